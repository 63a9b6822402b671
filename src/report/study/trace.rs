//! The runs of a study, each once, within the time limits, with progress by estimated cost; and the trace of each: probe values at common
//! times, and the cost of a step.

use super::Progress;
use super::settings::{Setting, Stop, exact, fits, scene_of};
use crate::error::Result;
use crate::report::StudyUnfit as Unfit;
use crate::scene::{Integrator, ProbeKind, Scene};
use crate::step::{Platform, Simulation};
use std::time::{Duration, Instant};

/// Steps between two readings of the device's clock, so that the others do not pay for a reading.
const TIMED: u32 = 4;

/// Quantity that errors are taken of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Probe by number; none for the largest force on a tool, N.
    pub probe: Option<usize>,
    /// Kind of quantity, one of [`KINDS`] or the unit of another one: errors are relative to the size of all signals of a kind.
    pub kind: &'static str,
    /// It is part of the total error; others are measured beside it.
    pub counted: bool,
}

/// Kinds with an error of their own in a study's table: displacements along z and positions, m; displacements across, m; velocities, m/s;
/// stresses and pressures, Pa; forces, N.
pub const KINDS: [&str; 5] = ["displacement", "lateral", "velocity", "stress", "force"];

/// Kind of a probe.
fn kind(probe: &ProbeKind) -> &'static str {
    match probe {
        ProbeKind::Displacement { axis, .. } | ProbeKind::MeanDisplacement { axis, .. } if *axis != 2 => "lateral",
        _ => match probe.unit() {
            "m" => "displacement",
            "m_s" => "velocity",
            "pa" => "stress",
            "n" => "force",
            unit => unit,
        },
    }
}

/// Quantities of a scene. Counted: the named probes or all of them, and the forces on tools. Beside them: displacements and stresses of other
/// points. With known values: their probes only.
pub fn signals(scene: &Scene) -> Vec<Signal> {
    let (study, probes) = (&scene.study, &scene.probes);
    let of = |probe: usize, counted| Signal { probe: Some(probe), kind: kind(&probes[probe].kind), counted };
    if !study.known.is_empty() {
        return study.known.iter().map(|(probe, _)| of(*probe, true)).collect();
    }
    if study.probes.is_empty() && probes.is_empty() && scene.tools.is_empty() {
        return vec![];
    }
    let all: Vec<usize> = (0..probes.len()).collect();
    let counted = if study.probes.is_empty() { &all } else { &study.probes };
    let mut out: Vec<Signal> = counted.iter().map(|probe| of(*probe, true)).collect();
    if !scene.tools.is_empty() {
        out.push(Signal { probe: None, kind: "force", counted: true });
    }
    let point = |probe: &usize| {
        matches!(probes[*probe].kind, ProbeKind::Displacement { .. } | ProbeKind::Stress { .. })
            && !counted.contains(probe)
    };
    out.extend(all.iter().filter(|probe| point(probe)).map(|probe| of(*probe, false)));
    out
}

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// `[time][signal]` values, SI, at the ends of the study's longest step; with known values only at the end.
    pub samples: Vec<Vec<f64>>,
    /// Iterations per step, mean.
    pub iterations: f64,
    /// Wall time per step, median, ms.
    pub ms_per_step: f64,
    /// Busy time of the device per step by its timestamps, median, ms.
    pub device_ms_per_step: Option<f64>,
    /// Number of warnings.
    pub warnings: u64,
    /// Completed steps,
    pub steps: u32,
    /// of this many.
    pub wanted: u32,
}

impl Trace {
    /// Whether the run reached its end.
    pub fn whole(&self) -> bool {
        self.steps == self.wanted
    }

    /// Takes over the times of another run of the same setting if it was faster.
    pub fn keep_faster(&mut self, other: &Self) {
        if other.ms_per_step < self.ms_per_step {
            (self.ms_per_step, self.device_ms_per_step) = (other.ms_per_step, other.device_ms_per_step);
        }
    }
}

