//! The folder of a run: tables, meshes for ParaView, pictures, the report.
//!
//! ```text
//! report.json   probes.csv   energy.csv   haptic.csv   hand_TOOL.csv   volume.pvd   surface.pvd   checkpoint.bin   cutis-files.txt
//! frames/frame_0001.png …    vtu/volume_0001.vtu …     vtu/surface_0001.vtu …
//! ```
//! A killed run leaves every file readable; report.json is then that of the last picture. A run that ends with an error leaves the report
//! of the completed steps, including the error; `reserve.bin` keeps room for it on a disk that has none left.

use super::Report;
use super::frames::{self, SkinSurface};
use super::listing::{Listing, remove};
use crate::backend::Snapshot;
use crate::error::Result;
use crate::mesh::Unstructured;
use crate::output::{Failed, Field, Series, Table, TableMark, replace, write_solids, write_triangles};
use crate::scene::{FIXED_COLUMNS, Probe, Scene};
use crate::step::{Measured, Simulation, StepReport};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Checkpoint file of a run.
pub(super) const CHECKPOINT: &str = "checkpoint.bin";

/// Folder of a running simulation.
pub(super) struct Folder {
    pub listing: Listing,
    probes: Table,
    energy: Table,
    /// Time of the last row of `energy`, s; NaN before one.
    measured: f64,
    contact: bool,
    volume: Series,
    surface: Series,
    frame_count: u32,
}

/// Positions in the files of a run.
#[derive(Serialize, Deserialize)]
pub(super) struct Written {
    probes: TableMark,
    energy: TableMark,
    /// Number of pictures.
    frames: u32,
    /// Entries of the `.pvd` files.
    volume: String,
    surface: String,
}

/// Columns of `probes.csv`.
fn columns(scene: &Scene) -> Vec<String> {
    let [first, last @ ..] = FIXED_COLUMNS;
    let mut columns = vec![first.to_string()];
    columns.extend(scene.probes.iter().map(Probe::column));
    if scene.contact.is_some() {
        columns.extend(last.map(String::from));
    }
    columns
}

/// Columns of `energy.csv`: the state at a checked step's start, then work and dissipation until there ([`crate::step::Booked`]).
const ENERGY: [&str; 10] = [
    "time_s",
    "kinetic_j",
    "elastic_j",
    "potential_j",
    "work_loads_j",
    "work_hands_j",
    "work_overlaps_j",
    "friction_j",
    "cutting_j",
    "impact_j",
];

/// Files of a run that have no number.
const FIXED: [&str; 8] =
    [CHECKPOINT, "report.json", RESERVE, "probes.csv", "energy.csv", "haptic.csv", "volume.pvd", "surface.pvd"];
/// Room kept for the report.
const RESERVE: &str = "reserve.bin";
/// Size of the reserve, bytes, beside twice that of the report before the first step: four blocks of a common file system.
const RESERVE_BYTES: usize = 16384;

/// Number in the name of a picture or a mesh.
fn number(name: &str) -> Option<u32> {
    let families = [("frames/frame_", ".png"), ("vtu/volume_", ".vtu"), ("vtu/surface_", ".vtu")];
    let digits = families.iter().find_map(|(start, end)| name.strip_prefix(start)?.strip_suffix(end))?;
    let plain = digits.len() >= 4 && digits.bytes().all(|b| b.is_ascii_digit());
    if plain { digits.parse().ok() } else { None }
}

/// Whether a run writes files of this name.
fn of_runs(name: &str) -> bool {
    FIXED.contains(&name) || number(name).is_some() || (name.starts_with("hand_") && name.ends_with(".csv"))
}

/// Opens the folder of a run, before anything is computed: tries the names of all files that it will have, `more` beside the usual ones.
///
/// # Errors
/// As [`Listing::open`].
pub(super) fn open(path: &Path, frames: u32, more: &[String]) -> Result<Listing> {
    let wanted = |name: &str| {
        FIXED.contains(&name) || more.iter().any(|more| more == name) || number(name).is_some_and(|n| n <= frames)
    };
    Listing::open(path, &["frames", "vtu"], wanted)
}

