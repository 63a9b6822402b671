//! Hyperelastic law of a body of tetrahedra on the CPU path: energy, forces and linearisation ([`crate::kernels::tetrahedra_laws`]).
//!
//! Steps are one linear solve each, with the forces of the law itself and its linearisation, as those of hexahedra are; there is no Newton's
//! method for them. Error of the skin block's centre displacement on 20×20×5 cells against the converged one, neo-Hookean, smoothed
//! (tests/verify/tetrahedra.rs), %: +6.7 and +4.4 under 10 kPa at ν 0.45 and 0.49, +7.3 and +3.6 under 50 kPa.

use super::operator::{Arrays, For, Rotations, Tetrahedron};
use crate::kernels::deformation::{Point, log_volume};
use crate::kernels::hyperelastic::STIFFENED;
use crate::kernels::{
    Params, tetrahedra, tetrahedra_changes, tetrahedra_deformations, tetrahedra_frames, tetrahedra_large,
    tetrahedra_laws, tetrahedra_means, tetrahedra_pressed, tetrahedra_pressures,
};
use crate::math::{Real, V4};

impl Arrays<f64> {
    /// Arrays of a mesh with a hyperelastic law: `laws` `[layer]` κ, two constants, Pa, and the law's code.
    pub fn hyperelastic(rest: &[[f64; 3]], tetrahedra: &[Tetrahedron], laws: &[V4<f64>], smoothed: bool) -> Self {
        let moduli: Vec<[f64; 2]> = laws.iter().map(|law| [law[0], tetrahedra_laws::material(*law).shear()]).collect();
        let mut out = Self::new(rest, tetrahedra, &moduli, smoothed);
        out.laws = laws.to_vec();
        if smoothed {
            // domains are of one layer each, that of any of their tetrahedra
            for (e, (_, layer)) in tetrahedra.iter().enumerate() {
                out.domains[6 * e..6 * e + 6].iter().for_each(|k| out.shear[*k as usize][1] = *layer as f64);
            }
            return out;
        }
        let count = tetrahedra.len() as u32;
        let volumes: Vec<f64> = (0..tetrahedra.len()).map(|e| out.volume(e)).collect();
        out.shear = volumes.iter().zip(tetrahedra).map(|(volume, (_, layer))| [*volume, *layer as f64]).collect();
        out.patches.per_volume = volumes.iter().map(|volume| volume.recip()).collect();
        out.domains = (0..count).flat_map(|e| [e; 6]).collect();
        out.first_of_domain = (0..=count).collect();
        out.of_domain = (0..count).map(|e| 4 * e).collect();
        (out.patches.first, out.patches.members) = (out.first_of_domain.clone(), out.of_domain.clone());
        out.patches.corners = (0..count).map(|e| [e; 4]).collect();
        out
    }

    /// Elastic energy of a hyperelastic law, J.
    pub(super) fn energy_of_law(&self, u: &[V4<f64>]) -> f64 {
        let mut strain = vec![[0.0; 4]; self.gradients.len()];
        let mut cofactor = strain.clone();
        tetrahedra_deformations::tetrahedra_deformations(&self.corners, &self.gradients, u, &mut strain, &mut cofactor);
        let (patches, ..) = self.patches();
        let mut mean = vec![0.0; self.patch_count()];
        self.volumes(&strain, &mut mean);
        let of_volume = |(e, patches): (usize, &[u32; 4])| {
            let log = log_volume(0.25 * patches.iter().map(|n| mean[*n as usize]).sum::<f64>())[0];
            0.5 * self.gradients[3 * e + 1][3] * self.volume(e) * log * log
        };
        let share = if self.smoothed { 1.0 / 6.0 } else { 1.0 };
        let of_domain = |(k, [volume, layer]): (usize, &[f64; 2])| {
            let members = &self.of_domain[self.first_of_domain[k] as usize..self.first_of_domain[k + 1] as usize];
            let (gradient, _) = tetrahedra::mean(&self.gradients, members, &strain, 1.0 / *volume);
            share * volume * tetrahedra_laws::material(self.laws[*layer as usize]).energy(&Point::new(gradient))
        };
        patches.iter().enumerate().map(of_volume).sum::<f64>()
            + self.shear.iter().enumerate().map(of_domain).sum::<f64>()
    }
}

