//! Vectors at the corners of many boxes at once: their sums in the eight sign patterns, and rotations by quaternions.
//!
//! The sums are a Walsh–Hadamard transform of length 8, `a_p = Σ_c (−1)^(bits of p ∧ c) a_c`; applied twice it gives `8 a`. A register
//! holds the same component of as many boxes as it has lanes ([`super::wide`]).

use super::Real;
use super::wide::Lanes;

/// `a·b`
#[inline(always)]
pub fn dot<R: Real, L: Lanes<R>>(l: L, a: [L::V; 3], b: [L::V; 3]) -> L::V {
    l.mul_add(a[2], b[2], l.mul_add(a[1], b[1], l.mul(a[0], b[0])))
}

/// Sums over the corners with the eight sign patterns; corner and pattern numbers are bits x + 2y + 4z.
#[inline(always)]
pub fn patterns<R: Real, L: Lanes<R>>(l: L, mut a: [[L::V; 3]; 8]) -> [[L::V; 3]; 8] {
    for bit in [1, 2, 4] {
        for low in 0..8 {
            if low & bit == 0 {
                for n in 0..3 {
                    let (p, q) = (a[low][n], a[low | bit][n]);
                    a[low][n] = l.add(p, q);
                    a[low | bit][n] = l.sub(p, q);
                }
            }
        }
    }
    a
}

/// Rows of `|q|² R(q)`: zero for a removed cell.
#[inline(always)]
pub fn rotation_rows<R: Real, L: Lanes<R>>(l: L, [x, y, z, w]: [L::V; 4]) -> [[L::V; 3]; 3] {
    let (x2, y2, z2) = (l.add(x, x), l.add(y, y), l.add(z, z));
    let (xx, yy, zz, ww) = (l.mul(x, x), l.mul(y, y), l.mul(z, z), l.mul(w, w));
    let (xy, xz, yz) = (l.mul(x2, y), l.mul(x2, z), l.mul(y2, z));
    let (wx, wy, wz) = (l.mul(w, x2), l.mul(w, y2), l.mul(w, z2));
    let (low, across) = (l.sub(ww, zz), l.sub(xx, yy));
    [
        [l.add(low, across), l.sub(xy, wz), l.add(xz, wy)],
        [l.add(xy, wz), l.sub(low, across), l.sub(yz, wx)],
        [l.sub(xz, wy), l.add(yz, wx), l.sub(l.add(ww, zz), l.add(xx, yy))],
    ]
}

/// Rows of `R(q) − I` for a unit quaternion, without cancellation at small angles; `r` are the rows of `R`.
#[inline(always)]
pub fn rotation_minus_one<R: Real, L: Lanes<R>>(
    l: L,
    [x, y, z, _]: [L::V; 4],
    mut r: [[L::V; 3]; 3],
) -> [[L::V; 3]; 3] {
    let minus_two = l.splat(R::of(-2.0));
    for (n, [a, b]) in [[y, z], [x, z], [x, y]].into_iter().enumerate() {
        r[n][n] = l.mul(minus_two, l.mul_add(a, a, l.mul(b, b)));
    }
    r
}
