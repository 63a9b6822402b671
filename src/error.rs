//! The one error type: where, what was found, what was wanted, what to do.
//!
//! Every message is one paragraph. Input from users ends here; a broken invariant of this crate is an `assert!` instead.
//! Messages show numbers as the file has them, in the file's units.

use std::fmt;
use std::path::{Path, PathBuf};

/// What every fallible function of this crate returns.
pub type Result<T> = std::result::Result<T, Error>;

/// A line of a file; lines count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: PathBuf,
    /// Line in it, from 1.
    pub line: usize,
}

impl Place {
    /// The given line of the given file.
    pub fn new(file: &Path, line: usize) -> Place {
        Place { file: file.to_path_buf(), line }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file.display(), self.line)
    }
}

/// Everything that can go wrong through the input, the machine or the disk.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The scene file itself cannot be read.
    #[error("{path}: the scene cannot be read ({source}); give the path of a scene file in TOML, as UTF-8 text")]
    SceneRead {
        /// The scene file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },

    /// A scene file without text.
    #[error("{path}: the scene is empty; start from a scene that works, for instance scenes/incision.toml")]
    EmptyScene {
        /// The scene file.
        path: PathBuf,
    },

    /// A scene of nothing.
    #[error("{}: the scene has no body; give it a `[skin]`, a `[[block]]`, a `[[tool]]` or a `[[rigid]]`", path.display())]
    NoBodies {
        /// The scene file.
        path: PathBuf,
    },

    /// A neo-Hookean body with what it does not go with.
    #[error("{at}: law = \"neo_hookean\" {why}; {fix}")]
    LawUnfit {
        /// Where.
        at: Place,
        /// What does not fit.
        why: &'static str,
        /// What to do.
        fix: &'static str,
    },

    /// A neo-Hookean cell without volume, where the law has no energy.
    #[error(
        "cell {cell:?} of a neo-Hookean body is inside out at a step's start; take a shorter step_ms, let contacts and held nodes move \
         less in one step, or take law = \"fem\""
    )]
    InsideOut {
        /// Cells along x, y, z.
        cell: [usize; 3],
    },

    /// A state that is no number, at the end of a run that came so far.
    #[error("{}: {what} \"{name}\" is non-finite at {time} s, where the run ends; {fix}", path.display())]
    NonFinite {
        /// The scene file.
        path: PathBuf,
        /// "the tool", "the body", "the hand of the tool".
        what: &'static str,
        /// Its name.
        name: String,
        /// End of the step, s.
        time: f64,
        /// What to do.
        fix: &'static str,
    },

    /// A checkpoint that a run cannot go on from.
    #[error("{}: the checkpoint {what}; {fix}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
        /// What to do.
        fix: &'static str,
    },

    /// A table that a resumed run cannot go on with.
    #[error("{}: the table {what}; resume in the folder of the run that wrote the checkpoint", path.display())]
    TableUnfit {
        /// The table.
        path: PathBuf,
        /// What is wrong with it.
        what: &'static str,
    },

    /// A state of another simulation.
    #[error(
        "the state has {found} {what} where the simulation has {wanted}; restore it in a simulation of the scene that it is of"
    )]
    StateUnfit {
        /// "nodes", "deformable bodies" …
        what: &'static str,
        /// In the state.
        found: usize,
        /// In the simulation.
        wanted: usize,
    },

    /// An integrator that a scene's bodies do not fit.
    #[error("{at}: integrator = \"{found}\" {why}; {fix}")]
    IntegratorUnfit {
        /// Where.
        at: Place,
        /// The integrator.
        found: String,
        /// What does not fit.
        why: &'static str,
        /// What to do.
        fix: &'static str,
    },

    /// A step at which an explicit run would blow up.
    #[error(
        "{}: {name} is stable under integrator = \"symplectic_euler\" up to a step of {stable_ms:.3e} ms, and its step (step_ms over \
         substeps) is {step_ms:.3e} ms; take at least substeps = {substeps} or a smaller step_ms, a smaller rayleigh_stiffness_s, coarser \
         cells, or integrator = \"implicit_euler\"",
        path.display()
    )]
    UnstableStep {
        /// The scene file.
        path: PathBuf,
        /// The body.
        name: String,
        /// ms
        step_ms: f64,
        /// ms
        stable_ms: f64,
        /// Parts of a whole step that are stable.
        substeps: u64,
    },

    /// A table of compliances that a cut would make false.
    #[error("{}: correction = \"precomputed\" knows the uncut body alone, but a tool has a blade; take \"exact\"", path.display())]
    PrecomputedCut {
        /// The scene file.
        path: PathBuf,
    },

    /// Ties that a correction does not hold.
    #[error("{}: correction = \"uncoupled\" lets tied nodes drift apart, as each knows itself alone; take \"exact\"", path.display())]
    UncoupledTies {
        /// The scene file.
        path: PathBuf,
    },

    /// An attachment across a gap.
    #[error(
        "the node at ({:.3}, {:.3}, {:.3}) mm is to be tied to a body that is {distance:.3} mm away from it; let the bodies touch where \
         they are tied, or choose another region",
        at[0],
        at[1],
        at[2]
    )]
    TiedToNothing {
        /// mm
        at: [f64; 3],
        /// mm
        distance: f64,
    },

    /// A body as its own other end.
    #[error("{at}: \"{name}\" is tied to itself; name another body in `to`, or leave `to` away to tie it to its place")]
    TiedToItself {
        /// The name.
        at: Place,
        /// Found.
        name: String,
    },

    /// The text is not TOML.
    #[error(
        "{at}: `{text}` is not TOML ({problem}); mend this line: text in quotes, lists in [ ], tables begin with [name], repeated ones with [[name]]"
    )]
    Syntax {
        /// Where.
        at: Place,
        /// The parser's words.
        problem: String,
        /// The line in question.
        text: String,
    },

    /// A key that is not known in its table.
    #[error("{at}: unknown key `{key}`; {hint}; known here: {known} (`cutis keys` explains them)")]
    UnknownKey {
        /// Where.
        at: Place,
        /// The key found.
        key: String,
        /// The nearest known key, or what to do without one.
        hint: String,
        /// Known keys of this table, with commas.
        known: String,
    },

    /// A key that has to be there.
    #[error("{at}: the key `{key}` is missing; {why}; add it to this table")]
    MissingKey {
        /// The table's first line; line 1 for the file itself.
        at: Place,
        /// The missing key.
        key: String,
        /// What asks for it.
        why: &'static str,
    },

    /// Anchors on a mass that is not the nodes'.
    #[error(
        "{at}: an anchor acts through the masses of nodes, and mass = \"consistent\" lies between them too; \
             use mass = \"lumped\" or \"uniform\", or hold the region with [[boundary]]"
    )]
    AnchoredMass {
        /// Where.
        at: Place,
    },

    /// A mass that the law cannot carry.
    #[error(
        "{at}: mass = \"{found}\" cannot be had with springs or neo-Hookean bricks; use \"lumped\" or \"uniform\", or law = \"fem\""
    )]
    Mass {
        /// Where.
        at: Place,
        /// The word.
        found: String,
    },

    /// A key that contradicts another one.
    #[error("{at}: `{key}` has no effect here; {why}; remove it")]
    NeedlessKey {
        /// Where.
        at: Place,
        /// The key.
        key: &'static str,
        /// When it would have an effect.
        why: &'static str,
    },

    /// A value of another type.
    #[error("{at}: `{text}` holds {found}; wanted {wanted}; rewrite the value")]
    WrongType {
        /// Where.
        at: Place,
        /// The line in question.
        text: String,
        /// The type and value found.
        found: String,
        /// The type wanted.
        wanted: String,
    },

    /// A list of the wrong length.
    #[error("{at}: {key} has {found} entries; wanted {wanted}; write {key} = [..] with {wanted} numbers")]
    Length {
        /// Where.
        at: Place,
        /// The key.
        key: &'static str,
        /// Entries found.
        found: usize,
        /// Entries wanted.
        wanted: usize,
    },

    /// A number out of its range.
    #[error("{at}: {key} = {found:?}; wanted {wanted}, in {unit}; write for example {example:?}")]
    Number {
        /// Where.
        at: Place,
        /// The key, with the index for a list.
        key: String,
        /// The value in the file's unit.
        found: f64,
        /// The range.
        wanted: &'static str,
        /// The file's unit.
        unit: &'static str,
        /// A value in the range.
        example: f64,
    },

    /// A count out of its range.
    #[error("{at}: {key} = {found}; wanted a whole number from {min} to {max}; change the count")]
    Count {
        /// Where.
        at: Place,
        /// The key, with the index for a list.
        key: String,
        /// The count found.
        found: u32,
        /// Smallest count.
        min: u32,
        /// Largest count.
        max: u32,
    },

    /// Poisson's ratio out of range.
    #[error(
        "{at}: poisson = {found:?}; wanted 0 ≤ poisson ≤ 0.4999, as nearly incompressible as is solved reliably; use 0.45 for most tissue"
    )]
    Poisson {
        /// Where.
        at: Place,
        /// The value found.
        found: f64,
    },

    /// Two bounds in the wrong order.
    #[error("{at}: {key}: the lower bound {lower:?} must be {relation} the upper bound {upper:?}; {fix}")]
    Order {
        /// Where.
        at: Place,
        /// The keys that bound.
        key: &'static str,
        /// The lower bound, in the file's unit.
        lower: f64,
        /// "below", or "at most".
        relation: &'static str,
        /// The upper bound, in the file's unit.
        upper: f64,
        /// What to do.
        fix: &'static str,
    },

    /// Steps of a study whose runs have no common times.
    #[error(
        "{at}: a step of {step} ms is no whole part of the longest, {longest} ms, so that runs could not be compared; take halves, fifths, tenths of it"
    )]
    StudyStep {
        /// Where.
        at: Place,
        /// ms
        step: f64,
        /// ms
        longest: f64,
    },

    /// A word that is none of the known ones.
    #[error("{at}: {key} = \"{found}\" is not known; {hint}; known: {known}")]
    Choice {
        /// Where.
        at: Place,
        /// The key.
        key: &'static str,
        /// The word found.
        found: String,
        /// The nearest known word, or what to do without one; boxed, to keep `Error` below 128 bytes.
        hint: Box<str>,
        /// Known words, with commas.
        known: String,
    },

    /// A name that cannot be a column of a table.
    #[error(
        "{at}: the {what} name \"{found}\" cannot be used; wanted a name that is not empty, without commas, quotes, control characters and spaces at its ends; choose a plain name"
    )]
    Name {
        /// Where.
        at: Place,
        /// What is named.
        what: &'static str,
        /// The name found.
        found: String,
    },

    /// The same name twice.
    #[error("{at}: the {what} name \"{name}\" is taken by line {first}; names are unique; rename one of the two")]
    Duplicate {
        /// Where the second one is.
        at: Place,
        /// What is named.
        what: &'static str,
        /// The name.
        name: String,
        /// Line of the first one.
        first: usize,
    },

    /// Axes other than letters of "xyz".
    #[error("{at}: axes = \"{found}\"; wanted one to three different letters of xyz; write for example axes = \"xyz\"")]
    Axes {
        /// Where.
        at: Place,
        /// The text found.
        found: String,
    },

    /// A turn of nodes that are not held in the plane of the turn.
    #[error("{at}: turn_deg turns nodes in the x-y plane, but axes = \"{axes}\" leaves them free there; hold x and y")]
    TurnAxes {
        /// Where the turn is.
        at: Place,
        /// Held axes.
        axes: String,
    },

    /// A colour that is not hexadecimal.
    #[error(
        "{at}: color = \"{found}\"; wanted # and six hexadecimal digits (sRGB); write for example color = \"#e8b9a0\""
    )]
    Color {
        /// Where.
        at: Place,
        /// The text found.
        found: String,
    },

    /// A skin without layers.
    #[error(
        "{at}: the skin has no layers; wanted at least one; add a table [[skin.layer]] with name, thickness_mm, cells, density_kg_m3"
    )]
    NoLayers {
        /// The skin table.
        at: Place,
    },

    /// More nodes than an index can count.
    #[error("{at}: the grid has {found} nodes; at most {limit} can be numbered; make cells fewer")]
    TooManyNodes {
        /// The cells.
        at: Place,
        /// Nodes asked for; the largest u64 stands for more.
        found: u64,
        /// Most nodes.
        limit: u32,
    },

    /// A region that holds no node.
    #[error(
        "{at}: the {region} holds no node of the {grid}; look at its place and size (origin: centre of the bottom; z up), or widen it to a cell at least"
    )]
    NoNode {
        /// The region's name.
        at: Place,
        /// "scene" or "test form".
        grid: &'static str,
        /// Its word.
        region: String,
    },

    /// A direction of no length.
    #[error("{at}: `{key}` has no length; write a direction such as [0, 0, 1]")]
    NoDirection {
        /// The vector.
        at: Place,
        /// Its key.
        key: &'static str,
    },

    /// A box that holds no node.
    #[error(
        "{at}: the box holds no node of the {grid}: none has {min:?} ≤ {axis} ≤ {max:?} mm, where the body reaches from {body_min:?} to {body_max:?} mm in cells of at most {cell:?} mm; widen box_mm along {axis}"
    )]
    EmptyRegion {
        /// The box.
        at: Place,
        /// "scene" or "test form".
        grid: &'static str,
        /// x, y or z.
        axis: char,
        /// Bounds of the box and the body and the cell along the axis, mm.
        min: f64,
        /// mm
        max: f64,
        /// mm
        body_min: f64,
        /// mm
        body_max: f64,
        /// mm
        cell: f64,
    },

    /// A load beside the body.
    #[error(
        "{at}: rectangle_mm reaches from {min:?} to {max:?} mm along {axis}; the top reaches from -{half:?} to {half:?}; move the rectangle onto it"
    )]
    LoadOutside {
        /// The rectangle.
        at: Place,
        /// x or y.
        axis: char,
        /// mm
        min: f64,
        /// mm
        max: f64,
        /// Half of the top's size, mm.
        half: f64,
    },

    /// A probe's point beyond the skin.
    #[error(
        "{at}: the point lies outside the skin: {axis} = {found} mm, where the skin at rest reaches from {min} to {max} mm; move it onto the skin (origin: centre of the bottom; z up)"
    )]
    PointOutside {
        /// The point.
        at: Place,
        /// x, y or z.
        axis: char,
        /// mm
        found: f64,
        /// mm
        min: f64,
        /// mm
        max: f64,
    },

    /// A blade edge that is no line.
    #[error(
        "{at}: edge_mm has {found} different points in a row; wanted at least two, from the tip to the heel, each apart from the one before; add or move points"
    )]
    BladeEdge {
        /// The edge.
        at: Place,
        /// Points before the first repetition or the end.
        found: usize,
    },

    /// A blade of too many pieces.
    #[error(
        "{at}: the blade has {found:e} places that touch; at most {most:e} are looked at; make edge_spacing_mm or flat_spacing_mm larger, or mend edge_mm"
    )]
    BladeSamples {
        /// The edge.
        at: Place,
        /// Samples of edge and flats.
        found: f64,
        /// Most samples.
        most: f64,
    },

    /// A blade whose normal is not across its edge.
    #[error(
        "{at}: the blade's normal is {angle:.1} degrees from the line between tip and heel; wanted 90 within {allowed} degrees, because the blade's plane holds the edge; give the direction across the flats"
    )]
    BladeNormal {
        /// The normal.
        at: Place,
        /// Angle between the two lines, degrees; 0 for a normal or an edge of no length.
        angle: f64,
        /// Allowed departure from 90 degrees.
        allowed: f64,
    },

    /// A round tool that is neither sphere nor capsule.
    #[error(
        "{at}: points_mm of a round tool has {found} points; wanted one, a sphere's centre, or two different ones, the ends of a capsule's axis; change the list"
    )]
    RoundPoints {
        /// The list.
        at: Place,
        /// Points found.
        found: usize,
    },

    /// A vertex of a tool's lines that is not three numbers.
    #[error("{at}: `{found}`; wanted `v` and three finite numbers; mend the line, or export the lines again")]
    LinesNumber {
        /// The `v` line.
        at: Place,
        /// The line.
        found: String,
    },

    /// An index of a tool's lines that no vertex has.
    #[error(
        "{at}: `{found}` is no vertex; {count} `v` lines stand above, so wanted 1 to {count}, or -{count} to -1; mend the index, or move the vertices up"
    )]
    LinesIndex {
        /// The `l` or `p` line.
        at: Place,
        /// The index found.
        found: String,
        /// Vertices so far.
        count: usize,
    },

    /// A line with one end.
    #[error("{at}: the line has {found} vertices; wanted at least two; add one, or write `p` for a point")]
    LinesLone {
        /// The `l` line.
        at: Place,
        /// Vertices found.
        found: usize,
    },

    /// A segment of no length.
    #[error(
        "{at}: vertices {a} and {b} of the line are at the same place; wanted segments with a length; leave one out"
    )]
    LinesShort {
        /// The `l` line.
        at: Place,
        /// The vertices, from 1.
        a: usize,
        /// The other one.
        b: usize,
    },

    /// A vertex of a tool's lines that is too far away.
    #[error(
        "{at}: vertex {vertex} is at {position:?}; in metres that is more than a number can hold; mend its `v` line or mesh_unit_mm of the scene"
    )]
    LinesVertex {
        /// The line that names it.
        at: Place,
        /// From 1.
        vertex: usize,
        /// Coordinates, in units of the file.
        position: [f64; 3],
    },

    /// A file without points and lines.
    #[error(
        "{path}: there are no points and lines; wanted a line `l 1 2` or `p 1` at least; export the tool with its edges"
    )]
    LinesEmpty {
        /// The file.
        path: PathBuf,
    },

    /// A contact filter that a tool cannot have.
    #[error(
        "{at}: filter = \"{filter}\" does not fit the tool \"{tool}\": it is for {fits}; remove the key (each tool then has its own filter), or write filter = \"points\", which fits all"
    )]
    FilterTool {
        /// The filter.
        at: Place,
        /// Its word.
        filter: String,
        /// The tool's name.
        tool: String,
        /// Which tools it fits, and what this one is.
        fits: &'static str,
    },

    /// A hand without places.
    #[error("{at}: path_mm has no rows; wanted at least one [t_s, x, y, z]; write where the hand rests")]
    PathEmpty {
        /// The list.
        at: Place,
    },

    /// A camera that looks at itself.
    #[error("{at}: eye_mm and target_mm are the same point; move eye_mm away from what is looked at")]
    ViewPoint {
        /// The view table.
        at: Place,
    },

    /// A file that the scene names cannot be read.
    #[error("{at}: {key} names {path}, which cannot be read ({reason}); {fix}, or change {key}")]
    File {
        /// Where it is named.
        at: Place,
        /// The key.
        key: &'static str,
        /// The file looked for.
        path: PathBuf,
        /// The system's reason.
        reason: String,
        /// What to do.
        fix: &'static str,
    },

    /// A mesh that is not Wavefront OBJ.
    #[error("{path}: not a readable OBJ mesh ({problem}); export the tool again as Wavefront OBJ")]
    Mesh {
        /// The mesh.
        path: PathBuf,
        /// The reader's words.
        problem: String,
    },

    /// A mesh without triangles.
    #[error("{path}: the mesh has no triangles; wanted at least one face (a line `f 1 2 3`); export it with its faces")]
    MeshEmpty {
        /// The mesh.
        path: PathBuf,
    },

    /// A vertex at no place.
    #[error(
        "{path}: vertex {vertex} is at {position:?}; wanted finite coordinates; mend its `v` line or mesh_unit_mm of the scene"
    )]
    MeshVertex {
        /// The mesh.
        path: PathBuf,
        /// Vertex in order of first use by a face, from 1.
        vertex: usize,
        /// Coordinates, in units of the file.
        position: [f64; 3],
    },

    /// A trajectory without samples.
    #[error(
        "{path}: the trajectory is empty; wanted the line `{header}` and at least one row below it; record the hand again"
    )]
    TrajectoryEmpty {
        /// The trajectory.
        path: PathBuf,
        /// The header wanted.
        header: &'static str,
    },

    /// A trajectory with another header.
    #[error("{at}: the header is `{found}`; wanted `{wanted}`; name, order and unit of the columns must be these")]
    TrajectoryHeader {
        /// Where.
        at: Place,
        /// The line found.
        found: String,
        /// The header wanted.
        wanted: &'static str,
    },

    /// A row with more or fewer columns.
    #[error("{at}: the row has {found} columns; wanted {wanted} (`{header}`); complete or remove the row")]
    TrajectoryColumns {
        /// Where.
        at: Place,
        /// Columns found.
        found: usize,
        /// Columns wanted.
        wanted: usize,
        /// The header.
        header: &'static str,
    },

    /// A cell that is no finite number.
    #[error("{at}: {column} = `{found}`; wanted a finite number; mend the value or remove the row")]
    TrajectoryNumber {
        /// Where.
        at: Place,
        /// The column's name.
        column: &'static str,
        /// The text found.
        found: String,
    },

    /// Time that stands still or runs back.
    #[error("{at}: time_s = {found:?} after {before:?}; times must rise from row to row; sort or remove rows")]
    TrajectoryTime {
        /// Where.
        at: Place,
        /// s
        found: f64,
        /// The row before, s.
        before: f64,
    },

    /// A quaternion that is no rotation.
    #[error(
        "{at}: the quaternion (qx,qy,qz,qw) has length {length:?}; wanted 1 within {allowed:?}; use 0,0,0,1 for no rotation, with the scalar last"
    )]
    TrajectoryRotation {
        /// Where.
        at: Place,
        /// Its length.
        length: f64,
        /// Allowed departure from 1.
        allowed: f64,
    },

    /// No adapter that the program can use.
    #[error("no usable GPU adapter: wanted {wanted}; found {found}; {how}")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What the machine has.
        found: String,
        /// How to get one, or go without.
        how: String,
    },

    /// A thing larger than a limit of the device.
    #[error("{what}: {need} wanted, but {limit_name} is {limit}; {fix}")]
    TooLarge {
        /// What is too large.
        what: String,
        /// What it needs.
        need: u64,
        /// The limit's name.
        limit_name: &'static str,
        /// The limit.
        limit: u64,
        /// What to do.
        fix: String,
    },

    /// A kernel that does not compile.
    #[error(
        "kernel `{kernel}` does not compile: {message}; mend its WGSL, or report it with adapter and driver if the text is unchanged"
    )]
    Shader {
        /// The kernel.
        kernel: String,
        /// The compiler's words.
        message: String,
    },

    /// A buffer that does not fit its binding.
    #[error("kernel `{kernel}`: binding `{name}` {problem}; known bindings: {known}; bind each of them once, by name")]
    Binding {
        /// The kernel.
        kernel: &'static str,
        /// The binding.
        name: String,
        /// Known names, with commas.
        known: String,
        /// What is wrong with it.
        problem: String,
    },

    /// The device stopped working.
    #[error(
        "the GPU device failed: {message}; run again, with a smaller scene or on the CPU if it fails at the same place"
    )]
    Device {
        /// The driver's words.
        message: String,
    },

    /// The machine gives no more memory.
    #[error("no memory is left for {what}: {bytes} bytes were refused; {fix}")]
    Memory {
        /// What was to be stored.
        what: &'static str,
        /// How much of it was asked for at once.
        bytes: u64,
        /// What to do.
        fix: &'static str,
    },

    /// The machine starts no more threads, for which it lacks memory most of the time.
    #[error(
        "the threads cannot be started ({source}); close what takes memory or threads, or raise the limit that this program runs under \
         (ulimit -v, ulimit -u)"
    )]
    Threads {
        /// The system's reason.
        source: std::io::Error,
    },

    /// A result that cannot be written.
    #[error("{path}: cannot be written ({source}); choose a folder that exists, is writable and has space")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },

    /// A picture that cannot be drawn.
    #[error("study.svg cannot be drawn ({message}); study.csv has the same numbers")]
    Plot {
        /// The drawing library's words.
        message: String,
    },

    /// A VTK file that cannot be written.
    #[error("{path}: cannot be written as VTK ({message}); choose a folder that exists, is writable and has space")]
    Vtk {
        /// The file.
        path: PathBuf,
        /// The writer's words.
        message: String,
    },

    /// A system that has no one solution.
    #[error(
        "the step's matrix is not positive definite at node {node:?} of the grid (counted from 0 along x, y, z), axis {axis}: nothing holds a part of the body there that has no mass either, or positions are not finite; hold the body, give it mass, or take a shorter step"
    )]
    NotPositive {
        /// Node along x, y, z.
        node: [usize; 3],
        /// x, y or z.
        axis: char,
    },

    /// An address that is none of the Inverse Service.
    #[error(
        "{url}: no address of an Inverse Service ({problem}); write ws://host:port, for example ws://localhost:10001"
    )]
    HaplyAddress {
        /// What was given.
        url: String,
        /// What is wrong with it.
        problem: String,
    },

    /// Nobody at the Inverse Service's address.
    #[error(
        "{url}: nothing listens there ({reason}); start Haply's Inverse Service, or `cutis haply-mock` as a stand-in, or change the address"
    )]
    HaplyNobody {
        /// The address.
        url: String,
        /// The system's reason.
        reason: String,
    },

    /// Somebody else at the Inverse Service's address.
    #[error(
        "{url}: what listens there is no Inverse Service ({found}); wanted a WebSocket that sends its inventory; look at the port: the service's simulation channel is 10001 unless its settings say otherwise"
    )]
    HaplyNoService {
        /// The address.
        url: String,
        /// What it did instead.
        found: String,
    },

    /// An Inverse Service that speaks other frames, or does not say which.
    #[error(
        "{url}: the Inverse Service says version {found}; wanted {wanted} or newer; update the service, or state its version if it does not tell"
    )]
    HaplyVersion {
        /// The address.
        url: String,
        /// As it was said, or why it was not.
        found: String,
        /// The oldest that will do.
        wanted: String,
    },

    /// An Inverse Service without an arm.
    #[error("{url}: the Inverse Service has no Inverse3; it has {there}; plug one in, switch it on and calibrate it")]
    HaplyNoArm {
        /// The address.
        url: String,
        /// The devices that are there.
        there: String,
    },

    /// A device that the Inverse Service does not have.
    #[error("{url}: the Inverse Service has no {what} \"{id}\"; it has {there}; plug it in, or name one of these")]
    HaplyUnknown {
        /// The address.
        url: String,
        /// "arm" or "grip".
        what: &'static str,
        /// The name wanted.
        id: String,
        /// The devices that are there.
        there: String,
    },

    /// A port that the stand-in of the Inverse Service cannot have.
    #[error(
        "{address}: cannot listen there ({source}); end what listens there (the Inverse Service itself, or another stand-in), or choose another port: --port 0 takes a free one"
    )]
    HaplyPort {
        /// The address.
        address: String,
        /// The system's reason.
        source: std::io::Error,
    },

    /// A command that makes no sense.
    #[error("{what}; {fix}")]
    Usage {
        /// What was asked.
        what: String,
        /// What to do.
        fix: String,
    },
}

impl Error {
    /// Exit status of the program: 2 for bad input, 3 for no usable adapter, 1 for failures of machine or disk.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::NoAdapter { .. } => 3,
            Error::Shader { .. }
            | Error::Binding { .. }
            | Error::Device { .. }
            | Error::Memory { .. }
            | Error::Threads { .. }
            | Error::NonFinite { .. }
            | Error::Write { .. }
            | Error::Plot { .. }
            | Error::Vtk { .. }
            | Error::HaplyNobody { .. }
            | Error::HaplyNoService { .. }
            | Error::HaplyPort { .. } => 1,
            _ => 2,
        }
    }
}
