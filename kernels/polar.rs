//! Rotation that maximises `tr(Rᵀ F)` for a deformation gradient `F`; text shared by the shaders that find rotations.
//!
//! For `det F > 0` this is the polar factor. It stays defined and continuous through `det F = 0` (the smallest singular value changes its
//! sign) and jumps only where two singular values are equal and opposite. It is found by Newton's method on the rotation,
//! `ω = (tr(S) I − sym S)⁻¹ axl(S)`, `S = RᵀF`. Where that matrix is not positive definite it is
//! shifted until it is; a stationary point that is no maximum is left by a fixed perturbation. The only local maximum is the global one
//! (Horn 1987: a 4×4 eigenvalue problem), so the result does not depend on the start.
//!
//! The twin takes as many gradients at once as a register holds, with the same operations and so the same bits: those whose matrix is
//! positive definite all the way, with steps of less than a radian, as of any tissue that is not inverted. Registers with others are left
//! to [`polar`]. One at a time took 130 ns.
//! Source: Müller, Bender, Chentanez, Macklin 2016 (iterative extraction); differs: Newton instead of a fixed-point step.

use crate::math::wide::{Lanes, MOST, Packed, Task};
use crate::math::{M3, Number, Real, V3, V4, quaternion_product, rotation_matrix};

/// Text shared by the shaders that call it.
pub const WGSL: &str = include_str!("polar.wgsl");

/// No rotation, where a search for one that keeps no state starts.
pub const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Maximum number of Newton steps. Warm starts take 1 to 3; a random start on a random, often inverted gradient up to 60.
const MAX_NEWTON: usize = 64;

/// Rotation quaternion that maximises `tr(Rᵀ f)`, starting at `q`.
pub fn polar<R: Real>(f: M3<R>, start: V4<R>) -> V4<R> {
    let mut q = start;
    for _ in 0..MAX_NEWTON {
        let Slopes { axial, hessian, minor, size, trace } = slopes(f, q);
        let tiny = R::of(1e-6) * size;
        let (hx, hy, hz) = (hessian.0[0].x, hessian.0[1].y, hessian.0[2].z);
        let definite = hx > tiny && minor > tiny * tiny && hessian.determinant() > tiny * tiny * tiny;
        // 1.1 |S| I − sym S is positive definite for any S and gives an ascent direction
        let shift = if definite { R::zero() } else { R::of(1.1) * size + R::of(1e-6) - trace };
        let shifted = hessian + M3::diagonal(V3::splat(shift));
        let mut omega = shifted.inverse() * axial;
        if !definite && axial.dot(axial) < tiny * tiny {
            // a stationary point that is no maximum: rotate about the axis of most negative curvature
            omega = if hx <= hy && hx <= hz {
                V3::new(R::of(0.5), R::zero(), R::zero())
            } else if hy <= hz {
                V3::new(R::zero(), R::of(0.5), R::zero())
            } else {
                V3::new(R::zero(), R::zero(), R::of(0.5))
            };
        }
        // step of at most one radian, applied to the quaternion
        let squared = omega.dot(omega);
        if squared > R::one() {
            omega = omega * (R::one() / squared.sqrt());
        }
        q = turned(q, omega);
        if squared < R::EPSILON {
            break;
        }
    }
    q
}

/// Slopes of `tr(Rᵀ f)`, `S = Rᵀ f`, with respect to the rotation vector.
struct Slopes<N> {
    /// Gradient.
    axial: V3<N>,
    /// Negative Hessian.
    hessian: M3<N>,
    /// Its second leading minor.
    minor: N,
    /// `|S|`
    size: N,
    /// `tr S`
    trace: N,
}

#[inline(always)]
fn slopes<N: Number>(f: M3<N>, q: V4<N>) -> Slopes<N> {
    let s = rotation_matrix(q).transpose() * f;
    let [a, b, c] = s.0;
    let axial = V3::new(b.z - c.y, c.x - a.z, a.y - b.x);
    let (trace, half) = (s.trace(), q[3].like(-0.5));
    let (xy, xz, yz) = (half * (a.y + b.x), half * (a.z + c.x), half * (b.z + c.y));
    let hessian = M3([V3::new(trace - a.x, xy, xz), V3::new(xy, trace - b.y, yz), V3::new(xz, yz, trace - c.z)]);
    let minor = hessian.0[0].x * hessian.0[1].y - xy * xy;
    Slopes { axial, hessian, minor, size: (a.dot(a) + b.dot(b) + c.dot(c)).sqrt(), trace }
}

