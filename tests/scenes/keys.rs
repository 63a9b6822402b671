//! The page of keys (`scene::keys`) against the reader of scenes: the same keys, the defaults that it takes, the ranges that it keeps. Both are
//! made of the tables in `src/scene/raw`; a range or a default in words, and a row that the reader passes by, show here.

use cutis::error::{Error, Result};
use cutis::scene::keys::{Key, keys, matching};
use cutis::scene::{Files, Invalid, Scene, parse};
use std::collections::BTreeSet;
use std::path::Path;

const TIP: &str = "v 0 0 0\nv 1 0 2\nv -1 1 2\nv -1 -1 2\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";
const PROBE: &str = "v 0 0 0\nv 0 0 5\nl 1 2\n";

/// A scene with every table. Sections by their header; of two with one header the first is tried.
const SECTIONS: &[(&str, &str)] = &[
    ("", "title = \"All tables\""),
    ("[time]", "step_ms = 5.0\nduration_s = 0.1"),
    ("[solver]", ""),
    ("[skin]", "size_mm = [10.0, 10.0]\ncells = [4, 4]"),
    (
        "[[skin.layer]]",
        "name = \"dermis\"\nthickness_mm = 2.0\ncells = 2\nyoung_kpa = 50.0\npoisson = 0.4\ndensity_kg_m3 = 1000.0",
    ),
    (
        "[[block]]",
        "name = \"fat\"\ncut = \"remove\"\nposition_mm = [30.0, 0.0, 0.0]\nsize_mm = [10.0, 10.0]\ncells = [4, 4]",
    ),
    (
        "[[block.layer]]",
        "name = \"fat\"\nthickness_mm = 2.0\ncells = 2\nyoung_kpa = 50.0\npoisson = 0.4\ndensity_kg_m3 = 1000.0",
    ),
    ("[[boundary]]", "body = \"skin\"\nregion = \"bottom\""),
    ("[[rest_spring]]", "body = \"skin\"\nregion = \"top\"\nstiffness_n_m = 10.0"),
    (
        "[[inclusion]]",
        "body = \"skin\"\nregion = \"sphere\"\ncentre_mm = [0.0, 0.0, 1.0]\nradius_mm = 0.5\nyoung_kpa = 90.0",
    ),
    ("[[load]]", "body = \"skin\"\npressure_kpa = 1.0\nrectangle_mm = [[-2.0, -2.0], [2.0, 2.0]]"),
    (
        "[[tool]]",
        "name = \"tip\"\nmesh = \"tip.obj\"\nmass_g = 10.0\ninertia_g_mm2 = [1.0, 1.0, 1.0]\npoints_mm = [[0.0, 0.0, 0.0]]\npath_mm = [[0.0, 0.0, 0.0, 9.0]]",
    ),
    ("[tool.coupling]", ""),
    ("[tool.device]", "kind = \"replay\""),
    (
        "[[tool]]",
        "name = \"knife\"\nmesh = \"tip.obj\"\nmass_g = 10.0\ninertia_g_mm2 = [1.0, 1.0, 1.0]\npath_mm = [[0.0, 0.0, 0.0, 19.0]]",
    ),
    ("[tool.blade]", "edge_mm = [[0.0, 0.0, 0.0], [4.0, 0.0, 4.0]]\nthickness_mm = 0.4"),
    ("[[tool]]", "name = \"ball\"\nmass_g = 10.0\ninertia_g_mm2 = [1.0, 1.0, 1.0]\npath_mm = [[0.0, 0.0, 0.0, 29.0]]"),
    ("[tool.round]", "radius_mm = 2.0\npoints_mm = [[0.0, 0.0, 0.0]]"),
    ("[tool.carve]", ""),
    (
        "[[tool]]",
        "name = \"hook\"\nmesh = \"tip.obj\"\nmass_g = 10.0\ninertia_g_mm2 = [1.0, 1.0, 1.0]\npath_mm = [[0.0, 0.0, 0.0, 39.0]]",
    ),
    ("[tool.lines]", "mesh = \"probe.obj\""),
    ("[[rigid]]", "name = \"stone\"\nradius_mm = 2.0\nmass_g = 5.0\nposition_mm = [0.0, 0.0, 60.0]"),
    ("[[plane]]", "name = \"floor\"\nthrough_mm = [0.0, 0.0, -9.0]\nnormal = [0.0, 0.0, 1.0]"),
    ("[[attach]]", "body = \"fat\"\nregion = \"bottom\""),
    ("[contact]", ""),
    ("[haptic]", ""),
    ("[[probe]]", "name = \"top\"\nkind = \"displacement\"\nbody = \"skin\"\npoint_mm = [0.0, 0.0, 2.0]"),
    ("[check]", "\"cut.length_mm\" = { min = 0.0 }"),
    ("[study]", ""),
    ("[test]", ""),
    ("[view]", ""),
    ("[output]", ""),
];

