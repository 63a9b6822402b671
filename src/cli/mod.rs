//! The program: translates arguments to library calls, results to text or JSON, errors to exit codes.

mod args;
mod print;
mod progress;
mod refused;
mod signals;
mod text;

use args::{Backend, Cli, Command, HaplyMock, Precision, Run};
use cutis::bodies::Model;
use cutis::bodies::tetrahedra::with_meshes;
use cutis::error::Error;
use cutis::formats::{self, Encoding, Format};
use cutis::haptic::haply::mock::{Event, Mock, Options};
use cutis::haptic::haply::wire::{ArmKind, GripKind};
use cutis::report::inspect::{self, Purpose};
use cutis::report::{check, compare, mesh, plot, render, run, study, verify};
use cutis::scene::{self, Pose, Preconditioner, Scene, Tool};
use cutis::step::Platform;
use cutis::{runner, serve, session};
use refused::{Refused, Result};
use serde_json::{Value, json};
use signals::Signals;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Exit status of a completed command whose check or comparison failed.
const FAILED: u8 = 1;

/// Stack of the main thread that is grown at the start, bytes: twice what runs were seen to take. One that cannot grow later, for want of
/// memory, would end the program without a word.
const STACK: usize = 512 << 10;

/// Grows the stack by so many bytes.
#[inline(never)]
fn grow_stack(bytes: usize) {
    let part = std::hint::black_box([0u8; 16 << 10]);
    if bytes > part.len() {
        grow_stack(bytes - part.len());
    }
    std::hint::black_box(&part);
}

/// Runs the requested command.
pub fn main() -> ExitCode {
    grow_stack(STACK);
    signals::survive_file_limits();
    let words: Vec<OsString> = std::env::args_os().collect();
    let as_json = words.iter().any(|word| word == "--json");
    let done = args::read(&words).and_then(|cli| cli.map_or(Ok(0), obey));
    ExitCode::from(done.unwrap_or_else(|error| {
        if as_json {
            // what cannot be printed is said on standard error
            print::json(&json!({ "error": error.to_string() })).ok();
        }
        match &error {
            Refused::Usage { error } => drop(error.print()),
            _ => print::note(format_args!("error: {error}")),
        }
        error.exit_code()
    }))
}

fn obey(cli: Cli) -> Result<u8> {
    runner::check_threads()?;
    match cli.command.unwrap_or(Command::Run(cli.run)) {
        Command::Run(args) => run_scene(&args),
        Command::Compare(args) => compare_paths(&args),
        Command::Study(args) => study_scene(&args),
        Command::Verify(args) => verify_answers(&args),
        Command::Serve(args) => serve_scene(&args),
        Command::View(args) => view_scene(&args),
        Command::Inspect(args) => inspect_scene(&args),
        Command::Check(args) => check_scenes(&args),
        Command::Keys(args) => list_keys(&args),
        Command::Mesh(args) => examine_mesh(&args),
        Command::Plot(args) => plot_results(&args),
        Command::Render(args) => render_results(&args),
        Command::Adapters(args) => list_adapters(args),
        Command::HaplyMock(args) => stand_in(&args),
    }
}

/// Reads the scene at a path, or the built-in one.
fn read(path: Option<&PathBuf>) -> Result<Scene> {
    Ok(path.map_or_else(scene::incision, |path| scene::read(path))?)
}

