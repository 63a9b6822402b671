//! Ramp, fade, stop, saturation, buttons, readings that are none.

use crate::bench::{TICK, plain, problem, reading, servo, spring, wall};
use cutis::haptic::device::{Limits, Reading, Workspace, Wrench};
use cutis::haptic::guard::{FADE_TIME, LATE_STEPS, LOST_AFTER, RAMP_TIME, STOP_TIME, VALID_FOR};
use cutis::haptic::servo::{Buttons, Problem, Record, Servo, Settings};
use cutis::scene::{Coupling, Role};
use glam::{DQuat, DVec3};

/// 1 mm into a rigid wall behind 1000 N/m: 1 N.
const DEPTH: DVec3 = DVec3::new(0.0, 0.0, -1e-3);

fn guarded() -> Settings {
    Settings { guarded: true, ..plain(spring(1000.0)) }
}

/// A servo in its element, with a clock.
struct Rig {
    servo: Servo,
    problem: Problem,
    time: f64,
}

impl Rig {
    fn new(settings: Settings) -> Self {
        Self { servo: servo(settings), problem: problem(wall(&[DVec3::ZERO], 0.0)), time: 0.0 }
    }

    /// Ticks for so many seconds on a fresh problem; the records.
    fn run(&mut self, seconds: f64, reading: Reading) -> Vec<Record> {
        self.problem.time = f64::INFINITY;
        self.go_on(seconds, reading)
    }

    /// The same on the problem as it is.
    fn go_on(&mut self, seconds: f64, reading: Reading) -> Vec<Record> {
        let tick = |_| {
            self.time += TICK;
            self.servo.tick(reading, &self.problem, self.time)
        };
        (0..(seconds / TICK).round() as u32).map(tick).collect()
    }
}

fn force(record: &Record) -> f64 {
    record.wrench.force.z
}

/// Largest change of the force between two records, N.
fn jump(records: &[Record]) -> f64 {
    records.windows(2).map(|pair| (force(&pair[1]) - force(&pair[0])).abs()).fold(0.0, f64::max)
}

#[test]
fn the_force_ramps_in_from_nothing() {
    let records = Rig::new(guarded()).run(0.3, reading(DEPTH));
    let step = TICK / RAMP_TIME;
    assert!((force(&records[0]) - step).abs() < 1e-6);
    assert!((force(&records[99]) - 0.5).abs() < 1e-6);
    assert!((force(&records[299]) - 1.0).abs() < 1e-6);
    assert!(jump(&records) < 1.01 * step, "{}", jump(&records));
    let bare = Rig::new(plain(spring(1000.0))).run(0.01, reading(DEPTH));
    assert!((force(&bare[0]) - 1.0).abs() < 1e-6, "the counter-test: unguarded it is there at once");
}

#[test]
fn the_force_fades_while_the_simulation_is_late_and_comes_back() {
    let mut rig = Rig::new(guarded());
    rig.run(0.3, reading(DEPTH));
    rig.problem.time = rig.time;
    let allowed = LATE_STEPS * rig.servo.settings.step;
    let in_time = rig.go_on(allowed - TICK, reading(DEPTH));
    assert!(in_time.iter().all(|r| (force(r) - 1.0).abs() < 1e-6) && rig.servo.counts().late == 0);
    let late = rig.go_on(2.0 * FADE_TIME, reading(DEPTH));
    assert_eq!(force(late.last().expect("ticks")), 0.0);
    assert!(jump(&late) < 1.01 * TICK / FADE_TIME);
    let back = rig.run(2.0 * FADE_TIME, reading(DEPTH));
    assert!((force(back.last().expect("ticks")) - 1.0).abs() < 1e-6 && jump(&back) < 1.01 * TICK / FADE_TIME);
    let counts = rig.servo.counts();
    assert_eq!((counts.fades, counts.stops), (1, 0));
    assert!((197..=200).contains(&counts.late), "{}", counts.late);
}

