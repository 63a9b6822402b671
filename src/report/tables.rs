//! Tables of a run, a row or more per step: [`Tables`] writes them, [`Rows`] reads them.
//!
//! | file | a row is |
//! | --- | --- |
//! | `probes.csv` | a step: probes, number of contacts, largest force, cut links |
//! | `solver.csv` | a step: iterations and residuals of its solves |
//! | `energy.csv` | a checked step: energy at its start, work and dissipation until there |
//! | `contacts.csv` | a contact point of a step that bears a force; only of scenes with contact |
//!
//! A row of contacts.csv takes 4 µs and 300 bytes: 0.1 % of the time of the incision's steps, which have six rows each. It is always written.
//!
//! They are read a row at a time, in memory that does not grow with them; what is no such table is told with its line.

use super::Refused;
use super::listing::Listing;
use crate::error::Result;
use crate::output::{Cell, Table, TableMark};
use crate::scene::{FIXED_COLUMNS, Probe, Scene};
use crate::step::{ContactPoint, Measured, StepReport};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Names of the files.
pub(super) const PROBES: &str = "probes.csv";
pub(super) const SOLVER: &str = "solver.csv";
pub(super) const ENERGY: &str = "energy.csv";
pub(super) const CONTACTS: &str = "contacts.csv";

/// Columns of `energy.csv`: the state at a checked step's start, then work and dissipation until there ([`crate::step::Booked`]).
const ENERGY_COLUMNS: [&str; 10] = [
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

/// Columns of `solver.csv`: the solve of the unconstrained motion, then that of the contact forces.
const SOLVER_COLUMNS: [&str; 7] = [
    "time_s",
    "iterations",
    "residual",
    "newton_iterations",
    "contact_passes",
    "contact_residual_n",
    "contact_residual_mm",
];

/// Columns of `contacts.csv` ([`ContactPoint`]): the force is that on the first body.
const CONTACT_COLUMNS: [&str; 17] = [
    "time_s",
    "first",
    "second",
    "kind",
    "x_mm",
    "y_mm",
    "z_mm",
    "normal_x",
    "normal_y",
    "normal_z",
    "gap_mm",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "slip_x_mm",
    "slip_y_mm",
    "slip_z_mm",
];

/// Columns of `probes.csv`.
fn probe_columns(scene: &Scene) -> Vec<String> {
    let [first, last @ ..] = FIXED_COLUMNS;
    let mut columns = vec![first.to_string()];
    columns.extend(scene.probes.iter().map(Probe::column));
    if scene.contact.is_some() {
        columns.extend(last.map(String::from));
    }
    columns
}

/// See the module.
pub(super) struct Tables {
    probes: Table,
    solver: Table,
    energy: Table,
    contacts: Option<Table>,
    /// Time of the last row of `energy`, s; NaN before one.
    measured: f64,
}

/// Positions in the tables of a run.
#[derive(Serialize, Deserialize)]
pub(super) struct Marks {
    probes: TableMark,
    solver: TableMark,
    energy: TableMark,
    contacts: Option<TableMark>,
}

impl Tables {
    /// Starts the tables.
    pub fn create(listing: &mut Listing, scene: &Scene) -> Result<Self> {
        let contacts = match scene.contact {
            Some(_) => Some(Table::create(&listing.add(CONTACTS)?, &CONTACT_COLUMNS)?),
            None => None,
        };
        Ok(Self {
            probes: Table::create(&listing.add(PROBES)?, &probe_columns(scene))?,
            solver: Table::create(&listing.add(SOLVER)?, &SOLVER_COLUMNS)?,
            energy: Table::create(&listing.add(ENERGY)?, &ENERGY_COLUMNS)?,
            contacts,
            measured: f64::NAN,
        })
    }

    /// Checks that the tables of a folder are those of the run with these positions.
    pub fn verify(path: &Path, scene: &Scene, marks: &Marks) -> Result<()> {
        Table::verify(&path.join(PROBES), &probe_columns(scene), marks.probes)?;
        Table::verify(&path.join(SOLVER), &SOLVER_COLUMNS, marks.solver)?;
        Table::verify(&path.join(ENERGY), &ENERGY_COLUMNS, marks.energy)?;
        marks.contacts.map_or(Ok(()), |mark| Table::verify(&path.join(CONTACTS), &CONTACT_COLUMNS, mark))
    }

    /// Continues the tables of a folder; cuts off what was written later.
    pub fn reopen(listing: &mut Listing, scene: &Scene, marks: &Marks) -> Result<Self> {
        let contacts = match marks.contacts {
            Some(mark) => Some(Table::reopen(&listing.add(CONTACTS)?, &CONTACT_COLUMNS, mark)?),
            None => None,
        };
        Ok(Self {
            probes: Table::reopen(&listing.add(PROBES)?, &probe_columns(scene), marks.probes)?,
            solver: Table::reopen(&listing.add(SOLVER)?, &SOLVER_COLUMNS, marks.solver)?,
            energy: Table::reopen(&listing.add(ENERGY)?, &ENERGY_COLUMNS, marks.energy)?,
            contacts,
            measured: f64::NAN,
        })
    }

    /// Positions so far, with all rows flushed.
    pub fn marks(&mut self) -> Result<Marks> {
        Ok(Marks {
            probes: self.probes.kept()?,
            solver: self.solver.kept()?,
            energy: self.energy.kept()?,
            contacts: self.contacts.as_mut().map(Table::kept).transpose()?,
        })
    }

    /// Adds the rows of a step.
    pub fn add_step(&mut self, scene: &Scene, step: &StepReport) -> Result<()> {
        let contact = &step.contact;
        let mut row = vec![step.time];
        row.extend(&step.probes);
        if scene.contact.is_some() {
            row.extend([contact.count() as f64, contact.largest_on_tools(), f64::from(step.severed)]);
        }
        self.probes.row(&row)?;
        self.solver.row(&[
            step.time,
            f64::from(step.free.iterations),
            step.residual,
            f64::from(step.newton_iterations),
            f64::from(contact.passes),
            contact.residual_n,
            contact.residual_m * 1e3,
        ])?;
        if let Some(table) = &mut self.contacts {
            contact
                .points()
                .filter(|p| p.force != DVec3::ZERO)
                .try_for_each(|point| add_contact(table, scene, step.time, &point))?;
            table.flush()?;
        }
        self.solver.flush()?;
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

    /// Flushes all rows so far.
    pub fn flush(&mut self) -> Result<()> {
        let usual = [&mut self.probes, &mut self.solver, &mut self.energy].into_iter();
        usual.chain(self.contacts.as_mut()).try_for_each(Table::flush)
    }

    /// Closes the tables.
    pub fn finish(self) -> Result<()> {
        let usual = [self.probes, self.solver, self.energy].into_iter();
        usual.chain(self.contacts).try_for_each(Table::finish)
    }
}

fn add_contact(table: &mut Table, scene: &Scene, time: f64, point: &ContactPoint) -> Result<()> {
    let [first, second] = point.bodies.map(|body| Cell::Word(scene.body_name(body)));
    let head = [Cell::Number(time), first, second, Cell::Word(point.kind.word())];
    let groups = [(point.point * 1e3).to_array(), point.normal.to_array()].concat();
    let rest = [point.force.to_array(), (point.slip * 1e3).to_array()].concat();
    let numbers = groups.into_iter().chain([point.gap * 1e3]).chain(rest).map(Cell::Number);
    table.cells(head.into_iter().chain(numbers))
}

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
