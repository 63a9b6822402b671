//! Scenes: the numbers of a valid one in SI, and for each bad input the line and the way to mend it.

use cutis::error::{Error, Result};
use cutis::gpu;
use cutis::report;
use cutis::scene::{
    Correction, Cut, DeviceKind, Element, Files, Filter, Integrator, Law, Material, Preconditioner, ProbeKind, Region,
    Rendering, Role, Scene, Start, parse, read,
};
use proptest::prelude::*;
use std::path::Path;

/// Uses every table and nearly every key.
const FULL: &str = r##"title = "Incision of a three-layer patch"

[time]
step_ms = 2.0
duration_s = 0.5
gravity_m_s2 = [0, 0, -9.8]

[solver]
preconditioner = "block"
tolerance = 1e-4
floor_n = 2e-7
max_iterations = 500
true_residual_every = 10

[skin]
size_mm = [40, 20]
cells = [8, 4]
law = "fem"
element = "bbar"
corotational = false
rayleigh_mass_per_s = 0.02
rayleigh_stiffness_s = 0.03
velocity_m_s = [0, 0, 0.1]
displacement_mm = [1, 0, 0]

[[skin.layer]]
name = "hypodermis"
thickness_mm = 1.2
cells = 2
young_kpa = 12
poisson = 0.45
density_kg_m3 = 900
pre_strain = [0.2, -0.05]
toughness_kj_m2 = 0.5
color = "#102030"

[[skin.layer]]
name = "dermis"
thickness_mm = 1
cells = 1
young_kpa = 300
poisson = 0.4
density_kg_m3 = 1100

[[skin.layer]]
name = "epidermis"
thickness_mm = 0.3
cells = 1
young_kpa = 1000
poisson = 0.48
density_kg_m3 = 1150

[[boundary]]
region = "bottom"

[[boundary]]
region = "box"
box_mm = [[-20, -10, 0], [-15, 10, 2.5]]
axes = "xz"
displacement_mm = [-2, 0, 0]

[[load]]
pressure_kpa = 1.5
rectangle_mm = [[-20, -10], [0, 10]]
start_s = 0.1
end_s = 0.2

[[tool]]
name = "scalpel"
mesh = "meshes/scalpel.obj"
mesh_unit_mm = 10
mass_g = 25
inertia_g_mm2 = [100, 200, 300]
points_mm = [[0, 0, 1]]
trajectory = "incision.csv"

[tool.coupling]
stiffness_n_m = 800
damping_n_s_m = 4

[tool.blade]
edge_mm = [[0, 0, 0], [10, 0, 0.5], [20, 0, 2]]
normal = [0, 2, 0]
thickness_mm = 0.4
edge_spacing_mm = 0.5

[tool.device]
kind = "hand"
rendering = "direct"
force_scale = 0.5
max_force_n = 3
max_torque_n_mm = 20
workspace_mm = 400
position_mm = [1, 2, 3]
turn_deg = [0, 0, 180]
scale = 2
buttons = ["active", "none", "freeze"]
passivity = false
hand_mass_g = 200
hand_stiffness_n_m = 250
hand_damping_n_s_m = 4
encoder_um = 5

[contact]
friction = 0.2
alarm_mm = 0.6
correction = "uncoupled"
max_contacts = 8

[[probe]]
name = "top"
kind = "displacement"
point_mm = [0, 0, 2.5]
axis = "x"

[[probe]]
name = "grip"
kind = "reaction"
region = "sides_x"

[check]
"contact_force_n_max" = { min = 0.1, max = 2.0 }
"probes.top" = { max = 0.01 }

[test]
cells = [8, 2]
steps = 5

[view]
frames = 3
size_px = [320, 200]
eye_mm = [50, -70, 60]

[[anchor]]
region = "sphere"
centre_mm = [20, 10, 0]
radius_mm = 6
stiffness_n_m = 40

[haptic]
rate_hz = 2000
"##;

