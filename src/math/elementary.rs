//! Elementary functions that give the same bits on every machine.
//!
//! `+ − × ÷`, the square root, rounding to whole numbers and a fused product-sum are exact by IEEE 754. All else comes from the system's C
//! library where `std` is asked, and that differs between systems and, where the library picks its code by processor, between machines of
//! one system. So these come from the crate `libm`, which uses exact operations alone; glam and parry3d are built to use it too. What
//! only pictures and plots see may use `std`.

pub use libm::{
    acos, atan, atan2, cbrt, cos, exp, expf as exp_f32, fma, fmaf as fma_f32, hypot, log as ln, logf as ln_f32, sin,
    sincos as sin_cos, tan,
};

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    #[test]
    fn glam_takes_its_functions_from_the_same_place() {
        for k in 0..2000 {
            let angle = 0.003 * f64::from(k);
            let q = DQuat::from_rotation_z(angle);
            let (sin, cos) = super::sin_cos(angle * 0.5);
            assert_eq!((q.z, q.w), (sin, cos), "at {angle}");
            let along = DQuat::from_scaled_axis(DVec3::Z * angle);
            assert!(k == 0 || (along.z, along.w) == (sin, cos), "at {angle}");
        }
    }
}
