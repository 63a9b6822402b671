//! Parses TOML into raw tables, and rephrases the parser's errors as what was found and what was wanted.

use super::invalid::{Invalid, Result};
use super::raw;
use super::text::{SceneText, nearest};
use serde::Deserialize;
use std::ops::Range;

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

fn key_hint(key: &str, known: &[&str]) -> String {
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
