//! Scenes in code: default values, and the check that every scene passes before it runs.

mod skin;
mod tool;

use super::devices::RATES;
use super::integrator::{FOLLOWED, fits_loads, unfit_for_static};
use super::invalid::{Invalid, Result};
use super::outputs::LARGEST_PICTURE;
use super::*;
use crate::error;
use std::fmt::Display;

impl Default for Scene {
    /// Empty, at rest.
    fn default() -> Self {
        Self {
            title: String::new(),
            file: PathBuf::from("scene in code"),
            lines: Default::default(),
            time: Time::default(),
            solver: Solver::default(),
            skins: vec![],
            boundaries: vec![],
            rest_springs: vec![],
            inclusions: vec![],
            loads: vec![],
            tools: vec![],
            planes: vec![],
            attachments: vec![],
            contact: None,
            haptic: Haptic::default(),
            probes: vec![],
            checks: vec![],
            study: Study::default(),
            test: None,
            view: View::default(),
            output: Output::default(),
        }
    }
}

impl Default for Time {
    /// One second in steps of 5 ms.
    fn default() -> Self {
        Self {
            step: 5e-3,
            duration: 1.0,
            gravity: [0.0, 0.0, -9.81],
            substeps: 1,
            integrator: Integrator::ImplicitEuler,
        }
    }
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            preconditioner: Preconditioner::Multigrid,
            tolerance: 1e-3,
            floor: 1e-10,
            max_iterations: 1000,
            newton: false,
            refinements: 0,
            true_residual_every: 20,
        }
    }
}

impl Default for Skin {
    /// A patch of 10 × 10 mm with one layer of 2 mm, neo-Hookean.
    fn default() -> Self {
        Self {
            name: "skin".into(),
            position: [0.0; 3],
            size: [0.01; 2],
            cells: [10; 2],
            layers: vec![Layer::default()],
            mesh: None,
            embedded: None,
            law: Law::Hyperelastic(Material::NeoHookean),
            mass: Mass::Lumped,
            cut: Cut::Split { reserve_columns: 44 },
            rayleigh_mass: 0.01,
            rayleigh_stiffness: 0.01,
            velocity: [0.0; 3],
            displacement: [0.0; 3],
            start: Start::Rest,
        }
    }
}

impl Default for Layer {
    /// Dermis.
    fn default() -> Self {
        Self {
            name: "dermis".into(),
            thickness: 2e-3,
            cells: 4,
            young: 2e5,
            poisson: 0.45,
            second_share: 0.0,
            fibres: Default::default(),
            density: 1100.0,
            pre_strain: [0.0; 2],
            toughness: 2e3,
            break_strain: f64::INFINITY,
            color: [232, 190, 172],
        }
    }
}

impl Default for Tool {
    /// A sphere of 2 mm held by a hand 20 mm above the origin.
    fn default() -> Self {
        Self {
            name: "tool".into(),
            mesh: ToolMesh { positions: vec![], triangles: vec![] },
            mass: 0.02,
            inertia: [1e-6; 3],
            blade: None,
            points: vec![],
            tip_radius: 0.0,
            round: Some(Round { radius: 2e-3, ends: [[0.0; 3]; 2] }),
            lines: None,
            cuboid: None,
            carve: None,
            coupling: Coupling::default(),
            trajectory: vec![Pose::default()],
            device: None,
            free: None,
        }
    }
}

impl Default for Coupling {
    fn default() -> Self {
        Self { stiffness: 1000.0, damping: 5.0, angular_stiffness: 1.0, angular_damping: 0.01 }
    }
}

impl Default for Pose {
    /// Upright, 20 mm above the origin.
    fn default() -> Self {
        Self { time: 0.0, position: [0.0, 0.0, 0.02], rotation: [0.0, 0.0, 0.0, 1.0] }
    }
}

