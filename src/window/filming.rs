//! A film of the window's pictures, with their times by the wall clock.

use crate::error::Result;
use crate::report::film::{Film, milliseconds};
use crate::view::Image;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Shortest time between two pictures: 12.5 a second at most.
const BETWEEN: Duration = Duration::from_millis(80);

/// See the module. A picture is written once the next one tells how long it was seen.
pub struct Filming {
    film: Film,
    path: PathBuf,
    last: (Image, Instant),
}

impl Filming {
    /// Begins with a picture.
    ///
    /// # Errors
    /// As [`Film::new`].
    pub fn new(path: &Path, first: Image) -> Result<Self> {
        let film = Film::new(path, [first.width, first.height])?;
        Ok(Self { film, path: path.to_owned(), last: (first, Instant::now()) })
    }

    /// Whether another picture is due.
    pub fn is_due(&self) -> bool {
        self.last.1.elapsed() >= BETWEEN
    }

    /// Whether a picture of this size fits.
    pub fn fits(&self, size: [u32; 2]) -> bool {
        self.film.size() == size
    }

    /// Takes the next picture.
    ///
    /// # Errors
    /// As [`Film::add`].
    pub fn add(&mut self, next: Image) -> Result<()> {
        let now = Instant::now();
        let (last, seen) = std::mem::replace(&mut self.last, (next, now));
        self.film.add(&last, milliseconds(now - seen))
    }

    /// Ends the film; what became of it, in words.
    pub fn end(mut self) -> String {
        let (last, seen) = &self.last;
        let ended = self.film.add(last, milliseconds(seen.elapsed().max(BETWEEN))).map(|()| self.film.count());
        match ended.and_then(|count| self.film.finish().map(|()| count)) {
            Ok(count) => format!("saved {} with {count} pictures", self.path.display()),
            Err(error) => error.to_string(),
        }
    }
}
