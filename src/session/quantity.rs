//! Quantities over cells, for colours on the surface.

use crate::backend::Snapshot;
use crate::math::{M3, V3};
use crate::report::frames::SkinSurface;
use crate::scene::Component;
use crate::step::{Body, Simulation};

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Von Mises' invariant of the Cauchy stress.
    VonMises,
    /// Minus a third of the trace of the Cauchy stress.
    Pressure,
    /// Share of a cell's links or springs that are intact.
    Alive,
    /// Factor on the stiffness of the layer, by inclusions.
    Stiffness,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::VonMises, Self::Pressure, Self::Alive, Self::Stiffness];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::VonMises => "von Mises",
            Self::Pressure => "pressure",
            Self::Alive => "links left",
            Self::Stiffness => "stiffness",
        }
    }

    /// Unit in a picture, and its factor.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::VonMises | Self::Pressure => ("kPa", 1e-3),
            Self::Alive => ("share", 1.0),
            Self::Stiffness => ("× that of the layer", 1.0),
        }
    }

    /// `[cell]` of a body; 0 for cells that are gone.
    fn of_cells(self, body: &Body, state: &Snapshot) -> Vec<f64> {
        let (model, wound) = (&body.model, &body.wound);
        let mechanics = model.mechanics();
        let of_stress = |of: fn(M3<f64>) -> f64| {
            mechanics.strains_and_stresses(model, wound, &state.u).into_iter().map(|[_, stress]| of(stress)).collect()
        };
        let of_cell = |of: &dyn Fn(usize) -> f64| {
            let cells = wound.surface.alive.iter().enumerate();
            let whole = model.unstructured().map_or(0, |of| of.mesh.tetrahedra().len());
            // tetrahedra of a mesh are not cut and have no inclusions
            let whole = std::iter::repeat_n(1.0, whole);
            cells.map(|(cell, here)| if *here { of(cell) } else { 0.0 }).chain(whole).collect()
        };
        match self {
            Self::VonMises => of_stress(|stress| Component::VonMises.of(stress.0.map(V3::f64))),
            Self::Pressure => of_stress(|stress| -stress.trace() / 3.0),
            Self::Alive => of_cell(&|cell| mechanics.alive_share(model, wound, cell)),
            Self::Stiffness => of_cell(&|cell| mechanics.stiffness_factor(cell)),
        }
    }

    /// `[node]` means over the cells behind the faces around it; 0 off the surface.
    pub fn on_nodes(self, surface: &SkinSurface, simulation: &Simulation, state: &[Snapshot]) -> Vec<f64> {
        let bodies = simulation.bodies.iter().zip(state);
        let of_cells: Vec<Vec<f64>> = bodies.map(|(body, state)| self.of_cells(body, state)).collect();
        let mut sums = vec![[0.0, 0.0]; surface.positions.len()];
        for faces in [&surface.skin, &surface.walls] {
            for ((triangle, [body, _]), cell) in faces.triangles.iter().zip(&faces.layers).zip(&faces.cells) {
                for node in triangle {
                    let [sum, count] = &mut sums[*node as usize];
                    *sum += of_cells[*body as usize][*cell as usize];
                    *count += 1.0;
                }
            }
        }
        sums.into_iter().map(|[sum, count]| if count > 0.0 { sum / count } else { 0.0 }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Inclusion, Region, Scene, read};
    use crate::step::Platform;
    use std::path::Path;

    /// Quantities on the surface after a step, without the nodes off it.
    fn seen(scene: &Scene) -> [Vec<f64>; 4] {
        let mut simulation = Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}"));
        let surface = SkinSurface::new(&simulation, &state);
        let on: std::collections::BTreeSet<u32> = surface.skin.triangles.iter().flatten().copied().collect();
        Quantity::ALL.map(|quantity| {
            let all = quantity.on_nodes(&surface, &simulation, &state);
            on.iter().map(|node| all[*node as usize]).collect()
        })
    }

    #[test]
    fn a_stretched_block_is_of_one_colour_and_an_inclusion_of_another() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/patch.toml");
        let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        // nominal stress, Pa, times the stretch of 1.1 over the volume ratio; free across
        let [von_mises, pressure, alive, stiffness] = seen(&scene);
        let (mean, third) = (von_mises[0], von_mises[0] / 3.0);
        assert!((9170.0..1.3 * 9170.0).contains(&mean), "{mean} Pa");
        assert!(von_mises.iter().all(|v| (v / mean - 1.0).abs() < 1e-4), "{von_mises:?}");
        assert!(pressure.iter().all(|v| (v / third + 1.0).abs() < 1e-4), "{pressure:?}");
        assert!(alive.iter().chain(&stiffness).all(|v| *v == 1.0));
        // the upper half is harder
        let region = Region::Box { min: [-1.0, -1.0, 2e-3], max: [1.0; 3] };
        scene.inclusions.push(Inclusion { body: 0, region, young: 300e3 });
        let [von_mises, _, _, stiffness] = seen(&scene);
        let (low, high) = stiffness.iter().fold((f64::MAX, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low == 1.0 && (high - 3.0).abs() < 1e-12, "{low} to {high}");
        assert!(von_mises.iter().any(|v| (v / mean - 1.0).abs() > 0.05), "{von_mises:?}");
    }
}