/// What has to stand beside a key that belongs to a choice: its table's header, the key, lines; `-key` takes a line away, `[skin] key` is
/// of that table, `[[skin.layer]] -key` too.
const BESIDE: &[(&str, &str, &str)] = &[
    (
        "[skin]",
        "spring_stiffness_n_m",
        "law = \"springs\"\nspring_damping_n_s_m = 1.0\n[[skin.layer]] -young_kpa\n[[skin.layer]] -poisson",
    ),
    (
        "[skin]",
        "spring_damping_n_s_m",
        "law = \"springs\"\nspring_stiffness_n_m = 1.0\n[[skin.layer]] -young_kpa\n[[skin.layer]] -poisson",
    ),
    (
        "[[skin.layer]]",
        "break_strain",
        "[skin] law = \"springs\"\n[skin] spring_stiffness_n_m = 1.0\n[skin] spring_damping_n_s_m = 1.0\n-young_kpa\n-poisson",
    ),
    ("[[skin.layer]]", "fibre_kpa", "[skin] law = \"holzapfel\""),
    ("[[skin.layer]]", "fibre_growth", "fibre_kpa = 1.0\n[skin] law = \"holzapfel\""),
    ("[[skin.layer]]", "fibre_dispersion", "fibre_kpa = 1.0\n[skin] law = \"holzapfel\""),
    ("[[skin.layer]]", "fibre_angle_deg", "fibre_kpa = 1.0\n[skin] law = \"holzapfel\""),
    ("[[skin.layer]]", "langer_deg", "fibre_kpa = 1.0\n[skin] law = \"holzapfel\""),
    ("[skin]", "element", "law = \"corotational\""),
    ("[skin]", "start_mm", "start = \"random\""),
    ("[skin]", "start_seed", "start = \"random\"\nstart_mm = 1.0"),
    ("[[load]]", "traction_kpa", "-pressure_kpa"),
    ("[[load]]", "force_n", "-pressure_kpa"),
    ("[[load]]", "at_mm", "-pressure_kpa\n-rectangle_mm\nforce_n = [0.0, 0.0, -1.0]"),
    ("*", "radius_mm", "region = \"sphere\"\ncentre_mm = [0.0, 0.0, 0.0]"),
    ("*", "within_mm", "region = \"plane\"\nthrough_mm = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]"),
    ("*", "margin_mm", "region = \"bottom_rim\""),
    ("[tool.device]", "hand_mass_g", "kind = \"hand\""),
    ("[tool.device]", "hand_stiffness_n_m", "kind = \"hand\""),
    ("[tool.device]", "hand_damping_n_s_m", "kind = \"hand\""),
    ("[tool.device]", "encoder_um", "kind = \"hand\""),
    ("[contact]", "penalty_n_m", "forces = \"penalty\""),
    ("[[attach]]", "friction", "slide = [1.0, 0.0, 0.0]"),
    ("[[attach]]", "resistance_n", "slide = [1.0, 0.0, 0.0]"),
];

/// Header of the section that a key is tried in.
fn header(key: &Key) -> &'static str {
    match (key.table, key.name) {
        ("The file", _) => "",
        ("`[skin]` and `[[block]]`", "name" | "position_mm") => "[[block]]",
        ("`[skin]` and `[[block]]`", _) => "[skin]",
        ("`[[skin.layer]]` and `[[block.layer]]`", _) => "[[skin.layer]]",
        (table, _) => table.trim_matches('`'),
    }
}

