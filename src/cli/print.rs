//! All printing of the program.
//!
//! A pipe that its reader has closed takes no more, which is no error: `cutis inspect SCENE | head -1` ends as without `head`. Standard
//! output that is full is one. Standard error has nobody to complain to: what it does not take is dropped, and the command goes on.
//! Control characters in names and titles are escaped, so that the text of a file neither moves the cursor nor adds lines.

use super::refused::{Refused, Result};
use std::fmt::{Display, Write as _};
use std::io::{self, ErrorKind, Write as _};
use std::path::Path;

/// Prints whole lines on standard output.
pub fn lines(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    written(out.write_all(escaped(text, "\n", rust).as_bytes()).and_then(|()| out.flush()))
}

/// Prints one line on standard output.
pub fn line(text: &str) -> Result<()> {
    lines(&(escaped(text, "", rust) + "\n"))
}

/// Prints a value as JSON on standard output.
pub fn json(value: &impl serde::Serialize) -> Result<()> {
    // a tree of numbers and strings always serialises
    let text = serde_json::to_string_pretty(value).unwrap_or_default();
    // within strings serde_json leaves the control characters beyond ASCII as they are
    let mut out = io::stdout().lock();
    written(out.write_all((escaped(&text, "\n", of_json) + "\n").as_bytes()).and_then(|()| out.flush()))
}

/// Prints one line on standard error.
pub fn note(words: impl Display) {
    let line = escaped(&words.to_string(), "", rust) + "\n";
    io::stderr().lock().write_all(line.as_bytes()).ok();
}

/// Result of a write to standard output.
pub fn written(result: io::Result<()>) -> Result<()> {
    match result {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => Err(Refused::Print { source }),
        _ => Ok(()),
    }
}

/// A text with its control characters escaped, but for those in `kept`.
fn escaped(text: &str, kept: &str, escape: fn(char) -> String) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c.is_control() && !kept.contains(c) {
            true => write!(out, "{}", escape(c)).expect("a String takes any text"),
            false => out.push(c),
        }
    }
    out
}

fn rust(c: char) -> String {
    c.escape_default().to_string()
}

fn of_json(c: char) -> String {
    format!("\\u{:04x}", u32::from(c))
}

/// A path as printed, with a separator at the end.
pub fn shown(path: &Path) -> String {
    format!("{}{}", path.display(), std::path::MAIN_SEPARATOR)
}