#[test]
fn a_lost_device_is_stopped_until_it_is_sound_again_and_the_tool_stays() {
    let mut rig = Rig::new(guarded());
    rig.run(0.3, reading(DEPTH));
    let lost = Reading { age: 1.01 * LOST_AFTER, ..reading(DEPTH) };
    let silent = rig.run(2.0 * STOP_TIME, lost);
    assert!(force(&silent[0]) > 0.5 && force(silent.last().expect("ticks")) == 0.0);
    // it comes back elsewhere: first nothing, then the ramp, the tool where it was
    let elsewhere = reading(DEPTH + DVec3::X);
    let back = rig.run(VALID_FOR + RAMP_TIME + 0.01, elsewhere);
    assert_eq!(force(&back[(VALID_FOR / TICK) as usize - 2]), 0.0, "latched");
    assert!((force(back.last().expect("ticks")) - 1.0).abs() < 1e-6 && jump(&back) < 1.01 * TICK / RAMP_TIME);
    assert!(back.iter().all(|r| (r.hand.position - DEPTH).length() < 1e-12));
    assert_eq!(rig.servo.counts().stops, 1);
    let mut short = Rig::new(guarded());
    short.run(0.3, reading(DEPTH));
    short.run(0.01, Reading { age: 0.99 * LOST_AFTER, ..reading(DEPTH) });
    assert_eq!(short.servo.counts().stops, 0, "the counter-test: a reading that is not too old");
}

#[test]
fn a_pose_that_is_no_number_stops_and_one_that_is_unsound_keeps_the_last() {
    let mut rig = Rig::new(guarded());
    rig.run(0.3, reading(DEPTH));
    let twisted = Reading { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.7), ..reading(DVec3::ONE) };
    let kept = rig.run(0.005, twisted);
    assert!(kept.iter().all(|r| r.hand.position == DEPTH && (force(r) - 1.0).abs() < 1e-6));
    let fast = Reading { velocity: DVec3::NAN, ..reading(DVec3::ONE) };
    assert!(rig.run(0.005, fast).iter().all(|r| r.velocity == DVec3::ZERO && (force(r) - 1.0).abs() < 1e-6));
    assert_eq!((rig.servo.counts().stops, rig.servo.counts().unsound), (0, 10));
    // but not for ever: where it is now, nobody knows
    let gone = rig.run(LOST_AFTER + 0.02, twisted);
    assert_eq!((force(gone.last().expect("ticks")), rig.servo.counts().stops), (0.0, 1));
    for broken in [
        reading(DVec3::NAN),
        reading(DVec3::new(f64::INFINITY, 0.0, 0.0)),
        Reading { rotation: DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0), ..reading(DEPTH) },
        Reading { age: f64::NAN, ..reading(DEPTH) },
    ] {
        let mut rig = Rig::new(guarded());
        rig.run(0.3, reading(DEPTH));
        let records = rig.run(0.01, broken);
        let finite = |r: &Record| r.wrench.force.is_finite() && r.hand.position == DEPTH;
        assert!(records.iter().all(finite) && force(records.last().expect("ticks")) == 0.0, "{broken:?}");
        assert_eq!(rig.servo.counts().stops, 1);
    }
}

#[test]
fn a_reading_beyond_the_workspace_is_none() {
    let reach = 0.5;
    let workspace = Workspace { reach, ..Workspace::SAME };
    let far = reading(DVec3::new(0.0, 1.001 * reach, 0.0));
    let fast = Reading { velocity: DVec3::new(1.001 * reach / TICK, 0.0, 0.0), ..reading(DEPTH) };
    for absurd in [far, fast, reading(DVec3::new(1e300, -1e300, 0.0))] {
        let mut rig = Rig::new(Settings { workspace, ..guarded() });
        rig.run(0.3, reading(DEPTH));
        let records = rig.run(0.01, absurd);
        let kept = |r: &Record| r.hand.position == DEPTH && r.velocity == DVec3::ZERO && r.wrench.force.is_finite();
        assert!(records.iter().all(kept), "{absurd:?}");
        assert_eq!(rig.servo.counts().unsound, 10, "{absurd:?}");
        let finite = absurd.position == DEPTH;
        assert_eq!(rig.servo.counts().stops, u64::from(!finite), "one that is somewhere keeps the force for a while");
    }
    // the counter-tests: just within, and without an end
    for (workspace, reading) in
        [(workspace, reading(DVec3::new(0.0, 0.999 * reach, 0.0))), (Workspace::SAME, reading(DVec3::Y))]
    {
        let mut rig = Rig::new(Settings { workspace, ..guarded() });
        let records = rig.run(0.01, reading);
        assert!(records.iter().all(|r| r.hand.position == reading.position));
        assert_eq!(rig.servo.counts().unsound, 0);
    }
}