impl Folder {
    /// Removes the files of an earlier run and starts the tables.
    pub fn create(mut listing: Listing, scene: &Scene) -> Result<Self> {
        listing.remove(of_runs)?;
        Ok(Self {
            probes: Table::create(&listing.add("probes.csv")?, &columns(scene))?,
            energy: Table::create(&listing.add("energy.csv")?, &ENERGY)?,
            measured: f64::NAN,
            contact: scene.contact.is_some(),
            volume: Series::new(listing.path("volume.pvd")),
            surface: Series::new(listing.path("surface.pvd")),
            frame_count: 0,
            listing,
        })
    }

    /// Checks that a folder belongs to the run with these positions.
    pub fn verify(path: &Path, scene: &Scene, written: &Written) -> Result<()> {
        Table::verify(&path.join("probes.csv"), &columns(scene), written.probes)?;
        Table::verify(&path.join("energy.csv"), &ENERGY, written.energy)
    }

    /// Continues in the folder of a run; removes what it wrote later.
    pub fn reopen(mut listing: Listing, scene: &Scene, written: &Written) -> Result<Self> {
        listing.remove(|name| number(name).is_some_and(|number| number > written.frames))?;
        let mut folder = Self {
            probes: Table::reopen(&listing.add("probes.csv")?, &columns(scene), written.probes)?,
            energy: Table::reopen(&listing.add("energy.csv")?, &ENERGY, written.energy)?,
            measured: f64::NAN,
            contact: scene.contact.is_some(),
            volume: Series::new(listing.path("volume.pvd")),
            surface: Series::new(listing.path("surface.pvd")),
            frame_count: written.frames,
            listing,
        };
        folder.volume.resume(written.volume.clone())?;
        folder.surface.resume(written.surface.clone())?;
        Ok(folder)
    }

    /// Keeps room for a report of twice this size, for a disk that is full at the end.
    pub fn reserve(&mut self, report: &Report) -> Result<()> {
        let path = self.listing.add(RESERVE)?;
        replace(&path, &vec![0; RESERVE_BYTES + 2 * text(&path, report)?.len()])
    }

    /// Gives that room up.
    pub fn release(&self) -> Result<()> {
        remove(&self.listing.path(RESERVE))
    }

    /// Positions so far, with all rows flushed.
    pub fn written(&mut self) -> Result<Written> {
        Ok(Written {
            probes: self.probes.kept()?,
            energy: self.energy.kept()?,
            frames: self.frame_count,
            volume: self.volume.entries().into(),
            surface: self.surface.entries().into(),
        })
    }

    /// Adds a row to `probes.csv`.
    pub fn add_step(&mut self, step: &StepReport) -> Result<()> {
        let mut row = vec![step.time];
        row.extend(&step.probes);
        if self.contact {
            let force = step.contact.largest_on_tools();
            row.extend([step.contact.count() as f64, force, f64::from(step.severed)]);
        }
        self.probes.row(&row)?;
        self.probes.flush() // a step takes milliseconds, a flush microseconds
    }

    /// Adds a row to `energy.csv`, one per time.
    pub fn add_energy(&mut self, measured: &Measured) -> Result<()> {
        if std::mem::replace(&mut self.measured, measured.time) == measured.time {
            return Ok(());
        }
        let Measured { time, energy, booked, .. } = measured;
        let now = [*time, energy.kinetic, energy.elastic, energy.potential];
        let done = [booked.loads, booked.hands, booked.overlap, booked.friction, booked.cutting, booked.impact];
        self.energy.row(&[&now[..], &done].concat())?;
        self.energy.flush()
    }

    /// Adds a picture and the meshes.
    pub fn add_frame(
        &mut self,
        scene: &Scene,
        simulation: &Simulation,
        state: &[Snapshot],
        step: &StepReport,
    ) -> Result<()> {
        self.frame_count += 1;
        let number = self.frame_count;
        let skin = SkinSurface::new(simulation, state);
        let picture = self.listing.add(&format!("frames/frame_{number:04}.png"))?;
        frames::write(scene, simulation, &skin, step, &picture)?;
        let volume = format!("vtu/volume_{number:04}.vtu");
        write_volume(&self.listing.add(&volume)?, simulation, state)?;
        self.listing.add("volume.pvd")?;
        self.volume.add(step.time, &volume)?;
        let surface = format!("vtu/surface_{number:04}.vtu");
        write_surface(&self.listing.add(&surface)?, &skin)?;
        self.listing.add("surface.pvd")?;
        self.surface.add(step.time, &surface)
    }

    /// Writes report.json.
    pub fn write_report(&mut self, report: &Report) -> Result<()> {
        let path = self.listing.add("report.json")?;
        replace(&path, text(&path, report)?.as_bytes())
    }

