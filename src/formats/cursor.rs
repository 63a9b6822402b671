//! Reads words and numbers one after the other, from text or binary data, and says where something is wrong.
//!
//! Text is read by rows where a format has a record on each line, so that a line with too few or too many numbers is told by its own
//! number; or freely ([`Cursor::free`]) where numbers may stand on any lines. Lines are counted when an error asks for them.

use super::{At, Position, Refused, Result, quoted};
use std::path::Path;
use std::str::FromStr;

/// How numbers stand in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbers {
    /// Decimal digits between blanks.
    Text,
    /// As in memory, least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Types of binary numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// Signed, bytes.
    Signed(usize),
    /// Unsigned, bytes.
    Unsigned(usize),
    /// Floating point, bytes.
    Float(usize),
}

impl Type {
    /// Bytes of one.
    pub fn bytes(self) -> usize {
        match self {
            Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Float(bytes) => bytes,
        }
    }

    /// Value of the first bytes of `bytes` as a float; of 64-bit integers the nearest.
    pub fn real(self, bytes: &[u8], big: bool) -> f64 {
        match self {
            Self::Float(4) => f64::from(f32::from_bits(bits(&bytes[..4], big) as u32)),
            Self::Float(_) => f64::from_bits(bits(&bytes[..8], big)),
            Self::Signed(count) => signed(&bytes[..count], big) as f64,
            Self::Unsigned(count) => bits(&bytes[..count], big) as f64,
        }
    }

    /// The same as a whole number, none for a float, or a negative one.
    pub fn whole(self, bytes: &[u8], big: bool) -> Option<u64> {
        match self {
            Self::Float(_) => None,
            Self::Signed(count) => u64::try_from(signed(&bytes[..count], big)).ok(),
            Self::Unsigned(count) => Some(bits(&bytes[..count], big)),
        }
    }
}

fn bits(bytes: &[u8], big: bool) -> u64 {
    let joined = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
    if big { bytes.iter().fold(0, joined) } else { bytes.iter().rev().fold(0, joined) }
}

fn signed(bytes: &[u8], big: bool) -> i64 {
    let shift = 64 - 8 * bytes.len() as u32;
    ((bits(bytes, big) << shift) as i64) >> shift
}

/// Fewest bytes between two calls of the progress function.
const TOLD_EVERY: usize = 1 << 20;

/// Position in a file.
pub struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    path: &'a Path,
    progress: &'a mut dyn FnMut(f64),
    told: usize,
    /// How the numbers of the next data stand.
    pub numbers: Numbers,
    /// Words may stand on the next line.
    pub free: bool,
}

impl<'a> Cursor<'a> {
    /// The beginning of a file, read as text by rows.
    pub fn new(bytes: &'a [u8], path: &'a Path, progress: &'a mut dyn FnMut(f64)) -> Self {
        let at = if bytes.starts_with("\u{feff}".as_bytes()) { 3 } else { 0 };
        Self { bytes, at, path, progress, told: 0, numbers: Numbers::Text, free: false }
    }

