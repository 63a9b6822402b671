//! Runs of a study: each once, within the time limits, with progress by estimated cost.

use super::super::StudyUnfit as Unfit;
use super::Progress;
use super::settings::{Setting, Stop, exact, fits, scene_of};
use super::trace::{Signal, Trace, trace};
use crate::error::Result;
use crate::scene::{Integrator, Scene};
use crate::step::Platform;
use std::time::{Duration, Instant};

/// Runs with their traces, each once, and the remaining work.
pub(super) struct Runs<'a> {
    pub scene: &'a Scene,
    pub signals: Vec<Signal>,
    pub duration: f64,
    pub every: Option<f64>,
    pub limit: Duration,
    /// Time at which all runs stop, references included.
    pub end: Option<Instant>,
    pub done: Vec<(Setting, bool, Trace)>,
    pub tried: Vec<(Setting, bool)>,
    /// Completed and requested runs, and their costs.
    pub count: [usize; 2],
    pub cost: [f64; 2],
    pub progress: &'a mut dyn FnMut(&Progress),
}

impl Runs<'_> {
    /// A setting's own run and those that its errors refer to.
    pub fn needed(&self, setting: &Setting) -> [(Setting, bool); 4] {
        let twin = Setting { platform: Platform::Cpu64, ..setting.clone() };
        let exactly = exact(self.scene, setting);
        let shortest = at_shortest(self.scene, &exactly);
        [(setting.clone(), false), (twin, false), (exactly, true), (shortest, true)]
    }

    /// Trace of a setting, run now unless known.
    pub fn get(&mut self, setting: &Setting, exactly: bool) -> Result<Trace> {
        let known = |(s, e, _): &&(Setting, bool, Trace)| s == setting && *e == exactly;
        if let Some((_, _, trace)) = self.done.iter().find(known) {
            return Ok(trace.clone());
        }
        let trace = self.run(setting, exactly);
        if !self.tried.iter().any(|(s, e)| s == setting && *e == exactly) {
            self.tried.push((setting.clone(), exactly));
            self.advance(setting, exactly);
        }
        let trace = trace?;
        self.done.push((setting.clone(), exactly, trace.clone()));
        Ok(trace)
    }

    /// Counts a run, even if it failed.
    pub fn advance(&mut self, setting: &Setting, exactly: bool) {
        self.count[0] += 1;
        self.cost[0] += self.cost_of(setting, exactly);
    }

    /// Runs a setting, even if its trace is known.
    pub fn run(&mut self, setting: &Setting, exactly: bool) -> Result<Trace> {
        let scene = scene_of(self.scene, setting, self.duration, exactly)?;
        let own = self.cost_of(setting, exactly);
        let ([run, runs], [before, total]) = (self.count, self.cost);
        let progress = &mut *self.progress;
        let mut stepped = |part: f64| progress(&Progress { run, runs, share: (before + own * part) / total });
        // runs that others refer to have no limit, except in a quick study
        let limit = if exactly { Duration::MAX } else { self.limit };
        let left = self.end.map_or(Duration::MAX, |end| end.saturating_duration_since(Instant::now()));
        let limit = limit.min(left);
        trace(&scene, &setting.platform, &self.signals, self.every, limit, &mut stepped)
    }

    /// Trace of a run that others refer to, complete and finite.
    pub fn whole(&mut self, setting: &Setting, what: &str) -> Result<Trace> {
        let trace = self.get(setting, true)?;
        if !trace.whole() {
            return Err(Unfit::Slow { what: what.into() }.of(self.scene));
        }
        if trace.samples.iter().flatten().all(|v| v.is_finite()) {
            return Ok(trace);
        }
        Err(Unfit::NonFinite { what: what.into() }.of(self.scene))
    }

    /// Cost estimate of a run: cells times steps times a weight of its solver.
    pub fn cost_of(&self, setting: &Setting, exactly: bool) -> f64 {
        use crate::scene::Preconditioner::{Block, Column, Direct, Jacobi, Multigrid, None};
        let solver = match (setting.preconditioner, setting.stop) {
            (Multigrid, _) => 5.0,
            (Direct, _) => 20.0,
            (Column, _) => 4.0,
            (None | Jacobi | Block, Stop::Iterations(n)) => (f64::from(n) / 15.0).min(10.0),
            (None | Jacobi | Block, _) => 10.0,
        };
        let weight = if matches!(setting.platform, Platform::Gpu(_)) { 3.0 } else { 1.0 };
        let repeats = if exactly { 3.0 } else { 1.0 };
        setting.refinement.powi(3) * self.duration / setting.step * (solver + 1.0) * weight * repeats
    }
}

/// The setting at the shortest step, with the integrator of highest order that is stable with its law.
pub(super) fn at_shortest(scene: &Scene, setting: &Setting) -> Setting {
    let second =
        scene.study.integrators.iter().copied().filter(|i| matches!(i, Integrator::Newmark | Integrator::Midpoint));
    let mut known = second.chain([scene.time.integrator]);
    let integrator = known.find(|i| fits(scene, setting.law, *i)).unwrap_or(Integrator::ImplicitEuler);
    Setting { step: scene.study.finest_step(&scene.time), integrator, ..setting.clone() }
}
