//! Accumulates step reports into the report of a run.

use super::{CostReport, DissipationReport, Memory, Report, Share, SolverReport, Spread, WorkReport};
use crate::backend::Snapshot;
use crate::math::larger;
use crate::math::random::Random;
use crate::scene::{Integrator, PRECONDITIONERS, Preconditioner, Scene, word};
use crate::step::{Measured, Part, Simulation, StepReport};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Number of costs in the report.
const COSTS: usize = 13;

/// Accumulates the report of a run.
pub(super) struct Collector {
    start: Instant,
    seen: Collected,
}

/// Data accumulated so far.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(super) struct Collected {
    report: Report,
    /// Wall time before the run was resumed, s.
    wall: f64,
    /// Times of the steps without and with a check, ms.
    plain: Series,
    checked: Series,
    costs: [Series; COSTS],
    iterations: u64,
    passes: u64,
    touching: u32,
    /// Time of the largest force, s.
    peak_time: f64,
    /// Law residual of the last step; 0 where it was not checked.
    law_residual: f64,
}

impl Collector {
    /// Empty, with the sizes of the simulation.
    pub fn new(scene: &Scene, simulation: &Simulation) -> Self {
        let models = || simulation.bodies.iter().map(|body| &body.model);
        let device = simulation.device();
        let on_gpu = device.backend == "gpu";
        let constant: u64 = models().map(|model| model.host_bytes()).sum();
        let explicit = scene.time.integrator == Integrator::SymplecticEuler;
        let kind = match scene.solver.preconditioner {
            _ if explicit => "none",
            Preconditioner::None => "cg",
            _ => "pcg",
        };
        let report = Report {
            scene: scene.file.display().to_string(),
            backend: device.backend.into(),
            adapter: match on_gpu {
                true => device.adapter,
                false => format!("{}, {}", device.adapter, device.precision),
            },
            driver: device.driver,
            nodes: models().map(|m| m.own_nodes()).sum(),
            hexes: models().map(|m| m.elements().hexahedron_count).sum(),
            tets: models().map(|m| m.elements().tetrahedron_count).sum(),
            spring_count: models().map(|m| m.elements().spring_count).sum(),
            dof: models().map(|model| model.degrees_of_freedom()).sum(),
            step_s: scene.time.step,
            solver: SolverReport {
                kind: kind.into(),
                preconditioner: if explicit { "none" } else { word(&PRECONDITIONERS, scene.solver.preconditioner) }
                    .into(),
                sums: device.sums.into(),
                ..SolverReport::default()
            },
            memory_bytes: match on_gpu {
                true => Memory { device: device.device_bytes, host: constant },
                false => Memory { device: 0, host: constant + device.device_bytes },
            },
            ..Report::default()
        };
        Self { start: Instant::now(), seen: Collected { report, ..Collected::default() } }
    }

    /// Data accumulated so far, for a checkpoint.
    pub fn collected(&self) -> Collected {
        Collected { wall: self.wall(), ..self.seen.clone() }
    }

    /// Continues with the data of the first part of the run; scene file, adapter and driver are those of this part.
    pub fn resume(&mut self, earlier: Collected) {
        let Report { scene, adapter, driver, .. } = std::mem::take(&mut self.seen.report);
        self.seen = Collected { report: Report { scene, adapter, driver, ..earlier.report.clone() }, ..earlier };
    }

    /// Time of the largest force, s.
    pub fn peak_time(&self) -> f64 {
        self.seen.peak_time
    }

    fn wall(&self) -> f64 {
        self.seen.wall + self.start.elapsed().as_secs_f64()
    }

