//! Steps that are solved in full: law and contact hold together, against a closed form; linearised steps do not.

use cutis::scene::{BodyId, Element, Files, Law, Material, Scene, Skin, parse, read};
use cutis::step::{Platform, Simulation, StepReport};
use std::path::Path;

/// A block of 4 mm, 50 kPa and ν 0.45 is driven by 0.4 mm into a plane in one step of a second, free to widen.
const BLOCK: &str = r#"title = "A block driven into a plane"
[time]
step_ms = 1000.0
duration_s = 1.0
gravity_m_s2 = [0.0, 0.0, 0.0]
[solver]
tolerance = 1e-6
newton = true
[skin]
size_mm = [4.0, 4.0]
cells = [3, 2]
rayleigh_mass_per_s = 0.0
rayleigh_stiffness_s = 0.0
[[skin.layer]]
name = "dermis"
thickness_mm = 4.0
cells = 2
young_kpa = 50.0
poisson = 0.45
density_kg_m3 = 1000.0
[[boundary]]
region = "side_x_min"
axes = "x"
[[boundary]]
region = "side_y_min"
axes = "y"
[[boundary]]
region = "top"
axes = "z"
path_mm = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -0.4]]
[[plane]]
name = "floor"
through_mm = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[contact]
friction = 0.0
tolerance = 1e-6
"#;

fn steps(scene: &Scene, platform: &Platform, count: u32) -> Vec<StepReport> {
    let mut simulation = Simulation::new(scene, platform).unwrap_or_else(|e| panic!("{e}"));
    (0..count).map(|_| simulation.step(true).unwrap_or_else(|e| panic!("{e}"))).collect()
}

/// Force of the neo-Hookean block at an axial stretch `s`, N: `P A`, `P = μ (s − 1/s) + λ ln J / s`, where the lateral stretch `t` has
/// `μ (t − 1/t) + λ ln J / t = 0`, `J = s t²`.
fn closed_form(s: f64) -> f64 {
    let (young, poisson, area) = (50e3, 0.45, 16e-6);
    let (mu, lambda) = (young / 2.0 / (1.0 + poisson), young * poisson / (1.0 + poisson) / (1.0 - 2.0 * poisson));
    let log = |t: f64| (s * t * t).ln();
    let (mut low, mut high) = (1.0, 2.0);
    while high - low > 1e-14 {
        let t = 0.5 * (low + high);
        if mu * (t - 1.0 / t) + lambda * log(t) / t < 0.0 { low = t } else { high = t }
    }
    -area * (mu * (s - 1.0 / s) + lambda * log(low) / s)
}

#[test]
fn a_block_driven_into_a_plane_in_one_step_pushes_back_by_its_law() {
    let scene = parse(BLOCK, Path::new("block.toml"), &Files::Embedded(&[])).unwrap_or_else(|e| panic!("{e}"));
    let force = |scene: &Scene, platform: &Platform| {
        let report = &steps(scene, platform, 1)[0];
        (report.contact.force(BodyId::Deformable(0), None).z, report.newton_iterations, report.warnings.clone())
    };
    let wanted = closed_form(0.9);
    for (platform, near) in [(Platform::Cpu64, 1e-5), (Platform::Cpu32, 1e-4)] {
        let (found, iterations, warnings) = force(&scene, &platform);
        println!("{platform:?}: {found} N after {iterations} defects, wanted {wanted} N");
        assert!(warnings.is_empty() && iterations > 2, "{platform:?}: {iterations}, {warnings:?}");
        assert!((found / wanted - 1.0).abs() < near, "{platform:?}: {found} N, wanted {wanted} N");
    }
    // the counter-test: the step's linearisation
    let mut linear = scene;
    linear.solver.newton = false;
    let (found, iterations, _) = force(&linear, &Platform::Cpu64);
    assert!(iterations == 0 && (found / wanted - 1.0).abs() > 0.05, "{found} N, wanted {wanted} N");
}

/// A sphere pressed into skin of hexahedra or tetrahedra and slid.
fn pressed(law: Law) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/press_slide.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    let skin: &mut Skin = &mut scene.skins[0];
    (skin.cells, skin.law) = ([6, 6], law);
    if let Law::LargeTetra { .. } = law {
        scene.solver.preconditioner = cutis::scene::Preconditioner::Block;
    }
    // a softer hand: on so few cells that of the scene squeezes some flat
    let coupling = &mut scene.tools[0].coupling;
    (coupling.stiffness, coupling.damping) = (5e3, 20.0);
    (scene.solver.newton, scene.solver.tolerance) = (true, 1e-3);
    scene
}

