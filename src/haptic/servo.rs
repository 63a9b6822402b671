//! The whole tick of one device: a reading and the newest problem in, a force and torque out.
//!
//! A tick places the reading in the scene (workspace, clutch), renders, limits, and watches the energy. It allocates nothing (once
//! [`Renderer::reserve`] has seen the largest problem), takes no lock, writes no log and waits for nothing; what it saw is in its
//! [`Record`], what it counted in [`Counts`].
//! Units: m, rad, N, N·m, s, J; forces of records are on the hand, in the device's frame.

use super::cells::{Counts, Felt, Problem};
use super::device::{Limits, Reading, Workspace, Wrench};
use super::guard::{Guard, LATE_STEPS, LOST_AFTER, Signs};
use super::passivity::Passivity;
use super::{Hand, MAX_SWEEPS, Renderer, Tick};
use crate::bodies::rigid::rotation_vector;
use crate::scene::{self, Coupling, Rendering, Role};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Time that the sweeps of a live tick may take: a third of the tick at 1 kHz, so that a crowded contact costs accuracy and no deadline.
pub const BUDGET: Duration = Duration::from_micros(300);
/// A problem that is at most this many ticks old is of the hand as it is, and says where the proxy is; to an older one it has moved on.
const FRESH: f64 = 1.5;

/// Steps of the simulation for which the skin is taken to go on as it moved at the end of the last one: a problem is up to two steps old
/// before the next one comes, and what moves for longer has been stopped by something.
const MOST_STEPS: f64 = 2.0;

/// Which buttons do what; bit k for button k.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Buttons {
    /// While one is down the blade cuts; without any it always does.
    pub active: u32,
    /// While one is down the hand moves and the tool stays.
    pub clutch: u32,
    /// While one is down tool and force hold their place.
    pub freeze: u32,
}

impl Buttons {
    /// By the roles of buttons 0, 1, …
    pub fn new(roles: &[Role]) -> Self {
        let of = |wanted: Role| {
            let down = roles.iter().enumerate().filter(|(k, role)| **role == wanted && *k < 32);
            down.fold(0, |bits, (k, _)| bits | 1 << k)
        };
        Self { active: of(Role::Active), clutch: of(Role::Clutch), freeze: of(Role::Freeze) }
    }
}

/// How a servo treats its device.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// Length of a tick, s.
    pub tick: f64,
    /// Length of a step of the simulation, s.
    pub step: f64,
    /// Coupling between hand and tool.
    pub link: Coupling,
    /// Whether it is felt.
    pub rendering: Rendering,
    /// Newtons on the hand per newton on the tool.
    pub force_scale: f64,
    /// Most that the device is asked for.
    pub limits: Limits,
    /// Where the device's frame lies.
    pub workspace: Workspace,
    /// Which buttons do what.
    pub buttons: Buttons,
    /// Keep the device from giving energy.
    pub passivity: bool,
    /// Step of the device's position sensors, m.
    pub resolution: f64,
    /// Ramp in, fade when the simulation is late, stop when the device is lost.
    pub guarded: bool,
    /// Time for the sweeps; none where results must not depend on a clock.
    pub budget: Option<Duration>,
    /// Sweeps of a tick at most.
    pub max_sweeps: u32,
    /// Rows of the largest problem.
    pub rows: usize,
}

