//! Rules about the text of the repository that a machine can check.

mod circles;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Longest file in src and kernels, lines before its tests: one topic a file, and a topic may need some.
const LONGEST: usize = 600;

/// Files that are longer, with the reason. An entry that is no longer needed fails the test.
const LONG: &[(&str, &str)] =
    &[("src/scene/invalid.rs", "one variant and one message per kind of bad input; they are read together")];

/// What may lie at the top: the layout that the owner fixed, and the usual files of a repository's root.
const TOP: &[&str] = &[
    "Cargo.toml",
    "Cargo.lock",
    "src",
    "kernels",
    "scenes",
    "tests",
    "benches",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
    "rustfmt.toml",
    ".gitignore",
    ".gitattributes",
    ".ci",
    ".github",
];

fn read(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{name}: {e}"));
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Files that git knows, or would take, and that are there.
fn tracked() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let listing = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard"])
        .current_dir(root)
        .output()
        .expect("these rules are about a git checkout");
    assert!(listing.status.success(), "{}", String::from_utf8_lossy(&listing.stderr));
    let names = String::from_utf8_lossy(&listing.stdout).into_owned();
    names.lines().filter(|name| root.join(name).is_file()).map(String::from).collect()
}

fn in_folder<'a>(files: &'a [String], folders: &'a [&str]) -> impl Iterator<Item = &'a String> {
    files.iter().filter(|f| folders.iter().any(|d| f.starts_with(d)))
}

/// The part of a Rust file before its tests.
fn without_tests(text: &str) -> &str {
    &text[..text.find("#[cfg(test)]").unwrap_or(text.len())]
}

/// The line without its comment.
fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or(line)
}

fn report(rule: &str, found: &[String]) {
    assert!(found.is_empty(), "{rule}:\n  {}", found.join("\n  "));
}

/// Modules with their level, from the architecture page: `main > report > …`, lower levels to the right.
fn levels(page: &str) -> BTreeMap<String, usize> {
    let text: String = page.lines().filter_map(|l| l.strip_prefix("//!")).collect();
    let rule = text.split("Imports go downward:").nth(1).and_then(|r| r.split('.').next());
    let rule = rule.expect("src/lib.rs says `Imports go downward: … > … .`");
    let groups = rule.split('>').enumerate();
    groups.flat_map(|(level, group)| group.split(',').map(move |m| (m.trim().to_string(), level))).collect()
}

/// Modules of the crate that a file's code names.
fn imports(text: &str) -> Vec<(usize, String)> {
    let mut found = vec![];
    for (number, line) in without_tests(text).lines().enumerate() {
        for rest in code(line).split("crate::").skip(1) {
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            found.push((number + 1, name));
        }
    }
    found
}

/// `src/step/mod.rs` and `src/step.rs` belong to `step`, `kernels/…` to `kernels`.
fn module(file: &str) -> String {
    if file.starts_with("kernels/") {
        return "kernels".into();
    }
    let inside = file.trim_start_matches("src/");
    inside.split('/').next().unwrap_or(inside).trim_end_matches(".rs").into()
}

fn upward(levels: &BTreeMap<String, usize>, file: &str, text: &str) -> Vec<String> {
    let own = module(file);
    let Some(own_level) = levels.get(&own) else {
        return vec![format!("{file}: module `{own}` is not in the order of src/lib.rs")];
    };
    let mut wrong = vec![];
    for (line, name) in imports(text) {
        match levels.get(&name) {
            _ if name == own => {}
            None => wrong.push(format!("{file}:{line}: `{name}` is not in the order of src/lib.rs")),
            Some(level) if level > own_level => {}
            // the one error type holds those of the modules that make them
            Some(_) if own == "error" => {}
            Some(_) => wrong.push(format!("{file}:{line}: `{own}` imports `{name}`, which is not below it")),
        }
    }
    wrong
}

#[test]
fn imports_go_downward_as_the_architecture_page_says() {
    let levels = levels(&read("src/lib.rs"));
    let files = tracked();
    let sources = in_folder(&files, &["src/", "kernels/"]).filter(|f| f.ends_with(".rs") && *f != "src/lib.rs");
    let wrong: Vec<String> = sources.flat_map(|f| upward(&levels, f, &read(f))).collect();
    report("imports go strictly downward", &wrong);
    // counter-test
    assert_eq!(upward(&levels, "src/gpu/mod.rs", "use crate::step::Platform;\n").len(), 1);
    assert_eq!(upward(&levels, "src/backend/cpu.rs", "let x = crate::nowhere::f();\n").len(), 1);
    assert_eq!(upward(&levels, "src/step/mod.rs", "use crate::math::V3; // crate::main\n").len(), 0);
}

