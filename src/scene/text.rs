//! Scene text and checked values: each reader reports its line if the value does not fit. [`tables`] parses the text's TOML, and rephrases
//! the parser's errors as what was found and what was wanted.
//!
//! Conversion to SI happens only here: `si = file · times / per`.

use super::invalid::{Invalid, Location, Result};
use super::raw::{self, At, Choice, Count, Counts, Number, Numbers, Points, Row, TwoCounts, Vector, Vectors, Within};
use crate::math::elementary::hypot;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// Metres in mm for messages, rounded to a millionth of a mm, which hides the rounding of the conversion to SI.
pub(super) fn in_mm(metres: f64) -> f64 {
    (metres * 1e9).round() / 1e6
}

/// The given value, or a default in the file's unit.
pub(super) fn or<T>(value: Option<At<T>>, default: T) -> At<T> {
    value.unwrap_or_else(|| At::new(0..0, default))
}

/// Names that are given already, with their spans.
pub(super) type Taken = BTreeMap<String, Range<usize>>;

/// Scene text with its file name, for locations in messages.
pub(super) struct SceneText<'a> {
    pub file: &'a Path,
    pub text: &'a str,
    /// Positions of the line ends.
    ends: Vec<usize>,
}

impl<'a> SceneText<'a> {
    pub fn new(file: &'a Path, text: &'a str) -> Self {
        Self { file, text, ends: text.match_indices('\n').map(|(at, _)| at).collect() }
    }

    /// Line where a span starts.
    pub fn location(&self, span: Range<usize>) -> Location {
        Location::new(self.file, self.line(&span))
    }

    /// Its number, from 1.
    pub fn line(&self, span: &Range<usize>) -> usize {
        1 + self.ends.partition_point(|end| *end < span.start)
    }

    fn checked(&self, key: &str, found: f64, span: Range<usize>, range: Number) -> Result<f64> {
        let Number { unit, bound } = range;
        let si = found * unit.times / unit.per;
        if bound.holds(found, si) {
            return Ok(si);
        }
        Err(Invalid::Number {
            at: self.location(span),
            key: key.to_string(),
            found,
            wanted: bound.wanted(),
            unit: unit.name,
            example: bound.example(found),
        })
    }

    /// Number in SI.
    pub fn number<D>(&self, row: &Row<Number, D>, value: &At<f64>) -> Result<f64> {
        self.checked(row.name, *value.get_ref(), value.span(), row.range)
    }

    /// Number in SI, or the default.
    pub fn number_or(&self, row: &Row<Number, f64>, value: Option<At<f64>>) -> Result<f64> {
        self.number(row, &row.or(value))
    }

    /// Number between two others, or the default.
    pub fn within_or(&self, row: &Row<Within, f64>, value: Option<At<f64>>) -> Result<f64> {
        let (value, range) = (row.or(value), row.range);
        let (found, si) = (*value.get_ref(), self.checked(row.name, *value.get_ref(), value.span(), range.positive())?);
        if range.holds(found) {
            return Ok(si);
        }
        Err(Invalid::Number {
            at: self.location(value.span()),
            key: row.name.to_string(),
            found,
            wanted: range.wanted,
            unit: range.unit.name,
            example: row.default,
        })
    }

    /// N numbers in SI.
    pub fn vector<const N: usize, D>(&self, row: &Row<Vector<N>, D>, value: &Numbers) -> Result<[f64; N]> {
        self.length(row.name, value.get_ref().len(), N, value.span())?;
        let mut si = [0.0; N];
        for (i, found) in value.get_ref().iter().enumerate() {
            si[i] = self.checked(&format!("{}[{i}]", row.name), *found, value.span(), row.range.0)?;
        }
        Ok(si)
    }

    /// N numbers in SI, or the default.
    pub fn vector_or<const N: usize>(
        &self,
        row: &Row<Vector<N>, [f64; N]>,
        value: Option<Numbers>,
    ) -> Result<[f64; N]> {
        self.vector(row, &row.or(value))
    }

    /// Any number of vectors in SI.
    pub fn points<const N: usize, D>(&self, row: &Row<Vectors<N>, D>, value: &Points) -> Result<Vec<[f64; N]>> {
        value.get_ref().iter().map(|point| self.vector(&row.each(), point)).collect()
    }

    /// Two corners in SI; the first must be below the second in each coordinate.
    pub fn corners<const N: usize, D>(&self, row: &Row<Vectors<N>, D>, value: &Points) -> Result<[[f64; N]; 2]> {
        let corners = self.points(row, value)?;
        self.length(row.name, corners.len(), 2, value.span())?;
        for (lower, upper) in corners[0].iter().zip(&corners[1]) {
            if lower > upper {
                return Err(Invalid::Order {
                    at: self.location(value.span()),
                    key: row.name,
                    lower: in_mm(*lower),
                    relation: "at most",
                    upper: in_mm(*upper),
                    fix: "write the corner with the smaller coordinates first",
                });
            }
        }
        Ok([corners[0], corners[1]])
    }

