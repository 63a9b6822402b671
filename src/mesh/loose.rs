//! Pieces of a body that cuts have set free: connected cells whose nodes nothing holds.
//!
//! A search starts in each cell beside a cut and spreads over the links, cell by cell in turn. Searches that meet are one from then on. They
//! end when all are one, or each has a whole piece or a cell that is held. A cut that frees nothing thus costs what lies around its front,
//! and one that frees a piece what lies in the smaller part.

use std::collections::{BTreeMap, VecDeque};

/// Cells of one search.
#[derive(Default)]
struct Spread {
    cells: Vec<usize>,
    /// Those whose neighbours have not been looked at.
    open: VecDeque<usize>,
    held: bool,
}

/// Whole pieces around these cells that nothing holds, each as its cells in ascending order; none where the cells are still connected.
pub fn parted(seeds: &[usize], linked: impl Fn(usize) -> Vec<usize>, held: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
    // one spread from each cell
    let (mut spreads, mut of_cell): (Vec<Spread>, BTreeMap<usize, usize>) = (vec![], BTreeMap::new());
    for seed in seeds {
        if let std::collections::btree_map::Entry::Vacant(entry) = of_cell.entry(*seed) {
            entry.insert(spreads.len());
            spreads.push(Spread { cells: vec![*seed], open: VecDeque::from([*seed]), held: false });
        }
    }
    // `[spread]` the one that it has joined, itself if none
    let mut joined: Vec<usize> = (0..spreads.len()).collect();
    let last = |joined: &[usize], mut k: usize| {
        while joined[k] != k {
            k = joined[k];
        }
        k
    };
    // all spread by one cell in turn, until one is left, or none can go on
    let mut left = spreads.len();
    let mut spreading = true;
    while left > 1 && spreading {
        spreading = false;
        for first in 0..spreads.len() {
            if joined[first] != first || spreads[first].held {
                continue;
            }
            let Some(cell) = spreads[first].open.pop_front() else { continue };
            spreading = true;
            spreads[first].held = held(cell);
            let mut own = first;
            for next in linked(cell) {
                match of_cell.get(&next).map(|k| last(&joined, *k)) {
                    None => {
                        of_cell.insert(next, own);
                        spreads[own].cells.push(next);
                        spreads[own].open.push_back(next);
                    }
                    Some(other) if other != own => {
                        // the smaller joins the larger
                        let (to, from) = if spreads[other].cells.len() > spreads[own].cells.len() {
                            (other, own)
                        } else {
                            (own, other)
                        };
                        let Spread { cells, open, held } = std::mem::take(&mut spreads[from]);
                        spreads[to].cells.extend(cells);
                        spreads[to].open.extend(open);
                        spreads[to].held |= held;
                        joined[from] = to;
                        (own, left) = (to, left - 1);
                    }
                    Some(_) => {}
                }
            }
        }
    }
    // what has not met the others is a piece of its own
    if left < 2 {
        return vec![];
    }
    let whole = |(k, spread): (usize, Spread)| (joined[k] == k && !spread.held).then_some(spread.cells);
    let mut out: Vec<Vec<usize>> = spreads.into_iter().enumerate().filter_map(whole).collect();
    out.iter_mut().for_each(|cells| cells.sort_unstable());
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// Pieces of a row of cells with cuts between some of them, and the number of cells that were looked at.
    fn of_row(count: usize, cuts: &[usize], seeds: &[usize], held: &[usize]) -> (Vec<Vec<usize>>, usize) {
        let looked = Cell::new(0);
        let linked = |cell: usize| {
            looked.set(looked.get() + 1);
            let before = (cell > 0 && !cuts.contains(&cell)).then(|| cell - 1);
            let after = (cell + 1 < count && !cuts.contains(&(cell + 1))).then_some(cell + 1);
            before.into_iter().chain(after).collect()
        };
        let found = parted(seeds, linked, |cell| held.contains(&cell));
        (found, looked.get())
    }

    #[test]
    fn a_cut_frees_the_side_that_nothing_holds() {
        assert_eq!(of_row(100, &[95], &[94, 95], &[0]).0, [vec![95, 96, 97, 98, 99]]);
        assert_eq!(of_row(100, &[5], &[4, 5], &[99]).0, [vec![0, 1, 2, 3, 4]]);
        // both ends held, none held
        assert!(of_row(100, &[5], &[4, 5], &[0, 99]).0.is_empty());
        assert_eq!(of_row(6, &[2], &[1, 2], &[]).0, [vec![0, 1], vec![2, 3, 4, 5]]);
        assert_eq!(of_row(9, &[3, 6], &[2, 3, 5, 6], &[8]).0, [vec![0, 1, 2], vec![3, 4, 5]]);
    }

    #[test]
    fn cells_that_are_still_connected_are_found_so_nearby() {
        let (found, looked) = of_row(1_000_000, &[], &[500_000, 500_001, 500_004], &[0]);
        assert!(found.is_empty() && looked < 20, "{looked}");
        // a single cell tells nothing
        assert_eq!(of_row(100, &[], &[7], &[]), (vec![], 0));
    }
}
