//! `cutis verify`: the short form meets its bounds, what is computed wrongly misses them, and the page says what was run.

use cutis::report::verify::{CASES, Case, Page, Row, open, verify, write};
use cutis::scene::Scene;
use cutis::step::Platform;
use std::sync::LazyLock;

static PAGE: LazyLock<Page> =
    LazyLock::new(|| verify(&Platform::Cpu64, true, &mut |_, _, _| {}).unwrap_or_else(|e| panic!("{e}")));

fn quick() -> impl Iterator<Item = &'static Case> {
    CASES.iter().filter(|case| case.quick)
}

fn words(row: &Row) -> String {
    row.words().join(" | ")
}

#[test]
fn every_answer_of_the_short_form_is_within_its_bound() {
    assert_eq!(PAGE.rows.len(), quick().count());
    PAGE.rows.iter().for_each(|row| println!("{}", words(row)));
    let missed: Vec<String> = PAGE.missed().into_iter().map(words).collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
    assert!(PAGE.rows.iter().all(|row| row.bound < 0.2), "a bound that anything meets");
}

/// A scene with the wrong modulus, damping and toughness; of rigid bodies the wrong friction and gravity.
fn wrong(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for skin in &mut scene.skins {
        skin.rayleigh_mass += 0.5;
        for layer in &mut skin.layers {
            (layer.young, layer.toughness) = (1.3 * layer.young, 1.3 * layer.toughness);
        }
    }
    if scene.skins.is_empty() {
        scene.contact.iter_mut().for_each(|contact| contact.friction *= 0.9);
        scene.time.gravity = scene.time.gravity.map(|g| 1.2 * g);
    }
    scene
}

#[test]
fn wrong_constants_miss_every_bound() {
    for case in quick() {
        let scene = case.scene().unwrap_or_else(|e| panic!("{e}"));
        let row = case.run(&wrong(&scene), &Platform::Cpu64);
        assert!(row.found.is_ok() && !row.holds(), "not noticed: {}", words(&row));
    }
}

/// Static steps of the elastica and at ν 0.4999: f32 leaves 1e-3 and 2e-3 of the forces, more than they may end with, and the page says so.
const BEYOND_SINGLE: [&str; 3] = ["elastica, P L²/EI = 2", "sheared panel, ν 0.4999", "Cook's membrane, ν 0.4999"];

#[test]
fn f32_meets_the_bounds_that_are_stated_for_it() {
    for case in quick().filter(|case| !BEYOND_SINGLE.contains(&case.name)) {
        let scene = case.scene().unwrap_or_else(|e| panic!("{e}"));
        let row = case.run(&scene, &Platform::Cpu32);
        assert!(row.holds(), "{}", words(&row));
    }
}

#[test]
fn f32_refuses_what_it_cannot_balance_and_says_why() {
    for case in quick().filter(|case| BEYOND_SINGLE.contains(&case.name)) {
        let scene = case.scene().unwrap_or_else(|e| panic!("{e}"));
        let said = case.run(&scene, &Platform::Cpu32).found.expect_err("f32 leaves too much");
        assert!(said.contains("f32 may round"), "{}: {said}", case.name);
    }
}

#[test]
fn the_files_have_every_row_and_its_figures() {
    let folder = std::env::temp_dir().join(format!("cutis-known-{}", std::process::id()));
    let mut listing = open(&folder).unwrap_or_else(|e| panic!("{e}"));
    write(&PAGE, &mut listing).unwrap_or_else(|e| panic!("{e}"));
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("it was written");
    let [page, csv, json] = ["verification.md", "verification.csv", "verification.json"].map(read);
    std::fs::remove_dir_all(&folder).expect("it was made");
    let rows = PAGE.rows.len();
    assert_eq!(page.lines().filter(|line| line.starts_with("| ")).count(), rows + 2, "{page}");
    assert!(page.contains(&format!("{rows} of {rows} bounds are met.")), "{page}");
    assert_eq!(csv.lines().count(), rows + 1);
    let json: serde_json::Value = serde_json::from_str(&json).expect("it is JSON");
    assert_eq!(json["rows"].as_array().map(Vec::len), Some(rows));
    for (row, of) in PAGE.rows.iter().zip(json["rows"].as_array().expect("it is a list")) {
        let [found, wanted] = [of["found"].as_f64(), row.found.clone().ok()].map(|v| v.expect("a number"));
        // a reader may round the last digit
        assert!((found - wanted).abs() <= 1e-15 * wanted.abs() && of["holds"] == true, "{found} {wanted}");
    }
    // a row that misses says so
    let mut missed = PAGE.clone();
    missed.rows[0].found = Ok(2.0 * missed.rows[0].case.reference);
    assert!(missed.markdown().contains("**missed**") && missed.markdown().contains(&format!("{} of {rows}", rows - 1)));
    assert_eq!(missed.to_json()["missed"], 1);
}

#[test]
fn every_case_reads_its_scene_and_names_its_reference() {
    for case in CASES {
        let scene = case.scene().unwrap_or_else(|e| panic!("{}: {e}", case.name));
        assert!(!scene.title.is_empty() && !case.source.is_empty() && !case.what.is_empty(), "{}", case.name);
        assert!(case.reference != 0.0 || case.size > 0.0, "{}: errors are relative to nothing", case.name);
    }
}