/// A quaternion after a small rotation, of length 1.
#[inline(always)]
fn turned<N: Number>(q: V4<N>, omega: V3<N>) -> V4<N> {
    let one = q[3].like(1.0);
    let [x, y, z, w] = quaternion_product(q, (omega * one.like(0.5)).pad(one));
    let scale = one / (x * x + y * y + z * z + w * w).sqrt();
    [x * scale, y * scale, z * scale, w * scale]
}

/// [`polar`] of many gradients, each from its quaternion, which it replaces; zero quaternions, of removed cells, stay.
pub fn polars<R: Real>(gradients: &[M3<R>], rotation: &mut [V4<R>]) {
    R::widest(Polars { gradients, rotation });
}

struct Polars<'a, R> {
    gradients: &'a [M3<R>],
    rotation: &'a mut [V4<R>],
}

impl<R: Real> Task<R> for Polars<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<R>>(self, lanes: L) {
        for (f, q) in self.gradients.chunks(L::COUNT).zip(self.rotation.chunks_mut(L::COUNT)) {
            // by component; lanes without a gradient repeat the last one
            let (mut parts, mut quaternions) = ([[[R::zero(); MOST]; 3]; 3], [[R::zero(); MOST]; 4]);
            for i in 0..L::COUNT {
                let (f, q) = (&f[i.min(f.len() - 1)], &q[i.min(q.len() - 1)]);
                for c in 0..3 {
                    (parts[c][0][i], parts[c][1][i], parts[c][2][i]) = (f.0[c].x, f.0[c].y, f.0[c].z);
                }
                for n in 0..4 {
                    quaternions[n][i] = q[n];
                }
            }
            let load = |part: &[R; MOST]| Packed::load(lanes, part);
            let column = |[x, y, z]: &[[R; MOST]; 3]| V3::new(load(x), load(y), load(z));
            let gradient = M3([column(&parts[0]), column(&parts[1]), column(&parts[2])]);
            let start = [load(&quaternions[0]), load(&quaternions[1]), load(&quaternions[2]), load(&quaternions[3])];
            match plain(gradient, start, R::EPSILON.f64()) {
                Some(found) => {
                    for n in 0..4 {
                        found[n].store(&mut quaternions[n]);
                    }
                    for (i, q) in q.iter_mut().enumerate() {
                        *q = [quaternions[0][i], quaternions[1][i], quaternions[2][i], quaternions[3][i]];
                    }
                }
                None => {
                    for (f, q) in f.iter().zip(q).filter(|(_, q)| **q != [R::zero(); 4]) {
                        *q = polar(*f, *q);
                    }
                }
            }
        }
    }
}

