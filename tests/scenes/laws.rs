//! Laws and integrators in scene files: what each is read as, asks for, refuses and goes together with.

use crate::scene_errors::{FULL, alone, parsed, says};
use cutis::scene::{Correction, Element, Integrator, Law, LoadKind, Material, Preconditioner, Region};

/// A scene of [`alone`] with layers of springs.
fn without_moduli(alone: String) -> String {
    alone.replace("young_kpa = 10\npoisson = 0.45\n", "")
}

#[test]
fn integrator_is_read_and_has_a_default() {
    let read = |word: &str| parsed(&alone(word, "", "")).expect("the scene is valid").time.integrator;
    assert_eq!(read(""), Integrator::ImplicitEuler);
    assert_eq!(read("integrator = \"implicit_euler\""), Integrator::ImplicitEuler);
    assert_eq!(read("integrator = \"midpoint\""), Integrator::Midpoint);
    assert_eq!(read("integrator = \"symplectic_euler\""), Integrator::SymplecticEuler);
}

#[test]
fn an_inclusion_is_a_solid_in_a_body_of_a_large_strain_law() {
    let of = |time: &str, skin: &str, region: &str| {
        parsed(&format!("{}\n[[inclusion]]\n{region}\nyoung_kpa = 90\n", alone(time, "", skin)))
    };
    let sphere = "region = \"sphere\"\ncentre_mm = [0, 0, 0.5]\nradius_mm = 0.8";
    let scene = of("", "", sphere).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((scene.inclusions[0].body, scene.inclusions[0].young), (0, 90e3));
    assert_eq!(scene.inclusions[0].region, Region::Sphere { centre: [0.0, 0.0, 0.5e-3], radius: 0.8e-3 });
    let refused = |time: &str, skin: &str, region: &str, parts: &str| {
        let error = of(time, skin, region).expect_err(parts);
        assert_eq!(error.exit_code(), 2);
        says(&error.to_string(), parts);
    };
    let law = "give it a hyperelastic law";
    refused("", "law = \"corotational\"", sphere, &format!("scenes/full.toml:20: … small-strain … {law}"));
    refused("integrator = \"symplectic_euler\"", "", sphere, "symplectic Euler … take implicit Euler steps");
    refused("", "", "region = \"top\"", "scenes/full.toml:21: … no solid … \"sphere\" or \"box\"");
    refused("", "", &sphere.replace("[0, 0, 0.5]", "[0, 0, 9]"), "no node");
    refused("", "", &sphere.replace("0.8", "0"), "radius_mm");
    refused("", "", "region = \"sphere\"", "centre_mm");
    refused("", "", &sphere.replace("sphere", "ball"), "no solid … \"sphere\"");
    refused("", "", &format!("{sphere}\nyoung_pa = 9"), "young_pa");
}

#[test]
fn explicit_steps_of_a_consistent_mass() {
    let text = alone("integrator = \"symplectic_euler\"", "", "law = \"linear\"\nmass = \"consistent\"");
    says(&parsed(&text).expect_err("no diagonal").to_string(), "scenes/full.toml:5: … consistent … lumped or uniform");
    assert!(parsed(&text.replace("symplectic_euler", "newmark")).is_ok());
    assert!(parsed(&text.replace("symplectic_euler", "midpoint")).is_ok());
}

#[test]
fn explicit_steps_of_springs() {
    let springs = "law = \"springs\"\nspring_stiffness_n_m = 5\nspring_damping_n_s_m = 0";
    let text = without_moduli(alone("integrator = \"symplectic_euler\"", "", springs));
    says(
        &parsed(&text).expect_err("dampers are implicit").to_string(),
        "scenes/full.toml:5: … springs … \"implicit_euler\"",
    );
    assert!(parsed(&text.replace("symplectic_euler", "implicit_euler")).is_ok());
}

#[test]
fn explicit_steps_need_no_solver() {
    let keys =
        ["preconditioner = \"column\"", "tolerance = 1e-4", "floor_n = 0", "max_iterations = 9", "refinements = 1"];
    for key in keys {
        let text = alone("integrator = \"symplectic_euler\"", key, "");
        let error = parsed(&text).expect_err("a key that does nothing").to_string();
        says(&error, &format!("scenes/full.toml:7: … {} … symplectic_euler", &key[..key.find(' ').expect("a key")]));
        let newmark = text.replace("symplectic_euler", "newmark").replace("[skin]", "[skin]\nlaw = \"linear\"");
        assert!(parsed(&newmark).is_ok());
    }
}

