//! Every key of a scene file. The unit is the end of a key's name: `_mm`, `_ms`, `_kpa`. A default in brackets is what happens without the key, in
//! words; without a default the key is required, or belongs to the choice that its meaning names. Ranges are of the value as it stands in the file.
#![doc = page!()]
#![doc = include_str!("topics.md")]

use super::raw::KEYS;
pub use super::raw::Key;

/// All keys, in the order of the page.
pub fn keys() -> Vec<Key> {
    KEYS.concat()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_says_of_each_key_what_the_list_says() {
        let (mut rest, mut table) = (page!(), "");
        for key in keys() {
            let heading = format!("## {}\n", key.table);
            let row = format!("\n| `{}` | {} | {} | {} |\n", key.name, key.default, key.range, key.meaning);
            let from = if key.table == table { Some(0) } else { rest.find(&heading) };
            let at = from.and_then(|from| Some(from + rest[from..].find(&row)?)).unwrap_or_else(|| panic!("{key:?}"));
            // the rows between are of other keys
            assert_eq!(rest[..at].matches("| `").count(), 0, "{key:?}");
            (rest, table) = (&rest[at + row.len() - 1..], key.table);
        }
        assert_eq!(rest.trim(), "");
    }
}
