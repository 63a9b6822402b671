//! Stress of each domain of hyperelastic tetrahedra, and its linearisation.
//!
//! Energy: `Σ_k V_k W'(F̄_k) + Σ_e V_e κ_e/2 φ(J̄_e)²` with the domains and means of [`super::tetrahedra`]: `F̄_k` over the tetrahedra
//! around an edge in one material, `J_a = Σ V_e J_e / Σ V_e` at nodes over all materials, `J̄_e` the mean of the element's four nodes; `W'`,
//! `κ` and `φ`, which is `ln J` extended below a tenth of the volume at rest, are those of [`super::hyperelastic`]. Plain elements: a domain
//! is a tetrahedron, and `J̄_e = J_e`. Stress of an element, exactly the energy's derivative: `Σ_k ⅙ P'_k + p̄_e cof F_e`, `p̄` the mean of its
//! nodes' `Σ V_e κ φ φ' / Σ V_e`. In smoothed elements the means alone enter the energy, so one that is inverted between others is not pushed
//! open by itself.
//!
//! Passes: `tetrahedra_deformations` → `tetrahedra_means`, `tetrahedra_volumes` → `tetrahedra_pressed` → `tetrahedra_volumes`, which averages
//! pressures, and `tetrahedra_laws` → `tetrahedra_large`; for products `tetrahedra_changes` → `tetrahedra_frames`, `tetrahedra_volumes` →
//! `tetrahedra_pressures` → `tetrahedra_large`. Patches are what volumes are averaged over: nodes, of plain elements the tetrahedra.
//!
//! Linearisation as of hexahedra ([`super::hyperelastic::Cell::linearised`]), positive definite, and at least half of the true tangent, so
//! that steps do not overshoot (tests/verify measures it at ν 0.45): volume along its present gradient, `κ (φ'² + φ φ'') dJ̄²`; in a domain with
//! `A = R_kᵀ dF̄_k`
//!
//! `R (2 μ s sym A + b s tr A I + τ skew A)`, `s = max(1, |∂φ/∂F|² − 2) − p/(2 μ) max(1, |F|/√3)` (the second where it presses),
//! the first with more of Mooney–Rivlin material ([`super::mooney_rivlin::stiffening`]),
//!
//! `b` 0, or `−⅔ μ` of isochoric laws, `τ = ½ (⅔ tr T + √⅔ |dev T|)` of the Biot stress `T` if positive. With the factor `f = 1 + r_K/h` of
//! damping, `1 + (s − 1)/f` and `τ/f`.
//! Source: the means of Nguyen-Thoi 2009 and Bonet, Burton 1998 (see `tetrahedra`) in the energy. Differs: no modified `F`; `W'` keeps its own
//! form.
//! Units: stress Pa.

use super::deformation::{EXTENDED, Point, log_volume_slope};
use super::hyperelastic::{Material, STIFFENED, STIFFEST};
use super::tetrahedra::{FEWEST, mean};
use super::{Params, Source};
use crate::math::{Real, V4, rotation_matrix};
use rayon::prelude::*;

/// The shader.
pub const SOURCE: Source =
    Source { name: "tetrahedra_laws", wgsl: include_str!("tetrahedra_laws.wgsl"), params: Params::<f32>::FIELDS };

/// The law of a layer from its row of constants.
pub fn material<R: Real>(row: V4<R>) -> Material<R> {
    Material::of([R::one(); 4], row, [[R::zero(); 4]; 2], [R::zero(); 4])
}

/// All domains.
pub fn tetrahedra_laws<R: Real>(
    params: &Params<R>,
    gradients: &[V4<R>],         // [tetrahedron × 3] see `tetrahedra`
    first_of_domain: &[u32],     // [domain + 1] into of_domain
    of_domain: &[u32],           // 4 × tetrahedron
    shear: &[[R; 2]],            // [domain] sum of the volumes m³, layer
    laws: &[V4<R>],              // [layer] κ, two constants Pa, the law's code
    strain: &[V4<R>],            // [tetrahedron × 3] displacement gradient, pressure Pa
    domain_rotation: &[V4<R>],   // [domain] quaternion
    domain_stress: &mut [V4<R>], // [domain × 3] Pa, a sixth
    frame: &mut [V4<R>],         // [domain] factors of sym, tr and skew Pa, a sixth; 1/volume 1/m³
) {
    let each = domain_stress.par_chunks_mut(3).zip(frame.par_iter_mut()).with_min_len(FEWEST).enumerate();
    each.for_each(|(k, (stress, frame))| {
        let [zero, one, two, three, sixth] = [0.0, 1.0, 2.0, 3.0, 1.0 / 6.0].map(R::of);
        let members = &of_domain[first_of_domain[k] as usize..first_of_domain[k + 1] as usize];
        let [volume, layer] = shear[k];
        let row = laws[layer.f64() as usize];
        let (gradient, pressure) = mean(gradients, members, strain, one / volume);
        let (point, own) = (Point::new(gradient), material(row));
        let found = own.stress(&point);
        stress.copy_from_slice(&(found * sixth).0.map(|column| column.pad(zero)));
        let f = point.gradient();
        let (mut s, mut tension, shear) = (one, zero, own.shear());
        if params.corotational == STIFFENED {
            let squared = f.dot(f);
            let mut pressed = one.max(point.log_gradient.dot(point.log_gradient) - two);
            if one + point.dilatation < R::of(EXTENDED) {
                pressed = pressed.max((one + log_volume_slope(point.dilatation) * squared.sqrt()) / two);
            }
            let pressed = own.stiffening(&point, pressed);
            let sheared = (-pressure / (two * shear)).max(zero) * (squared.max(three) / three).sqrt();
            s = one + ((pressed + sheared).min(R::of(STIFFEST)) - one) / params.stiffness_factor;
            let whole = found + point.cofactor * pressure;
            let trace = whole.dot(rotation_matrix(domain_rotation[k]));
            let deviator = (whole.dot(whole) - trace * trace / three).max(zero);
            tension = (trace / three + (deviator / R::of(6.0)).sqrt()).max(zero) / params.stiffness_factor;
        }
        *frame = [two * shear * s * sixth, own.of_trace() * shear * s * sixth, tension * sixth, one / volume];
    });
}
