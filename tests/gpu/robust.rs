//! Three thousand random sweeps on the device (`CUTIS_MEASURED=1`: ten thousand): they cut what they cut on the CPU path in f32, and each
//! step of the body that is left is the CPU path's from the same state.
//!
//! The CPU's body starts each round from what the device's holds then, with the whole wound at once; the device's goes through all
//! rounds with what each cut changes. Both get the same removals, those of the device's hits.

use super::Failure;
use super::crumbs::{CAP, at_rest, block, needs, quad, random};
use cutis::backend::{Backend, FREE, GpuBackend, Query, Snapshot, SolveRequest, Target, on_cpu};
use cutis::bodies::Model;
use cutis::bodies::{Removal, Wound};
use cutis::gpu::Gpu;
use std::collections::BTreeSet;

/// Rounds of a step and sweeps; the second number where the tests measure.
const ROUNDS: [usize; 2] = [60, 200];
const SWEEPS: usize = 50;
/// Columns of copies: used up on the way.
const RESERVE: usize = 40;
/// Residual that each step is solved to, of its load.
const TOLERANCE: f64 = 2e-6;
/// Difference of a step's motion, of the largest: two residuals of the tolerance, times the condition that single cells hanging by
/// an edge leave, about 1e3.
const STEP: f64 = 5e-3;
/// Links of which rounding decides whether they are cut, of all that are.
const DECIDED: f64 = 1e-3;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_body_cut_by_random_sweeps_is_that_of_the_cpu", sweeps_agree),
    ("a_word_that_the_device_lacks_is_noticed", a_lost_word_is_noticed),
];

/// The body on the device, and how it was cut.
struct Run {
    model: Model,
    wound: Wound,
    gpu: GpuBackend,
    hits: usize,
    decided: usize,
    apart: f64,
}

/// Motion of a step that is solved to the tolerance, `[node]` m.
fn step(backend: &mut dyn Backend) -> Result<Vec<[f64; 4]>, Failure> {
    backend.begin()?;
    let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) }];
    let outcome = backend.solve(&wanted, &[])?.0[0];
    if !outcome.converged {
        return Err(format!("{outcome:?}").into());
    }
    let dx = backend.solution(FREE)?;
    backend.finish(false, true)?;
    Ok(dx)
}

/// Largest difference of the motions, of the largest motion.
fn apart(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    let largest = |x: &mut dyn Iterator<Item = f64>| x.fold(0.0, |m: f64, c| if c.abs() <= m { m } else { c.abs() });
    let (a, b) = (a.as_flattened(), b.as_flattened());
    largest(&mut a.iter().zip(b).map(|(p, q)| p - q)) / largest(&mut b.iter().copied())
}

/// A copy has the state of the node that it comes from, all others theirs.
fn duplicated(before: &Snapshot, after: &Snapshot, removal: &Removal) -> bool {
    let mut wanted = [before.u.clone(), before.v.clone()];
    for [copy, source] in &removal.copies {
        wanted.iter_mut().for_each(|values| values[*copy as usize] = values[*source as usize]);
    }
    wanted[0] == after.u && wanted[1] == after.v
}

/// All that a cut has changed so far, for a backend that starts from the state now.
fn whole(model: &Model, wound: &Wound) -> Removal {
    let uncut = Wound::new(model);
    let pairs = uncut.surface.parts.table().iter().zip(wound.surface.parts.table());
    let words =
        (0..).zip(pairs).filter(|(_, (before, now))| before != now).map(|(word, (_, now))| (word, *now)).collect();
    let in_use = model.params::<f32>().nodes_in_use(wound.surface.parts.table());
    let dofs = (0..).zip(wound.dofs.iter().copied()).take(in_use).collect();
    Removal { words, dofs, ..Removal::default() }
}

