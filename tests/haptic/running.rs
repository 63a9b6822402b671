//! Servos with a simulation behind them: continuity of the force, simulated hands, runs by the wall clock.

use crate::bench::{TICK, at, measured, plain};
use crate::small;
use cutis::haptic::device::Device;
use cutis::haptic::devices::{Path, Recorder, Replay};
use cutis::haptic::haply::mock;
use cutis::haptic::servo::{Problem, Servo};
use cutis::haptic::{device::Workspace, device::Wrench};
use cutis::report::haptics::Recording;
use cutis::report::run::{Options, Summary, run};
use cutis::scene::{Contact, Coupling, DeviceKind, Element, Files, Law, Pose, Region, Round, Scene, Tool, parse};
use cutis::step::{Platform, Simulation};
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path as FilePath, PathBuf};

/// A ball pressed 0.4 mm into a small block in half a second.
fn press() -> Scene {
    let ball = Tool {
        name: "ball".into(),
        mass: 0.01,
        inertia: [1e-7; 3],
        round: Some(Round { radius: 1e-3, ends: [[0.0; 3]; 2] }),
        trajectory: vec![pose(0.0, 3.05), pose(0.5, 2.65)],
        ..Tool::default()
    };
    let mut scene = small::block([8e-3; 2], [4; 2], &[(2, 2e-3, 100e3, 0.4, 1100.0)]);
    (scene.time.duration, scene.view.frames) = (0.5, 0);
    scene.boundaries = vec![small::held(Region::Bottom, [true; 3])];
    (scene.tools, scene.contact) = (vec![ball], Some(Contact::default()));
    scene
}

/// Over the middle of the block, at a height in mm.
fn pose(time: f64, height: f64) -> Pose {
    Pose { time, position: [0.0, 0.0, 1e-3 * height], ..Pose::default() }
}

/// The same block under a tip, which always has one contact.
fn tip() -> Scene {
    let mut scene = press();
    let tool = &mut scene.tools[0];
    (tool.round, tool.points) = (None, vec![[0.0; 3]]);
    tool.trajectory = vec![pose(0.0, 2.05), pose(0.5, 1.65)];
    scene
}

/// The ball in a device.
fn held(kind: DeviceKind) -> Scene {
    let mut scene = press();
    scene.tools[0].device = Some(cutis::scene::Device { kind, ..Default::default() });
    scene
}

fn folder(name: &str) -> PathBuf {
    FilePath::new(env!("CARGO_TARGET_TMPDIR")).join(format!("haptic_run_{name}"))
}

fn options(name: &str, realtime: bool) -> Options {
    Options { realtime, record: name == "recorded", ..Options::new(Platform::Cpu64, folder(name)) }
}

fn ran(scene: &Scene, name: &str, realtime: bool) -> (Summary, Vec<Vec<f64>>) {
    let summary = run(scene, &options(name, realtime), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    let table = std::fs::read_to_string(folder(name).join("haptic.csv")).expect("a run with a tool writes it");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("numbers")).collect();
    (summary, table.lines().skip(1).map(row).collect())
}

/// Largest change of the force from one tick to the next over the press, and the force at its end, N; problems come a step late.
fn jumps(hz: f64) -> (f64, f64) {
    let mut scene = tip();
    scene.time.step = 1.0 / hz;
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let tool = simulation.tools[0].clone();
    let mut servo = Servo::new(plain(tool.coupling), at(tool.position));
    let (mut problem, mut tick) = (Problem::default(), 0u32);
    problem.reduced.position = tool.position;
    let (mut most, mut last): (f64, f64) = (0.0, 0.0);
    while simulation.time + 1.0 / hz < scene.time.duration + 1e-9 {
        simulation.step(false).expect("the CPU path does not fail");
        let number = problem.number + 1;
        // what the ticks know is one step old when it comes, and two when the next one does
        let end = simulation.time + 1.0 / hz;
        while f64::from(tick) * TICK < end {
            let time = f64::from(tick) * TICK;
            let (position, rotation) = tool.hand(time);
            let reading = cutis::haptic::device::Reading { rotation, ..crate::bench::reading(position) };
            let force = servo.tick(reading, &problem, time).wrench.force.length();
            most = most.max((force - last).abs());
            (last, tick) = (force, tick + 1);
        }
        problem.refill(&simulation.reduced[0], simulation.time, number, 0);
    }
    (most, last)
}