impl Default for Blade {
    /// A 4 mm edge that rises from its tip at the origin and cuts along −x.
    fn default() -> Self {
        Self {
            edge: vec![[0.0; 3], [4e-3, 0.0, 4e-3]],
            normal: [0.0, 1.0, 0.0],
            thickness: 4e-4,
            edge_spacing: 4e-4,
            flat_spacing: 1e-3,
            depth: 2e-3,
        }
    }
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            friction: 0.3,
            alarm: 5e-4,
            distance: 0.0,
            forces: Loop::Constraints,
            correction: Correction::Exact,
            filter: Filter::Own,
            angle_cone: 0.02,
            max_contacts: 16,
            lips: false,
            tolerance: 1e-3,
            column_tolerance: 0.2,
            max_passes: 16,
        }
    }
}

impl Default for Haptic {
    fn default() -> Self {
        Self { rate: 1000.0 }
    }
}

impl Default for View {
    /// From the front and above.
    fn default() -> Self {
        Self { frames: 8, size: [960, 640], eye: [0.0, -0.03, 0.03], target: [0.0; 3], field_of_view: 30.0 }
    }
}

/// Part of a scene, by its path in the code.
struct Part<'a> {
    scene: &'a Scene,
    path: String,
}

impl Part<'_> {
    fn of(&self, name: impl Display) -> Part<'_> {
        let dot = if self.path.is_empty() { "" } else { "." };
        Part { scene: self.scene, path: format!("{}{dot}{name}", self.path) }
    }

    /// Part of a list.
    fn at(&self, name: &str, number: usize) -> Part<'_> {
        self.of(format!("{name}[{number}]"))
    }

    fn refuse(&self, found: impl Display, wanted: &'static str) -> Invalid {
        let Scene { file, title, .. } = self.scene;
        let (file, title) = (file.clone(), title.clone());
        Invalid::InCode { file, title, path: self.path.clone(), found: found.to_string(), wanted }
    }

    fn that(&self, holds: bool, found: impl Display, wanted: &'static str) -> Result<()> {
        if holds { Ok(()) } else { Err(self.refuse(found, wanted)) }
    }

    fn finite(&self, name: &str, values: &[f64]) -> Result<()> {
        let odd = values.iter().find(|v| !v.is_finite());
        odd.map_or(Ok(()), |v| Err(self.of(name).refuse(v, "finite numbers")))
    }

    fn positive(&self, name: &str, values: &[f64]) -> Result<()> {
        let odd = values.iter().find(|v| !(v.is_finite() && **v > 0.0));
        odd.map_or(Ok(()), |v| Err(self.of(name).refuse(v, "finite numbers above 0")))
    }

    fn not_negative(&self, name: &str, values: &[f64]) -> Result<()> {
        let odd = values.iter().find(|v| !(v.is_finite() && **v >= 0.0));
        odd.map_or(Ok(()), |v| Err(self.of(name).refuse(v, "finite numbers of at least 0")))
    }

    fn at_least_one(&self, name: &str, counts: &[u32]) -> Result<()> {
        self.of(name).that(counts.iter().all(|c| *c > 0), 0, "at least 1")
    }

    fn fraction(&self, name: &str, value: f64) -> Result<()> {
        self.of(name).that(value > 0.0 && value < 1.0, value, "a number between 0 and 1")
    }

    fn unit(&self, name: &str, v: &[f64]) -> Result<()> {
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        self.of(name).that((length - 1.0).abs() < 1e-6, length, "length 1")
    }

    fn index(&self, name: &str, index: usize, count: usize) -> Result<()> {
        self.of(name).that(index < count, index, "the number of one that is there, from 0")
    }
}

impl Scene {
    /// Checks that the scene can run: values in range, valid body indices, compatible parts. (Whether a solver supports a body's kind is
    /// checked when the body is made; a region in code may contain no node.) The reader of scene files and
    /// [`Simulation`](crate::step::Simulation) call it.
    ///
    /// # Errors
    /// [`Error::Scene`](error::Error::Scene) with the part, its value and the allowed ones.
    pub fn check(&self) -> error::Result<()> {
        Ok(self.parts()?)
    }

