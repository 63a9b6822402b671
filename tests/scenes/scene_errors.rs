//! Scenes: the numbers of a valid one in SI, and for each bad input the line and the way to mend it.

use cutis::error::{Error, Result};
use cutis::gpu;
use cutis::report;
use cutis::scene::{
    Correction, Cut, DeviceKind, Element, Files, Filter, Law, LoadKind, Preconditioner, ProbeKind, Region, Rendering,
    Role, Scene, Start, parse, read,
};
use proptest::prelude::*;
use std::path::Path;

/// Uses every table and nearly every key.
pub const FULL: &str = r##"title = "Incision of a three-layer patch"

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
law = "linear"
element = "bbar"
# of small strain
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

[[rest_spring]]
region = "sphere"
centre_mm = [20, 10, 0]
radius_mm = 6
stiffness_n_m = 40

[haptic]
rate_hz = 2000
"##;

/// A cube of 4 mm embedded in a grid.
const EMBEDDED: &str = r#"title = "A cube"

[time]
step_ms = 5
duration_s = 0.1

[skin]
mesh = "meshes/cube.obj"
embed = "bricks"
cells = [4, 4]

[[skin.layer]]
name = "cube"
cells = 4
young_kpa = 50
poisson = 0.4
density_kg_m3 = 1000

[[rest_spring]]
region = "bottom"
stiffness_n_m = 10
"#;

const CUBE: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

#[test]
fn an_embedded_surface_gives_the_grid_its_size() {
    let scene = parsed(EMBEDDED).expect("EMBEDDED is valid");
    let skin = &scene.skins[0];
    assert_eq!((skin.size, skin.layers[0].thickness, skin.cells), ([4e-3; 2], 4e-3, [4; 2]));
    assert!(skin.mesh.is_none() && skin.cut == Cut::Remove && !skin.can_be_carved());
    let surface = skin.embedded.as_ref().expect("it is");
    assert_eq!((surface.triangles().len(), surface.points().len()), (12, 8));
    assert!((surface.volume() / 64e-9 - 1.0).abs() < 1e-12);
    // a larger grid, in layers
    let text = EMBEDDED.replace("cells = [4, 4]", "cells = [6, 6]\nsize_mm = [6, 6]").replace(
        "cells = 4\n",
        "cells = 2\nthickness_mm = 2\nyoung_kpa = 20\npoisson = 0.4\ndensity_kg_m3 = 900\n[[skin.layer]]\nname = \"upper\"\n\
         thickness_mm = 2.5\ncells = 2\n",
    );
    let skin = &parsed(&text).expect("the grid is around it").skins[0];
    assert_eq!((skin.size, skin.layers.len()), ([6e-3; 2], 2));
}