#[test]
fn the_force_of_a_slow_press_is_continuous_the_more_so_the_faster_the_simulation() {
    let rows = [20.0, 60.0, 200.0].map(|hz| (hz, jumps(hz)));
    for (hz, (jump, force)) in rows {
        measured(&format!("{hz} Hz: largest jump per tick {:.1} mN of {:.1} mN", jump * 1e3, force * 1e3));
    }
    let [slow, middle, fast] = rows.map(|(_, (jump, force))| jump / force);
    assert!(fast < middle && middle < slow, "{slow} {middle} {fast}");
    assert!(fast < 0.05 && slow < 0.5, "{slow} {middle} {fast}");
}

/// Forces of all ticks of a press and a withdrawal into viscous skin, N; without `creep` the skin stands still between two steps.
fn pressed_and_withdrawn(hz: f64, creep: bool) -> Vec<f64> {
    let mut scene = tip();
    (scene.time.step, scene.skins[0].rayleigh_stiffness) = (1.0 / hz, 0.01);
    // whose memory of a step is that of its viscosity; stiffened cells forget sooner
    scene.skins[0].law = Law::Fem { element: Element::Bbar, corotational: true };
    scene.tools[0].trajectory = vec![pose(0.0, 2.05), pose(0.25, 1.7), pose(0.3, 1.7), pose(0.45, 2.1)];
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
    let tool = simulation.tools[0].clone();
    let mut servo = Servo::new(plain(tool.coupling), at(tool.position));
    let (mut problem, mut forces) = (Problem::default(), vec![]);
    while simulation.time + 0.5 / hz < 0.45 {
        simulation.step(false).expect("the CPU path does not fail");
        problem.refill(&simulation.reduced[0], simulation.time, problem.number + 1, 0);
        if !creep {
            problem.reduced.rate.fill(0.0);
        }
        while (forces.len() as f64) * TICK < simulation.time + 1.0 / hz - 1e-9 {
            let time = forces.len() as f64 * TICK;
            let (position, rotation) = tool.hand(time);
            let reading = cutis::haptic::device::Reading { rotation, ..crate::bench::reading(position) };
            forces.push(servo.tick(reading, &problem, time).wrench.force.z);
        }
    }
    forces
}

#[test]
fn skin_that_creeps_between_steps_is_felt_without_a_sawtooth() {
    for hz in [50.0, 100.0, 200.0] {
        // while the tool goes in and out, away from its turns
        let jump = |creep: bool| {
            let forces = pressed_and_withdrawn(hz, creep);
            let jumps = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs()).enumerate();
            jumps.filter(|(k, _)| (80..240).contains(k) || (330..380).contains(k)).map(|j| j.1).fold(0.0, f64::max)
        };
        let (with, without) = (jump(true), jump(false));
        measured(&format!("{hz} Hz: largest jump {:.2} mN, without creep {:.2} mN", with * 1e3, without * 1e3));
        assert!(with < 0.5 * without, "{hz} Hz: {with} N, without creep {without} N");
    }
}

#[test]
fn a_recorded_hand_feels_under_the_scenes_clock_what_it_is_rendered() {
    let (summary, rows) = ran(&press(), "recorded", false);
    assert_eq!(rows.len(), 500);
    let last = rows.last().expect("rows");
    assert!((last[4] - 2.65).abs() < 1e-9 && last[10] > 0.03, "{last:?}");
    assert!(rows.iter().all(|row| row[15] == 1.0), "no ramp where the scene asks for no device");
    let report = summary.report.haptic;
    assert_eq!((report.stops, report.fades, report.clamped, report.missed), (0, 0, 0, None));
    assert!(report.force_jump_n_max > 0.0 && report.force_jump_n_max < 0.2 * report.force_n_max, "{report:?}");
    // and its recording is the hand that it followed
    let kept = std::fs::read_to_string(folder("recorded").join("hand_ball.csv")).expect("asked for");
    let last = kept.lines().last().expect("rows").split(',').map(|cell| cell.parse::<f64>().expect("numbers"));
    assert_eq!((kept.lines().count(), last.skip(3).step_by(100).next()), (501, Some(2.65)), "{kept}");
}