impl Run {
    fn new(gpu: &Gpu) -> Result<Self, Failure> {
        let model = block(RESERVE);
        let a = &gpu.adapter;
        let own = Gpu::open(Some(&format!("{} {} {}", a.name, a.backend, a.driver)))?;
        Ok(Self {
            gpu: GpuBackend::new(own, &model, needs(), CAP, 0.0, &at_rest(&model))?,
            wound: Wound::new(&model),
            model,
            hits: 0,
            decided: 0,
            apart: 0.0,
        })
    }

    /// The CPU path from the device's state.
    fn twin(&mut self) -> Result<Box<dyn Backend>, Failure> {
        let mut twin = on_cpu(true, &self.model, needs(), CAP, 0.0, &self.gpu.snapshot()?);
        twin.remove(&whole(&self.model, &self.wound))?;
        Ok(twin)
    }

    /// A step on both and sweeps after it; `lose` drops what it wants of the device's removal.
    fn round(&mut self, next: &mut impl FnMut() -> f64, lose: impl Fn(&mut Removal)) -> Result<(), Failure> {
        let mut twin = self.twin()?;
        let moved = [step(&mut self.gpu)?, step(twin.as_mut())?];
        self.apart = self.apart.max(apart(&moved[0], &moved[1]));
        let quads: Vec<[f64; 3]> = (0..SWEEPS).flat_map(|_| quad(&self.model, next)).collect();
        let query = Query { quads, ..Query::default() };
        let hits = self.gpu.read(&query)?.hits;
        let there: BTreeSet<u32> = hits.iter().map(|hit| hit.segment).collect();
        let here: BTreeSet<u32> = twin.read(&query)?.hits.iter().map(|hit| hit.segment).collect();
        self.hits += there.len();
        self.decided += there.symmetric_difference(&here).count();
        let mut removal = self.wound.apply(&self.model, &hits);
        let before = self.gpu.snapshot()?;
        lose(&mut removal);
        self.gpu.remove(&removal)?;
        let after = self.gpu.snapshot()?;
        let finite = after.u.iter().chain(&after.v).flatten().all(|c| c.is_finite());
        match finite && duplicated(&before, &after, &removal) {
            true => Ok(()),
            false => Err("copies have another state than their nodes, or none".into()),
        }
    }
}

fn sweeps_agree(gpu: &Gpu) -> Result<(), Failure> {
    let (mut run, mut next) = (Run::new(gpu)?, random(2));
    for n in 0..ROUNDS[usize::from(std::env::var_os("CUTIS_MEASURED").is_some())] {
        run.round(&mut next, |_| ()).map_err(|e| format!("round {n}: {}", e.0))?;
        if run.apart.is_nan() || run.apart > STEP {
            return Err(format!("round {n}: the step is {:.1e} off that of the CPU", run.apart).into());
        }
    }
    let totals = run.wound.totals;
    let text = format!(
        "{} hits, {} on one path alone, steps {:.1e} apart; {} links severed, {} refused, {} copies",
        run.hits, run.decided, run.apart, totals.links, totals.refused, totals.copies
    );
    super::report(gpu, &text);
    if run.decided as f64 > DECIDED * run.hits as f64 || totals.refused == 0 || totals.links < 300 {
        return Err(text.into());
    }
    Ok(())
}

/// The counter-test: one corner of a split cell.
fn a_lost_word_is_noticed(gpu: &Gpu) -> Result<(), Failure> {
    let (mut run, mut next) = (Run::new(gpu)?, random(2));
    (0..3).try_for_each(|_| run.round(&mut next, |_| ()))?;
    let whole = run.apart;
    let first = run.model.params::<f64>().layout().corners as u32;
    let copies = run.model.grid.node_count() as u32;
    run.round(&mut next, |removal| {
        let lost = removal.words.iter().position(|(word, value)| *word >= first && *value >= copies);
        lost.map(|k| removal.words.remove(k));
    })?;
    run.round(&mut next, |_| ())?;
    super::report(gpu, &format!("steps {whole:.1e} apart, {:.1e} without a word", run.apart));
    match whole <= STEP && run.apart > STEP {
        true => Ok(()),
        false => Err(format!("steps are {whole:e} apart, {:e} without a word", run.apart).into()),
    }
}
