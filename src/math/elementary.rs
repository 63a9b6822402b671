//! Elementary functions that give the same bits on every machine.
//!
//! `+ − × ÷`, the square root, rounding to integers and fused multiply-add are exactly defined by IEEE 754. `std` takes all other functions
//! from the system's C library, which differs between systems and, where it selects code by processor, between machines. These functions
//! come from the crate `libm` instead, which uses exactly defined operations only; glam and parry3d are built with it too. Code for
//! pictures and plots may use `std`.

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