/// Runs a scene for at most `limit`, and samples every `every` s, or only at the end.
///
/// # Errors
/// If a model is too large or the device fails.
pub fn trace(
    scene: &Scene,
    platform: &Platform,
    signals: &[Signal],
    every: Option<f64>,
    limit: Duration,
    stepped: &mut dyn FnMut(f64),
) -> Result<Trace> {
    let wanted = scene.time.steps();
    let sampled = every.map_or(wanted, |every| (every / scene.time.step).round().max(1.0) as u32);
    let start = Instant::now();
    let mut simulation = Simulation::new(scene, platform)?;
    simulation.time_device(true);
    let mut trace = Trace { wanted, ..Trace::default() };
    let (mut wall, mut busy, mut iterations) = (vec![], vec![], 0u64);
    for number in 1..=wanted {
        // a step with its wall time, and now and then the device's
        let begin = Instant::now();
        let step = simulation.step(false)?;
        wall.push(begin.elapsed().as_secs_f64() * 1e3);
        if number % TIMED == 0 {
            busy.extend(simulation.device_time()?.map(|s| s * 1e3 / f64::from(TIMED)));
        }
        iterations += u64::from(step.free.iterations);
        trace.warnings += step.warnings.values().map(|n| u64::from(*n)).sum::<u64>();
        trace.steps = number;
        // samples at the common times
        if number % sampled == 0 {
            let value = |signal: &Signal| match signal.probe {
                Some(probe) => step.probes[probe],
                None => step.contact.largest_on_tools(),
            };
            trace.samples.push(signals.iter().map(value).collect());
        }
        stepped(f64::from(number) / f64::from(wanted));
        if start.elapsed() > limit {
            break;
        }
    }
    // cost per step
    trace.iterations = iterations as f64 / f64::from(trace.steps.max(1));
    trace.ms_per_step = median(&mut wall).unwrap_or(f64::NAN);
    trace.device_ms_per_step = median(&mut busy);
    Ok(trace)
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Distance of two runs relative to a reference: root of the sum of squares over all samples of the counted signals of one kind, the largest
/// over the kinds. Infinite if a run is not finite or the reference is zero.
pub fn apart(a: &[Vec<f64>], b: &[Vec<f64>], reference: &[Vec<f64>], signals: &[Signal]) -> f64 {
    let mut kinds: Vec<&str> = signals.iter().filter(|signal| signal.counted).map(|signal| signal.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let of = |kind| relative(a, b, reference, &|k| signals[k].counted && signals[k].kind == kind, signals.len());
    kinds.into_iter().filter_map(of).fold(0.0, |worst, error| if error > worst { error } else { worst })
}

/// The same for all signals of one kind, counted or not; none without such a signal.
pub fn apart_in(kind: &str, a: &[Vec<f64>], b: &[Vec<f64>], reference: &[Vec<f64>], signals: &[Signal]) -> Option<f64> {
    relative(a, b, reference, &|k| signals[k].kind == kind, signals.len())
}

/// The same for some of the signals.
fn relative(
    a: &[Vec<f64>],
    b: &[Vec<f64>],
    reference: &[Vec<f64>],
    wanted: &dyn Fn(usize) -> bool,
    count: usize,
) -> Option<f64> {
    let own: Vec<usize> = (0..count).filter(|k| wanted(*k)).collect();
    if own.is_empty() {
        return None;
    }
    assert!(a.len() == b.len() && b.len() == reference.len(), "runs are sampled at the same times");
    let (mut difference, mut size) = (0.0, 0.0);
    for ((a, b), r) in a.iter().zip(b).zip(reference) {
        for k in &own {
            difference += (a[*k] - b[*k]).powi(2);
            size += r[*k].powi(2);
        }
    }
    let error = if difference == 0.0 { 0.0 } else { (difference / size).sqrt() };
    Some(if error.is_finite() { error } else { f64::INFINITY })
}

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
            return Err(Unfit::Slow { what: what.into() }.of(self.scene).into());
        }
        if trace.samples.iter().flatten().all(|v| v.is_finite()) {
            return Ok(trace);
        }
        Err(Unfit::NonFinite { what: what.into() }.of(self.scene).into())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_unit_counts_and_what_is_no_number_is_infinitely_wrong() {
        let of = |probe, kind, counted| Signal { probe, kind, counted };
        let signals = [of(Some(0), "displacement", true), of(Some(1), "displacement", true), of(None, "force", true)];
        let reference = [vec![3e-3, 4e-3, 1.0], vec![0.0, 0.0, 1.0]];
        let near = [vec![3e-3, 4.5e-3, 1.0], vec![0.0, 0.0, 1.2]];
        let error = apart(&near, &reference, &reference, &signals);
        assert!((error - 0.2 / 2f64.sqrt()).abs() < 1e-12, "{error}");
        let displaced = apart(&near, &reference, &reference, &signals[..2]);
        assert!((displaced - 0.1).abs() < 1e-12, "{displaced}");
        let [first, second] = [signals[0], signals[1]];
        let other = [first, second, of(Some(2), "ratio", true)];
        let error = apart(&near, &reference, &reference, &other);
        assert!((error - 0.2 / 2f64.sqrt()).abs() < 1e-12, "a kind without a column counts as well: {error}");
        // what is beside the total has its own column
        let beside = [first, second, of(Some(2), "stress", false)];
        assert!((apart(&near, &reference, &reference, &beside) - 0.1).abs() < 1e-12);
        let stress = apart_in("stress", &near, &reference, &reference, &beside).expect("there is one");
        assert!((stress - 0.2 / 2f64.sqrt()).abs() < 1e-12, "{stress}");
        assert_eq!(apart_in("lateral", &near, &reference, &reference, &beside), None);
        let non_finite = [vec![f64::NAN, 0.0, 0.0], vec![0.0; 3]];
        assert_eq!(apart(&non_finite, &reference, &reference, &signals), f64::INFINITY);
        assert_eq!(apart(&reference, &reference, &reference, &signals), 0.0);
    }
}
