//! Commands and options. [`read`] reads the command line; where it cannot be read, it says what was meant as far as that can be told.

use super::print;
use super::refused::{self, Refused};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use cutis::scene::{PRECONDITIONERS, Preconditioner, nearest};
use std::ffi::{OsStr, OsString};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

const ABOUT: &str = "GPU soft-tissue engine: layered skin that is pressed and cut";

const LONG_ABOUT: &str = "GPU soft-tissue engine: layered skin that is pressed and cut, on any vendor's GPU or on the CPU.

Without a command, the built-in incision runs: a scalpel slices 10 mm along three-layer skin. Pictures, tables and meshes for ParaView \
are then in `out/`.";

const AFTER: &str = "Exit status: 0 done; 1 a check or a comparison failed, or the machine or disk did; 2 bad input; 3 no usable adapter; \
129, 130 or 143 a run that SIGHUP, SIGINT (Ctrl-C) or SIGTERM ended, with the report of its completed steps.";

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "cutis", version, about = ABOUT, long_about = LONG_ABOUT, after_help = AFTER)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// What to do; `run` when nothing is said.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Of `run`.
    #[command(flatten)]
    pub run: Run,
}

/// Commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scene: report.json, tables, pictures and meshes (the default)
    ///
    /// Steps the scene to its end, writes DIR/report.json, probes.csv, solver.csv, energy.csv, contacts.csv, haptic.csv,
    /// frames/*.png, volume.pvd, surface.pvd, tools.pvd and contacts.pvd, and evaluates the scene's [check] table: a failed check is exit status 1.
    Run(Run),
    /// Run a scene on the GPU and on the CPU path and list the differences
    ///
    /// Three comparisons: the patch under 10 kPa without tools, solved to 1e-6 and to the scene's own tolerance, node by node; then
    /// the scene as it is, by live mass, cut links and peak force, because contact makes trajectories chaotic. Exit status 1 if a
    /// difference is beyond its bound.
    Compare(Compare),
    /// Run a scene in many settings and say how fast and how wrong each is
    ///
    /// Element, preconditioner, tolerance or iterations, grid, step, precision, backend and contact correction, as the scene's [study]
    /// table lists them, against the scene on a finer grid solved exactly (or known values). Writes DIR/study.csv, study.md and study.svg.
    Study(Study),
    /// Run scenes whose answer is known, and list reference, result and error side by side
    ///
    /// Patch tests, beams, skin blocks of three loads, Hertz, spheres, vibrations, energy, momentum, friction, a stack, cutting work; the
    /// scenes are inside the program. With --out DIR, writes DIR/verification.md, verification.csv and verification.json. Exit status 1
    /// if a case misses its bound.
    Verify(Verify),
    /// Run a scene in a browser: watch it, hold its tools with the mouse, change it while it runs
    ///
    /// Prints an address; the page there shows skin and tools, plots forces and times, pauses, steps, goes back, and changes friction,
    /// stiffness, tolerance and step. Any number of pages join. Ends with Ctrl-C.
    Serve(Serve),
    /// Run a scene in a window: watch it, hold its tools with the mouse, change it while it runs
    ///
    /// The window shows skin and tools, plots forces and times, pauses, steps, goes back, and changes friction, stiffness, tolerance and step;
    /// P saves a picture, F a film (an animated PNG). Needs a display and a program built with `--features view`.
    View(View),
    /// List the arrays, kernels, launches and read-backs of a scene; nothing runs, no adapter is needed
    Inspect(Inspect),
    /// Read and validate scenes
    Check(Check),
    /// Explain the keys of scene files: default, range, meaning
    Keys(Keys),
    /// Examine a mesh file: counts, sizes, quality, boundary, defects; draw it, mend it, convert it
    ///
    /// Reads Gmsh .msh (2.2, 4.1), legacy .vtk, .vtu, .obj, .stl and .ply; --out writes them (but .vtk) by their ending. A mesh with defects
    /// is no error: they are listed, with what comes of each.
    Mesh(Mesh),
    /// Draw force, probes, energy, convergence and computing time of a run over its time, as SVG and PNG
    ///
    /// Reads the tables and the report in DIR and writes DIR/plots/force.svg and .png, probes, energy, residual and timing, as far as there is
    /// something to draw.
    Plot(Plot),
    /// Make pictures and a film of a run from its saved surfaces, coloured by displacement, velocity, stress or layer
    ///
    /// Reads the meshes in DIR (of the pictures that --frames asked for) and writes DIR/render/frame_0001.png … and film.png, an animated PNG
    /// that browsers play.
    Render(Render),
    /// List the adapters of this machine and say which one `--backend auto` takes
    Adapters(Adapters),
    /// Stand in for Haply's Inverse Service: an Inverse3 and a simulated hand that pushes back, on a port of this machine
    ///
    /// Speaks the service's WebSocket frames, so that a scene with a Haply device runs without one. The hand is a mass on a spring; it
    /// moves on by 1 ms per frame of the client. Ends with Ctrl-C.
    HaplyMock(HaplyMock),
}