    fn length(&self, key: &'static str, found: usize, wanted: usize, span: Range<usize>) -> Result<()> {
        if found == wanted {
            return Ok(());
        }
        Err(Invalid::Length { at: self.location(span), key, found, wanted })
    }

    fn counted(&self, key: &str, found: u32, span: Range<usize>, range: Count) -> Result<u32> {
        let Count { min, max } = range;
        if (min..=max).contains(&found) {
            return Ok(found);
        }
        Err(Invalid::Count { at: self.location(span), key: key.to_string(), found, min, max })
    }

    /// A count in its range.
    pub fn count<D>(&self, row: &Row<Count, D>, value: &At<u32>) -> Result<u32> {
        self.counted(row.name, *value.get_ref(), value.span(), row.range)
    }

    /// A count in its range, or the default.
    pub fn count_or(&self, row: &Row<Count, u32>, value: Option<At<u32>>) -> Result<u32> {
        self.count(row, &row.or(value))
    }

    /// Two counts, each in their range.
    pub fn counts<D>(&self, row: &Row<TwoCounts, D>, value: &Counts) -> Result<[u32; 2]> {
        self.length(row.name, value.get_ref().len(), 2, value.span())?;
        let mut counts = [0; 2];
        for (i, found) in value.get_ref().iter().enumerate() {
            counts[i] = self.counted(&format!("{}[{i}]", row.name), *found, value.span(), row.range.0)?;
        }
        Ok(counts)
    }

    /// Choice among the words of a key.
    pub fn choice<T: Copy, D>(&self, row: &Row<Choice<T>, D>, value: &At<String>) -> Result<T> {
        self.among(row.name, value, row.range.0)
    }

    /// Choice among the words of a key, or its default.
    pub fn choice_or<T: Copy>(&self, row: &Row<Choice<T>, &'static str>, value: Option<At<String>>) -> Result<T> {
        self.choice(row, &row.or(value))
    }

    /// Choice among known words.
    pub fn among<T: Copy>(&self, key: &'static str, value: &At<String>, known: &[(&str, T)]) -> Result<T> {
        let found = value.get_ref();
        if let Some((_, chosen)) = known.iter().find(|(word, _)| word == found) {
            return Ok(*chosen);
        }
        let words: Vec<&str> = known.iter().map(|(word, _)| *word).collect();
        Err(self.unknown_word(key, value, &words))
    }

    /// Error for an unknown word.
    pub fn unknown_word(&self, key: &'static str, value: &At<String>, known: &[&str]) -> Invalid {
        let hint = match nearest(value.get_ref(), known) {
            Some(word) => format!("did you mean \"{word}\"?"),
            None => "use a known one".to_string(),
        };
        let known = match known {
            [] => "none".to_string(),
            _ => known.join(", "),
        };
        Invalid::Choice {
            at: self.location(value.span()),
            key,
            found: value.get_ref().clone(),
            hint: hint.into(),
            known,
        }
    }

    /// Valid name that is not among `taken`; it is added there.
    pub fn name(&self, what: &'static str, value: &At<String>, taken: &mut Taken) -> Result<String> {
        let name = value.get_ref();
        let unusable = |c: char| c.is_control() || c == ',' || c == '"';
        if name.is_empty() || name.trim() != name || name.contains(unusable) {
            return Err(Invalid::Name { at: self.location(value.span()), what, found: name.clone() });
        }
        if let Some(first) = taken.get(name) {
            return Err(Invalid::Duplicate {
                at: self.location(value.span()),
                what,
                name: name.clone(),
                first: self.line(first),
            });
        }
        taken.insert(name.clone(), value.span());
        Ok(name.clone())
    }

    /// Value of a key that another key requires.
    pub fn required<T>(&self, key: &str, value: Option<T>, table: Range<usize>, why: &'static str) -> Result<T> {
        value.ok_or_else(|| Invalid::MissingKey { at: self.location(table), key: key.to_string(), why })
    }

    /// Error if a key is present that another key makes redundant.
    pub fn needless<T>(&self, key: &'static str, value: &Option<At<T>>, why: &'static str) -> Result<()> {
        match value {
            None => Ok(()),
            Some(value) => Err(Invalid::NeedlessKey { at: self.location(value.span()), key, why }),
        }
    }
}

/// Unit vector; `None` for zero length.
pub(super) fn normalized(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = hypot(hypot(a[0], a[1]), a[2]);
    (length.is_normal()).then(|| a.map(|part| part / length))
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Nearest known word, within an edit distance of a third of its length, at least 2.
pub fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let ranked = known.iter().map(|other| (edit_distance(&lower, other), *other));
    let (distance, other) = ranked.min_by_key(|(distance, _)| *distance)?;
    (distance <= (other.len() / 3).max(2) && distance < other.len()).then_some(other)
}

