//! Complete tick of one device: from a reading and the newest problem to force and torque.
//!
//! A tick places the reading in the scene (workspace, clutch), renders, limits, and observes the energy. It allocates nothing (once
//! [`Renderer::reserve`] has had the largest problem), takes no lock, writes no log and never waits; its result is a [`Record`], its
//! counters are [`Counts`].
//! Units: m, rad, N, N·m, s, J; forces of records act on the hand, in the device's frame.
//!
//! [`cells`] are the exchange between the simulation and a servo: the newest problem in one direction, the newest hand pose in the other.
//! Each passes through a triple buffer, so neither side waits for the other and every read is consistent. Problems are written into
//! existing buffers, so a hand-over allocates nothing once all three have the size of the largest problem.

use super::device::{Limits, Reading, Workspace, Wrench};
use super::guard::{Guard, LATE_STEPS, LOST_AFTER, Passivity, Signs};
use super::{Hand, MAX_SWEEPS, Reduced, Renderer, Tick};
use crate::bodies::rigid::rotation_vector;
use crate::scene::{self, Coupling, Rendering, Role};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use triple_buffer::{Input, Output, triple_buffer};

/// Time budget of the sweeps in a live tick: a third of the tick at 1 kHz, so that a crowded contact costs accuracy and not the deadline.
pub const BUDGET: Duration = Duration::from_micros(300);
/// A problem of at most this age in ticks is based on the current hand pose and sets the proxy; for an older one the proxy has moved on.
const FRESH: f64 = 1.5;

/// Number of simulation steps over which the skin's last motion is extrapolated: a problem is up to two steps old before the next one
/// arrives, and a longer motion has been stopped by something.
const MOST_STEPS: f64 = 2.0;
/// Change of the force in a tick, beyond what the hand's motion in the last steps explains, that counts as a jump, N: that of a blade that is
/// thrown through skin was 28 N, a straight cut has 0.1 N.
const JUMP: f64 = 0.5;

/// Buttons by role; bit k for button k.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buttons {
    /// The blade cuts while one of these is pressed; without any it always cuts.
    pub active: u32,
    /// While one of these is pressed the hand moves and the tool stays.
    pub clutch: u32,
    /// While one of these is pressed tool and force are frozen.
    pub freeze: u32,
}

impl Buttons {
    /// From the roles of buttons 0, 1, …
    pub fn new(roles: &[Role]) -> Self {
        let of = |wanted: Role| {
            let down = roles.iter().enumerate().filter(|(k, role)| **role == wanted && *k < 32);
            down.fold(0, |bits, (k, _)| bits | 1 << k)
        };
        Self { active: of(Role::Active), clutch: of(Role::Clutch), freeze: of(Role::Freeze) }
    }
}

/// Settings of a servo.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// Length of a tick, s.
    pub tick: f64,
    /// Length of a step of the simulation, s.
    pub step: f64,
    /// Virtual coupling between hand and tool.
    pub coupling: Coupling,
    /// Rendering method.
    pub rendering: Rendering,
    /// Newtons on the hand per newton on the tool.
    pub force_scale: f64,
    /// Largest force and torque requested from the device.
    pub limits: Limits,
    /// Placement of the device's frame.
    pub workspace: Workspace,
    /// Buttons by role.
    pub buttons: Buttons,
    /// Use the passivity controller.
    pub passivity: bool,
    /// Resolution of the device's position sensors, m.
    pub resolution: f64,
    /// Use the guard: ramp, fade when the simulation is late, stop when the device is lost.
    pub guarded: bool,
    /// Time budget of the sweeps; `None` where results must not depend on a clock.
    pub budget: Option<Duration>,
    /// Maximum number of sweeps per tick.
    pub max_sweeps: u32,
    /// Number of rows of the largest problem.
    pub rows: usize,
}

impl Settings {
    /// Settings for a scene's device with these lengths of ticks and steps, s; `can` are the device's limits.
    pub fn new(device: &scene::Device, coupling: Coupling, can: Limits, [tick, step]: [f64; 2]) -> Self {
        Self {
            tick,
            step,
            coupling,
            rendering: device.rendering,
            force_scale: device.force_scale,
            limits: Limits { force: can.force.min(device.max_force), torque: can.torque.min(device.max_torque) },
            workspace: Workspace::new(device),
            buttons: Buttons::new(&device.buttons),
            passivity: device.passivity,
            resolution: 0.0,
            guarded: true,
            budget: None,
            max_sweeps: MAX_SWEEPS,
            rows: 0,
        }
    }
}

