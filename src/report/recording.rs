//! What a recorded device said and was given, into `hand_TOOL.csv` while the run goes on: a killed run leaves it up to the last flush.

use crate::error::Result;
use crate::haptic::replay::Row;
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
    /// Creates or empties the file at `path`; `rows` come from a [`Recorder`](crate::haptic::replay::Recorder).
    ///
    /// # Errors
    /// When it cannot be written, as all methods here.
    pub fn create(path: &Path, rows: Consumer<Row>) -> Result<Self> {
        let columns: Vec<&str> = TRAJECTORY_COLUMNS.iter().chain(&FORCE_COLUMNS).copied().collect();
        Ok(Self { rows, table: Table::create(path, &columns)? })
    }

    /// Writes down what has come meanwhile.
    pub fn drain(&mut self) -> Result<()> {
        while let Ok(row) = self.rows.pop() {
            self.table.row(&row)?;
        }
        Ok(())
    }

    /// Writes down the rest and closes the file.
    pub fn finish(mut self) -> Result<()> {
        self.drain()?;
        self.table.finish()
    }
}
