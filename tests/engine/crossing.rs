//! Bodies that meet edge on edge: boxes turned on each other, a bar between two rows of nodes, crossed bars of tissue, a box beside a blade.

use cutis::scene::{Files, parse};
use cutis::step::{Platform, Simulation};
use std::path::Path;

const HEAD: &str = "title = \"crossing\"\n[time]\nstep_ms = 5\nduration_s = 0.5\n[contact]\nfriction = 0.3\nalarm_mm = 0.2\n\
                    max_contacts = 2000\n[[plane]]\nname = \"floor\"\nthrough_mm = [0, 0, 0]\nnormal = [0, 0, 1]\n";

fn rigid(name: &str, size: [f64; 3], at: [f64; 3], turn: f64) -> String {
    format!(
        "[[rigid]]\nname = \"{name}\"\nbox_mm = {size:?}\nmass_g = 0.4\nposition_mm = {at:?}\nturn_deg = [0.0, 0.0, {turn:?}]\n"
    )
}

fn block(name: &str, height: f64, size: [f64; 2], cells: [u32; 3]) -> String {
    format!(
        "[[block]]\nname = \"{name}\"\nposition_mm = [0, 0, {height:?}]\nsize_mm = {size:?}\ncells = [{}, {}]\n[[block.layer]]\n\
         name = \"tissue\"\nthickness_mm = 3\ncells = {}\nyoung_kpa = 50\npoisson = 0.45\ndensity_kg_m3 = 1000\n",
        cells[0], cells[1], cells[2]
    )
}

const STILL: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n";

const BLADE: &str = "v -4 0 0\nv 4 0 0\nv 4 0 2\nf 1 2 3\n";

/// A scene after these steps, and what its first probe shows.
fn after(steps: u32, text: &str) -> (Simulation, f64) {
    let files = Files::Embedded(&[("still.csv", STILL), ("blade.obj", BLADE)]);
    let scene = parse(text, Path::new("crossing.toml"), &files).unwrap_or_else(|e| panic!("{e}"));
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
    let mut step = || {
        let report = simulation.step(false).expect("the CPU path has no device to fail");
        assert!(report.warnings.is_empty(), "at {} s: {:?}", report.time, report.warnings);
        report
    };
    let last = (0..steps).map(|_| step()).last().expect("there are steps");
    let probe = last.probes.first().copied().unwrap_or(0.0);
    (simulation, probe)
}

#[test]
fn a_box_stays_on_another_however_it_is_turned() {
    for turn in [0.0, 1e-9, 1e-7, 1e-5, 1e-3, 0.01, 1.0, 30.0, 45.0, 90.0] {
        let boxes = rigid("lower", [6.0, 6.0, 3.0], [0.0, 0.0, 1.5], 0.0)
            + &rigid("upper", [6.0, 6.0, 3.0], [0.0, 0.0, 4.5], turn);
        let (end, _) = after(100, &format!("{HEAD}{boxes}"));
        let at = end.tools[1].position;
        assert!((at.z - 4.5e-3).abs() < 1e-8 && at.x.abs() < 1e-8, "turned by {turn} degrees: {at}");
    }
}

#[test]
fn a_bar_between_rows_of_nodes_rests_on_the_edges_between_them() {
    let skin = block("skin", 0.0, [20.0, 20.0], [16, 16, 3]) + "[[boundary]]\nbody = \"skin\"\nregion = \"bottom\"\n";
    for (x, turn) in [(0.6, 0.0), (0.6, 5.0), (0.3, 0.0), (0.6, 45.0)] {
        let bar = rigid("bar", [0.6, 24.0, 3.0], [x, 0.0, 4.51], turn);
        let (end, _) = after(100, &format!("{HEAD}{skin}{bar}"));
        let at = end.tools[0].position;
        // it sinks in by some micrometres
        assert!((4.49e-3..4.5e-3).contains(&at.z) && (at.x - 1e-3 * x).abs() < 5e-6, "{x} {turn}: {at}");
    }
}

#[test]
fn crossed_bars_without_a_node_where_they_meet_carry_each_other() {
    for cells in [5, 6] {
        let bars = block("lower", 0.0, [3.0, 30.0], [1, cells, 1]) + &block("upper", 3.01, [30.0, 3.0], [cells, 1, 1]);
        let probe = "[[probe]]\nname = \"middle\"\nkind = \"displacement\"\nbody = \"upper\"\npoint_mm = [0, 0, 1.5]\naxis = \"z\"\n";
        let (_, sunk) = after(100, &format!("{HEAD}{bars}{probe}"));
        assert!(sunk.abs() < 1e-4, "{cells} cells: {sunk} m");
    }
}

#[test]
fn a_box_beside_a_blade_stays_where_it_is_on_either_side() {
    for y in [2.8, -2.8, 2.3, -2.3, 2.201, -2.201] {
        let text = format!(
            "title = \"blade\"\n[time]\nstep_ms = 5\nduration_s = 0.1\ngravity_m_s2 = [0, 0, 0]\n[contact]\nfriction = 0.3\nalarm_mm = 0.2\n\
             [[tool]]\nname = \"scalpel\"\nmesh = \"blade.obj\"\ntrajectory = \"still.csv\"\nmass_g = 20\ninertia_g_mm2 = [4000, 6000, 4000]\n\
             [tool.blade]\nedge_mm = [[-4, 0, 0], [4, 0, 0]]\nnormal = [0, 1, 0]\nthickness_mm = 0.4\nedge_spacing_mm = 0.2\n\
             flat_spacing_mm = 1\ndepth_mm = 1\n{}",
            rigid("box", [4.0, 4.0, 4.0], [0.0, y, 0.0], 0.0)
        );
        let (end, _) = after(20, &text);
        let free = end.tools.iter().find(|tool| tool.free).expect("the box");
        assert!((free.position.y - 1e-3 * y).abs() < 1e-9, "{y}: {}", free.position);
    }
}