fn run_scene(args: &Run) -> Result<u8> {
    let mut scene = read(args.scene.as_ref())?;
    // options override the scene's values
    let solver = &mut scene.solver;
    solver.tolerance = args.solver.tolerance.unwrap_or(solver.tolerance);
    solver.max_iterations = args.solver.iterations.unwrap_or(solver.max_iterations);
    solver.preconditioner = args.solver.preconditioner.unwrap_or(solver.preconditioner);
    scene.view.frames = args.frames.unwrap_or(scene.view.frames);
    let of_time = args.seconds.map(|seconds| steps_of(seconds, scene.time.step)).transpose()?;
    // haptic threads need a core of their own
    if args.realtime {
        runner::leave_a_core()?;
    } else {
        runner::take_all_cores()?;
    }
    note(&scene);
    let signals = Signals::catch()?;
    let options = run::Options {
        platform: platform_of(&scene, &args.target)?,
        steps: args.steps.or(of_time),
        out: args.out.clone(),
        realtime: args.realtime,
        record: args.record,
        checkpoint: args.checkpoint,
        resume: args.resume.clone(),
        interrupt: signals.stop.clone(),
    };
    // run with a progress display
    let mut shown = progress::Shown::new(options.steps.unwrap_or(scene.time.steps()));
    let summary = run::run(&scene, &options, &mut |p| shown.update(p));
    shown.end();
    let summary = summary.map_err(|error| match error {
        Error::Interrupted => Refused::Interrupted { code: signals.exit_code() },
        error => error.into(),
    })?;
    // result on standard output, notes on standard error
    if args.json {
        print::json(&summary.report)?;
    } else {
        print::lines(&text::summary(&scene, &summary, &args.out))?;
        if args.profile {
            print::lines(&text::profile(&summary.report))?;
        }
    }
    for (name, count) in &summary.report.warnings {
        print::note(text::warning(name, *count));
    }
    if summary.cut_short && !scene.checks.is_empty() {
        print::note("note: the scene's checks are for the whole run and were not evaluated");
    }
    for failure in &summary.failures {
        print::note(format_args!("check failed: {failure}"));
    }
    Ok(if summary.failures.is_empty() { 0 } else { FAILED })
}

fn serve_scene(args: &args::Serve) -> Result<u8> {
    let (scene, signals, session) = watched(args.scene.as_ref(), &args.target, args.paused)?;
    let options = serve::Options { listen: args.listen, session };
    // whether somebody reads this or not
    let tell = |url: &str| drop(print::line(&format!("open {url} in a browser; Ctrl-C ends")));
    serve::serve(&scene, &options, &mut { tell })?;
    Ok(signals.exit_code())
}

#[cfg(feature = "view")]
fn view_scene(args: &args::View) -> Result<u8> {
    let (scene, signals, session) = watched(args.scene.as_ref(), &args.target, args.paused)?;
    use cutis::window;
    let options = window::Options { session, folder: args.out.clone() };
    let shown = window::show(&scene, &options)?;
    let window::Shown { closed, pictures, seconds, time_s } = shown;
    print::line(&format!("{time_s:.3} s of the scene and {pictures} pictures in {seconds:.1} s"))?;
    Ok(if closed { 0 } else { signals.exit_code() })
}

#[cfg(not(feature = "view"))]
fn view_scene(_: &args::View) -> Result<u8> {
    Err(Refused::NoWindow)
}

/// A scene that is run before somebody, and how.
fn watched(path: Option<&PathBuf>, target: &args::Target, paused: bool) -> Result<(Scene, Signals, session::Options)> {
    let scene = read(path)?;
    inspect::fits(&scene, Purpose::Single)?;
    // haptic threads need a core of their own
    if session::is_live(&scene) {
        runner::leave_a_core()?;
    } else {
        runner::take_all_cores()?;
    }
    note(&scene);
    let signals = Signals::catch()?;
    let options = session::Options { platform: platform_of(&scene, target)?, paused, interrupt: signals.stop.clone() };
    Ok((scene, signals, options))
}

/// Number of steps in a time, at least one.
fn steps_of(seconds: f64, step: f64) -> Result<u32> {
    let steps = (seconds / step).round().max(1.0);
    if steps > f64::from(u32::MAX) { Err(Refused::Seconds { seconds, steps }) } else { Ok(steps as u32) }
}

/// Prints the notes on a scene.
fn note(scene: &Scene) {
    scene.notes().iter().for_each(|note| print::note(format_args!("note: {note}")));
}

/// Backend for a scene.
fn platform_of(scene: &Scene, target: &args::Target) -> Result<Platform> {
    let (backend, adapter) = (target.backend, target.adapter.as_deref());
    platform(backend, adapter, target.precision, scene.solver.preconditioner == Preconditioner::Direct)
}