    /// Adds a step.
    pub fn add(&mut self, step: &StepReport, took: Duration) {
        let r = &mut self.seen.report;
        r.steps += 1;
        // time, iterations and residuals of the solver
        let times = match step.true_residual {
            Some(_) => &mut self.seen.checked,
            None => &mut self.seen.plain,
        };
        times.add(took.as_secs_f64() * 1e3);
        self.seen.costs.iter_mut().zip(cost_values(step)).for_each(|(series, value)| series.add(value));
        self.seen.iterations += u64::from(step.free.iterations);
        r.solver.iterations_max = r.solver.iterations_max.max(step.free.iterations);
        r.solver.refinements += u64::from(step.refinements);
        r.solver.newton_iterations_max = r.solver.newton_iterations_max.max(step.newton_iterations);
        r.solver.at_floor += u64::from(step.at_floor);
        r.solver.residual_max = r.solver.residual_max.max(step.residual);
        if let Some(residual) = step.true_residual {
            r.solver.residual_true = Some(r.solver.residual_true.unwrap_or(0.0).max(residual));
            r.solver.law_residual = Some(larger(r.solver.law_residual.unwrap_or(0.0), step.law_residual));
        }
        self.seen.law_residual = step.law_residual;
        step.measured.iter().for_each(|measured| self.measured(measured));
        let r = &mut self.seen.report;
        // contact
        r.contacts_max = r.contacts_max.max(step.contact.count());
        r.contact.candidates_max = r.contact.candidates_max.max(step.contact.candidates);
        r.contact.depth_mm_max = r.contact.depth_mm_max.max(step.contact.depth * 1e3);
        if step.contact.count() > 0 {
            self.seen.touching += 1;
            self.seen.passes += u64::from(step.contact.passes);
            r.contact.passes_max = r.contact.passes_max.max(step.contact.passes);
            r.contact.residual_n_max = r.contact.residual_n_max.max(step.contact.residual_n);
            r.contact.residual_m_max = r.contact.residual_m_max.max(step.contact.residual_m);
        }
        let force = step.contact.largest_on_tools();
        if force > r.contact_force_n_max {
            r.contact_force_n_max = force;
            self.seen.peak_time = step.time;
        }
        // wound and warnings
        r.cut.opening_mm_max = r.cut.opening_mm_max.max(step.opening * 1e3);
        r.cut.overlap_mm_max = r.cut.overlap_mm_max.max(step.overlap * 1e3);
        for (name, count) in &step.warnings {
            *r.warnings.entry((*name).to_string()).or_default() += u64::from(*count);
        }
    }

    /// Adds the state before the first step.
    pub fn began(&mut self, measured: &Measured) {
        self.measured(measured);
        self.warn_of(measured);
        let energy = &mut self.seen.report.energy_j;
        let now = measured.energy;
        energy.start = Some(now.total());
        (energy.kinetic.start, energy.elastic.start, energy.potential.start) =
            (Some(now.kinetic), Some(now.elastic), Some(now.potential));
    }

    fn measured(&mut self, measured: &Measured) {
        let (r, now) = (&mut self.seen.report, measured.energy);
        let raise = |most: &mut Option<f64>, value: f64| *most = Some(most.map_or(value, |most| larger(most, value)));
        raise(&mut r.energy_j.max, now.total());
        raise(&mut r.energy_j.kinetic.max, now.kinetic);
        raise(&mut r.energy_j.elastic.max, now.elastic);
        raise(&mut r.energy_j.potential.max, now.potential);
        if r.nodes > 0 {
            r.inverted_cells_max = r.inverted_cells_max.max(Some(measured.inverted));
        }
    }

    /// Counts problems of a state between steps; those of a checked step are in its own report.
    fn warn_of(&mut self, measured: &Measured) {
        measured.warnings().into_iter().for_each(|(name, count)| self.warn(name, u64::from(count)));
    }

    fn warn(&mut self, name: &str, count: u64) {
        debug_assert!(crate::step::warning(name).is_some(), "{name} is in no row of `WARNINGS`");
        if count > 0 {
            *self.seen.report.warnings.entry(name.into()).or_default() += count;
        }
    }

    /// Adds the state at the end of the run.
    pub fn ended(&mut self, simulation: &Simulation, states: &[Snapshot], measured: Option<&Measured>) {
        self.warn("non_finite_nodes", states.iter().map(Snapshot::non_finite).sum::<usize>() as u64);
        let beyond = larger(self.seen.law_residual, 1.0) != 1.0;
        self.warn("step_beyond_linearisation", u64::from(beyond));
        if let Some(measured) = measured {
            self.measured(measured);
            self.warn_of(measured);
            self.balance(measured);
        }
        // only of kinds whose pieces are counted
        let counted = || {
            let bodies = simulation.bodies.iter();
            bodies.filter_map(|body| Some((body.model.mechanics().pieces(&body.wound)?, &body.wound.surface)))
        };
        self.seen.report.cut.pieces = Some(counted().map(|(pieces, _)| pieces).sum());
        self.seen.report.cut.nonmanifold_edges = Some(counted().map(|(_, surface)| surface.edges().nonmanifold).sum());
    }

