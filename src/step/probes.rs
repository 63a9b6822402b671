//! Probes: what they are of in each body, and their values at the end of a step.
//!
//! The reaction at a node is the force that its support exerts on it. Along a fixed axis the balance of the node gives it,
//!
//! `R = f_int(u') + f_damp(v') − f_ext − Jᵀλ`:
//!
//! elastic forces of the cells around at the displacements of the end of the step, the stiffness damping at its velocities, less the dead
//! loads and the weight that acted in the step and its contact forces. A fixed node is at rest and has neither inertia nor mass damping; one
//! on a path has both, from its path (`m ((v' − v)/h + r_M v')`).
//! Damping is part of it since the support carries it: with it the reactions, loads, weights and contact forces of a body add up to the change
//! of its momentum over the step, as closely as the step meets the law. A step of a hyperelastic body takes damping, and if it is linearised
//! elasticity, with the matrix of its start: a block under a sphere that slides by 0.075 mm a step has 2.6 % of its force unexplained with
//! `newton`, 5.7 % without, and less in proportion in shorter steps. A consistent mass also couples fixed nodes to the acceleration of their neighbours, which is not included.
//! Along a free axis a rest-shape spring holds the node, `R = −k (u' + r_K v')`; without one nothing does, `R = 0`.
//!
//! All of this is evaluated on the host in f64 from the displacements and velocities of the nodes around, read back with what the other
//! probes and the next search for contacts want: a body without such probes costs nothing. The terms of `f_int` lose the digits of an f32
//! displacement times the stiffness of a cell, on any backend.
//!
//! A cut changes which nodes belong to a region (duplicates lie where their originals do), the corners of cells and the surface; probes find
//! them again after each.

use super::body::Body;
use super::contact::{ContactReport, NodeForces};
use super::{Simulation, StepReport};
use crate::backend::Query;
use crate::bodies::ElementPoint;
use crate::constraints::Law;
use crate::error::Result;
use crate::math::{V3, V4};
use crate::mesh::{MaterialPoint, trilinear};
use crate::scene::{BodyId, ProbeKind, Region};
use glam::DVec3;

/// A probe, and what it is of in its body as that is cut now.
pub(super) struct Prepared {
    kind: ProbeKind,
    /// Of a region: its nodes with their duplicates, in ascending order. Of a displacement: nodes.
    nodes: Vec<u32>,
    /// `[node]` weights of a displacement.
    weights: Vec<f64>,
    /// Elements that contain a point.
    points: Vec<ElementPoint>,
    /// Faces of the surface in a region.
    faces: Vec<[u32; 4]>,
    /// Nodes whose displacements are read.
    read: Vec<u32>,
    /// Number of the body's cuts at that time; none before the first.
    cuts: Option<usize>,
}

impl Prepared {
    pub fn new(kind: ProbeKind) -> Self {
        Self { kind, nodes: vec![], weights: vec![], points: vec![], faces: vec![], read: vec![], cuts: None }
    }

    /// Has it found again, since its body may have other cuts than before.
    pub fn forget(&mut self) {
        self.cuts = None;
    }