impl Settings {
    /// As the device of a scene asks, whose ticks and steps take so long; `can` is what the device can give.
    pub fn new(device: &scene::Device, link: Coupling, can: Limits, [tick, step]: [f64; 2]) -> Self {
        Self {
            tick,
            step,
            link,
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

/// One tick.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// s
    pub time: f64,
    /// The hand in the scene.
    pub hand: Hand,
    /// m/s
    pub velocity: DVec3,
    /// The proxy in the scene, m.
    pub proxy: DVec3,
    /// What is written to the device, in its frame.
    pub wrench: Wrench,
    /// The same in the scene's frame.
    pub felt: Wrench,
    /// Age of the problem, s.
    pub age: f64,
    /// Share of the force that ramp, fade and stop let through.
    pub gain: f64,
    /// Gauss–Seidel sweeps.
    pub sweeps: u32,
    /// The blade cuts.
    pub active: bool,
}

/// The tick of one device and its memory.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Servo {
    /// How it treats its device.
    pub settings: Settings,
    /// Observer and controller.
    pub passivity: Passivity,
    renderer: Renderer,
    guard: Guard,
    counts: Counts,
    last: Option<Reading>,
    /// The device has said something.
    heard: bool,
    /// Some force was let through once.
    begun: bool,
    /// When the last tick was, and the last sound reading, s.
    ticked: Option<f64>,
    sound_at: Option<f64>,
    /// The last tick's force was no number.
    spoilt: bool,
    hand: Hand,
    held: bool,
    shift: DVec3,
    turn: DQuat,
    number: Option<u64>,
    epoch: u32,
    rendered: Tick,
    wrench: Wrench,
    velocity: DVec3,
    spin: DVec3,
    active: bool,
}

impl Servo {
    /// A servo whose tool rests at a pose of the scene until its device is heard of.
    pub fn new(settings: Settings, start: Hand) -> Self {
        let mut renderer = Renderer::new(settings.link, start);
        (renderer.rendering, renderer.budget) = (settings.rendering, settings.budget);
        renderer.max_sweeps = settings.max_sweeps;
        renderer.reserve(settings.rows);
        Self {
            renderer,
            passivity: Passivity::default(),
            guard: Guard::default(),
            counts: Counts::default(),
            last: None,
            heard: false,
            begun: false,
            ticked: None,
            sound_at: None,
            spoilt: false,
            hand: start,
            held: false,
            shift: DVec3::ZERO,
            turn: DQuat::IDENTITY,
            number: None,
            epoch: 0,
            rendered: Tick::default(),
            wrench: Wrench::default(),
            velocity: DVec3::ZERO,
            spin: DVec3::ZERO,
            active: settings.buttons.active == 0,
            settings,
        }
    }

