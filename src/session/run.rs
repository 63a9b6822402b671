//! The simulation: one thread that takes commands, makes a step when one is due, and shows its state.

use super::audience::{Audience, Command, Figures, MOST_COMMANDS, Motion, Shown, lock};
use super::mouse::{Mouse, Shared};
use super::quantity::{Asked, Quantity};
use crate::error::{Error, Result};
use crate::haptic::device::Workspace;
use crate::haptic::devices::Path;
use crate::report::frames::SkinSurface;
use crate::runner::{Clock, Runner, State};
use crate::scene::{Device, DeviceKind, Law, Role, Scene};
use crate::step::{Platform, Simulation, StepReport, Warnings};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

/// Shortest time between two frames.
const BETWEEN_FRAMES: Duration = Duration::from_millis(33);
/// Longest wait for a command while nothing moves.
const SLICE: Duration = Duration::from_millis(20);
/// Scene time between two kept states at first, s, and most of them; when they are full, every other one goes.
const BETWEEN_KEPT: f64 = 0.1;
const MOST_KEPT: usize = 60;
/// Steps whose times the traffic light looks at.
const RECENT: usize = 100;
/// Time between two rows of the recorded motion, s, and most of them.
const BETWEEN_ROWS: f64 = 0.01;
const MOST_ROWS: usize = 100_000;

/// Options of a session.
#[derive(Clone, Debug)]
pub struct Options {
    /// Backend and precision.
    pub platform: Platform,
    /// Stand still until a watcher says otherwise.
    pub paused: bool,
    /// Once set, the session ends.
    pub interrupt: Arc<AtomicBool>,
}

/// Whether a hand of the scene goes by the wall clock, and so does the session.
pub fn is_live(scene: &Scene) -> bool {
    scene.tools.iter().any(|tool| tool.device.as_ref().is_some_and(|d| matches!(d.kind, DeviceKind::Haply { .. })))
}

/// Values that watchers change.
#[derive(Clone, Copy, Debug)]
struct Settings {
    friction: Option<f64>,
    stiffness: f64,
    tolerance: f64,
    step: f64,
}

impl Settings {
    fn of(scene: &Scene) -> Self {
        let friction = scene.contact.map(|contact| contact.friction);
        Self { friction, stiffness: 1.0, tolerance: scene.solver.tolerance, step: scene.time.step }
    }

    /// The scene as read, with these values.
    fn apply(&self, read: &Scene) -> Scene {
        let mut scene = read.clone();
        if let (Some(contact), Some(friction)) = (&mut scene.contact, self.friction) {
            contact.friction = friction;
        }
        for skin in &mut scene.skins {
            skin.layers.iter_mut().for_each(|layer| layer.young *= self.stiffness);
            if let Law::Springs { stiffness: Some(stiffness), .. } = &mut skin.law {
                *stiffness *= self.stiffness;
            }
        }
        scene.inclusions.iter_mut().for_each(|inclusion| inclusion.young *= self.stiffness);
        (scene.solver.tolerance, scene.time.step) = (self.tolerance, self.step);
        scene
    }
}

struct Session<'a> {
    read: Scene,
    settings: Settings,
    platform: Platform,
    audience: &'a mut dyn Audience,
    interrupt: Arc<AtomicBool>,
    live: bool,
    runner: Runner,
    /// `[tool]` its hand, if watchers may hold it
    hands: Vec<Option<Arc<Shared>>>,
    /// `[tool]` position of the hand, m
    held: Vec<[f64; 3]>,
    playing: bool,
    speed: f64,
    due: Instant,
    late: u64,
    kept: VecDeque<(f64, State)>,
    between_kept: f64,
    recent: VecDeque<f64>,
    shown: Instant,
    asked: Asked,
    watchers: usize,
    report: StepReport,
    warnings: Warnings,
    motion: Motion,
}