    pub(super) fn parts(&self) -> Result<()> {
        let scene = Part { scene: self, path: String::new() };
        self.check_solution(&scene)?;
        for (k, skin) in self.skins.iter().enumerate() {
            skin::check(&scene.at("skins", k), skin)?;
        }
        self.check_held(&scene)?;
        self.check_driven(&scene)?;
        self.check_touching(&scene)?;
        self.check_outputs(&scene)?;
        self.check_together(&scene)
    }

    /// Checks time and solver.
    fn check_solution(&self, scene: &Part) -> Result<()> {
        let time = scene.of("time");
        time.positive("step", &[self.time.step])?;
        time.positive("duration", &[self.time.duration])?;
        time.finite("gravity", &self.time.gravity)?;
        time.at_least_one("substeps", &[self.time.substeps])?;
        if let Some(steps) = self.time.too_many_steps() {
            return Err(time.of("duration, step").refuse(format!("{steps:.0} steps"), "at most 4294967295 steps"));
        }
        let solver = scene.of("solver");
        solver.fraction("tolerance", self.solver.tolerance)?;
        solver.not_negative("floor", &[self.solver.floor])?;
        solver.at_least_one("max_iterations", &[self.solver.max_iterations])?;
        solver.at_least_one("true_residual_every", &[self.solver.true_residual_every])
    }

    /// Checks boundaries and rest-shape springs.
    fn check_held(&self, scene: &Part) -> Result<()> {
        let skins = self.skins.len();
        for (k, boundary) in self.boundaries.iter().enumerate() {
            let part = scene.at("boundaries", k);
            part.index("body", boundary.body, skins)?;
            part.finite("displacement", &boundary.displacement)?;
            part.finite("rotation", &[boundary.rotation])?;
            check_path(&part.of("path"), &boundary.path, self.time.integrator)?;
            let [x, y, _] = boundary.axes;
            part.of("axes").that(
                boundary.rotation == 0.0 || (x && y),
                "without x or y",
                "with both where nodes are turned",
            )?;
            let path = boundary.path.iter().map(|pose| &pose.position);
            let unheld = path.chain([&boundary.displacement]).any(|by| boundary.leaves(by));
            part.of("axes").that(
                !unheld,
                "without one that nodes are moved along",
                "with those that nodes are moved along",
            )?;
            self.check_region(&part, boundary.body, &boundary.region)?;
        }
        for (k, spring) in self.rest_springs.iter().enumerate() {
            let part = scene.at("rest_springs", k);
            part.index("body", spring.body, skins)?;
            part.positive("stiffness", &[spring.stiffness])?;
            self.check_region(&part, spring.body, &spring.region)?;
            let lumped = self.skins[spring.body].mass != Mass::Consistent;
            part.of("body").that(lumped, "of a consistent mass", "of a lumped or uniform mass")?;
        }
        Ok(())
    }

    /// Checks inclusions and loads.
    fn check_driven(&self, scene: &Part) -> Result<()> {
        let skins = self.skins.len();
        for (k, inclusion) in self.inclusions.iter().enumerate() {
            let part = scene.at("inclusions", k);
            part.index("body", inclusion.body, skins)?;
            part.positive("young", &[inclusion.young])?;
            self.check_region(&part, inclusion.body, &inclusion.region)?;
            let solid = matches!(inclusion.region, Region::Sphere { .. } | Region::Box { .. });
            part.of("region").that(solid, "neither a sphere nor a box", "one of them")?;
            let large = matches!(self.skins[inclusion.body].law, Law::Hyperelastic(_));
            part.of("body").that(large, "of a small-strain law, springs or tetrahedra", "of a hyperelastic law")?;
            let implicit = self.time.integrator != Integrator::SymplecticEuler;
            scene.of("time").of("integrator").that(implicit, "symplectic Euler", "an implicit one, for inclusions")?;
        }
        for (k, load) in self.loads.iter().enumerate() {
            let part = scene.at("loads", k);
            part.index("body", load.body, skins)?;
            part.of("start, end").that(load.start < load.end, "in the wrong order", "rising")?;
            self.check_region(&part, load.body, &load.region)?;
            if let Region::Box { min, max } = load.region {
                let area = (0..3).filter(|axis| min[*axis] < max[*axis]).count() > 1;
                part.of("region.min, max").that(area, "without an area", "corners of a rectangle or of a box")?;
            }
            part.finite("kind", &load.kind.numbers())?;
            if let LoadKind::PointForce { at, .. } = load.kind {
                let inside = self.skins[load.body].holds(at);
                part.of("kind.at").that(inside, format!("{at:?}"), "a point of the body at rest")?;
            }
        }
        Ok(())
    }