#[test]
fn a_device_is_where_its_workspace_says_from_its_first_word_on() {
    let workspace = Workspace { position: DVec3::X, ..Workspace::SAME };
    let mut rig = Rig::new(Settings { workspace, ..guarded() });
    let silent = rig.run(0.3, Reading::at_rest(f64::INFINITY));
    assert!(silent.iter().all(|r| force(r) == 0.0 && r.hand.position == DVec3::ZERO), "before its first word");
    let records = rig.run(VALID_FOR + RAMP_TIME + 0.01, reading(DEPTH));
    assert!(records.iter().all(|r| r.hand.position == DVec3::X + DEPTH));
    assert!((force(records.last().expect("ticks")) - 1.0).abs() < 1e-6 && jump(&records) < 1.01 * TICK / RAMP_TIME);
    assert_eq!(rig.servo.counts().stops, 0);
}

#[test]
fn a_problem_that_is_no_number_gives_no_force() {
    let mut rig = Rig::new(plain(spring(1000.0)));
    let sound = rig.problem.clone();
    rig.problem.reduced.violation[0] = f64::NAN;
    let records = rig.run(0.01, reading(DEPTH));
    assert!(records.iter().all(|r| r.wrench == Wrench::default()));
    assert_eq!(rig.servo.counts().non_finite, 10);
    // a sound one after it is felt again, also when it is some ticks old
    rig.servo.settings.step = 1e3;
    rig.problem = Problem { number: 7, time: 0.0, ..sound };
    let records = rig.go_on(0.01, reading(DEPTH));
    let last = records.last().expect("ticks");
    assert!((force(last) - 1.0).abs() < 1e-3 && last.proxy.is_finite(), "{last:?}");
}

#[test]
fn a_loop_that_stood_still_ramps_in_again() {
    let mut rig = Rig::new(guarded());
    rig.run(0.5, reading(DEPTH));
    rig.time += 1.2 * LOST_AFTER;
    let after = rig.run(0.02, reading(DEPTH));
    assert!(force(after.last().expect("ticks")) == 0.0 && rig.servo.counts().stops == 1);
    let mut other = Rig::new(guarded());
    other.run(0.5, reading(DEPTH));
    other.time += 0.5 * LOST_AFTER;
    other.run(0.02, reading(DEPTH));
    assert_eq!(other.servo.counts().stops, 0, "the counter-test: a shorter pause");
}

#[test]
fn the_force_ends_at_the_limit_in_its_own_direction() {
    let (limits, turn) = (Limits { force: 0.5, torque: 0.0 }, DQuat::from_rotation_x(0.4));
    let workspace = Workspace { rotation: turn, scale: 2.0, ..Workspace::SAME };
    let mut rig = Rig::new(Settings { limits, workspace, force_scale: 0.8, ..plain(spring(1000.0)) });
    let (position, rotation) = workspace.from_scene(DEPTH, DQuat::IDENTITY);
    let pressed = Reading { position, rotation, ..Reading::at_rest(0.0) };
    let record = rig.run(0.001, pressed)[0];
    assert!((record.wrench.force.length() - 0.5).abs() < 1e-12);
    assert!((record.felt.force - DVec3::Z * 0.5).length() < 1e-9, "{}", record.felt.force);
    assert_eq!((rig.servo.counts().clamped, record.wrench.torque), (1, DVec3::ZERO));
    let light = Reading { position: position * 0.5, ..pressed };
    let record = rig.run(0.001, light)[0];
    assert!((record.felt.force - DVec3::Z * 0.4).length() < 1e-9 && rig.servo.counts().clamped == 1);
}

#[test]
fn a_device_without_torque_gets_none_and_one_with_it_gets_its_limit() {
    let arms = [DVec3::new(4e-3, 0.0, 0.0), DVec3::new(-4e-3, 0.0, 0.0)];
    let tilted = Reading { rotation: DQuat::from_rotation_y(0.05), ..reading(DEPTH) };
    let torque = |torque: f64| {
        let limits = Limits { force: f64::INFINITY, torque };
        let mut servo = servo(Settings { limits, ..plain(spring(1000.0)) });
        let record = servo.tick(tilted, &problem(wall(&arms, 1e-4)), TICK);
        (record.wrench.torque.length(), servo.counts().clamped)
    };
    assert_eq!(torque(0.0), (0.0, 0));
    let (free, _) = torque(f64::INFINITY);
    let (held, clamped) = torque(0.5 * free);
    assert!(free > 1e-3 && (held - 0.5 * free).abs() < 1e-12 && clamped == 1, "{free} N·m, {held} N·m");
}