/// Record of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// s
    pub time: f64,
    /// Hand pose in the scene.
    pub hand: Hand,
    /// m/s
    pub velocity: DVec3,
    /// Position of the proxy in the scene, m.
    pub proxy: DVec3,
    /// Wrench written to the device, in its frame.
    pub wrench: Wrench,
    /// The same in the scene's frame, at the tool's origin.
    pub felt: Wrench,
    /// Age of the problem, s.
    pub age: f64,
    /// Factor of ramp, fade and stop.
    pub gain: f64,
    /// Gauss–Seidel sweeps.
    pub sweeps: u32,
    /// True if the blade cuts.
    pub active: bool,
}

/// Tick of one device and its state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Servo {
    /// Settings.
    pub settings: Settings,
    /// Passivity observer and controller.
    pub passivity: Passivity,
    renderer: Renderer,
    guard: Guard,
    counts: Counts,
    last: Option<Reading>,
    /// The device has been read successfully.
    connected: bool,
    /// A force has been applied at least once.
    begun: bool,
    /// Factor of ramp, fade and stop in the last tick.
    gain: f64,
    /// Way of the hand in the last steps, earlier ticks counting for less, m.
    moved: f64,
    /// Times of the last tick and of the last valid reading, s.
    ticked: Option<f64>,
    valid_at: Option<f64>,
    /// The last tick's force was non-finite.
    non_finite: bool,
    hand: Hand,
    held: bool,
    offset: DVec3,
    offset_rotation: DQuat,
    number: Option<u64>,
    epoch: u32,
    rendered: Tick,
    wrench: Wrench,
    velocity: DVec3,
    angular_velocity: DVec3,
    active: bool,
}

impl Servo {
    /// Servo whose tool rests at a pose of the scene until the first reading of its device.
    pub fn new(settings: Settings, start: Hand) -> Self {
        let mut renderer = Renderer::new(settings.coupling, start);
        (renderer.rendering, renderer.budget) = (settings.rendering, settings.budget);
        renderer.max_sweeps = settings.max_sweeps;
        renderer.reserve(settings.rows);
        Self {
            renderer,
            passivity: Passivity::default(),
            guard: Guard::default(),
            counts: Counts::default(),
            last: None,
            connected: false,
            begun: false,
            gain: 0.0,
            moved: 0.0,
            ticked: None,
            valid_at: None,
            non_finite: false,
            hand: start,
            held: false,
            offset: DVec3::ZERO,
            offset_rotation: DQuat::IDENTITY,
            number: None,
            epoch: 0,
            rendered: Tick::default(),
            wrench: Wrench::default(),
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
            active: settings.buttons.active == 0,
            settings,
        }
    }

    /// One tick at `time`, s.
    pub fn tick(&mut self, reading: Reading, problem: &Problem, time: f64) -> Record {
        // validity of the reading
        let age = time - problem.time;
        let late = age > LATE_STEPS * self.settings.step;
        let workspace = &self.settings.workspace;
        let is_pose = workspace.within_reach(reading.position) && reading.rotation.is_finite();
        let is_valid = workspace.accepts(&reading);
        // The device is lost if the reading is no pose or too old (or its age is NaN), if none was valid for too long, if the loop itself
        // stood still for so long that the device has released the force, or if the last rendered force was non-finite.
        let stood_still = time - self.ticked.replace(time).unwrap_or(time) > LOST_AFTER;
        if is_valid || self.valid_at.is_none() {
            self.valid_at = Some(time);
        }
        let silent = self.valid_at.is_some_and(|at| time - at > LOST_AFTER);
        let lost = !(is_pose && reading.age <= LOST_AFTER) || silent || stood_still || self.non_finite;
        self.non_finite = false;
        self.connected |= !lost && is_valid;
        // buttons, guard and hand pose
        let reading = self.validated(reading);
        let down = |mask: u32| reading.is_some_and(|r| r.buttons & mask != 0);
        let Buttons { active, clutch, freeze } = self.settings.buttons;
        let (clutched, frozen) = (down(clutch), down(freeze));
        self.active = active == 0 || down(active);
        let signs = Signs { lost, late, clutched };
        let gain = if self.settings.guarded { self.guard.update(signs, self.settings.tick) } else { 1.0 };
        self.begun |= gain > 0.0;
        let whole = gain == 1.0 && self.gain == 1.0; // neither fades nor rises
        self.gain = gain;
        let hand_before = (self.hand.position, self.velocity);
        self.move_hand(reading, clutched || frozen || (self.begun && self.guard.stopped()));
        // rendering
        let cut = self.receive(problem, age);
        if !frozen {
            let ahead = age.clamp(0.0, MOST_STEPS * self.settings.step);
            self.rendered = self.renderer.tick(&problem.reduced, self.hand, self.settings.tick, ahead);
            if !(self.rendered.force.is_finite() && self.rendered.torque.is_finite()) {
                self.counts.non_finite += 1;
                self.non_finite = true;
                self.renderer.rest_at(self.hand);
                self.rendered = Tick { sweeps: self.rendered.sweeps, ..Tick::default() };
            }
        }
        // output and counters
        let before = self.wrench.force;
        let clamped = self.output(gain) || self.rendered.bounded;
        self.count(problem, age, signs, clamped);
        let jump = (self.wrench.force - before).length();
        self.counts.jump_max = self.counts.jump_max.max(jump);
        let explained = self.of_motion(hand_before);
        self.counts.jumps += u64::from(whole && jump > JUMP + explained);
        if cut {
            self.counts.cut_jump = self.counts.cut_jump.max(jump);
        }
        Record {
            time,
            hand: self.hand,
            velocity: self.velocity,
            proxy: self.renderer.position,
            wrench: self.wrench,
            felt: self.settings.workspace.wrench_to_scene(self.wrench, self.effector()),
            age,
            gain,
            sweeps: self.rendered.sweeps,
            active: self.active,
        }
    }