    /// Finds its nodes, cells and faces in its body, if that has been cut since.
    pub fn find(&mut self, bodies: &[Body]) {
        let BodyId::Deformable(number) = self.kind.body() else { return };
        let body = &bodies[number];
        if self.cuts == Some(body.cuts.len()) {
            return;
        }
        self.cuts = Some(body.cuts.len());
        let (model, wound, mechanics) = (&body.model, &body.wound, body.model.mechanics());
        match &self.kind {
            ProbeKind::Displacement { point, .. } => {
                (self.nodes, self.weights) = body.material_point(*point).0.into_iter().unzip();
                self.read.clone_from(&self.nodes);
            }
            ProbeKind::MeanDisplacement { region, .. } => {
                self.nodes = body.nodes_in(region);
                self.weights = body.shares(&self.nodes);
                self.read.clone_from(&self.nodes);
            }
            ProbeKind::Reaction { region, .. } => {
                self.nodes = body.nodes_in(region);
                self.read = mechanics.reached(model, wound, &self.nodes);
            }
            ProbeKind::Pressure { region, .. } => {
                self.nodes = body.nodes_in(region);
                let inside = |face: &[u32; 4]| face.iter().all(|node| self.nodes.binary_search(node).is_ok());
                self.faces = body.wound.surface.all().iter().map(|quad| quad.nodes).filter(inside).collect();
                self.read = self.faces.as_flattened().to_vec();
            }
            ProbeKind::Strain { point, .. } | ProbeKind::Stress { point, .. } => {
                self.points = mechanics.element_points(model, wound, *point);
                self.read = mechanics.reached_from(model, wound, &self.points);
            }
            _ => {}
        }
    }

    fn of(&self, body: usize) -> bool {
        self.kind.body() == BodyId::Deformable(body)
    }
}

/// What the probes ask of a body at its nodes.
pub(super) fn query(probes: &[Prepared], number: usize) -> Query {
    let mut query = Query::default();
    for probe in probes.iter().filter(|probe| probe.of(number)) {
        query.displacements.extend(&probe.read);
        if let ProbeKind::Reaction { .. } = probe.kind {
            query.velocities.extend(&probe.read);
        }
    }
    query
}

impl Simulation {
    /// Reads the probes at the end of a step that began at `begin`, s, with its contact forces on nodes.
    pub(super) fn read_probes(
        &mut self,
        begin: f64,
        forces: Option<&[NodeForces]>,
        report: &mut StepReport,
    ) -> Result<()> {
        self.probes.iter_mut().for_each(|probe| probe.find(&self.bodies));
        // displacements and velocities; of whole bodies, and the loads of the step, where a probe asks for them
        let mut whole: Vec<Vec<V4<f64>>> = vec![];
        let mut loads: Vec<Vec<[f64; 3]>> = vec![];
        for (number, body) in self.bodies.iter_mut().enumerate() {
            body.read(query(&self.probes, number))?;
            let any = |is: fn(&ProbeKind) -> bool| self.probes.iter().any(|p| p.of(number) && is(&p.kind));
            whole.push(if any(ProbeKind::of_whole) { body.backend.displacements()? } else { vec![] });
            let held = any(|kind| matches!(kind, ProbeKind::Reaction { .. }));
            loads.push(if held { body.load_at(&self.scene, begin) } else { vec![] });
        }
        // reactions along several axes of a region are one sum
        let mut borne: Vec<(usize, &Region, [f64; 3])> = vec![];
        // value of each probe
        for probe in &self.probes {
            let value = match &probe.kind {
                ProbeKind::Displacement { body, axis, .. } | ProbeKind::MeanDisplacement { body, axis, .. } => {
                    let u = |node: &u32| self.bodies[*body].known.moved(*node as usize)[0].f64()[*axis];
                    probe.nodes.iter().zip(&probe.weights).map(|(node, weight)| weight * u(node)).sum()
                }
                // probes of one region along several axes share its reaction
                ProbeKind::Reaction { body, region, axis } => {
                    let known = borne.iter().find(|(of, at, _)| of == body && *at == region).map(|known| known.2);
                    let force = known.unwrap_or_else(|| {
                        let contact = forces.map_or(&[][..], |forces| &forces[*body]);
                        self.bodies[*body].reaction(&probe.nodes, &loads[*body], contact)
                    });
                    if known.is_none() {
                        borne.push((*body, region, force));
                    }
                    force[*axis]
                }
                ProbeKind::Pressure { body, .. } => self.bodies[*body].pressure(*body, probe, &report.contact),
                ProbeKind::Strain { body, component, .. } => {
                    component.of(self.bodies[*body].strain_and_stress(&probe.points)[0])
                }
                ProbeKind::Stress { body, component, .. } => {
                    component.of(self.bodies[*body].strain_and_stress(&probe.points)[1])
                }
                ProbeKind::Volume { body } | ProbeKind::VolumeChange { body } => {
                    let Body { model, wound, .. } = &self.bodies[*body];
                    let [rest, change] = wound.volume(model, &whole[*body]);
                    match probe.kind {
                        ProbeKind::Volume { .. } => rest + change,
                        _ if rest > 0.0 => change / rest,
                        _ => 0.0,
                    }
                }
                ProbeKind::CentreOfMass { of: BodyId::Deformable(body), axis } => {
                    self.bodies[*body].centre_of_mass(&whole[*body])[*axis]
                }
                ProbeKind::CentreOfMass { of, axis } => match of {
                    BodyId::Rigid(body) => self.tools[*body].position[*axis],
                    _ => 0.0, // refused by `Scene::check`
                },
                ProbeKind::Position { body, axis } => self.tools[*body].position[*axis],
                ProbeKind::Velocity { body, axis } => self.tools[*body].velocity[*axis],
                ProbeKind::Spin { body, axis } => self.tools[*body].angular_velocity[*axis],
                ProbeKind::Force { on, from, axis } => report.contact.force(*on, *from)[*axis],
            };
            report.probes.push(value);
        }
        Ok(())
    }
}

