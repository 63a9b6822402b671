//! Changes of a text at random: of lines, of values, of numbers, of bytes.

use proptest::prelude::*;

/// One change; indices count around, so that any number is one.
#[derive(Clone, Debug)]
pub enum Change {
    /// A line goes.
    Drop(usize),
    /// A line is copied to another line.
    Copy(usize, usize),
    /// The value of a key is another one.
    Value(usize, String),
    /// A number is another one.
    Number(usize, String),
    /// A number times a power of ten.
    Scale(usize, i32),
    /// Two numbers are swapped.
    Swap(usize, usize),
    /// A line of another text stands here.
    Line(usize, String),
    /// The text ends.
    End(usize),
    /// Characters stand here.
    Insert(usize, String),
}

/// What numbers and counts can be at worst.
const NUMBERS: &[&str] = &[
    "nan",
    "-nan",
    "inf",
    "-inf",
    "0",
    "0.0",
    "-0.0",
    "1",
    "-1",
    "-1.0",
    "0.5",
    "1e308",
    "-1e308",
    "1e309",
    "1e-308",
    "5e-324",
    "1e38",
    "3.5e38",
    "1e-38",
    "1e-46",
    "1e19",
    "255",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775808",
    "18446744073709551616",
    "67108863",
    "67108864",
    "16000000",
    "0x10",
];

/// Values of other types and shapes.
const VALUES: &[&str] = &[
    "\"\"",
    "\"text\"",
    "\"a,b\"",
    "\"\\u0000\"",
    "[]",
    "[[]]",
    "[[[]]]",
    "{}",
    "true",
    "[1]",
    "[0, 0]",
    "[0, 0, 0]",
    "[nan, 0, 0]",
    "[1e30, 1e30]",
    "[4294967295, 1]",
    "[1, 4294967295]",
    "[1, 67108863]",
    "[1, 2, 3, 4]",
    "[[0, 0, 0], [0, 0, 0]]",
    "[[-1e9, -1e9, -1e9], [1e9, 1e9, 1e9]]",
    "2020-01-01",
    "\"../../../etc\"",
    "\".\"",
    "\"all\"",
    "\"top\"",
    "\"multigrid\"",
    "\"direct\"",
    "\"uncoupled\"",
    "\"precomputed\"",
    "\"springs\"",
    "\"corotational\"",
    "\"mooney_rivlin\"",
    "\"holzapfel\"",
    "\"midpoint\"",
    "\"static\"",
    "\"symplectic_euler\"",
    "\"consistent\"",
    "\"remove\"",
    "\"cones\"",
    "\"one\"",
    "\"penalty\"",
    "\"enhanced\"",
    "\"sphere\"",
    "\"plane\"",
    "\"bottom_core\"",
    "\"skin\"",
];

fn index() -> impl Strategy<Value = usize> {
    any::<u32>().prop_map(|n| n as usize)
}

fn number() -> impl Strategy<Value = String> {
    prop_oneof![
        4 => prop::sample::select(NUMBERS).prop_map(String::from),
        1 => any::<f64>().prop_map(|n| format!("{n:e}")),
        1 => (-1000i64..1000).prop_map(|n| n.to_string()),
    ]
}

/// Brackets, tables and keys in each other.
fn nested() -> impl Strategy<Value = String> {
    let depth = prop_oneof![1usize..20, 70usize..130, Just(5000usize)];
    (depth, 0..4).prop_map(|(depth, kind)| match kind {
        0 => format!("{}{}", "[".repeat(depth), "]".repeat(depth)),
        1 => format!("{}1{}", "{a=".repeat(depth), "}".repeat(depth)),
        2 => format!("1\n{}a = 1", "a.".repeat(depth)),
        _ => format!("1\n[{}a]", "a.".repeat(depth)),
    })
}

