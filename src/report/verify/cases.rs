//! The known answers: scenes, references, bounds.
//!
//! References that say "27-node hexahedra" are of hexahedra with discontinuous linear pressure (Q2/P1), computed outside this project on two or
//! three grids whose digits agree to what is given here; those of 1 kPa, of 50 kPa at ν 0.49 and of u_x on one grid of 10 × 10 × 5 such cells
//! for a quarter, which is within 0.03 % of the next one at 50 kPa and ν 0.45.

use super::Change::{Cells, Friction, Law as By, Poisson, Pressure, SecondShare, ToolDown, TopDensity};
use super::Measure::{At, EnergyKept, ForceOnTool, Frequency, Probe, Rate, VolumeChange, WorkOfTool};
use super::{Case, Change};
use crate::error::Result;
use crate::scene::{Element, Files, Law, MATERIALS, Material, Scene, parse};
use std::path::Path;

/// Scenes by name, as of the build.
const SCENES: &[(&str, &str)] = &[
    ("ball", include_str!("../../../scenes/verify/ball.toml")),
    ("bar", include_str!("../../../scenes/verify/bar.toml")),
    ("bar_aslant", include_str!("../../../scenes/verify/bar_aslant.toml")),
    ("beam", include_str!("../../../scenes/verify/beam.toml")),
    ("braking", include_str!("../../../scenes/verify/braking.toml")),
    ("cantilever", include_str!("../../../scenes/verify/cantilever.toml")),
    ("confined_column_045", include_str!("../../../scenes/verify/confined_column_045.toml")),
    ("confined_column_049", include_str!("../../../scenes/verify/confined_column_049.toml")),
    ("cook", include_str!("../../../scenes/verify/cook.toml")),
    ("drag", include_str!("../../../scenes/verify/drag.toml")),
    ("elastica", include_str!("../../../scenes/verify/elastica.toml")),
    ("flight", include_str!("../../../scenes/verify/flight.toml")),
    ("friction_known", include_str!("../../../scenes/verify/friction_known.toml")),
    ("hertz", include_str!("../../../scenes/verify/hertz.toml")),
    ("incline_slide", include_str!("../../../scenes/verify/incline_slide.toml")),
    ("incline_stick", include_str!("../../../scenes/verify/incline_stick.toml")),
    ("langer", include_str!("../../../scenes/verify/langer.toml")),
    ("pad_under_pressure", include_str!("../../../scenes/verify/pad_under_pressure.toml")),
    ("panel", include_str!("../../../scenes/verify/panel.toml")),
    ("patch", include_str!("../../../scenes/verify/patch.toml")),
    ("skin_block_045", include_str!("../../../scenes/verify/skin_block_045.toml")),
    ("skin_block_049", include_str!("../../../scenes/verify/skin_block_049.toml")),
    ("skin_block_0499", include_str!("../../../scenes/verify/skin_block_0499.toml")),
    ("skin_block_neo_045", include_str!("../../../scenes/verify/skin_block_neo_045.toml")),
    ("slice", include_str!("../../../scenes/verify/slice.toml")),
    ("sphere_press_neo_hookean", include_str!("../../../scenes/verify/sphere_press_neo_hookean.toml")),
    ("stack_five", include_str!("../../../scenes/verify/stack_five.toml")),
];

/// Files that they name.
const FILES: &[(&str, &str)] = &[
    ("../meshes/bar_aslant.obj", include_str!("../../../scenes/meshes/bar_aslant.obj")),
    ("../meshes/cook.obj", include_str!("../../../scenes/meshes/cook.obj")),
    ("../meshes/pad.obj", include_str!("../../../scenes/meshes/pad.obj")),
    ("../meshes/pin.obj", include_str!("../../../scenes/meshes/pin.obj")),
    ("../meshes/pin_point.obj", include_str!("../../../scenes/meshes/pin_point.obj")),
    ("../meshes/scalpel.obj", include_str!("../../../scenes/meshes/scalpel.obj")),
];

/// Scene of that name.
///
/// # Errors
/// As [`parse`], if it was invalid at build time.
pub(super) fn scene(name: &str) -> Result<Scene> {
    let text = SCENES.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text);
    parse(text, Path::new(&format!("scenes/verify/{name}.toml")), &Files::Embedded(FILES))
}