impl<R: Real> Arrays<R> {
    /// Whether its law is hyperelastic.
    pub fn is_hyperelastic(&self) -> bool {
        !self.laws.is_empty()
    }

    /// Linearisation of a hyperelastic law at displacements.
    pub fn linearised(&self, u: &[V4<R>], purpose: For<R>) -> Rotations<R> {
        let mut out = self.unlinearised();
        self.forces_of_law(u, purpose, &mut out, &mut self.scratch());
        out
    }

    /// Room for one.
    pub fn unlinearised(&self) -> Rotations<R> {
        let zeros = |count: usize| vec![[R::zero(); 4]; count];
        let (cofactor, frame, domain) = (zeros(self.gradients.len()), zeros(self.shear.len()), zeros(self.shear.len()));
        Rotations { element: vec![], domain, cofactor, frame }
    }

    /// `[tetrahedron × 3]` forces of a hyperelastic law at corners 1 to 3, N, in `scratch`, and its linearisation.
    pub fn forces_of_law<'a>(
        &self,
        u: &[V4<R>],
        purpose: For<R>,
        out: &mut Rotations<R>,
        scratch: &'a mut [R],
    ) -> &'a mut [V4<R>] {
        let params = match purpose {
            For::Steps(stiffness_factor) => Params { corotational: STIFFENED, stiffness_factor, ..Params::default() },
            For::Damping => Params::default(),
        };
        let Self { corners, gradients, first_of_domain, of_domain, shear, laws, domains, .. } = self;
        let Rotations { domain, cofactor, frame, .. } = out;
        let [of_elements, stress, mean, pressure] = self.divided(scratch);
        let (of_elements, stress) = (of_elements.as_chunks_mut().0, stress.as_chunks_mut().0);
        let (patches, ..) = self.patches();
        tetrahedra_deformations::tetrahedra_deformations(corners, gradients, u, of_elements, cofactor);
        tetrahedra_means::tetrahedra_means(gradients, first_of_domain, of_domain, of_elements, domain);
        self.volumes(of_elements, mean);
        tetrahedra_pressed::tetrahedra_pressed(patches, gradients, mean, of_elements, cofactor);
        self.volumes(of_elements, pressure);
        tetrahedra_laws::tetrahedra_laws(
            &params,
            gradients,
            first_of_domain,
            of_domain,
            shear,
            laws,
            of_elements,
            domain,
            stress,
            frame,
        );
        tetrahedra_large::tetrahedra_large(patches, gradients, cofactor, domains, stress, pressure, of_elements);
        of_elements
    }

    /// `[tetrahedron × 3]` forces of its linearisation.
    pub(super) fn changes_of_law<'a>(
        &self,
        z: &[V4<R>],
        rotations: &Rotations<R>,
        scratch: &'a mut [R],
    ) -> &'a mut [V4<R>] {
        let Self { corners, gradients, first_of_domain, of_domain, domains, .. } = self;
        let Rotations { domain, cofactor, frame, .. } = rotations;
        let [of_elements, stress, mean, pressure] = self.divided(scratch);
        let (of_elements, stress) = (of_elements.as_chunks_mut().0, stress.as_chunks_mut().0);
        let (patches, first, members, per_volume) = self.patches();
        tetrahedra_changes::tetrahedra_changes(corners, gradients, cofactor, z, of_elements);
        tetrahedra_frames::tetrahedra_frames(gradients, first_of_domain, of_domain, domain, frame, of_elements, stress);
        self.volumes(of_elements, mean);
        // the stiffness of the volume stands where the bulk modulus does in `gradients`
        tetrahedra_pressures::tetrahedra_pressures(patches, cofactor, first, members, per_volume, mean, pressure);
        tetrahedra_large::tetrahedra_large(patches, gradients, cofactor, domains, stress, pressure, of_elements);
        of_elements
    }
}
