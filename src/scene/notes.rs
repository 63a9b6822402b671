//! Notes on a valid scene: what runs, but is seldom meant.

use super::{BodyId, Integrator, Load, LoadKind, Pose, Region, Scene, Skin, Tool};
use glam::{DQuat, DVec3};

/// Share of a step by which a duration may miss a multiple of it; decimal numbers of the file are rounded to 10⁻¹⁶ of their value.
const WHOLE: f64 = 1e-6;

/// Poisson's ratio above which tetrahedra are inaccurate: errors in `bodies::tetrahedra`.
const MOST_OF_TETRAHEDRA: f64 = 0.49;

/// Sizes of bodies that a file is likely to mean, m.
const SIZES: std::ops::Range<f64> = 1e-4..10.0;

/// A body's centre and the radius of a ball around it, m.
#[derive(Clone, Copy)]
struct Extent {
    centre: DVec3,
    radius: f64,
}

impl Skin {
    /// Whether a point is within its extent at rest.
    fn reaches(&self, point: DVec3) -> bool {
        let half = DVec3::new(0.5 * self.size[0], 0.5 * self.size[1], 0.5 * self.thickness());
        let from_centre = point - DVec3::from_array(self.position) - DVec3::Z * half.z;
        from_centre.abs().cmple(half).all()
    }
}

impl Tool {
    /// Whether its hand leads a blade through skin against the way that its edge faces: by more, over all, than a tenth of what it moves along
    /// that way.
    fn led_backward(&self, skins: &[Skin]) -> bool {
        let Some(blade) = &self.blade else { return false };
        let [tip, heel] =
            [blade.edge.first(), blade.edge.last()].map(|end| DVec3::from_array(*end.unwrap_or(&[0.0; 3])));
        let ([.., forward], middle) = (blade.frame(), (tip + heel) * 0.5);
        let step = |pair: &[Pose]| {
            let [from, to] = [0, 1].map(|k| DVec3::from_array(pair[k].position));
            let [turn, then] = [0, 1].map(|k| DQuat::from_array(pair[k].rotation));
            // the share of the way that is in skin
            let inside = |n: &u32| {
                let hand = from.lerp(to, f64::from(*n) / 10.0);
                [tip, heel].iter().any(|end| skins.iter().any(|skin| skin.reaches(hand + turn * *end)))
            };
            let moved = to + then * middle - from - turn * middle;
            moved.dot(turn * forward) * (0..=10).filter(inside).count() as f64
        };
        let steps = self.trajectory.windows(2).map(step);
        let (over_all, moved) = steps.fold((0.0, 0.0), |(sum, moved), step| (sum + step, moved + step.abs()));
        over_all < -0.1 * moved
    }
}

impl Scene {
    /// Notes for a person, one sentence each: a duration that is no multiple of the step, bodies that gravity or loads push away since nothing
    /// holds or supports them, nearly incompressible tetrahedra, a mesh in another unit, a load that comes too late or goes too soon, a blade
    /// that is led backward. A body that nothing pushes may float.
    pub fn notes(&self) -> Vec<String> {
        let mut out = vec![];
        // duration
        let (steps, time) = (self.time.duration / self.time.step, &self.time);
        if (steps - steps.round()).abs() > WHOLE {
            let (count, step) = (time.steps(), 1e3 * time.step);
            out.push(format!(
                "duration_s = {} is no multiple of step_ms = {step}: the run takes {count} steps and ends at {} s",
                time.duration,
                (f64::from(count) * time.step * 1e6).round() / 1e6
            ));
        }
        // units of meshes
        for skin in self.skins.iter().filter(|skin| skin.mesh.is_some() || skin.embedded.is_some()) {
            let across = skin.size[0].max(skin.size[1]).max(skin.thickness());
            if !SIZES.contains(&across) {
                let mm = 1e3 * across;
                out.push(format!(
                    "`{}` is {mm:.3e} mm across by its file; write mesh_unit_mm = 1000 if that is in metres",
                    skin.name
                ));
            }
        }
        // late loads
        for load in self.loads.iter().filter(|load| load.start >= time.duration) {
            let (start, end) = (load.start, time.duration);
            out.push(format!("a load starts at {start} s, when the run of {end} s is over"));
        }
        // loads that no step takes
        let part = time.part();
        let all = f64::from(time.steps()) * f64::from(time.substeps);
        let [first, last] = if time.integrator == Integrator::Static { [1.0, all] } else { [0.0, all - 1.0] };
        let step = |load: &Load| (load.start / part - WHOLE).ceil().max(first);
        let missed = |load: &&Load| step(load) * part >= load.end || step(load) > last;
        for load in self.loads.iter().filter(|load| load.start < time.duration).filter(missed) {
            out.push(format!(
                "a load that starts at {} s is in no step of {} ms: a step takes the loads of its start, a static one those of its end",
                load.start,
                1e3 * part
            ));
        }
        // blades led backward
        for tool in self.tools.iter().filter(|tool| tool.led_backward(&self.skins)) {
            out.push(format!(
                "`{}` is led backward: its edge faces normal × (heel − tip), against most of its way; write its normal with the other sign, \
                 or it cuts nothing",
                tool.name
            ));
        }
        // bodies that nothing holds or supports
        let kept = self.kept();
        for (number, id) in self.movable().into_iter().enumerate() {
            if kept[number] || !self.pushed(id) {
                continue;
            }
            let (name, by) = match id {
                BodyId::Deformable(k) if time.gravity == [0.0; 3] => (&self.skins[k].name, "its load pushes"),
                BodyId::Deformable(k) => (&self.skins[k].name, "gravity pulls"),
                BodyId::Rigid(k) => (&self.tools[k].name, "gravity pulls"),
                _ => continue,
            };
            out.push(format!(
                "nothing holds `{name}` and nothing is under it, so {by} it away; hold a region of it with [[boundary]], [[rest_spring]] or \
                 [[attach]], put a [[plane]] under it, or leave out gravity and loads"
            ));
        }
        // nearly incompressible tetrahedra
        let nearly_incompressible = |skin: &&Skin| {
            skin.law.is_tetrahedral() && skin.layers.iter().any(|layer| layer.poisson > MOST_OF_TETRAHEDRA)
        };
        for skin in self.skins.iter().filter(nearly_incompressible) {
            let most = skin.layers.iter().map(|layer| layer.poisson).fold(0.0, f64::max);
            out.push(format!(
                "`{}` is of tetrahedra with poisson = {most}: above {MOST_OF_TETRAHEDRA} they are inexact (smoothed ones by up to a seventh at 0.499, \
                 plain ones lock); take hexahedra (element = \"bbar\", or a surface with embed = \"bricks\")",
                skin.name
            ));
        }
        out
    }