    /// Largest change of the force that the hand's motion explains by the coupling, N: that of the last steps, which a problem answers.
    fn of_motion(&mut self, (position, velocity): (DVec3, DVec3)) -> f64 {
        let Settings { coupling: Coupling { stiffness, damping, .. }, force_scale, tick, step, .. } = self.settings;
        let [moved, faster] = [self.hand.position - position, self.velocity - velocity].map(DVec3::length);
        self.moved = moved + self.moved * (1.0 - tick / (MOST_STEPS * step)).max(0.0);
        force_scale * (stiffness * self.moved + damping * faster)
    }

    /// The reading, or the last valid one if it is invalid, or `None` before the first; updates the observer with the hand's motion.
    fn validated(&mut self, reading: Reading) -> Option<Reading> {
        let valid = self.settings.workspace.accepts(&reading);
        self.counts.unsound += u64::from(!valid);
        if !self.connected {
            return None;
        }
        let reading = match valid {
            true => Some(reading),
            false => self.last.map(|last| Reading { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, ..last }),
        };
        if let (Some(now), Some(last)) = (reading, self.last) {
            let turned = rotation_vector(now.rotation * last.rotation.conjugate());
            self.passivity.observe(now.position - last.position, turned, self.settings.resolution);
        }
        self.last = reading;
        reading
    }

    /// Moves the hand in the scene, or holds it. After a hold it continues from where it was held; the first reading is placed by the
    /// workspace.
    fn move_hand(&mut self, reading: Option<Reading>, hold: bool) {
        (self.velocity, self.angular_velocity) = (DVec3::ZERO, DVec3::ZERO);
        let Some(reading) = reading else { return };
        let there = self.settings.workspace.to_scene(reading);
        if hold {
            self.held = true;
            return;
        }
        if self.held {
            self.offset = self.hand.position - there.position;
            self.offset_rotation = there.rotation.conjugate() * self.hand.rotation;
            self.held = false;
        }
        self.hand = Hand { position: there.position + self.offset, rotation: there.rotation * self.offset_rotation };
        (self.velocity, self.angular_velocity) = (there.velocity, there.angular_velocity);
    }

    /// Takes a new problem over; true if it is the first of a new epoch.
    fn receive(&mut self, problem: &Problem, age: f64) -> bool {
        if self.number == Some(problem.number) {
            return false;
        }
        match age <= FRESH * self.settings.tick {
            true => self.renderer.receive(&problem.reduced, self.settings.tick),
            false => self.renderer.receive_late(&problem.reduced, self.settings.tick),
        }
        let cut = self.number.is_some() && problem.reduced.epoch != self.epoch;
        (self.number, self.epoch) = (Some(problem.number), problem.reduced.epoch);
        cut
    }

    /// Last rotation of the end effector.
    fn effector(&self) -> DQuat {
        self.last.map_or(DQuat::IDENTITY, |reading| reading.rotation)
    }

    /// Scales, limits and damps the rendered wrench for the device; true if a limit was exceeded.
    fn output(&mut self, gain: f64) -> bool {
        let Settings { force_scale, limits, workspace, passivity, tick, .. } = self.settings;
        let scale = force_scale * gain;
        let rendered = Wrench { force: self.rendered.force * scale, torque: self.rendered.torque * scale };
        let (asked, clamped) = limits.apply(workspace.to_device(rendered, self.effector()));
        self.wrench = asked;
        if passivity {
            self.wrench = limits.apply(self.passivity.control(asked, tick, limits.torque > 0.0)).0;
        }
        self.passivity.hold(self.wrench, asked);
        clamped
    }