    /// Checks rigid bodies, walls and attachments.
    fn check_touching(&self, scene: &Part) -> Result<()> {
        for (k, tool) in self.tools.iter().enumerate() {
            tool::check(&scene.at("tools", k), tool)?;
        }
        let held_first = self.tools.windows(2).all(|pair| pair[0].free.is_none() || pair[1].free.is_some());
        scene.of("tools").that(held_first, "a held tool after a free one", "those that hands hold first")?;
        for (k, plane) in self.planes.iter().enumerate() {
            scene.at("planes", k).finite("through", &plane.through)?;
            scene.at("planes", k).unit("normal", &plane.normal)?;
        }
        for (k, attachment) in self.attachments.iter().enumerate() {
            let part = scene.at("attachments", k);
            part.index("body", attachment.body, self.skins.len())?;
            self.check_body(&part.of("to"), attachment.to)?;
            self.check_region(&part, attachment.body, &attachment.region)?;
            part.of("to").that(
                attachment.to != BodyId::Deformable(attachment.body),
                "the body itself",
                "another body",
            )?;
            if let Some(slide) = attachment.slide {
                part.of("slide").unit("direction", &slide.direction)?;
                part.of("slide").not_negative("friction, resistance", &[slide.friction, slide.resistance])?;
            }
        }
        Ok(())
    }

    /// Checks probes, the haptic loop, the view, and what the study refers to.
    fn check_outputs(&self, scene: &Part) -> Result<()> {
        for (k, probe) in self.probes.iter().enumerate() {
            self.check_probe(&scene.at("probes", k), &probe.kind)?;
        }
        let ([least, most], rate) = (RATES, self.haptic.rate);
        scene.of("haptic.rate").that((least..=most).contains(&rate), rate, "from 100 to 4000 Hz")?;
        let view = scene.of("view");
        view.at_least_one("size", &self.view.size)?;
        let most = self.view.size[0].max(self.view.size[1]);
        view.of("size").that(most <= LARGEST_PICTURE, most, "at most 8192 pixels")?;
        view.finite("eye, target", &[self.view.eye, self.view.target].concat())?;
        view.of("eye").that(self.view.eye != self.view.target, "the target", "apart from the target")?;
        let angle = self.view.field_of_view;
        view.of("field_of_view").that(angle > 0.0 && angle < 180.0, angle, "degrees between 0 and 180")?;
        let odd = |k: &usize| *k >= self.probes.len();
        let named = self.study.probes.iter().chain(self.study.known.iter().map(|(k, _)| k)).copied().find(odd);
        named.map_or(Ok(()), |k| scene.of("study").index("probes", k, self.probes.len()))
    }

    fn check_body(&self, part: &Part, body: BodyId) -> Result<()> {
        match body {
            BodyId::Rigid(k) => part.index("Rigid", k, self.tools.len()),
            BodyId::Deformable(k) => part.index("Deformable", k, self.skins.len()),
            BodyId::Plane(k) => part.index("Plane", k, self.planes.len()),
            BodyId::World => Ok(()),
        }
    }