#[test]
fn a_simulated_hand_gives_way_and_moves_the_tool() {
    let soft = DeviceKind::Hand { mass: 0.15, stiffness: 100.0, damping: 5.0, encoder: 2e-6 };
    let (summary, rows) = ran(&held(soft), "hand", false);
    let (_, recorded) = ran(&press(), "hand_recorded", false);
    let (felt, unyielding) = (rows.last().expect("rows"), recorded.last().expect("rows"));
    let yielded = felt[4] - 2.65;
    // the hand's spring and damper hold the force
    let speed = (felt[4] - rows[rows.len() - 51][4]) / 50.0; // m/s
    let held = yielded * 1e-3 * 100.0 + 5.0 * speed;
    assert!((held / felt[10] - 1.0).abs() < 0.05, "{yielded} mm at {speed} m/s, {} N", felt[10]);
    assert!(felt[10] < 0.9 * unyielding[10], "{} N instead of {} N", felt[10], unyielding[10]);
    assert!(((felt[4] * 500.0).round() - felt[4] * 500.0).abs() < 1e-6, "in steps of 2 µm: {}", felt[4]);
    assert!(summary.report.haptic.energy_out_j < 1e-6, "{:?}", summary.report.haptic);
}

/// A ball that a hand moves about at random on the skin: in and out, and sideways.
fn shaken(seed: u64, passivity: bool) -> cutis::report::HapticReport {
    let mut generator = cutis::math::random::Random::new(seed);
    let mut random = |low: f64, high: f64| generator.between(low, high);
    let mut scene = held(DeviceKind::Replay);
    let tool = &mut scene.tools[0];
    tool.trajectory = vec![pose(0.0, 3.05)];
    for k in 1..=40 {
        let at = [random(-0.5, 0.5), random(-0.5, 0.5), random(2.5, 3.1)];
        tool.trajectory.push(Pose { position: at.map(|c| 1e-3 * c), ..pose(f64::from(k) * 0.0125, 0.0) });
    }
    tool.coupling = Coupling { stiffness: 1000.0, damping: 0.0, ..Coupling::default() };
    tool.device.as_mut().expect("it is held").passivity = passivity;
    // nothing that takes energy, and problems of 20 ms
    scene.time.step = 0.02;
    (scene.skins[0].rayleigh_stiffness, scene.skins[0].rayleigh_mass) = (0.0, 0.0);
    scene.contact = Some(Contact { friction: 0.0, ..Contact::default() });
    ran(&scene, &format!("shaken_{seed}_{passivity}"), false).0.report.haptic
}

#[test]
fn a_hand_that_moves_at_random_on_the_skin_gets_no_energy_out_of_it() {
    // what a force, held over one tick, may give before the next reading shows it: 0.6 mm in 12.5 ms
    let tick = 0.6e-3 / 12.5;
    let mut without: f64 = 0.0;
    for seed in 1..=6 {
        let (with, free) = (shaken(seed, true), shaken(seed, false));
        let uncontrolled = free.energy_out_j / free.force_n_max / tick;
        without = without.max(uncontrolled);
        let out = with.energy_out_j / with.force_n_max / tick;
        measured(&format!(
            "seed {seed}: {out:.3} ticks of the largest force, {uncontrolled:.3} without the controller"
        ));
        // where the path turns on a tick, what that tick gives is seen one tick later
        assert!(with.force_n_max > 0.01 && out < 0.25, "seed {seed}: {with:?}");
    }
    assert!(without > 2.0, "the counter-test: {without} without the controller");
}

#[test]
fn a_hand_at_rest_and_a_frame_of_its_own() {
    let framed = |kind| {
        let mut scene = held(kind);
        let device = scene.tools[0].device.as_mut().expect("it is held");
        (device.position, device.scale) = ([1e-3, 2e-3, 3e-3], 2.0);
        device.rotation = DQuat::from_rotation_y(FRAC_PI_2).to_array();
        scene
    };
    let (_, rows) = ran(&framed(DeviceKind::Null), "null", false);
    assert!(rows.iter().all(|row| (row[4] - 3.05).abs() < 1e-9 && row[10] == 0.0));
    let (_, rows) = ran(&framed(DeviceKind::Replay), "frame", false);
    let (_, recorded) = ran(&press(), "frame_recorded", false);
    for (row, plain) in rows.iter().zip(&recorded).skip(250) {
        assert!((row[4] - plain[4]).abs() < 1e-9 && (row[10] - plain[10]).abs() < 1e-6, "{row:?} {plain:?}");
    }
}

