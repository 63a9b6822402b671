//! Quantities for colours on the surface: over nodes, or over cells.

use crate::backend::Snapshot;
use crate::math::{M3, V3};
use crate::report::frames::SkinSurface;
use crate::report::slice::Slice;
use crate::scene::Component;
use crate::step::{Body, Simulation};
use crate::view::Clip;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// See the module.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Length of the displacement.
    Displacement,
    /// Length of the velocity.
    Velocity,
    /// Von Mises' invariant of the Cauchy stress.
    VonMises,
    /// Minus a third of the trace of the Cauchy stress.
    Pressure,
    /// Force that the last step has left out of balance at a node. The session evaluates it in f64 in each step while it is asked for.
    Residual,
    /// Share of a cell's links or springs that are intact.
    Alive,
    /// Factor on the stiffness of the layer, by inclusions.
    Stiffness,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Displacement,
        Self::Velocity,
        Self::VonMises,
        Self::Pressure,
        Self::Residual,
        Self::Alive,
        Self::Stiffness,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::VonMises => "von Mises",
            Self::Pressure => "pressure",
            Self::Residual => "residual",
            Self::Alive => "links left",
            Self::Stiffness => "stiffness",
        }
    }

    /// Unit in a picture, and its factor.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Displacement => ("mm", 1e3),
            Self::Velocity => ("mm/s", 1e3),
            Self::VonMises | Self::Pressure => ("kPa", 1e-3),
            Self::Residual => ("mN", 1e3),
            Self::Alive => ("share", 1.0),
            Self::Stiffness => ("× that of the layer", 1.0),
        }
    }

    /// Values on the surface, and on a slice; none of a residual that was not evaluated.
    fn read(
        self,
        surface: &SkinSurface,
        slice: Option<&Slice>,
        simulation: &Simulation,
        state: &[Snapshot],
    ) -> Option<Values> {
        let of_nodes = |nodes: Vec<f64>| {
            let slice = slice.map_or(vec![], |slice| slice.of_nodes(&nodes));
            Values { of: self, nodes, slice }
        };
        let of_cells = |of: &dyn Fn(&Body, &Snapshot) -> Vec<f64>| {
            let bodies = simulation.bodies.iter().zip(state);
            let cells: Vec<Vec<f64>> = bodies.map(|(body, state)| of(body, state)).collect();
            Values {
                of: self,
                nodes: means(surface, &cells),
                slice: slice.map_or(vec![], |slice| slice.of_cells(&cells)),
            }
        };
        let lengths = |vectors: &[[f64; 3]]| vectors.iter().map(|v| DVec3::from(*v).length()).collect();
        let of_stress = |of: &dyn Fn(M3<f64>) -> f64| {
            of_cells(&|body, state| {
                let all = body.model.mechanics().strains_and_stresses(&body.model, &body.wound, &state.u);
                all.into_iter().map(|[_, stress]| of(stress)).collect()
            })
        };
        Some(match self {
            Self::Displacement => of_nodes(lengths(&surface.displacements)),
            Self::Velocity => of_nodes(lengths(&surface.velocities)),
            Self::Residual => of_nodes(residuals(simulation)?),
            Self::VonMises => of_stress(&|stress| Component::VonMises.of(stress.0.map(V3::f64))),
            Self::Pressure => of_stress(&|stress| -stress.trace() / 3.0),
            Self::Alive => of_cells(&|body, _| body.alive_shares()),
            Self::Stiffness => of_cells(&|body, _| body.stiffness_factors()),
        })
    }
}

/// `[node]` residuals of the last step, N, those of the points of embedded surfaces between their nodes'; none if it was not checked.
fn residuals(simulation: &Simulation) -> Option<Vec<f64>> {
    let mut out = vec![];
    for body in &simulation.bodies {
        let (own, model) = (&body.residual, &body.model);
        if own.len() != model.node_count() {
            return None;
        }
        out.extend(own);
        let at = |point: usize| body.wound.surface.corner(point).moved(|node| [own[node as usize], 0.0, 0.0])[0];
        out.extend((model.node_count()..model.point_count()).map(at));
    }
    Some(out)
}

/// `[node]` means over the cells behind the faces around it, of `[body][cell]` values; 0 off the surface.
fn means(surface: &SkinSurface, cells: &[Vec<f64>]) -> Vec<f64> {
    let mut sums = vec![[0.0, 0.0]; surface.positions.len()];
    for faces in [&surface.skin, &surface.walls] {
        for ((triangle, [body, _]), cell) in faces.triangles.iter().zip(&faces.layers).zip(&faces.cells) {
            for node in triangle {
                let [sum, count] = &mut sums[*node as usize];
                *sum += cells[*body as usize][*cell as usize];
                *count += 1.0;
            }
        }
    }
    sums.into_iter().map(|[sum, count]| if count > 0.0 { sum / count } else { 0.0 }).collect()
}