/// Files that the scene names, good and bad.
const FILES: &[(&str, &str)] = &[
    ("meshes/scalpel.obj", QUAD),
    ("meshes/nofaces.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
    ("meshes/nan.obj", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"),
    ("meshes/bad.obj", "v 0 0 0\nf 1 2 9\n"),
    ("meshes/loose.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf /1 2 3\n"),
    ("meshes/text.obj", "v zero 0 0\n"),
    ("meshes/pair.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n"),
    ("meshes/cut.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n"),
    ("meshes/two.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n"),
    ("meshes/decimals.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1.5 2 3\n"),
    ("meshes/huge.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 99999999999999999999 2 3\n"),
    ("meshes/behind.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 2 3\n"),
    ("meshes/before.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"),
    ("meshes/far.obj", "v 0 0 0\nv 1 0 0\nv 0 1e300 0\nf 1 2 3\n"),
    ("meshes/continued.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n 2 9\nf 1 2 3\n"),
    ("meshes/marked.obj", "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 \\\n 1 # up\nf 1/1/1 2//2 \\\n\\\n3\nf -1 1 2\n"),
    ("meshes/cube.obj", CUBE),
    ("meshes/open.obj", "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\n"),
    ("meshes/turned.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n"),
    ("meshes/mixed.obj", "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"),
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

pub fn parsed(text: &str) -> Result<Scene> {
    parse(text, Path::new("scenes/full.toml"), &Files::Embedded(FILES))
}

/// Whether a message has the parts, which ` … ` divides, in this order.
fn in_order(message: &str, parts: &str) -> std::result::Result<(), String> {
    let mut rest = message;
    for part in parts.split(" … ") {
        let Some(found) = rest.find(part) else {
            return Err(format!("`{part}` is missing or out of order in: {message}"));
        };
        rest = &rest[found + part.len()..];
    }
    Ok(())
}

#[track_caller]
pub fn says(message: &str, parts: &str) {
    in_order(message, parts).unwrap_or_else(|e| panic!("{e}"));
}

/// Whether a scene with `to` in the place of `from`, as the rows of scene_errors/refused.txt have them, is refused with the parts.
fn refused_in(base: &str, from: &str, to: &str, parts: &str) -> std::result::Result<(), String> {
    let (before, after) = match base.split_once(from) {
        _ if from == "+" => (base, ""),
        Some((_, after)) if after.contains(from) => return Err(format!("`{from}` is there more than once")),
        Some(halves) => halves,
        None => return Err(format!("`{from}` is not there")),
    };
    let marked = before.len() + to.find('¦').unwrap_or(0);
    let line = 1 + format!("{before}{to}")[..marked].matches('\n').count();
    let Err(error) = parsed(&format!("{before}{}{after}", to.replace('¦', ""))) else {
        return Err("it is taken".into());
    };
    let (location, parts) = match parts.strip_prefix('@') {
        Some(parts) => (parts.split(" … ").next().unwrap_or_default().to_string(), parts),
        None => (format!("scenes/full.toml:{line}: "), parts),
    };
    let message = error.to_string();
    if error.exit_code() != 2 || message.contains('\n') || !message.starts_with(&location) {
        return Err(format!("exit code {}, wanted `{location}` in one line: {message}", error.exit_code()));
    }
    in_order(&message, parts)
}

#[track_caller]
fn refused(from: &str, to: &str, parts: &str) {
    refused_in(FULL, from, to, parts).unwrap_or_else(|e| panic!("{e}"));
}

#[test]
fn bad_input_is_refused_where_it_stands_with_the_way_to_mend_it() {
    let rows = include_str!("scene_errors/refused.txt").lines().enumerate().skip(3).filter(|(_, row)| !row.is_empty());
    let (mut base, mut from, mut tried, mut failed) = (String::new(), String::new(), 0, vec![]);
    for (number, row) in rows {
        if row.starts_with('#') {
            base = match row.rsplit_once('[').map_or("", |(_, name)| name) {
                "" => FULL.into(),
                "springs]" => SMALL.into(),
                "alone]" => alone("", "", ""),
                "round]" => rounded(),
                "lines]" => wired(),
                "embedded]" => EMBEDDED.into(),
                other => panic!("[{other} is no scene"),
            };
            continue;
        }
        let columns: Vec<String> = row.split('|').map(|column| column.trim().replace("\\n", "\n")).collect();
        let [first, to, parts] = &columns[..] else { panic!("{row}") };
        if !first.is_empty() {
            from.clone_from(first);
        }
        tried += 1;
        failed.extend(refused_in(&base, &from, to, parts).err().map(|e| format!("refused.txt:{}: {e}", number + 1)));
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(tried > 180, "{tried} rows");
    // counter-tests: what is valid, another line, another order, and what is not there or twice
    let friction = |from, to, parts| refused_in(FULL, from, to, parts).expect_err("it is not as the row says");
    assert_eq!(friction("friction = 0.2", "friction = 0.3", "friction"), "it is taken");
    assert!(
        friction("friction = 0.2", "¦\nfriction = -1", "friction")
            .starts_with("exit code 2, wanted `scenes/full.toml:")
    );
    assert!(
        friction("friction = 0.2", "friction = -1", "0 or more … friction = -1").contains("is missing or out of order")
    );
    assert_eq!(friction("friction = 0.3", "", ""), "`friction = 0.3` is not there");
    assert_eq!(friction("poisson", "", ""), "`poisson` is there more than once");
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
        let other = parsed(&FULL.replace("\"bbar\"", &format!("\"{word}\""))).expect("a known element");
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
    assert_eq!(scene.rest_springs[0].region, Region::Sphere { centre: [0.02, 0.01, 0.0], radius: 6e-3 });
    assert_eq!(scene.rest_springs[0].stiffness, 40.0);
    assert_eq!(scene.boundaries[1].displacement, [-2e-3, 0.0, 0.0]);
    let load = &scene.loads[0];
    assert_eq!(load.kind, LoadKind::Pressure { pressure: 1500.0, follower: false });
    assert_eq!((load.start, load.end), (0.1, 0.2));
    let top = scene.skins[0].thickness();
    assert_eq!(load.region, Region::Box { min: [-0.02, -0.01, top], max: [0.0, 0.01, top] });
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
fn an_empty_scene_is_called_empty() {
    let message = parsed(" \n").expect_err("nothing is no scene").to_string();
    assert!(message.starts_with("scenes/full.toml: the scene is empty"), "{message}");
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
    assert_eq!((contact.tolerance, contact.column_tolerance, contact.max_passes), (1e-3, 0.2, 16));
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
    let bare = with("[tool.device]\nkind = \"haply\"\n").tools[0].device.clone().expect("it has one");
    assert!(matches!(&bare.kind, DeviceKind::Haply { url, .. } if url == "ws://localhost:10001"));
}

#[test]
fn buttons_have_known_roles_each_once() {
    let from = "buttons = [\"active\", \"none\", \"freeze\"]";
    let many = format!("buttons = [{}]", ["\"none\""; 33].join(", "));
    refused(from, &many, "buttons = 33; wanted a whole number from 0 to 32");
}

#[test]
fn keys_of_another_kind_of_device_are_needless() {
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
}

#[test]
fn a_mesh_may_begin_with_a_mark_and_continue_its_lines() {
    let found =
        parsed(&FULL.replace("meshes/scalpel.obj", "meshes/marked.obj")).expect("both are as the format has them");
    let mesh = &found.tools[0].mesh;
    assert_eq!(mesh.positions, [[0.0; 3], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 0, 1]]);
}

const SMALL: &str = "title = 'a'\n[time]\nstep_ms = 1\nduration_s = 1\n[skin]\nsize_mm = [10, 10]\ncells = [2, 2]\nlaw = 'springs'\nspring_stiffness_n_m = 5\nspring_damping_n_s_m = 0\n[[skin.layer]]\nname = 'a'\nthickness_mm = 1\ncells = 1\ndensity_kg_m3 = 1000\n";

#[test]
fn absent_tables_have_defaults() {
    let scene = parsed(SMALL).expect("SMALL is valid");
    assert_eq!(scene.skins[0].layers[0].young, 0.0, "unused by springs");
    assert!(matches!(scene.skins[0].law, Law::Springs { stiffness: Some(5.0), damping: 0.0 }));
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
fn direct_is_for_hexahedra() {
    let scene = parsed(&FULL.replace("preconditioner = \"block\"", "preconditioner = \"direct\"")).expect("hexahedra");
    assert_eq!(scene.solver.preconditioner, Preconditioner::Direct);
    // the command line can ask for it after the scene was read
    let mut scene = parsed(SMALL).expect("SMALL is valid");
    scene.solver.preconditioner = Preconditioner::Direct;
    let error = cutis::bodies::Model::new(&scene, 0).expect_err("springs");
    says(
        &error.to_string(),
        "the direct solver is for hexahedra; this skin is of springs; take the preconditioner column",
    );
    assert_eq!(error.exit_code(), 2);
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
fn values_at_the_ends_of_a_range_are_taken() {
    let most = parsed(&FULL.replacen("poisson = 0.45", "poisson = 0.4999", 1)).expect("the limit is in the range");
    assert_eq!(most.skins[0].layers[0].poisson, 0.4999);
    let strained = parsed(&FULL.replace("pre_strain = [0.2, -0.05]", "pre_strain = [0.999, -0.499]"));
    assert!(strained.is_ok(), "both limits are excluded");
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
    assert_eq!(start("start = \"inside_out\""), Start::Inverted);
    assert_eq!(start("start = \"twist\"\nstart_deg = 180"), Start::Twist(std::f64::consts::PI));
}

#[test]
fn boundaries_turn_what_they_hold() {
    let turned = parsed(&FULL.replace("axes = \"xz\"", "axes = \"xy\"\nturn_deg = 90")).expect("x and y are held");
    assert_eq!((turned.boundaries[0].rotation, turned.boundaries[1].rotation), (0.0, std::f64::consts::FRAC_PI_2));
    let held = cutis::bodies::Model::new(&turned, 0).expect("the scene is valid");
    // the corner at (-20, -10, 2.5) mm comes to (10, -20) mm, and goes on by -2 mm along x
    let corner = held.grid.nearest([-20e-3, -10e-3, 2.5e-3]);
    let [x, y, z] = held.prescribed[corner];
    assert!((x - 28e-3).abs() < 1e-12 && (y + 10e-3).abs() < 1e-12 && z == 0.0, "{:?}", held.prescribed[corner]);
}

#[test]
fn names_are_unique_and_plain() {
    let tool = FULL.find("[[tool]]").expect("in FULL")..FULL.find("[contact]").expect("in FULL");
    let twice = FULL.replace("[contact]", &format!("{}[contact]", &FULL[tool]));
    let error = parsed(&twice).expect_err("two scalpels");
    says(&error.to_string(), "tool name \"scalpel\" is taken by line 69");
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
    let held = with("[[attach]]\nregion = \"top\"\nfriction = 0.3\n");
    says(&held, "`friction` has no effect here; what is tied along all axes does not slide");
    let negative = with("[[attach]]\nregion = \"top\"\nslide = [0, 0, 1]\nresistance_n = -1\n");
    says(&negative, "resistance_n = -1.0; wanted a finite number, 0 or more");
    says(&with("[[plane]]\nname = \"p\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 0, 0]\n"), "normal");
    let rigid = "[[rigid]]\nname = \"r\"\nmass_g = 1\nposition_mm = [0, 0, 9]\n";
    says(&with(rigid), "key `box_mm` is missing … a box … or a sphere");
    says(&with(&format!("{rigid}box_mm = [1, 1, 1]\nradius_mm = 1\n")), "`radius_mm` has no effect … `box_mm`");
    says(&with("[[probe]]\nname = \"v\"\nkind = \"velocity\"\n"), "key `body` is missing");
    says(&with("[[probe]]\nname = \"v\"\nkind = \"velocity\"\nbody = \"skin\"\n"), "skin");
}

#[test]
fn a_scene_of_nothing_is_refused() {
    let error = parsed("title = \"\"\n[time]\nstep_ms = 1\nduration_s = 1\n").expect_err("no body").to_string();
    says(&error, "no body … `[skin]`");
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
fn each_tool_that_carves_has_to_fit() {
    let tool = |name: &str, carve: &str| {
        format!(
            "[[tool]]\nname = \"{name}\"\nmass_g = 10\ninertia_g_mm2 = [1, 1, 1]\npath_mm = [[0, 0, 0, 29]]\n\
             [tool.round]\nradius_mm = 2\npoints_mm = [[0, 0, 0]]\n[tool.carve]\n{carve}"
        )
    };
    let body = alone("", "", "law = \"corotational\"\ncut = \"remove\"");
    let whole = "whole_cells = true\n";
    let text = |carve: &str| format!("{body}{}{}", tool("a", whole), tool("b", carve));
    assert!(parsed(&text(whole)).is_ok());
    let text = text("");
    let line = 1 + text[..text.rfind("[tool.carve]").expect("it carves")].matches('\n').count();
    let error = parsed(&text).expect_err("space of a corotational body").to_string();
    says(&error, &format!("scenes/full.toml:{line}: … the tool \"b\" carves … whole_cells = true"));
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
    let points = wired().replace("[contact]", "[contact]\nfilter = \"points\"");
    let contact = parsed(&points).unwrap_or_else(|e| panic!("{e}")).contact.expect("it has a tool");
    assert_eq!(contact.filter, Filter::Points);
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
    for &(kind, fraction, value) in edits {
        let at = (fraction * bytes.len() as f64) as usize;
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
fn a_cut_has_room_without_being_asked() {
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
    let remove = direct.replace("law = \"linear\"\n", "law = \"linear\"\ncut = \"remove\"\n");
    assert!(model(&remove).is_ok(), "cells may go");
    assert!(model(FULL).is_ok(), "other solvers split");
}

/// A body that touches nothing, by what stands in its tables of time, solver and skin.
pub fn alone(time: &str, solver: &str, skin: &str) -> String {
    format!(
        "title = \"alone\"\n[time]\nstep_ms = 1\nduration_s = 1\n{time}\n[solver]\n{solver}\n[skin]\nsize_mm = [4, 4]\ncells = [2, 2]\n{skin}\n\
         [[skin.layer]]\nname = \"a\"\nthickness_mm = 1\ncells = 1\nyoung_kpa = 10\npoisson = 0.45\ndensity_kg_m3 = 1000\n"
    )
}

/// What a body refuses once it runs names the line of the key that mends it.
#[test]
fn a_blade_of_too_many_pieces_has_its_line() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml");
    let text = std::fs::read_to_string(&path).expect("the scene is there");
    let line = |start: &str| text.lines().position(|line| line.starts_with(start)).map(|at| at + 1);
    let wanted = line("edge_spacing_mm").or(line("[tool.blade]")).expect("the scene has a blade");
    let scene = read(&path).expect("the scene is valid");
    let error = Error::from(cutis::bodies::Refused::SweptQuads { count: 300, most: 256 }).of_scene(&scene).to_string();
    assert!(error.contains(&format!("incision.toml:{wanted}: the blade sweeps 300 quads")), "{error}");
    // the counter-test: a body without one key to mend has the file alone
    let error = Error::from(cutis::bodies::Refused::RestSpringMass).of_scene(&scene).to_string();
    assert!(error.contains("incision.toml: rest-shape"), "{error}");
}