const LINEAR: Change = By(Law::Fem { element: Element::Bbar, corotational: false });
const ENHANCED: Change = By(Law::Fem { element: Element::Enhanced, corotational: false });
const PLAIN: Change = By(Law::Fem { element: Element::Plain, corotational: false });
const COROTATIONAL: Change = By(Law::Fem { element: Element::Bbar, corotational: true });
const NEO_HOOKEAN: Change = By(Law::Hyperelastic(Material::NeoHookean));
/// Smoothed and plain tetrahedra.
const TETRA: Change = By(Law::Fem { element: Element::Tetra, corotational: false });
const PLAIN_TETRA: Change = By(Law::Fem { element: Element::PlainTetra, corotational: false });
const SOFT_TETRA: Change = By(Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra });
const SOFT_PLAIN_TETRA: Change = By(Law::LargeTetra { material: Material::NeoHookean, element: Element::PlainTetra });
const RUBBER_TETRA: Change = By(Law::LargeTetra { material: MATERIALS[1].1, element: Element::Tetra });
/// Mooney–Rivlin material.
const TWO_CONSTANTS: Change = By(Law::Hyperelastic(MATERIALS[1].1));
/// Grids of the skin block.
const COARSE: Change = Cells([20, 20], &[2, 2, 1]);
const FINE: Change = Cells([40, 40], &[4, 3, 1]);

/// Rounding of solves to 1e-7 and better.
const EXACT: f64 = 1e-6;
/// On 20 × 20 × 5 cells of the skin block, and on 40 × 40 × 8.
const ON_COARSE: f64 = 0.025;
const ON_FINE: f64 = 0.01;
const OF_TETRA: f64 = 0.1;
/// Elements that lock: shown, not bounded.
const LOCKS: f64 = f64::INFINITY;
/// The law is not that of the reference: shown, not bounded.
const OTHER_LAW: f64 = f64::INFINITY;

const Q2: &str = "27-node hexahedra, converged";
/// Middle of the skin block's top.
const CENTRE: super::Measure = At([0.0, 0.0, 2.3e-3], 2);
const MM: (&str, f64) = ("mm", 1e3);
const N: (&str, f64) = ("N", 1.0);
const MN: (&str, f64) = ("mN", 1e3);
const RATIO: (&str, f64) = ("", 1.0);

/// Displacements of the neo-Hookean skin block under its own weight and so many kPa, m.
const NEO_1_045: f64 = -0.01921e-3;
const NEO_1_049: f64 = -0.01484e-3;
const NEO_10_049: f64 = -0.1431e-3;
const NEO_50_045: f64 = -0.7585e-3;
const NEO_50_049: f64 = -0.6171e-3;
const NEO_EDGE_X: f64 = -0.00788e-3;

/// What most cases have.
const BASE: Case = Case {
    name: "",
    scene: "",
    changes: &[],
    measure: CENTRE,
    what: "u_z of the centre",
    unit: MM,
    reference: 0.0,
    source: Q2,
    size: 0.0,
    bound: EXACT,
    quick: false,
};

const PATCH: Case = Case {
    name: "patch test, stretch 1.1",
    scene: "patch",
    measure: Probe("pull"),
    what: "pull on the top",
    unit: N,
    reference: 1.0,
    source: "E ε A",
    quick: true,
    ..BASE
};

const BLOCK: Case = Case { scene: "skin_block_neo_045", changes: &[NEO_HOOKEAN, COARSE], bound: ON_COARSE, ..BASE };

const SPHERE: Case = Case {
    name: "sphere R 2 mm, 0.575 mm into skin, ν 0.45",
    scene: "sphere_press_neo_hookean",
    measure: ForceOnTool,
    what: "force",
    unit: N,
    ..BASE
};

const CANTILEVER: Case = Case {
    scene: "cantilever",
    name: "cantilever, clamped, P L²/EI = 0.05",
    measure: Probe("sideways"),
    what: "tip, across",
    reference: 1.8155e-3,
    bound: 0.02,
    ..BASE
};

const PANEL: Case = Case {
    name: "sheared panel, ν 1/3",
    scene: "panel",
    measure: Probe("sideways"),
    what: "middle of the top, across",
    reference: 0.13395e-3,
    bound: 0.01,
    ..BASE
};