/// `run`.
#[derive(Args, Clone, Debug)]
pub struct Run {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub target: Target,
    /// Stop after N steps; the scene's checks are evaluated on whole runs only
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with = "seconds", value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: Option<u32>,
    /// Stop after T seconds of the scene
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = positive)]
    pub seconds: Option<f64>,
    /// Pace the steps by the wall clock, with a 1 kHz thread for each device; pictures take time, so think of --frames 0
    #[arg(long)]
    pub realtime: bool,
    /// Keep how each device moved and what it was given in DIR/hand_TOOL.csv, which a scene can take as a `trajectory`
    #[arg(long)]
    pub record: bool,
    /// Write DIR/checkpoint.bin after every N steps, from which a run that was ended goes on with --resume
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with_all = ["realtime", "record"], value_parser = clap::value_parser!(u32).range(1..))]
    pub checkpoint: Option<u32>,
    /// Go on from a checkpoint, with the same scene, options and DIR: the end is that of a run that was not ended
    #[arg(long, value_name = "FILE", conflicts_with_all = ["realtime", "record"])]
    pub resume: Option<PathBuf>,
    /// Folder of the results; files of an earlier run in it are replaced
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Pictures and meshes over the run, instead of the scene's number; 0 for none
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub frames: Option<u32>,
    #[command(flatten)]
    pub solver: Solver,
    /// Print what the steps cost, by part
    #[arg(long, conflicts_with = "json")]
    pub profile: bool,
    /// Print the report as JSON, nothing else, on standard output
    #[arg(long)]
    pub json: bool,
}

/// Where a scene is computed.
#[derive(Args, Clone, Debug)]
pub struct Target {
    /// Where to compute
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// GPU whose name, API or driver contains TEXT; the only way to a software adapter under `auto`
    #[arg(long, value_name = "TEXT")]
    pub adapter: Option<String>,
    /// Precision of the CPU path, f64 when none is given; asks for the CPU path under `auto`
    #[arg(long, value_enum)]
    pub precision: Option<Precision>,
}

/// Overrides of the scene's solver.
#[derive(Args, Clone, Debug)]
pub struct Solver {
    /// Residual of a solve, relative to the step's load
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = fraction)]
    pub tolerance: Option<f64>,
    /// Most iterations of a solve; beyond, the step counts as not converged
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..))]
    pub iterations: Option<u32>,
    /// Preconditioner of the conjugate gradients
    #[arg(long, value_parser = preconditioner())]
    pub preconditioner: Option<Preconditioner>,
}

