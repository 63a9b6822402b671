//! Random paths of a blade through small skins, and what a run of one is judged by.

use cutis::bodies::Model;
use cutis::bodies::grid::{cell_centres, links};
use cutis::bodies::rigid::Instrument;
use cutis::error::Result;
use cutis::kernels::cut::cut;
use cutis::math::random;
use cutis::report::Report;
use cutis::report::run::{Options, run};
use cutis::scene::{Files, Pose, Scene, parse};
use cutis::step::Platform;
use glam::{DQuat, DVec3};
use std::path::Path;

/// Numbers that look random and are the same for the same seed.
pub struct Random(random::Random);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        Self(random::Random::split_mix(seed))
    }
    /// Between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }
    /// One of some.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.between(0.0, of.len() as f64) as usize).min(of.len() - 1)]
    }
}

/// A kind of path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Straight down, a straight cut of some length, straight up; the skin's sides and bottom are held.
    Straight,
    /// The same right across the skin and through all of it, whose sides are free.
    Through,
    /// Anywhere at any speed: sideways, backwards, from inside, through the border.
    Any,
}

/// A skin and the blade's path through it.
pub struct Case {
    /// To run.
    pub scene: Scene,
    /// What it is, for messages.
    pub name: String,
    kind: Kind,
}

/// Side of the skin, mm, cells across, and cells over the thickness of each layer.
const SKINS: [(f64, u32, [u32; 3]); 4] =
    [(10.0, 10, [1, 1, 1]), (10.0, 13, [2, 1, 1]), (20.0, 16, [2, 2, 1]), (20.0, 24, [2, 2, 1])];

const HEAD: &str = r#"title = "A random path"
[time]
step_ms = 5.0
duration_s = 1.0
[solver]
preconditioner = "multigrid"
tolerance = 1e-2
[skin]
size_mm = [SIZE, SIZE]
cells = [CELLS, CELLS]
rayleigh_mass_per_s = 0.01
rayleigh_stiffness_s = 0.01
[[skin.layer]]
name = "hypodermis"
thickness_mm = 1.2
cells = FAT
young_kpa = 34.0
poisson = 0.45
density_kg_m3 = 971.0
toughness_kj_m2 = 0.15
[[skin.layer]]
name = "dermis"
thickness_mm = 1.0
cells = DERMIS
young_kpa = 200.0
poisson = 0.45
density_kg_m3 = 1116.0
toughness_kj_m2 = 0.2
pre_strain = [TAUT]
[[skin.layer]]
name = "epidermis"
thickness_mm = 0.1
cells = EPIDERMIS
young_kpa = 1000.0
poisson = 0.45
density_kg_m3 = 1116.0
toughness_kj_m2 = 0.2
pre_strain = [TAUT]
HELD
[[tool]]
name = "scalpel"
mesh = "meshes/scalpel.obj"
trajectory = "incision.csv"
mass_g = 20.0
inertia_g_mm2 = [4000.0, 6000.0, 4000.0]
[tool.coupling]
stiffness_n_m = 3000.0
damping_n_s_m = 10.0
angular_stiffness_n_m_rad = 3.0
angular_damping_n_m_s_rad = 0.01
[tool.blade]
edge_mm = [[-12.0, 0.0, -14.0], [-8.0, 0.0, -10.0]]
normal = [0.0, 1.0, 0.0]
thickness_mm = 0.4
edge_spacing_mm = SPACING
flat_spacing_mm = 1.0
depth_mm = 1.0
[contact]
friction = 0.3
alarm_mm = 0.2
max_contacts = 48
"#;

/// Thickness of all layers, m.
const THICK: f64 = 2.3e-3;
/// Toughness of the toughest layer, J/m².
const TOUGHNESS: f64 = 200.0;
/// Length of the edge, m.
const EDGE: f64 = 5.657e-3;
/// Thickness of the blade, m.
const THICKNESS: f64 = 4e-4;
/// Stiffness of the hand's coupling, N/m, and its damping, N·s/m.
const COUPLING: f64 = 3000.0;
const DAMPING: f64 = 10.0;
/// Haptic ticks per second.
const TICKS: f64 = 1000.0;
/// How far the blade is behind the hand while it cuts: what the coupling and the skin give under 0.4 N, m.
const LAG: f64 = 4e-4;
/// The blade's tip in its own frame, m.
const TIP: DVec3 = DVec3::new(-12e-3, 0.0, -14e-3);