    fn count(&mut self, problem: &Problem, age: f64, signs: Signs, clamped: bool) {
        let counts = &mut self.counts;
        counts.ticks += 1;
        counts.sweeps_max = counts.sweeps_max.max(self.rendered.sweeps);
        counts.out_of_time += u64::from(self.rendered.out_of_time);
        counts.old += u64::from(age > 2.0 * self.settings.step + self.settings.tick);
        counts.late += u64::from(signs.late);
        counts.lost += u64::from(signs.lost);
        counts.stale += u64::from(problem.reduced.epoch < problem.announced);
        counts.clamped += u64::from(clamped);
        (counts.fades, counts.stops) = (self.guard.fades, self.guard.stops);
        counts.force_max = counts.force_max.max(self.wrench.force.length());
        (counts.energy_out, counts.energy_uncontrolled) = (self.passivity.energy_most, self.passivity.wanted_most);
        counts.energy_damped = self.passivity.wanted - self.passivity.energy;
    }

    /// Counters so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Message to the simulation.
    pub fn felt(&self) -> Felt {
        let Self { hand, velocity, angular_velocity, active, counts, .. } = *self;
        let buttons = self.last.map_or(0, |last| last.buttons);
        Felt { hand, velocity, angular_velocity, buttons, active, counts }
    }
}

/// Contact problem for a servo.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Problem {
    /// Reduced contact problem.
    pub reduced: Reduced,
    /// Time of the hand pose that the problem is based on, on the servo's clock, s.
    pub time: f64,
    /// Number of the hand-over, starting at 0.
    pub number: u64,
    /// Newest epoch announced by the simulation; a problem of an older one precedes a cut.
    pub announced: u32,
}

impl Problem {
    /// Overwrites the problem in its own memory.
    pub fn refill(&mut self, reduced: &Reduced, time: f64, number: u64, announced: u32) {
        self.reduced.refill(reduced);
        (self.time, self.number, self.announced) = (time, number, announced);
    }
}

/// Counters of a servo.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Ticks.
    pub ticks: u64,
    /// Largest number of sweeps in a tick.
    pub sweeps_max: u32,
    /// Ticks whose time budget for sweeps was used up.
    pub out_of_time: u64,
    /// Invalid readings.
    pub unsound: u64,
    /// Ticks at which the device was lost: no reading, an old one, or one that is no pose.
    pub lost: u64,
    /// Ticks with a non-finite force; none is applied then.
    pub non_finite: u64,
    /// Ticks with a problem older than two steps, its age when every step takes its time.
    pub old: u64,
    /// Ticks with a problem so old that the force fades.
    pub late: u64,
    /// Ticks with a problem from before a cut.
    pub stale: u64,
    /// Ticks whose force or torque was limited to what the device can exert, or the coupling.
    pub clamped: u64,
    /// Times the force faded because the simulation was late.
    pub fades: u64,
    /// Times the force stopped because the device was lost.
    pub stops: u64,
    /// Largest force on the hand, N.
    pub force_max: f64,
    /// Largest change of the force from one tick to the next, N.
    pub jump_max: f64,
    /// Ticks in which the force changed by more than half a newton beyond what the hand's motion explains, and did not fade or rise.
    pub jumps: u64,
    /// Largest change of the force at the arrival of a problem of a new epoch, N.
    pub cut_jump: f64,
    /// Maximum energy given to the hand, J.
    pub energy_out: f64,
    /// The same for the same motion without the passivity controller, J.
    pub energy_uncontrolled: f64,
    /// Energy removed by the controller, J.
    pub energy_damped: f64,
}

/// Message of a servo to the simulation.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// Pose of the tool in the hand.
    pub hand: Hand,
    /// m/s
    pub velocity: DVec3,
    /// rad/s
    pub angular_velocity: DVec3,
    /// Bit k is set while button k is pressed.
    pub buttons: u32,
    /// True while the blade cuts.
    pub active: bool,
    /// Counters so far.
    pub counts: Counts,
}

/// The servo's ends of both buffers.
pub struct ServoEnd {
    /// From the simulation.
    pub problem: Output<Problem>,
    /// To it.
    pub felt: Input<Felt>,
}

/// The simulation's ends.
pub struct SimulationEnd {
    /// From the servo.
    pub felt: Output<Felt>,
    problem: Input<Problem>,
    number: u64,
}

/// Both buffers between a simulation and a servo.
pub fn cells(first: &Problem, felt: &Felt) -> (ServoEnd, SimulationEnd) {
    let (to_servo, problem) = triple_buffer(first);
    let (to_simulation, felt) = triple_buffer(felt);
    (ServoEnd { problem, felt: to_simulation }, SimulationEnd { felt, problem: to_servo, number: first.number })
}

impl SimulationEnd {
    /// Hands a problem over: `time` of its hand pose, s, and the newest epoch.
    pub fn publish(&mut self, reduced: &Reduced, time: f64, announced: u32) {
        self.number += 1;
        self.problem.input_buffer_mut().refill(reduced, time, self.number, announced);
        self.problem.publish();
    }
}
