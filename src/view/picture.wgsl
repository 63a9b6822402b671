// Pictures on a graphics adapter; the same light as shade.rs, but for ambient occlusion. Host: picture.rs.
// View space: x right, y up, z away from the eye, m. Depth is near / z, as the rasteriser's inverse depth: larger is nearer.
// Colours are linear; sRGB is approximated by gamma 2.

struct Frame {
    right: vec4<f32>,         // axes of the camera
    up: vec4<f32>,
    forward: vec4<f32>,
    eye: vec4<f32>,           // m
    lens: vec4<f32>,          // x and y of the picture per x/z and y/z, near plane, m, share by which lines are nearer
    size: vec4<f32>,          // width, height, pixels; share by which what is in front is nearer; cells of a shadow's edge to either side
    clip: vec4<f32>,          // what is clipped remains where clip.xyz · x ≥ clip.w, m
    lights: array<vec4<f32>, 3>, // direction to the light, view space, and brightness; the first casts shadows
    ambient: vec4<f32>,       // from above, from below; background at the top, at the bottom
    map_u: vec4<f32>,         // axes of the shadow map, view space; w: its lower end, m
    map_v: vec4<f32>,
    map_w: vec4<f32>,
    map_scale: vec4<f32>,     // share of the map per m, across and in depth; cells along a side; m per cell
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var shadow: texture_depth_2d;
@group(1) @binding(1) var nearest: sampler_comparison;

fn to_view(x: vec3<f32>) -> vec3<f32> {
    let p = x - frame.eye.xyz;
    return vec3<f32>(dot(frame.right.xyz, p), dot(frame.up.xyz, p), dot(frame.forward.xyz, p));
}

fn project(p: vec3<f32>) -> vec4<f32> {
    return vec4<f32>(p.x * frame.lens.x, p.y * frame.lens.y, frame.lens.z, p.z);
}

// How a surface is drawn: 0 whole, 1 clipped by the plane, 2 in front of all others and without a shadow.
fn is_clipped(x: vec3<f32>, kind: f32) -> bool {
    return kind == 1.0 && dot(frame.clip.xyz, x) < frame.clip.w;
}

// Position in the shadow map: across from 0 to 1, and height towards the light from 0 to 1.
fn to_map(p: vec3<f32>) -> vec3<f32> {
    let across = vec2<f32>(dot(frame.map_u.xyz, p) - frame.map_u.w, dot(frame.map_v.xyz, p) - frame.map_v.w);
    return vec3<f32>(across * frame.map_scale.x, (dot(frame.map_w.xyz, p) - frame.map_w.w) * frame.map_scale.y);
}

// ------------------------------------------------------------------ background

struct Sky {
    @builtin(position) at: vec4<f32>,
}

@vertex
fn sky_vertex(@builtin(vertex_index) index: u32) -> Sky {
    // one triangle that covers the picture
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return Sky(vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0));
}

@fragment
fn sky(in: Sky) -> @location(0) vec4<f32> {
    let uv = in.at.xy / frame.size.xy;
    let grey = frame.ambient.z + (frame.ambient.w - frame.ambient.z) * uv.y * uv.y;
    let middle = uv - 0.5;
    let color = vec3<f32>(0.985, 0.995, 1.01) * (grey - 0.12 * dot(middle, middle));
    return vec4<f32>(sqrt(clamp(color, vec3<f32>(0.0), vec3<f32>(1.0))), 1.0);
}

// ------------------------------------------------------------------ shadow map

struct Cast {
    @builtin(position) at: vec4<f32>,
    @location(0) world: vec3<f32>,
    @location(1) @interpolate(flat) kind: f32,
}

@vertex
fn cast_vertex(@location(0) x: vec3<f32>, @location(3) material: vec2<f32>) -> Cast {
    let at = to_map(to_view(x));
    return Cast(vec4<f32>(at.x * 2.0 - 1.0, 1.0 - at.y * 2.0, at.z, 1.0), x, material.y);
}

@fragment
fn cast_shadow(in: Cast) {
    if is_clipped(in.world, in.kind) {
        discard;
    }
}

// where no plane clips: without a discard, depths are tested before the fragments are shaded
@fragment
fn cast_whole(in: Cast) {}

// ------------------------------------------------------------------ surfaces

struct Corner {
    @builtin(position) at: vec4<f32>,
    @location(0) x: vec3<f32>,      // view space, m
    @location(1) normal: vec3<f32>, // view space
    @location(2) color: vec3<f32>,
    @location(3) world: vec3<f32>,  // m
    @location(4) @interpolate(flat) material: vec2<f32>, // shininess, kind
}

@vertex
fn surface_vertex(
    @location(0) x: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec3<f32>,
    @location(3) material: vec2<f32>,
) -> Corner {
    let p = to_view(x);
    let n = vec3<f32>(dot(frame.right.xyz, normal), dot(frame.up.xyz, normal), dot(frame.forward.xyz, normal));
    var at = project(p);
    if material.y == 2.0 {
        at.z *= frame.size.z;
    }
    return Corner(at, p, n, color, x, material);
}