const COOK: Case = Case {
    name: "Cook's membrane, ν 1/3",
    scene: "cook",
    measure: Probe("tip"),
    what: "middle of the free end, along the load",
    reference: 8.6098e-6,
    source: "quadrilaterals of 9 nodes, converged",
    bound: 0.01,
    ..BASE
};

const ELASTICA: Case = Case {
    name: "elastica, P L²/EI = 2",
    scene: "elastica",
    measure: Probe("sideways"),
    what: "tip, across",
    reference: 0.49346 * 99.5e-3,
    source: "Euler, boundary value problem to 1e-10",
    bound: 0.01,
    quick: true,
    ..BASE
};

const FIBRES: Case = Case {
    name: "strip with fibres, stretch 1.2, along Langer's lines",
    scene: "langer",
    measure: Probe("along"),
    what: "reaction of its end",
    unit: N,
    reference: 0.9845238,
    source: "law in principal stretches, exact",
    bound: 1e-4,
    quick: true,
    ..BASE
};

const CONFINED: Case = Case {
    name: "confined layers, 0.1 mm, ν 0.45",
    scene: "confined_column_045",
    measure: Probe("top_reaction"),
    what: "reaction of the top",
    unit: N,
    reference: -0.9390237,
    source: "layers in series, exact",
    quick: true,
    ..BASE
};

/// In cells that the surface cuts.
const HANGING: Case = Case {
    name: "bar 30° aslant under its own weight, embedded",
    scene: "bar_aslant",
    measure: Probe("strain"),
    what: "strain at its middle, along z",
    unit: RATIO,
    reference: 8.91e-4,
    source: "ρ g 6 mm/E, uniaxial",
    bound: 0.05,
    quick: true,
    ..BASE
};

const BOX: Case =
    Case { measure: Rate("speed"), unit: ("m/s²", 1.0), source: "Coulomb", bound: 1e-4, quick: true, ..BASE };