/// Values of a quantity.
#[derive(Clone, Debug)]
pub struct Values {
    /// The quantity.
    pub of: Quantity,
    /// `[node]` of the surface; of a quantity over cells the mean over those behind the faces around it.
    pub nodes: Vec<f64>,
    /// `[vertex]` of the slice.
    pub slice: Vec<f64>,
}

impl Values {
    /// The largest one, or 0 where none is positive.
    pub fn high(&self) -> f64 {
        self.nodes.iter().chain(&self.slice).copied().fold(0.0, f64::max)
    }
}

/// What is read for pictures beside the surface.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
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
        let values = self.quantity.and_then(|quantity| quantity.read(surface, slice.as_ref(), simulation, state));
        Read { values, slice }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Inclusion, Region, Scene, read};
    use crate::step::Platform;
    use std::path::Path;

    /// Quantities on the surface after a checked step, without the nodes off it, and on a slice.
    fn seen(scene: &Scene) -> [Vec<f64>; 7] {
        let mut simulation = Simulation::new(scene, &Platform::Cpu64).unwrap_or_else(|e| panic!("{e}"));
        simulation.step(true).unwrap_or_else(|e| panic!("{e}"));
        let state = simulation.snapshots().unwrap_or_else(|e| panic!("{e}"));
        let surface = SkinSurface::new(&simulation, &state);
        let plane = Some(Clip { normal: [0.0, 1.0, 0.2], offset: 0.3e-3 });
        let on: std::collections::BTreeSet<u32> = surface.skin.triangles.iter().flatten().copied().collect();
        Quantity::ALL.map(|quantity| {
            let asked = Asked { quantity: Some(quantity), plane };
            let Read { values, slice } = asked.read(&surface, &simulation, &state);
            let Values { of, nodes, slice: inside } = values.expect("it was asked for");
            assert!(of == quantity && inside.len() == slice.expect("a slice").positions.len() && !inside.is_empty());
            on.iter().map(|node| nodes[*node as usize]).chain(inside).collect()
        })
    }

    #[test]
    fn every_quantity_is_read_on_an_embedded_surface() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/pad.toml");
        let scene = read(&path).unwrap_or_else(|e| panic!("{e}")).in_test_form();
        let all = seen(&scene);
        assert!(all.iter().flatten().all(|value| value.is_finite()));
        let [displacement, _, _, _, residual, alive, _] = all;
        assert!([displacement, residual, alive].iter().all(|of| of.iter().any(|value| *value > 0.0)));
    }

    #[test]
    fn a_stretched_block_is_of_one_colour_and_an_inclusion_of_another() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/verify/patch.toml");
        let mut scene = read(&path).unwrap_or_else(|e| panic!("{e}"));
        // nominal stress, Pa, times the stretch of 1.1 over the volume ratio; free across
        let [displacement, velocity, von_mises, pressure, residual, alive, stiffness] = seen(&scene);
        let (mean, third) = (von_mises[0], von_mises[0] / 3.0);
        assert!((9170.0..1.3 * 9170.0).contains(&mean), "{mean} Pa");
        assert!(von_mises.iter().all(|v| (v / mean - 1.0).abs() < 1e-4), "{von_mises:?}");
        assert!(pressure.iter().all(|v| (v / third + 1.0).abs() < 1e-4), "{pressure:?}");
        assert!(alive.iter().chain(&stiffness).all(|v| *v == 1.0));
        let [farthest, fastest, out_of_balance] =
            [displacement, velocity, residual].map(|of| of.into_iter().fold(0.0, f64::max));
        assert!((0.5e-3..2e-3).contains(&farthest), "a tenth of the side of 10 mm: {farthest:e} m");
        assert!(fastest < 1e-9 && out_of_balance < 1e-6, "{fastest:e} m/s, {out_of_balance:e} N");
        // the upper half is harder
        let region = Region::Box { min: [-1.0, -1.0, 2e-3], max: [1.0; 3] };
        scene.inclusions.push(Inclusion { body: 0, region, young: 300e3 });
        let [_, _, von_mises, _, _, _, stiffness] = seen(&scene);
        let (low, high) = stiffness.iter().fold((f64::MAX, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(low == 1.0 && (high - 3.0).abs() < 1e-12, "{low} to {high}");
        assert!(von_mises.iter().any(|v| (v / mean - 1.0).abs() > 0.05), "{von_mises:?}");
    }
}
