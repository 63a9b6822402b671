//! Errors of scenes and of the files that they name: location, what was found, what was wanted, how to fix it.
//!
//! Messages show numbers as the file has them, in the file's units.

use std::fmt;
use std::path::{Path, PathBuf};

/// Result of the functions that read a scene.
pub(super) type Result<T> = std::result::Result<T, Invalid>;

/// Line of a file; lines count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// File name as given by the user.
    pub file: PathBuf,
    /// Line number, from 1.
    pub line: usize,
}

impl Location {
    /// The given line of the given file.
    pub fn new(file: &Path, line: usize) -> Location {
        Location { file: file.to_path_buf(), line }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.file.display(), self.line)
    }
}

/// Error in a scene.
#[derive(Debug, thiserror::Error)]
pub enum Invalid {
    /// The scene file itself cannot be read.
    #[error("{path}: the scene cannot be read ({reason}); give the path of a scene file in TOML, as UTF-8 text")]
    SceneRead {
        /// The scene file.
        path: PathBuf,
        /// Why.
        reason: String,
    },

    /// An invalid part of a scene made in code.
    #[error("{}: scene \"{title}\": {path} is {found}; it has to be {wanted}", file.display())]
    InCode {
        /// Source of the scene, as it states it.
        file: PathBuf,
        /// Title of the scene.
        title: String,
        /// Path of the part in the code.
        path: String,
        /// Its value.
        found: String,
        /// Allowed values.
        wanted: &'static str,
    },

    /// A scene file without text.
    #[error("{path}: the scene is empty; start from a scene that works, for instance scenes/incision.toml")]
    EmptyScene {
        /// The scene file.
        path: PathBuf,
    },

    /// A scene without bodies.
    #[error("{}: the scene has no body; give it a `[skin]`, a `[[block]]`, a `[[tool]]` or a `[[rigid]]`", path.display())]
    NoBodies {
        /// The scene file.
        path: PathBuf,
    },

    /// A hyperelastic body combined with something it does not support.
    #[error("{at}: law = \"{law}\" {why}; {fix}")]
    LawUnfit {
        /// Where.
        at: Location,
        /// Name of the law.
        law: &'static str,
        /// Reason.
        why: &'static str,
        /// Remedy.
        fix: &'static str,
    },

    /// An integrator that does not support the scene's bodies.
    #[error("{at}: integrator = \"{found}\" {why}; {fix}")]
    IntegratorUnfit {
        /// Where.
        at: Location,
        /// The integrator.
        found: String,
        /// Reason.
        why: &'static str,
        /// Remedy.
        fix: &'static str,
    },