/// Backend of a run: the hardware GPU if there is one, else the CPU path; a software adapter only on request. With `direct` solves, the CPU
/// path.
fn platform(backend: Backend, adapter: Option<&str>, precision: Option<Precision>, direct: bool) -> Result<Platform> {
    let cpu = match precision.unwrap_or(Precision::F64) {
        Precision::F64 => Platform::Cpu64,
        Precision::F32 => Platform::Cpu32,
    };
    if adapter.is_some() && (backend == Backend::Cpu || precision.is_some()) {
        return Err(Refused::AdapterForCpu);
    }
    if direct && (backend == Backend::Gpu || adapter.is_some()) {
        return Err(Refused::DirectOnGpu);
    }
    match backend {
        Backend::Cpu => Ok(cpu),
        Backend::Gpu if precision == Some(Precision::F64) => Err(Refused::DoubleOnGpu),
        Backend::Gpu => {
            note_software(adapter);
            Ok(Platform::Gpu(adapter.map(String::from)))
        }
        Backend::Auto if adapter.is_some() => Ok(Platform::Gpu(adapter.map(String::from))),
        Backend::Auto if precision.is_some() || direct => Ok(cpu),
        Backend::Auto => Ok(inspect::automatic().map_or(cpu, |_| Platform::Gpu(None))),
    }
}

/// Prints a note when `--backend gpu` without an adapter name ends on a software adapter.
fn note_software(adapter: Option<&str>) {
    let first = cutis::gpu::adapters().into_iter().next();
    if let (None, Some(first)) = (adapter, first.filter(|a| a.software)) {
        print::note(format_args!(
            "note: no hardware GPU; `{}` is a software adapter: a GPU's results at less than the CPU path's speed",
            first.name
        ));
    }
}

fn compare_paths(args: &args::Compare) -> Result<u8> {
    runner::take_all_cores()?;
    let scene = read(args.scene.as_ref())?;
    note_software(args.adapter.as_deref());
    let result = compare::compare(&scene, args.adapter.as_deref(), args.steps, &mut |stage| print::note(stage))?;
    let holds = result.rows.iter().all(compare::Row::holds);
    if args.json {
        let row = |r: &compare::Row| json!({ "name": r.name, "cpu": r.cpu, "gpu": r.gpu, "difference": r.difference, "bound": r.bound, "holds": r.holds() });
        let rows: Vec<Value> = result.rows.iter().map(row).collect();
        print::json(&json!({
            "scene": scene.file.display().to_string(),
            "adapter": result.gpu.adapter,
            "driver": result.gpu.driver,
            "steps": result.steps,
            "holds": holds,
            "rows": rows,
        }))?;
    } else {
        print::lines(&text::comparison(&result))?;
    }
    Ok(if holds { 0 } else { FAILED })
}

fn study_scene(args: &args::Study) -> Result<u8> {
    runner::take_all_cores()?;
    let scene = read(args.scene.as_ref())?;
    let gpu = match &args.adapter {
        Some(text) => Some(Platform::Gpu(Some(text.clone()))),
        None => inspect::automatic().map(|_| Platform::Gpu(None)),
    };
    let options =
        study::Options { gpu, quick: args.quick, limit_s: args.limit, repeats: args.repeats, out: args.out.clone() };
    let mut shown = progress::Share::new();
    let result = study::study(&scene, &options, &mut |p| shown.update(p));
    shown.end();
    let result = result?;
    if args.json {
        print::json(&result.to_json())?;
    } else {
        print::lines(&text::study(&result, &args.out))?;
    }
    for line in result.failures() {
        print::note(format_args!("warning: not run: {line}"));
    }
    Ok(0)
}

fn verify_answers(args: &args::Verify) -> Result<u8> {
    // a page of the CPU path unless a GPU is asked for: its figures are the same on every machine
    let backend = args.backend.unwrap_or(if args.adapter.is_some() { Backend::Auto } else { Backend::Cpu });
    let platform = platform(backend, args.adapter.as_deref(), args.precision, false)?;
    runner::take_all_cores()?;
    let mut folder = args.out.as_deref().map(verify::open).transpose()?;
    let page = verify::verify(&platform, args.quick, &mut |number, all, case| {
        print::note(format_args!("{}/{all}: {}", number + 1, case.name));
    })?;
    if let Some(folder) = &mut folder {
        verify::write(&page, folder)?;
    }
    if args.json {
        print::json(&page.to_json())?;
    } else {
        print::lines(&text::verification(&page, args.out.as_deref()))?;
    }
    Ok(if page.missed().is_empty() { 0 } else { FAILED })
}