#[test]
fn steps_of_second_order_are_of_laws_that_they_are_stable_with() {
    let springs = "law = \"springs\"\nspring_stiffness_n_m = 5\nspring_damping_n_s_m = 0";
    let [linear, corotational, neo_hookean] =
        ["linear", "corotational", "neo_hookean"].map(|law| format!("law = \"{law}\""));
    let read = |word: &str, law: &str| {
        let text = alone(&format!("integrator = \"{word}\""), "", law);
        parsed(&if law == springs { without_moduli(text) } else { text })
    };
    for (word, law, says_why) in [
        ("newmark", &neo_hookean[..], "hyperelastic … \"midpoint\" … \"implicit_euler\""),
        ("newmark", &corotational, "energy … \"implicit_euler\""),
        ("midpoint", &corotational, "energy … \"implicit_euler\""),
        ("newmark", springs, "energy … \"implicit_euler\""),
        ("midpoint", springs, "energy … \"implicit_euler\""),
    ] {
        says(&read(word, law).expect_err(law).to_string(), &format!("scenes/full.toml:5: … {word} … {says_why}"));
    }
    for (word, law) in [("newmark", &linear), ("midpoint", &linear), ("midpoint", &neo_hookean)] {
        let mut scene = read(word, law).expect("the scene is valid");
        assert!(scene.check().is_ok());
        // in code as in files
        scene.skins[0].law = parsed(&alone("", "", &corotational)).expect("the scene is valid").skins[0].law;
        says(&scene.check().expect_err("corotational").to_string(), "time.integrator … Midpoint … stable");
    }
    // pressures that follow have no potential in a step
    let followed = |word: &str, law: &str, follower: bool| {
        let load = format!("[[load]]\npressure_kpa = 1\nfollower = {follower}\n[skin]\n");
        parsed(&alone(&format!("integrator = \"{word}\""), "", law).replace("[skin]\n", &load))
    };
    let refused = followed("midpoint", &neo_hookean, true).expect_err("it follows");
    says(&refused.to_string(), "scenes/full.toml:5: … midpoint … follows … \"implicit_euler\"");
    for (word, law) in [("midpoint", &linear), ("implicit_euler", &neo_hookean), ("static", &neo_hookean)] {
        assert!(followed(word, law, true).is_ok_and(|scene| !scene.newton() && scene.check().is_ok()), "{word}, {law}");
    }
    let mut scene = followed("midpoint", &neo_hookean, false).expect("the counter-test");
    scene.loads[0].kind = LoadKind::Pressure { pressure: 1e3, follower: true };
    says(&scene.check().expect_err("it follows").to_string(), "time.integrator … Midpoint … follows");
    // a study takes it where one of its laws does
    let study = |laws: &str| {
        let text = alone("", "", &corotational)
            .replace("[skin]\n", "[study]\nintegrators = [\"midpoint\"]\nlaws = LAWS\n[skin]\n");
        parsed(&text.replace("LAWS", laws))
    };
    assert!(study("[\"neo_hookean\", \"bbar\"]").is_ok());
    says(&study("[\"bbar\"]").expect_err("none fits").to_string(), "midpoint … energy");
}

#[test]
fn neo_hookean_law_is_read() {
    let scene = parsed(&alone("", "", "law = \"neo_hookean\"")).expect("the scene is valid");
    assert!(matches!(scene.skins[0].law, Law::Hyperelastic(Material::NeoHookean)));
    assert_eq!(scene.solver.preconditioner, Preconditioner::Multigrid);
    let midpoint =
        parsed(&alone("integrator = \"midpoint\"", "", "law = \"neo_hookean\"")).expect("the scene is valid");
    assert!(midpoint.newton() && midpoint.time.integrator == Integrator::Midpoint);
}

#[test]
fn hyperelastic_tetrahedra_are_read() {
    let read = |keys: &str| parsed(&alone("", "", keys));
    for (word, element) in [("tetra", Element::Tetra), ("plain_tetra", Element::PlainTetra)] {
        let scene = read(&format!("law = \"neo_hookean\"\nelement = \"{word}\"")).expect("the scene is valid");
        assert_eq!(scene.skins[0].law, Law::LargeTetra { material: Material::NeoHookean, element });
        assert_eq!(scene.solver.preconditioner, Preconditioner::Block);
    }
    let refused = read("law = \"holzapfel\"\nelement = \"tetra\"").expect_err("fibres are of hexahedra");
    says(&refused.to_string(), "element … without fibres … \"tetra\"");
    let newton = parsed(&alone("", "newton = true", "law = \"neo_hookean\"\nelement = \"tetra\""));
    assert!(newton.expect("they are solved in full").in_full());
}

