#![doc = include_str!("keys.md")]
#![doc = include_str!("topics.md")]

/// Key of a scene file, as listed on the page above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Heading of its table: `[time]`, `[skin] and [[block]]`, or `The file`.
    pub table: &'static str,
    /// Name, with its unit.
    pub name: &'static str,
    /// Default as TOML, or in words in brackets; empty if the key is required or belongs to a choice.
    pub default: &'static str,
    /// Allowed values.
    pub range: &'static str,
    /// Meaning.
    pub meaning: &'static str,
}

const PAGE: &str = include_str!("keys.md");

/// All keys, in the order of the page.
pub fn keys() -> Vec<Key> {
    let (mut table, mut out) = ("", vec![]);
    for line in PAGE.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            table = heading;
        }
        let cells: Vec<&'static str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if let [name, default, range, meaning] = cells[..]
            && let Some(name) = name.strip_prefix('`').and_then(|name| name.strip_suffix('`'))
        {
            out.push(Key { table, name, default, range, meaning });
        }
    }
    out
}

/// Keys whose name or table contains a word, or if there are none, whose meaning does; all keys for `None`.
pub fn matching(word: Option<&str>) -> Vec<Key> {
    let Some(word) = word.map(str::to_lowercase) else { return keys() };
    let named = |key: &Key| key.name.contains(&word) || key.table.contains(&word);
    let found: Vec<Key> = keys().into_iter().filter(named).collect();
    match found.is_empty() {
        true => keys().into_iter().filter(|key| key.meaning.to_lowercase().contains(&word)).collect(),
        false => found,
    }
}