/// Runs a scene before an audience until it is interrupted; calls `ready` once it is prepared. The hands' motion is recorded in `motion`.
///
/// # Errors
/// If the scene cannot be prepared, or its state not be read.
pub fn run(
    scene: &Scene,
    options: &Options,
    audience: &mut dyn Audience,
    motion: Motion,
    ready: &mut dyn FnMut(),
) -> Result<()> {
    let mut session = Session::new(scene, options, audience, motion)?;
    ready();
    while !options.interrupt.load(Ordering::Acquire) {
        session.turn()?;
    }
    session.runner.stop(&mut |_, _| Ok(()))
}

/// A scene whose tools watchers may hold, and the hands of those; a tool on a real device stays with it.
fn prepared(scene: &Scene) -> (Scene, Vec<Option<Arc<Shared>>>) {
    let mut scene = scene.clone();
    let mut hands = vec![];
    for tool in &mut scene.tools {
        let real = matches!(tool.device.as_ref().map(|d| &d.kind), Some(DeviceKind::Haply { .. }));
        let ours = tool.free.is_none() && !real;
        if ours {
            // positions of watchers are those of the scene, and their button cuts
            let buttons = if tool.blade.is_some() { vec![Role::Active] } else { vec![] };
            tool.device = Some(Device { buttons, passivity: false, ..Device::default() });
        }
        hands.push(ours.then(Arc::default));
    }
    (scene, hands)
}

impl<'a> Session<'a> {
    fn new(read: &Scene, options: &Options, audience: &'a mut dyn Audience, motion: Motion) -> Result<Self> {
        let settings = Settings::of(read);
        let live = is_live(read);
        let (runner, hands) = Self::runner(read, &options.platform, live, &options.interrupt)?;
        let mut session = Self {
            read: read.clone(),
            settings,
            platform: options.platform.clone(),
            audience,
            interrupt: options.interrupt.clone(),
            live,
            runner,
            hands,
            held: vec![],
            playing: !options.paused,
            speed: 1.0,
            due: Instant::now(),
            late: 0,
            kept: VecDeque::new(),
            between_kept: BETWEEN_KEPT,
            recent: VecDeque::new(),
            shown: Instant::now(),
            asked: Asked::default(),
            watchers: 0,
            report: StepReport::default(),
            warnings: Warnings::new(),
            motion,
        };
        session.began()?;
        Ok(session)
    }

    /// Runner at the start of a scene, with the watchers' hands.
    fn runner(
        scene: &Scene,
        platform: &Platform,
        live: bool,
        interrupt: &Arc<AtomicBool>,
    ) -> Result<(Runner, Vec<Option<Arc<Shared>>>)> {
        let (scene, hands) = prepared(scene);
        let simulation = Simulation::new(&scene, platform).map_err(|error| error.of_scene(&scene))?;
        let mut runner = Runner::new(&scene, simulation, if live { Clock::Wall } else { Clock::Scene });
        runner.interrupt_by(interrupt.clone());
        for (number, shared) in hands.iter().enumerate() {
            if let Some(shared) = shared {
                let path = Path { poses: scene.tools[number].trajectory.as_slice().into(), workspace: Workspace::SAME };
                runner.attach(number, Box::new(Mouse::new(path, shared.clone())))?;
            }
        }
        Ok((runner, hands))
    }

    /// What a new runner begins with.
    fn began(&mut self) -> Result<()> {
        let held: Vec<bool> = self.hands.iter().map(Option::is_some).collect();
        self.audience.begin(&self.settings.apply(&self.read), &held);
        self.kept.clear();
        self.recent.clear();
        *lock(&self.motion) = vec![vec![]; self.read.tools.len()];
        (self.between_kept, self.late) = (BETWEEN_KEPT, 0);
        (self.report, self.warnings) = (StepReport::default(), Warnings::new());
        self.held = self.runner.simulation.tools.iter().map(|tool| tool.hand(0.0).0.to_array()).collect();
        self.due = Instant::now();
        self.keep()?;
        self.show()
    }