/// The scene with lines in one section, in the place of those with the same keys.
fn with(header: &str, lines: &str) -> Result<Scene> {
    let key = |line: &str| line.trim_start_matches('-').split(" = ").next().unwrap_or_default().to_string();
    let mut text = String::new();
    let mut open = true; // the section is still to come
    for (name, own) in SECTIONS {
        let here = open && *name == header;
        open &= !here;
        let elsewhere = format!("{name} ");
        let new: Vec<&str> = match here {
            true => lines.lines().filter(|line| !line.starts_with('[')).collect(),
            false => lines.lines().filter_map(|line| line.strip_prefix(&elsewhere)).collect(),
        };
        let kept = own.lines().filter(|line| !new.iter().any(|other| key(other) == key(line)));
        text += &format!("{name}\n");
        let there = |line: &&str| !line.starts_with('-');
        kept.chain(new.iter().copied()).filter(there).for_each(|line| text += &format!("{line}\n"));
    }
    parse(&text, Path::new("keys.toml"), &Files::Embedded(&[("tip.obj", TIP), ("probe.obj", PROBE)]))
}

/// A key with a value, if any, and what has to stand beside it.
fn given(key: &Key, value: Option<&str>) -> Result<Scene> {
    let own = value.map_or(String::new(), |value| format!("{} = {value}", key.name));
    let of_check = format!("\"cut.length_mm\" = {{ min = 0.0, {own} }}");
    let at = header(key);
    let beside = BESIDE.iter().find(|(table, name, _)| {
        let region =
            *table == "*" && ["[[boundary]]", "[[rest_spring]]", "[[load]]", "[[attach]]", "[[probe]]"].contains(&at);
        (*table == at || region) && *name == key.name
    });
    let on_top =
        if at == "[[load]]" && beside.is_some_and(|(table, ..)| *table == "*") { "\n-rectangle_mm" } else { "" };
    let beside = beside.map_or(String::new(), |(_, _, lines)| format!("\n{lines}{on_top}"));
    let reaction = if at == "[[probe]]" && beside.contains("region") { "\nkind = \"reaction\"" } else { "" };
    match at {
        "[check]" => with(at, &of_check),
        _ => with(at, &format!("{own}{beside}{reaction}")),
    }
}

/// A value in the form of a key whose range asks for some: a number, a list of two or three.
fn shaped(key: &Key, value: &str) -> String {
    match key.range {
        range if range.starts_with("3 numbers") => format!("[{value}, {value}, {value}]"),
        range if range.starts_with("2 ") => format!("[{value}, {value}]"),
        range if range.starts_with("list") => format!("[{value}]"),
        _ => value.to_string(),
    }
}

/// Values beyond a range.
fn beyond(range: &str) -> Vec<String> {
    let interval = range.rsplit(", ").next().unwrap_or(range);
    if range.starts_with("`\"") && !range.contains("rrggbb") {
        return vec!["\"zzz\"".into(), "1".into()];
    }
    if let Some((low, high)) = interval.split_once(" … ") {
        let step = if low.contains('.') || high.contains('.') || high == "4000" || high == "150" { 0.01 } else { 1.0 };
        let (low, high): (f64, f64) = (low.parse().expect("a number"), high.parse().expect("a number"));
        let whole = |x: f64| if step == 1.0 { format!("{x}") } else { format!("{x:?}") };
        return vec![whole(low - step), whole(high + step)];
    }
    match interval {
        "> 0" => vec!["0.0".into(), "-1.0".into(), "nan".into()],
        "≥ 0" => vec!["-1e-9".into(), "inf".into()],
        "0 < x < 1" => vec!["0.0".into(), "1.0".into()],
        "-0.5 < x < 1" => vec!["-0.5".into(), "1.0".into()],
        "true or false" => vec!["1".into(), "\"true\"".into()],
        "number" | "3 numbers" => vec!["nan".into(), "\"x\"".into()],
        _ => vec![],
    }
}