    /// Adds the energy at the end, and what went in and out.
    fn balance(&mut self, measured: &Measured) {
        let Measured { energy: now, booked, .. } = measured;
        let energy = &mut self.seen.report.energy_j;
        energy.end = Some(now.total());
        (energy.kinetic.end, energy.elastic.end, energy.potential.end) =
            (Some(now.kinetic), Some(now.elastic), Some(now.potential));
        energy.work_in =
            WorkReport { loads: Some(booked.loads), hands: Some(booked.hands), overlaps: Some(booked.overlap) };
        let damping = booked.damping();
        let start = energy.start.unwrap_or(f64::NAN);
        let known = booked.dissipated() + damping.unwrap_or(0.0);
        energy.dissipated = DissipationReport {
            friction: Some(booked.friction),
            cutting: Some(booked.cutting),
            impact: Some(booked.impact),
            damping,
            numerical: (!booked.unknown).then_some(start + booked.work() - now.total() - known),
        };
    }

    /// Current report.
    pub fn report(&self, simulation: &Simulation) -> Report {
        let mut r = self.seen.report.clone();
        let totals = simulation.totals();
        r.cut.hexes_removed = totals.hexahedra;
        r.cut.removed_mm3 = totals.volume * 1e9;
        r.cut.tets_removed = totals.tetrahedra;
        r.cut.springs_removed = totals.springs_removed;
        r.cut.links_severed = totals.links;
        r.cut.links_held = totals.holding;
        r.cut.node_copies = totals.copies;
        r.cut.area_mm2 = totals.area * 1e6;
        r.cut.length_mm = totals.length * 1e3;
        r.cut.length_top_mm = totals.length_top * 1e3;
        r.cut.depth_mm = totals.depth * 1e3;
        r.solver.iterations_mean = mean(self.seen.iterations, r.steps);
        r.contact.passes_mean = mean(self.seen.passes, self.seen.touching);
        let times = if self.seen.plain.is_empty() { &self.seen.checked } else { &self.seen.plain };
        r.step_ms = times.spread();
        r.costs = costs(&self.seen.costs);
        r.wall_s = self.wall();
        r
    }
}

/// A step's costs with its columns and passes, in the order of [`costs`].
fn cost_values(step: &StepReport) -> [f64; COSTS] {
    let ms = |part: Part| step.costs.of(part) * 1e3;
    [
        f64::from(step.contact.columns),
        f64::from(step.contact.passes),
        f64::from(step.costs.iterations),
        step.costs.row_updates as f64,
        step.costs.cut_tests as f64,
        ms(Part::Search),
        ms(Part::Free),
        ms(Part::Columns),
        ms(Part::Corrections),
        ms(Part::Laws),
        ms(Part::HandOver),
        ms(Part::Cut),
        ms(Part::Other),
    ]
}

/// Report of the values of [`cost_values`].
fn costs(series: &[Series; COSTS]) -> CostReport {
    let [
        columns,
        passes,
        iterations,
        row_updates,
        cut_tests,
        search_ms,
        free_ms,
        columns_ms,
        corrections_ms,
        laws_ms,
        hand_over_ms,
        cut_ms,
        other_ms,
    ] = series.each_ref().map(Series::share);
    CostReport {
        columns,
        passes,
        iterations,
        row_updates,
        cut_tests,
        search_ms,
        free_ms,
        columns_ms,
        corrections_ms,
        laws_ms,
        hand_over_ms,
        cut_ms,
        other_ms,
    }
}

fn mean(sum: u64, count: u32) -> f64 {
    match count {
        0 => 0.0,
        _ => sum as f64 / f64::from(count),
    }
}

/// Most values of the sample.
const KEPT: usize = 4096;

/// Number, sum and maximum of values that are not negative, and a sample of them for their ranks: of as many steps as a run has, in memory
/// that ends growing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Series {
    count: u64,
    sum: f64,
    max: f64,
    kept: Vec<f64>,
}