// Fraction of the first light that reaches a point; a shadow's edge is three cells wide, or one.
fn lit(p: vec3<f32>, normal: vec3<f32>) -> f32 {
    let at = to_map(p + normal * (2.0 * frame.map_scale.w));
    let cell = 1.0 / frame.map_scale.z;
    let around = i32(frame.size.w);
    var sum = 0.0;
    for (var row = -around; row <= around; row++) {
        for (var column = -around; column <= around; column++) {
            let offset = vec2<f32>(f32(column), f32(row)) * cell;
            sum += textureSampleCompareLevel(shadow, nearest, at.xy + offset, at.z);
        }
    }
    let inside = all(at.xy > vec2<f32>(cell)) && all(at.xy < vec2<f32>(1.0 - 3.0 * cell));
    let side = f32(2 * around + 1);
    return select(1.0, sum / (side * side), inside);
}

// Brightness of the surroundings in a mirror: a light ceiling, a darker floor, a soft lamp.
fn surroundings(direction: vec3<f32>, lamp: vec3<f32>) -> f32 {
    return 0.22 + 0.72 * smoothstep(-0.5, 0.5, direction.y) + 0.9 * smoothstep(0.55, 0.95, dot(direction, lamp));
}

@fragment
fn surface(in: Corner) -> @location(0) vec4<f32> {
    // derivatives before anything is discarded
    let across = cross(dpdx(in.x), dpdy(in.x));
    if is_clipped(in.world, in.material.y) {
        discard;
    }
    return shaded(in, across);
}

@fragment
fn surface_whole(in: Corner) -> @location(0) vec4<f32> {
    return shaded(in, cross(dpdx(in.x), dpdy(in.x)));
}

// Colour of a point of a face whose normal is along `across`.
fn shaded(in: Corner, across: vec3<f32>) -> vec4<f32> {
    let ray = normalize(in.x);
    var face = select(normalize(across), -ray, dot(across, across) == 0.0);
    face = select(face, -face, dot(face, ray) > 0.0);
    var normal = select(normalize(in.normal), face, dot(in.normal, in.normal) == 0.0);
    normal = select(normal, -normal, dot(normal, face) < 0.0);
    let shininess = in.material.x;
    let mirror = shininess * shininess / (shininess * shininess + 2500.0);
    var diffuse = frame.ambient.y + (frame.ambient.x - frame.ambient.y) * (0.5 + 0.5 * normal.y);
    var highlight = 0.0;
    for (var k = 0; k < 3; k++) {
        let to_light = frame.lights[k].xyz;
        var bright = frame.lights[k].w;
        if k == 0 {
            bright *= select(0.0, lit(in.x, face), dot(face, to_light) > 0.0);
        }
        let cosine = max(dot(normal, to_light), 0.0);
        diffuse += bright * cosine;
        let half = to_light - ray;
        let s = max(dot(normal, half) * inverseSqrt(max(dot(half, half), 1e-12)), 0.0);
        // Schlick 1994 in place of sⁿ
        highlight += bright * min(cosine, 0.25) * 4.0 * s / (shininess * (1.0 - s) + s);
    }
    let matt = in.color * diffuse * (1.0 - 0.75 * mirror);
    let seen = surroundings(reflect(ray, normal), frame.lights[0].xyz);
    let glossy = in.color * (mirror * seen) + highlight * (0.07 + 0.5 * mirror);
    return vec4<f32>(sqrt(clamp(matt + glossy, vec3<f32>(0.0), vec3<f32>(1.0))), 1.0);
}

// ------------------------------------------------------------------ lines: what is below, times an ink

struct Stroke {
    @builtin(position) at: vec4<f32>,
    @location(0) ink: vec3<f32>,
    @location(1) world: vec3<f32>,
    @location(2) @interpolate(flat) kind: f32,
}

@vertex
fn line_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) a: vec3<f32>,
    @location(1) b: vec3<f32>,
    @location(2) ink: vec3<f32>,
    @location(3) style: vec2<f32>, // width, pixels, and kind
) -> Stroke {
    let near = frame.lens.z;
    var p = to_view(a);
    var q = to_view(b);
    // the part before the near plane is left out
    if p.z < near && q.z > near {
        p = mix(p, q, (near - p.z) / (q.z - p.z));
    } else if q.z < near && p.z > near {
        q = mix(q, p, (near - q.z) / (p.z - q.z));
    }
    let ends = array<vec4<f32>, 2>(project(p), project(q));
    let pixels = 0.5 * frame.size.xy;
    let along = (ends[1].xy / ends[1].w - ends[0].xy / ends[0].w) * pixels;
    let side = vec2<f32>(-along.y, along.x) * inverseSqrt(max(dot(along, along), 1e-12));
    // two triangles: corners 0 1 2 and 2 1 3, the end by the second bit and the side by the first
    let corner = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u)[index];
    var at = ends[corner >> 1u];
    let sign = f32(corner & 1u) * 2.0 - 1.0;
    let moved = at.xy + side * (sign * 0.5 * style.x) / pixels * at.w;
    let nearer = select(1.0 + frame.lens.w, frame.size.z, style.y == 2.0);
    at = vec4<f32>(moved, at.z * nearer, at.w);
    return Stroke(at, ink, select(a, b, (corner >> 1u) == 1u), style.y);
}

@fragment
fn line(in: Stroke) -> @location(0) vec4<f32> {
    if is_clipped(in.world, in.kind) {
        discard;
    }
    return vec4<f32>(sqrt(in.ink), 1.0);
}
