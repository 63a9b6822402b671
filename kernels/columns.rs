//! Solution of the factored columns ([`super::factor`]) for a load, with a dot product: shared by `precondition` and `relax`.
//!
//! Forward: `y_k = l_k − G_{k−1}ᵀ y_{k−1}`; backward: `s_k = D'_k⁻¹ y_k − G_k s_{k+1}`. The kernel supplies the load `l` and the use of the
//! solution `s`, level by level.
//!
//! The twin solves as many columns at once as a register ([`crate::math::wide`]) holds; for it the factors of a part's nodes at one level
//! are stored by component ([`by_component`]), where the shader has them by node. One column at a time took four times as long.
//! Units: r l y N, s m.

use super::PART;
use crate::math::wide::{Lanes, OneByOne, Task};
use crate::math::{Real, V4};

/// Text of the shaders.
pub const WGSL: &str = include_str!("columns.wgsl");

/// Numbers of a node's factors: 6 of `D'⁻¹`, 9 of `G` by columns, one pad ([`super::blocks::pack`]).
const NUMBERS: usize = 16;

/// Values at a part's nodes of one level, by component.
pub type Components<R> = [[R; PART]; 3];

/// Re-arranges the factors of a part's nodes at one level, `[node × 4]` packed, in place: `[number][node]`.
pub fn by_component<R: Real>(packed: &mut [V4<R>]) {
    let mut moved = [R::zero(); NUMBERS * PART];
    let width = packed.len() / 4;
    for (node, numbers) in packed.as_flattened().as_chunks::<NUMBERS>().0.iter().enumerate() {
        for (n, value) in numbers.iter().enumerate() {
            moved[n * width + node] = *value;
        }
    }
    packed.as_flattened_mut().copy_from_slice(&moved[..NUMBERS * width]);
}

/// What a kernel does at the nodes of a part at one level; mark both `#[inline(always)]` ([`crate::math::wide`]).
pub trait Ends<R> {
    /// The load, from what is in `y`, N.
    fn load(&mut self, level: usize, y: &[V4<R>], load: &mut Components<R>);
    /// Uses the solution, m, and sets `y`.
    fn take(&mut self, level: usize, y: &mut [V4<R>], solution: &Components<R>);
}

/// Values of the nodes of a part by component: all components of a node in turn, so that lanes load whole nodes and sort them.
#[inline(always)]
pub fn from_nodes<R: Real>(count: usize, of: impl Fn(usize, usize) -> R, to: &mut Components<R>) {
    let [x, y, z] = to;
    let count = count.min(PART);
    for c in 0..count {
        x[c] = of(c, 0);
        y[c] = of(c, 1);
        z[c] = of(c, 2);
    }
}

/// Solves the columns of one part ([`super::by_columns`]): takes the loads from the bottom up, gives the solutions from the top down.
pub fn solve_columns<R: Real>(
    columns: usize,         // of all parts
    part: usize,            // its number
    block: &[V4<R>],        // [node × 4] D'⁻¹, G by component
    y: &mut [&mut [V4<R>]], // [level][column of the part] N
    ends: impl Ends<R>,
) {
    R::widest(Solve { columns, part, block, y, ends });
}

struct Solve<'a, 'b, R, E> {
    columns: usize,
    part: usize,
    block: &'a [V4<R>],
    y: &'a mut [&'b mut [V4<R>]],
    ends: E,
}

impl<R: Real, E: Ends<R>> Task<R> for Solve<'_, '_, R, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) {
        let Solve { columns, part, block, y, mut ends } = self;
        let width = y.first().map_or(0, |level| level.len());
        let whole = width - width % L::COUNT;
        let mut load = [[R::zero(); PART]; 3];
        // forward substitution, bottom to top
        let mut carried = [[R::zero(); PART]; 3]; // G_{k−1}ᵀ y_{k−1}
        for (k, y) in y.iter_mut().enumerate() {
            ends.load(k, y, &mut load);
            let factors = block[4 * (part * PART + k * columns)..][..4 * width].as_flattened();
            let y = y.as_flattened_mut();
            for at in (0..whole).step_by(L::COUNT) {
                forward(lanes, factors, [width, at], &load, &mut carried, y);
            }
            for at in whole..width {
                forward(OneByOne, factors, [width, at], &load, &mut carried, y);
            }
        }
        // backward substitution, top to bottom
        let mut solution = [[R::zero(); PART]; 3];
        for (k, y) in y.iter_mut().enumerate().rev() {
            let factors = block[4 * (part * PART + k * columns)..][..4 * width].as_flattened();
            for at in (0..whole).step_by(L::COUNT) {
                backward(lanes, factors, [width, at], y.as_flattened(), &mut solution);
            }
            for at in whole..width {
                backward(OneByOne, factors, [width, at], y.as_flattened(), &mut solution);
            }
            ends.take(k, y, &solution);
        }
    }
}

/// `y = load − carried`, `carried = Gᵀ y` for the columns of a register.
#[inline(always)]
fn forward<R: Real, L: Lanes<R>>(
    lanes: L,
    factors: &[R],
    [width, at]: [usize; 2],
    load: &Components<R>,
    carried: &mut Components<R>,
    y: &mut [R],
) {
    let mut own = [lanes.splat(R::zero()); 3];
    for n in 0..3 {
        own[n] = lanes.sub(lanes.load(&load[n][at..]), lanes.load(&carried[n][at..]));
        lanes.store(own[n], &mut y[n * width + at..]);
    }
    for column in 0..3 {
        let mut g = own;
        for n in 0..3 {
            g[n] = lanes.load(&factors[(6 + 3 * column + n) * width + at..]);
        }
        lanes.store(dot(lanes, g, own), &mut carried[column][at..]);
    }
}

/// `solution = D'⁻¹ y − G solution` for the columns of a register.
#[inline(always)]
fn backward<R: Real, L: Lanes<R>>(
    lanes: L,
    factors: &[R],
    [width, at]: [usize; 2],
    y: &[R],
    solution: &mut Components<R>,
) {
    let [mut own, mut above] = [[lanes.splat(R::zero()); 3]; 2];
    for n in 0..3 {
        own[n] = lanes.load(&y[n * width + at..]);
        above[n] = lanes.load(&solution[n][at..]);
    }
    for row in 0..3 {
        let [mut d, mut g] = [own; 2];
        for n in 0..3 {
            d[n] = lanes.load(&factors[SYMMETRIC[row][n] * width + at..]);
            g[n] = lanes.load(&factors[(6 + 3 * n + row) * width + at..]);
        }
        lanes.store(lanes.sub(dot(lanes, d, own), dot(lanes, g, above)), &mut solution[row][at..]);
    }
}

/// Numbers of the rows of `D'⁻¹`.
const SYMMETRIC: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

#[inline(always)]
fn dot<R: Real, L: Lanes<R>>(lanes: L, a: [L::V; 3], b: [L::V; 3]) -> L::V {
    lanes.mul_add(a[2], b[2], lanes.mul_add(a[1], b[1], lanes.mul(a[0], b[0])))
}