impl Body {
    /// Nodes of a region with their duplicates, in ascending order.
    fn nodes_in(&self, region: &Region) -> Vec<u32> {
        let surface = &self.wound.surface;
        let mut nodes = self.model.nodes_in(region);
        let copies: Vec<u32> = nodes.iter().flat_map(|node| surface.copies(*node as usize)).collect();
        nodes.extend(copies);
        nodes.sort_unstable();
        nodes
    }

    /// `[node]` shares of the volume of the present cells around nodes; equal ones where no cell is left.
    fn shares(&self, nodes: &[u32]) -> Vec<f64> {
        let surface = &self.wound.surface;
        let quarters = surface.tetrahedra().map(|of| of.volumes());
        let around = |node: &u32| -> f64 {
            if let Some(quarters) = &quarters {
                return quarters[*node as usize];
            }
            let cells = surface.parts.cells_of(*node as usize).into_iter().filter(|cell| surface.alive[*cell]);
            let volume = |cell| self.model.shape[self.model.layer(cell)][..3].iter().product::<f64>();
            cells.map(|cell| volume(cell) * self.model.grid_share(cell)).sum()
        };
        let volumes: Vec<f64> = nodes.iter().map(around).collect();
        let sum: f64 = volumes.iter().sum();
        let share = |volume: f64| if sum > 0.0 { volume / sum } else { 1.0 / nodes.len() as f64 };
        volumes.into_iter().map(share).collect()
    }

    /// The material point at a rest position in the body's frame: a node of the grid, or a point of a cell as it is cut now.
    fn material_point(&self, point: [f64; 3]) -> MaterialPoint {
        if let Some((e, weights)) = self.model.tetrahedron_at(point) {
            let surface = &self.wound.surface;
            let own = MaterialPoint::of(surface.corners_of_tetrahedra()[e], weights);
            // a node stands for itself, whichever tetrahedra it still has
            let of_node = |node: u32| MaterialPoint::node(surface.original(node as usize) as u32);
            return if own.0.len() == 1 { of_node(own.0[0].0) } else { own };
        }
        let cells = self.model.cells_at(point);
        let present = cells.iter().find(|(cell, _)| self.wound.surface.alive[*cell]);
        let Some((cell, natural)) = present.or(cells.first()) else { return MaterialPoint::default() };
        let of = |corners: [usize; 8]| MaterialPoint::of(corners.map(|node| node as u32), trilinear(*natural));
        let own = of(self.wound.surface.params().corners(*cell));
        if own.0.len() == 1 { own } else { of(self.wound.surface.parts.corners(*cell)) }
    }

