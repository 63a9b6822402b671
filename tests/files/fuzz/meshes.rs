//! Mesh files of every format, with changed lines, numbers and bytes: each is refused with words, or taken and examined.

use super::bounds::{TO_READ, bounded, count, mends, tried};
use super::change::{Change, change, changed};
use crate::samples::FORMS;
use cutis::formats::{Format, parse};
use cutis::report::mesh;
use proptest::collection::vec;
use proptest::prelude::*;
use std::path::Path;
use std::sync::LazyLock;

/// Lines that one format or another knows.
static LINES: LazyLock<Vec<String>> = LazyLock::new(|| {
    let texts = FORMS.iter().filter_map(|(_, bytes)| std::str::from_utf8(bytes).ok());
    let mut lines: Vec<String> = texts.flat_map(str::lines).map(String::from).collect();
    lines.extend(
        ["$Nodes", "CELLS 4294967295 4294967296", "$PartitionedEntities", "1 4 99 0", "3 1 2", ""].map(String::from),
    );
    lines
});

/// A change of bytes; positions count around.
#[derive(Clone, Debug)]
enum Bytes {
    /// One is another.
    Set(usize, u8),
    /// Eight are a number, little or big.
    Number(usize, u64, bool),
    /// The file ends.
    End(usize),
    /// Some go.
    Drop(usize, usize),
    /// Some are copied to another position.
    Copy(usize, usize, usize),
}

fn bytes() -> impl Strategy<Value = Bytes> {
    let at = || any::<u32>().prop_map(|n| n as usize);
    let numbers =
        prop::sample::select(&[0, 1, 255, 1 << 16, 1 << 31, u32::MAX as u64, 1 << 32, 1 << 40, 1 << 63, u64::MAX][..]);
    prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(at, byte)| Bytes::Set(at, byte)),
        4 => (at(), numbers, any::<bool>()).prop_map(|(at, number, big)| Bytes::Number(at, number, big)),
        1 => at().prop_map(Bytes::End),
        1 => (at(), 1..20usize).prop_map(|(at, count)| Bytes::Drop(at, count)),
        1 => (at(), at(), 1..20usize).prop_map(|(from, to, count)| Bytes::Copy(from, to, count)),
    ]
}

fn with_bytes(bytes: &[u8], changes: &[Bytes]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for change in changes {
        let length = out.len();
        match *change {
            _ if length == 0 => {}
            Bytes::Set(at, byte) => out[at % length] = byte,
            Bytes::Number(at, number, big) => {
                let bytes = if big { number.to_be_bytes() } else { number.to_le_bytes() };
                let at = at % length;
                bytes.iter().zip(&mut out[at..]).for_each(|(byte, old)| *old = *byte);
            }
            Bytes::End(at) => out.truncate(at % length),
            Bytes::Drop(at, count) => drop(out.drain(at % length..(at % length + count).min(length))),
            Bytes::Copy(from, to, count) => {
                let part = out[from % length..(from % length + count).min(length)].to_vec();
                let to = to % length;
                out.splice(to..to, part);
            }
        }
    }
    out
}

/// Reads it, and examines and mends what it gives.
fn holds(bytes: &[u8], format: Format, name: &str) -> Result<(), String> {
    let read = bounded(TO_READ, || parse(bytes, format, Path::new(name), &mut |_| {}))?;
    match read {
        Ok(found) => bounded(TO_READ, || drop((mesh::summary(&found), mesh::summary(&mesh::mended(&found))))),
        Err(error) => mends(&error.to_string(), name),
    }
}

/// Changes of the forms of one format.
fn changed_forms(format: Format) {
    let forms: Vec<(&str, &[u8])> = FORMS
        .iter()
        .filter(|(name, _)| name.ends_with(&format!(".{}", format.ending())))
        .map(|(name, bytes)| (*name, &bytes[..]))
        .collect();
    assert!(!forms.is_empty());
    let inputs: (_, _, _) = (0..forms.len(), vec(change(&LINES), 0..4), vec(bytes(), 0..4));
    tried(count(1), inputs, |(which, lines, more): &(usize, Vec<Change>, Vec<Bytes>)| {
        let (name, bytes) = forms[*which];
        let text = std::str::from_utf8(bytes).map(|text| changed(text, lines).into_bytes());
        holds(&with_bytes(&text.unwrap_or_else(|_| bytes.to_vec()), more), format, name)
    });
}

#[test]
fn changed_gmsh_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Msh);
}

#[test]
fn changed_legacy_vtk_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Vtk);
}

#[test]
fn changed_vtu_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Vtu);
}

#[test]
fn changed_obj_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Obj);
}

#[test]
fn changed_stl_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Stl);
}

#[test]
fn changed_ply_meshes_are_refused_with_words_or_examined() {
    changed_forms(Format::Ply);
}