    /// Flushes all rows so far.
    pub fn flush(&mut self) -> Result<()> {
        self.probes.flush()?;
        self.energy.flush()
    }

    /// Closes the tables; returns the number of pictures.
    pub fn finish(self) -> Result<u32> {
        self.release()?;
        self.probes.finish()?;
        self.energy.finish()?;
        Ok(self.frame_count)
    }
}

/// Text of report.json.
fn text(path: &Path, report: &Report) -> Result<String> {
    let text = serde_json::to_string_pretty(report);
    Ok(text.map_err(|e| Failed::Write { path: path.to_owned(), source: e.into() })? + "\n")
}

/// Points kept in a file, and cells renumbered for them.
struct Kept {
    old: Vec<u32>, // in ascending order
}

impl Kept {
    fn of<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.old.iter().map(|n| values[*n as usize]).collect()
    }

    fn renumbered<const N: usize>(&self, cells: &[[u32; N]]) -> Vec<[u32; N]> {
        let new = |id: &u32| self.old.binary_search(id).expect("points of cells are kept") as u32;
        cells.iter().map(|cell| cell.each_ref().map(new)).collect()
    }
}

/// Remaining cells at displaced positions. Grid nodes without a remaining cell stay in the file, unused duplicates do not.
fn write_volume(path: &Path, simulation: &Simulation, state: &[Snapshot]) -> Result<()> {
    let (mut cells, mut layers, mut bodies, mut old) = (vec![], vec![], vec![], vec![]);
    let (mut tetrahedra, mut theirs) = (vec![], vec![]); // after the cells of all grids
    let mut first = 0;
    for (number, body) in simulation.bodies.iter().enumerate() {
        let surface = &body.wound.surface;
        for (layer, corners) in surface.live_cells() {
            cells.push(corners.map(|n| first + n as u32));
            layers.push(layer as f64);
            bodies.push(number as f64);
        }
        if let Some(Unstructured { mesh, .. }) = body.model.unstructured() {
            tetrahedra.extend(mesh.tetrahedra().iter().map(|corners| corners.map(|n| first + n)));
            theirs.extend(mesh.layers().iter().map(|layer| (f64::from(*layer), number as f64)));
        }
        let count = body.model.node_count();
        old.extend((0..count).filter(|node| surface.parts.in_use(*node)).map(|node| first + node as u32));
        first += count as u32;
    }
    layers.extend(theirs.iter().map(|(layer, _)| *layer));
    bodies.extend(theirs.iter().map(|(_, body)| *body));
    let kept = Kept { old };
    write_solids(
        path,
        &kept.of(&frames::positions(simulation, state)),
        &kept.renumbered(&cells),
        &kept.renumbered(&tetrahedra),
        &[
            ("displacement_m", Field::Vectors(&kept.of(&frames::joined(state, |s| &s.u)))),
            ("velocity_m_s", Field::Vectors(&kept.of(&frames::joined(state, |s| &s.v)))),
        ],
        &[("layer", Field::Scalars(&layers)), ("body", Field::Scalars(&bodies))],
    )
}

/// The surface as drawn in the pictures; `wall` is 1 for a face made by a cut.
fn write_surface(path: &Path, surface: &SkinSurface) -> Result<()> {
    let SkinSurface { skin, walls, .. } = surface;
    let triangles = [&skin.triangles[..], &walls.triangles].concat();
    let mut old: Vec<u32> = triangles.as_flattened().to_vec();
    old.sort_unstable();
    old.dedup();
    let kept = Kept { old };
    let behind = || skin.layers.iter().chain(&walls.layers);
    let (bodies, layers): (Vec<f64>, Vec<f64>) =
        behind().map(|[body, layer]| (f64::from(*body), f64::from(*layer))).unzip();
    let wall: Vec<f64> = (0..triangles.len()).map(|t| f64::from(t >= skin.triangles.len())).collect();
    write_triangles(
        path,
        &kept.of(&surface.positions),
        &kept.renumbered(&triangles),
        &[
            ("displacement_m", Field::Vectors(&kept.of(&surface.displacements))),
            ("velocity_m_s", Field::Vectors(&kept.of(&surface.velocities))),
        ],
        &[("layer", Field::Scalars(&layers)), ("body", Field::Scalars(&bodies)), ("wall", Field::Scalars(&wall))],
    )
}