    /// Bodies that are not held by a hand: deformable ones, then free rigid ones.
    fn movable(&self) -> Vec<BodyId> {
        let free = (0..self.tools.len()).filter(|k| self.tools[*k].free.is_some()).map(BodyId::Rigid);
        (0..self.skins.len()).map(BodyId::Deformable).chain(free).collect()
    }

    /// `[movable body]` true if something holds it, or something that is kept is in its way.
    fn kept(&self) -> Vec<bool> {
        let bodies = self.movable();
        let mut kept: Vec<bool> = bodies.iter().map(|id| self.held(*id)).collect();
        // what rests on or is tied to what is kept is kept: as many rounds as bodies
        for _ in 0..bodies.len() {
            for (number, id) in bodies.iter().enumerate() {
                let by = |other: usize| other != number && kept[other];
                let found = (0..bodies.len()).any(|other| {
                    by(other) && (self.tied(*id, bodies[other]) || self.in_way_of(*id, self.extent(bodies[other])))
                });
                kept[number] |= found;
            }
        }
        kept
    }

    /// True if the world or a hand holds a body, or a wall or a hand's tool is in its way.
    fn held(&self, id: BodyId) -> bool {
        let g = DVec3::from_array(self.time.gravity);
        let along = |axes: [bool; 3]| g == DVec3::ZERO || (0..3).any(|n| axes[n] && g[n] != 0.0);
        let hand = |k: usize| self.tools[k].free.is_none();
        let own = matches!(id, BodyId::Deformable(body) if {
            self.boundaries.iter().any(|b| b.body == body && along(b.axes)) || self.rest_springs.iter().any(|a| a.body == body)
        });
        let wall = self.planes.iter().any(|plane| g == DVec3::ZERO || DVec3::from_array(plane.normal).dot(g) < 0.0);
        let tools = (0..self.tools.len()).filter(|k| hand(*k)).map(BodyId::Rigid);
        let of_tools = tools.into_iter().any(|tool| self.tied(id, tool) || self.in_way_of(id, self.extent(tool)));
        own || wall || of_tools || self.tied(id, BodyId::World)
    }

    fn tied(&self, a: BodyId, b: BodyId) -> bool {
        let between = |pair: [BodyId; 2]| pair == [a, b] || pair == [b, a];
        self.attachments.iter().any(|tie| between([BodyId::Deformable(tie.body), tie.to]))
    }

    /// True if gravity or a load with a resultant acts on a body.
    fn pushed(&self, id: BodyId) -> bool {
        let balanced =
            |region: &Region| matches!(region, Region::All | Region::Sides | Region::SidesX | Region::SidesY);
        let loaded = self.loads.iter().any(|load| {
            BodyId::Deformable(load.body) == id
                && match load.kind {
                    LoadKind::Pressure { pressure, .. } => pressure != 0.0 && !balanced(&load.region),
                    LoadKind::Traction(v) | LoadKind::Force(v) | LoadKind::PointForce { force: v, .. } => v != [0.0; 3],
                }
        });
        self.time.gravity != [0.0; 3] || loaded
    }

    /// True if a body meets another extent when gravity pulls it; by loads alone, wherever that is.
    fn in_way_of(&self, id: BodyId, other: Extent) -> bool {
        let down = DVec3::from_array(self.time.gravity).normalize_or_zero();
        let own = self.extent(id);
        let apart = other.centre - own.centre;
        let beside = apart - down * apart.dot(down);
        down == DVec3::ZERO || (apart.dot(down) > 0.0 && beside.length() <= own.radius + other.radius)
    }

    fn extent(&self, id: BodyId) -> Extent {
        match id {
            BodyId::Deformable(k) => {
                let skin = &self.skins[k];
                let half = 0.5 * DVec3::new(skin.size[0], skin.size[1], skin.thickness());
                Extent { centre: DVec3::from_array(skin.position) + DVec3::Z * half.z, radius: half.length() }
            }
            BodyId::Rigid(k) => {
                let tool = &self.tools[k];
                let centre = tool.trajectory.first().map_or(DVec3::ZERO, |pose| DVec3::from_array(pose.position));
                let length = |p: &[f64; 3]| DVec3::from_array(*p).length();
                let round = tool
                    .round
                    .as_ref()
                    .map_or(0.0, |round| round.radius + round.ends.iter().map(length).fold(0.0, f64::max));
                let mesh = tool.mesh.positions.iter().map(length).fold(round, f64::max);
                Extent { centre, radius: mesh }
            }
            _ => Extent { centre: DVec3::ZERO, radius: 0.0 },
        }
    }
}