impl Series {
    /// Adds a value. The sample has all of the first [`KEPT`]; of more, each with the same probability (Vitter 1985, algorithm R), by a
    /// generator that depends on their number alone.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.max = larger(self.max, value);
        if self.kept.len() < KEPT {
            self.kept.push(value);
        } else if let Some(kept) = self.kept.get_mut(Random::split_mix(self.count).below(self.count) as usize) {
            *kept = value;
        }
    }

    /// No value was added.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Order statistics by nearest rank in the sample, and the maximum of all; `None` without values.
    pub fn spread(&self) -> Spread {
        let mut sorted = self.kept.clone();
        sorted.sort_by(f64::total_cmp);
        let rank = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.max(1) - 1).copied()
        };
        Spread { median: rank(0.5), p99: rank(0.99), max: (!self.is_empty()).then_some(self.max) }
    }

    /// Mean, 99 % and maximum; 0 without values.
    pub fn share(&self) -> Share {
        let mean = self.sum / self.count.max(1) as f64;
        Share { mean, p99: self.spread().p99.unwrap_or(0.0), max: self.max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::Energy;

    #[test]
    fn inverted_cells_and_an_energy_that_is_no_number_are_warnings() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/hard/still.toml");
        let scene = crate::scene::read(&path).unwrap_or_else(|e| panic!("{e}"));
        let simulation = Simulation::new(&scene, &crate::step::Platform::Cpu64).expect("the scene fits");
        let warned = |energy: f64, inverted: u32, beyond_law: u32, grew: bool| {
            let mut collector = Collector::new(&scene, &simulation);
            let energy = Energy { elastic: energy, ..Energy::default() };
            collector.began(&Measured { energy, inverted, grew, beyond_law, ..Measured::default() });
            collector.seen.report.warnings.into_iter().collect::<Vec<_>>()
        };
        assert_eq!(warned(f64::NAN, 2, 0, false), [("inverted_cells".into(), 2), ("non_finite_energy".into(), 1)]);
        assert_eq!(warned(1.0, 0, 3, true), [("energy_grew".into(), 1), ("strain_beyond_law".into(), 3)]);
        assert_eq!(warned(1.0, 0, 0, false), [], "the counter-test");
    }

    fn series(values: impl Iterator<Item = f64>) -> Series {
        let mut series = Series::default();
        values.for_each(|value| series.add(value));
        series
    }

    #[test]
    fn ranks_are_values_that_occurred() {
        let s = series((1..=200).rev().map(f64::from)).spread();
        assert_eq!((s.median, s.p99, s.max), (Some(100.0), Some(198.0), Some(200.0)));
        assert_eq!(series([3.0].into_iter()).spread().p99, Some(3.0));
        assert_eq!(series([].into_iter()).spread().median, None);
    }

    #[test]
    fn a_long_series_is_a_fair_sample_in_bounded_memory() {
        // rising, falling, and alternating, which a sample by every second value would see half of
        let n = 100_000;
        let ramp = |k: i32| f64::from(k) / f64::from(n);
        for values in [&ramp as &dyn Fn(i32) -> f64, &|k| ramp(n - k), &|k| f64::from(k % 2) * ramp(k)] {
            let whole: Vec<f64> = (1..=n).map(values).collect();
            let s = series(whole.iter().copied());
            assert!(s.kept.capacity() <= KEPT, "{}", s.kept.capacity());
            let (found, share) = (s.spread(), s.share());
            let max = whole.iter().copied().fold(0.0, f64::max);
            assert_eq!((found.max, share.max), (Some(max), max), "of all, not of the sample");
            assert!((share.mean - whole.iter().sum::<f64>() / f64::from(n)).abs() < 1e-9);
            // ranks of a sample of 4096: standard deviations 0.8 and 0.16 %
            for (found, wanted, most) in [(found.median, 0.5, 0.03), (found.p99, 0.99, 0.006)] {
                let found = found.expect("there are values");
                let below = whole.iter().filter(|v| **v < found).count() as f64 / f64::from(n);
                let to = whole.iter().filter(|v| **v <= found).count() as f64 / f64::from(n);
                assert!(below - most <= wanted && wanted <= to + most, "{below} to {to}, wanted {wanted}");
            }
        }
    }
}