/// Files that the scene names, good and bad.
const FILES: &[(&str, &str)] = &[
    ("meshes/scalpel.obj", QUAD),
    ("meshes/nofaces.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
    ("meshes/nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"),
    ("meshes/bad.obj", "v 0 0 0\nf 1 2 9\n"),
    ("meshes/loose.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf /1 2 3\n"),
    ("meshes/text.obj", "v zero 0 0\n"),
    ("lines/good.obj", "# a hook\nv 9 9 9\nv 0 0 -1 0.5\nv 0 0 0\nv 1 0 2\nf 1 2 3\nvn 0 0 1\nl 2/1 3 -1\np 3 4\n"),
    ("lines/none.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ("lines/number.obj", "v 0 0 0\nv 1 zero 0\nl 1 2\n"),
    ("lines/short.obj", "v 0 0 0\nv 1 0\nl 1 2\n"),
    ("lines/nan.obj", "v 0 0 0\nv 1 0 nan\nl 1 2\n"),
    ("lines/index.obj", "v 0 0 0\nv 1 0 0\nl 1 3\n"),
    ("lines/zero.obj", "v 0 0 0\np 0\n"),
    ("lines/back.obj", "v 0 0 0\np -2\n"),
    ("lines/word.obj", "v 0 0 0\nl 1 b\n"),
    ("lines/lone.obj", "v 0 0 0\n\nl 1\n"),
    ("lines/same.obj", "v 0 0 0\nv 0 0 0\nl 1 2\n"),
    ("lines/far.obj", "v 0 0 0\nv 1e300 0 0\nl 1 2\n"),
    ("incision.csv", HAND),
    ("nothing.csv", ""),
    ("header.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n"),
    ("order.csv", "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n"),
    ("columns.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,1\n"),
    ("word.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,left,0,0,0,0,1\n"),
    ("nan.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n\n1,0,0,NaN,0,0,0,1\n"),
    ("inf.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,inf,0,0,0,0,0,1\n"),
    ("back.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0.5,0,0,0,0,0,0,1\n0.5,1,0,0,0,0,0,1\n"),
    ("felt.csv", FELT),
    (
        "felt_short.csv",
        "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw,force_x_n,force_y_n,force_z_n,torque_x_n_mm,torque_y_n_mm,torque_z_n_mm\n0,0,0,0,0,0,0,1\n",
    ),
    ("twist.csv", "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,0.5,1\n"),
];

/// One square in two objects of one polygon each.
const QUAD: &str = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no b\nv 0 0 1\nf 1//1 2 5\nvn 0 0 1\n";
/// The second quaternion is longer than 1 by 0.5 %.
const HAND: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\r\n0,1,2,3,0,0,0,1\r\n0.25, 4,5,6, 0,0,1.005,0\r\n";

/// A recorded hand with what it felt.
const FELT: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw,force_x_n,force_y_n,force_z_n,torque_x_n_mm,torque_y_n_mm,torque_z_n_mm\n\
    0,1,2,3,0,0,0,1,0,0,0,0,0,0\n0.25,4,5,6,0,0,0,1,0.1,0.2,0.3,1,2,3\n";

fn parsed(text: &str) -> Result<Scene> {
    parse(text, Path::new("scenes/full.toml"), &Files::Embedded(FILES))
}

/// The message for FULL with `from` (which it holds once) replaced by `to`; it must name the line that is `below` lines
/// under the start of `to`.
fn message_below(from: &str, to: &str, below: usize) -> String {
    assert_eq!(FULL.matches(from).count(), 1, "`{from}` is not once in FULL");
    let start = FULL.find(from).expect("counted above");
    let line = 1 + FULL[..start].matches('\n').count() + below;
    let error = parsed(&FULL.replace(from, to)).expect_err("the input is bad");
    let message = error.to_string();
    assert_eq!(error.exit_code(), 2, "{message}");
    assert!(message.starts_with(&format!("scenes/full.toml:{line}: ")), "line {line} in: {message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

/// The message has the parts, which ` … ` divides, in this order.
#[track_caller]
fn says(message: &str, parts: &str) {
    let mut rest = message;
    for part in parts.split(" … ") {
        let found = rest.find(part);
        let start = found.unwrap_or_else(|| panic!("`{part}` is not in its place in: {message}"));
        rest = &rest[start + part.len()..];
    }
}

#[track_caller]
fn refused(from: &str, to: &str, parts: &str) {
    says(&message_below(from, to, 0), parts);
}

/// The message for FULL with another mesh or trajectory.
fn file_message(from: &str, to: &str) -> String {
    let error = parsed(&FULL.replace(from, to)).expect_err("the file is bad");
    assert_eq!(error.exit_code(), 2, "{error}");
    error.to_string()
}

#[test]
fn full_scene_is_read_in_si() {
    let scene = parsed(FULL).expect("FULL is valid");
    assert_eq!(scene.title, "Incision of a three-layer patch");
    assert_eq!((scene.time.step, scene.time.duration), (2e-3, 0.5));
    assert_eq!(scene.time.gravity, [0.0, 0.0, -9.8]);
    assert_eq!(scene.solver.preconditioner, Preconditioner::Block);
    assert_eq!((scene.solver.tolerance, scene.solver.floor), (1e-4, 2e-7));
    assert_eq!((scene.solver.max_iterations, scene.solver.true_residual_every), (500, 10));
    let skin = &scene.skins[0];
    assert_eq!((skin.size, skin.cells), ([0.04, 0.02], [8, 4]));
    assert!(matches!(skin.law, Law::Fem { element: Element::Bbar, corotational: false }));
    assert_eq!((skin.rayleigh_mass, skin.rayleigh_stiffness), (0.02, 0.03));
    assert_eq!((skin.velocity, skin.displacement), ([0.0, 0.0, 0.1], [1e-3, 0.0, 0.0]));
    for (word, wanted) in [("enhanced", Element::Enhanced), ("plain", Element::Plain)] {
        let other = parsed(&FULL.replace("\"bbar\"", &format!("\"{word}\""))).expect("a known brick");
        assert!(matches!(other.skins[0].law, Law::Fem { element, .. } if element == wanted), "{word}");
    }
    let names: Vec<&str> = skin.layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!(names, ["hypodermis", "dermis", "epidermis"]);
    let bottom = &skin.layers[0];
    assert_eq!((bottom.thickness, bottom.cells), (1.2e-3, 2));
    assert_eq!((bottom.young, bottom.poisson, bottom.density), (12e3, 0.45, 900.0));
    assert_eq!((bottom.toughness, bottom.color), (500.0, [0x10, 0x20, 0x30]));
    assert_eq!(bottom.pre_strain, [0.2, -0.05]);
    let top = &skin.layers[2];
    assert_eq!(top.pre_strain, [0.0; 2]);
    assert_eq!((top.thickness, top.toughness, top.color), (0.3e-3, 2000.0, [0xe8, 0xb9, 0xa0]));
}

#[test]
fn full_scene_keeps_boundaries_loads_and_outputs() {
    let scene = parsed(FULL).expect("FULL is valid");
    assert_eq!(scene.boundaries[0].region, Region::Bottom);
    assert_eq!(scene.boundaries[0].axes, [true; 3]);
    let (min, max) = ([-0.02, -0.01, 0.0], [-0.015, 0.01, 2.5e-3]);
    assert_eq!(scene.boundaries[1].region, Region::Box { min, max });
    assert_eq!(scene.boundaries[1].axes, [true, false, true]);
    assert_eq!(scene.anchors[0].region, Region::Sphere { centre: [0.02, 0.01, 0.0], radius: 6e-3 });
    assert_eq!(scene.anchors[0].stiffness, 40.0);
    assert_eq!(scene.boundaries[1].displacement, [-2e-3, 0.0, 0.0]);
    let load = scene.loads[0];
    assert_eq!((load.pressure, load.start, load.end), (1500.0, 0.1, 0.2));
    assert_eq!((load.min, load.max), ([-0.02, -0.01], [0.0, 0.01]));
    let point = [0.0, 0.0, 2.5e-3];
    assert_eq!(scene.probes[0].kind, ProbeKind::Displacement { body: 0, point, axis: 0 });
    let region = Region::SidesX;
    assert_eq!(scene.probes[1].kind, ProbeKind::Reaction { body: 0, region, axis: 2 });
    let check = &scene.checks[0];
    assert_eq!((check.key.as_str(), check.min, check.max), ("contact_force_n_max", 0.1, 2.0));
    assert_eq!((scene.checks[1].min, scene.checks[1].max), (f64::NEG_INFINITY, 0.01));
    let test = scene.test.expect("FULL has a test form");
    assert_eq!((test.cells, test.steps), (Some([8, 2]), Some(5)));
    assert_eq!((scene.view.frames, scene.view.size), (3, [320, 200]));
    assert_eq!(scene.view.eye, [0.05, -0.07, 0.06]);
    assert_eq!(scene.view.target[..2], [0.0, 0.0]);
    let middle: f64 = 1.25e-3;
    assert!((scene.view.target[2] - middle).abs() < 1e-15);
}

/// FULL with its first boundary's region replaced.
fn with_region(keys: &str) -> String {
    FULL.replacen("region = \"bottom\"", keys, 1)
}

#[test]
fn regions_hold_the_nodes_they_name() {
    // the skin of FULL is 40 × 20 × 2.5 mm
    let cases = [
        ("region = \"sphere\"\ncentre_mm = [0, 0, 2.5]\nradius_mm = 3", [0.0, 0.0, 0.0], [0.0, 0.0, -1e-3]),
        (
            "region = \"plane\"\nthrough_mm = [0, 0, 0]\nnormal = [2, 0, 0]\nwithin_mm = 1",
            [9e-4, 5e-3, 1e-3],
            [1.1e-3, 0.0, 0.0],
        ),
        ("region = \"bottom_rim\"\nmargin_mm = 2", [0.0, 8.5e-3, 0.0], [0.0, 7.5e-3, 0.0]),
        ("region = \"bottom_core\"\nmargin_mm = 2", [0.0, 7.5e-3, 0.0], [0.0, 8.5e-3, 0.0]),
    ];
    for (keys, inside, outside) in cases {
        let scene = parsed(&with_region(keys)).unwrap_or_else(|e| panic!("{keys}: {e}"));
        let holds = |p| scene.boundaries[0].region.holds(p, scene.skins[0].size, 2.5e-3);
        assert!(holds(inside) && !holds(outside), "{keys}");
    }
}

#[test]
fn regions_without_their_keys_or_nodes_are_errors() {
    let cases = [
        ("region = \"sphere\"\ncentre_mm = [0, 0, 2.5]", "`radius_mm`"),
        ("region = \"sphere\"\ncentre_mm = [90, 0, 2.5]\nradius_mm = 3", "holds no node"),
        ("region = \"plane\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 0, 0]\nwithin_mm = 1", "has no length"),
        ("region = \"bottom_core\"\nmargin_mm = 30", "holds no node"),
        ("region = \"bottom\"\nmargin_mm = 3", "bottom_rim"),
        ("region = \"bottom_edge\"\nmargin_mm = 3", "bottom_core"),
    ];
    for (keys, wanted) in cases {
        let message = parsed(&with_region(keys)).err().unwrap_or_else(|| panic!("{keys} is no error")).to_string();
        assert!(message.contains(wanted), "{keys}: {message}");
    }
}

#[test]
fn an_empty_scene_is_called_empty() {
    let message = parsed(" \n").expect_err("nothing is no scene").to_string();
    assert!(message.starts_with("scenes/full.toml: the scene is empty"), "{message}");
}

#[test]
fn a_probe_beyond_the_skin_is_refused() {
    refused("point_mm = [0, 0, 2.5]", "point_mm = [0, 0, 2.6]", "outside the skin: z = 2.6 mm … from 0 to 2.5 mm");
}

#[test]
fn full_scene_loads_tool_mesh_and_hand() {
    let scene = parsed(FULL).expect("FULL is valid");
    let tool = &scene.tools[0];
    assert_eq!((tool.mass, tool.inertia), (0.025, [1e-7, 2e-7, 3e-7]));
    assert_eq!(tool.points, [[0.0, 0.0, 1e-3]]);
    assert_eq!(tool.mesh.triangles.len(), 3, "a quad and a triangle");
    let corner = |id: u32| tool.mesh.positions[id as usize];
    assert_eq!(tool.mesh.triangles[2].map(corner), [[0.0; 3], [0.01, 0.0, 0.0], [0.0, 0.0, 0.01]]);
    assert_eq!((tool.coupling.stiffness, tool.coupling.damping), (800.0, 4.0));
    assert_eq!((tool.coupling.angular_stiffness, tool.coupling.angular_damping), (1.0, 0.01));
    let blade = tool.blade.as_ref().expect("FULL has a blade");
    assert_eq!(blade.edge, [[0.0; 3], [0.01, 0.0, 0.5e-3], [0.02, 0.0, 2e-3]]);
    assert_eq!((blade.normal, blade.thickness), ([0.0, 1.0, 0.0], 0.4e-3));
    assert!(tool.round.is_none());
    assert_eq!((blade.edge_spacing, blade.flat_spacing, blade.depth), (0.5e-3, 1e-3, 2e-3));
    assert_eq!(tool.trajectory.len(), 2);
    assert_eq!(tool.trajectory[1].time, 0.25);
    assert_eq!(tool.trajectory[1].position, [4e-3, 5e-3, 6e-3]);
    assert_eq!(tool.trajectory[1].rotation, [0.0, 0.0, 1.0, 0.0], "made a unit quaternion");
    let contact = scene.contact.expect("a scene with a tool has a contact law");
    assert_eq!((contact.friction, contact.alarm, contact.distance), (0.2, 0.6e-3, 0.0));
    assert_eq!((contact.correction, contact.max_contacts), (Correction::Uncoupled, 8));
    assert_eq!((contact.tolerance, contact.column_tolerance, contact.max_passes), (1e-3, 0.05, 16));
    let short = parsed(&FULL.replace("max_contacts = 8", "max_passes = 2")).expect("two passes are allowed");
    assert_eq!(short.contact.map(|c| c.max_passes), Some(2));
}

#[test]
fn full_scene_says_which_device_holds_the_tool() {
    let scene = parsed(FULL).expect("FULL is valid");
    assert_eq!(scene.haptic.rate, 2000.0);
    let device = scene.tools[0].device.clone().expect("FULL has a device");
    assert_eq!(device.kind, DeviceKind::Hand { mass: 0.2, stiffness: 250.0, damping: 4.0, encoder: 5e-6 });
    assert_eq!((device.rendering, device.passivity), (Rendering::Direct, false));
    assert_eq!((device.force_scale, device.max_force, device.max_torque), (0.5, 3.0, 0.02));
    assert_eq!((device.position, device.scale, device.workspace), ([1e-3, 2e-3, 3e-3], 2.0, 0.4));
    assert!((device.rotation[2] - 1.0).abs() < 1e-12, "half a turn about z: {:?}", device.rotation);
    assert_eq!(device.buttons, [Role::Active, Role::None, Role::Freeze]);
    let start = FULL.find("[tool.device]").expect("in FULL");
    let end = FULL.find("[contact]").expect("in FULL");
    let with = |device: &str| parsed(&format!("{}{device}{}", &FULL[..start], &FULL[end..])).expect("valid");
    let bare = with("");
    assert!(bare.tools[0].device.is_none());
    assert_eq!(parsed(&FULL.replace("rate_hz = 2000", "")).expect("valid").haptic.rate, 1000.0);
    let haply = with("[tool.device]\nkind = \"haply\"\nurl = \"ws://here:1\"\ndevice = \"04BA\"\n");
    let device = haply.tools[0].device.clone().expect("it has one");
    let kind = DeviceKind::Haply { url: "ws://here:1".into(), device: "04BA".into(), grip: String::new() };
    assert_eq!((device.kind, device.passivity, device.rendering), (kind, true, Rendering::Coupling));
    assert!(device.max_force.is_infinite() && device.buttons.is_empty() && device.workspace == 10.0);
}

#[test]
fn devices_are_known_words_in_range() {
    refused(
        "kind = \"hand\"",
        "kind = \"hamd\"",
        "kind = \"hamd\" is not known; did you mean \"hand\"? … replay, hand, null, haply",
    );
    refused("rendering = \"direct\"", "rendering = \"force\"", "rendering = \"force\" is not known … coupling, direct");
    refused("force_scale = 0.5", "force_scale = 0", "force_scale = 0.0; wanted a finite number above 0");
    refused("max_force_n = 3", "max_force_n = -3", "max_force_n = -3.0; wanted a finite number, 0 or more, in N;");
    refused(
        "max_force_n = 3",
        "max_force = 3",
        "unknown key `max_force`; the unit is part of the key: write `max_force_n`",
    );
    refused("max_torque_n_mm = 20", "max_torque_n_mm = -1", "0 or more, in N·mm;");
    refused("scale = 2\n", "scale = -2\n", "scale = -2.0; wanted a finite number above 0");
    refused("workspace_mm = 400", "workspace_mm = 0", "workspace_mm = 0.0; wanted a finite number above 0");
    refused(
        "workspace_mm = 400",
        "workspace_m = 0.4",
        "unknown key `workspace_m`; the unit is part of the key: write `workspace_mm`",
    );
    refused("encoder_um = 5", "encoder_um = -5", "encoder_um = -5.0; wanted a finite number, 0 or more, in µm;");
    refused(
        "hand_mass_g = 200",
        "hand_mass_g = 0",
        "hand_mass_g = 0.0; wanted a finite number above 0 (at least 1.2e-38 in SI), in g;",
    );
    refused("passivity = false", "passivity = 0", "passivity = 0 … wanted true or false");
    refused(
        "rate_hz = 2000",
        "rate_hz = 20",
        "rate_hz = 20.0; wanted a number from 100 to 4000, in Hz; write for example 1000.0",
    );
}

#[test]
fn buttons_have_known_roles_each_once() {
    let from = "buttons = [\"active\", \"none\", \"freeze\"]";
    refused(
        from,
        "buttons = [\"activ\"]",
        "buttons = \"activ\" is not known; did you mean \"active\"? … none, active, clutch, freeze",
    );
    refused(from, "buttons = [\"clutch\", \"clutch\"]", "the button name \"clutch\" is taken by line");
    let many = format!("buttons = [{}]", ["\"none\""; 33].join(", "));
    refused(from, &many, "buttons = 33; wanted a whole number from 0 to 32");
}

#[test]
fn keys_of_another_kind_of_device_are_needless() {
    for key in ["url", "device", "grip"] {
        let wanted =
            format!("`{key}` has no effect here; only kind = \"haply\" asks a service for a device; remove it");
        says(&message_below("encoder_um = 5\n", &format!("encoder_um = 5\n{key} = \"a\"\n"), 1), &wanted);
    }
    for key in ["hand_mass_g", "hand_stiffness_n_m", "hand_damping_n_s_m", "encoder_um"] {
        let start = FULL.find("kind = \"hand\"").expect("in FULL");
        let end = FULL.find("[contact]").expect("in FULL");
        let text = format!("{}kind = \"null\"\n{key} = 1\n{}", &FULL[..start], &FULL[end..]);
        let message = parsed(&text).expect_err("it is no hand").to_string();
        says(&message, &format!("`{key}` has no effect here; only kind = \"hand\" is a simulated hand; remove it"));
    }
}

#[test]
fn a_trajectory_may_have_the_forces_of_a_recording() {
    let found = parsed(&FULL.replace("incision.csv", "felt.csv")).expect("forces are passed over");
    assert_eq!(found.tools[0].trajectory[1].position, [4e-3, 5e-3, 6e-3]);
    says(&file_message("incision.csv", "felt_short.csv"), "felt_short.csv:2: the row has 8 columns; wanted 14");
}

const SMALL: &str = "title = 'a'\n[time]\nstep_ms = 1\nduration_s = 1\n[skin]\nsize_mm = [10, 10]\ncells = [2, 2]\nlaw = 'springs'\nspring_stiffness_n_m = 5\nspring_damping_n_s_m = 0\n[[skin.layer]]\nname = 'a'\nthickness_mm = 1\ncells = 1\ndensity_kg_m3 = 1000\n";

#[test]
fn absent_tables_have_defaults() {
    let scene = parsed(SMALL).expect("SMALL is valid");
    assert_eq!(scene.skins[0].layers[0].young, 0.0, "unused by springs");
    assert!(matches!(scene.skins[0].law, Law::Springs { stiffness: 5.0, damping: 0.0 }));
    assert_eq!(scene.time.gravity, [0.0, 0.0, -9.81]);
    assert_eq!(scene.solver.preconditioner, Preconditioner::Column);
    assert!(scene.contact.is_none() && scene.tools.is_empty() && scene.test.is_none());
    assert_eq!((scene.view.frames, scene.view.size, scene.view.field_of_view), (8, [960, 640], 30.0));
    let [x, y, z] = scene.view.eye;
    let distance = x.hypot(y).hypot(z - scene.view.target[2]);
    let radius = 5e-3_f64.hypot(5e-3).hypot(0.5e-3);
    assert!(distance * 15_f64.to_radians().sin() > radius, "the whole patch is in view");
}

#[test]
fn direct_is_for_bricks() {
    let scene = parsed(&FULL.replace("preconditioner = \"block\"", "preconditioner = \"direct\"")).expect("bricks");
    assert_eq!(scene.solver.preconditioner, Preconditioner::Direct);
    let error = parsed(&format!("{SMALL}[solver]\npreconditioner = 'direct'\n")).expect_err("springs");
    says(&error.to_string(), "preconditioner = \"direct\" is not known … known: none, jacobi, block, column");
    // the command line can ask for it after the scene was read
    let mut scene = parsed(SMALL).expect("SMALL is valid");
    scene.solver.preconditioner = Preconditioner::Direct;
    let error = cutis::bodies::Model::new(&scene, 0).expect_err("springs");
    says(
        &error.to_string(),
        "the direct solver is for bricks; this skin is of springs; take the preconditioner column",
    );
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn tool_without_contact_table_has_default_contact() {
    let start = FULL.find("[contact]").expect("in FULL");
    let end = FULL.find("[[probe]]").expect("in FULL");
    let scene = parsed(&format!("{}{}", &FULL[..start], &FULL[end..])).expect("valid");
    let contact = scene.contact.expect("default");
    assert_eq!((contact.friction, contact.alarm, contact.max_contacts), (0.3, 0.5e-3, 16));
    assert_eq!(contact.correction, Correction::Exact);
}

#[test]
fn scene_is_read_with_files_of_its_folder() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scene_errors");
    std::fs::create_dir_all(folder.join("meshes")).expect("the target folder is writable");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("writable");
    write("full.toml", FULL);
    write("meshes/scalpel.obj", QUAD);
    write("incision.csv", HAND);
    let scene = read(&folder.join("full.toml")).expect("FULL is valid");
    assert_eq!(scene.tools[0].trajectory.len(), 2);
    write("lost.toml", &FULL.replace("incision.csv", "lost.csv"));
    let error = read(&folder.join("lost.toml")).expect_err("lost.csv is not there");
    assert_eq!(error.exit_code(), 2);
    says(&error.to_string(), "lost.toml:75: trajectory names  … lost.csv, which cannot … folder");
    let error = read(&folder.join("no.toml")).expect_err("no.toml is not there");
    assert_eq!(error.exit_code(), 2);
    says(&error.to_string(), "no.toml: the scene cannot be read … give the path");
}

#[test]
fn wrong_key_names_the_nearest() {
    refused("friction = 0.2", "frictoin = 0.2", "unknown key `frictoin` … did you mean `friction`? … max_contacts");
    refused("[view]", "[veiw]", "unknown key `veiw` … did you mean `view`? … boundary, anchor, load, tool");
    refused("steps = 5", "elephants = 5", "unknown key `elephants` … remove it … known here: cells, steps");
}

#[test]
fn wrong_unit_names_the_key_with_the_right_one() {
    refused("thickness_mm = 1.2", "thickness_cm = 0.12", "unit is part of the key: write `thickness_mm`");
    refused("young_kpa = 300", "young_mpa = 0.3", "`young_mpa` … write `young_kpa` and convert");
    refused("density_kg_m3 = 900", "density = 900", "write `density_kg_m3`");
    refused("duration_s = 0.5", "duration_ms = 500", "write `duration_s`");
}

#[test]
fn missing_keys_name_their_table() {
    refused("[time]\nstep_ms = 2.0", "[time]", "key `step_ms` is missing … add it to this table");
    let message = message_below("[[skin.layer]]\nname = \"dermis\"", "[[skin.layer]]", 0);
    says(&message, "key `name` is missing");
    let error = parsed("[time]\nstep_ms = 1\nduration_s = 1").expect_err("a scene without a title");
    says(&error.to_string(), "scenes/full.toml:1: the key `title` is missing");
    let layer = "young_kpa = 12\n";
    assert!(FULL.contains(layer));
    let error = parsed(&FULL.replace(layer, "")).expect_err("bricks need a modulus");
    says(&error.to_string(), "scenes/full.toml:26: the key `young_kpa` is missing … law = \"fem\"");
}

#[test]
fn wrong_types_name_the_wanted_one() {
    refused("step_ms = 2.0", "step_ms = \"2\"", "`step_ms = \"2\"` holds string … wanted a number, without quotes");
    refused("cells = [8, 4]", "cells = [8.5, 4]", "8.5 … wanted a whole number");
    refused("cells = [8, 4]", "cells = [-8, 4]", "-8 … whole number from 0");
    refused("corotational = false", "corotational = 0", "wanted true or false");
    refused("size_mm = [40, 20]", "size_mm = 40", "wanted a list in [ ]");
    refused("[time]", "[[time]]", "wanted one table");
    refused("[[load]]", "[load]", "wanted a list in [ ]; for tables, headers in [[ ]]");
}

#[test]
fn lists_of_the_wrong_length_are_refused() {
    refused("size_mm = [40, 20]", "size_mm = [40]", "size_mm has 1 entries; wanted 2");
    refused("size_mm = [40, 20]", "size_mm = [40, 20, 3]", "size_mm has 3 entries; wanted 2");
    refused("[[-20, -10], [0, 10]]", "[[-20, -10]]", "rectangle_mm has 1 entries; wanted 2");
    refused("points_mm = [[0, 0, 1]]", "points_mm = [[0, 0]]", "points_mm has 2 entries; wanted 3");
}

#[test]
fn broken_toml_is_quoted() {
    refused("[solver]", "[solver", "`[solver` is not TOML … mend this line");
    refused("name = \"dermis\"", "name = \"dermis", "`name = \"dermis` is not TOML");
    refused("poisson = 0.4\n", "poisson = \n", "`poisson =` is not TOML");
    let message = message_below("friction = 0.2", "friction = 0.2\nfriction = 0.3", 1);
    says(&message, "duplicate key");
}

#[test]
fn poisson_outside_its_range_is_refused() {
    refused(
        "poisson = 0.45",
        "poisson = 0.5",
        "poisson = 0.5; wanted 0 ≤ poisson ≤ 0.4999, … use 0.45 for most tissue",
    );
    refused("poisson = 0.45", "poisson = -0.1", "poisson = -0.1; … 0 ≤ poisson ≤ 0.4999");
    refused("poisson = 0.45", "poisson = nan", "poisson = NaN; … 0 ≤ poisson ≤ 0.4999");
    refused("poisson = 0.45", "poisson = 0.49991", "poisson = 0.49991; … 0 ≤ poisson ≤ 0.4999");
    let most = parsed(&FULL.replacen("poisson = 0.45", "poisson = 0.4999", 1)).expect("the counter-test");
    assert_eq!(most.skins[0].layers[0].poisson, 0.4999);
}

#[test]
fn pre_strain_outside_its_range_is_refused() {
    let from = "pre_strain = [0.2, -0.05]";
    let wanted = "wanted a strain between -0.5 and 1, both excluded … for example 0.1";
    refused(from, "pre_strain = [1, 0]", &format!("pre_strain[0] = 1.0; … {wanted}"));
    refused(from, "pre_strain = [0, -0.5]", &format!("pre_strain[1] = -0.5; … {wanted}"));
    refused(from, "pre_strain = [0, nan]", &format!("pre_strain[1] = NaN; … {wanted}"));
    refused(from, "pre_strain = [0.1]", "pre_strain has 1 entries; wanted 2");
    refused(from, "pre_strain = [0.1, 0, 0]", "pre_strain has 3 entries; wanted 2");
    assert!(parsed(&FULL.replace(from, "pre_strain = [0.999, -0.499]")).is_ok(), "both limits are excluded");
    let springs = SMALL.replace("cells = 1\n", "cells = 1\npre_strain = [0.1, 0.1]\n");
    let message = parsed(&springs).expect_err("springs are at rest").to_string();
    says(&message, "scenes/full.toml:15: … pre_strain … pre-strain belongs to law = \"fem\"");
}

#[test]
fn numbers_outside_their_range_are_refused() {
    refused(
        "thickness_mm = 1.2",
        "thickness_mm = -1.2",
        "thickness_mm = -1.2; wanted a finite number above 0 (at least 1.2e-38 in SI), in mm … for example 1.2",
    );
    refused("density_kg_m3 = 900", "density_kg_m3 = 0", "above 0 (at least 1.2e-38 in SI), in kg/m³ … for example 1.0");
    refused("young_kpa = 12", "young_kpa = inf", "young_kpa = inf; wanted a finite number");
    refused("young_kpa = 12", "young_kpa = 1e36", "young_kpa = 1e36; wanted a finite number");
    refused("step_ms = 2.0", "step_ms = 0", "step_ms = 0.0 … above 0 (at least 1.2e-38 in SI), in ms");
    refused("tolerance = 1e-4", "tolerance = 1", "tolerance = 1.0 … between 0 and 1 … 0.001");
    refused("friction = 0.2", "friction = -0.2", "friction = -0.2 … 0 or more … 0.2");
    refused("inertia_g_mm2 = [100, 200, 300]", "inertia_g_mm2 = [100, 0, 300]", "inertia_g_mm2[1] = 0.0 … g·mm²");
    refused("gravity_m_s2 = [0, 0, -9.8]", "gravity_m_s2 = [0, 0, nan]", "gravity_m_s2[2] = NaN … finite");
    refused("duration_s = 0.5", "duration_s = 0.001", "0.002 must be at most … 0.001 … at least one step");
    refused("eye_mm = [50, -70, 60]", "field_of_view_deg = 170", "from 1 to 150 … for example 30");
}

#[test]
fn a_layer_without_mass_is_refused_wherever_it_is() {
    for density in ["900", "1100", "1150"] {
        let (from, to) = (format!("density_kg_m3 = {density}"), "density_kg_m3 = 0.0");
        refused(&from, to, "density_kg_m3 = 0.0; wanted a finite number above 0 … in kg/m³ … for example 1.0");
    }
    refused("density_kg_m3 = 1100", "density_kg_m3 = -1100", "above 0 … in kg/m³ … for example 1100");
}

#[test]
fn a_body_starts_in_a_shape_that_is_known() {
    let start = |keys: &str| {
        let text = FULL.replace("displacement_mm = [1, 0, 0]", &format!("displacement_mm = [1, 0, 0]\n{keys}"));
        parsed(&text).expect("the keys are valid").skins[0].start
    };
    assert_eq!(start(""), Start::Rest);
    assert_eq!(start("start = \"random\"\nstart_mm = 2"), Start::Random { amplitude: 2e-3, seed: 1 });
    assert_eq!(start("start = \"random\"\nstart_mm = 2\nstart_seed = 7"), Start::Random { amplitude: 2e-3, seed: 7 });
    assert_eq!(start("start = \"flat\""), Start::Flat);
    assert_eq!(start("start = \"inside_out\""), Start::InsideOut);
    assert_eq!(start("start = \"twist\"\nstart_deg = 180"), Start::Twist(std::f64::consts::PI));
    let key = "law = \"fem\"";
    refused(key, "start = \"falt\"", "did you mean \"flat\"? … rest, random, flat, inside_out, twist");
    refused(key, "start_mm = 1", "start_mm … start = \"random\"");
    refused(key, "start_seed = 1", "start_seed … start = \"random\"");
    refused(key, "start_deg = 1", "start_deg … start = \"twist\"");
    says(&message_below(key, "start = \"random\"\nstart_mm = 0", 1), "start_mm = 0.0 … above 0 … in mm");
    says(&message_below(key, "start = \"twist\"\nstart_deg = inf", 1), "start_deg = inf … finite");
    for (word, missing) in [("random", "start_mm"), ("twist", "start_deg")] {
        let error = parsed(&FULL.replace(key, &format!("start = \"{word}\""))).expect_err("a key is missing");
        says(&error.to_string(), &format!("`{missing}` is missing; start = \"{word}\""));
    }
}

#[test]
fn boundaries_turn_what_they_hold() {
    let turned = parsed(&FULL.replace("axes = \"xz\"", "axes = \"xy\"\nturn_deg = 90")).expect("x and y are held");
    assert_eq!((turned.boundaries[0].turn, turned.boundaries[1].turn), (0.0, std::f64::consts::FRAC_PI_2));
    let held = cutis::bodies::Model::new(&turned, 0).expect("the scene is valid");
    // the corner at (-20, -10, 2.5) mm comes to (10, -20) mm, and goes on by -2 mm along x
    let corner = held.grid.nearest([-20e-3, -10e-3, 2.5e-3]);
    let [x, y, z] = held.held[corner];
    assert!((x - 28e-3).abs() < 1e-12 && (y + 10e-3).abs() < 1e-12 && z == 0.0, "{:?}", held.held[corner]);
    says(
        &message_below("axes = \"xz\"", "axes = \"xz\"\nturn_deg = 90", 1),
        "turn_deg … x-y plane … axes = \"xz\" … hold x and y",
    );
    says(&message_below("axes = \"xz\"", "axes = \"xy\"\nturn_deg = inf", 1), "turn_deg = inf … finite … degrees");
}

#[test]
fn counts_outside_their_range_are_refused() {
    refused("cells = [8, 4]", "cells = [8, 0]", "cells[1] = 0; wanted a whole number from 1");
    refused("max_iterations = 500", "max_iterations = 0", "max_iterations = 0; wanted … change the count");
    refused("size_px = [320, 200]", "size_px = [320, 9000]", "size_px[1] = 9000 … to 8192");
    refused(
        "max_contacts = 8",
        "max_passes = 0",
        "max_passes = 0; wanted a whole number from 1 to 100; change the count",
    );
    refused("max_contacts = 8", "max_passes = 101", "max_passes = 101; wanted a whole number from 1 to 100");
    refused("max_contacts = 8", "max_pases = 2", "unknown key `max_pases` … did you mean `max_passes`?");
    refused("cells = [8, 4]", "cells = [4000000000, 4000000000]", "at most 67108863 … make cells fewer");
    refused("cells = [8, 2]", "cells = [70000, 70000]", "24500700005 nodes … make cells fewer");
}

#[test]
fn words_outside_their_list_are_refused() {
    refused(
        "preconditioner = \"block\"",
        "preconditioner = \"blok\"",
        "did you mean \"block\"? … none, jacobi, block, column, multigrid, direct",
    );
    refused("element = \"bbar\"", "element = \"enhance\"", "did you mean \"enhanced\"? … bbar, enhanced, plain");
    refused("law = \"fem\"", "mass = \"lumpy\"", "did you mean \"lumped\"? … lumped, uniform, consistent");
    let springs = "mass = \"consistent\"\nlaw = \"springs\"\nspring_stiffness_n_m = 1\nspring_damping_n_s_m = 0";
    refused(
        "law = \"fem\"",
        springs,
        "mass = \"consistent\" cannot be had with springs … \"uniform\", or law = \"fem\"",
    );
    refused("law = \"fem\"", "law = \"spring\"", "law = \"spring\" … did you mean \"springs\"?");
    refused("region = \"sides_x\"", "region = \"left\"", "region = \"left\" … bottom, top, sides");
    refused("axes = \"xz\"", "axes = \"xx\"", "axes = \"xx\" … different letters of xyz … axes = \"xyz\"");
    refused("axes = \"xz\"", "axes = \"\"", "one to three");
    refused("color = \"#102030\"", "color = \"red\"", "color = \"red\" … six hexadecimal digits … #e8b9a0");
    refused("\"probes.top\"", "\"probes.tpo\"", "probe = \"tpo\" … did you mean \"top\"? … known: top, grip");
}

#[test]
fn names_are_unique_and_plain() {
    refused("name = \"dermis\"", "name = \"hypodermis\"", "layer name \"hypodermis\" is taken by line 27 … rename");
    refused("name = \"grip\"", "name = \"top\"", "probe name \"top\" is taken by line … rename");
    refused("name = \"grip\"", "name = \"a,b\"", "without commas … choose a plain name");
    let tool = FULL.find("[[tool]]").expect("in FULL")..FULL.find("[contact]").expect("in FULL");
    let twice = FULL.replace("[contact]", &format!("{}[contact]", &FULL[tool]));
    let error = parsed(&twice).expect_err("two scalpels");
    says(&error.to_string(), "tool name \"scalpel\" is taken by line 69");
}

#[test]
fn skin_without_layers_is_refused() {
    let text = &SMALL[..SMALL.find("[[skin").expect("in SMALL")];
    let error = parsed(text).expect_err("no layer");
    assert_eq!(error.exit_code(), 2);
    says(&error.to_string(), "scenes/full.toml:5: the skin has no layers … [[skin.layer]]");
}

#[test]
fn springs_need_their_constants() {
    let error = parsed(&SMALL.replace("spring_stiffness_n_m = 5\n", "")).expect_err("no stiffness");
    says(&error.to_string(), "full.toml:5: the key `spring_stiffness_n_m` is missing … law = \"springs\"");
}

#[test]
fn boxes_without_nodes_are_refused() {
    let full = "box_mm = [[-20, -10, 0], [-15, 10, 2.5]]";
    refused(
        full,
        "box_mm = [[-19, -10, 0], [-16, 10, 2.5]]",
        "no node of the scene … ≤ x ≤ … cells of at most 5.0 mm … widen box_mm along x",
    );
    refused(full, "box_mm = [[-20, -10, 3], [-15, 10, 4]]", "≤ z ≤ … 2.5 mm … along z");
    refused(full, "box_mm = [[-20, -6, 0], [-15, -4, 2.5]]", "no node of the test form … along y");
    refused(full, "box_mm = [[-15, -10, 0], [-20, 10, 2.5]]", "at most … smaller coordinates first");
    refused(
        "region = \"box\"\nbox_mm = [[-20, -10, 0], [-15, 10, 2.5]]",
        "region = \"box\"",
        "key `box_mm` is missing",
    );
    let message = message_below("region = \"bottom\"", "region = \"bottom\"\nbox_mm = []", 1);
    says(&message, "`box_mm` has no effect … remove it");
}

#[test]
fn loads_beside_the_top_are_refused() {
    refused(
        "[[-20, -10], [0, 10]]",
        "[[-20, -10], [0, 11]]",
        "to 11.0 mm along y … from -10.0 to 10.0 … move the rectangle",
    );
    refused("[[-20, -10], [0, 10]]", "[[0, -10], [-20, 10]]", "smaller coordinates first");
    refused("[[-20, -10], [0, 10]]", "[[-20, -10], [0, -10]]", "-10.0 must be below … give the rectangle an area");
    refused("end_s = 0.2", "end_s = 0.1", "start_s and end_s … 0.1 must be below … end the load after its start");
}

#[test]
fn anchors_that_hold_nothing_or_act_on_no_node_are_refused() {
    refused("stiffness_n_m = 40\n", "stiffness_n_m = 0\n", "stiffness_n_m … 0");
    refused("region = \"sphere\"\ncentre_mm = [20, 10, 0]", "region = \"sphere\"\ncentre_mm = [20, 10, 90]", "no node");
    let bare = "[[anchor]]\nregion = \"sphere\"\ncentre_mm = [20, 10, 0]\nradius_mm = 6\n";
    let message = message_below(&format!("{bare}stiffness_n_m = 40\n"), bare, 0);
    says(&message, "key `stiffness_n_m` is missing");
    let text = FULL.replace("law = \"fem\"", "mass = \"consistent\"");
    let error = parsed(&text).expect_err("a consistent mass").to_string();
    says(&error, "consistent … \"lumped\" or \"uniform\", or hold the region with [[boundary]]");
    let line = 1 + text[..text.find("[[anchor]]").expect("FULL has one")].matches('\n').count();
    assert!(error.starts_with(&format!("scenes/full.toml:{line}: ")), "{error}");
}

#[test]
fn blades_without_an_edge_or_plane_are_refused() {
    let edge = "edge_mm = [[0, 0, 0], [10, 0, 0.5], [20, 0, 2]]";
    refused(edge, "edge_mm = [[0, 0, 0]]", "edge_mm has 1 different points … at least two");
    refused(edge, "edge_mm = [[0, 0, 0], [1, 0, 0], [1, 0, 0]]", "edge_mm has 2 different points");
    let finer = "edge_mm = [[0, 0, 0], [10, 0, 0.5], [20, 0, 2]]\nflat_spacing_mm = 1e-30";
    refused(edge, finer, "places that touch; at most 1e5 are looked at … flat_spacing_mm larger");
    refused(edge, "edge_mm = [[0, 0, 0], [1e30, 0, 0.5]]", "places that touch … mend edge_mm");
    refused("normal = [0, 2, 0]", "normal = [20, 0, 2]", "0.0 degrees from the line … across the flats");
    refused("normal = [0, 2, 0]", "normal = [0, 0, 0]", "0.0 degrees … wanted 90");
}

#[test]
fn probes_and_checks_need_their_keys() {
    refused(
        "[[probe]]\nname = \"grip\"\nkind = \"reaction\"\nregion = \"sides_x\"",
        "[[probe]]\nname = \"grip\"\nkind = \"reaction\"",
        "key `region` is missing … kind = \"reaction\"",
    );
    let message = message_below("axis = \"x\"", "axis = \"x\"\nregion = \"top\"", 1);
    says(&message, "`region` has no effect … displacement");
    refused("{ max = 0.01 }", "{ }", "key `min` is missing … `min`, `max` or both");
    refused("{ min = 0.1, max = 2.0 }", "{ min = 3, max = 2.0 }", "3.0 must be at most … swap");
    refused("{ max = 0.01 }", "{ max = 0.01, cells = 1 }", "`cells` has no effect … a length");
}

#[test]
fn bounds_of_a_length_know_the_cells() {
    let wanted = FULL.replace("\"contact_force_n_max\" = {", "\"cut.length_mm\" = { cells = 0.5,");
    let scene = parsed(&wanted).unwrap_or_else(|e| panic!("{e}"));
    let [min, max] = scene.checks[0].bounds(&scene.skins);
    let narrow = 1e3 * f64::min(0.04 / f64::from(scene.skins[0].cells[0]), 0.02 / f64::from(scene.skins[0].cells[1]));
    assert!((min - (0.1 - 0.5 * narrow)).abs() < 1e-12 && (max - (2.0 + 0.5 * narrow)).abs() < 1e-12, "{min} to {max}");
    assert_eq!(scene.checks[1].bounds(&scene.skins), [f64::NEG_INFINITY, 0.01]);
}

#[test]
fn bodies_say_who_they_are_and_where() {
    let block = "[[block]]\nsize_mm = [4, 4]\ncells = [2, 2]\n[[block.layer]]\nname = \"b\"\nthickness_mm = 1\ncells = 1\nyoung_kpa = 9\n\
                 poisson = 0.4\ndensity_kg_m3 = 1000\n";
    let with = |more: &str| parsed(&format!("{FULL}\n{more}")).expect_err(more).to_string();
    says(&with(block), "key `name` is missing … a block is called by its name");
    let named = block.replace("[[block]]\n", "[[block]]\nname = \"b\"\n");
    says(&with(&named), "key `position_mm` is missing … the middle of its bottom");
    let placed = named.replace("[[block]]\n", "[[block]]\nposition_mm = [0, 0, 9]\n");
    says(&with(&placed.replace("name = \"b\"\nsize", "name = \"skin\"\nsize")), "skin");
    says(
        &with(&format!("{placed}[[attach]]\nregion = \"top\"\nto = \"skim\"\n")),
        "to = \"skim\" … did you mean \"skin\"",
    );
    let itself = with(&format!("{placed}[[attach]]\nregion = \"top\"\nto = \"skin\"\n"));
    says(&itself, "\"skin\" is tied to itself … leave `to` away");
    let direction = with("[[attach]]\nregion = \"top\"\nslide = [0, 0, 0]\n");
    says(&direction, "slide");
    says(&with("[[plane]]\nname = \"p\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 0, 0]\n"), "normal");
    let rigid = "[[rigid]]\nname = \"r\"\nmass_g = 1\nposition_mm = [0, 0, 9]\n";
    says(&with(rigid), "key `box_mm` is missing … a box … or a sphere");
    says(&with(&format!("{rigid}box_mm = [1, 1, 1]\nradius_mm = 1\n")), "`radius_mm` has no effect … `box_mm`");
    says(&with("[[probe]]\nname = \"v\"\nkind = \"velocity\"\n"), "key `body` is missing");
    says(&with("[[probe]]\nname = \"v\"\nkind = \"velocity\"\nbody = \"skin\"\n"), "skin");
}

#[test]
fn loops_and_corrections_that_do_not_fit_are_refused() {
    let message = message_below("[contact]", "[contact]\nforces = \"penalty\"", 1);
    says(&message, "key `penalty_n_m` is missing … stiffness");
    says(&message_below("[contact]", "[contact]\npenalty_n_m = 5", 1), "`penalty_n_m` has no effect … penalty");
    let text = FULL.replace("correction = \"uncoupled\"", "correction = \"precomputed\"");
    let error = parsed(&text).expect_err("it has a blade").to_string();
    says(&error, "precomputed … uncut … exact");
    let tied = parsed(&format!("{FULL}\n[[attach]]\nregion = \"top\"\n")).expect_err("it is uncoupled").to_string();
    says(&tied, "uncoupled … drift apart … exact");
}

#[test]
fn a_scene_of_nothing_is_refused() {
    let error = parsed("title = \"\"\n[time]\nstep_ms = 1\nduration_s = 1\n").expect_err("no body").to_string();
    says(&error, "no body … `[skin]`");
}

#[test]
fn camera_in_its_target_is_refused() {
    let text = FULL.replace("eye_mm = [50, -70, 60]", "eye_mm = [1, 2, 3]\ntarget_mm = [1, 2, 3]");
    let error = parsed(&text).expect_err("no direction");
    says(&error.to_string(), "eye_mm and target_mm are the same point … move eye_mm");
}

/// FULL with its tool turned into a capsule with a hand written in the scene.
fn rounded() -> String {
    let (head, rest) = FULL.split_once("mesh = \"meshes/scalpel.obj\"\nmesh_unit_mm = 10\n").expect("FULL has a mesh");
    let rest = rest.replace(
        "points_mm = [[0, 0, 1]]\ntrajectory = \"incision.csv\"\n",
        "path_mm = [[0, 1, 2, 3], [0.3, 4, 5, 6]]\n",
    );
    let (before, blade) = rest.split_once("[tool.blade]").expect("FULL has a blade");
    let (_, after) = blade.split_once("[contact]").expect("FULL has contact");
    let round = "[tool.round]\nradius_mm = 2\npoints_mm = [[0, 0, 0], [0, 0, 5]]\n\n[contact]\nfilter = \"one\"";
    format!("{head}{before}{round}{after}")
}

#[test]
fn a_round_tool_has_a_mesh_of_its_own_and_a_hand_from_the_scene() {
    let scene = parsed(&rounded()).unwrap_or_else(|e| panic!("{e}"));
    let tool = &scene.tools[0];
    let round = tool.round.expect("it is round");
    assert_eq!((round.radius, round.ends), (2e-3, [[0.0; 3], [0.0, 0.0, 5e-3]]));
    assert!(tool.mesh.triangles.len() > 300 && tool.blade.is_none() && tool.points.is_empty());
    let (low, high) = tool.mesh.positions.iter().fold((0.0f64, 0.0f64), |(l, h), p| (l.min(p[2]), h.max(p[2])));
    assert!((low + 2e-3).abs() < 1e-15 && (high - 7e-3).abs() < 1e-15, "{low} to {high}");
    assert_eq!((tool.trajectory[1].time, tool.trajectory[1].position), (0.3, [4e-3, 5e-3, 6e-3]));
    assert_eq!(tool.trajectory[1].rotation, [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(scene.contact.expect("it has a tool").filter, Filter::One);
    let sphere = rounded().replace("[[0, 0, 0], [0, 0, 5]]", "[[1, 0, 0]]");
    let sphere = parsed(&sphere).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(sphere.tools[0].round.map(|r| r.ends), Some([[1e-3, 0.0, 0.0]; 2]));
}

#[test]
fn bad_round_tools_and_hands_are_refused() {
    let refused = |from: &str, to: &str, parts: &str| {
        let text = rounded();
        assert_eq!(text.matches(from).count(), 1, "{from}");
        let error = parsed(&text.replace(from, to)).expect_err("the input is bad");
        assert_eq!(error.exit_code(), 2, "{error}");
        says(&error.to_string(), parts);
    };
    let path = "path_mm = [[0, 1, 2, 3], [0.3, 4, 5, 6]]\n";
    refused(path, "", "full.toml:68: the key `trajectory` is missing … `path_mm`");
    refused(path, &format!("{path}trajectory = \"incision.csv\"\n"), "full.toml:72: `path_mm` has no effect … remove");
    refused("[0.3, 4", "[0, 4", "full.toml:72: time_s = 0.0 after 0.0; times must rise");
    refused("[0.3, 4, 5, 6]", "[0.3, 4, 5]", "full.toml:72: path_mm has 3 entries; wanted 4");
    refused("[0.3, 4", "[inf, 4", "path_mm[0] = inf … finite");
    refused("[[0, 1, 2, 3], [0.3, 4, 5, 6]]", "[]", "full.toml:72: path_mm has no rows … where the hand rests");
    refused(
        "radius_mm = 2",
        "radius_mm = -2",
        "radius_mm = -2.0; wanted a finite number above 0 (at least 1.2e-38 in SI), in mm",
    );
    refused("[[0, 0, 0], [0, 0, 5]]", "[]", "points_mm of a round tool has 0 points … a sphere's centre");
    refused("[0, 0, 5]]", "[0, 0, 0]]", "points_mm of a round tool has 2 points … two different");
    refused("\"one\"", "\"two\"", "filter = \"two\" … points, one, cones");
    let why = "`points_mm` has no effect here … `round` table";
    refused(path, &format!("{path}points_mm = [[0, 0, 1]]\n"), why);
    let blade = "[tool.blade]\nedge_mm = [[0, 0, 0], [1, 0, 0]]\nthickness_mm = 1\n[tool.round]";
    refused("[tool.round]", blade, "`blade` has no effect here … `round` table … remove");
    let bare = parsed(&FULL.replace("mesh = \"meshes/scalpel.obj\"\n", "")).expect_err("a blade needs a mesh");
    says(&bare.to_string(), "full.toml:68: the key `mesh` is missing … drawn");
}

/// FULL with its tool turned into points and lines.
fn wired() -> String {
    let text = FULL.replace("points_mm = [[0, 0, 1]]\n", "");
    let (before, blade) = text.split_once("[tool.blade]").expect("FULL has a blade");
    let (_, after) = blade.split_once("[contact]").expect("FULL has contact");
    format!("{before}[tool.lines]\nmesh = \"lines/good.obj\"\nmesh_unit_mm = 2\nradius_mm = 0.1\n\n[contact]{after}")
}

#[test]
fn a_tool_of_lines_has_the_vertices_that_its_file_uses() {
    let scene = parsed(&wired()).unwrap_or_else(|e| panic!("{e}"));
    let lines = scene.tools[0].lines.as_ref().expect("it has lines");
    assert_eq!(lines.positions, [[0.0, 0.0, -2e-3], [0.0; 3], [2e-3, 0.0, 4e-3]]);
    assert_eq!((&lines.segments[..], lines.radius), (&[[0, 1], [1, 2]][..], 1e-4));
    let contact = scene.contact.expect("it has a tool");
    assert_eq!((contact.filter, contact.angle_cone), (Filter::Own, 0.02));
    let chosen = wired().replace("[contact]", "[contact]\nfilter = \"cones\"\nangle_cone = 0");
    let contact = parsed(&chosen).unwrap_or_else(|e| panic!("{e}")).contact.expect("it has a tool");
    assert_eq!((contact.filter, contact.angle_cone), (Filter::Cones, 0.0));
}

#[test]
fn bad_lines_are_refused() {
    let refused = |from: &str, to: &str, parts: &str| {
        let text = wired();
        assert_eq!(text.matches(from).count(), 1, "{from}");
        let error = parsed(&text.replace(from, to)).expect_err("the input is bad");
        assert_eq!(error.exit_code(), 2, "{error}");
        says(&error.to_string(), parts);
    };
    let file = |name: &str, parts: &str| refused("lines/good.obj", &format!("lines/{name}.obj"), parts);
    file("none", "lines/none.obj: there are no points and lines … `l 1 2` … export");
    file("number", "lines/number.obj:2: `v 1 zero 0`; wanted `v` and three finite numbers; mend");
    file("short", "lines/short.obj:2: `v 1 0`; wanted");
    file("nan", "lines/nan.obj:2: `v 1 0 nan`; wanted");
    file("index", "lines/index.obj:3: `3` is no vertex; 2 `v` lines … 1 to 2, or -2 to -1; mend the index");
    file("zero", "lines/zero.obj:2: `0` is no vertex");
    file("back", "lines/back.obj:2: `-2` is no vertex");
    file("word", "lines/word.obj:2: `b` is no vertex");
    file("lone", "lines/lone.obj:3: the line has 1 vertices; wanted at least two … `p`");
    file("same", "lines/same.obj:3: vertices 1 and 2 … same place … leave one out");
    file("far", "lines/far.obj:3: vertex 2 is at [1e300, 0.0, 0.0] … mesh_unit_mm");
    file("lost", "mesh names lines/lost.obj … change mesh");
    refused("radius_mm = 0.1", "radius_mm = -1", "radius_mm = -1.0; wanted a finite number, 0 or more, in mm");
    let table = "[tool.lines]";
    let blade = "[tool.blade]\nedge_mm = [[0, 0, 0], [1, 0, 0]]\nthickness_mm = 1\n[tool.lines]";
    refused(table, blade, "`blade` has no effect here … `lines` table … remove");
    let round = "[tool.round]\nradius_mm = 1\npoints_mm = [[0, 0, 0]]\n[tool.lines]";
    refused(table, round, "`lines` has no effect here … `round` table … remove");
    refused("mass_g = 25", "mass_g = 25\npoints_mm = [[0, 0, 1]]", "`points_mm` has no effect here … `lines` table");
}

#[test]
fn a_filter_that_a_tool_cannot_have_is_refused() {
    let message = |text: String| parsed(&text).expect_err("the filter does not fit").to_string();
    let one = message(wired().replace("[contact]", "[contact]\nfilter = \"one\""));
    says(&one, "filter = \"one\" does not fit the tool \"scalpel\" … for tools with a `round` table … remove the key");
    let cones = message(rounded().replace("\"one\"", "\"cones\""));
    says(
        &cones,
        "filter = \"cones\" does not fit … for tools with a `lines` table, and this one is `round` … \"points\"",
    );
    let both = wired().replace("[contact]", "[contact]\nfilter = \"points\"");
    assert_eq!(parsed(&both).expect("it fits").contact.expect("it has a tool").filter, Filter::Points);
    let angle = message(both.replace("[contact]", "[contact]\nangle_cone = 0.1"));
    says(&angle, "`angle_cone` has no effect here … filter = \"points\" … remove");
    says(
        &message(FULL.replace("[contact]", "[contact]\nangle_cone = 0.1")),
        "`angle_cone` has no effect here … `lines` table",
    );
    let angle = message(wired().replace("[contact]", "[contact]\nangle_cone = -0.1"));
    says(&angle, "angle_cone = -0.1; wanted a finite number, 0 or more");
}

#[test]
fn missing_files_name_the_line_of_their_key() {
    refused("meshes/scalpel.obj", "meshes/knife.obj", "mesh names meshes/knife.obj … change mesh");
    refused("incision.csv", "lost.csv", "trajectory names lost.csv … change trajectory");
}

#[test]
fn bad_meshes_are_refused() {
    let message = |file| file_message("meshes/scalpel.obj", file);
    says(&message("meshes/nofaces.obj"), "meshes/nofaces.obj: the mesh has no triangles … export");
    says(&message("meshes/nan.obj"), "meshes/nan.obj: vertex 2 is at [NaN, 0.0, 0.0] … mend its `v` line");
    says(&message("meshes/bad.obj"), "meshes/bad.obj: not a readable OBJ mesh (face vertex … export");
    says(&message("meshes/text.obj"), "meshes/text.obj: not a readable OBJ mesh (position");
    says(&message("meshes/loose.obj"), "meshes/loose.obj: not a readable OBJ mesh (face parse");
}

#[test]
fn bad_trajectories_are_refused() {
    let message = |file| file_message("incision.csv", file);
    says(&message("nothing.csv"), "nothing.csv: the trajectory is empty … time_s,x_mm … record");
    says(&message("header.csv"), "header.csv: the trajectory is empty … at least one row");
    says(&message("order.csv"), "order.csv:1: the header is … wanted `time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw`");
    says(&message("columns.csv"), "columns.csv:3: the row has 7 columns; wanted 8 … complete or remove");
    says(&message("word.csv"), "word.csv:2: y_mm = `left` … finite number");
    says(&message("nan.csv"), "nan.csv:4: z_mm = `NaN` … remove the row");
    says(&message("inf.csv"), "inf.csv:2: x_mm = `inf`");
    says(&message("back.csv"), "back.csv:3: time_s = 0.5 after 0.5 … times must rise");
    says(&message("twist.csv"), "twist.csv:2: the quaternion … wanted 1 within 0.01 … scalar last");
}

#[test]
fn exit_codes_tell_input_from_machine() {
    let text = String::new;
    let code = |error: Error| error.exit_code();
    assert_eq!(code(gpu::Failed::NoAdapter { wanted: text(), found: text() }.into()), 3);
    assert_eq!(code(report::Refused::NoSteps.into()), 2);
    assert_eq!(code(gpu::Failed::Device { message: text() }.into()), 1);
}

/// Pieces that mean something in one of the three formats.
const PIECES: &[&str] = &[
    "nan",
    "inf",
    "-1",
    "0",
    "1e308",
    "1e-320",
    "4294967295",
    "-9223372036854775808",
    "[",
    "]]",
    "[[skin.layer]]\n",
    "\"",
    "'''",
    "\n",
    "=",
    "{",
    "}",
    ",",
    "#",
    "\u{feff}",
    "é",
    "\0",
    "f 1 -2 99\n",
    "v 1\n",
    "f\n",
    "/",
    "o\n",
];

/// Flips, cuts, doublings and insertions at places given as fractions of the length.
fn mutated(text: &str, edits: &[(u8, f64, usize)]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for &(kind, place, value) in edits {
        let at = (place * bytes.len() as f64) as usize;
        let end = (at + value % 40).min(bytes.len());
        match kind {
            0 if at < bytes.len() => bytes[at] ^= 1 << (value % 8),
            1 => bytes.truncate(at),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            _ => drop(bytes.splice(at..at, PIECES[value % PIECES.len()].bytes())),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn edits() -> impl Strategy<Value = Vec<(u8, f64, usize)>> {
    prop::collection::vec((0..9_u8, 0.0..1.0_f64, any::<usize>()), 1..5)
}

/// A scene, or an error that a user can read.
fn readable(outcome: Result<Scene>) {
    match outcome {
        Ok(scene) => assert!(scene.view.eye.iter().all(|coordinate| coordinate.is_finite())),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(!error.to_string().contains('\n'), "{error:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_scenes_never_panic(edits in edits()) {
        readable(parsed(&mutated(FULL, &edits)));
    }

    #[test]
    fn mutated_files_never_panic(mesh in edits(), hand in edits()) {
        let meshes: &'static str = mutated(QUAD, &mesh).leak();
        let hands: &'static str = mutated(HAND, &hand).leak();
        let file = Path::new("scenes/full.toml");
        let files = vec![("meshes/scalpel.obj", meshes), ("incision.csv", HAND)].leak();
        readable(parse(FULL, file, &Files::Embedded(files)));
        let files = vec![("meshes/scalpel.obj", QUAD), ("incision.csv", hands)].leak();
        readable(parse(FULL, file, &Files::Embedded(files)));
    }
}

#[test]
fn cuts_are_chosen_where_bricks_can_be_split() {
    refused("law = \"fem\"\nelement", "cut = \"splits\"\nlaw = \"fem\"\nelement", "cut = \"splits\" … \"split\"");
    let none = "cut_reserve_columns = 0\nlaw = \"fem\"\nelement";
    refused("law = \"fem\"\nelement", none, "cut_reserve_columns … 0 … 1");
    let both = "cut_reserve_columns = 5\ncut = \"remove\"\nlaw = \"fem\"\nelement";
    refused("law = \"fem\"\nelement", both, "cut_reserve_columns … cut = \"remove\" splits nothing");
    let springs = |key: &str| {
        let text = SMALL.replace("law = 'springs'\n", &format!("law = 'springs'\n{key}\n"));
        parsed(&text).expect_err("springs").to_string()
    };
    says(&springs("cut = 'remove'"), "scenes/full.toml:9: … cut … a blade removes springs; only bricks are split");
    says(&springs("cut_reserve_columns = 3"), "scenes/full.toml:9: … cut_reserve_columns … only bricks are split");
    // what is not asked for has room for two cuts right across either way
    let scene = parsed(FULL).expect("FULL is valid");
    assert_eq!(scene.skins[0].cut, Cut::Split { reserve_columns: 2 * (8 + 4 + 2) });
}

#[test]
fn the_direct_solver_does_not_split() {
    let direct = FULL.replace("preconditioner = \"block\"", "preconditioner = \"direct\"");
    let model = |text: &str| cutis::bodies::Model::new(&parsed(text).expect("a valid scene"), 0);
    let error = model(&direct).expect_err("a blade may split nodes");
    says(&error.to_string(), "direct solver … a blade splits … cut = \"remove\" or the preconditioner multigrid");
    assert_eq!(error.exit_code(), 2);
    let remove = direct.replace("law = \"fem\"\n", "law = \"fem\"\ncut = \"remove\"\n");
    assert!(model(&remove).is_ok(), "cells may go");
    assert!(model(FULL).is_ok(), "other solvers split");
}

/// A body that touches nothing, by what stands in its tables of time, solver and skin.
fn alone(time: &str, solver: &str, skin: &str) -> String {
    format!(
        "title = \"alone\"\n[time]\nstep_ms = 1\nduration_s = 1\n{time}\n[solver]\n{solver}\n[skin]\nsize_mm = [4, 4]\ncells = [2, 2]\n{skin}\n\
         [[skin.layer]]\nname = \"a\"\nthickness_mm = 1\ncells = 1\nyoung_kpa = 10\npoisson = 0.45\ndensity_kg_m3 = 1000\n"
    )
}

#[test]
fn integrator_is_read_and_has_a_default() {
    let read = |word: &str| parsed(&alone(word, "", "")).expect("the scene is valid").time.integrator;
    assert_eq!(read(""), Integrator::ImplicitEuler);
    assert_eq!(read("integrator = \"implicit_euler\""), Integrator::ImplicitEuler);
    assert_eq!(read("integrator = \"newmark\""), Integrator::Newmark);
    assert_eq!(read("integrator = \"symplectic_euler\""), Integrator::SymplecticEuler);
}

#[test]
fn integrator_that_is_not_known() {
    let error = parsed(&alone("integrator = \"newmarck\"", "", "")).expect_err("a misspelt word").to_string();
    says(&error, "scenes/full.toml:5: … newmarck … newmark");
}

#[test]
fn integrator_of_bodies_that_touch() {
    for word in ["newmark", "symplectic_euler"] {
        let to = format!("step_ms = 2.0\nintegrator = \"{word}\"");
        says(&message_below("step_ms = 2.0", &to, 1), &format!("integrator = \"{word}\" … tools … \"implicit_euler\""));
    }
}

#[test]
fn explicit_steps_of_a_consistent_mass() {
    let text = alone("integrator = \"symplectic_euler\"", "", "mass = \"consistent\"");
    says(&parsed(&text).expect_err("no diagonal").to_string(), "scenes/full.toml:5: … consistent … lumped or uniform");
    assert!(parsed(&text.replace("symplectic_euler", "newmark")).is_ok());
}

#[test]
fn explicit_steps_of_springs() {
    let springs = "law = \"springs\"\nspring_stiffness_n_m = 5\nspring_damping_n_s_m = 0";
    let text = alone("integrator = \"symplectic_euler\"", "", springs);
    says(
        &parsed(&text).expect_err("dampers are implicit").to_string(),
        "scenes/full.toml:5: … springs … \"implicit_euler\"",
    );
    assert!(parsed(&text.replace("symplectic_euler", "newmark")).is_ok());
}

#[test]
fn explicit_steps_need_no_solver() {
    let keys =
        ["preconditioner = \"column\"", "tolerance = 1e-4", "floor_n = 0", "max_iterations = 9", "refinements = 1"];
    for key in keys {
        let text = alone("integrator = \"symplectic_euler\"", key, "");
        let error = parsed(&text).expect_err("a key that does nothing").to_string();
        says(&error, &format!("scenes/full.toml:7: … {} … symplectic_euler", &key[..key.find(' ').expect("a key")]));
        assert!(parsed(&text.replace("symplectic_euler", "newmark")).is_ok());
    }
}

#[test]
fn neo_hookean_law_is_read() {
    let scene = parsed(&alone("", "", "law = \"neo_hookean\"")).expect("the scene is valid");
    assert!(matches!(scene.skins[0].law, Law::Hyperelastic(Material::NeoHookean)));
    assert_eq!(scene.solver.preconditioner, Preconditioner::Multigrid);
    let newmark = alone("integrator = \"newmark\"", "", "law = \"neo_hookean\"");
    assert!(parsed(&newmark).is_ok());
}

#[test]
fn neo_hookean_skin_under_a_blade() {
    let text =
        FULL.replace("element = \"bbar\"\ncorotational = false\n", "").replace("pre_strain = [0.2, -0.05]\n", "");
    let text = text.replace("law = \"fem\"", "law = \"neo_hookean\"");
    let line = 1 + text.lines().position(|l| l.starts_with("law")).expect("it is there");
    let error = parsed(&text).expect_err("no cut").to_string();
    says(&error, &format!("scenes/full.toml:{line}: law = \"neo_hookean\" … blade … \"fem\""));
}

#[test]
fn neo_hookean_skin_with_keys_of_other_bricks() {
    for key in ["element = \"bbar\"", "corotational = true"] {
        let error =
            parsed(&alone("", "", &format!("law = \"neo_hookean\"\n{key}"))).expect_err("one brick").to_string();
        says(&error, &format!("scenes/full.toml:12: … {} … hyperelastic", &key[..key.find(' ').expect("a key")]));
    }
    let strained = alone("", "", "law = \"neo_hookean\"") + "pre_strain = [0.1, 0]\n";
    says(&parsed(&strained).expect_err("no pre-strain").to_string(), "pre_strain … hyperelastic");
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
    let other = parsed(&(alone("", "", "") + "c10_kpa = 1\n")).expect_err("of another law").to_string();
    says(&other, "scenes/full.toml:19: … c10_kpa … mooney_rivlin");
}

#[test]
fn neo_hookean_skin_of_a_consistent_mass() {
    let error = parsed(&alone("", "", "law = \"neo_hookean\"\nmass = \"consistent\"")).expect_err("no such mass");
    says(&error.to_string(), "scenes/full.toml:12: … consistent … lumped");
}

#[test]
fn neo_hookean_skin_with_explicit_steps_or_refinements() {
    let explicit = alone("integrator = \"symplectic_euler\"", "", "law = \"neo_hookean\"");
    says(
        &parsed(&explicit).expect_err("implicit alone").to_string(),
        "scenes/full.toml:11: … symplectic_euler … newmark",
    );
    let refined = alone("", "refinements = 2", "law = \"neo_hookean\"");
    says(&parsed(&refined).expect_err("Newton alone").to_string(), "scenes/full.toml:11: … Newton … refinements");
    assert!(parsed(&alone("", "refinements = 0", "law = \"neo_hookean\"")).is_ok());
}