    /// Precomputed compliances in a scene with a blade or springs that break, which would invalidate them.
    #[error(
        "{at}: correction = \"precomputed\" has the compliance of the whole body, but a tool has a blade or springs break; take \"exact\""
    )]
    PrecomputedCut {
        /// Where.
        at: Location,
    },

    /// Tool that carves where it cannot.
    #[error("{at}: the tool \"{tool}\" carves: {what}")]
    Carving {
        /// Where.
        at: Location,
        /// Name of the tool.
        tool: String,
        /// Reason and remedy.
        what: &'static str,
    },

    /// Attachments with a contact correction that cannot hold them.
    #[error(
        "{at}: correction = \"uncoupled\" lets tied nodes drift apart, as it ignores the compliance between nodes; take \"exact\""
    )]
    UncoupledTies {
        /// Where.
        at: Location,
    },

    /// A body attached to itself.
    #[error(
        "{at}: \"{name}\" is tied to itself; name another body in `to`, or leave `to` away to tie it to its rest position"
    )]
    TiedToItself {
        /// Where.
        at: Location,
        /// The body's name.
        name: String,
    },

    /// The text is not TOML.
    #[error(
        "{at}: `{text}` is not TOML ({problem}); mend this line: text in quotes, lists in [ ], tables begin with [name], repeated ones with [[name]]"
    )]
    Syntax {
        /// Where.
        at: Location,
        /// The parser's message.
        problem: String,
        /// The line in question.
        text: String,
    },

    /// A key that is not known in its table.
    #[error("{at}: unknown key `{key}`; {hint}; known here: {known} (`cutis keys` explains them)")]
    UnknownKey {
        /// Where.
        at: Location,
        /// The key found.
        key: String,
        /// The nearest known key, or what to do without one.
        hint: String,
        /// Known keys of this table, with commas.
        known: String,
    },

    /// A missing key.
    #[error("{at}: the key `{key}` is missing; {why}; add it to this table (`cutis keys {key}` explains it)")]
    MissingKey {
        /// The table's first line; line 1 for the file itself.
        at: Location,
        /// The missing key.
        key: String,
        /// What requires it.
        why: &'static str,
    },

    /// An inclusion that a body cannot have.
    #[error("{at}: an inclusion is not possible here: {why}")]
    Inclusion {
        /// Where.
        at: Location,
        /// Why, and what to do.
        why: &'static str,
    },

    /// Rest-shape springs with a consistent mass.
    #[error(
        "{at}: a rest-shape spring needs lumped nodal masses, which mass = \"consistent\" does not have; \
             use mass = \"lumped\" or \"uniform\", or hold the region with [[boundary]]"
    )]
    RestSpringMass {
        /// Where.
        at: Location,
    },

    /// A mass discretisation that the law does not support.
    #[error(
        "{at}: mass = \"{found}\" is not available with springs or a hyperelastic law; use \"lumped\" or \"uniform\", or law = \"corotational\""
    )]
    Mass {
        /// Where.
        at: Location,
        /// The word.
        found: String,
    },

    /// A key that has no effect because of another one.
    #[error("{at}: `{key}` has no effect here; {why}; remove it")]
    NeedlessKey {
        /// Where.
        at: Location,
        /// The key.
        key: &'static str,
        /// When it would have an effect.
        why: &'static str,
    },

    /// A value of another type.
    #[error("{at}: `{text}` holds {found}; wanted {wanted}; rewrite the value")]
    WrongType {
        /// Where.
        at: Location,
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
        at: Location,
        /// The key.
        key: &'static str,
        /// Entries found.
        found: usize,
        /// Entries wanted.
        wanted: usize,
    },

    /// A number out of range.
    #[error("{at}: {key} = {found:?}; wanted {wanted}, in {unit}; write for example {example:?}")]
    Number {
        /// Where.
        at: Location,
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

    /// A count out of range.
    #[error("{at}: {key} = {found}; wanted a whole number from {min} to {max}; change the count")]
    Count {
        /// Where.
        at: Location,
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
        at: Location,
        /// The value found.
        found: f64,
    },

    /// More steps than are counted.
    #[error(
        "{at}: the run has {steps:.3e} steps; at most {most} are counted; take a longer step_ms or a shorter duration_s"
    )]
    TooManySteps {
        /// The duration.
        at: Location,
        /// Steps.
        steps: f64,
        /// Maximum.
        most: u32,
    },

    /// Steps with more haptic ticks than are computed.
    #[error(
        "{at}: a step of {step} s has {ticks:.3e} ticks of {rate} Hz for the hands of its tools; at most {most:e} are computed; take a \
         shorter step_ms, or a lower [haptic] rate_hz"
    )]
    TooManyTicks {
        /// The step.
        at: Location,
        /// s
        step: f64,
        /// Ticks of a step.
        ticks: f64,
        /// Hz
        rate: f64,
        /// Maximum.
        most: f64,
    },

    /// A device's address that no service can have.
    #[error(
        "{at}: url = \"{found}\" is no address of a service ({problem}); write ws://host:port, for example ws://localhost:10001"
    )]
    Url {
        /// Where.
        at: Location,
        /// The text.
        found: String,
        /// What is wrong with it.
        problem: &'static str,
    },

    /// A probe whose column has the name of another one.
    #[error(
        "{at}: the probe \"{name}\" gives the column {column} of probes.csv, which is there already; rename the probe"
    )]
    Column {
        /// Where.
        at: Location,
        /// Name of the probe.
        name: String,
        /// Name of its column.
        column: String,
    },

    /// Moments of inertia that no body has.
    #[error(
        "{at}: inertia_g_mm2: {largest:?} is more than the other two together, {others:?} g·mm², as no body has it; take the moments about the \
         principal axes through the centre of mass"
    )]
    Inertia {
        /// Where.
        at: Location,
        /// Largest one, g·mm².
        largest: f64,
        /// Sum of the others, g·mm².
        others: f64,
    },

    /// Two bounds in the wrong order.
    #[error("{at}: {key}: the lower bound {lower:?} must be {relation} the upper bound {upper:?}; {fix}")]
    Order {
        /// Where.
        at: Location,
        /// Keys of the bounds.
        key: &'static str,
        /// The lower bound, in the file's unit.
        lower: f64,
        /// "below", or "at most".
        relation: &'static str,
        /// The upper bound, in the file's unit.
        upper: f64,
        /// Remedy.
        fix: &'static str,
    },

    /// Steps of a study whose runs have no common times.
    #[error(
        "{at}: a step of {step} ms is no whole part of the longest, {longest} ms, so that runs could not be compared; take halves, fifths, tenths of it"
    )]
    StudyStep {
        /// Where.
        at: Location,
        /// ms
        step: f64,
        /// ms
        longest: f64,
    },

    /// An unknown word.
    #[error("{at}: {key} = \"{found}\" is not known; {hint}; known: {known}")]
    Choice {
        /// Where.
        at: Location,
        /// The key.
        key: &'static str,
        /// The word found.
        found: String,
        /// The nearest known word, or what to do without one; boxed, to keep `Error` below 128 bytes.
        hint: Box<str>,
        /// Known words, with commas.
        known: String,
    },

    /// A name that cannot be the name of a table column.
    #[error(
        "{at}: the {what} name \"{found}\" cannot be used; wanted a name that is not empty, without commas, quotes, control characters and spaces at its ends; choose a plain name"
    )]
    Name {
        /// Where.
        at: Location,
        /// What is named.
        what: &'static str,
        /// The name found.
        found: String,
    },

    /// The same name twice.
    #[error("{at}: the {what} name \"{name}\" is taken by line {first}; names are unique; rename one of the two")]
    Duplicate {
        /// Where the second one is.
        at: Location,
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
        at: Location,
        /// The text found.
        found: String,
    },

    /// A rotation of nodes that are not constrained in its plane.
    #[error(
        "{at}: turn_deg rotates nodes in the x-y plane, but axes = \"{axes}\" leaves them free there; hold x and y"
    )]
    TurnAxes {
        /// Location of the rotation.
        at: Location,
        /// Constrained axes.
        axes: String,
    },

    /// A colour that is not hexadecimal.
    #[error(
        "{at}: color = \"{found}\"; wanted # and six hexadecimal digits (sRGB); write for example color = \"#e8b9a0\""
    )]
    Color {
        /// Where.
        at: Location,
        /// The text found.
        found: String,
    },

    /// A skin without layers.
    #[error(
        "{at}: the skin has no layers; wanted at least one; add a table [[skin.layer]] with name, thickness_mm, cells, density_kg_m3"
    )]
    NoLayers {
        /// The skin table.
        at: Location,
    },

    /// More nodes than 32-bit indices reach.
    #[error("{at}: the grid has {found} nodes; at most {limit} can be numbered; make cells fewer")]
    TooManyNodes {
        /// The cells.
        at: Location,
        /// Number of nodes; the largest u64 stands for more.
        found: u64,
        /// Maximum.
        limit: u32,
    },

    /// Cells so long that no solver reaches an answer.
    #[error(
        "{at}: the cells of layer \"{layer}\" are {:e} × {:e} × {:e} mm; at most {most} times as long as wide are solved with any accuracy; \
         mend thickness_mm or size_mm, or have more cells along the long edge", edges[0], edges[1], edges[2]
    )]
    SlenderCells {
        /// The thickness, or the size.
        at: Location,
        /// Name of the layer.
        layer: String,
        /// Edges along x, y, z, mm.
        edges: [f64; 3],
        /// Largest ratio.
        most: f64,
    },

    /// A region without nodes.
    #[error(
        "{at}: the {region} holds no node of the {grid}; look at its position and size (origin: centre of the bottom; z up), or widen it to a cell at least"
    )]
    NoNode {
        /// The region's name.
        at: Location,
        /// "scene" or "test form".
        grid: &'static str,
        /// Name of the region.
        region: String,
    },

    /// A region without a face of the surface.
    #[error(
        "{at}: the {region} holds no whole face of the {grid}'s surface, so a pressure on it has no area; widen it to the four corners of a cell's face at least, or ask for kind = \"force\""
    )]
    NoFace {
        /// The region's name.
        at: Location,
        /// "scene" or "test form".
        grid: &'static str,
        /// Name of the region.
        region: String,
    },

    /// A direction of zero length.
    #[error("{at}: `{key}` has no length; write a direction such as [0, 0, 1]")]
    NoDirection {
        /// The vector.
        at: Location,
        /// Its key.
        key: &'static str,
    },

    /// A box without nodes.
    #[error(
        "{at}: the box holds no node of the {grid}: none has {min:?} ≤ {axis} ≤ {max:?} mm, where the body reaches from {body_min:?} to {body_max:?} mm in cells of at most {cell:?} mm; widen box_mm along {axis}"
    )]
    EmptyRegion {
        /// The box.
        at: Location,
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

    /// A load outside the top face.
    #[error(
        "{at}: rectangle_mm reaches from {min:?} to {max:?} mm along {axis}; the top reaches from -{half:?} to {half:?}; move the rectangle onto it"
    )]
    LoadOutside {
        /// The rectangle.
        at: Location,
        /// x or y.
        axis: char,
        /// mm
        min: f64,
        /// mm
        max: f64,
        /// Half of the top's size, mm.
        half: f64,
    },

    /// A point of a probe or of a load outside the tetrahedra of a mesh.
    #[error(
        "{at}: the point [{}, {}, {}] mm lies in no tetrahedron of the mesh; move it into the body (origin: middle of the bottom of its \
         bounding box; z up)", found[0], found[1], found[2]
    )]
    PointOutsideMesh {
        /// The point.
        at: Location,
        /// mm
        found: [f64; 3],
    },

    /// A load's region without any part of the surface.
    #[error(
        "{at}: no face of the {grid}'s surface reaches into region = \"{region}\"; move the region onto the surface, on which loads act"
    )]
    NoSurface {
        /// The region.
        at: Location,
        /// Grid of the scene or of the test form.
        grid: &'static str,
        /// Its name.
        region: String,
    },

    /// A point of a probe or of a load outside the skin.
    #[error(
        "{at}: the point lies outside the skin: {axis} = {found} mm, where the skin at rest reaches from {min} to {max} mm; move it onto the skin (origin: centre of the bottom; z up)"
    )]
    PointOutside {
        /// The point.
        at: Location,
        /// x, y or z.
        axis: char,
        /// mm
        found: f64,
        /// mm
        min: f64,
        /// mm
        max: f64,
    },

    /// A blade edge that is no polyline.
    #[error(
        "{at}: edge_mm has {found} different points in a row; wanted at least two, from the tip to the heel, each apart from the one before; add or move points"
    )]
    BladeEdge {
        /// The edge.
        at: Location,
        /// Points before the first repetition or the end.
        found: usize,
    },

    /// A blade with too many contact samples.
    #[error(
        "{at}: the blade has {found:e} contact samples; at most {most:e} are allowed; make edge_spacing_mm or flat_spacing_mm larger, or mend edge_mm"
    )]
    BladeSamples {
        /// The edge.
        at: Location,
        /// Samples of edge and flats.
        found: f64,
        /// Maximum.
        most: f64,
    },

    /// A blade whose normal is not perpendicular to its edge.
    #[error(
        "{at}: the blade's normal is {angle:.1} degrees from the line between tip and heel; wanted 90 within {allowed} degrees, because the blade's plane holds the edge; give the direction across the flats"
    )]
    BladeNormal {
        /// The normal.
        at: Location,
        /// Angle between the two, degrees; 0 for a normal or an edge of zero length.
        angle: f64,
        /// Allowed deviation from 90 degrees.
        allowed: f64,
    },

    /// A round tool that is neither sphere nor capsule.
    #[error(
        "{at}: points_mm of a round tool has {found} points; wanted one, a sphere's centre, or two different ones, the ends of a capsule's axis; change the list"
    )]
    RoundPoints {
        /// The list.
        at: Location,
        /// Points found.
        found: usize,
    },

    /// Mesh file that cannot be read.
    #[error(transparent)]
    Mesh(crate::formats::Refused),

    /// A mesh file that no body can be made of.
    #[error("{at}: mesh names {}, of which no body can be made: {found}; {mend}", path.display())]
    BodyMesh {
        /// Where it is named.
        at: Location,
        /// The mesh file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
        /// What to do.
        mend: String,
    },

    /// A grid that ends within the surface embedded in it.
    #[error(
        "{at}: along {axis} the grid has {grid} mm and the surface that is embedded in it {own} mm; leave the grid's size out, which then is the \
         surface's, or write at least {own}"
    )]
    EmbeddedSize {
        /// Where the size stands, or the body.
        at: Location,
        /// x, y or z.
        axis: char,
        /// Extent of the surface, mm.
        own: f64,
        /// Extent of the grid, mm.
        grid: f64,
    },

    /// Feature that a body embedded in a grid does not support.
    #[error("{at}: {what} is not available with embed = \"bricks\"; {fix}")]
    Embedded {
        /// Where.
        at: String,
        /// What was found.
        what: String,
        /// What to do.
        fix: &'static str,
    },

    /// A vertex beyond the range of f32.
    #[error("{at}: `{found}`; in metres that exceeds the range of f32; mend the line, or mesh_unit_mm of the scene")]
    ObjFar {
        /// The `v` line.
        at: Location,
        /// The line.
        found: String,
    },

    /// A segment of zero length.
    #[error(
        "{at}: vertices {a} and {b} of the line are at the same position; wanted segments with a length; leave one out"
    )]
    LinesShort {
        /// The `l` line.
        at: Location,
        /// The vertices, from 1.
        a: usize,
        /// The other one.
        b: usize,
    },

    /// A file without points and lines.
    #[error(
        "{path}: there are no points and lines; wanted a line `l 1 2` or `p 1` at least; export the tool with its edges"
    )]
    LinesEmpty {
        /// The file.
        path: PathBuf,
    },

    /// A contact filter that does not suit a tool.
    #[error(
        "{at}: filter = \"{filter}\" does not fit the tool \"{tool}\": it is for {fits}; remove the key (each tool then has its own filter), or write filter = \"points\", which fits all"
    )]
    FilterTool {
        /// The filter.
        at: Location,
        /// Its word.
        filter: String,
        /// The tool's name.
        tool: String,
        /// Tools that it suits, and the kind of this one.
        fits: &'static str,
    },

    /// A hand path without positions.
    #[error(
        "{at}: path_mm has no rows; wanted at least one [t_s, x, y, z]; write where the hand or the boundary rests"
    )]
    PathEmpty {
        /// The list.
        at: Location,
    },

    /// A camera at its own target.
    #[error("{at}: eye_mm and target_mm are the same point; move eye_mm away from what is looked at")]
    ViewPoint {
        /// The view table.
        at: Location,
    },

    /// A file that the scene names cannot be read.
    #[error("{at}: {key} names {path}, which cannot be read ({reason}); {fix}, or change {key}")]
    File {
        /// Where it is named.
        at: Location,
        /// The key.
        key: &'static str,
        /// The file looked for.
        path: PathBuf,
        /// The system's reason.
        reason: String,
        /// What to do.
        fix: &'static str,
    },

    /// A mesh without triangles.
    #[error("{path}: the mesh has no triangles; wanted at least one face (a line `f 1 2 3`); export it with its faces")]
    MeshEmpty {
        /// The mesh.
        path: PathBuf,
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
        at: Location,
        /// The line found.
        found: String,
        /// The header wanted.
        wanted: &'static str,
    },

    /// A row with more or fewer columns.
    #[error("{at}: the row has {found} columns; wanted {wanted} (`{header}`); complete or remove the row")]
    TrajectoryColumns {
        /// Where.
        at: Location,
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
        at: Location,
        /// The column's name.
        column: &'static str,
        /// The text found.
        found: String,
    },

    /// Position that no hand reaches.
    #[error("{at}: {column} = {found:?}; wanted {most} at most in size (1 km); mend the value or remove the row")]
    TrajectoryFar {
        /// Where.
        at: Location,
        /// The column's name.
        column: &'static str,
        /// mm
        found: f64,
        /// mm
        most: f64,
    },

    /// Time that stands still or runs back.
    #[error("{at}: time_s = {found:?} after {before:?}; times must rise from row to row; sort or remove rows")]
    TrajectoryTime {
        /// Where.
        at: Location,
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
        at: Location,
        /// Its length.
        length: f64,
        /// Allowed departure from 1.
        allowed: f64,
    },
}
