//! Files that take names from each other in a circle, by what `use` and paths in their code say. A module and the files under it may: they
//! are parts of one thing.

use std::collections::{BTreeMap, BTreeSet};

/// A module: its file, its children, what it defines, and what names stand for in it.
#[derive(Default)]
struct Module {
    file: String,
    children: BTreeSet<String>,
    defines: BTreeSet<String>,
    /// Name in this module → path from the root; of `use`, also those that others see.
    uses: BTreeMap<String, Vec<String>>,
    /// Paths in the code, from the root.
    paths: Vec<Vec<String>>,
}

type Modules = BTreeMap<Vec<String>, Module>;

fn words(text: &str) -> Vec<String> {
    text.split("::").map(|word| word.trim().to_string()).collect()
}

/// The module of a file: `src/a/mod.rs` and `src/a.rs` are `a`, `src/lib.rs` is the root.
fn module_of(file: &str) -> Vec<String> {
    let inside = match file.strip_prefix("kernels/") {
        Some(rest) => format!("kernels/{rest}"),
        None => file.trim_start_matches("src/").to_string(),
    };
    let path = inside.trim_end_matches(".rs").trim_end_matches("/mod");
    match path {
        "lib" => vec![],
        path => path.split('/').map(String::from).collect(),
    }
}

/// Code without comments, strings and tests.
fn plain(text: &str) -> String {
    let code = &text[..text.find("#[cfg(test)]").unwrap_or(text.len())];
    let mut out = String::new();
    for line in code.lines() {
        let line = line.split("//").next().unwrap_or(line);
        // what stands between quotes is no path
        let parts = line.split('"').enumerate().filter(|(k, _)| k % 2 == 0).map(|(_, part)| part);
        out.push_str(&parts.collect::<Vec<_>>().join("\"\""));
        out.push('\n');
    }
    out
}

/// `a::{b, c::{d, e as f}}` as pairs of a name and its path.
fn flatten(prefix: &[String], tree: &str, out: &mut Vec<(String, Vec<String>)>) {
    let tree = tree.trim();
    if let Some((head, rest)) = tree.split_once('{') {
        let head: Vec<String> =
            words(head.trim().trim_end_matches("::")).into_iter().filter(|w| !w.is_empty()).collect();
        let (mut depth, mut start) = (0, 0);
        let inner = &rest[..rest.rfind('}').unwrap_or(rest.len())];
        let prefix = [prefix, &head].concat();
        for (at, c) in inner.char_indices().chain([(inner.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    flatten(&prefix, &inner[start..at], out);
                    start = at + 1;
                }
                _ => {}
            }
        }
    } else if !tree.is_empty() {
        let (path, name) = tree.split_once(" as ").map_or((tree, None), |(path, name)| (path, Some(name.trim())));
        let mut path = [prefix, &words(path)].concat();
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = name.map(String::from).or(path.last().cloned()).unwrap_or_default();
        out.push((name, path));
    }
}

/// A path from the root, of one in a module; none of another crate's.
fn absolute(own: &[String], module: &Module, path: &[String]) -> Option<Vec<String>> {
    let first = path.first()?.as_str();
    let supers = path.iter().take_while(|word| *word == "super").count();
    if supers > 0 {
        return Some([&own[..own.len().checked_sub(supers)?], &path[supers..]].concat());
    }
    match first {
        "crate" => Some(path[1..].to_vec()),
        "self" => Some([own, &path[1..]].concat()),
        first if module.children.contains(first) => Some([own, path].concat()),
        first => Some([&module.uses.get(first)?[..], &path[1..]].concat()),
    }
}