fn inspect_scene(args: &args::Inspect) -> Result<u8> {
    runner::take_all_cores()?;
    let scene = read(args.scene.as_ref())?;
    let plan = inspect::inspect(&scene)?;
    note(&scene);
    if args.json {
        print::json(&plan)?;
    } else {
        print::lines(&text::plan(&plan))?;
    }
    Ok(0)
}

fn check_scenes(args: &args::Check) -> Result<u8> {
    let read = |path: &PathBuf| -> Result<Scene> {
        let scene = scene::read(path)?;
        check::known(&scene)?;
        inspect::fits(&scene, Purpose::Single)?;
        // what only the set-up of a body refuses
        let meshed = with_meshes(&scene)?;
        (0..meshed.skins.len())
            .try_for_each(|body| Model::of_sizes(&meshed, body).map(drop))
            .map_err(|e| e.of_scene(&scene))?;
        Ok(scene)
    };
    let mut worst = 0;
    let mut list = vec![];
    for path in &args.scenes {
        let name = path.display().to_string();
        let result = read(path);
        match &result {
            Ok(scene) if args.json => {
                let notes = scene.notes();
                list.push(json!({ "scene": name, "valid": true, "title": scene.title, "notes": notes }));
            }
            Ok(scene) => {
                print::line(&format!("{name}: valid: {}", scene.title))?;
                note(scene);
            }
            Err(error) => {
                worst = worst.max(error.exit_code());
                if args.json {
                    list.push(json!({ "scene": name, "valid": false, "error": error.to_string() }));
                }
                print::note(format_args!("error: {error}"));
            }
        }
    }
    if args.json {
        print::json(&list)?;
    }
    Ok(worst)
}

fn list_keys(args: &args::Keys) -> Result<u8> {
    let found = scene::keys::matching(args.word.as_deref());
    if found.is_empty() {
        return Err(Refused::NoKey { word: args.word.clone().unwrap_or_default() });
    }
    if args.json {
        let row = |k: &scene::keys::Key| json!({ "table": k.table, "key": k.name, "default": k.default, "range": k.range, "meaning": k.meaning });
        print::json(&found.iter().map(row).collect::<Vec<Value>>())?;
    } else {
        print::lines(&text::keys(&found))?;
    }
    Ok(0)
}

fn examine_mesh(args: &args::Mesh) -> Result<u8> {
    runner::take_all_cores()?;
    // endings first: a large file takes its time
    let format = args.out.as_deref().map(Format::of).transpose().map_err(Error::from)?;
    if let (Some(Format::Vtk), Some(path)) = (format, &args.out) {
        return Err(Error::from(formats::Refused::ReadOnly { path: path.clone() }).into());
    }
    let mut shown = progress::Reading::new(std::fs::metadata(&args.file).map_or(0, |file| file.len()));
    let read = formats::read(&args.file, &mut |share| shown.update(share));
    shown.end();
    let mut found = read.map_err(Error::from)?;
    let mut summary = mesh::summary(&found);
    if args.mend {
        found = mesh::mended(&found);
        let after = mesh::summary(&found);
        print::note(format_args!(
            "note: mended: {} points, {} tetrahedra, {} triangles before; what follows is of the mended mesh",
            summary.points, summary.tetrahedra, summary.triangles
        ));
        summary = after;
    }
    if args.json {
        print::json(&summary)?;
    } else {
        print::lines(&text::mesh(&args.file, &summary))?;
    }
    if let (Some(path), Some(format)) = (&args.out, format) {
        let encoding = if args.text { Encoding::Text } else { Encoding::Binary };
        for words in formats::lost(&found, format, encoding) {
            print::note(format_args!("note: {} does not keep {words}", path.display()));
        }
        mesh::save(&found, encoding, path)?;
    }
    if let Some(path) = &args.png {
        mesh::picture(&found, &summary, path)?;
    }
    Ok(0)
}

