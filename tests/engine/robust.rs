//! A body that ten thousand random sweeps cut until nothing more gives way, or its reserve of copies is used up, while it moves: after each
//! sweep everything that must hold of a cut body holds.
//!
//! `CUTIS_MEASURED=1` prints what was measured.

use crate::crumbs::{CAP, at_rest, block, needs, quad, random};
use cutis::backend::{Backend, FREE, Query, Snapshot, SolveRequest, Target, on_cpu};
use cutis::bodies::Wound;
use cutis::bodies::{Model, Solved, true_residual};
use std::collections::BTreeSet;

const SWEEPS: usize = 10_000;
/// Sweeps between two steps.
const BETWEEN: usize = 50;
/// Residual that each step is solved to, of its load.
const TOLERANCE: f64 = 1e-6;
/// Sums of some thousand masses in f64.
const ROUNDING: f64 = 1e-12;

/// Columns of copies for any cut: eight cells around a node are at most eight parts.
const ENOUGH: usize = 7 * 9 * 9;

/// The body as it is cut.
struct Run {
    model: Model,
    wound: Wound,
    backend: Box<dyn Backend>,
    pieces: usize,
    iterations: u32,
    residual: f64,
}

impl Run {
    fn new(reserve: usize) -> Self {
        let model = block(reserve);
        let backend = on_cpu(false, &model, needs(), CAP, 0.0, &at_rest(&model));
        Self { wound: Wound::new(&model), model, backend, pieces: 1, iterations: 0, residual: 0.0 }
    }

    fn state(&mut self) -> Snapshot {
        self.backend.snapshot().expect("the CPU path has no device to fail")
    }

    fn sweep(&mut self, random: &mut impl FnMut() -> f64) {
        let device = "the CPU path has no device to fail";
        let query = Query { quads: quad(&self.model, random).to_vec(), ..Query::default() };
        let hits = self.backend.read(&query).expect(device).hits;
        let removal = self.wound.apply(&self.model, &hits);
        self.backend.remove(&removal).expect(device);
    }

    /// A step; its true residual.
    fn step(&mut self) -> f64 {
        let device = "the CPU path has no device to fail";
        let before = self.state();
        self.backend.begin().expect(device);
        let wanted = [SolveRequest { rhs: FREE, target: Target::OfLoad(TOLERANCE) }];
        let outcome = self.backend.solve(&wanted, &[]).expect(device).0[0];
        assert!(outcome.converged, "{outcome:?} of {} pieces", self.pieces);
        self.iterations = self.iterations.max(outcome.iterations);
        let residual = true_residual(&self.model, &solved(before, self.backend.solution(FREE).expect(device)));
        self.residual = self.residual.max(residual);
        self.backend.finish(false, true).expect(device);
        residual
    }

    /// Pieces by joining the cells of each link that holds; they never grow fewer.
    fn count_pieces(&mut self) {
        let params = self.model.params::<f64>();
        let mut piece: Vec<usize> = (0..params.cell_count as usize).collect();
        fn root(piece: &[usize], mut cell: usize) -> usize {
            while piece[cell] != cell {
                cell = piece[cell];
            }
            cell
        }
        for [link, a, b] in links(&self.model) {
            if !self.wound.surface.parts.is_severed(link / 3, link % 3) {
                let (a, b) = (root(&piece, a), root(&piece, b));
                piece[a.max(b)] = a.min(b);
            }
        }
        let count = (0..piece.len()).filter(|cell| piece[*cell] == *cell).count();
        assert_eq!(self.wound.surface.parts.pieces(&self.wound.surface.alive), count);
        assert!(count >= self.pieces, "{count} pieces after {}", self.pieces);
        self.pieces = count;
    }
}

/// Links between face neighbours: number, both cells.
fn links(model: &Model) -> Vec<[usize; 3]> {
    let all = cutis::bodies::grid::links(&model.params());
    let both = all.into_iter().enumerate().filter(|(_, [a, b])| a != b);
    both.map(|(link, [a, b])| [link, a as usize, b as usize]).collect()
}

fn solved(before: Snapshot, dx: Vec<[f64; 4]>) -> Solved {
    let zeros = vec![[0.0; 4]; dx.len()];
    Solved { start: before, load: zeros.clone(), contact: zeros, dx, ..Solved::default() }
}

/// Relative change of a body's mass.
fn mass_lost(model: &Model, state: &Snapshot) -> f64 {
    let sum = |dofs: &[[f64; 4]]| dofs.iter().map(|f| f[3]).sum::<f64>();
    (sum(&state.dofs) / sum(&model.dofs) - 1.0).abs()
}

/// What must hold after each sweep.
fn holds(model: &Model, wound: &Wound, state: &Snapshot) -> Result<(), String> {
    let (params, parts) = (model.params::<f64>(), &wound.surface.parts);
    let numbers = state.u.iter().chain(&state.v).chain(&state.dofs).chain(&state.rotation).flatten();
    if let Some(c) = numbers.into_iter().find(|c| !c.is_finite()) {
        return Err(format!("{c} in the state"));
    }
    if state.split != parts.table() || state.dofs != wound.dofs {
        return Err("the backend has another table or other masses".into());
    }
    let mut used = BTreeSet::new();
    for cell in 0..params.cell_count as usize {
        for (corner, own) in params.corners(cell).into_iter().zip(parts.corners(cell)) {
            if own >= model.node_count() || parts.original(own) != corner {
                return Err(format!("cell {cell} has {own} for node {corner}"));
            }
            used.insert(own);
        }
    }
    if let Some(node) = used.iter().find(|node| state.dofs[**node][3] <= 0.0) {
        return Err(format!("node {node} has cells and no mass"));
    }
    if used.len() != model.grid.node_count() + wound.totals.copies {
        return Err(format!("{} nodes, {} copies", used.len(), wound.totals.copies));
    }
    let lost = mass_lost(model, state);
    if lost > ROUNDING {
        return Err(format!("the mass has changed by {lost:e}"));
    }
    match wound.surface.edges().open {
        0 => Ok(()),
        open => Err(format!("{open} edges are open")),
    }
}