#[test]
fn steps_in_full_leave_as_little_of_the_law_as_the_solver_leaves() {
    let material = Material::NeoHookean;
    let laws = [
        Law::Hyperelastic(material),
        Law::LargeTetra { material, element: Element::Tetra },
        Law::LargeTetra { material, element: Element::PlainTetra },
    ];
    for law in laws {
        let scene = pressed(law);
        let left = |scene: &Scene, platform: &Platform| {
            let reports = steps(scene, platform, 20);
            let touched = reports.iter().filter(|r| r.contact.on_tool.first().is_some_and(|f| f[2] > 0.1)).count();
            let warned: Vec<_> =
                reports.iter().filter(|r| !r.warnings.is_empty()).map(|r| (r.time, &r.warnings)).collect();
            assert!(touched > 10 && warned.is_empty(), "{law:?}: touched in {touched}, {warned:?}");
            reports.iter().map(|r| r.law_residual.max(r.true_residual.unwrap_or(f64::NAN))).fold(0.0, f64::max)
        };
        for platform in [Platform::Cpu64, Platform::Cpu32] {
            let found = left(&scene, &platform);
            println!("{law:?}, {platform:?}: {found:e} of the load are left");
            assert!(found < 2.0 * scene.solver.tolerance, "{law:?}, {platform:?}: {found:e}");
        }
        // the counter-test
        let mut linear = scene.clone();
        linear.solver.newton = false;
        let found = left(&linear, &Platform::Cpu64);
        assert!(found > 20.0 * scene.solver.tolerance, "{law:?}: {found:e}");
    }
}

#[test]
fn tetrahedra_that_nothing_touches_are_solved_in_full() {
    let mut scene = pressed(Law::LargeTetra { material: Material::NeoHookean, element: Element::Tetra });
    scene.tools.clear();
    (scene.contact, scene.time.gravity) = (None, [2000.0, 0.0, -6000.0]);
    scene.probes.clear();
    scene.checks.clear();
    let left = |scene: &Scene| {
        let reports = steps(scene, &Platform::Cpu64, 5);
        let in_full = |r: &StepReport| (r.newton_iterations > 0) == scene.solver.newton;
        assert!(reports.iter().all(|r| r.warnings.is_empty() && in_full(r)));
        reports.iter().map(|r| r.law_residual).fold(0.0, f64::max)
    };
    let found = left(&scene);
    println!("{found:e}");
    assert!(found < 2.0 * scene.solver.tolerance, "{found:e}");
    scene.solver.newton = false;
    let linear = left(&scene);
    assert!(linear > 10.0 * found, "the counter-test: {linear:e}, {found:e}");
}

/// A sphere thrown at skin crushes it by more than a linearisation bears: such a step is counted and is the linearised one.
#[test]
fn a_step_that_does_not_converge_in_full_is_the_linearised_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/tip_fast.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
    let forces = |scene: &Scene| {
        let reports = steps(scene, &Platform::Cpu64, 4);
        let count = |r: &StepReport| r.warnings.get("newton_not_converged").copied().unwrap_or(0);
        let first = reports.iter().position(|r| count(r) > 0);
        (reports.iter().map(|r| r.contact.on_tool.first().copied()).collect::<Vec<_>>(), first)
    };
    let (linear, none) = forces(&scene);
    scene.solver.newton = true;
    let (full, first) = forces(&scene);
    println!("{linear:?} {full:?} {first:?}");
    let step = first.expect("the sphere is thrown at the skin");
    let [linear, full] = [linear, full].map(|of_steps| of_steps[step].expect("it has met the skin")[2]);
    assert!(none.is_none() && linear > 0.1 && (full / linear - 1.0).abs() < 1e-2, "{full} N, linearised {linear} N");
}

/// A blade's cut splits cells and adds nodes, for which defects are evaluated as well.
#[test]
fn steps_in_full_go_on_through_a_cut() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml");
    let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}")).in_test_form();
    let severed = |scene: &Scene| {
        let reports = steps(scene, &Platform::Cpu64, scene.time.steps());
        let first = reports.iter().position(|r| r.severed > 0).expect("the blade cuts");
        assert!(reports.iter().all(|r| r.warnings.is_empty()));
        let left = reports[first + 1..].iter().map(|r| r.law_residual).fold(0.0, f64::max);
        (reports.iter().map(|r| r.severed).sum::<u32>(), left)
    };
    let (linear, left_linear) = severed(&scene);
    scene.solver.newton = true;
    let (full, left) = severed(&scene);
    println!("{linear} links and {left_linear:e} left, in full {full} and {left:e}");
    assert!(full.abs_diff(linear) <= 2 && left < 2.0 * scene.solver.tolerance && left_linear > 2.0 * left);
}