fn plot_results(args: &args::Plot) -> Result<u8> {
    list_files(&plot::plot(&args.folder)?, args.json)
}

fn render_results(args: &args::Render) -> Result<u8> {
    runner::take_all_cores()?;
    let metres = |values: &Vec<f64>| [0, 1, 2].map(|k| values[k] * 1e-3);
    let options = render::Options {
        folder: args.folder.clone(),
        color: match args.color {
            args::Color::Displacement => render::Color::Displacement,
            args::Color::Velocity => render::Color::Velocity,
            args::Color::VonMises => render::Color::VonMises,
            args::Color::Layer => render::Color::Layer,
        },
        size: [args.size[0], args.size[1]],
        rate: args.fps,
        eye: args.eye_mm.as_ref().map(metres),
        target: args.target_mm.as_ref().map(metres),
    };
    let mut shown = progress::Pictures::new();
    let files = render::render(&options, &mut |done, all| shown.update(done, all));
    shown.end();
    list_files(&files?, args.json)
}

/// Prints the names of the files that a command has written.
fn list_files(files: &[PathBuf], as_json: bool) -> Result<u8> {
    let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    match as_json {
        true => print::json(&names)?,
        false => names.iter().try_for_each(|name| print::line(name))?,
    }
    Ok(0)
}

fn list_adapters(args: args::Adapters) -> Result<u8> {
    let all = cutis::gpu::adapters();
    if args.json {
        // hardware comes first, so `auto` takes the first one or none
        let row = |(k, a): (usize, &cutis::gpu::Adapter)| {
            json!({
                "name": a.name, "backend": a.backend, "driver": a.driver, "software": a.software,
                "binding_bytes_max": a.max_binding, "auto": k == 0 && !a.software,
            })
        };
        print::json(&all.iter().enumerate().map(row).collect::<Vec<Value>>())?;
    } else {
        print::lines(&text::adapters(&all))?;
    }
    Ok(0)
}

/// `cutis haply-mock`: stand-in for Haply's Inverse Service until the program is ended, or standard input where that is asked for.
fn stand_in(args: &HaplyMock) -> Result<u8> {
    let mut options = Options { port: args.port, tell: Some(tell), keep: args.keep, ..Options::default() };
    options.arms = vec![(ArmKind::Inverse3, args.device.clone())];
    options.grips = if args.no_grip { Vec::new() } else { vec![(GripKind::Wired, args.grip.clone())] };
    options.path = args.scene.as_deref().map_or(Ok(Vec::new()), |scene| hand(scene, args.tool.as_deref()))?;
    let mock = Mock::start(options)?;
    let with = if args.no_grip { String::new() } else { format!(" with verse_grip {}", args.grip) };
    let end = if args.until_stdin_ends { "Ctrl-C or the end of standard input ends it" } else { "Ctrl-C ends it" };
    print::line(&format!("listens at {} as inverse3 {}{with}; {end}", mock.url(), args.device))?;
    if !args.until_stdin_ends {
        loop {
            std::thread::park();
        }
    }
    // an unreadable input counts as ended
    std::io::copy(&mut std::io::stdin(), &mut std::io::sink()).ok();
    Ok(0)
}

/// Recorded hand trajectory of a scene's tool.
fn hand(path: &Path, wanted: Option<&str>) -> Result<Vec<Pose>> {
    let scene = scene::read(path)?;
    let held: Vec<Tool> = scene.tools.into_iter().filter(|tool| tool.free.is_none()).collect();
    let names: Vec<String> = held.iter().map(|tool| format!("\"{}\"", tool.name)).collect();
    let found = held.into_iter().find(|tool| wanted.is_none_or(|name| name == tool.name));
    let scene = path.to_path_buf();
    found.map(|tool| tool.trajectory).ok_or_else(|| match wanted {
        Some(name) if !names.is_empty() => Refused::NoTool { scene, name: name.into(), known: names.join(", ") },
        _ => Refused::NoHand { scene },
    })
}

fn tell(event: Event) {
    let line = match event {
        Event::Connected(from) => format!("connected: {from}"),
        Event::Left(from, frames) => format!("left: {from} after {frames} frames"),
    };
    // clients are served whether somebody reads this or not
    print::line(&line).ok();
}