#[test]
fn neo_hookean_skin_may_be_cut_and_refined_where_it_is_touched() {
    let text = FULL.replace("element = \"bbar\"\n", "");
    let scene = parsed(&text.replace("law = \"linear\"", "law = \"neo_hookean\"")).expect("the scene is valid");
    assert!(matches!(scene.skins[0].law, Law::Hyperelastic(Material::NeoHookean)));
    assert!(scene.tools[0].blade.is_some() && scene.contact.is_some());
    let refined =
        text.replace("law = \"linear\"", "law = \"neo_hookean\"").replace("[solver]\n", "[solver]\nrefinements = 2\n");
    assert_eq!(parsed(&refined).expect("the scene is valid").solver.refinements, 2);
}

#[test]
fn mooney_rivlin_constants_are_read_and_asked_for() {
    let with = |constants: &str| {
        let text = alone("", "", "law = \"mooney_rivlin\"");
        parsed(&text.replace("young_kpa = 10\npoisson = 0.45\n", constants))
    };
    let scene = with("c10_kpa = 3\nc01_kpa = 1\nbulk_kpa = 200\n").expect("the scene is valid");
    let layer = &scene.skins[0].layers[0];
    let (shear, bulk) = (8e3, 200e3);
    let near = |found: f64, wanted: f64| assert!((found / wanted - 1.0).abs() < 1e-12, "{found}, wanted {wanted}");
    near(layer.young / (2.0 * (1.0 + layer.poisson)), shear);
    near(layer.young / (3.0 * (1.0 - 2.0 * layer.poisson)), bulk);
    near(layer.second_share, 0.25);
    for (constants, wanted) in [
        ("c10_kpa = 3\nc01_kpa = 1\n", "scenes/full.toml:12: … bulk_kpa … mooney_rivlin"),
        ("c10_kpa = 3\nc01_kpa = -1\nbulk_kpa = 200\n", "scenes/full.toml:17: … c01_kpa"),
        ("c10_kpa = 3\nc01_kpa = 1\nbulk_kpa = 5\n", "scenes/full.toml:18: … mooney_rivlin … Poisson … 1.4"),
        ("c10_kpa = 3\nc01_kpa = 1\nbulk_kpa = 1e5\n", "scenes/full.toml:18: … mooney_rivlin … Poisson … 9999"),
        ("c10_kpa = 3\nc01_kpa = 1\nbulk_kpa = 9\nyoung_kpa = 9\n", "scenes/full.toml:19: … young_kpa … mooney_rivlin"),
    ] {
        says(&with(constants).expect_err(constants).to_string(), wanted);
    }
}

#[test]
fn fibres_are_read_and_asked_for() {
    let with = |law: &str, fibres: &str| {
        let text = alone("", "", &format!("law = \"{law}\""));
        parsed(&text.replace("poisson = 0.45\n", &format!("poisson = 0.45\n{fibres}")))
    };
    let all = "fibre_kpa = 20\nfibre_growth = 3\nfibre_dispersion = 0.1\nfibre_angle_deg = 30\nlanger_deg = 60\n";
    let scene = with("holzapfel", all).expect("the scene is valid");
    let fibres = scene.skins[0].layers[0].fibres;
    assert_eq!((fibres.stiffness, fibres.growth, fibres.dispersion), (20e3, 3.0, 0.1));
    let right = std::f64::consts::FRAC_PI_2;
    assert!((fibres.families[0] - right).abs() < 1e-12 && (fibres.families[1] - right / 3.0).abs() < 1e-12);
    let none = with("holzapfel", "").expect("a layer without fibres is valid");
    assert_eq!(none.skins[0].layers[0].fibres.stiffness, 0.0);
    for (law, fibres, wanted) in [
        ("holzapfel", "fibre_kpa = -1\n", "scenes/full.toml:18: … fibre_kpa … 0 or more"),
        ("holzapfel", "fibre_kpa = 1\nfibre_growth = 0\n", "scenes/full.toml:19: … fibre_growth"),
        ("holzapfel", "fibre_kpa = 1\nfibre_dispersion = 0.34\n", "scenes/full.toml:19: … fibre_dispersion … 1/3"),
        ("holzapfel", "fibre_kpa = 1\nlanger_deg = nan\n", "scenes/full.toml:19: … langer_deg"),
        ("holzapfel", "langer_deg = 30\n", "scenes/full.toml:18: … langer_deg … fibre_kpa"),
        ("neo_hookean", "fibre_kpa = 1\n", "scenes/full.toml:18: … fibre_kpa … holzapfel"),
        ("corotational", "langer_deg = 1\n", "scenes/full.toml:18: … langer_deg … holzapfel"),
    ] {
        says(&with(law, fibres).expect_err(fibres).to_string(), wanted);
    }
}

