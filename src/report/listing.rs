//! Folder of results, locked while a command writes to it, with a list of the files that this program wrote there.
//!
//! The list, `cutis-files.txt`, has one name a line. A name is added before its file is written, so that also a killed run's files are on
//! it: the next run removes those and no others, and refuses to write over a file that is not on it. The lock is the system's, on the
//! list; it ends with the process.

use super::Refused;
use crate::error::Result;
use crate::output::Failed;
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Name of the list.
const LIST: &str = "cutis-files.txt";
/// Its first line, by which it is known.
const HEAD: &str = "# Files that cutis has written here, and may replace or remove; it leaves all others alone.\n";
/// End of the name of a file that is being written.
const UNFINISHED: &str = ".tmp";

/// See the module.
pub struct Listing {
    folder: PathBuf,
    file: File,
    /// Names relative to the folder, with `/` in them.
    names: BTreeSet<String>,
    /// The folder was not there before.
    made: bool,
}

impl Listing {
    /// Locks a folder, which is made if it is missing, and tries what is to be written there: the `wanted` names, in the folder itself
    /// and in `inside`, the folders in it.
    ///
    /// # Errors
    /// If the folders cannot be written to, if another command writes there, and if a file that is not on the list has a wanted name.
    pub fn open(folder: &Path, inside: &[&str], wanted: impl Fn(&str) -> bool) -> Result<Self> {
        let made = !folder.exists();
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        let path = folder.join(LIST);
        let opened = File::options().read(true).append(true).create(true).open(&path);
        let mut file = opened.map_err(failed(&path))?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => Refused::Locked { path: folder.to_owned() }.into(),
            TryLockError::Error(source) => failed(&path)(source),
        })?;
        let mut bytes = vec![];
        file.read_to_end(&mut bytes).map_err(failed(&path))?;
        let text = String::from_utf8_lossy(&bytes);
        match text.strip_prefix(HEAD) {
            Some(names) if names.is_empty() || names.ends_with('\n') => {}
            // a killed run, or a full disk, has cut the last line or the first one short
            Some(_) => file.write_all(b"\n").map_err(failed(&path))?,
            None if HEAD.starts_with(&*text) => {
                file.write_all(&HEAD.as_bytes()[text.len()..]).map_err(failed(&path))?;
            }
            None => return Err(Refused::Foreign { path }.into()),
        }
        let names = text.lines().skip(1).map(String::from).collect();
        let listing = Self { folder: folder.to_owned(), file, names, made };
        listing.attempt("", &wanted)?;
        inside.iter().try_for_each(|name| listing.attempt(&format!("{name}/"), &wanted))?;
        Ok(listing)
    }

    /// Tries one folder: that files can be made in it, and that no file of somebody else has a wanted name.
    fn attempt(&self, inside: &str, wanted: &impl Fn(&str) -> bool) -> Result<()> {
        let folder = self.folder.join(inside.trim_end_matches('/'));
        let entries = match std::fs::read_dir(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            entries => entries.map_err(failed(&folder))?,
        };
        for entry in entries {
            let entry = entry.map_err(failed(&folder))?;
            let Some(name) = entry.file_name().to_str().map(|name| format!("{inside}{name}")) else { continue };
            let finished = name.strip_suffix(UNFINISHED).unwrap_or(&name);
            let is_file = entry.file_type().map_err(failed(&entry.path()))?.is_file();
            if wanted(finished) && !(is_file && self.names.contains(finished)) {
                return Err(Refused::Foreign { path: entry.path() }.into());
            }
        }
        let probe = folder.join(format!("{LIST}{UNFINISHED}"));
        File::create(&probe).map_err(failed(&folder))?;
        std::fs::remove_file(&probe).map_err(failed(&probe))
    }

    /// Path of a file.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Adds a file that is to be written; returns its path.
    pub fn add(&mut self, name: &str) -> Result<PathBuf> {
        if !self.names.contains(name) {
            let list = self.folder.join(LIST);
            self.file.write_all(format!("{name}\n").as_bytes()).map_err(failed(&list))?;
            self.names.insert(name.into());
        }
        let path = self.folder.join(name);
        let folder = path.parent().unwrap_or(&self.folder);
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        Ok(path)
    }

    /// Removes files on the list that `gone` picks, in the order of their names: `.pvd` files go before the `vtu` that they name.
    pub fn remove(&mut self, gone: impl Fn(&str) -> bool) -> Result<()> {
        let (gone, names): (BTreeSet<_>, BTreeSet<_>) =
            std::mem::take(&mut self.names).into_iter().partition(|name| gone(name));
        self.names = names;
        for name in &gone {
            remove(&self.folder.join(name))?;
            remove(&self.folder.join(format!("{name}{UNFINISHED}")))?;
        }
        // written before it is cut, so that a run killed here leaves names too many and none too few
        let left = self.names.iter().fold(HEAD.to_string(), |text, name| text + name + "\n");
        let list = self.folder.join(LIST);
        let mut file = File::options().write(true).open(&list).map_err(failed(&list))?;
        let written = file.rewind().and_then(|()| file.write_all(left.as_bytes()));
        written.and_then(|()| file.set_len(left.len() as u64)).map_err(failed(&list))
    }
}

impl Drop for Listing {
    /// Leaves nothing behind where nothing was written.
    fn drop(&mut self) {
        if self.made && self.names.is_empty() {
            std::fs::remove_file(self.folder.join(LIST)).ok();
            std::fs::remove_dir(&self.folder).ok();
        }
    }
}

/// Removes a file if it is there.
pub(super) fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(failed(path)(error)),
        _ => Ok(()),
    }
}

fn failed(path: &Path) -> impl Fn(io::Error) -> crate::error::Error {
    move |source| Failed::Write { path: path.to_owned(), source }.into()
}
