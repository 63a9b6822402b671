//! The pieces that a body has fallen into: live cells that hang together by links.

use super::Parts;

impl Parts {
    /// How many pieces the live cells have fallen into.
    pub fn pieces(&self, alive: &[bool]) -> usize {
        let strides = [1, self.params.cells_x as usize, (self.params.cells_x * self.params.cells_y) as usize];
        let mut seen: Vec<bool> = alive.iter().map(|live| !live).collect();
        let mut count = 0;
        let mut open = vec![];
        for first in 0..seen.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            count += 1;
            open.push(first);
            while let Some(cell) = open.pop() {
                let at = self.params.cell_at(cell);
                for axis in 0..3 {
                    let before = (at[axis] > 0).then(|| cell - strides[axis]).filter(|b| !self.is_severed(*b, axis));
                    let beyond = self.beyond(cell, axis).filter(|_| !self.is_severed(cell, axis));
                    for next in before.into_iter().chain(beyond) {
                        if !std::mem::replace(&mut seen[next], true) {
                            open.push(next);
                        }
                    }
                }
            }
        }
        count
    }
}
