//! Reads the tables of a run (`.csv`) a row at a time, in memory that does not grow with them; what is no such table is told with its line.

use super::Refused;
use crate::error::Result;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line, bytes; a scene of a thousand probes has a tenth of it.
const LONGEST_LINE: u64 = 1 << 20;
/// First column of every table over time.
pub(super) const TIME: &str = "time_s";

/// An open table.
pub(super) struct Rows {
    path: PathBuf,
    file: BufReader<File>,
    /// Names of the columns.
    pub columns: Vec<String>,
    line: usize,
    cells: Vec<String>,
}

impl Rows {
    /// Opens a table over time; none where there is no such file.
    ///
    /// # Errors
    /// [`Refused::Table`] for a file that cannot be read or is no table over time.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(unread(path, &error)),
            Ok(file) => BufReader::new(file),
        };
        let mut rows = Self { path: path.to_owned(), file, columns: vec![], line: 0, cells: vec![] };
        if !rows.advance()? || rows.cells[0] != TIME {
            rows.line = 1;
            return Err(rows.refuse("no table of a run".into(), "a first line that begins with the column time_s"));
        }
        rows.columns.clone_from(&rows.cells);
        Ok(Some(rows))
    }

    /// Number of a column.
    ///
    /// # Errors
    /// [`Refused::Table`] for a table without it.
    pub fn column(&self, name: &str) -> Result<usize> {
        let found = self.columns.iter().position(|column| column == name);
        let missing = || Refused::Table {
            at: format!("{}:1", self.path.display()),
            found: format!("no column {name}"),
            wanted: "the columns of a table that `cutis run` has written",
        };
        Ok(found.ok_or_else(missing)?)
    }

    /// Goes to the next row; false at the end.
    ///
    /// # Errors
    /// [`Refused::Table`] for a row that is cut off or has another number of values.
    pub fn next(&mut self) -> Result<bool> {
        let more = self.advance()?;
        if more && self.cells.len() != self.columns.len() {
            let found = format!("{} values in a row of {} columns", self.cells.len(), self.columns.len());
            return Err(self.refuse(found, "one value per column"));
        }
        Ok(more)
    }

    /// Text in a column of the present row.
    pub fn word(&self, column: usize) -> &str {
        &self.cells[column]
    }

    /// Number in a column of the present row.
    ///
    /// # Errors
    /// [`Refused::Table`] for a text that is none.
    pub fn number(&self, column: usize) -> Result<f64> {
        let cell = &self.cells[column];
        let name = &self.columns[column];
        cell.parse().map_err(|_| self.refuse(format!("`{}` in the column {name}", shortened(cell)), "a number"))
    }

    /// Reads a line into cells.
    fn advance(&mut self) -> Result<bool> {
        self.line += 1;
        let mut bytes = vec![];
        let read = (&mut self.file).take(LONGEST_LINE).read_until(b'\n', &mut bytes);
        read.map_err(|error| unread(&self.path, &error))?;
        if bytes.is_empty() {
            return Ok(false);
        }
        if bytes.pop() != Some(b'\n') {
            return Err(self.refuse("a line that is cut off, or no text".into(), "whole lines"));
        }
        let text = String::from_utf8(bytes);
        let text = text.map_err(|_| self.refuse("bytes that are not UTF-8".into(), "text"))?;
        match cells(text.trim_end_matches('\r')) {
            Some(cells) => self.cells = cells,
            None => return Err(self.refuse("a quote that is not closed".into(), "quotes in pairs")),
        }
        Ok(true)
    }

    fn refuse(&self, found: String, wanted: &'static str) -> crate::error::Error {
        Refused::Table { at: format!("{}:{}", self.path.display(), self.line), found, wanted }.into()
    }
}

fn unread(path: &Path, error: &io::Error) -> crate::error::Error {
    Refused::Table {
        at: path.display().to_string(),
        found: format!("a file that cannot be read ({error})"),
        wanted: "a file that `cutis run` has written",
    }
    .into()
}

/// Values of a line (RFC 4180); `None` if a quote is not closed.
fn cells(line: &str) -> Option<Vec<String>> {
    let mut out = vec![String::new()];
    let (mut inside, mut characters) = (false, line.chars().peekable());
    while let Some(c) = characters.next() {
        let cell = out.last_mut()?;
        match c {
            '"' if inside && characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            '"' if inside || cell.is_empty() => inside = !inside,
            ',' if !inside => out.push(String::new()),
            c => cell.push(c),
        }
    }
    (!inside).then_some(out)
}

/// A text that fits into a message.
fn shortened(text: &str) -> String {
    let start: String = text.chars().take(24).collect();
    if start.len() < text.len() { start + "…" } else { start }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_hold_commas_and_quotes() {
        assert_eq!(cells("1,a,\"b,\"\"c\"\"\",").expect("closed"), ["1", "a", "b,\"c\"", ""]);
        assert_eq!(cells("1,\"a"), None);
    }
}
