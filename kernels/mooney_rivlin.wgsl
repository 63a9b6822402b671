// The Mooney–Rivlin law at a Gauss point; see mooney_rivlin.rs (formula and units there).
struct Invariants { f: mat3x3<f32>, s: mat3x3<f32>, second: f32, i1: f32, i2: f32 }

fn invariants(p: Point) -> Invariants {
    let e = green(p);
    let trace = e[0].x + e[1].y + e[2].z;
    let squares = dot(e[0], e[0]) + dot(e[1], e[1]) + dot(e[2], e[2]);
    let second = 0.5 * (trace * trace - squares);
    return Invariants(identity() + p.h, identity() * trace - e, second, trace / 3.0, (2.0 * trace + second) / 3.0);
}

// J^(−2/3), its own tangent below J = EXTENDED.
struct Isochoric { scale: f32, beyond: f32, log_gradient: mat3x3<f32>, complement: mat3x3<f32> }

fn isochoric(p: Point) -> Isochoric {
    let volume = 1.0 + p.dilatation;
    let whole = log_volume(p.dilatation);
    if volume >= EXTENDED { return Isochoric(exp(-2.0 / 3.0 * whole.x), whole.y, p.log_gradient, p.complement); }
    let grown = 1.0 + 2.0 / 3.0 * (EXTENDED - volume) / EXTENDED;
    let extended = -2.3025851 - 1.5 * log(grown);
    let gradient = p.log_gradient * (1.0 / grown);
    return Isochoric(4.6415888 * grown, p.dilatation - extended, gradient, identity() - gradient);
}

fn mooney_rivlin_energy(c: vec2<f32>, p: Point) -> f32 {
    let v = invariants(p);
    let left = contracted(p.h, p.h) - 2.0 * p.second_order;
    let beyond = isochoric(p).beyond;
    let x1 = left / 3.0 - logarithm(v.i1).y + beyond * 2.0 / 3.0;
    let x2 = left * 2.0 / 3.0 + v.second / 3.0 - logarithm(v.i2).y + beyond * 4.0 / 3.0;
    return 3.0 * (c.x * exponential(x1) + c.y * exponential(x2));
}

fn mooney_rivlin_stress(c: vec2<f32>, p: Point) -> mat3x3<f32> {
    let v = invariants(p);
    let own = isochoric(p);
    let scale = own.scale;
    let difference = p.h + own.complement;
    let p1 = difference - own.log_gradient * v.i1;
    let p2 = difference * 4.0 + v.f * v.s * 2.0 - own.log_gradient * (4.0 * v.i2);
    return p1 * (2.0 * c.x * scale) + p2 * (c.y * scale * scale);
}

fn mooney_rivlin_stiffening(c: vec2<f32>, p: Point, g: f32) -> f32 {
    let v = invariants(p);
    let scale = isochoric(p).scale;
    let stretched = max(contracted(v.f, v.f) / 3.0 - 1.0, 0.0);
    let second = max(1.5 * (1.0 + v.i2) * g - 0.5 + stretched, 1.0);
    return (c.x * scale * (1.0 + v.i1) * g + c.y * scale * scale * second) / (c.x + c.y);
}

fn mooney_rivlin_tangent(c: vec2<f32>, p: Point, change: mat3x3<f32>) -> mat3x3<f32> {
    let v = invariants(p);
    let own = isochoric(p);
    let scale = own.scale;
    let t = contracted(own.log_gradient, change);
    let along = contracted(v.f, change);
    let crossed = own.log_gradient * transpose(change) * own.log_gradient;
    let difference = p.h + own.complement - own.log_gradient * v.i1;
    let d1 = change - difference * (2.0 / 3.0 * t) - own.log_gradient * (2.0 / 3.0 * along) + crossed * (1.0 + v.i1);
    let inner = identity() * 2.0 + v.s;
    let d = v.f * inner;
    let q = d * 2.0 - own.log_gradient * (4.0 * (1.0 + v.i2));
    let dc = transpose(change) * v.f + transpose(v.f) * change;
    let dd = v.f * (2.0 * along) + change * inner - v.f * dc;
    let d2 = q * (-4.0 / 3.0 * t) + dd * 2.0 - own.log_gradient * (8.0 / 3.0 * contracted(d, change)) + crossed * (4.0 * (1.0 + v.i2));
    return d1 * (2.0 * c.x * scale) + d2 * (c.y * scale * scale);
}
