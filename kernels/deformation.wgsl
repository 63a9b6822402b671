// Deformation at a Gauss point; see deformation.rs (formula and units there).
const NEAR: f32 = 0.78867513; // (1 + 1/√3)/2
const FAR: f32 = 0.21132487;

const EXTENDED: f32 = 0.1; // volume ratio

struct Point {
    h: mat3x3<f32>,
    dilatation: f32,
    second_order: f32,
    cofactor: mat3x3<f32>,
    complement: mat3x3<f32>,
    log_gradient: mat3x3<f32>,
}

fn shape_gradient(inverse_edges: vec3<f32>, a: u32, p: u32) -> vec3<f32> {
    let own = corner(a);
    let weight = select(vec3<f32>(FAR), vec3<f32>(NEAR), own == corner(p));
    let sign = select(vec3<f32>(-1.0), vec3<f32>(1.0), own == vec3<u32>(1u));
    return sign * weight.yxx * weight.zzy * inverse_edges;
}

// Σ A_ij B_ij
fn contracted(a: mat3x3<f32>, b: mat3x3<f32>) -> f32 {
    return dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2]);
}

fn identity() -> mat3x3<f32> {
    return diagonal(vec3<f32>(1.0));
}

fn field_gradient(inverse_edges: vec3<f32>, at: array<vec3<f32>, 8>, p: u32) -> mat3x3<f32> {
    var values = at;
    var sum = mat3x3<f32>();
    for (var a = 1u; a < 8u; a += 1u) {
        sum += outer(values[a] - values[0], shape_gradient(inverse_edges, a, p));
    }
    return sum;
}

fn point_of(h: mat3x3<f32>) -> Point {
    let a = h[0]; let b = h[1]; let c = h[2];
    let minors = (a.x * b.y - b.x * a.y) + (a.x * c.z - c.x * a.z) + (b.y * c.z - c.y * b.z);
    let second_order = minors + dot(a, cross(b, c));
    let dilatation = a.x + b.y + c.z + second_order;
    let f = identity() + h;
    let cofactor = mat3x3<f32>(cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1]));
    let slope = log_volume_slope(dilatation);
    let log_gradient = cofactor * slope;
    let own = mat3x3<f32>(cross(b, c), cross(c, a), cross(a, b));
    var complement = identity() - log_gradient;
    if 1.0 + dilatation >= EXTENDED { complement = (identity() * second_order + transpose(h) - own) * slope; }
    return Point(h, dilatation, second_order, cofactor, complement, log_gradient);
}

// C − 1
fn green(p: Point) -> mat3x3<f32> { return p.h + transpose(p.h) + transpose(p.h) * p.h; }

fn is_inverted(point: Point) -> bool {
    let volume = 1.0 + point.dilatation;
    return !(volume > 0.0 && volume < 1e38); // a comparison with NaN is false
}

// ln(1 + g) and g − ln(1 + g).
fn logarithm(g: f32) -> vec2<f32> {
    let s = g / (2.0 + g);
    if abs(s) > 1.0 / 3.0 {
        let ln = log(1.0 + g);
        return vec2<f32>(ln, g - ln);
    }
    let t = s * s;
    var tail = 0.0;
    for (var n = 12u; n > 0u; n -= 1u) { tail = tail * t + 1.0 / f32(2u * n + 1u); }
    tail = 2.0 * s * t * tail;
    return vec2<f32>(2.0 * s + tail, s * g - tail);
}

// φ(1 + g) and g − φ, φ = ln J extended below J = EXTENDED.
fn log_volume(g: f32) -> vec2<f32> {
    let volume = 1.0 + g;
    if volume >= EXTENDED { return logarithm(g); }
    let ln = -2.3025851 + (volume - EXTENDED) / EXTENDED;
    return vec2<f32>(ln, g - ln);
}

// φ'(1 + g).
fn log_volume_slope(g: f32) -> f32 {
    return 1.0 / max(1.0 + g, EXTENDED);
}

// φ'² + φ φ''.
fn log_volume_stiffness(g: f32) -> f32 {
    let volume = 1.0 + g;
    return select(1.0 / (EXTENDED * EXTENDED), (1.0 - log_volume(g).x) / (volume * volume), volume >= EXTENDED);
}

// φ φ' at a mean dilatation.
fn volume_pressure(mean: f32) -> f32 {
    return log_volume(mean).x * log_volume_slope(mean);
}

// φ'² + φ φ'', at least (0.6 − ln J̄/5) φ'², above a tenth.
fn volume_stiffness(mean: f32) -> f32 {
    let slope = log_volume_slope(mean);
    let least = clamp(0.6 - 0.2 * log_volume(mean).x, 0.1, 0.6);
    return max(log_volume_stiffness(mean), least * slope * slope);
}

// exp(x) − 1.
fn exponential(x: f32) -> f32 {
    if abs(x) > 0.25 { return exp(x) - 1.0; }
    var sum = 0.0;
    for (var n = 12u; n > 0u; n -= 1u) { sum = (x + x * sum) / f32(n); }
    return sum;
}
