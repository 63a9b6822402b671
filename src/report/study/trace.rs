//! One run of a study: probe values at common times, and the cost of a step.

use crate::error::Result;
use crate::scene::Scene;
use crate::step::{Platform, Simulation};
use std::time::{Duration, Instant};

/// Steps between two readings of the device's clock, so that the others do not pay for a reading.
const TIMED: u32 = 4;

/// Quantity that errors are taken of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Signal {
    /// Probe by number, with its unit.
    Probe(usize, &'static str),
    /// Largest force on a tool, N.
    Force,
}

impl Signal {
    fn unit(self) -> &'static str {
        match self {
            Self::Probe(_, unit) => unit,
            Self::Force => "n",
        }
    }
}

/// Quantities of a scene: the named probes or all of them, and the forces on tools; with known values their probes only.
pub fn signals(scene: &Scene) -> Vec<Signal> {
    let unit = |probe: usize| Signal::Probe(probe, scene.probes[probe].kind.unit());
    if !scene.study.known.is_empty() {
        return scene.study.known.iter().map(|(probe, _)| unit(*probe)).collect();
    }
    let mut out: Vec<Signal> = match scene.study.probes.is_empty() {
        true => (0..scene.probes.len()).map(unit).collect(),
        false => scene.study.probes.iter().map(|probe| unit(*probe)).collect(),
    };
    if !scene.tools.is_empty() {
        out.push(Signal::Force);
    }
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
            let value = |signal: &Signal| match signal {
                Signal::Probe(probe, _) => step.probes[*probe],
                Signal::Force => step.contact.largest_on_tools(),
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

/// Distance of two runs relative to a reference: root of the sum of squares over all samples of the signals of one unit, the largest over
/// the units. Infinite if a run is not finite or the reference is zero.
pub fn apart(a: &[Vec<f64>], b: &[Vec<f64>], reference: &[Vec<f64>], signals: &[Signal]) -> f64 {
    let mut units: Vec<&str> = signals.iter().map(|signal| signal.unit()).collect();
    units.sort_unstable();
    units.dedup();
    let errors = units.into_iter().filter_map(|unit| apart_in(unit, a, b, reference, signals));
    errors.fold(0.0, |worst, error| if error > worst { error } else { worst })
}

/// Units with an error of their own in a study's table.
pub const UNITS: [&str; 3] = ["m", "m_s", "n"];

/// The same for the signals of one unit; none without such a signal.
pub fn apart_in(unit: &str, a: &[Vec<f64>], b: &[Vec<f64>], reference: &[Vec<f64>], signals: &[Signal]) -> Option<f64> {
    let own: Vec<usize> = (0..signals.len()).filter(|k| signals[*k].unit() == unit).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_unit_counts_and_what_is_no_number_is_infinitely_wrong() {
        let signals = [Signal::Probe(0, "m"), Signal::Probe(1, "m"), Signal::Force];
        let reference = [vec![3e-3, 4e-3, 1.0], vec![0.0, 0.0, 1.0]];
        let near = [vec![3e-3, 4.5e-3, 1.0], vec![0.0, 0.0, 1.2]];
        let error = apart(&near, &reference, &reference, &signals);
        assert!((error - 0.2 / 2f64.sqrt()).abs() < 1e-12, "{error}");
        let displaced = apart(&near, &reference, &reference, &signals[..2]);
        assert!((displaced - 0.1).abs() < 1e-12, "{displaced}");
        let stress = [Signal::Probe(0, "m"), Signal::Probe(1, "m"), Signal::Probe(2, "pa")];
        let error = apart(&near, &reference, &reference, &stress);
        assert!((error - 0.2 / 2f64.sqrt()).abs() < 1e-12, "a unit without a column counts as well: {error}");
        let non_finite = [vec![f64::NAN, 0.0, 0.0], vec![0.0; 3]];
        assert_eq!(apart(&non_finite, &reference, &reference, &signals), f64::INFINITY);
        assert_eq!(apart(&reference, &reference, &reference, &signals), 0.0);
    }
}