#[test]
fn the_clutch_moves_the_hand_and_not_the_tool() {
    let buttons = Buttons::new(&[Role::Active, Role::Clutch, Role::Freeze]);
    let mut rig = Rig::new(Settings { buttons, ..guarded() });
    rig.run(0.3, reading(DEPTH));
    let moved = DEPTH + DVec3::new(0.03, 0.0, 0.01);
    let lifted = rig.run(2.0 * FADE_TIME, Reading { buttons: 0b010, ..reading(moved) });
    assert!(lifted.iter().all(|r| r.hand.position == DEPTH));
    assert_eq!(force(lifted.last().expect("ticks")), 0.0);
    let after = rig.run(2.0 * FADE_TIME, reading(moved));
    assert!(after.iter().all(|r| (r.hand.position - DEPTH).length() < 1e-12));
    assert!((force(after.last().expect("ticks")) - 1.0).abs() < 1e-6 && jump(&after) < 1.01 * TICK / FADE_TIME);
    // from there on the tool goes with the hand again, and turns about the hand's axes
    let turned = Reading { rotation: DQuat::from_rotation_x(0.1), ..reading(moved + DVec3::X * 1e-3) };
    let record = rig.run(TICK, turned)[0];
    assert!((record.hand.position - DEPTH - DVec3::X * 1e-3).length() < 1e-12);
    assert!(record.hand.rotation.dot(turned.rotation) > 1.0 - 1e-12);
}

#[test]
fn freezing_holds_tool_and_force() {
    // with damping, a proxy that jumps would be felt
    let coupling = Coupling { damping: 5.0, ..spring(1000.0) };
    let mut rig = Rig::new(Settings { buttons: Buttons::new(&[Role::Freeze]), guarded: true, ..plain(coupling) });
    rig.run(0.3, reading(DEPTH));
    let held = rig.run(0.05, Reading { buttons: 1, ..reading(4.0 * DEPTH) });
    assert!(held.iter().all(|r| r.hand.position == DEPTH && (force(r) - 1.0).abs() < 1e-6));
    let after = rig.run(0.05, reading(4.0 * DEPTH));
    assert!(after.iter().all(|r| (force(r) - 1.0).abs() < 1e-6), "no jump at its end");
    let deeper = rig.run(0.05, reading(5.0 * DEPTH));
    let (last, wanted) = (deeper.last().expect("ticks"), 2.0);
    assert!((force(last) - wanted).abs() < 1e-6, "and it goes on from there: {} N", force(last));
}

#[test]
fn the_blade_is_active_while_its_button_is_down_and_always_without_one() {
    let mut with = Rig::new(Settings { buttons: Buttons::new(&[Role::None, Role::Active]), ..guarded() });
    let down = Reading { buttons: 0b10, ..reading(DEPTH) };
    assert!(!with.run(TICK, reading(DEPTH))[0].active && !with.servo.felt().active);
    assert!(with.run(TICK, down)[0].active && with.servo.felt().active);
    assert!(Rig::new(guarded()).run(TICK, reading(DEPTH))[0].active);
}

#[test]
fn ticks_on_a_problem_from_before_a_cut_are_counted_and_the_jump_after_it() {
    let mut rig = Rig::new(plain(spring(1000.0)));
    rig.run(0.01, reading(DEPTH));
    assert_eq!((rig.servo.counts().stale, rig.servo.counts().cut_jump), (0, 0.0));
    rig.problem.announced = 1;
    rig.run(0.005, reading(DEPTH));
    assert_eq!(rig.servo.counts().stale, 5);
    // the cut skin gives way by half a millimetre
    (rig.problem.reduced.epoch, rig.problem.number) = (1, 7);
    rig.problem.reduced.violation[0] = 0.5e-3;
    rig.run(0.005, reading(DEPTH));
    let counts = rig.servo.counts();
    assert_eq!(counts.stale, 5);
    assert!((counts.cut_jump - 0.5).abs() < 1e-6, "{}", counts.cut_jump);
}

#[test]
fn a_force_that_jumps_while_the_hand_is_still_is_counted() {
    let jumps = |gives_way: f64, hand_moves: f64| {
        let mut rig = Rig::new(plain(spring(1000.0)));
        rig.run(0.05, reading(DEPTH));
        rig.problem.number = 7;
        rig.problem.reduced.violation[0] = gives_way;
        rig.run(0.005, reading(DEPTH + DVec3::Z * hand_moves));
        (rig.servo.counts().jumps, rig.servo.counts().jump_max)
    };
    let thrown = jumps(0.7e-3, 0.0);
    assert!(thrown.0 == 1 && thrown.1 > 0.65, "{thrown:?}");
    assert_eq!(jumps(0.4e-3, 0.0).0, 0, "below what counts");
    assert_eq!(jumps(0.0, 0.7e-3).0, 0, "the hand's own motion explains it");
}