/// `compare`.
#[derive(Args, Clone, Debug)]
pub struct Compare {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    /// Steps of the scene as it is
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: u32,
    /// GPU whose name, API or driver contains TEXT; hardware first when none is given
    #[arg(long, value_name = "TEXT")]
    pub adapter: Option<String>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `study`.
#[derive(Args, Clone, Debug)]
pub struct Study {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    /// Under two minutes: one setting, on the grid that the scene says for it, and what differs from it in one thing
    #[arg(long)]
    pub quick: bool,
    /// GPU whose name, API or driver contains TEXT, beside the CPU path; a hardware GPU is taken without being named
    #[arg(long, value_name = "TEXT")]
    pub adapter: Option<String>,
    /// Run every setting so many times, one after the other, and take the fastest: for machines that do other things too
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: u32,
    /// Stop a run after so many seconds; its errors are then not known (what others are measured against runs to its end)
    #[arg(long, value_name = "T", allow_hyphen_values = true, default_value = "60", value_parser = positive)]
    pub limit: f64,
    /// Folder of study.csv, study.md and study.svg
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the rows as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `verify`.
#[derive(Args, Clone, Debug)]
pub struct Verify {
    /// The short form: less than a minute, most of it on coarse grids
    #[arg(long)]
    pub quick: bool,
    /// Where to compute; the CPU path when neither this nor --adapter is given
    #[arg(long, value_enum)]
    pub backend: Option<Backend>,
    /// GPU whose name, API or driver contains TEXT
    #[arg(long, value_name = "TEXT")]
    pub adapter: Option<String>,
    /// Precision of the CPU path, f64 when none is given
    #[arg(long, value_enum)]
    pub precision: Option<Precision>,
    /// Folder of verification.md, verification.csv and verification.json; none are written when none is given
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `serve`.
#[derive(Args, Clone, Debug)]
pub struct Serve {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub target: Target,
    /// Address and port to listen on, port 0 for any that is free; on other addresses than this machine's own, pages need the token of the
    /// printed address
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8088", value_parser = address)]
    pub listen: SocketAddr,
    /// Stand still until the page says otherwise
    #[arg(long)]
    pub paused: bool,
}

/// `view`.
#[derive(Args, Clone, Debug)]
pub struct View {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub target: Target,
    /// Stand still until somebody plays
    #[arg(long)]
    pub paused: bool,
    /// Folder of what is saved: view_0001.png, film_0001.png, motion_0001.csv and so on; none is replaced
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub out: PathBuf,
}

/// `inspect`.
#[derive(Args, Clone, Debug)]
pub struct Inspect {
    /// Scene file; the built-in incision when none is given
    pub scene: Option<PathBuf>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `check`.
#[derive(Args, Clone, Debug)]
pub struct Check {
    /// Scene files
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `keys`.
#[derive(Args, Clone, Debug)]
pub struct Keys {
    /// Keys and tables with WORD in their name; all when none is given
    pub word: Option<String>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mesh`.
#[derive(Args, Clone, Debug)]
pub struct Mesh {
    /// Mesh file
    pub file: PathBuf,
    /// Write the mesh to FILE: .msh (2.2), .vtu, .obj, .stl or .ply
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write text instead of binary numbers
    #[arg(long, requires = "out")]
    pub text: bool,
    /// Before writing and drawing, join points at one position, turn inverted tetrahedra, leave out what is unused, repeated or degenerate
    #[arg(long)]
    pub mend: bool,
    /// Draw the surface into a PNG file, coloured by region
    #[arg(long, value_name = "FILE")]
    pub png: Option<PathBuf>,
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `plot`.
#[derive(Args, Clone, Debug)]
pub struct Plot {
    /// Folder of a run
    #[arg(value_name = "DIR", default_value = "out")]
    pub folder: PathBuf,
    /// Print the names of the files as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `render`.
#[derive(Args, Clone, Debug)]
pub struct Render {
    /// Folder of a run
    #[arg(value_name = "DIR", default_value = "out")]
    pub folder: PathBuf,
    /// What the colours are of
    #[arg(long, value_enum, default_value_t = Color::Displacement)]
    pub color: Color,
    /// Width and height, pixels
    #[arg(long, num_args = 2, value_names = ["W", "H"], allow_negative_numbers = true, default_values_t = [960, 640], value_parser = clap::value_parser!(u32).range(1..=8192))]
    pub size: Vec<u32>,
    /// Pictures of the film per second
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub fps: u16,
    /// Position of the camera; all in view from the front right when none is given
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true, value_parser = millimetres)]
    pub eye_mm: Option<Vec<f64>>,
    /// Point that it looks at; the middle when none is given
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true, value_parser = millimetres)]
    pub target_mm: Option<Vec<f64>>,
    /// Print the names of the files as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// Colours of `render`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Color {
    /// Length of the displacement
    Displacement,
    /// Length of the velocity
    Velocity,
    /// Von Mises stress; the scene has to save it: [output] fields = ["stress"]
    VonMises,
    /// Layers, as in the pictures of the run
    Layer,
}

/// `adapters`.
#[derive(Args, Clone, Copy, Debug)]
pub struct Adapters {
    /// Print JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `haply-mock`.
#[derive(Args, Clone, Debug)]
pub struct HaplyMock {
    /// Port to listen on, 0 for any that is free; clients look at 10001 when nothing is said
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = cutis::haptic::haply::mock::PORT)]
    pub port: u16,
    /// Name of the arm
    #[arg(long, value_name = "ID", default_value = "MOCK", value_parser = name)]
    pub device: String,
    /// Name of the grip, whose rotation and buttons the hand has
    #[arg(long, value_name = "ID", default_value = "GRIP", conflicts_with = "no_grip", value_parser = name)]
    pub grip: String,
    /// An arm alone: no rotation and no buttons
    #[arg(long)]
    pub no_grip: bool,
    /// Scene whose recorded hand the simulated one follows; it rests when none is given
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Leave the hand where the last client has left it, instead of beginning anew with the first client of each run
    #[arg(long)]
    pub keep: bool,
    /// End with the end of standard input, for a program that starts the stand-in and may die before it
    #[arg(long)]
    pub until_stdin_ends: bool,
    /// Tool of that scene, the first one when none is given
    #[arg(long, value_name = "NAME", requires = "scene")]
    pub tool: Option<String>,
}

/// Where to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// A hardware GPU if there is one, else the CPU path
    Auto,
    /// The CPU path, on all cores
    Cpu,
    /// A GPU, hardware first; a software adapter if there is no other
    Gpu,
}

/// Of the CPU path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    /// 64 bits, the reference
    F64,
    /// 32 bits, as on the GPU
    F32,
}

/// The scene's words for preconditioners, with what each is.
fn preconditioner() -> impl TypedValueParser<Value = Preconditioner> {
    let value = |(word, kind): (&'static str, Preconditioner)| {
        PossibleValue::new(word).help(match kind {
            Preconditioner::None => "Plain conjugate gradients",
            Preconditioner::Jacobi => "The diagonal",
            Preconditioner::Block => "3×3 blocks of the nodes",
            Preconditioner::Column => "Block-tridiagonal along each column of nodes",
            Preconditioner::Multigrid => "A V-cycle of geometric multigrid; of tetrahedra on a grid around them",
            Preconditioner::Direct => {
                "An exact sparse factor; hexahedra only, on the CPU path, which `auto` then takes"
            }
        })
    };
    let kind = |word: String| PRECONDITIONERS.into_iter().find(|known| known.0 == word).map(|known| known.1);
    PossibleValuesParser::new(PRECONDITIONERS.map(value)).map(move |word| kind(word).expect("one of the values"))
}

fn number(text: &str, wanted: &str, holds: impl Fn(f64) -> bool) -> Result<f64, String> {
    text.parse().ok().filter(|value| holds(*value)).ok_or_else(|| format!("wanted {wanted}"))
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, "seconds above 0", |v| v.is_finite() && v > 0.0)
}

fn millimetres(text: &str) -> Result<f64, String> {
    number(text, "a length in mm", |v| v.abs() < 1e9)
}

fn fraction(text: &str) -> Result<f64, String> {
    number(text, "a number between 0 and 1", |v| v > 0.0 && v < 1.0)
}

fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "wanted an address with a port, as 127.0.0.1:8088".into())
}

fn name(text: &str) -> Result<String, String> {
    let holds = !text.trim().is_empty() && !text.contains(char::is_control);
    if holds { Ok(text.into()) } else { Err("wanted a name, which is not empty and on one line".into()) }
}

/// Arguments of the program; none where help or version was asked for, which is printed here.
pub fn read(words: &[OsString]) -> refused::Result<Option<Cli>> {
    if let Some(word) = words.get(1)
        && is_neither_scene_nor_option(word)
        && !commands().iter().any(|command| word == command.as_str())
    {
        let known = commands();
        let word = word.to_string_lossy().into_owned();
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        return Err(Refused::NoCommand { nearest: nearest(&word, &known).map(String::from), word });
    }
    match Cli::try_parse_from(words) {
        Ok(cli) => Ok(Some(cli)),
        Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            print::written(error.print()).map(|()| None)
        }
        Err(error) => Err(match (error.kind(), command_behind(words)) {
            (ErrorKind::ArgumentConflict, Some(command)) => Refused::OptionBeforeCommand { command },
            _ => Refused::Usage { error },
        }),
    }
}

fn is_neither_scene_nor_option(word: &OsStr) -> bool {
    let text = word.to_string_lossy();
    !text.is_empty() && !text.starts_with('-') && !text.contains(['.', '/', '\\']) && !Path::new(word).exists()
}

/// Names of the commands.
fn commands() -> Vec<String> {
    let help = ["help".to_string()].into_iter();
    Cli::command().get_subcommands().map(|command| command.get_name().to_string()).chain(help).collect()
}

/// Command that stands behind options of its own.
fn command_behind(words: &[OsString]) -> Option<String> {
    commands().into_iter().find(|name| words.iter().skip(2).any(|word| word == name.as_str()))
}