#[test]
fn gpu_knows_no_physics() {
    let files = tracked();
    let kernels = ["kernels::Source", "kernels::text", "kernels::{Source, text}"];
    for file in in_folder(&files, &["src/gpu"]).filter(|f| f.ends_with(".rs")) {
        let text = read(file);
        for line in without_tests(&text).lines().filter(|l| code(l).contains("crate::kernels")) {
            assert!(
                kernels.iter().any(|k| line.contains(k)),
                "{file}: takes more from kernels than shader text: {line}"
            );
        }
    }
    for file in in_folder(&files, &["src/"]).filter(|f| f.ends_with(".rs")) {
        let text = read(file);
        let names_parry = without_tests(&text).lines().any(|l| code(l).contains("parry3d::"));
        assert!(!names_parry || module(file) == "collide", "{file}: `collide` alone names parry3d");
    }
}

#[test]
fn files_are_short() {
    let mut wrong = vec![];
    let files = tracked();
    for file in in_folder(&files, &["src/", "kernels/"]) {
        let lines = without_tests(&read(file)).lines().count();
        let allowed = LONG.iter().any(|l| l.0 == file);
        if lines > LONGEST && !allowed {
            wrong.push(format!("{file}: {lines} lines without tests, at most {LONGEST}"));
        } else if lines <= LONGEST && allowed {
            wrong.push(format!("{file}: {lines} lines; take it off the list in tests/house/tidy.rs"));
        }
    }
    report("files are short", &wrong);
}

#[test]
fn sources_do_not_panic_on_purpose() {
    let words = [".unwrap()", "panic!(", "todo!(", "unimplemented!("];
    let mut wrong = vec![];
    let files = tracked();
    for file in in_folder(&files, &["src/", "kernels/"]).filter(|f| f.ends_with(".rs")) {
        let text = read(file);
        let lines = without_tests(&text).lines().enumerate();
        wrong.extend(
            lines
                .filter(|(_, l)| words.iter().any(|w| code(l).contains(w)))
                .map(|(n, l)| format!("{file}:{}: {}", n + 1, l.trim())),
        );
    }
    report("no unwrap and no panic in sources; `expect(\"why it cannot fail\")` is allowed", &wrong);
}

#[test]
fn kernels_come_in_pairs() {
    let files = tracked();
    let names = |ending: &str| -> Vec<String> {
        let alone = ["kernels/mod", "kernels/common"];
        let stems = in_folder(&files, &["kernels/"]).filter_map(|f| f.strip_suffix(ending));
        stems.filter(|s| !alone.contains(s)).map(String::from).collect()
    };
    let (shaders, twins) = (names(".wgsl"), names(".rs"));
    assert_eq!(shaders, twins, "every name.wgsl has its name.rs and the other way round");
    assert!(shaders.len() > 10, "{shaders:?}");
}

/// Places of this machine that a text names.
fn machine_paths(text: &str) -> Vec<String> {
    let mut found = vec![];
    for folder in ["work", "root", "home", "tmp", "Users"] {
        let path = format!("/{folder}/");
        for (at, _) in text.match_indices(&path) {
            let before = text[..at].chars().next_back();
            // `https://host/home/` and `a/home/b` are no paths of a machine
            if !before.is_some_and(|c| c.is_alphanumeric() || "._-}*".contains(c)) {
                found.push(text[at..].chars().take(40).collect());
            }
        }
    }
    found
}

#[test]
fn no_file_names_a_path_of_the_machine_it_was_made_on() {
    let mut wrong = vec![];
    for file in tracked() {
        wrong.extend(machine_paths(&read(&file)).into_iter().map(|p| format!("{file}: {p}")));
    }
    report("paths of one machine", &wrong);
    let made = format!("see \"/{}/someone/x\"", "home");
    assert_eq!(machine_paths(&made).len(), 1);
    assert_eq!(machine_paths(&made.replace('"', "https://host")).len(), 0);
}

#[test]
fn nothing_is_left_to_be_done_in_a_comment() {
    let marks = [["TO", "DO"].concat(), ["FIX", "ME"].concat()];
    let mut wrong = vec![];
    for file in tracked() {
        for (number, line) in read(&file).lines().enumerate() {
            if marks.iter().any(|m| line.contains(m.as_str())) {
                wrong.push(format!("{file}:{}: {}", number + 1, line.trim()));
            }
        }
    }
    report("open ends belong into issues", &wrong);
}