#[test]
fn a_run_by_the_wall_clock_takes_its_time_and_leaves_every_tick() {
    let begin = std::time::Instant::now();
    let (summary, rows) = ran(&press(), "live", true);
    let took = begin.elapsed().as_secs_f64();
    let report = summary.report.haptic;
    assert!(took > 0.49, "half a second of scene in {took} s");
    let [missed, lost] = [report.missed, report.records_lost].map(|count| count.expect("by the wall clock"));
    // each deadline has a tick or is missed; the run ends once the last step is done
    let due = rows.len() as u64 + missed + lost;
    assert!(due as f64 > 490.0 && due as f64 <= took * 1000.0 + 1.0, "{} rows, {missed} missed, {took} s", rows.len());
    assert!(rows.len() > 200, "{} rows, {missed} missed", rows.len());
    assert!(rows.windows(2).all(|pair| pair[0][0] < pair[1][0]), "times rise");
    let period = report.period_us.p50.expect("measured");
    assert!((period / 1000.0 - 1.0).abs() < 0.2, "{period} µs between ticks");
    let whole = rows.iter().rev().find(|row| row[15] == 1.0);
    match whole {
        Some(row) => assert!(row[10] > 0.005, "{row:?} {report:?}"),
        None => println!("the machine was too busy for a force: {} late ticks", report.late_ticks),
    }
    assert!(rows[0][15] < 0.1, "it ramps in");
    measured(&format!("{report:?}"));
}

#[test]
fn a_haply_device_asks_for_the_wall_clock_and_for_its_service() {
    // nothing listens at port 1
    let nobody = DeviceKind::Haply { url: "ws://127.0.0.1:1".into(), device: String::new(), grip: String::new() };
    let scene = held(nobody);
    let said = |realtime: bool| {
        let ended = run(&scene, &options("haply", realtime), &mut |_| {});
        ended.expect_err("no such device").to_string()
    };
    let (scene_clock, wall_clock) = (said(false), said(true));
    assert!(scene_clock.contains("\"ball\"") && scene_clock.contains("--realtime"), "{scene_clock}");
    assert!(wall_clock.contains("ws://127.0.0.1:1"), "{wall_clock}");
}

/// The shipped scene for two hands, coarser, with longer steps for a machine that is busy, on stand-ins that follow its paths.
#[test]
fn two_hands_feel_the_skin_on_two_stand_ins() {
    let path = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_hands.toml");
    let mut scene = cutis::scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
    (scene.skins[0].cells, scene.time.step, scene.time.duration, scene.view.frames) = ([8, 8], 0.05, 1.4, 0);
    let start = |tool: &cutis::scene::Tool| {
        // a stand-in's time is frames: at half the path's times it is in the skin early, also where frames get lost
        let path = tool.trajectory.iter().map(|pose| Pose { time: 0.5 * pose.time, ..*pose }).collect();
        let options = mock::Options { port: 0, path, ..mock::Options::default() };
        mock::Mock::start(options).unwrap_or_else(|e| panic!("{e}"))
    };
    let mocks: Vec<mock::Mock> = scene.tools.iter().map(start).collect();
    for (tool, mock) in scene.tools.iter_mut().zip(&mocks) {
        let device = tool.device.as_mut().expect("both have one");
        let DeviceKind::Haply { url, .. } = &mut device.kind else { panic!("{:?}", device.kind) };
        *url = mock.url();
    }
    let summary = run(&scene, &options("two_hands", true), &mut |_| {}).unwrap_or_else(|e| panic!("{e}"));
    let report = summary.report.haptic;
    measured(&format!("{report:?}"));
    assert_eq!((report.unsound, report.non_finite, report.device_faults), (0, 0, Some(0)), "{report:?}");
    let table = std::fs::read_to_string(folder("two_hands").join("haptic.csv")).expect("written");
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("numbers")).collect())
        .collect();
    for (tool, mock) in mocks.iter().enumerate() {
        let own: Vec<&Vec<f64>> = rows.iter().filter(|row| row[1] == tool as f64).collect();
        let most = own.iter().map(|row| row[10]).fold(0.0, f64::max);
        assert!(own.len() > 200 && most > 0.01, "tool {tool}: {} ticks, {most} N", own.len());
        assert!(mock.record().frames > 200, "tool {tool}: {:?}", mock.record());
        // two stand-ins: the tools are where their own hands are
        assert!(own.iter().all(|row| (row[2] - [-12.0, 11.0][tool]).abs() < 1.0), "tool {tool} is elsewhere");
    }
}