    fn check_probe(&self, part: &Part, kind: &ProbeKind) -> Result<()> {
        // body
        let (skins, tools) = (self.skins.len(), self.tools.len());
        match kind {
            ProbeKind::Force { on, from, .. } => {
                self.check_body(&part.of("on"), *on)?;
                from.map_or(Ok(()), |from| self.check_body(&part.of("from"), from))?;
            }
            ProbeKind::CentreOfMass { of, .. } => {
                self.check_body(&part.of("of"), *of)?;
                let heavy = matches!(of, BodyId::Deformable(_) | BodyId::Rigid(_));
                part.of("of").that(heavy, "without a mass", "a deformable or a rigid body")?;
            }
            _ => match kind.body() {
                BodyId::Rigid(body) => part.index("body", body, tools)?,
                BodyId::Deformable(body) => part.index("body", body, skins)?,
                BodyId::Plane(_) | BodyId::World => {}
            },
        }
        // point or region, axis or component
        kind.region().map_or(Ok(()), |(body, region)| self.check_region(part, body, region))?;
        match kind {
            ProbeKind::Displacement { body, point, axis } => {
                self.check_point(part, *body, *point)?;
                part.index("axis", *axis, 3)
            }
            ProbeKind::Strain { body, point, component } | ProbeKind::Stress { body, point, component } => {
                self.check_point(part, *body, *point)?;
                let stress = matches!(kind, ProbeKind::Stress { .. });
                match component {
                    Component::Entry(i, j) => part.index("component", *i.max(j), 3)?,
                    Component::VonMises => part.of("component").that(stress, "VonMises", "an Entry of a strain")?,
                }
                let springs = matches!(self.skins[*body].law, Law::Springs { .. });
                part.of("body").that(!(stress && springs), "of springs", "of cells, which have a stress")
            }
            ProbeKind::MeanDisplacement { axis, .. }
            | ProbeKind::Reaction { axis, .. }
            | ProbeKind::CentreOfMass { axis, .. }
            | ProbeKind::Position { axis, .. }
            | ProbeKind::Velocity { axis, .. }
            | ProbeKind::Spin { axis, .. }
            | ProbeKind::Force { axis, .. } => part.index("axis", *axis, 3),
            ProbeKind::Pressure { .. } => {
                part.that(self.contact.is_some(), "of contact", "of a scene with a contact law")
            }
            ProbeKind::Volume { .. } | ProbeKind::VolumeChange { .. } => Ok(()),
        }
    }

    /// A probe's point is one of its body's material.
    fn check_point(&self, part: &Part, body: usize, point: [f64; 3]) -> Result<()> {
        part.finite("point", &point)?;
        let holds = self.skins[body].holds(point);
        part.of("point").that(holds, format!("{point:?}"), "a point of the body at rest")
    }

    /// Checks the region of a part in a body.
    fn check_region(&self, part: &Part, body: usize, region: &Region) -> Result<()> {
        let part = part.of("region");
        match region {
            Region::Box { min, max } => part.finite("min, max", &[*min, *max].concat()),
            Region::Sphere { centre, radius } => {
                part.finite("centre", centre)?;
                part.positive("radius", &[*radius])
            }
            Region::Plane { through, normal, within } => {
                part.finite("through", through)?;
                part.unit("normal", normal)?;
                part.not_negative("within", &[*within])
            }
            Region::Rim(margin) | Region::Core(margin) => part.not_negative("margin", &[*margin]),
            Region::Group(group) => {
                let skin = &self.skins[body];
                if let Some(surface) = &skin.embedded {
                    let known = surface.groups().iter().any(|own| own.name() == group.name());
                    return part.that(known, format!("group \"{}\"", group.name()), "a group of its body's surface");
                }
                let nodes = skin.mesh.as_ref().map_or(0, |mesh| mesh.nodes().len());
                let odd = group.nodes().iter().find(|node| **node as usize >= nodes);
                odd.map_or(Ok(()), |node| {
                    Err(part.refuse(
                        format!("a group with node {node}"),
                        "a group of its body's mesh, or a region of a grid",
                    ))
                })
            }
            _ => Ok(()),
        }
    }