/// Edit distance: insertions, deletions and replacements between two words (Levenshtein 1966), by dynamic programming over rows.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// Maximum length of a quotation in a message, characters.
const QUOTE_LENGTH: usize = 72;

/// Unit suffixes of keys; they are ignored when looking for a key with a wrong unit.
const UNIT_WORDS: &[&str] = &[
    "cm", "cm2", "cm3", "deg", "g", "gpa", "hz", "j", "kg", "kj", "km", "kn", "kpa", "m", "m2", "m3", "mg", "min",
    "mj", "mm", "mm2", "mm3", "mn", "mpa", "ms", "n", "nm", "pa", "per", "px", "rad", "s", "s2", "um", "us",
];

/// Parses the tables; every failure becomes an error with a line.
pub(super) fn tables(scene: &SceneText) -> Result<raw::Scene> {
    let syntax = |error: toml::de::Error| not_toml(scene, error.message(), error.span());
    let parsed = toml::Deserializer::parse(scene.text).map_err(syntax)?;
    raw::Scene::deserialize(parsed).map_err(|error| explain(scene, error.message(), error.span()))
}

fn not_toml(scene: &SceneText, problem: &str, span: Option<Range<usize>>) -> Invalid {
    let span = span.unwrap_or(0..0);
    Invalid::Syntax { text: quote(scene, &span), at: scene.location(span), problem: problem.trim().replace('\n', ", ") }
}

fn explain(scene: &SceneText, message: &str, span: Option<Range<usize>>) -> Invalid {
    let location = scene.location(span.clone().unwrap_or(0..0));
    if let Some((key, known)) = unknown_field(message) {
        return Invalid::UnknownKey {
            at: location,
            key: shorten(key),
            hint: key_hint(key, &known),
            known: known.join(", "),
        };
    }
    if let Some(key) = between(message, "missing field `", "`") {
        return Invalid::MissingKey { at: location, key: key.to_string(), why: "it has no default" };
    }
    let typed = message.strip_prefix("invalid type: ");
    let typed = typed.or_else(|| message.strip_prefix("invalid value: "));
    match typed.and_then(|rest| rest.rsplit_once(", expected ")) {
        Some((found, wanted)) => Invalid::WrongType {
            at: location,
            text: quote(scene, &span.unwrap_or(0..0)),
            found: shorten(found),
            wanted: plain_type(wanted).to_string(),
        },
        None => not_toml(scene, message, span),
    }
}

/// Key and known keys in serde's "unknown field `a`, expected one of `b`, `c`".
fn unknown_field(message: &str) -> Option<(&str, Vec<&str>)> {
    let rest = message.strip_prefix("unknown field `")?;
    let (key, known) = rest.rsplit_once("`, expected ")?;
    Some((key, known.split('`').skip(1).step_by(2).collect()))
}

fn between<'a>(text: &'a str, start: &str, end: &str) -> Option<&'a str> {
    text.strip_prefix(start)?.split(end).next()
}

fn plain_type(wanted: &str) -> &str {
    match wanted {
        "f64" => "a number, without quotes",
        "u32" => "a whole number from 0 to 4294967295, without a point",
        "a boolean" => "true or false",
        "a string" => "text in quotes",
        "a sequence" => "a list in [ ]; for tables, headers in [[ ]]",
        "a table" | "a map" => "one table: a header in [ ] with its keys below, once (or [[ ]] where tables repeat)",
        other => other,
    }
}

/// Keys with another name since a former version.
const RENAMED: [(&str, &str); 1] = [("anchor", "rest_spring")];

fn key_hint(key: &str, known: &[&str]) -> String {
    if let Some((_, now)) = RENAMED.iter().find(|(former, now)| *former == key && known.contains(now)) {
        return format!("it is called `{now}` now");
    }
    let same_stem = known.iter().find(|other| stem(other) == stem(key));
    if let Some(other) = same_stem {
        return format!("the unit is part of the key: write `{other}` and convert the value to its unit");
    }
    match nearest(key, known) {
        Some(other) => format!("did you mean `{other}`?"),
        None => "remove it, or move it to the table it belongs to".to_string(),
    }
}

/// Key without its unit: `thickness` of `thickness_cm`.
fn stem(key: &str) -> String {
    let lower = key.to_lowercase().replace('-', "_");
    let mut words: Vec<&str> = lower.split('_').collect();
    while words.len() > 1 && words.last().is_some_and(|word| UNIT_WORDS.contains(word)) {
        words.pop();
    }
    words.join("_")
}

/// First line of a span, complete and trimmed.
fn quote(scene: &SceneText, span: &Range<usize>) -> String {
    let line = scene.location(span.clone()).line;
    shorten(scene.text.lines().nth(line - 1).unwrap_or("").trim())
}

/// At most [`QUOTE_LENGTH`] characters of a text, on one line.
pub(super) fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(QUOTE_LENGTH).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short.replace(char::is_control, " ")
}