    /// One tick at `time`, s.
    pub fn tick(&mut self, reading: Reading, problem: &Problem, time: f64) -> Record {
        let age = time - problem.time;
        let late = age > LATE_STEPS * self.settings.step;
        let workspace = &self.settings.workspace;
        let is_pose = workspace.has_place(reading.position) && reading.rotation.is_finite();
        let is_sound = workspace.holds(&reading);
        // a reading is lost when it is no pose or old (or of an age that is no number), when none was sound for long, when the loop itself
        // has stood still for so long that the device has let go by itself, and when what was rendered is no force
        let stood_still = time - self.ticked.replace(time).unwrap_or(time) > LOST_AFTER;
        if is_sound || self.sound_at.is_none() {
            self.sound_at = Some(time);
        }
        let silent = self.sound_at.is_some_and(|at| time - at > LOST_AFTER);
        let lost = !(is_pose && reading.age <= LOST_AFTER) || silent || stood_still || self.spoilt;
        self.spoilt = false;
        self.heard |= !lost && is_sound;
        let reading = self.sound(reading);
        let down = |mask: u32| reading.is_some_and(|r| r.buttons & mask != 0);
        let Buttons { active, clutch, freeze } = self.settings.buttons;
        let (clutched, frozen) = (down(clutch), down(freeze));
        self.active = active == 0 || down(active);
        let signs = Signs { lost, late, clutched };
        let gain = if self.settings.guarded { self.guard.update(signs, self.settings.tick) } else { 1.0 };
        self.begun |= gain > 0.0;
        self.place(reading, clutched || frozen || (self.begun && self.guard.stopped()));
        let cut = self.receive(problem, age);
        if !frozen {
            let ahead = age.clamp(0.0, MOST_STEPS * self.settings.step);
            self.rendered = self.renderer.tick(&problem.reduced, self.hand, self.settings.tick, ahead);
            if !(self.rendered.force.is_finite() && self.rendered.torque.is_finite()) {
                self.counts.non_finite += 1;
                self.spoilt = true;
                self.renderer.rest_at(self.hand);
                self.rendered = Tick { sweeps: self.rendered.sweeps, ..Tick::default() };
            }
        }
        let before = self.wrench.force;
        let clamped = self.give(gain);
        self.count(problem, late, clamped);
        let jump = (self.wrench.force - before).length();
        self.counts.jump_max = self.counts.jump_max.max(jump);
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

    /// The reading, or the last one in its place where it is none, or nothing before the first; the observer sees how the hand has moved.
    fn sound(&mut self, reading: Reading) -> Option<Reading> {
        let sound = self.settings.workspace.holds(&reading);
        self.counts.unsound += u64::from(!sound);
        if !self.heard {
            return None;
        }
        let reading = match sound {
            true => Some(reading),
            false => self.last.map(|last| Reading { velocity: DVec3::ZERO, spin: DVec3::ZERO, ..last }),
        };
        if let (Some(now), Some(last)) = (reading, self.last) {
            let turned = rotation_vector(now.rotation * last.rotation.conjugate());
            self.passivity.observe(now.position - last.position, turned, self.settings.resolution);
        }
        self.last = reading;
        reading
    }

    /// Moves the hand in the scene, or holds it; where it was held, it goes on from there. A device that is heard of for the first time
    /// is where its workspace says.
    fn place(&mut self, reading: Option<Reading>, hold: bool) {
        (self.velocity, self.spin) = (DVec3::ZERO, DVec3::ZERO);
        let Some(reading) = reading else { return };
        let there = self.settings.workspace.to_scene(reading);
        if hold {
            self.held = true;
            return;
        }
        if self.held {
            self.shift = self.hand.position - there.position;
            self.turn = there.rotation.conjugate() * self.hand.rotation;
            self.held = false;
        }
        self.hand = Hand { position: there.position + self.shift, rotation: there.rotation * self.turn };
        (self.velocity, self.spin) = (there.velocity, there.spin);
    }

    /// Takes a new problem over; whether it is the first of a new epoch.
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

    /// Rotation of the end effector, as the device said it last.
    fn effector(&self) -> DQuat {
        self.last.map_or(DQuat::IDENTITY, |reading| reading.rotation)
    }

    /// Scales, limits and damps what was rendered into what the device gets; whether a limit was met.
    fn give(&mut self, gain: f64) -> bool {
        let Settings { force_scale, limits, workspace, passivity, tick, .. } = self.settings;
        let size = force_scale * gain;
        let rendered = Wrench { force: self.rendered.force * size, torque: self.rendered.torque * size };
        let (asked, clamped) = limits.apply(workspace.to_device(rendered, self.effector()));
        self.wrench = asked;
        if passivity {
            self.wrench = limits.apply(self.passivity.control(asked, tick, limits.torque > 0.0)).0;
        }
        self.passivity.hold(self.wrench, asked);
        clamped
    }

    fn count(&mut self, problem: &Problem, late: bool, clamped: bool) {
        let counts = &mut self.counts;
        counts.ticks += 1;
        counts.sweeps_max = counts.sweeps_max.max(self.rendered.sweeps);
        counts.out_of_time += u64::from(self.rendered.out_of_time);
        counts.late += u64::from(late);
        counts.stale += u64::from(problem.reduced.epoch < problem.announced);
        counts.clamped += u64::from(clamped);
        (counts.fades, counts.stops) = (self.guard.fades, self.guard.stops);
        counts.force_max = counts.force_max.max(self.wrench.force.length());
        (counts.energy_out, counts.energy_uncontrolled) = (self.passivity.energy_most, self.passivity.wanted_most);
        counts.energy_damped = self.passivity.wanted - self.passivity.energy;
    }

    /// What was counted so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What the simulation has to know.
    pub fn felt(&self) -> Felt {
        let Self { hand, velocity, spin, active, counts, .. } = *self;
        let buttons = self.last.map_or(0, |last| last.buttons);
        Felt { hand, velocity, spin, buttons, active, counts }
    }
}