    /// Checks combinations of parts.
    fn check_together(&self, scene: &Part) -> Result<()> {
        super::embedded::fits(self)?;
        // the solver
        let refinements = scene.of("solver.refinements");
        refinements.that(
            !self.balances_law() || self.solver.refinements == 0,
            self.solver.refinements,
            "0 with Newton's method",
        )?;
        if let Some(why) =
            self.unfit_for_newton().filter(|_| self.solver.newton && self.skins.iter().any(hyperelastic::large_strain))
        {
            return Err(scene.of("solver.newton").refuse(format!("true, but {why}"), "false"));
        }
        // the integrator with contact, loads and laws
        let integrator = scene.of("time.integrator");
        let implicit = matches!(self.time.integrator, Integrator::ImplicitEuler | Integrator::Static);
        integrator.that(
            implicit || self.contact.is_none(),
            "another",
            "ImplicitEuler or Static where bodies may touch",
        )?;
        if let (Integrator::Static, Some((why, _))) = (self.time.integrator, unfit_for_static(&self.skins, &self.tools))
        {
            return Err(integrator.refuse(format!("Static, which {why}"), "another"));
        }
        let fits = fits_loads(self.time.integrator, &self.skins, &self.loads);
        integrator.that(fits, format!("Midpoint, which {FOLLOWED}"), "ImplicitEuler with `solver.newton`")?;
        let fits = self.skins.iter().all(|skin| self.time.integrator.fits(skin.law));
        integrator.that(fits, "Newmark or Midpoint", "one that is stable with the law (`Integrator::fits`)")?;
        if self.time.integrator == Integrator::SymplecticEuler {
            let explicit = |skin: &Skin| !matches!(skin.law, Law::Springs { .. }) && skin.mass != Mass::Consistent;
            let fits = self.skins.iter().all(explicit);
            integrator.that(fits, "SymplecticEuler", "an implicit one with this law or mass")?;
        }
        // contact, and what its correction goes with
        let part = scene.of("contact");
        let Some(contact) = &self.contact else {
            return part.that(self.attachments.is_empty(), "none", "a contact law where bodies are tied");
        };
        part.not_negative("friction, distance, angle_cone", &[contact.friction, contact.distance, contact.angle_cone])?;
        part.positive("alarm", &[contact.alarm])?;
        part.fraction("tolerance", contact.tolerance)?;
        part.fraction("column_tolerance", contact.column_tolerance)?;
        part.at_least_one("max_contacts, max_passes", &[contact.max_contacts, contact.max_passes])?;
        if let Loop::Penalty(stiffness) = contact.forces {
            part.of("forces").positive("Penalty", &[stiffness])?;
        }
        let correction = part.of("correction");
        let ties = contact.correction == Correction::Uncoupled && !self.attachments.is_empty();
        correction.that(!ties, "Uncoupled", "Exact where bodies are tied")?;
        let changes = self.tools.iter().any(|tool| tool.blade.is_some()) || self.skins.iter().any(Skin::breaks);
        let cut = contact.correction == Correction::Precomputed && changes;
        correction.that(!cut, "Precomputed", "Exact where a tool has a blade or springs break")?;
        let unfit = super::tools::unfit_to_carve(&self.skins, &self.tools, contact.correction);
        let Some((number, what)) = unfit else { return Ok(()) };
        let found = format!("of \"{}\", which cannot carve: {what}", self.tools[number].name);
        Err(scene.of(format!("tools[{number}].carve")).refuse(found, "None, or as this says"))
    }
}

fn check_path(part: &Part, path: &[Pose], integrator: Integrator) -> Result<()> {
    for pose in path {
        part.finite("time, position", &[&[pose.time], &pose.position[..]].concat())?;
    }
    let rising = path.windows(2).all(|pair| pair[0].time < pair[1].time);
    part.that(rising, "with times that do not rise", "rising times")?;
    let fits = path.is_empty() || matches!(integrator, Integrator::ImplicitEuler | Integrator::Static);
    part.that(fits, "with another integrator", "empty, or with implicit Euler or static steps")
}
