//! Every kernel against its twin on random bodies, and the same with a kernel broken on purpose, which must be found out.
//!
//! `|gpu − twin| ≤ (ORDER + 1) e` for each number, with `e` from the twin on [`Bounded`]: the twin itself may be off by `e`, the GPU by
//! `ORDER e`. Where `e` is zero (untouched words, copies, integers) both must be equal.

use super::Failure;
use super::body::{Array, Body, NO_HIT};
use super::bounded::{Bounded, uncertain_comparisons};
use super::twins::{self, Outputs, rhs_sums};
use cutis::gpu::{Access, Buffer, Gpu, Shader, cast};
use cutis::kernels::tetrahedra::matrix;
use cutis::kernels::{self, GROUP, Source};
use cutis::math::{M3, V3, rotation_matrix};
use std::collections::BTreeMap;

/// Sums of three terms (`dot`, matrix times vector) may be associated either way; that at most doubles their roundings.
const ORDER: f64 = 2.0;
/// Roundings on the way from displacements to the gradient of `tr(Rᵀ F)`: 8 terms of 2 in F, 10 in R, 3 in RᵀF, 1 in the
/// difference, each up to 2 ulp with WGSL's rounding in either direction; and what is left when Newton stops at `|ω|² < ulp`.
const NEWTON_ROUNDINGS: f64 = 64.0;
/// The same from a mean over tetrahedra: 24 terms of 2 in F and 24 in the volume, a product and a quotient.
const MEAN_ROUNDINGS: f64 = 180.0;

/// What a dispatch covers.
#[derive(Clone, Copy)]
enum Threads {
    Nodes,
    Cells,
    Tiles,
    Touched,
    Tetrahedra,
    Domains,
    Bounds,
    Columns,
    Segments,
    Ids,
    One,
}

/// A kernel with its twin in both precisions, its dispatch, and ways to break its text.
pub struct Case {
    /// The kernel.
    pub source: &'static Source,
    single: fn(&Body) -> Outputs<f32>,
    bounded: fn(&Body) -> Outputs<Bounded>,
    threads: Threads,
    by_rhs: bool,
    breaks: &'static [(&'static str, &'static str)],
}

macro_rules! cases {
    ($($name:ident $threads:ident $by_rhs:literal [$($from:literal => $to:literal),+])*) => {
        &[$(Case {
            source: &kernels::$name::SOURCE,
            single: twins::$name::<f32>,
            bounded: twins::$name::<Bounded>,
            threads: Threads::$threads,
            by_rhs: $by_rhs,
            breaks: &[$(($from, $to)),+],
        }),*]
    };
}

