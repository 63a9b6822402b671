//! Scenes of the repository in their test forms, run on any path.

use cutis::report::{self, Report, run::Options};
use cutis::scene::{Scene, read};
use cutis::step::Platform;
use std::path::{Path, PathBuf};

pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// Every `*.toml` under scenes/, sorted, with its path from there.
pub fn files() -> Vec<(String, PathBuf)> {
    let mut open = vec![folder()];
    let mut found = vec![];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
            let path = entry.expect("the folder can be listed").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    let name = |p: &Path| p.strip_prefix(self::folder()).expect("it was found there").display().to_string();
    found.into_iter().map(|p| (name(&p).replace('\\', "/"), p)).collect()
}

pub fn scene(path: &Path) -> Scene {
    read(path).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene in its test form, without pictures; none where it has no `[test]` table.
pub fn test_form(path: &Path) -> Option<Scene> {
    let mut scene = scene(path);
    scene.test?;
    scene.view.frames = 0;
    Some(scene.in_test_form())
}

/// The test forms of the hard cases of deformable bodies, by name.
pub fn hard() -> Vec<(String, Scene)> {
    let hard = files().into_iter().filter_map(|(file, path)| {
        let name = file.strip_prefix("hard/")?.strip_suffix(".toml")?.to_string();
        let form = (!scene(&path).skins.is_empty()).then(|| test_form(&path))?;
        Some((name, form.unwrap_or_else(|| panic!("{file} has no [test] table"))))
    });
    hard.collect()
}

/// Runs a scene into a folder of its own.
pub fn report_of(name: &str, scene: &Scene, platform: &Platform) -> Result<Report, String> {
    let mut folder = format!("cutis-forms-{}-{name}-{platform:?}", std::process::id());
    folder.retain(|c| c.is_ascii_alphanumeric() || c == '-');
    let out = std::env::temp_dir().join(folder);
    let options = Options::new(platform.clone(), &out);
    let summary = report::run::run(scene, &options, &mut |_| {}).map_err(|e| format!("{name}: {e}"))?;
    std::fs::remove_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    Ok(summary.report)
}

/// Hard cases of which f32 leaves a true residual of more than twice the tolerance, which is a warning: a displacement rounded to 6e-8 of
/// itself is that much force where a body resists some motions a thousand times as much as others, or has come far.
pub const ROUNDED: &[&str] = &[
    "island",
    "nu_0499",
    "nu_04999",
    "press_50kpa_nu_0499",
    "start_inside_out",
    "stiffness_ratio",
    "stiffness_ratio_tilted",
    "tools_many_points",
];

/// The warning of [`ROUNDED`].
pub const RESIDUAL: &str = "residual_true_above_tolerance";

/// What every run must be: no warning that its `[check]` table does not bound (nodes that are not finite are one; what f32 leaves of
/// [`ROUNDED`] is let pass), all steps, and its `[check]` table.
pub fn passes(name: &str, scene: &Scene, report: &Report) -> Result<(), String> {
    let asked = |warning: &str| scene.checks.iter().any(|c| c.key.strip_prefix("warnings.") == Some(warning));
    let in_f32 = report.backend == "gpu" || report.adapter.ends_with("f32");
    let rounded = |warning: &str| in_f32 && warning == RESIDUAL && ROUNDED.contains(&name);
    let unasked: Vec<_> = report.warnings.iter().filter(|(name, _)| !asked(name) && !rounded(name)).collect();
    let steps = scene.time.steps();
    if !unasked.is_empty() || report.steps != steps {
        return Err(format!("{name}: {} of {steps} steps, {unasked:?}", report.steps));
    }
    let failures = report::check::failures(scene, report);
    let text: Vec<String> = failures.iter().map(ToString::to_string).collect();
    if text.is_empty() { Ok(()) } else { Err(format!("{name}: {}", text.join("; "))) }
}