/// [`polar`] in all lanes, where none needs a shift or a shorter step; `None` otherwise.
#[inline(always)]
fn plain<N: Number>(f: M3<N>, start: V4<N>, epsilon: f64) -> Option<V4<N>> {
    let constant = |value: f64| start[3].like(value);
    let (zero, one, half) = (constant(0.0), constant(1.0), constant(0.5));
    let (mut q, mut moving) = (start, one);
    for _ in 0..MAX_NEWTON {
        let Slopes { axial, hessian, minor, size, .. } = slopes(f, q);
        // definite by more than `polar` asks for
        let bound = constant(2e-6) * size;
        let is_definite = size.all_at_least(constant(1e-6))
            && hessian.0[0].x.all_at_least(bound)
            && minor.all_at_least(bound * bound)
            && hessian.determinant().all_at_least(bound * bound * bound);
        if !is_definite {
            return None;
        }
        let shifted = hessian + M3::diagonal(V3::splat(zero));
        let cofactors = shifted.cofactors();
        let inverse = (cofactors * (one / shifted.0[0].dot(cofactors.0[0]))).transpose();
        let omega = inverse * axial;
        let squared = omega.dot(omega);
        if !one.all_at_least(squared) {
            return None;
        }
        // lanes that have converged stay
        let next = turned(q, omega);
        for n in 0..4 {
            q[n] = moving.pick(half, next[n], q[n]);
        }
        moving = squared.pick(constant(epsilon), moving, zero);
        if zero.all_at_least(moving) {
            break;
        }
    }
    Some(q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::wide::{Arrays, OneByOne};

    /// Gradients near rotations, some inverted or far, and their starts; the first cell is removed.
    fn of_cells<R: Real>() -> (Vec<M3<R>>, Vec<V4<R>>) {
        let mut generator = crate::math::random::Random::new(11);
        let mut random = |size: f64| R::of(size * generator.signed());
        let gradients = (0..203).map(|k| {
            let size = if k % 40 == 7 { 2.0 } else { 0.3 };
            M3::identity() + M3([0; 3].map(|_| V3::new(random(size), random(size), random(size))))
        });
        let gradients = gradients.collect();
        let mut starts: Vec<V4<R>> = (0..203).map(|_| [random(0.1), random(0.1), random(0.1), R::one()]).collect();
        starts.iter_mut().for_each(|q| {
            let size = q.iter().fold(R::zero(), |sum, c| sum + *c * *c).sqrt();
            *q = q.map(|c| c / size);
        });
        starts[0] = [R::zero(); 4];
        (gradients, starts)
    }

    fn many_at_once<R: Real>() {
        let (gradients, starts) = of_cells::<R>();
        let one = |(f, q): (&M3<R>, &V4<R>)| if *q == [R::zero(); 4] { *q } else { polar(*f, *q) };
        let wanted: Vec<V4<R>> = gradients.iter().zip(&starts).map(one).collect();
        let by = |run: &dyn Fn(Polars<R>)| {
            let mut rotation = starts.clone();
            run(Polars { gradients: &gradients, rotation: &mut rotation });
            rotation
        };
        assert_eq!(by(&|task| R::widest(task)), wanted);
        assert_eq!(by(&|task| task.run(OneByOne)), wanted);
        assert_eq!(by(&|task| task.run(Arrays::<4>)), wanted);
        assert_eq!(by(&|task| task.run(Arrays::<16>)), wanted);
        // most groups take the short way
        let short = gradients.chunks(1).zip(&starts[..]).filter(|(f, q)| plain(f[0], **q, R::EPSILON.f64()).is_some());
        assert!((150..203).contains(&short.count()));
    }

    #[test]
    fn many_at_once_have_the_same_bits_as_one_by_one() {
        many_at_once::<f32>();
        many_at_once::<f64>();
    }

    fn residual(f: M3<f64>, q: V4<f64>) -> f64 {
        let s = rotation_matrix(q).transpose() * f;
        let d = s - s.transpose();
        d.0.iter().map(|c| c.length()).fold(0.0, f64::max)
    }

    #[test]
    fn any_start_finds_the_same_maximum() {
        let mut generator = crate::math::random::Random::new(7);
        let mut random = || generator.signed();
        for case in 0..500 {
            let f = M3([0; 3].map(|_| V3::new(random(), random(), random())));
            let mut traces = vec![];
            for _ in 0..4 {
                let q = [random(), random(), random(), random()];
                let n = q.iter().map(|c| c * c).sum::<f64>().sqrt();
                let r = polar(f, q.map(|c| c / n));
                assert!(residual(f, r) < 1e-6, "case {case}: {}", residual(f, r));
                traces.push((rotation_matrix(r).transpose() * f).trace());
            }
            let spread = traces.iter().fold(0.0f64, |m, t| m.max((t - traces[0]).abs()));
            assert!(spread < 1e-9, "case {case}: {traces:?}");
        }
    }

    #[test]
    fn half_turns_and_inversions_have_a_rotation() {
        let half_turn = M3::diagonal(V3::new(-1.0, -1.0, 1.0));
        let q: V4<f64> = polar(half_turn, [0.0, 0.0, 0.0, 1.0]);
        assert!((q[2].abs() - 1.0).abs() < 1e-12);
        let inverted = M3::diagonal(V3::new(1.0, 1.0, -0.3));
        let q: V4<f64> = polar(inverted, [0.0, 0.0, 0.0, 1.0]);
        assert!((q[3].abs() - 1.0).abs() < 1e-12, "{q:?}");
        for f in [M3::zero(), M3::diagonal(V3::new(1.0, 0.0, 0.0))] {
            let q = polar::<f32>(M3(f.0.map(|c: V3<f64>| V3::of(c.f64()))), [0.0, 0.0, 0.0, 1.0]);
            assert!(q.iter().all(|c| c.is_finite()));
        }
    }
}