#[test]
fn neo_hookean_skin_takes_any_steps_and_newtons_method_no_refinements() {
    let explicit = alone("integrator = \"symplectic_euler\"", "", "law = \"neo_hookean\"");
    assert!(parsed(&explicit).is_ok());
    assert!(parsed(&alone("", "refinements = 2", "")).is_ok());
    let refined = alone("", "newton = true\nrefinements = 2", "");
    says(&parsed(&refined).expect_err("Newton alone").to_string(), "scenes/full.toml:8: … refinements … Newton");
    let midpoint = alone("integrator = \"midpoint\"", "refinements = 2", "");
    says(&parsed(&midpoint).expect_err("Newton alone").to_string(), "scenes/full.toml:7: … refinements … Newton");
    for (skin, time, says_why) in
        [("law = \"linear\"", "", "only hyperelastic"), ("", "integrator = \"symplectic_euler\"", "solves no system")]
    {
        let text = alone(time, "newton = true", skin);
        says(&parsed(&text).expect_err(says_why).to_string(), &format!("newton … {says_why}"));
    }
    let scene = parsed(&alone("", "newton = true", "")).expect("the scene is valid");
    assert!(scene.newton() && scene.solver.newton);
    assert!(!parsed(&alone("", "", "")).expect("the scene is valid").newton());
}

#[test]
fn steps_with_contact_are_solved_in_full_where_asked() {
    let text = FULL.replace("element = \"bbar\"\n", "").replace("law = \"linear\"", "law = \"neo_hookean\"");
    let uncoupled = parsed(&text.replace("[solver]\n", "[solver]\nnewton = true\n"));
    says(&uncoupled.expect_err("it has no exact correction").to_string(), "newton … correction");
    let text = text.replace("correction = \"uncoupled\"", "correction = \"exact\"");
    let with = |solver: &str, contact: &str| {
        let text = text.replace("[solver]\n", &format!("[solver]\n{solver}\n"));
        parsed(&text.replace("[contact]\n", &format!("[contact]\n{contact}\n")))
    };
    let [plain, full] = ["", "newton = true"].map(|solver| with(solver, "").expect("the scene is valid"));
    assert!(!plain.in_full() && full.in_full() && !full.newton());
    full.check().expect("code says the same");
    for (change, says_why) in
        [(Correction::Uncoupled, "newton … correction"), (Correction::Precomputed, "newton … correction")]
    {
        let mut scene = full.clone();
        scene.tools.iter_mut().for_each(|tool| (tool.blade, tool.carve) = (None, None));
        scene.attachments.clear();
        scene.contact.as_mut().expect("it has contact").correction = change;
        says(&scene.check().expect_err(says_why).to_string(), says_why);
    }
    let mut still = full;
    still.time.integrator = Integrator::Static;
    says(&still.check().expect_err("always in full").to_string(), "newton … static");
}

#[test]
fn static_steps_are_of_bodies_that_stay() {
    let statics = |skin: &str| parsed(&alone("integrator = \"static\"", "", skin));
    let scene = statics("").expect("the scene is valid");
    assert!(scene.newton() && scene.time.integrator == Integrator::Static);
    says(
        &statics("velocity_m_s = [0, 0, 1]").expect_err("it moves").to_string(),
        "scenes/full.toml:5: … static … velocity_m_s",
    );
    let cut = FULL.replace("[time]\n", "[time]\nintegrator = \"static\"\n").replace("velocity_m_s = [0, 0, 0.1]\n", "");
    says(&parsed(&cut).expect_err("a blade cuts in time").to_string(), "static … blade");
}
