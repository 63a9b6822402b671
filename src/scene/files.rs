//! Files named by a scene, and the trajectories (CSV) among them.

use super::Pose;
use super::invalid::{Invalid, Location, Result};
use super::limits::free;
use super::raw::At;
use super::raw::MM;
use super::text::{SceneText, shorten};
use crate::formats::{self, Format, Mesh};
use crate::math::elementary::hypot;
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

/// Header of a trajectory; the quaternion has its scalar last.
const HEADER: &str = "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw";
/// Columns of a trajectory.
pub const COLUMNS: [&str; 8] = ["time_s", "x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"];
/// Force columns of a recording; they may follow, and are ignored.
pub const FORCE_COLUMNS: [&str; 6] =
    ["force_x_n", "force_y_n", "force_z_n", "torque_x_n_mm", "torque_y_n_mm", "torque_z_n_mm"];
/// Tolerance of a quaternion's length: two printed digits pass, a wrong column order rarely does.
const QUATERNION_SLACK: f64 = 0.01;

/// Largest coordinate of a path, mm: 1 km from the origin single precision has steps of 0.06 mm, and no hand is there.
const FARTHEST: f64 = 1e6;
/// Memory that a text takes while it is read, bytes per byte of the file, as measured of the worst texts (lists of one-digit numbers, short
/// rows): TOML with its tokens, which takes 58, and tables of numbers and meshes. Less is free, and the reader is aborted.
const PER_BYTE_OF_TOML: u64 = 80;
const PER_BYTE: u64 = 16;

/// Source of the files that a scene names.
#[derive(Clone, Debug)]
pub enum Files {
    /// Folder of the scene file; names are relative to it.
    Folder(PathBuf),
    /// Names and texts of files embedded in the program.
    Embedded(&'static [(&'static str, &'static str)]),
}

impl Files {
    /// Path (for messages) and text of the file that `key` names.
    pub(super) fn text(
        &self,
        scene: &SceneText,
        key: &'static str,
        name: &At<String>,
    ) -> Result<(PathBuf, Cow<'static, str>)> {
        let (path, text, fix) = match self {
            Files::Folder(folder) => {
                let path = folder.join(name.get_ref());
                let text = text_of(&path, PER_BYTE).map(Cow::Owned);
                (path, text, "put the file there: names are relative to the scene's folder")
            }
            Files::Embedded(files) => {
                let found = files.iter().find(|(known, _)| known == name.get_ref());
                let text = found.map(|(_, text)| Cow::Borrowed(*text));
                let text = text.ok_or_else(|| "no such file inside the program".to_string());
                (PathBuf::from(name.get_ref()), text, "name one of the built-in files")
            }
        };
        match text {
            Ok(text) => Ok((path, text)),
            Err(reason) => Err(Invalid::File { at: scene.location(name.span()), key, path, reason, fix }),
        }
    }
}

impl Files {
    /// Path (for messages) and mesh of the file that the body's key `mesh` names.
    pub(super) fn mesh(&self, scene: &SceneText, name: &At<String>) -> Result<(PathBuf, Mesh)> {
        if let Files::Folder(folder) = self {
            let path = folder.join(name.get_ref());
            let fix = "put the file there: names are relative to the scene's folder";
            let refuse = |reason| Invalid::File {
                at: scene.location(name.span()),
                key: "mesh",
                path: path.clone(),
                reason,
                fix,
            };
            let size = std::fs::metadata(&path).map_err(|error| refuse(error.to_string()))?.len();
            fits(size, PER_BYTE).map_err(refuse)?;
            let mesh = formats::read(&path, &mut |_| {}).map_err(Invalid::Mesh)?;
            return Ok((path, mesh));
        }
        let (path, text) = self.text(scene, "mesh", name)?;
        let format = Format::of(&path).map_err(Invalid::Mesh)?;
        let mesh = formats::parse(text.as_bytes(), format, &path, &mut |_| {}).map_err(Invalid::Mesh)?;
        Ok((path, mesh))
    }
}

/// Why a file of `size` bytes, of which each takes `per_byte`, does not fit into memory.
fn fits(size: u64, per_byte: u64) -> std::result::Result<(), String> {
    let Some(free) = free().filter(|free| size.saturating_mul(per_byte) > *free) else { return Ok(()) };
    let [size, wanted, free] = [size, size.saturating_mul(per_byte), free].map(|bytes| bytes as f64 * 1e-6);
    Err(format!(
        "its {size:.1} MB may take {wanted:.0} MB of memory to read, and {free:.0} MB are free; split it or leave rows out, or close what \
         takes memory"
    ))
}

/// Text of a scene file, as [`text_of`].
pub(super) fn toml_of(path: &Path) -> std::result::Result<String, String> {
    text_of(path, PER_BYTE_OF_TOML)
}

/// Text of a file, or why there is none: only files have an end, only UTF-8 is read, and only what fits into memory, of which each byte
/// takes `per_byte`.
fn text_of(path: &Path, per_byte: u64) -> std::result::Result<String, String> {
    let size = std::fs::metadata(path).map_or(0, |found| if found.is_file() { found.len() } else { 0 });
    fits(size, per_byte)?;
    let bytes = bytes_of(path).map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + good.iter().filter(|byte| **byte == b'\n').count();
        let begin = good.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        // what stands before the bad byte is text
        let column = 1 + String::from_utf8_lossy(&good[begin..]).chars().count();
        let byte = error.as_bytes()[good.len()];
        let guess = if error.as_bytes().starts_with(&[0xff, 0xfe]) { "utf-16" } else { "latin1" };
        format!(
            "not UTF-8: the byte 0x{byte:02x} in line {line}, column {column}; save it as UTF-8, or convert it with \
             `iconv -f {guess} -t utf-8`"
        )
    })
}