const CASES: &[Case] = cases! {
    accelerate Nodes false [
        "dofs[i].w * params.inertia" => "params.inertia", "1.0 / inertia" => "inertia", "* dofs[i].xyz" => ""
    ]
    ahead Nodes false ["* params.lead_time" => "* params.step", "u[i].xyz + v" => "v", "u[i].xyz + v" => "u[i].xyz - v"]
    advance One true [
        "delta - head.y * gamma / head.x" => "delta + head.y * gamma / head.x",
        "tail.y <= tail.x" => "tail.y < 0.0",
        "n += LANES" => "n += LANES + 1u", "starting && n < groups" => "starting && n < 1u",
        "if n < params.product_groups" => "if n + 1u < params.product_groups", "if n < column_groups" => "if n < 1u",
        "if n < groups" => "if n < 1u", "sum += part;\n            lane_sum[lane] = sum" => "lane_sum[lane] = part",
        "max(request.x * reference, request.z)" => "min(request.x * reference, request.z)",
        "denominator > 0.0 &&" => "denominator != 0.0 &&",
        "request.w == 2.0" => "request.w == 3.0", "max(tail.x, request.x * sums.w)" => "tail.x"
    ]
    rest_springs Ids false [
        "* spring_stiffness[k]" => "* spring_stiffness[0]", "* dofs[i].xyz" => "", "let i = ids[k]" => "let i = k", "b[i].xyz - u" => "b[i].xyz + u"
    ]
    auxiliary_correction Nodes true [
        "+ weighted[n]" => "", "* weight[n]" => "", "* dofs[i].xyz" => "", "rhs * (arrayLength(&auxiliary_z) / params.rhs_count)" => "rhs * params.node_count",
        "n < first_weight[i + 1u]" => "n + 1u < first_weight[i + 1u]", "w[at] = vec4<f32>(0.0)" => "w[at] = z[at]", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    auxiliary_restriction Nodes true [
        "+ around[n]" => "", "* weight_around[n]" => "", "* auxiliary_dofs[i].xyz" => "", "rhs * (arrayLength(&r) / params.rhs_count)" => "rhs * params.node_count",
        "n < first_around[i + 1u]" => "n + 1u < first_around[i + 1u]", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    auxiliary_rotations Cells false [
        "node_rotation[in_cell[n]]" => "node_rotation[n]", "select(q, -q," => "select(q, q,", "scale[cell] / sqrt" => "1.0 / sqrt", "if squared > 0.0" => "if squared > 9.0",
        "n < first_of_cell[cell + 1u]" => "n + 1u < first_of_cell[cell + 1u]"
    ]
    trial_point Nodes false [
        "* params.gain" => "", "u[i].xyz + moved" => "moved", "dot(residual_force[i].xyz" => "dot(dx[i].xyz", "moved * params.stiffness_factor" => "moved", "n = GROUP / 2u" => "n = GROUP / 4u"
    ]
    blocks Nodes false [
        "first + (a | 4u)" => "first + a", "if a < 4u" => "if a < 3u", "layer_of[at.z] * 64u" => "0u",
        "all(c < vec3" => "all(c + 1u < vec3", "corner_node(params, at, a) != i" => "false", "a < 4u && chained" => "a < 4u",
        "select(2.0, 1.0, chained)" => "1.0", "above(params, other) == i" => "true", "i + bundle(p, (i - columns * p.nodes_z) / p.nodes_z).y" => "i + BUNDLE", "dofs[over].xyz" => "dofs[i].xyz",
        "own += stiffness_between(cell, a, a)" => "", "upper += stiffness_between(cell, a, a | 4u)" => "", "outer(s_b, s_a)" => "outer(s_a, s_b)", "squares.y * (xy + yz + all)" => "squares.y * (xy + yz)", "params.corotational >= HYPERELASTIC" => "false", "* sign.y" => "* sign.z"
    ]
    bounds Bounds false [
        "last - first + 1u" => "last - first", "max(high, d)" => "min(high, d)", "low.w += 1.0" => "low.w += 0.0", "n += GROUP" => "n += 2u * GROUP",
        "n = GROUP / 2u" => "n = GROUP / 4u", "tile / tiles.x" => "tile / tiles.x / 2u", "min(first + TILE," => "max(first,",
        "params.cells_x == 0u" => "false", "if tile >= of_grid { i" => "if false { i", "BUNDLE: u32 = 32u" => "BUNDLE: u32 = 64u", "vec2<u32>((tile - of_grid) * TILE, 0u)" => "vec2<u32>(0u, 0u)"
    ]
    centres Cells false ["sum * 0.125" => "sum * 0.126", "corner_node(params, at, k)" => "node_id(params, at + corner(k))"]
    coarsen Cells false [
        "0.25 * share" => "share", "select(weight, -weight," => "select(weight, weight,",
        "x >= params.cells_x ||" => "", "weight = squared *" => "weight =", "child & 1u" => "child & 0u",
        "+ n] * (squared * squared)" => "+ n] * squared", "2.0 * mean" => "mean", "3u * cell;" => "2u * cell;", "if share > 0.0" => "if share > 9.0"
    ]
    collect Nodes false ["a * 3u;" => "3u;", "|| corner_node(params, at, a) != i" => "", "corner_force[k + 1u]" => "corner_force[k]", "all(c < vec3" => "all(c + 1u < vec3"]
    collect_product Nodes true [
        "* params.stiffness_factor" => "", "* dofs[i].xyz" => "", "rhs * params.cell_count * 24u" => "0u", "w[at].xyz + more" => "more",
        "scalars[rhs * 2u].w == 0.0" => "true", "n = GROUP / 2u" => "n = GROUP / 4u", "corner_force[k + 1u]" => "corner_force[k]"
    ]
    converge One true [
        "n < groups" => "n < 1u", "residual <=" => "residual >", "scalars[rhs * 2u].w == 0.0" => "true"
    ]
    cut Segments false [
        "quads[k * 4u + 3u]" => "quads[k * 4u + 1u]", "b0 - p0" => "b0 - p1", "0.5 - 0.5 *" => "0.5 + 0.5 *",
        "n < 12u" => "n < 11u", "face.x + face.z]" => "face.x + face.y]", "(other.x > 0.0)" => "(other.x > 1e-3)",
        "* (p.z / (p.z - q.z))" => "* 0.5", "(y / (y - other.x))" => "0.5", "both.x - both.y" => "both.x + both.y",
        "point_before[second]" => "point_before[first]", "+ (c[6] - c[4])" => ""
    ]
    defect Nodes false [
        "x[i].xyz * (params" => "f[i].xyz * (params", "* dofs[i].w" => "", "/ params.stiffness_factor" => "", "f_end[i].xyz - f[i].xyz" => "f_end[i].xyz + f[i].xyz",
        "w[i].xyz - inertia" => "w[i].xyz", "linear - change" => "linear + change", "* dofs[i].xyz" => "", "b[i].xyz + " => ""
    ]
    duplicate Ids true [
        "k >= params.count" => "k >= params.count / 2u", "pairs[k].y]" => "pairs[0].y]", "thread.group.y * params.stride" => "params.stride"
    ]
    factor Columns false ["own.d - below" => "own.d + below", "i1 - l21 * yz" => "i1 + l21 * yz", "l10 * l21 - l20" => "l10 * l21 + l20", "transpose(own.g) * g" => "own.g * g", "own.x) * p.nodes_z" => "0u) * p.nodes_z", "e - own.x;" => "e;"]
    forces Nodes false [
        "- 0.5" => "- 0.4", "a * 8u + b" => "b * 8u + a", "own) * r" => "own) * transpose(r)", "|| corner_node(params, at, a) != i" => "", "u[corner_node(params, at, b)]" => "u[node_id(params, at + corner(b))]",
        "change * x + e * x" => "change * x", "pre_strain[layer]" => "pre_strain[0]"
    ]
    gather Ids false [
        "source[ids[k]]" => "source[k]", "params.first + number_of" => "number_of", "params.first + params.count" => "params.count"
    ]
    integrate Nodes false ["rhs_count > 1u" => "rhs_count > 99u", "x[i] = " => "let total = ", "params.velocity_factor / params.step" => "1.0 / params.step", "- kept" => "", "params.velocity_factor - 1.0" => "params.velocity_factor"]
    momentum Nodes false [
        "near.y * near.z" => "near.y", "sum * rate" => "sum", "v[corner_node(params, at, b)].xyz - own" => "v[corner_node(params, at, b)].xyz", "|| corner_node(params, at, a) != i" => "", "shape[layer_of[at.z]]" => "shape[0]",
        "all(c < vec3" => "all(c + 1u < vec3", "== vec4<f32>(0.0)) ||" => "== vec4<f32>(9.0)) ||"
    ]
    hyperelastic_forces Cells false [
        "0.78867513" => "0.7887", "weight.zzy" => "weight.zyy", "values[a] - values[0]" => "values[a]", "+ dot(a, cross(b, c))" => "",
        "cross(f[1], f[2]), cross(f[2], f[0])" => "cross(f[1], f[2]), cross(f[0], f[2])", "layer_of[at.z]" => "0u",
        "(p.h + p.complement) * mu" => "p.h * mu", "transpose(h) - own" => "transpose(h)", "squares - 2.0 * p.second_order" => "squares", "volume_gradient[a] * pressure" => "volume_gradient[a]",
        "inverted || is_inverted(point)" => "false", "own.material.x * log_mean * log_volume_slope(mean)" => "own.material.x * log_mean",
        "all(rotation[cell] == vec4<f32>(0.0))" => "false", "displacement[corner_node(params, own.at, a)]" => "displacement[node_id(params, own.at + corner(a))]", "1.0 / max(1.0 + g, EXTENDED)" => "1.0 / (1.0 + g)",
        "contracted(point.log_gradient, point.log_gradient) - 2.0" => "contracted(point.log_gradient, point.log_gradient) - 2.1", "(24.0 * shear)" => "(27.0 * shear)", "- 0.125 * contracted(beyond, beyond)" => "", "corner(a)[n] == 0u" => "corner(a)[n] == 1u", "(row * r) * scale" => "(r * row) * scale", "8.0 * own.weight * factor" => "8.0 * own.weight", "trace / 3.0 + sqrt(deviator / 6.0)" => "trace / 3.0", "most_drawn / factor" => "most_drawn", "0.0625 / (own.weight" => "0.125 / (own.weight", "contracted(mean, turn)" => "contracted(mean, identity())", "params.cell_count + 3u * cell + n" => "params.cell_count + 3u * cell", "-pressure / (2.0 *" => "-pressure / (1.0 *",
        "longest / 3.0" => "longest / 2.0", "* volume_stiffness(mean) * uneven" => "* uneven", "(1.0 + e) / shape" => "1.0 / shape", "diagonal(cell.pre_strain) +" => "", "strained.z, 1.0" => "1.0, 1.0", "sqrt(sqrt(factor))" => "sqrt(factor)",
        "4.0 * own.material.x" => "own.material.x", "f32(2u * n + 1u)" => "f32(2u * n)", "let ln = log(1.0 + g)" => "let ln = g", "s * g - tail" => "s * g",
        "material.w == MOONEY_RIVLIN" => "false", "difference - own.log_gradient * v.i1" => "difference", "v.f * v.s * 2.0" => "v.f * v.s", "own.log_gradient * (4.0 * v.i2)" => "own.log_gradient * (2.0 * v.i2)", "4.6415888 * grown" => "4.6415888", "p.log_gradient * (1.0 / grown)" => "p.log_gradient", "- 1.5 * log(grown)" => "",
        "exp(-2.0 / 3.0" => "exp(-1.0 / 3.0", "p2 * (c.y * scale * scale)" => "p2 * (c.y * scale)", "c.x * scale * (1.0 + v.i1) * g + c.y * scale * scale * second" => "c.x * scale * (1.0 + v.i1) * g", "1.5 * (1.0 + v.i2) * g" => "1.5 * (1.0 + v.i2)", "contracted(v.f, v.f) / 3.0 - 1.0" => "contracted(v.f, v.f) - 1.0", "left * 2.0 / 3.0" => "left / 3.0", "beyond * 4.0 / 3.0" => "beyond",
        "contracted(p.h, p.h) - 2.0 * p.second_order" => "contracted(p.h, p.h)", "(x + x * sum) / f32(n)" => "(x + x * sum)", "trace * trace - squares" => "trace * trace",
        "if material.w == HOLZAPFEL" => "if false", "own.material.w == HOLZAPFEL" => "false", "directions.zw, family == 1u" => "directions.zw, family == 2u", "1.0 - 3.0 * fibres.dispersion" => "1.0 - 2.0 * fibres.dispersion", "identity() * fibres.dispersion +" => "", "if stretched <= 0.0" => "if stretched <= -1.0",
        "sqrt(MOST_EXPONENT / fibres.growth)" => "1.0", "/ (2.0 * fibres.growth) * grown" => "* grown", "0.5 * curvature * beyond" => "curvature * beyond", "slope + curvature * beyond, curvature" => "slope, curvature", "first.structure * (2.0 *" => "first.structure * (1.0 *",
        "+ second.structure * (2.0 * second.slope)" => "", "e * own.structure * 0.5" => "e * own.structure", "- own.structure * grown" => "", "/ fibres.stiffness - 1.0" => "/ fibres.stiffness", "(1.0 - 2.0 * fibres.dispersion)" => "1.0", "fibres[2u * layer + 1u]" => "fibres[1u]", "volume + sheared + fibrous" => "volume + sheared",
        "force[a][n] * times" => "force[a][n]", "log_mean) * times" => "log_mean)", "* sqrt(sqrt(times))" => "", "min(cell, arrayLength(&scale) - 1u)" => "0u"
    ]
    hyperelastic_tangent Cells true [
        "values[a] - values[0]" => "values[a]", "layer_of[at.z]" => "0u", "transpose(change) * log_gradient" => "change * log_gradient", "- crossed * kirchhoff_pressure" => "", "kirchhoff_pressure * relative_change" => "kirchhoff_pressure",
        "(change + p.log_gradient" => "(change - p.log_gradient", "if material.w == MOONEY_RIVLIN { return mooney_rivlin_tangent" => "if false { return mooney_rivlin_tangent", "difference * (2.0 / 3.0 * t)" => "difference * t", "(2.0 / 3.0 * along)" => "(along)",
        "crossed * (1.0 + v.i1)" => "crossed", "v.f * (2.0 * along)" => "v.f * along", "- v.f * dc" => "", "q * (-4.0 / 3.0 * t)" => "q * t",
        "8.0 / 3.0" => "4.0 / 3.0", "crossed * (4.0 * (1.0 + v.i2))" => "crossed * 4.0", "transpose(change) * v.f" => "change * v.f",
        "(1.0 - log_volume(g).x)" => "1.0", "(volume * volume)" => "volume", "own.weight * jacobian * relative_change" => "own.weight * relative_change",
        "scalars[rhs * 2u].w != 0.0" => "false", "rhs * params.node_count" => "0u", "(rhs * params.cell_count + cell)" => "cell",
        "inverted || is_inverted(point)" => "false", "+ volume_gradient[a] * pressure_change" => "",
        "if material.w == HOLZAPFEL { return holzapfel_tangent" => "if false { return holzapfel_tangent", "sum += change * own.structure * (2.0 * own.slope) +" => "sum +=", "4.0 * own.curvature *" => "own.curvature *", "contracted(pull, change)" => "contracted(own.structure, change)", "(1.0 + 2.0 * exponent)" => "1.0",
        "out[n] * times" => "out[n]", "min(cell, arrayLength(&scale) - 1u)" => "0u"
    ]
    precondition Columns true [
        "- own.g * above" => "+ own.g * above", "n = GROUP / 2u" => "n = GROUP / 4u",
        "scalars[rhs * 2u].w == 0.0" => "true", "dot(r[offset + i].xyz, take" => "dot(above, take"
    ]
    prescribe Ids false ["let i = ids[k]" => "let i = k", "- u[i].xyz" => "+ u[i].xyz", "== vec3<f32>(0.0)" => "== vec3<f32>(1.0)"]
    probe One false ["(sum - a," => "(sum - b,", "+ hidden(b - part" => "- hidden(b - part"]
    product Tiles true [
        "params.inertia * dofs[i].w" => "params.inertia", "n = GROUP / 2u" => "n = GROUP / 4u",
        "scalars[rhs * 2u].w == 0.0" => "true", "a1 = v[0] - v[1]" => "a1 = v[0] + v[1]",
        "g3 = modes[first + 3u]" => "g3 = modes[first + 2u]", "r * f7" => "transpose(r) * f7",
        "vec3<f32>(l7.x, l4.y, l2.z)" => "vec3<f32>(l7.x, l4.y, l3.z)", "(below + above)" => "(above)",
        "corner_force[129u + lane]" => "corner_force[130u + lane]",
        "layer_of[k] * 8u" => "0u", "tile / tiles.x % tiles.y" => "tile / tiles.x", "max(first, 1u) - 1u" => "first", "min(last, params.cells_z)" => "params.cells_z - 1u", "params.first_rhs + thread.group.y" => "thread.group.y + 1u", "if !is_split(params, cell)" => "if true",
        "params.corotational >= HYPERELASTIC" => "false", "dot(y2, l2)" => "dot(y2, l4)", "f4 += y4 * change" => "f4 += y2 * change", "let spin = 0.5 *" => "let spin =", "f2 += cross(spin" => "f2 -= cross(spin", "vec3<f32>(k.y, k.x, k.x + k.y) * l3" => "vec3<f32>(k.x, k.y, k.x + k.y) * l3", "vec3<f32>(k.y + k.z, k.z, k.y) * l6" => "vec3<f32>(k.z, k.z, k.y) * l6", "/ 3.0 * l7" => "/ 9.0 * l7"
    ]
    prolongation Nodes true [
        "0.25 *" => "0.5 *", "dofs[i].xyz" => "dofs[0].xyz", "rhs * size.x" => "0u * size.x", "x % 2u" => "y % 2u", "let at = grid_coordinates(params, i)" => "let at = node_at(params, i)",
        "|| scalars[rhs * 2u].w != 0.0" => ""
    ]
    relax Columns true [
        "- own.g * above" => "+ own.g * above", "n = GROUP / 2u" => "n = GROUP / 4u", "* params.keep" => "* params.gain",
        "params.fresh == 1u" => "false", "params.fresh == 0u" => "true",
        "scalars[rhs * 2u].w == 0.0" => "true", "z[at].xyz + change" => "change", "- w[at].xyz" => ""
    ]
    residual Nodes false [
        "(elastic - before)" => "elastic", "- w[i].xyz - (" => "- (", "* dofs[i].xyz" => "", "* 0.5" => "",
        "(b[i].xyz + before)" => "b[i].xyz", "dot(left, left)" => "dot(left, pull)", "elastic + left" => "elastic - left", "n = GROUP / 2u" => "n = GROUP / 4u"
    ]
    restriction Nodes true [
        "0.5, 1.0, x == at.x + 1u" => "0.5, 1.0, x == at.x", "0.5, 1.0, y == at.y + 1u" => "0.5, 1.0, y == at.y", "- w[node].xyz" => "+ w[node].xyz", "x > params.nodes_x ||" => "",
        "coarse_dofs[i].xyz" => "coarse_dofs[0].xyz", "while next != 0u" => "while next != 0u && false", "level * own.y" => "level",
        "next = split[params.extra_columns + next - 1u]" => "next = 0u", "|| scalars[rhs * 2u].w != 0.0" => ""
    ]
    rhs Nodes false [
        "elastic + v[i].xyz" => "elastic - v[i].xyz", "dot(reaction, reaction)" => "dot(reaction, sum)", "n > 0u" => "n > 1u"
    ]
    rotations Cells false ["u[corner_node(params, at, a)]" => "u[node_id(params, at + o)]", "* 2.0 - 1.0" => "* 2.0 - 1.001", "t - s[1].y" => "t + s[1].y", "MAX_NEWTON: u32 = 64u" => "MAX_NEWTON: u32 = 1u"]
    scatter Ids false ["destination[ids[k]] =" => "destination[k] =", "params.add == 1u" => "params.add == 2u"]
    split_product Touched true [
        "!is_split(params, cell) ||" => "", "|| corner_node(params, at, a) != i" => "", "if !of_grid { out" => "if of_grid { out",
        "if of_grid { out +=" => "if false { out +=", "* 64u + a * 8u" => "* 64u", "n = GROUP / 2u" => "n = GROUP / 4u", "scalars[rhs * 2u].w == 0.0" => "true",
        "parent % p.nodes_x" => "0u", "within / own.y" => "0u", "rest - own.x * p.nodes_z" => "rest", "out *= dofs[i].xyz" => "out *= dofs[0].xyz", "- own) * r;" => "- own) * transpose(r);", "{ local += stiffness_between(cell, a, b) * moved; }" => "{ }", "* sign.y" => "* sign.z"
    ]
    springs Nodes false [
        "max(stretch, 0.0)" => "stretch", "sum -= d" => "sum += d", "own.x + elongation" => "elongation",
        "span + span + shift, shift" => "span + span, shift", "length > 0.0" => "true"
    ]
    springs_blocks Nodes false ["g -= t" => "g += t", "== above" => "== i"]
    springs_product Nodes true [
        "(own - z" => "(own + z", "n = GROUP / 2u" => "n = GROUP / 4u", "scalars[rhs * 2u].w == 0.0" => "true"
    ]
    tetrahedra_blocks Nodes false [
        "* transpose(r)" => "* r", "node_rotation[i]" => "node_rotation[0]", "2u * i + 1u" => "2u * i", "params.stiffness_factor, params" => "1.0, params"
    ]
    tetrahedra_centres Tetrahedra false ["sum * 0.25" => "sum * 0.26", "u[c.w].xyz" => "u[c.z].xyz", "corners[e]" => "corners[0]"]
    tetrahedra_changes Tetrahedra true [
        "corners[e] + rhs * params.node_count" => "corners[e]", "cofactor[3u * e + 2u].xyz, change[2]" => "cofactor[3u * e + 2u].xyz, change[1]",
        "rhs * params.tetrahedron_count + e" => "e", "scalars[rhs * 2u].w != 0.0" => "false", "change[0], grown" => "change[0], 0.0"
    ]
    tetrahedra_deformations Tetrahedra false [
        "u[c.w].xyz" => "u[c.z].xyz", "point.h[0], point.dilatation" => "point.h[0], 0.0", "point.cofactor[1], 0.0" => "point.cofactor[2], 0.0",
        "dot(a, cross(b, c))" => "0.0", "gradients[3u * e].w)" => "0.0)"
    ]
    tetrahedra_domains Domains true [
        "1.0 / shear[k].x" => "1.0", "of_domain[n] / 4u" => "of_domain[n] / 5u", "if total == 1u { a" => "if false { a", "shear[k].y * (1.0 / 3.0)" => "shear[k].y",
        "trace(strain) * (1.0 / 3.0)" => "trace(strain)", "(a + transpose(a)) * 0.5" => "a", "gradients[3u * e].w * per_volume" => "per_volume",
        "rhs * params.domain_count + k" => "k", "rhs * params.tetrahedron_count + e" => "e", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    tetrahedra_forces Nodes false ["sum -= tet" => "sum += tet", "at + a - 1u" => "at", "of_node[n] % 4u" => "1u", "of_node[n] / 4u" => "of_node[n] / 5u"]
    tetrahedra_frames Domains true [
        "* factors.w" => "", "of_domain[n] / 4u" => "of_domain[n] / 5u", "factors.y * trace(change)" => "factors.y", "(change - transpose(change))" => "(change + transpose(change))",
        "factors.z * 0.5" => "factors.z", "domain_rotation[k]" => "domain_rotation[0]", "rhs * params.domain_count + k" => "k",
        "rhs * params.tetrahedron_count + e" => "e", "scalars[rhs * 2u].w != 0.0" => "false", "frame[k]" => "frame[0]"
    ]
    tetrahedra_large Tetrahedra true [
        "* 0.25" => "", "EDGES: u32 = 6u" => "EDGES: u32 = 5u", "domains[EDGES * e + n]" => "domains[n]", "* gradients[3u * e].w" => "",
        "rhs * params.domain_count" => "0u", "rhs * params.node_count" => "0u", "cofactor[3u * e + 1u]" => "cofactor[3u * e]", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    tetrahedra_laws Domains false [
        "1.0 / shear[k].x" => "1.0", "of_domain[n] / 4u" => "of_domain[n] / 5u", "u32(shear[k].y)" => "0u", "found * sixth" => "found", "2.0 * (material.y + material.z)" => "(material.y + material.z)",
        "params.corotational == STIFFENED" => "false", "log_gradient) - 2.0" => "log_gradient)", "-pressure / (2.0 * modulus)" => "0.0", "squared, 3.0) / 3.0" => "squared, 3.0)",
        "- 1.0) / params.stiffness_factor" => "- 1.0)", "point.cofactor * pressure" => "point.cofactor", "domain_rotation[k]" => "domain_rotation[0]", "deviator / 6.0" => "deviator",
        "law_of_trace(law) * modulus" => "modulus", "tension * sixth, per_volume" => "tension * sixth, 0.0"
    ]
    tetrahedra_means Nodes false [
        "volume += own" => "volume = own", "members[n] / 4u" => "members[n] / 5u", "strain[3u * e + 2u]" => "strain[3u * e + 1u]", "diagonal(vec3<f32>(1.0)) +" => "",
        "sum * per_volume" => "sum", "MAX_NEWTON: u32 = 64u" => "MAX_NEWTON: u32 = 1u"
    ]
    tetrahedra_plain Tetrahedra true [
        "gradients[3u * e + 1u].w *" => "", "2.0 * gradients" => "gradients", "q)), total == 1u" => "q)), false", "if total == 1u { a" => "if false { a",
        "* gradients[3u * e].w" => "", "corners[e] + rhs * params.node_count" => "corners[e]", "rhs * params.tetrahedron_count + e" => "e",
        "scalars[rhs * 2u].w != 0.0" => "false", "outer(u3 - u0, g[2])" => "outer(u3 - u0, g[1])"
    ]
    tetrahedra_pressed Tetrahedra false [
        "* 0.25" => "", "nodal_strain[c.w]" => "nodal_strain[c.z]", "gradients[3u * e + 1u].w" => "gradients[3u * e + 2u].w", "log_volume(mean).x * log_volume_slope(mean)" => "log_volume(mean).x",
        "max(log_volume_stiffness(mean), least * slope * slope)" => "log_volume_stiffness(mean)", "0.6 - 0.2" => "0.6 - 0.1"
    ]
    tetrahedra_pressures Nodes true [
        "* 0.25" => "", "corners[e] + offset" => "corners[e]", "gradients[3u * e + 1u].w *" => "", "sum * per_volume[i]" => "sum",
        "pressure[offset + i]" => "pressure[i]", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    tetrahedra_product Nodes true [
        "params.inertia * dofs[i].w" => "params.inertia", "* params.stiffness_factor" => "", "* dofs[i].xyz" => "", "n = GROUP / 2u" => "n = GROUP / 4u",
        "3u * rhs * params.tetrahedron_count" => "0u", "scalars[rhs * 2u].w == 0.0" => "true", "sum -= tet" => "sum += tet"
    ]
    tetrahedra_rotations Tetrahedra false [
        "u[c.w].xyz" => "u[c.z].xyz", "outer(u1 - u0, g[0])" => "outer(u1, g[0])", "diagonal(vec3<f32>(1.0)) +" => "", "MAX_NEWTON: u32 = 64u" => "MAX_NEWTON: u32 = 1u"
    ]
    tetrahedra_smoothed Tetrahedra true [
        "* 0.25" => "", "EDGES: u32 = 6u" => "EDGES: u32 = 5u", "domains[EDGES * e + n]" => "domains[n]", "* gradients[3u * e].w" => "",
        "rhs * params.domain_count" => "0u", "rhs * params.node_count" => "0u", "element_rotation[e]" => "element_rotation[0]", "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    tetrahedra_strains Tetrahedra true [
        "q)), total == 1u" => "q)), false", "corners[e] + rhs * params.node_count" => "corners[e]", "dot(r[2], gradient[2])" => "dot(r[2], gradient[1])",
        "rhs * params.tetrahedron_count + e" => "e", "scalars[rhs * 2u].w != 0.0" => "false", "gradients[3u * e + 2u]" => "gradients[3u * e + 1u]"
    ]
    tetrahedra_volumes Nodes true [
        "sum * per_volume[i]" => "sum", "strain[first + at]" => "strain[at]", "gradients[at].w *" => "", "rhs * params.node_count + i" => "i",
        "scalars[rhs * 2u].w != 0.0" => "false"
    ]
    update Nodes true [
        "head.y * s[i]" => "head.x * s[i]", "&& scalars[rhs * 2u].w == 0.0" => "", ".w == 1.0" => ".w == 2.0", "r[i] - head.x" => "r[i] + head.x",
        "n = GROUP / 2u" => "n = GROUP / 4u"
    ]
};

/// What a kernel writes on a body, by name.
pub fn run_kernel(gpu: &Gpu, source: &Source, body: &Body) -> Result<BTreeMap<String, Vec<f64>>, Failure> {
    let case = case_of(source).ok_or("no parity case")?;
    run(gpu, case, body, None)
}

/// The case of a kernel.
pub fn case_of(source: &Source) -> Option<&'static Case> {
    CASES.iter().find(|case| case.source.name == source.name)
}

/// A body and what a kernel must make of it.
struct Expected {
    body: Body,
    single: Outputs<f32>,
    bounded: Outputs<Bounded>,
}

/// Share of random segments whose hits rounding may decide; they are left out.
const UNCERTAIN: f64 = 0.01;
/// Seeds that are tried until rounding decides no branch.
const SEEDS: u64 = 50;

impl Expected {
    fn new(case: &Case, cells: [usize; 3], rhs_count: usize, first_rhs: usize) -> Result<Self, Failure> {
        for seed in 0..SEEDS {
            let mut body = Body::new(case.source.name, cells, rhs_count, first_rhs, seed);
            if case.source.name == "cut" {
                body.no_segments = twins::uncertain_segments(&body);
                if body.no_segments.len() as f64 > UNCERTAIN * body.springs.ends.len() as f64 + 1.0 {
                    let (left_out, all) = (body.no_segments.len(), body.springs.ends.len());
                    return Err(format!("rounding decides {left_out} of {all} segments").into());
                }
            }
            uncertain_comparisons();
            let mut bounded = (case.bounded)(&body);
            let decides = ["cut", "advance", "converge"].contains(&case.source.name);
            if decides && uncertain_comparisons() > 0 {
                continue;
            }
            match case.source.name {
                "rotations" => bounded = bounded_rotations(&body),
                "tetrahedra_rotations" => bounded = bounded_tetrahedra(&body),
                "tetrahedra_means" => bounded = bounded_means(&body),
                _ => {}
            }
            return Ok(Self { single: (case.single)(&body), bounded, body });
        }
        Err(format!("{cells:?} cells: rounding decides a branch with each of {SEEDS} seeds").into())
    }

    /// One cell and one right-hand side; a few, without the first; and enough for several workgroups, with every state of one.
    fn all(case: &Case) -> Result<Vec<Self>, Failure> {
        let mut all = vec![
            Self::new(case, [1, 1, 1], 1, 0)?,
            Self::new(case, [3, 2, 2], 3, 1)?,
            Self::new(case, [7, 8, 6], 8, 0)?,
        ];
        if ["advance", "converge"].contains(&case.source.name) {
            // more partial sums than the workgroup has lanes, of nodes and of columns
            all.push(Self::new(case, [129, 129, 1], 5, 0)?);
        }
        if case.source.name == "product" {
            // several tiles and slabs, the last ones smaller
            all.push(Self::new(case, [8, 9, 11], 2, 0)?);
        }
        if case.source.name == "bounds" {
            // several tiles, the last ones narrower; and no cells
            all.push(Self::new(case, [17, 9, 2], 1, 0)?);
            all.push(Self::new(case, [0; 3], 1, 0)?);
        }
        Ok(all)
    }
}

/// Runs a kernel on a body; all read-write arrays by name, partial sums summed.
fn run(gpu: &Gpu, case: &Case, body: &Body, broken: Option<&Shader>) -> Result<BTreeMap<String, Vec<f64>>, Failure> {
    let shader = match broken {
        Some(shader) => shader.clone(),
        None => Shader::read(case.source)?,
    };
    let buffers: Vec<(&str, Access, Buffer)> = shader
        .variables
        .iter()
        .map(|v| Ok((v.name.as_str(), v.access, body.upload(gpu, &v.name)?)))
        .collect::<Result<_, Failure>>()?;
    let list: Vec<(&str, &Buffer)> = buffers.iter().map(|(name, _, b)| (*name, b)).collect();
    let bound = match broken {
        Some(shader) => gpu.bind_shader(shader.clone(), &list)?,
        None => gpu.bind(case.source, &list)?,
    };
    let threads = match case.threads {
        Threads::Nodes => body.nodes(),
        Threads::Cells => body.grid.cell_count(),
        Threads::Tiles => body.product_tiles() * GROUP as usize,
        Threads::Touched => body.params::<f32>().touched_nodes as usize,
        Threads::Tetrahedra => body.tetrahedra.corners.len(),
        Threads::Domains => body.tetrahedra.shear.len(),
        Threads::Bounds => body.tiles() * GROUP as usize,
        Threads::Columns => body.columns(),
        Threads::Segments => body.springs.ends.len(),
        Threads::Ids => body.ids().len(),
        Threads::One => 1,
    };
    let rows = if case.by_rhs { body.rhs_count - body.first_rhs } else { 1 };
    let mut batch = gpu.batch();
    batch.run(&bound, threads, rows as u32);
    let written: Vec<_> = buffers.iter().filter(|b| b.1 == Access::ReadWrite).collect();
    let wanted: Vec<(&Buffer, u64)> = written.iter().map(|(_, _, b)| (b, b.bytes)).collect();
    let parts = gpu.submit_and_read(batch, &wanted)?;
    let read =
        |((name, _, _), bytes): (&&(&str, Access, Buffer), &Vec<u8>)| (name.to_string(), numbers(body, name, bytes));
    Ok(written.iter().zip(&parts).map(read).collect())
}

/// An array read back, as the twins give it.
fn numbers(body: &Body, name: &str, bytes: &[u8]) -> Vec<f64> {
    let real = || cast::<f32>(bytes).into_iter().map(f64::from).collect::<Vec<_>>();
    match (name, body.array(name)) {
        // not the padding to 16 bytes
        ("partial_gamma", Array::Real(all)) => rhs_sums(&real()[..all.len()], body.column_groups()),
        ("partial_product", Array::Real(all)) => rhs_sums(&real()[..all.len()], body.product_groups()),
        ("potential_and_residual", Array::Real(all)) => {
            let sum = |part: usize| real()[..all.len()].iter().skip(part).step_by(4).sum();
            vec![sum(0), sum(1), sum(2)]
        }
        ("partial_load" | "partial_residual" | "predicted_decrease", Array::Real(all)) => {
            rhs_sums(&real()[..all.len()], body.node_groups())
        }
        (_, Array::Real(all)) => real()[..all.len()].to_vec(),
        (_, Array::Count(all)) => {
            let words = &cast::<u32>(bytes)[..all.len()];
            if name == "hits" {
                return hits(words);
            }
            words.iter().copied().map(f64::from).collect()
        }
    }
}

/// Segments with where they are crossed, in the order of segments.
fn hits(words: &[u32]) -> Vec<f64> {
    let mut pairs: Vec<&[u32]> = words.chunks_exact(2).collect();
    pairs.sort_unstable();
    let number = |pair: &[u32]| match pair[0] {
        NO_HIT => [f64::from(NO_HIT); 2],
        segment => [f64::from(segment), f64::from(f32::from_bits(pair[1]))],
    };
    pairs.into_iter().flat_map(number).collect()
}

/// Compares one run with both twins; the largest part of its bound that a number used, or what is wrong.
fn compare(expected: &Expected, gpu: &BTreeMap<String, Vec<f64>>) -> Result<Result<f64, String>, Failure> {
    let Expected { single, bounded, .. } = expected;
    let names: Vec<&str> = single.iter().map(|(name, _)| *name).collect();
    if gpu.len() != names.len() {
        let found: Vec<&String> = gpu.keys().collect();
        return Err(format!("the kernel writes {found:?}, its twin {names:?}").into());
    }
    let mut worst: f64 = 0.0;
    for ((name, single), (_, bounded)) in single.iter().zip(bounded) {
        let gpu = gpu.get(*name).ok_or_else(|| format!("the kernel does not write `{name}`"))?;
        if gpu.len() != single.len() {
            return Err(format!("`{name}` has {} numbers, the twin's {}", gpu.len(), single.len()).into());
        }
        for (k, ((gpu, single), exact)) in gpu.iter().zip(single).zip(bounded).enumerate() {
            let twin = f64::from(*single);
            let own = (twin - exact.value).abs();
            if !(own <= exact.error && exact.error.is_finite()) {
                return Err(format!("{name}[{k}]: the bound is no bound: {twin:e} for {exact:?}").into());
            }
            let (difference, allowed) = ((gpu - twin).abs(), (ORDER + 1.0) * exact.error);
            if difference.is_nan() || difference > allowed {
                return Ok(Err(format!(
                    "{name}[{k}] is {gpu:e}, the twin's {twin:e}: they differ by {difference:.2e}, allowed are {allowed:.2e}"
                )));
            }
            if allowed > 0.0 {
                worst = worst.max(difference / allowed);
            }
        }
    }
    Ok(Ok(worst))
}

/// Newton forgets the roundings of its early steps, which a running analysis does not know. What counts is the last gradient `g` of
/// `tr(Rᵀ F)`: `δω = H⁻¹ δg`, `δq = δω / 2`, with `|δg| ≤ ulp size` per rounding, `size` the sum of the absolute terms of F.
fn bounded_polar(f: M3<f64>, size: f64, q: [f64; 4], roundings: f64) -> [Bounded; 4] {
    let s = rotation_matrix(q).transpose() * f;
    let symmetric = (s + s.transpose()) * 0.5;
    let hessian = M3::diagonal(V3::splat(s.trace())) - symmetric;
    let inverse = hessian.inverse().0.iter().map(|c| c.dot(*c)).sum::<f64>().sqrt();
    q.map(|c| Bounded::with_error(c, 0.5 * inverse * roundings * f64::from(f32::EPSILON) * size))
}

/// Rotations of cells: `size` is `1 + Σ_a |u_a| |∇N_a|`.
fn bounded_rotations(body: &Body) -> Outputs<Bounded> {
    let params = body.params::<f64>();
    let (u, shape) = (body.v4::<f64>("u"), body.v4::<f64>("shape"));
    let start = body.v4::<f64>("rotation");
    let rotation = &twins::rotations::<f64>(body)[0].1;
    let mut out = vec![];
    for (cell, q) in rotation.as_chunks::<4>().0.iter().enumerate() {
        let level = params.cell_at(cell)[2];
        let h = V3::from4(shape[body.grid.layer_of[level] as usize]);
        let (mut f, mut size) = (M3::identity(), 1.0);
        for (a, node) in params.corner_nodes(&body.split(), cell).into_iter().enumerate() {
            let sign = kernels::corner(a).map(|o| if o == 1 { 0.25 } else { -0.25 });
            let gradient = V3::new(sign[0] / h.x, sign[1] / h.y, sign[2] / h.z);
            f = f + V3::from4(u[node]).outer(gradient);
            size += V3::from4(u[node]).length() * gradient.length();
        }
        let dead = start[cell] == [0.0; 4];
        out.extend(if dead {
            q.map(|c| Bounded::with_error(c, 0.0))
        } else {
            bounded_polar(f, size, *q, NEWTON_ROUNDINGS)
        });
    }
    vec![("rotation", out)]
}

/// Rotations of tetrahedra: three differences of displacements.
fn bounded_tetrahedra(body: &Body) -> Outputs<Bounded> {
    let (u, gradients) = (body.v4::<f64>("u"), body.v4::<f64>("gradients"));
    let rotation = &twins::tetrahedra_rotations::<f64>(body)[0].1;
    let mut out = vec![];
    for (e, q) in rotation.as_chunks::<4>().0.iter().enumerate() {
        let corners = body.tetrahedra.corners[e].map(|node| V3::from4(u[node as usize]));
        let (mut f, mut size) = (M3::identity(), 1.0);
        for k in 0..3 {
            let gradient = V3::from4(gradients[3 * e + k]);
            f = f + (corners[k + 1] - corners[0]).outer(gradient);
            size += (corners[k + 1].length() + corners[0].length()) * gradient.length();
        }
        out.extend(bounded_polar(f, size, *q, NEWTON_ROUNDINGS));
    }
    vec![("element_rotation", out)]
}

/// Mean rotations: up to 24 tetrahedra, whose volumes are summed too.
fn bounded_means(body: &Body) -> Outputs<Bounded> {
    let (gradients, strain) = (body.v4::<f64>("gradients"), body.v4::<f64>("strain"));
    let rotation = &twins::tetrahedra_means::<f64>(body)[0].1;
    let mut out = vec![];
    for (node, q) in rotation.as_chunks::<4>().0.iter().enumerate() {
        let volume: f64 = body.tetrahedra.around(node).map(|(e, _)| gradients[3 * e][3]).sum();
        let (mut f, mut size) = (M3::identity(), 1.0);
        for (e, _) in body.tetrahedra.around(node) {
            let (own, share) = (matrix(&strain, e), gradients[3 * e][3] / volume);
            f = f + own * share;
            size += own.dot(own).sqrt() * share;
        }
        out.extend(bounded_polar(f, size, *q, MEAN_ROUNDINGS));
    }
    vec![("mean_rotation", out)]
}

/// The kernel agrees with its twin on every body.
pub fn agrees(gpu: &Gpu, case: &Case) -> Result<(), Failure> {
    let mut worst: f64 = 0.0;
    for expected in Expected::all(case)? {
        let used = compare(&expected, &run(gpu, case, &expected.body, None)?)?;
        let cells = expected.body.grid.cells;
        worst = worst.max(used.map_err(|e| format!("{cells:?} cells: {e}"))?);
    }
    super::report(gpu, &format!("{}: at most {:.1} % of the bound", case.source.name, 100.0 * worst));
    Ok(())
}

/// A broken kernel does not agree with its twin on one of the bodies: the comparison can fail.
pub fn is_found_out_when_broken(gpu: &Gpu, case: &Case) -> Result<(), Failure> {
    let all = Expected::all(case)?;
    for (from, to) in case.breaks {
        let whole = kernels::text(case.source);
        let (common, wgsl) = whole.split_at(whole.len() - case.source.wgsl.len());
        let (mut common, mut wgsl) = (common.to_string(), wgsl.to_string());
        let text = if wgsl.contains(from) { &mut wgsl } else { &mut common };
        if !text.contains(from) {
            return Err(format!("`{from}` is not in the kernel; choose another part to break").into());
        }
        *text = text.replacen(from, to, 1);
        let shader = Shader::from_text(case.source.name, format!("{common}{wgsl}"))?;
        let mut found = false;
        for expected in all.iter().rev() {
            found = found || compare(expected, &run(gpu, case, &expected.body, Some(&shader))?)?.is_err();
        }
        if !found {
            return Err(format!("with `{to}` instead of `{from}` it still agrees with its twin").into());
        }
    }
    Ok(())
}