/// A change; `lines` are lines that others have.
pub fn change(lines: &'static [String]) -> impl Strategy<Value = Change> {
    let value = prop_oneof![
        3 => number(),
        3 => prop::sample::select(VALUES).prop_map(String::from),
        1 => prop::collection::vec(number(), 0..5).prop_map(|list| format!("[{}]", list.join(", "))),
        1 => nested(),
    ];
    prop_oneof![
        2 => index().prop_map(Change::Drop),
        2 => (index(), index()).prop_map(|(from, to)| Change::Copy(from, to)),
        3 => (index(), value).prop_map(|(line, value)| Change::Value(line, value)),
        6 => (index(), number()).prop_map(|(n, number)| Change::Number(n, number)),
        5 => (index(), -12i32..12).prop_map(|(n, power)| Change::Scale(n, power)),
        1 => (index(), index()).prop_map(|(a, b)| Change::Swap(a, b)),
        2 => (index(), prop::sample::select(lines)).prop_map(|(line, text)| Change::Line(line, text)),
        1 => index().prop_map(Change::End),
        1 => (index(), "\\PC{0,6}|[\\x00-\\x7f]{1,4}").prop_map(|(at, text)| Change::Insert(at, text)),
    ]
}

/// Bytes of the numbers of a text.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let of_number = |c: char| c.is_ascii_alphanumeric() || "+-._".contains(c);
    let mut found = vec![];
    let mut start = None;
    for (at, c) in text.char_indices().chain([(text.len(), ' ')]) {
        match (start, of_number(c)) {
            (None, true) => start = Some(at),
            (Some(from), false) => {
                if text[from..at].parse::<f64>().is_ok() {
                    found.push(from..at);
                }
                start = None;
            }
            _ => {}
        }
    }
    found
}

fn boundary(text: &str, at: usize) -> usize {
    let at = at % (text.len() + 1);
    (0..=at).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

fn by_lines(text: &mut String, change: impl FnOnce(&mut Vec<String>)) {
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    if !lines.is_empty() {
        change(&mut lines);
        *text = lines.join("\n") + "\n";
    }
}

fn replaced(text: &mut String, n: usize, with: impl FnOnce(&str) -> String) {
    let all = numbers(text);
    if let Some(range) = all.get(n % all.len().max(1)) {
        let new = with(&text[range.clone()]);
        text.replace_range(range.clone(), &new);
    }
}

/// The text after the changes.
pub fn changed(text: &str, changes: &[Change]) -> String {
    let mut text = text.to_string();
    for change in changes {
        match change.clone() {
            Change::Drop(line) => by_lines(&mut text, |lines| drop(lines.remove(line % lines.len()))),
            Change::Copy(from, to) => by_lines(&mut text, |lines| {
                let line = lines[from % lines.len()].clone();
                lines.insert(to % lines.len(), line);
            }),
            Change::Value(line, value) => by_lines(&mut text, |lines| {
                let keys: Vec<usize> = (0..lines.len()).filter(|k| lines[*k].contains(" = ")).collect();
                if let Some(k) = keys.get(line % keys.len().max(1)) {
                    let key = lines[*k].split(" = ").next().unwrap_or_default();
                    lines[*k] = format!("{key} = {value}");
                }
            }),
            Change::Number(n, number) => replaced(&mut text, n, |_| number),
            Change::Scale(n, power) => {
                replaced(&mut text, n, |old| format!("{:?}", old.parse::<f64>().unwrap_or(0.0) * 10f64.powi(power)));
            }
            Change::Swap(a, b) => {
                let all = numbers(&text);
                let of = |n: usize| all.get(n % all.len().max(1)).map(|range| text[range.clone()].to_string());
                if let (Some(first), Some(second)) = (of(a), of(b)) {
                    replaced(&mut text, a, |_| second);
                    replaced(&mut text, b, |_| first);
                }
            }
            Change::Line(line, other) => by_lines(&mut text, |lines| lines.insert(line % lines.len(), other)),
            Change::End(at) => text.truncate(boundary(&text, at)),
            Change::Insert(at, characters) => text.insert_str(boundary(&text, at), &characters),
        }
    }
    text
}