    /// Force of the support on nodes, N, under the dead loads and the contact forces of the step: see the module.
    fn reaction(&self, nodes: &[u32], load: &[[f64; 3]], contact: &[(u32, [f64; 3])]) -> [f64; 3] {
        let (model, known, rate) = (&self.model, &self.known, self.model.step.rayleigh_stiffness);
        let internal = model.mechanics().forces_at(model, &self.wound, nodes, &|node| known.moved(node));
        let mut sum = [0.0; 3];
        for (node, internal) in nodes.iter().zip(internal) {
            let [x, y, z, mass] = self.wound.dofs[*node as usize];
            let inertia = self.accelerations.get(node).copied().unwrap_or_default();
            if mass == 0.0 {
                continue; // it has left the system
            }
            let spring = model.rest_springs.nodes.binary_search(node).map_or(0.0, |k| model.rest_springs.stiffness[k]);
            let [u, v] = known.moved(*node as usize);
            let pulled = ((u + v * rate) * spring).f64();
            let pushed = contact.binary_search_by_key(node, |f| f.0).map_or([0.0; 3], |k| contact[k].1);
            for axis in 0..3 {
                let outside = load[*node as usize][axis] + mass * model.step.gravity[axis] + pushed[axis];
                let fixed = [x, y, z][axis] == 0.0;
                sum[axis] += if fixed { internal[axis] - outside + mass * inertia[axis] } else { -pulled[axis] };
            }
        }
        sum
    }

    /// Normal contact forces on a probe's nodes over the present area of its faces, Pa; 0 without a face.
    fn pressure(&self, number: usize, probe: &Prepared, contact: &ContactReport) -> f64 {
        let mut force = 0.0;
        for (touch, along) in contact.contacts.iter().zip(&contact.forces) {
            let Law::Coulomb { .. } = touch.law else { continue };
            for side in (0..2).filter(|side| touch.on[*side] == BodyId::Deformable(number)) {
                let here = touch.points[side].0.iter().filter(|(node, _)| probe.nodes.binary_search(node).is_ok());
                force += along[0] * here.map(|(_, weight)| weight).sum::<f64>();
            }
        }
        let position = |node: u32| {
            let u = self.known.moved(node as usize)[0].f64();
            DVec3::from_array(self.wound.rest[node as usize]) + DVec3::from_array(u)
        };
        let area = |face: &[u32; 4]| {
            let [a, b, c, d] = face.map(position);
            0.5 * (c - a).cross(d - b).length()
        };
        let area: f64 = probe.faces.iter().map(area).sum();
        if area > 0.0 { force / area } else { 0.0 }
    }

    /// Green–Lagrange strain and Cauchy stress, Pa, by rows: their means over elements at a point of each; 0 without one.
    fn strain_and_stress(&self, points: &[ElementPoint]) -> [[[f64; 3]; 3]; 2] {
        if points.is_empty() {
            return [[[0.0; 3]; 3]; 2];
        }
        let (model, known) = (&self.model, &self.known);
        let moved = |node| known.moved(node);
        let means = model.mechanics().strain_and_stress_at(model, &self.wound, points, &moved);
        means.map(|tensor| tensor.0.map(V3::f64)) // symmetric: columns are rows
    }

    /// Centre of mass at displacements `u`, `[node]` m, world, m; 0 of a body without mass.
    fn centre_of_mass(&self, u: &[V4<f64>]) -> [f64; 3] {
        let (mut mass, mut moment) = (0.0, [0.0; 3]);
        for ((dofs, rest), u) in self.wound.dofs.iter().zip(&self.wound.rest).zip(u) {
            mass += dofs[3];
            (0..3).for_each(|n| moment[n] += dofs[3] * (rest[n] + u[n]));
        }
        if mass > 0.0 { moment.map(|m| m / mass) } else { [0.0; 3] }
    }
}