#[test]
fn what_a_recorder_writes_is_a_hand_that_a_scene_reads() {
    let scene = press();
    let workspace = Workspace { position: DVec3::X, scale: 3.0, ..Workspace::SAME };
    let path = Path { poses: scene.tools[0].trajectory.as_slice().into(), workspace };
    std::fs::create_dir_all(folder("recorder")).expect("writable");
    let file = folder("recorder").join("hand.csv");
    let (mut recorder, rows) = Recorder::new(Box::new(Replay(path.clone())), workspace, 500);
    let mut recording = Recording::create(&file, rows).expect("the folder is there");
    for k in 0..500 {
        let time = f64::from(k) * TICK;
        recorder.read(time);
        recorder.write(time, Wrench { force: DVec3::Z, torque: DVec3::ZERO });
    }
    recording.drain().expect("the folder is there");
    let soon = std::fs::read_to_string(&file).expect("written").lines().count();
    assert!(soon > 430, "{soon} lines before its end: a killed run leaves what it has recorded");
    recorder.close().expect("nothing was lost");
    recording.finish().expect("the folder is there");
    let text = std::fs::read_to_string(&file).expect("written");
    assert!(text.lines().nth(1).is_some_and(|line| line.ends_with(",0,0,1,0,0,0")), "{text}");
    let ball = "title = \"a ball\"\n[time]\nstep_ms = 5\nduration_s = 0.5\n[[tool]]\nname = \"ball\"\nmass_g = 10\n\
                inertia_g_mm2 = [100, 100, 100]\ntrajectory = \"hand.csv\"\n[tool.round]\nradius_mm = 1\npoints_mm = [[0, 0, 0]]\n";
    let read = parse(ball, FilePath::new("ball.toml"), &Files::Folder(folder("recorder")));
    let read = read.unwrap_or_else(|e| panic!("{e}"));
    let [found, wanted] = [&read.tools[0].trajectory, &scene.tools[0].trajectory]
        .map(|poses| cutis::bodies::rigid::along(poses, 0.3).expect("samples").0);
    assert!((found - wanted).length() < 1e-12, "{found} {wanted}");
    // a full one says so
    let (mut full, _rows) = Recorder::new(Box::new(Replay(path)), workspace, 1);
    full.read(0.0);
    full.read(TICK);
    assert!(full.close().expect_err("full").to_string().contains("1 ticks are not in it"));
}

#[test]
fn a_blade_that_is_not_active_presses_and_does_not_cut() {
    let path = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("scenes/incision.toml");
    let mut scene = cutis::scene::read(&path).unwrap_or_else(|e| panic!("{e}")).in_test_form();
    scene.skins[0].cells = [16, 12];
    let cut_after = |sharp: bool, steps: u32| {
        let mut simulation = Simulation::new(&scene, &Platform::Cpu64).expect("the scene fits");
        simulation.tools[0].sharp = sharp;
        let mut force: f64 = 0.0;
        for number in 1..=steps {
            let report = simulation.step(false).expect("the CPU path does not fail");
            force = report.contact.on_tool.first().map_or(0.0, |f| f[2]).max(force);
            if simulation.totals().links > 0 {
                return (Some(number), force);
            }
        }
        (None, force)
    };
    let (first, sharp) = cut_after(true, 150);
    let first = first.expect("the counter-test: the sharp blade cuts");
    let (none, blunt) = cut_after(false, first + 10);
    assert_eq!(none, None);
    assert!(blunt > sharp && sharp > 0.0, "blunt {blunt} N, sharp {sharp} N");
}