/// Functions of the system's C library, which give other bits on other machines; `math::elementary` has them all.
const OF_THE_SYSTEM: &[&str] = &[
    "sin", "cos", "sin_cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2", "exp_m1",
    "ln", "ln_1p", "log", "log2", "log10", "powf", "hypot", "cbrt",
];

/// Lines of a file whose results other machines would not repeat.
fn not_repeated(file: &str, text: &str) -> Vec<String> {
    let asks = |line: &str| {
        OF_THE_SYSTEM.iter().any(|name| {
            let forms = [format!(".{name}("), format!("f64::{name}"), format!("f32::{name}")];
            forms.iter().any(|form| {
                // `f64::cos` and not `f64::consts`
                let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
                line.match_indices(form.as_str()).any(|(at, _)| form.ends_with('(') || ends(&line[at + form.len()..]))
            })
        })
    };
    let lines = without_tests(text).lines().enumerate();
    lines.filter(|(_, l)| asks(code(l))).map(|(n, l)| format!("{file}:{}: {}", n + 1, l.trim())).collect()
}

#[test]
fn results_ask_no_function_of_the_system() {
    let files = tracked();
    // pictures and plots are no results
    let others = ["src/math/", "src/view/", "src/report/", "src/window/"];
    let sources = in_folder(&files, &["src/", "kernels/"]).filter(|f| f.ends_with(".rs"));
    let wrong: Vec<String> = sources
        .filter(|f| !others.iter().any(|other| f.starts_with(other)))
        .flat_map(|f| not_repeated(f, &read(f)))
        .collect();
    report("take these from math::elementary", &wrong);
    assert_eq!(not_repeated("a", "let y = x.hypot(z);\nf(f64::sin);\nuse std::f64::consts::PI;\n").len(), 2);
}

/// Hash maps differ from run to run in the order of their entries.
#[test]
fn results_know_no_hash_map() {
    let files = tracked();
    // ids and names that are looked up
    let others =
        ["src/report/glb.rs", "src/report/mesh.rs", "src/formats/msh.rs", "src/formats/stl.rs", "src/gpu/device.rs"];
    let hashes =
        |text: &str| without_tests(text).lines().any(|l| code(l).contains("HashMap") || code(l).contains("HashSet"));
    let sources = in_folder(&files, &["src/", "kernels/"]).filter(|f| f.ends_with(".rs"));
    let wrong: Vec<String> = sources.filter(|f| !others.contains(&f.as_str()) && hashes(&read(f))).cloned().collect();
    report("take a BTreeMap", &wrong);
    assert!(others.iter().all(|f| hashes(&read(f))) && hashes("use std::collections::HashSet;\n"));
}

/// Lines outside `bodies` that look into what a deformable body is made of.
fn kinds_told_apart(file: &str, text: &str) -> Vec<String> {
    let words = [".grid", ".springs", "Kind::Springs", "Kind::Hexahedra", "hexahedra()", "springs()"];
    let names = |line: &str| {
        words.iter().any(|word| {
            let whole = |at: usize| {
                let (before, after) = (&line[..at], &line[at + word.len()..]);
                !before.ends_with('.') && !after.starts_with(|c: char| c.is_alphanumeric() || "_(".contains(c))
            };
            line.match_indices(word).any(|(at, _)| !word.starts_with('.') || whole(at))
        })
    };
    let lines = without_tests(text).lines().enumerate();
    lines.filter(|(_, l)| names(code(l))).map(|(n, l)| format!("{file}:{}: {}", n + 1, l.trim())).collect()
}

#[test]
fn kinds_of_bodies_are_told_apart_in_bodies_alone() {
    let files = tracked();
    let sources = in_folder(&files, &["src/"]).filter(|f| f.ends_with(".rs") && !f.starts_with("src/bodies/"));
    let wrong: Vec<String> = sources.flat_map(|f| kinds_told_apart(f, &read(f))).collect();
    report("ask `Model`, `Wound` and the seams in src/bodies", &wrong);
    let made = "let x = model.grid.edge;\nif model.springs().is_some() {}\nlet y = Params { ..grid };\nmatch kind { Kind::Springs(_) => 1 }\n";
    assert_eq!(kinds_told_apart("a", made).len(), 3);
}