/// All known answers.
#[rustfmt::skip]
pub const CASES: &[Case] = &[
    Case { changes: &[LINEAR], ..PATCH },
    Case { changes: &[ENHANCED], ..PATCH },
    Case { changes: &[PLAIN], ..PATCH },
    Case { changes: &[COROTATIONAL], ..PATCH },
    Case { changes: &[NEO_HOOKEAN], reference: 0.9170344, source: "P(λ), no stress across", ..PATCH },
    Case { changes: &[TWO_CONSTANTS, SecondShare(0.25)], reference: 0.8893319, source: "P(λ), no stress across", ..PATCH },
    Case { changes: &[TETRA], ..PATCH },
    Case { changes: &[SOFT_TETRA], reference: 0.9170344, source: "P(λ), no stress across", ..PATCH },
    Case { changes: &[SOFT_PLAIN_TETRA], reference: 0.9170344, source: "P(λ), no stress across", ..PATCH },
    Case { changes: &[RUBBER_TETRA, SecondShare(0.25)], reference: 0.8893319, source: "P(λ), no stress across", ..PATCH },
    FIBRES,
    Case { name: "strip with fibres, stretch 1.2, across Langer's lines", measure: Probe("across"), reference: 0.2769133, ..FIBRES },
    CONFINED,
    Case { name: "confined layers, 0.1 mm, ν 0.49", scene: "confined_column_049", reference: -4.236779, ..CONFINED },
    Case { quick: true, ..CANTILEVER },
    Case { changes: &[Cells([8, 8], &[79, 1])], bound: 0.01, ..CANTILEVER },
    Case { changes: &[ENHANCED], bound: 0.01, ..CANTILEVER },
    Case { name: "cantilever, clamped, P L²/EI = 2", changes: &[NEO_HOOKEAN, TopDensity(17160.0)], reference: 49.77e-3, ..CANTILEVER },
    Case { name: "cantilever, clamped, P L²/EI = 2", changes: &[NEO_HOOKEAN, TopDensity(17160.0)], measure: Probe("along"),
           what: "tip, along", reference: -16.15e-3, bound: 0.03, ..CANTILEVER },
    ELASTICA,
    Case { measure: Probe("along"), what: "tip, along", reference: -0.16064 * 99.5e-3, ..ELASTICA },
    Case { changes: &[NEO_HOOKEAN, Cells([4, 4], &[40, 1])], quick: false, ..ELASTICA },
    Case { changes: &[Cells([22, 1], &[23, 1])], quick: true, ..PANEL },
    PANEL,
    Case { name: "sheared panel, ν 0.4999", changes: &[Poisson(0.4999), Cells([22, 1], &[23, 1])],
           reference: 0.12254e-3, bound: 0.02, quick: true, ..PANEL },
    Case { name: "sheared panel, ν 0.4999", changes: &[Poisson(0.4999)], reference: 0.12254e-3, ..PANEL },
    Case { changes: &[Cells([24, 1], &[30])], quick: true, ..COOK },
    COOK,
    Case { name: "Cook's membrane, ν 1/4", changes: &[Poisson(0.25)], reference: 23.96 * 0.9375 / 250.0 * 1e-4,
           source: "23.96 F/(E t) in plane stress at ν 1/3, of long standing", ..COOK },
    Case { name: "Cook's membrane, ν 0.4999", changes: &[Poisson(0.4999), Cells([24, 1], &[30])], reference: 7.4048e-6, bound: 0.02, quick: true, ..COOK },
    Case { name: "Cook's membrane, ν 0.4999", changes: &[Poisson(0.4999)], reference: 7.4048e-6, ..COOK },
    Case { name: "skin block, 10 kPa, ν 0.45", scene: "skin_block_045", changes: &[LINEAR, COARSE], reference: -0.1910e-3, quick: true, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", scene: "skin_block_045", changes: &[LINEAR, COARSE], measure: VolumeChange,
           what: "change of volume", unit: ("mm³", 1e9), reference: -1.655e-9, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", scene: "skin_block_045", changes: &[LINEAR, FINE], reference: -0.1910e-3, bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", scene: "skin_block_049", changes: &[LINEAR, COARSE], reference: -0.1482e-3, quick: true, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", scene: "skin_block_049", changes: &[LINEAR, FINE], reference: -0.1482e-3, bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.499, no gravity", scene: "skin_block_0499", changes: &[LINEAR, COARSE], reference: -0.1362e-3, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.499, no gravity", scene: "skin_block_0499", changes: &[LINEAR, FINE], reference: -0.1362e-3,
           bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", scene: "skin_block_045", changes: &[TETRA, COARSE], reference: -0.1910e-3, bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", scene: "skin_block_049", changes: &[TETRA, COARSE], reference: -0.1482e-3, bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", scene: "skin_block_049", changes: &[PLAIN_TETRA, COARSE], reference: -0.1482e-3, bound: LOCKS, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", changes: &[SOFT_TETRA, COARSE], reference: -0.1836e-3, bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", changes: &[SOFT_TETRA, COARSE, Poisson(0.49)], reference: NEO_10_049, bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.45", changes: &[SOFT_TETRA, COARSE, Pressure(50e3)], reference: NEO_50_045, bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.49", changes: &[SOFT_TETRA, COARSE, Pressure(50e3), Poisson(0.49)], reference: NEO_50_049,
           bound: OF_TETRA, ..BLOCK },
    Case { name: "skin block, 1 kPa, ν 0.45", changes: &[NEO_HOOKEAN, COARSE, Pressure(1e3)], reference: NEO_1_045, quick: true, ..BLOCK },
    Case { name: "skin block, 1 kPa, ν 0.49", changes: &[NEO_HOOKEAN, COARSE, Pressure(1e3), Poisson(0.49)], reference: NEO_1_049, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", reference: -0.1836e-3, quick: true, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", changes: &[NEO_HOOKEAN, FINE], reference: -0.1836e-3, bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", changes: &[NEO_HOOKEAN, COARSE, Poisson(0.49)], reference: NEO_10_049, quick: true, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.49", changes: &[NEO_HOOKEAN, FINE, Poisson(0.49)], reference: NEO_10_049, bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.45", changes: &[NEO_HOOKEAN, COARSE, Pressure(50e3)], reference: NEO_50_045, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.45", changes: &[NEO_HOOKEAN, FINE, Pressure(50e3)], reference: NEO_50_045, bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.49", changes: &[NEO_HOOKEAN, COARSE, Pressure(50e3), Poisson(0.49)], reference: NEO_50_049, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.49", changes: &[NEO_HOOKEAN, FINE, Pressure(50e3), Poisson(0.49)], reference: NEO_50_049,
           bound: ON_FINE, ..BLOCK },
    Case { name: "skin block, 1 kPa, ν 0.45", changes: &[COROTATIONAL, COARSE, Pressure(1e3)], reference: NEO_1_045, bound: OTHER_LAW, ..BLOCK },
    Case { name: "skin block, 10 kPa, ν 0.45", changes: &[COROTATIONAL, COARSE], reference: -0.1836e-3, bound: OTHER_LAW, ..BLOCK },
    Case { name: "skin block, 50 kPa, ν 0.45", changes: &[COROTATIONAL, COARSE, Pressure(50e3)], reference: NEO_50_045, bound: OTHER_LAW, ..BLOCK },
    Case { name: "skin block, 10 kPa, beside the load's edge", changes: &[NEO_HOOKEAN, COARSE], measure: At([2e-3, 0.0, 2.3e-3], 0),
           what: "u_x at x = 2 mm, on top", reference: NEO_EDGE_X, bound: ON_COARSE, ..BLOCK },
    Case { name: "skin block, 10 kPa, beside the load's edge", changes: &[NEO_HOOKEAN, FINE], measure: At([2e-3, 0.0, 2.3e-3], 0),
           what: "u_x at x = 2 mm, on top", reference: NEO_EDGE_X, bound: ON_FINE, ..BLOCK },
    Case { name: "Hertz: sphere R 5 mm, 0.1 mm deep, on 10 mm", scene: "hertz", changes: &[Cells([40, 40], &[7, 4, 4])], measure: Probe("bottom"),
           what: "reaction of a quarter", unit: MN, reference: 3.365695e-3, source: "Hertz 1882, Dimitriadis et al. 2002", bound: 0.02, ..BASE },
    Case { name: "Hertz: sphere R 5 mm, 0.1 mm deep, on 10 mm", scene: "hertz", measure: Probe("bottom"),
           what: "reaction of a quarter", unit: MN, reference: 3.365695e-3, source: "Hertz 1882, Dimitriadis et al. 2002", bound: 0.01, ..BASE },
    Case { name: "stiff ball in a pulled block, 10 : 1, ν 0.3", scene: "ball", measure: Probe("inside"), what: "strain inside, along", unit: RATIO,
           reference: 1.842538e-4, source: "Eshelby 1957", bound: 0.05, quick: true, ..BASE },
    HANGING,
    Case { changes: &[Cells([24, 8], &[32])], measure: Probe("stress"), what: "von Mises stress at its middle", unit: ("Pa", 1.0), reference: 6.6,
           source: "ρ g 6 mm", bound: 0.02, quick: false, ..HANGING },
    Case { name: "curved pad under pressure all around, embedded", scene: "pad_under_pressure", measure: Probe("shrinks"), what: "change of volume",
           unit: ("10⁻⁶", 1e6), reference: -6e-5, source: "p/K", bound: 1e-3, quick: true, ..BASE },
    Case { name: "sphere R 2 mm, 0.575 mm into skin, ν 0.45", changes: &[NEO_HOOKEAN, COARSE], reference: 0.172, bound: 0.10, ..SPHERE },
    Case { name: "sphere R 2 mm, 0.575 mm into skin, ν 0.45", changes: &[NEO_HOOKEAN, FINE], reference: 0.172, bound: 0.05, ..SPHERE },
    Case { name: "sphere R 2 mm, 0.575 mm into skin, ν 0.49", changes: &[NEO_HOOKEAN, COARSE, Poisson(0.49)], reference: 0.2, bound: 0.10, ..SPHERE },
    Case { name: "sphere R 2 mm, 0.575 mm into skin, ν 0.49", changes: &[NEO_HOOKEAN, FINE, Poisson(0.49)], reference: 0.2, bound: 0.05, ..SPHERE },
    Case { name: "sphere R 2 mm, 1.15 mm into skin, ν 0.45", changes: &[NEO_HOOKEAN, COARSE, ToolDown(3.15e-3)], reference: 0.609, bound: 0.10, ..SPHERE },
    Case { name: "sphere R 2 mm, 1.15 mm into skin, ν 0.45", changes: &[NEO_HOOKEAN, FINE, ToolDown(3.15e-3)], reference: 0.609, bound: 0.05, ..SPHERE },
    Case { name: "sphere R 2 mm, 0.575 mm into skin, ν 0.45", changes: &[SOFT_TETRA, COARSE], reference: 0.172, bound: 0.15, ..SPHERE },
    Case { name: "sphere R 2 mm, 1.15 mm into skin, ν 0.49", changes: &[NEO_HOOKEAN, COARSE, ToolDown(3.15e-3), Poisson(0.49)], reference: 0.717, bound: 0.10, ..SPHERE },
    Case { name: "sphere R 2 mm, 1.15 mm into skin, ν 0.49", changes: &[NEO_HOOKEAN, FINE, ToolDown(3.15e-3), Poisson(0.49)], reference: 0.717, bound: 0.05, ..SPHERE },
    Case { name: "free vibration, confined bar", scene: "bar", measure: Frequency("end"), what: "lowest frequency", unit: ("Hz", 1.0),
           reference: 48.689728, source: "√(M/ρ)/4L, exact", bound: 2e-3, quick: true, ..BASE },
    Case { name: "free vibration, cantilever", scene: "beam", measure: Frequency("end"), what: "lowest frequency", unit: ("Hz", 1.0),
           reference: 1.6048914, source: "Timoshenko's beam, k = 5/6", bound: 0.01, quick: true, ..BASE },
    Case { name: "energy of a vibrating bar, average acceleration", scene: "bar", measure: EnergyKept, what: "end over start", unit: RATIO,
           reference: 1.0, source: "conserved", bound: EXACT, quick: true, ..BASE },
    Case { name: "energy of a block, mass damping 2 1/s, 0.5 s", scene: "drag", measure: EnergyKept, what: "end over start", unit: RATIO,
           reference: 0.1353353, source: "e⁻²", bound: 5e-3, quick: true, ..BASE },
    Case { name: "energy of a sliding box, taken by friction", scene: "braking", measure: Probe("way"), what: "way to the stop", unit: MM,
           reference: 0.1698947, source: "v²/2μg, Coulomb", bound: 5e-3, quick: true, ..BASE },
    Case { name: "momentum of a free block out of shape", scene: "flight", measure: Rate("x"), what: "speed of its centre of mass", unit: ("m/s", 1.0),
           reference: 0.5, source: "conserved", bound: EXACT, quick: true, ..BASE },
    Case { name: "friction, box on 30°, μ 0.3", scene: "incline_slide", what: "acceleration", reference: 2.3562872, ..BOX },
    Case { name: "friction, box on 30°, μ 0.57 < tan 30°", scene: "incline_slide", changes: &[Friction(0.57)], what: "acceleration",
           reference: 0.0624457, ..BOX },
    Case { name: "friction, box on 30°, μ 0.58 > tan 30°", scene: "incline_stick", changes: &[Friction(0.58)], measure: Probe("drift"),
           what: "drift in 10 s, of 1 mm", unit: MM, reference: 0.0, size: 1e-3, bound: 1e-3, ..BOX },
    Case { name: "friction on skin, one point slides, one sticks", scene: "friction_known", measure: Probe("pulled"), what: "both along x",
           unit: MN, reference: -0.45e-3, source: "μN + spring, Coulomb", bound: 5e-3, ..BASE },
    Case { name: "stack of five boxes of 100 g", scene: "stack_five", measure: Probe("under 5"), what: "under the lowest", unit: N,
           reference: 4.905, source: "5 m g", bound: 1e-4, quick: true, ..BASE },
    Case { name: "stack of five boxes of 100 g", scene: "stack_five", measure: Probe("under 2"), what: "under the second", unit: N,
           reference: 1.962, source: "2 m g", bound: 1e-4, quick: true, ..BASE },
    Case { name: "cutting work of a slice, 50 J/m²", scene: "slice", measure: WorkOfTool, what: "work of the blade", unit: ("mJ", 1e3),
           reference: 0.84e-3, source: "toughness × area", bound: 0.1, quick: true, ..BASE },
];