impl Case {
    /// The case of a kind and number.
    pub fn new(kind: Kind, number: u64) -> Self {
        let mut random = Random::new(number.wrapping_mul(1_000_003).wrapping_add(kind as u64));
        // a cut right through touches along the whole height of the skin: the smallest grid is dear enough
        let (size, cells, layers) = random.pick(if kind == Kind::Through { &SKINS[..1] } else { &SKINS });
        let held: &[&str] = match kind {
            Kind::Straight => &["bottom", "sides"],
            Kind::Through => &["sides"],
            Kind::Any => random.pick(&[&["sides"] as &[&str], &["bottom", "sides"]]),
        };
        let taut = random.pick(&["0.0, 0.0", "0.05, 0.1"]);
        let boundary = |region: &&str| format!("[[boundary]]\nregion = \"{region}\"\n");
        let text = HEAD
            .replace("SPACING", if kind == Kind::Straight { "0.2" } else { "0.4" })
            .replace("SIZE", &size.to_string())
            .replace("CELLS", &cells.to_string())
            .replace("FAT", &layers[0].to_string())
            .replace("EPIDERMIS", &layers[2].to_string())
            .replace("DERMIS", &layers[1].to_string())
            .replace("TAUT", if kind == Kind::Through { "0.0, 0.0" } else { taut })
            .replace("HELD", &held.iter().map(boundary).collect::<String>());
        let files = Files::Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"));
        let mut scene = parse(&text, Path::new("scenes/random.toml"), &files).unwrap_or_else(|e| panic!("{e}"));
        let (path, name) = match kind {
            Kind::Straight => straight(&mut random, 1e-3 * size),
            Kind::Through => through(&mut random, 1e-3 * size),
            Kind::Any => any(&mut random, 1e-3 * size),
        };
        scene.time.duration = path.last().map_or(0.1, |pose| pose.time) + 0.02;
        scene.tools[0].trajectory = path;
        scene.view.frames = 0;
        Self { scene, kind, name: format!("{kind:?} {number}: {size} mm, {cells} x {cells} x {layers:?}, {name}") }
    }

    /// Links that the edge crosses where the hand takes it, raised by a height, m, through skin that does not give way.
    pub fn links_on_the_path(&self, raised: f64) -> usize {
        let model = Model::new(&self.scene, 0).unwrap_or_else(|e| panic!("{e}"));
        let links = links(&model.grid.params::<f64>());
        let centres: Vec<[f64; 4]> = cell_centres(&model).into_iter().map(|[x, y, z]| [x, y, z, 0.0]).collect();
        let still = vec![[0.0; 4]; centres.len()];
        let tool = Instrument::new(&self.scene.tools[0], [0.0; 3]);
        let edge = tool.edge.as_ref().map_or(&[][..], |edge| &edge.points);
        let steps = (self.scene.time.duration / self.scene.time.step).round() as usize;
        let at = |step: usize| {
            let (position, rotation) = tool.hand(step as f64 * self.scene.time.step);
            let swept = |p: &DVec3| (position + DVec3::Z * raised + rotation * *p).extend(0.0).to_array();
            edge.iter().map(swept).collect::<Vec<_>>()
        };
        let mut crossed = vec![false; links.len()];
        for step in 0..steps {
            let (old, new) = (at(step), at(step + 1));
            let quads = (1..edge.len()).flat_map(|k| [old[k - 1], old[k], new[k], new[k - 1]]);
            for hit in cut(&links, &centres, &still, &still, &quads.collect::<Vec<_>>()) {
                crossed[hit.segment as usize] = true;
            }
        }
        crossed.iter().filter(|c| **c).count()
    }

    /// Largest change that the hand's own motion makes of the coupling's force from one tick to the next, N.
    fn push_of_the_hand(&self) -> f64 {
        let tool = Instrument::new(&self.scene.tools[0], [0.0; 3]);
        let ticks = (self.scene.time.duration * TICKS) as usize;
        let velocity =
            |tick: usize| (tool.hand((tick + 1) as f64 / TICKS).0 - tool.hand(tick as f64 / TICKS).0) * TICKS;
        let push = |tick| {
            COUPLING * velocity(tick).length() / TICKS + DAMPING * (velocity(tick) - velocity(tick + 1)).length()
        };
        (0..ticks).map(push).fold(0.0, f64::max)
    }

    /// What is wrong with a run.
    pub fn faults(&self, report: &Report) -> Vec<String> {
        let mut faults = vec![];
        let mut bound = |what: &str, value: f64, most: f64| {
            if value > most || value.is_nan() {
                faults.push(format!("{what} {value:.3}, at most {most:.3}"));
            }
        };
        // three times toughness x edge, and what the hand's spring bears while the blade lags behind it
        bound("force N", report.contact_force_n_max, 3.0 * TOUGHNESS * EDGE + COUPLING * LAG);
        bound(
            "jump N",
            report.haptic.force_jump_n_max,
            0.5 + if self.kind == Kind::Straight { 0.0 } else { self.push_of_the_hand() },
        );
        bound("depth mm", report.contact.depth_mm_max, 1e3 * THICKNESS / 2.0);
        for (name, count) in &report.warnings {
            if !self.may_warn().contains(&name.as_str()) {
                faults.push(format!("warning {name} x {count}"));
            }
        }
        let severed = report.cut.links_severed;
        match self.kind {
            // skin gives way before it is cut, so the cut is less deep and less long than the path by as much
            Kind::Straight => {
                let (least, most) = (self.links_on_the_path(LAG), self.links_on_the_path(0.0));
                if (severed as f64) < 0.9 * least as f64 - 1.0 || severed as f64 > 1.1 * most as f64 + 1.0 {
                    faults.push(format!("{severed} links severed, {least} to {most} crossed"));
                }
            }
            Kind::Through if report.cut.pieces.unwrap_or(0) < 2 => {
                faults.push(format!("one piece, {severed} links severed"))
            }
            _ => {}
        }
        faults
    }