fn read(own: &[String], file: &str, text: &str, children: BTreeSet<String>) -> Module {
    let code = plain(text);
    let mut module = Module { file: file.into(), children, ..Module::default() };
    let mut rest = String::new();
    let mut found = vec![];
    let mut parts = code.split_inclusive(';');
    let mut pending = String::new();
    // statements that begin with `use` or `pub use` on a line of their own
    for part in &mut parts {
        pending.push_str(part);
        let at = ["\nuse ", "\npub use ", "\npub(crate) use ", "\npub(super) use "]
            .iter()
            .filter_map(|start| format!("\n{pending}").rfind(start).map(|at| (at, start.len())))
            .max();
        match at {
            Some((at, length)) => {
                let text = format!("\n{pending}");
                flatten(&[], text[at + length..].trim_end_matches(';'), &mut found);
                rest.push_str(&text[..at]);
            }
            None => rest.push_str(&pending),
        }
        pending.clear();
    }
    for (name, path) in &found {
        if let Some(path) = absolute(own, &module, path) {
            module.uses.insert(name.clone(), path);
        }
    }
    for line in rest.lines() {
        let words: Vec<&str> = line.trim_start().split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        let kinds = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];
        if let Some(at) = words.iter().position(|word| kinds.contains(word)).filter(|at| *at < 4) {
            module.defines.extend(words.get(at + 1).map(|name| name.to_string()));
        }
    }
    let boundary = |c: char| !(c.is_alphanumeric() || c == '_' || c == ':');
    for word in rest.split(boundary) {
        if let Some(path) = word.contains("::").then(|| absolute(own, &module, &words(word))).flatten() {
            module.paths.push(path);
        }
    }
    module
}

/// The file that defines what a path names, as far as that is in this crate.
fn home(modules: &Modules, path: &[String], depth: u32) -> Option<String> {
    let known = (0..=path.len()).rev().find(|n| modules.contains_key(&path[..*n]))?;
    let module = &modules[&path[..known]];
    let name = path.get(known)?; // of a module itself, what it is used for is told by its paths
    if module.defines.contains(name) || depth == 0 {
        return Some(module.file.clone());
    }
    match module.uses.get(name) {
        Some(other) => home(modules, &[&other[..], &path[known + 1..]].concat(), depth - 1),
        None => Some(module.file.clone()),
    }
}

/// Circles of files, each as a list of its files, and what ties them.
pub fn circles(files: &[(String, String)]) -> Vec<Vec<String>> {
    let names: BTreeSet<Vec<String>> = files.iter().map(|(file, _)| module_of(file)).collect();
    let mut modules = Modules::new();
    for (file, text) in files {
        let own = module_of(file);
        let below = |name: &&Vec<String>| name.len() == own.len() + 1 && name.starts_with(&own);
        let children = names.iter().filter(below).filter_map(|name| name.last().cloned()).collect();
        modules.insert(own.clone(), read(&own, file, text, children));
    }
    // between siblings: each module with all that is under it, by what tells their files apart first
    let mut edges: BTreeMap<Vec<String>, BTreeMap<Vec<String>, String>> = BTreeMap::new();
    for (own, module) in &modules {
        for file in module.uses.values().chain(&module.paths).filter_map(|path| home(&modules, path, 8)) {
            let other = module_of(&file);
            let common = own.iter().zip(&other).take_while(|(a, b)| a == b).count();
            // those of the top have an order of their own, which another rule keeps
            if common > 0 && common < own.len() && common < other.len() {
                let said = format!("{} → {file}", module.file);
                edges.entry(own[..=common].to_vec()).or_default().entry(other[..=common].to_vec()).or_insert(said);
            }
        }
    }
    let reach = |from: &Vec<String>| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = next.pop() {
            for other in edges.get(&module).into_iter().flat_map(BTreeMap::keys) {
                if seen.insert(other.clone()) {
                    next.push(other.clone());
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&Vec<String>, BTreeSet<Vec<String>>> = edges.keys().map(|m| (m, reach(m))).collect();
    let mut out: Vec<Vec<Vec<String>>> = vec![];
    for module in edges.keys().filter(|module| reached[module].contains(*module)) {
        let both = |other: &&Vec<String>| reached[module].contains(*other) && reached[other].contains(module);
        if !out.iter().flatten().any(|known| known == module) {
            out.push(edges.keys().filter(both).cloned().collect());
        }
    }
    out.iter()
        .map(|circle| {
            let ties = circle.iter().flat_map(|module| &edges[module]).filter(|(other, _)| circle.contains(other));
            ties.map(|(_, said)| said.clone()).collect()
        })
        .collect()
}