/// Bytes of a file; pipes and devices, which may have no end, are refused.
pub(crate) fn bytes_of(path: &Path) -> io::Result<Vec<u8>> {
    match std::fs::metadata(path)? {
        found if found.is_file() => std::fs::read(path),
        found if found.is_dir() => Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")),
        _ => Err(io::Error::other("it is a pipe or a device; save what it gives in a file")),
    }
}

/// Samples of a hand path, at least one, in ascending order of times, quaternions of length 1. Blank lines are skipped.
pub(super) fn trajectory(text: &str, path: &Path) -> Result<Vec<Pose>> {
    let text = text.trim_start_matches('\u{feff}');
    let lines = text.lines().enumerate();
    let mut lines = lines.map(|(i, line)| (Location::new(path, i + 1), line.trim()));
    let empty = || Invalid::TrajectoryEmpty { path: path.to_path_buf(), header: HEADER };
    let (at, header) = lines.find(|(_, line)| !line.is_empty()).ok_or_else(empty)?;
    let words = || header.split(',').map(str::trim);
    let with_forces = words().eq(COLUMNS.into_iter().chain(FORCE_COLUMNS));
    if !with_forces && !words().eq(COLUMNS) {
        return Err(Invalid::TrajectoryHeader { at, found: shorten(header), wanted: HEADER });
    }
    let mut poses: Vec<Pose> = Vec::new();
    for (at, line) in lines.filter(|(_, line)| !line.is_empty()) {
        let pose = pose(&at, line, with_forces)?;
        if let Some(before) = poses.last().filter(|before| before.time >= pose.time) {
            return Err(Invalid::TrajectoryTime { at, found: pose.time, before: before.time });
        }
        poses.push(pose);
    }
    if poses.is_empty() {
        return Err(empty());
    }
    Ok(poses)
}

fn pose(at: &Location, line: &str, with_forces: bool) -> Result<Pose> {
    let found = line.split(',').count();
    let wanted = if with_forces { COLUMNS.len() + FORCE_COLUMNS.len() } else { COLUMNS.len() };
    if found != wanted {
        return Err(Invalid::TrajectoryColumns { at: at.clone(), found, wanted, header: HEADER });
    }
    let mut row = [0.0; COLUMNS.len()];
    for ((number, cell), column) in row.iter_mut().zip(line.split(',')).zip(COLUMNS) {
        let parsed = cell.trim().parse::<f64>().ok();
        *number = parsed.filter(|value| value.is_finite()).ok_or_else(|| Invalid::TrajectoryNumber {
            at: at.clone(),
            column,
            found: shorten(cell.trim()),
        })?;
    }
    let [time, x, y, z, qx, qy, qz, qw] = row;
    let far = [x, y, z].into_iter().zip(&COLUMNS[1..]).find(|(found, _)| found.abs() > FARTHEST);
    if let Some((found, column)) = far {
        return Err(Invalid::TrajectoryFar { at: at.clone(), column, found, most: FARTHEST });
    }
    let length = hypot(hypot(hypot(qx, qy), qz), qw);
    if (length - 1.0).abs() > QUATERNION_SLACK {
        return Err(Invalid::TrajectoryRotation { at: at.clone(), length, allowed: QUATERNION_SLACK });
    }
    Ok(Pose {
        time,
        position: [x, y, z].map(|coordinate| coordinate / MM.per),
        rotation: [qx, qy, qz, qw].map(|part| part / length),
    })
}