    /// Warnings that a run may end with. A blade right through a free border, or on a wild path, drags flaps along and turns their cells inside
    /// out; what is inside such a cell says nothing, and contacts with it are left out and counted.
    fn may_warn(&self) -> &[&str] {
        match self.kind {
            Kind::Straight => &[],
            Kind::Through | Kind::Any => &["contacts_unexplained", "cut_reserve_exhausted", "inverted_cells"],
        }
    }

    /// Runs it on the CPU path.
    ///
    /// # Errors
    /// As [`run`].
    pub fn run(&self, platform: Platform, out: &Path) -> Result<Report> {
        let options = Options::new(platform, out);
        Ok(run(&self.scene, &options, &mut |_| ())?.report)
    }
}

/// A pose with the tip at a position, the blade turned about the vertical.
fn pose(time: f64, tip: DVec3, rotation: DQuat) -> Pose {
    Pose { time, position: (tip - rotation * TIP).to_array(), rotation: rotation.to_array() }
}

fn straight(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let yaw = random.between(0.0, std::f64::consts::TAU);
    let rotation = DQuat::from_rotation_z(yaw);
    let (speed, depth) = (random.between(0.02, 0.08), random.between(0.7e-3, 1.5e-3));
    let length = random.between(0.2, 0.4) * size;
    let room = 0.35 * size - 0.5 * length;
    let middle = DVec3::new(random.between(-room, room), random.between(-room, room), 0.0);
    let ahead = rotation * DVec3::X;
    let [from, to] = [-0.5, 0.5].map(|s| middle + ahead * (s * length));
    let (above, below) = (DVec3::Z * (THICK + 0.5e-3), DVec3::Z * (THICK - depth));
    let down = (above.z - below.z) / speed.min(0.03);
    let across = down + length / speed;
    let poses = vec![
        pose(0.0, from + above, rotation),
        pose(down, from + below, rotation),
        pose(across, to + below, rotation),
        pose(across + 0.1, to + above + DVec3::Z * 1e-3, rotation),
    ];
    let name = format!(
        "yaw {:.1} deg, {:.1} mm/s, {:.2} mm long, {:.2} mm deep",
        yaw.to_degrees(),
        speed * 1e3,
        length * 1e3,
        depth * 1e3
    );
    (poses, name)
}

fn through(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let along_x = random.between(0.0, 1.0) < 0.5;
    let yaw = if along_x { 0.0 } else { std::f64::consts::FRAC_PI_2 } + random.between(-0.1, 0.1);
    let rotation = DQuat::from_rotation_z(yaw);
    let speed = random.between(0.02, 0.08);
    let ahead = rotation * DVec3::X;
    let aside = DVec3::Z.cross(ahead);
    let middle = aside * random.between(-0.2, 0.2) * size;
    // the whole edge, 4 mm high, passes the whole skin: in from beside it and out on the other side
    let reach = 0.5 * size + 4.5e-3;
    let low = DVec3::Z * random.between(-1.2e-3, -0.5e-3);
    let poses = vec![
        pose(0.0, middle - ahead * reach + low, rotation),
        pose(2.0 * reach / speed, middle + ahead * reach + low, rotation),
    ];
    (
        poses,
        format!(
            "yaw {:.1} deg, {:.1} mm/s, tip {:.2} mm under the bottom",
            yaw.to_degrees(),
            speed * 1e3,
            -low.z * 1e3
        ),
    )
}

fn any(random: &mut Random, size: f64) -> (Vec<Pose>, String) {
    let speed = random.between(0.02, 0.2);
    let mut poses = vec![];
    let mut time = 0.0;
    let mut last: Option<DVec3> = None;
    let yaw = random.between(0.0, std::f64::consts::TAU);
    for _ in 0..8 {
        let mut side = || random.between(-0.7, 0.7) * size;
        let tip = DVec3::new(side(), side(), random.between(0.0, 2.0 * THICK));
        let tilt = DVec3::new(random.between(-0.5, 0.5), random.between(-0.5, 0.5), yaw + random.between(-0.7, 0.7));
        let rotation = DQuat::from_rotation_z(tilt.z) * DQuat::from_rotation_y(tilt.y) * DQuat::from_rotation_x(tilt.x);
        time += last.map_or(0.0, |from| from.distance(tip) / speed);
        last = Some(tip);
        poses.push(pose(time, tip, rotation));
    }
    // no longer than it takes to see what happens
    poses.retain(|pose| pose.time < 0.6);
    (poses, format!("{:.1} mm/s", speed * 1e3))
}