    /// File name, for messages.
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// Bytes not yet read.
    pub fn left(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// Bytes read.
    pub fn position(&self) -> usize {
        self.at
    }

    /// Goes back or forth, at most to the end.
    pub fn go_to(&mut self, position: usize) {
        self.at = position.min(self.bytes.len());
    }

    /// The present location.
    pub fn location(&self) -> At {
        self.location_of(self.at)
    }

    /// Byte where the next word, or the next binary number, begins; [`Cursor::at`] makes a location of it.
    pub fn location_of_next(&self) -> usize {
        match self.numbers {
            Numbers::Text => self.at + self.left().iter().take_while(|byte| byte.is_ascii_whitespace()).count(),
            _ => self.at,
        }
    }

    /// Location of a byte.
    pub fn at(&self, position: usize) -> At {
        self.location_of(position.min(self.bytes.len()))
    }

    fn location_of(&self, at: usize) -> At {
        let position = match self.numbers {
            Numbers::Text => Position::Line(1 + self.bytes[..at].iter().filter(|byte| **byte == b'\n').count()),
            _ => Position::Byte(at),
        };
        At { file: self.path.to_path_buf(), position }
    }

    /// An error at a byte: found something, or the end, where `wanted` should stand.
    fn unlike(&self, at: usize, found: &[u8], wanted: &'static str) -> Refused {
        match found.is_empty() && at >= self.bytes.len() {
            true => Refused::End { at: self.location_of(at), wanted },
            false if found.is_empty() => {
                Refused::Unexpected { at: self.location_of(at), found: "the line ends".into(), wanted }
            }
            false => Refused::Unexpected { at: self.location_of(at), found: quoted(found), wanted },
        }
    }

    /// An error at the present location.
    pub fn unexpected(&self, found: impl Into<String>, wanted: &'static str) -> Refused {
        Refused::Unexpected { at: self.location(), found: found.into(), wanted }
    }

    fn skip_blanks(&mut self) {
        let left = self.left();
        let count = match self.free {
            true => left.iter().take_while(|byte| byte.is_ascii_whitespace()).count(),
            false => left.iter().take_while(|byte| byte.is_ascii_whitespace() && **byte != b'\n').count(),
        };
        self.at += count;
    }

    /// The next word; empty at the end of the line, or of the file if words may stand on any line.
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let left = self.left();
        let count = left.iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
        self.at += count;
        &left[..count]
    }