#[test]
fn the_page_has_the_keys_of_the_reader() {
    assert!(with("", "title = \"All\"").is_ok(), "{}", with("", "title = \"All\"").map(|_| ()).expect_err("fails"));
    let headers: BTreeSet<&str> = keys().iter().map(header).chain(["[[block.layer]]"]).collect();
    for at in headers {
        let lines = if at == "[check]" { "\"cut.length_mm\" = { zzz = 1 }" } else { "zzz = 1" };
        let known = match with(at, lines) {
            Err(Error::Scene(invalid)) => match *invalid {
                Invalid::UnknownKey { known, .. } => known,
                other => panic!("{at}: {other}"),
            },
            other => panic!("{at}: {:?}", other.map(|_| ())),
        };
        let known: BTreeSet<String> = known.split(", ").map(String::from).collect();
        let listed = |key: &&Key| {
            let block = at == "[[block]]" && key.table.contains("[[block]]");
            let skin = at == "[skin]" && key.table.contains("`[skin]`");
            let layer = at == "[[block.layer]]" && key.table.contains("[[block.layer]]");
            header(key) == at || block || skin || layer
        };
        let mut page: BTreeSet<String> = keys().iter().filter(listed).map(|key| key.name.to_string()).collect();
        let bodies = ["[skin]", "[[block]]"];
        if bodies.contains(&at) {
            page.insert("layer".into());
        }
        if at.is_empty() {
            let tables =
                SECTIONS.iter().map(|(name, _)| name.trim_matches(['[', ']'])).filter(|name| !name.contains('.'));
            page.extend(tables.filter(|name| !name.is_empty()).map(String::from));
        }
        assert_eq!(page, known, "{at}");
    }
}

#[test]
fn defaults_are_those_of_the_reader() {
    let mut tried = 0;
    for key in keys() {
        let Some(default) = key.default.strip_prefix('`').and_then(|word| word.strip_suffix('`')) else {
            assert!(key.default.is_empty() || key.default.starts_with('('), "{key:?}");
            continue;
        };
        tried += 1;
        let [said, plain] = [Some(default), None].map(|value| {
            let mut scene = given(&key, value).unwrap_or_else(|e| panic!("{key:?}: {e}"));
            // the key moves what stands below it
            scene.lines.clear();
            format!("{scene:?}")
        });
        assert!(said == plain, "{key:?}: its default changes the scene");
    }
    assert!(tried > 50, "{tried} defaults");
    // the counter-test
    let tolerance = keys().into_iter().find(|key| key.name == "tolerance").expect("it is there");
    let of = |value| format!("{:?}", given(&tolerance, value).expect("it is in range"));
    assert!(of(Some("2e-3")) != of(None));
}

#[test]
fn what_is_beyond_a_range_is_refused() {
    let mut tried = 0;
    for key in keys() {
        for value in beyond(key.range) {
            tried += 1;
            let value = shaped(&key, &value);
            assert!(given(&key, Some(&value)).is_err(), "{key:?} takes {value}");
        }
    }
    assert!(tried > 150, "{tried} values");
    // the counter-test: a value within each range of those with one is taken
    for (name, value) in [
        ("friction", "0.0"),
        ("traction_kpa", "[0.0, 0.0, 0.0]"),
        ("at_mm", "[5.0, 0.0, 2.0]"),
        ("max_passes", "100"),
        ("rate_hz", "4000.0"),
        ("size_px", "[8192, 1]"),
    ] {
        let key = keys().into_iter().find(|key| key.name == name).expect("it is there");
        given(&key, Some(value)).unwrap_or_else(|e| panic!("{name} = {value}: {e}"));
    }
}

#[test]
fn a_word_finds_its_keys() {
    assert!(matching(Some("friction")).iter().any(|key| key.table.contains("contact")));
    assert!(matching(Some("Poisson")).iter().all(|key| key.name == "poisson"));
    assert!(matching(Some("Coulomb")).iter().any(|key| key.name == "friction"), "by its meaning");
    assert!(matching(Some("zzz")).is_empty());
    assert_eq!(matching(None).len(), keys().len());
}
