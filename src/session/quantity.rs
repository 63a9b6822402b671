//! Quantities over cells, for colours on the surface.

use crate::backend::Snapshot;
use crate::math::{M3, V3};
use crate::report::frames::SkinSurface;
use crate::report::slice::Slice;
use crate::scene::Component;
use crate::step::{Body, Simulation};
use crate::view::Clip;

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
        let of_stress = |of: fn(M3<f64>) -> f64| {
            let all = model.mechanics().strains_and_stresses(model, wound, &state.u);
            all.into_iter().map(|[_, stress]| of(stress)).collect()
        };
        match self {
            Self::VonMises => of_stress(|stress| Component::VonMises.of(stress.0.map(V3::f64))),
            Self::Pressure => of_stress(|stress| -stress.trace() / 3.0),
            Self::Alive => body.alive_shares(),
            Self::Stiffness => body.stiffness_factors(),
        }
    }

    /// Values on the surface, and on a slice.
    fn read(self, surface: &SkinSurface, slice: Option<&Slice>, simulation: &Simulation, state: &[Snapshot]) -> Values {
        let bodies = simulation.bodies.iter().zip(state);
        let of_cells: Vec<Vec<f64>> = bodies.map(|(body, state)| self.of_cells(body, state)).collect();
        let of_slice = slice.map_or(vec![], |slice| {
            let cells = slice.layers.iter().zip(&slice.cells);
            cells.map(|([body, _], cell)| of_cells[*body as usize][*cell as usize]).collect()
        });
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
        let nodes = sums.into_iter().map(|[sum, count]| if count > 0.0 { sum / count } else { 0.0 }).collect();
        Values { of: self, nodes, slice: of_slice }
    }
}

/// Values of a quantity.
#[derive(Clone, Debug)]
pub struct Values {
    /// The quantity.
    pub of: Quantity,
    /// `[node]` means over the cells behind the faces around it; 0 off the surface.
    pub nodes: Vec<f64>,
    /// `[triangle]` of the slice.
    pub slice: Vec<f64>,
}

/// What is read for pictures beside the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// A quantity.
    pub quantity: Option<Quantity>,
    /// A plane that the bodies are cut open at.
    pub plane: Option<Clip>,
}

/// What was asked for.
#[derive(Debug, Default)]
pub struct Read {
    /// The quantity.
    pub values: Option<Values>,
    /// What the plane lays open.
    pub slice: Option<Slice>,
}

impl Asked {
    /// Reads it.
    pub fn read(&self, surface: &SkinSurface, simulation: &Simulation, state: &[Snapshot]) -> Read {
        let slice = self.plane.map(|plane| Slice::new(simulation, surface, plane));
        let values = self.quantity.map(|quantity| quantity.read(surface, slice.as_ref(), simulation, state));
        Read { values, slice }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Inclusion, Region, Scene, read};
    use crate::step::Platform;
    use std::path::Path;

    /// Quantities on the surface after a step, without the nodes off it, and on a slice.
    fn seen(scene: &Scene) -> [Vec<f64>; 4] {
        let mut simulation = Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        simulation.step(false).unwrap_or_else(|e| panic!("{e}"));
        let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}"));
        let surface = SkinSurface::new(&simulation, &state);
        let plane = Some(Clip { normal: [0.0, 1.0, 0.2], offset: 0.3e-3 });
        let on: std::collections::BTreeSet<u32> = surface.skin.triangles.iter().flatten().copied().collect();
        Quantity::ALL.map(|quantity| {
            let asked = Asked { quantity: Some(quantity), plane };
            let Read { values, slice } = asked.read(&surface, &simulation, &state);
            let Values { of, nodes, slice: inside } = values.expect("it was asked for");
            assert!(of == quantity && inside.len() == slice.expect("a slice").triangles.len() && !inside.is_empty());
            on.iter().map(|node| nodes[*node as usize]).chain(inside).collect()
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
