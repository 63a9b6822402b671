//! Writes the recording of a device to `hand_TOOL.csv` during the run; a killed run leaves it up to the last flush.

use crate::error::Result;
use crate::haptic::devices::Row;
use crate::output::Table;
use crate::scene::{FORCE_COLUMNS, TRAJECTORY_COLUMNS};
use rtrb::Consumer;
use std::path::Path;

/// An open recording.
pub struct Recording {
    rows: Consumer<Row>,
    table: Table,
}

impl Recording {
    /// Creates or truncates the file at `path`; `rows` come from a [`Recorder`](crate::haptic::devices::Recorder).
    ///
    /// # Errors
    /// Here and in every method: if the file cannot be written.
    pub fn create(path: &Path, rows: Consumer<Row>) -> Result<Self> {
        let columns: Vec<&str> = TRAJECTORY_COLUMNS.iter().chain(&FORCE_COLUMNS).copied().collect();
        Ok(Self { rows, table: Table::create(path, &columns)? })
    }

    /// Writes the rows that have arrived.
    pub fn drain(&mut self) -> Result<()> {
        while let Ok(row) = self.rows.pop() {
            self.table.row(&row)?;
        }
        Ok(())
    }

    /// Writes the remaining rows and closes the file.
    pub fn finish(mut self) -> Result<()> {
        self.drain()?;
        self.table.finish()
    }
}