#[test]
fn a_material_law_is_named_in_few_files() {
    let files = tracked();
    let naming = |law: &str| {
        // prose aside
        let names = |f: &&String| !f.ends_with("topics.md") && code_of(&read(f)).to_lowercase().contains(law);
        in_folder(&files, &["src/", "kernels/"]).filter(names).cloned().collect::<Vec<_>>()
    };
    let found = naming("mooney_rivlin");
    let by_type = naming("mooneyrivlin");
    let all: std::collections::BTreeSet<&String> = found.iter().chain(&by_type).collect();
    assert!((5..=8).contains(&all.len()), "a law is one pair of kernels, an arm and its keys: {all:#?}");
}

/// Code without comments and tests.
fn code_of(text: &str) -> String {
    without_tests(text).lines().map(code).collect::<Vec<_>>().join("\n")
}

/// Dependencies without a comment on the line above.
fn unexplained(manifest: &str) -> Vec<String> {
    let (mut inside, mut before, mut wrong) = (false, "", vec![]);
    for line in manifest.lines() {
        if line.starts_with('[') {
            inside = line.trim_end_matches(']').ends_with("dependencies");
        } else if inside && line.contains('=') && !line.starts_with('#') && !before.starts_with("# ") {
            wrong.push(line.to_string());
        }
        before = line;
    }
    wrong
}

#[test]
fn every_dependency_says_what_it_is_for() {
    report("Cargo.toml: no comment above", &unexplained(&read("Cargo.toml")));
    let made = "[dependencies]\n# Why.\na = \"1\"\nb = \"2\"\n[dev-dependencies]\nc = \"3\"\n[lints.rust]\nd = \"4\"\n";
    assert_eq!(unexplained(made), ["b = \"2\"", "c = \"3\""]);
}

#[test]
fn the_top_holds_what_the_owner_fixed_and_no_more() {
    let files = tracked();
    let strange: Vec<String> =
        files.iter().filter_map(|f| f.split('/').next()).filter(|top| !TOP.contains(top)).map(String::from).collect();
    report("the top level", &strange);
    for folder in &TOP[..7] {
        let there = files.iter().any(|f| f == folder || f.starts_with(&format!("{folder}/")));
        assert!(there, "{folder} is missing");
    }
}

#[test]
fn no_files_take_names_from_each_other_in_a_circle() {
    let files: Vec<(String, String)> = in_folder(&tracked(), &["src/", "kernels/"])
        .filter(|name| name.ends_with(".rs") && *name != "src/main.rs")
        .map(|name| (name.clone(), read(name)))
        .collect();
    let found: Vec<String> = circles::circles(&files).into_iter().map(|circle| circle.join("; ")).collect();
    report("files in a circle", &found);
}

/// `src/error.rs` names the errors of every module, so none of them names it.
#[test]
fn errors_of_modules_do_not_name_their_sum() {
    let makers: Vec<String> = in_folder(&tracked(), &["src/"])
        .filter(|name| ["/refused.rs", "/failed.rs", "/invalid.rs"].iter().any(|end| name.ends_with(end)))
        .filter(|name| !name.starts_with("src/cli/"))
        .cloned()
        .collect();
    assert!(makers.len() > 4, "{makers:?}");
    let wrong: Vec<String> = makers.into_iter().filter(|name| read(name).contains("crate::error")).collect();
    report("names crate::error", &wrong);
}

#[test]
fn a_circle_of_files_is_noticed() {
    let file = |name: &str, text: &str| (name.to_string(), text.to_string());
    let root = file("src/m/mod.rs", "pub mod a;\npub mod b;\n");
    let list = |a: &str, b: &str| circles::circles(&[root.clone(), file("src/m/a.rs", a), file("src/m/b/mod.rs", b)]);
    assert!(list("use super::b::B;\npub struct A;\n", "pub struct B;\n").is_empty());
    assert_eq!(list("use super::b::B;\npub struct A;\n", "pub struct B;\nfn f() -> crate::m::a::A {}\n").len(), 1);
    // through a name that a third module passes on, and through what is under a module
    let passed = [
        file("src/m/mod.rs", "pub mod a;\npub mod c;\n"),
        file("src/m/a.rs", "use crate::m::c::{self, D};\npub struct A(D);\n"),
    ];
    let third = |d: &str| {
        let files =
            [&passed[..], &[file("src/m/c/mod.rs", "mod d;\npub use d::D;\n"), file("src/m/c/d.rs", d)]].concat();
        circles::circles(&files)
    };
    assert!(third("pub struct D;\n").is_empty());
    assert_eq!(third("pub struct D;\nuse crate::m::{\n    a::A,\n};\n").len(), 1);
}