    /// Commands that have come, then a step if one is due.
    fn turn(&mut self) -> Result<()> {
        let now = Instant::now();
        let until = match self.playing {
            true if self.live => now, // the runner waits for the step's time
            true => self.due.min(now + SLICE),
            false => now + SLICE,
        };
        // a bounded number of commands, so that watchers that send without end do not hold up the steps
        for _ in 0..MOST_COMMANDS {
            let left = until.saturating_duration_since(Instant::now());
            match self.audience.commands().recv_timeout(left) {
                Ok((watcher, command)) => {
                    if let Err(error) = self.obey(command) {
                        if matches!(error, Error::Interrupted) {
                            return Ok(());
                        }
                        self.audience.refuse(Some(watcher), &error.to_string());
                    }
                }
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
        if self.playing && (self.live || Instant::now() >= self.due) {
            self.step_or_stand();
        } else if self.watchers != self.audience.watchers() {
            self.show()?;
        }
        Ok(())
    }

    fn obey(&mut self, command: Command) -> Result<()> {
        match command {
            Command::Play => {
                self.playing = true;
                self.due = Instant::now();
            }
            Command::Pause => {
                self.stand();
                self.show()?;
            }
            Command::Step => {
                self.stand();
                self.step_or_stand();
                self.show()?;
            }
            Command::Reset => self.restart()?,
            Command::Speed(speed) => {
                self.speed = if self.live { 1.0 } else { speed };
                self.due = Instant::now();
            }
            Command::Hand(hand) => {
                if let Some(Some(shared)) = self.hands.get(hand.tool) {
                    shared.set(Some(hand.target()));
                }
            }
            Command::Release(tool) => {
                if let Some(Some(shared)) = self.hands.get(tool) {
                    shared.set(None);
                }
            }
            Command::Seek(number) => self.seek(number)?,
            Command::Friction(friction) => self.change(Settings { friction: Some(friction), ..self.settings })?,
            Command::Stiffness(stiffness) => self.change(Settings { stiffness, ..self.settings })?,
            Command::Tolerance(tolerance) => self.change(Settings { tolerance, ..self.settings })?,
            Command::StepMs(ms) => {
                let before = std::mem::replace(&mut self.settings.step, ms * 1e-3);
                if let Err(error) = self.restart() {
                    self.settings.step = before;
                    return Err(error);
                }
            }
            Command::Look(asked) => {
                self.asked = asked;
                // otherwise with the next step's
                if !self.playing {
                    self.show()?;
                }
            }
            Command::Drawn(_) => {} // the server's own
        }
        Ok(())
    }

    fn stand(&mut self) {
        self.playing = false;
        self.runner.pause();
    }

    /// Continues with other values.
    fn change(&mut self, settings: Settings) -> Result<()> {
        let scene = prepared(&settings.apply(&self.read)).0;
        self.runner.simulation.change(|old| *old = scene)?;
        self.settings = settings;
        // kept states are of other values
        self.kept.clear();
        self.keep()?;
        self.show()
    }

    /// Begins anew with the present values.
    fn restart(&mut self) -> Result<()> {
        let scene = self.settings.apply(&self.read);
        scene.check()?;
        // a real device is closed before it is opened again
        self.runner.stop(&mut |_, _| Ok(()))?;
        (self.runner, self.hands) = Self::runner(&scene, &self.platform, self.live, &self.interrupt)?;
        self.began()
    }

    /// Goes back to a kept state and stands still.
    fn seek(&mut self, number: usize) -> Result<()> {
        let Some((time, state)) = self.kept.get(number) else { return Ok(()) };
        let time = *time;
        self.runner.restore(state)?;
        self.kept.truncate(number + 1);
        lock(&self.motion).iter_mut().for_each(|rows| rows.retain(|row| row[0] <= time));
        self.stand();
        self.report = StepReport { time, ..StepReport::default() };
        self.show()
    }

    /// Keeps the present state; by the wall clock there is none that could be restored.
    fn keep(&mut self) -> Result<()> {
        if self.live {
            return Ok(());
        }
        if self.kept.len() == MOST_KEPT {
            // the first one stays
            let mut number = 0;
            self.kept.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.between_kept *= 2.0;
        }
        let state = self.runner.state()?;
        self.kept.push_back((self.runner.simulation.time, state));
        Ok(())
    }

    /// One step; where it fails, the session stands still and says why.
    fn step_or_stand(&mut self) {
        if let Err(error) = self.step() {
            self.stand();
            if !matches!(error, Error::Interrupted) {
                self.audience.refuse(None, &format!("{error}; begin anew"));
            }
        }
    }

    fn step(&mut self) -> Result<()> {
        let (held, motion) = (&mut self.held, &self.motion);
        let check = self.asked.quantity == Some(Quantity::Residual);
        let step = self.runner.step(check, &mut |tool, tick| {
            held[tool] = tick.hand.position.to_array();
            let rows = &mut lock(motion)[tool];
            let due = rows.last().is_none_or(|row| tick.time - row[0] >= BETWEEN_ROWS * (1.0 - 1e-9));
            if due && rows.len() < MOST_ROWS {
                let ([x, y, z], [a, b, c, d]) = ((tick.hand.position * 1e3).to_array(), tick.hand.rotation.to_array());
                rows.push([tick.time, x, y, z, a, b, c, d]);
            }
            Ok(())
        })?;
        // times
        let took = step.took.as_secs_f64();
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(took);
        let budget = self.settings.step / self.speed;
        self.late += u64::from(took > budget);
        // what is late is not made up for: the next step is due a step's time after this one was, or now
        self.due = (self.due + Duration::from_secs_f64(budget)).max(Instant::now());
        // results
        step.report.warnings.iter().for_each(|(name, count)| *self.warnings.entry(name).or_default() += count);
        self.report = step.report;
        let last = self.kept.back().map_or(f64::NEG_INFINITY, |(time, _)| *time);
        if self.runner.simulation.time - last >= self.between_kept * (1.0 - 1e-9) {
            self.keep()?;
        }
        if self.shown.elapsed() >= BETWEEN_FRAMES && self.audience.is_ready() {
            self.show()?;
        }
        Ok(())
    }

    /// Shows the present state.
    fn show(&mut self) -> Result<()> {
        self.shown = Instant::now();
        self.watchers = self.audience.watchers();
        let state = self.runner.simulation.snapshots()?;
        let surface = SkinSurface::new(&self.runner.simulation, &state);
        let read = self.asked.read(&surface, &self.runner.simulation, &state);
        let figures = self.figures();
        let (simulation, report) = (&self.runner.simulation, &self.report);
        self.audience.show(Shown { surface, read, simulation, hands: &self.held, report, figures });
        Ok(())
    }

    /// Figures of the last steps.
    fn figures(&self) -> Figures {
        let mut sorted: Vec<f64> = self.recent.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = |share: f64| sorted.get(((sorted.len() as f64 * share) as usize).min(sorted.len().max(1) - 1));
        let [median, high] = [0.5, 0.9].map(|share| rank(share).copied().unwrap_or(0.0));
        let budget = self.settings.step / self.speed;
        let (report, totals) = (&self.report, self.runner.simulation.totals());
        Figures {
            time_s: self.runner.simulation.time,
            playing: self.playing,
            speed: self.speed,
            force_n: report.contact.on_tool.iter().map(|f| glam::DVec3::from_array(*f).length()).collect(),
            contacts: report.contact.count(),
            passes: report.contact.passes,
            iterations: report.free.iterations + report.correction_iterations,
            residual: report.residual,
            step_ms: median * 1e3,
            step_ms_90: high * 1e3,
            budget_ms: budget * 1e3,
            late: self.late,
            severed: totals.links + totals.springs_removed,
            kept: self.kept.iter().map(|(time, _)| *time).collect(),
            friction: self.settings.friction,
            stiffness: self.settings.stiffness,
            tolerance: self.settings.tolerance,
            scene_step_ms: self.settings.step * 1e3,
            look: self.asked,
            watchers: self.watchers,
            warnings: self.warnings.clone(),
        }
    }
}
