//! The folder of a run: tables, meshes for ParaView, pictures, the report.
//!
//! ```text
//! report.json   probes.csv   solver.csv   energy.csv   contacts.csv   haptic.csv   hand_TOOL.csv   checkpoint.bin   cutis-files.txt
//! volume.pvd   surface.pvd   tools.pvd   contacts.pvd   frames/frame_0001.png …   vtu/volume_0001.vtu …   vtu/surface_0001.vtu …   vtu/tools_0001.vtu …
//! vtu/contacts_0001.vtu …   surface/surface_0001.glb …
//! ```
//! A killed run leaves every file readable; report.json is then that of the last picture. A run that ends with an error leaves the report
//! of the completed steps, including the error; `reserve.bin` keeps room for it on a disk that has none left.

use super::Report;
use super::frames::{Painter, SkinSurface};
use super::listing::{Listing, remove};
use super::meshes;
use super::plot;
use super::render;
use super::tables::{self, Marks, Tables};
use crate::backend::Snapshot;
use crate::error::Result;
use crate::output::{Failed, Series, replace};
use crate::scene::Scene;
use crate::step::{Simulation, StepReport};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Checkpoint file of a run.
pub(super) const CHECKPOINT: &str = "checkpoint.bin";

/// Folder of a running simulation.
pub(super) struct Folder {
    pub listing: Listing,
    pub tables: Tables,
    /// In the order of [`KINDS`].
    series: [Series; 4],
    frame_count: u32,
    /// From the first picture on.
    painter: Option<Painter>,
}

/// Positions in the files of a run.
#[derive(Serialize, Deserialize)]
pub(super) struct Written {
    tables: Marks,
    /// Number of pictures.
    frames: u32,
    /// Entries of the `.pvd` files, in the order of [`KINDS`].
    series: [String; 4],
}

/// Series of meshes: `KIND.pvd` and `vtu/KIND_0001.vtu` ….
const KINDS: [&str; 4] = ["volume", "surface", "tools", "contacts"];

/// Empty series in a folder.
fn series(listing: &Listing) -> [Series; 4] {
    KINDS.map(|kind| Series::new(listing.path(&format!("{kind}.pvd"))))
}

/// Files of a run that have no number.
const FIXED: [&str; 12] = [
    CHECKPOINT,
    "report.json",
    RESERVE,
    tables::PROBES,
    tables::SOLVER,
    tables::ENERGY,
    tables::CONTACTS,
    "haptic.csv",
    "volume.pvd",
    "surface.pvd",
    "tools.pvd",
    "contacts.pvd",
];
/// Room kept for the report.
const RESERVE: &str = "reserve.bin";
/// Size of the reserve, bytes, beside twice that of the report before the first step: four blocks of a common file system.
const RESERVE_BYTES: usize = 16384;

/// Number in the name of a picture or a mesh.
fn number(name: &str) -> Option<u32> {
    let families = [
        ("frames/frame_", ".png"),
        ("vtu/volume_", ".vtu"),
        ("vtu/surface_", ".vtu"),
        ("vtu/tools_", ".vtu"),
        ("vtu/contacts_", ".vtu"),
        ("surface/surface_", ".glb"),
        ("surface/surface_", ".obj"),
        ("surface/surface_", ".stl"),
    ];
    let digits = families.iter().find_map(|(start, end)| name.strip_prefix(start)?.strip_suffix(end))?;
    let plain = digits.len() >= 4 && digits.bytes().all(|b| b.is_ascii_digit());
    if plain { digits.parse().ok() } else { None }
}

/// Whether a run writes files of this name.
fn of_runs(name: &str) -> bool {
    FIXED.contains(&name)
        || number(name).is_some()
        || plot::is_plot(name)
        || render::is_rendered(name)
        || (name.starts_with("hand_") && name.ends_with(".csv"))
}

/// Opens the folder of a run, before anything is computed: tries the names of all files that it will have, `more` beside the usual ones.
///
/// # Errors
/// As [`Listing::open`].
pub(super) fn open(path: &Path, frames: u32, more: &[String]) -> Result<Listing> {
    let wanted = |name: &str| {
        FIXED.contains(&name) || more.iter().any(|more| more == name) || number(name).is_some_and(|n| n <= frames)
    };
    Listing::open(path, &["frames", "vtu", "surface"], wanted)
}

impl Folder {
    /// Removes the files of an earlier run and starts the tables.
    pub fn create(mut listing: Listing, scene: &Scene) -> Result<Self> {
        listing.remove(of_runs)?;
        let tables = Tables::create(&mut listing, scene)?;
        Ok(Self { tables, series: series(&listing), frame_count: 0, painter: None, listing })
    }

    /// Checks that a folder belongs to the run with these positions.
    pub fn verify(path: &Path, scene: &Scene, written: &Written) -> Result<()> {
        Tables::verify(path, scene, &written.tables)
    }

    /// Continues in the folder of a run; removes what it wrote later.
    pub fn reopen(mut listing: Listing, scene: &Scene, written: &Written) -> Result<Self> {
        listing.remove(|name| number(name).is_some_and(|number| number > written.frames))?;
        let mut folder = Self {
            tables: Tables::reopen(&mut listing, scene, &written.tables)?,
            series: series(&listing),
            frame_count: written.frames,
            painter: None,
            listing,
        };
        for (series, entries) in folder.series.iter_mut().zip(&written.series) {
            series.resume(entries.clone())?;
        }
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
            tables: self.tables.marks()?,
            frames: self.frame_count,
            series: self.series.each_ref().map(|series| series.entries().into()),
        })
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
        let fields = meshes::CellFields::new(scene, simulation, state);
        let picture = self.listing.add(&format!("frames/frame_{number:04}.png"))?;
        let painter = self.painter.get_or_insert_with(|| Painter::new(scene, simulation));
        painter.write(scene, simulation, &skin, step, &picture)?;
        for (series, kind) in self.series.iter_mut().zip(KINDS) {
            let is_there = match kind {
                "tools" => scene.tools.iter().any(|tool| !tool.mesh.triangles.is_empty()),
                "contacts" => scene.contact.is_some(),
                _ => true,
            };
            if !is_there {
                continue;
            }
            let name = format!("vtu/{kind}_{number:04}.vtu");
            let path = self.listing.add(&name)?;
            match kind {
                "volume" => meshes::write_volume(&path, simulation, state, &fields)?,
                "surface" => meshes::write_surface(&path, scene, &skin, &fields)?,
                "tools" => meshes::write_tools(&path, scene, simulation)?,
                _ => meshes::write_contacts(&path, step)?,
            }
            self.listing.add(&format!("{kind}.pvd"))?;
            series.add(step.time, &name)?;
        }
        for format in &scene.output.surfaces {
            let path = self.listing.add(&format!("surface/surface_{number:04}.{}", format.ending()))?;
            meshes::write_format(&path, *format, scene, simulation, &skin)?;
        }
        Ok(())
    }

    /// Writes report.json.
    pub fn write_report(&mut self, report: &Report) -> Result<()> {
        let path = self.listing.add("report.json")?;
        replace(&path, text(&path, report)?.as_bytes())
    }

    /// Closes the tables; returns the number of pictures.
    pub fn finish(self) -> Result<u32> {
        self.release()?;
        self.tables.finish()?;
        Ok(self.frame_count)
    }
}

/// Text of report.json.
fn text(path: &Path, report: &Report) -> Result<String> {
    let text = serde_json::to_string_pretty(report);
    Ok(text.map_err(|e| Failed::Write { path: path.to_owned(), source: e.into() })? + "\n")
}
