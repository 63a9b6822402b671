//! Rotation that maximises `tr(Rᵀ F)` for a deformation gradient `F`; text shared by the shaders that find rotations.
//!
//! For `det F > 0` this is the polar factor. It stays defined and continuous through `det F = 0` (the smallest singular value changes its
//! sign) and jumps only where two singular values are equal and opposite. It is found by Newton's method on the rotation,
//! `ω = (tr(S) I − sym S)⁻¹ axl(S)`, `S = RᵀF`. Where that matrix is not positive definite it is
//! shifted until it is; a stationary point that is no maximum is left by a fixed perturbation. The only local maximum is the global one
//! (Horn 1987: a 4×4 eigenvalue problem), so the result does not depend on the start.
//! Source: Müller, Bender, Chentanez, Macklin 2016 (iterative extraction); differs: Newton instead of a fixed-point step.

use crate::math::{M3, Real, V3, V4, quaternion_product, rotation_matrix};

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
        // gradient and negative Hessian of tr(Rᵀ f) with respect to the rotation vector
        let s = rotation_matrix(q).transpose() * f;
        let [a, b, c] = s.0;
        let axial = V3::new(b.z - c.y, c.x - a.z, a.y - b.x);
        let t = s.trace();
        let half = R::of(-0.5);
        let (xy, xz, yz) = (half * (a.y + b.x), half * (a.z + c.x), half * (b.z + c.y));
        let hessian = M3([V3::new(t - a.x, xy, xz), V3::new(xy, t - b.y, yz), V3::new(xz, yz, t - c.z)]);
        let size = (a.dot(a) + b.dot(b) + c.dot(c)).sqrt();
        let tiny = R::of(1e-6) * size;
        let (hx, hy, hz) = (hessian.0[0].x, hessian.0[1].y, hessian.0[2].z);
        let minor = hx * hy - xy * xy;
        let definite = hx > tiny && minor > tiny * tiny && hessian.determinant() > tiny * tiny * tiny;
        // 1.1 |S| I − sym S is positive definite for any S and gives an ascent direction
        let shift = if definite { R::zero() } else { R::of(1.1) * size + R::of(1e-6) - t };
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
        let turned = quaternion_product(q, (omega * R::of(0.5)).pad(R::one()));
        let [x, y, z, w] = turned;
        let scale = R::one() / (x * x + y * y + z * z + w * w).sqrt();
        q = [x * scale, y * scale, z * scale, w * scale];
        if squared < R::EPSILON {
            break;
        }
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;

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