    /// The rest of the line, without blanks around it, and the next line; none at the end of the file.
    pub fn line(&mut self) -> Option<&'a [u8]> {
        let left = self.left();
        if left.is_empty() {
            return None;
        }
        let count = left.iter().position(|byte| *byte == b'\n');
        self.at += count.map_or(left.len(), |count| count + 1);
        Some(left[..count.unwrap_or(left.len())].trim_ascii())
    }

    /// The next line that is not blank, from the beginning of a line on; none at the end of the file.
    pub fn text(&mut self) -> Option<&'a [u8]> {
        loop {
            let line = self.line()?;
            if !line.is_empty() {
                return Some(line);
            }
        }
    }

    /// Before each record of a text: the rest of the line has to be blank; goes to the next line that is not. Nothing in binary data.
    pub fn row(&mut self, wanted: &'static str) -> Result<()> {
        self.tell();
        if self.numbers != Numbers::Text || self.free {
            return Ok(());
        }
        self.skip_blanks();
        match self.left().first() {
            None => Err(Refused::End { at: self.location(), wanted }),
            // at the beginning of a line, of which `row` has been called for before
            Some(b'\n') => {
                self.at += self.left().iter().take_while(|byte| byte.is_ascii_whitespace()).count();
                match self.left().is_empty() {
                    true => Err(Refused::End { at: self.location(), wanted }),
                    false => Ok(()),
                }
            }
            Some(_) if self.at == 0 || self.begins_line() => Ok(()),
            Some(_) => {
                let at = self.at;
                let rest = self.line().unwrap_or_default();
                Err(self.unlike(at, rest, "the end of the line"))
            }
        }
    }

    fn begins_line(&self) -> bool {
        let before = self.bytes[..self.at].iter().rev().find(|byte| **byte == b'\n' || !byte.is_ascii_whitespace());
        before.is_none_or(|byte| *byte == b'\n')
    }

    /// Tells the progress now and then.
    pub fn tell(&mut self) {
        if self.at >= self.told + TOLD_EVERY {
            self.told = self.at;
            (self.progress)(self.at as f64 / self.bytes.len() as f64);
        }
    }

    /// Bytes of binary data.
    pub fn take(&mut self, count: usize, wanted: &'static str) -> Result<&'a [u8]> {
        let left = self.left();
        if left.len() < count {
            return Err(Refused::End { at: self.location_of(self.bytes.len()), wanted });
        }
        self.at += count;
        Ok(&left[..count])
    }

    /// A whole number, not negative; of `kind` in binary data.
    pub fn whole(&mut self, kind: Type, wanted: &'static str) -> Result<u64> {
        let at = self.at;
        let (found, word) = match self.numbers {
            Numbers::Text => {
                let word = self.word();
                (digits(word), word)
            }
            numbers => {
                (kind.whole(self.take(kind.bytes(), wanted)?, numbers == Numbers::Big), &b"a negative number"[..])
            }
        };
        found.ok_or_else(|| self.unlike(self.begun(at), word, wanted))
    }

    /// The next word as a number.
    fn parsed<T: FromStr>(&mut self, wanted: &'static str) -> Result<T> {
        let at = self.at;
        let word = self.word();
        let found = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        found.ok_or_else(|| self.unlike(self.begun(at), word, wanted))
    }

    /// A whole number within 32 bits.
    pub fn int(&mut self, wanted: &'static str) -> Result<i32> {
        match self.numbers {
            Numbers::Text => self.parsed(wanted),
            numbers => Ok(bits(self.take(4, wanted)?, numbers == Numbers::Big) as u32 as i32),
        }
    }

    /// A number; of `kind` in binary data; may be non-finite.
    pub fn real(&mut self, kind: Type, wanted: &'static str) -> Result<f64> {
        match self.numbers {
            Numbers::Text => self.parsed(wanted),
            numbers => Ok(kind.real(self.take(kind.bytes(), wanted)?, numbers == Numbers::Big)),
        }
    }

    /// Three finite numbers.
    pub fn point(&mut self, kind: Type) -> Result<[f64; 3]> {
        let at = self.at;
        let mut point = [0.0; 3];
        for coordinate in &mut point {
            *coordinate = self.real(kind, "three coordinates of a point")?;
        }
        if point.iter().all(|coordinate: &f64| coordinate.is_finite()) {
            return Ok(point);
        }
        let found = format!("a point at {point:?}");
        Err(Refused::Unexpected { at: self.location_of(self.begun(at)), found, wanted: "three finite numbers" })
    }

    /// Where the word that was read from `at` on begins.
    fn begun(&self, at: usize) -> usize {
        match self.numbers {
            Numbers::Text => {
                let blanks = self.bytes[at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
                // of a word that is not there, the line is told that lacks it
                if self.at < at + blanks { self.at } else { at + blanks }
            }
            _ => at,
        }
    }

    /// A count that the rest of the file can hold, each thing being `bytes` long at least in text or binary data.
    pub fn count(&mut self, kind: Type, bytes: [usize; 2], what: &'static str) -> Result<usize> {
        let at = self.at;
        let found = self.whole(kind, what)?;
        let each = bytes[usize::from(self.numbers != Numbers::Text)];
        self.holds(found, each, what).map_err(|error| match error {
            Refused::Count { what, found, left, .. } => {
                Refused::Count { at: self.location_of(self.begun(at)), what, found, left }
            }
            error => error,
        })
    }

    /// The same of a count that has been read.
    pub fn holds(&self, found: u64, each: usize, what: &'static str) -> Result<usize> {
        let left = self.left().len();
        // the last thing of a text may lack its end of line
        let most = (left + usize::from(self.numbers == Numbers::Text)) / each.max(1);
        match usize::try_from(found).ok().filter(|found| *found <= most) {
            Some(count) if count < u32::MAX as usize => Ok(count),
            Some(_) => Err(Refused::TooMany { path: self.path.to_path_buf(), count: found }),
            None => Err(Refused::Count { at: self.location(), what, found, left }),
        }
    }
}

/// A whole number of digits alone.
pub fn digits(word: &[u8]) -> Option<u64> {
    if word.is_empty() {
        return None;
    }
    word.iter().try_fold(0u64, |sum, byte| {
        let digit = byte.wrapping_sub(b'0');
        let digit = (digit < 10).then_some(u64::from(digit))?;
        sum.checked_mul(10)?.checked_add(digit)
    })
}