fn measured(run: &Run) {
    if std::env::var_os("CUTIS_MEASURED").is_some() {
        println!(
            "{} columns: {:?}, {} pieces, {} iterations at most, true residual {:.2e}",
            run.model.hexahedra().extra_columns,
            run.wound.totals,
            run.pieces,
            run.iterations,
            run.residual
        );
    }
}

/// All sweeps, with a step after every so many.
fn cut_up(reserve: usize, seed: u64) -> Run {
    let mut run = Run::new(reserve);
    let mut next = random(seed);
    for n in 0..SWEEPS {
        if n % BETWEEN == 0 {
            run.step();
            run.count_pieces();
        }
        run.sweep(&mut next);
        let state = run.state();
        holds(&run.model, &run.wound, &state).unwrap_or_else(|e| panic!("seed {seed}, sweep {n}: {e}"));
    }
    run.step();
    run.count_pieces();
    measured(&run);
    // the recurrence of conjugate gradients keeps to the true residual in f64
    assert!(run.residual < 1.1 * TOLERANCE, "{:e}", run.residual);
    run
}

/// Number of cells that are joined to a cell by these links without one of them.
fn joined(links: &[[usize; 3]], cell: usize, without: usize) -> usize {
    let mut found = BTreeSet::from([cell]);
    loop {
        let before = found.len();
        for [link, a, b] in links {
            if *link != without && (found.contains(a) || found.contains(b)) {
                found.extend([*a, *b]);
            }
        }
        if found.len() == before {
            return before;
        }
    }
}

#[test]
fn ten_thousand_sweeps_leave_a_body_that_is_sound_and_no_crumbs() {
    let run = cut_up(ENOUGH, 1);
    assert_eq!(run.wound.totals.refused, 0);
    let parts = &run.wound.surface.parts;
    let (held, severed): (Vec<[usize; 3]>, Vec<_>) =
        links(&run.model).into_iter().partition(|[link, ..]| !parts.is_severed(link / 3, link % 3));
    assert_eq!(run.wound.totals.links, severed.len());
    assert!(severed.len() > held.len(), "{} links hold", held.len());
    // what holds, holds a piece of fewer than eight cells; nothing is smaller
    for [link, a, b] in &held {
        let small = joined(&held, *a, *link) < 8 || joined(&held, *b, *link) < 8;
        assert!(small, "link {link} holds cells {a} and {b} for no reason");
    }
    for cell in 0..run.model.grid.cell_count() {
        assert!(joined(&held, cell, usize::MAX) >= 8, "cell {cell} is a crumb");
    }
}

#[test]
fn ten_thousand_sweeps_with_a_small_reserve_leave_a_body_that_is_sound() {
    let run = cut_up(60, 2);
    let parts = &run.wound.surface.parts;
    assert!(run.wound.totals.refused > 0 && parts.parents().len() == 60, "{:?}", run.wound.totals);
    let severed = links(&run.model).into_iter().filter(|[link, ..]| parts.is_severed(link / 3, link % 3)).count();
    assert_eq!(severed, run.wound.totals.links);
}

#[test]
fn a_word_a_mass_or_a_copy_that_is_left_out_is_noticed() {
    let mut run = Run::new(ENOUGH);
    let mut next = random(3);
    run.step();
    (0..500).for_each(|_| run.sweep(&mut next));
    let state = run.state();
    assert_eq!(holds(&run.model, &run.wound, &state), Ok(()));
    let copy = run.model.grid.node_count() + run.wound.surface.parts.copies(0).len();
    let copy = (copy..run.model.node_count()).find(|node| state.dofs[*node][3] > 0.0).expect("there are copies");
    let mut lighter = state.clone();
    lighter.dofs[copy][3] = 0.0;
    assert!(mass_lost(&run.model, &lighter) > 1e3 * ROUNDING);
    assert!(holds(&run.model, &run.wound, &lighter).is_err());
    let mut nowhere = state.clone();
    nowhere.u[copy][1] = f64::NAN;
    assert!(holds(&run.model, &run.wound, &nowhere).is_err());
    // a corner that is still the node of the grid: other equations than those that were solved
    let before = run.state();
    assert!(run.step() < 1.1 * TOLERANCE);
    let dx = run.backend.solution(FREE).expect("the CPU path has no device to fail");
    let mut other = before;
    let params = run.model.params::<f64>();
    let cell = run.wound.surface.parts.cells_of(copy)[0];
    let word = params.layout().corners + 8 * (other.split[params.layout().row + cell] as usize - 1);
    for (a, corner) in params.corners(cell).into_iter().enumerate() {
        other.split[word + a] = corner as u32;
    }
    let residual = true_residual(&run.model, &solved(other, dx));
    assert!(residual > 100.0 * TOLERANCE, "{residual:e}");
}
