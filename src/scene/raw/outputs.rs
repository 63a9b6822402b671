//! Tables of what is recorded: probes, checks, pictures, studies.

use super::*;
use crate::scene::{Component, OutputField, SurfaceFormat};

/// Kind of a probe.
#[derive(Clone, Copy, PartialEq)]
pub enum KindOfProbe {
    Displacement,
    MeanDisplacement,
    Reaction,
    Pressure,
    Strain,
    Stress,
    Volume,
    VolumeChange,
    CentreOfMass,
    Position,
    Velocity,
    Spin,
    Force,
}

region_table! {
    struct Probe = "`[[probe]]`" {
        /// Column of `probes.csv`.
        name: text,
        /// What is recorded.
        kind: choice(KindOfProbe:
            "displacement" => KindOfProbe::Displacement, "mean_displacement" => KindOfProbe::MeanDisplacement,
            "reaction" => KindOfProbe::Reaction, "pressure" => KindOfProbe::Pressure, "strain" => KindOfProbe::Strain,
            "stress" => KindOfProbe::Stress, "volume" => KindOfProbe::Volume,
            "volume_change" => KindOfProbe::VolumeChange, "centre_of_mass" => KindOfProbe::CentreOfMass,
            "position" => KindOfProbe::Position, "velocity" => KindOfProbe::Velocity, "spin" => KindOfProbe::Spin,
            "force" => KindOfProbe::Force
        ),
        /// Body that it is of.
        body: text or "(the skin, or the only body)",
        /// Of `kind = "force"`: from that body alone.
        from: text or "",
        /// Of `kind = "displacement"`, `"strain"` and `"stress"`: rest position of the point.
        point_mm: vector(3, MM) or "",
        /// Direction, of the kinds that have one.
        axis: choice(usize: "x" => 0, "y" => 1, "z" => 2) = "z",
        /// Of `kind = "strain"` and `"stress"`; `"von_mises"` of a stress.
        component: choice(Component:
            "xx" => Component::Entry(0, 0), "yy" => Component::Entry(1, 1), "zz" => Component::Entry(2, 2),
            "xy" => Component::Entry(0, 1), "yz" => Component::Entry(1, 2), "zx" => Component::Entry(2, 0),
            "von_mises" => Component::VonMises
        ) or "",
        /// Of `kind = "mean_displacement"`, `"reaction"` and `"pressure"`.
        region: text("as in `[[boundary]]`") or "",
    }
    region {
    }
}

table! {
    /// Each key is a number of the report by its path, such as `"cut.length_mm"`, or `"probes.NAME"`; its table has
    struct Check = "`[check]`" {
        /// Least value that passes.
        min: number(PLAIN) or "",
        /// Largest value that passes.
        max: number(PLAIN) or "",
        /// Of a length in mm: cells by which both bounds are widened.
        cells: number(PLAIN, > 0) or "",
    }
}

table! {
    struct View: Default = "`[view]`" {
        /// Pictures and meshes over the run.
        frames: count(0 ..= 4294967295) = 8,
        /// Size of a picture.
        size_px: counts(1 ..= 8192) = [960, 640],
        /// Position of the camera.
        eye_mm: vector(3, MM) or "(all in view)",
        /// Point that it looks at.
        target_mm: vector(3, MM) or "(the middle)",
        // beyond these a picture is noise or a fisheye
        /// Vertical angle of view.
        field_of_view_deg: within(DEGREE, 1 ..= 150) = 30.0,
    }
}

table! {
    struct Output: Default = "`[output]`" {
        /// Fields of the saved meshes beside displacement, velocity, layer and body: Cauchy stress with von Mises', Green–Lagrange strain
        /// (both in the middle of each cell or tetrahedron; springs have no stress: 0), share of a cell's links or springs that are intact
        /// (with `embed` of its volume inside), factor on the stiffness of its layer by `[[inclusion]]`s and `embed`.
        fields: list(choice(OutputField:
            "stress" => OutputField::Stress, "strain" => OutputField::Strain, "alive" => OutputField::Alive,
            "stiffness" => OutputField::Stiffness
        )) or "(none)",
        /// Saves the surface with each picture in more formats: glTF 2.0 with colours and tools (opens in a browser or Blender), OBJ, STL.
        surface: list(choice(SurfaceFormat:
            "glb" => SurfaceFormat::Glb, "obj" => SurfaceFormat::Obj, "stl" => SurfaceFormat::Stl
        )) or "(none)",
    }
}

table! {
    /// For `cutis study`; what is not named is as the scene has it.
    struct Study: Default = "`[study]`" {
        /// What errors are of.
        probes: list(text, "list of names") or "(all, and the force on tools)",
        /// Values of probes at the end that are known, SI.
        known: by_name or "(a reference run)",
        /// Length of each run.
        duration_s: number(SECOND, > 0) or "(the scene's)",
        /// `"neo_hookean"`, and values of `element` for corotational hexahedra (linear ones if the scene's are).
        laws: list(text, "list") or "(the scene's)",
        /// Values of `preconditioner`.
        preconditioners: list(text, "list") or "(the scene's)",
        /// Values of `tolerance`.
        tolerances: list(number(PLAIN, 0 < x < 1)) or "(the scene's)",
        /// Runs that stop after so many iterations.
        iterations: list(count(1 ..= 4294967295)) or "(none)",
        /// Factors of the numbers of cells.
        grids: list(number(PLAIN, > 0)) or "(the scene's)",
        /// Lengths of a step.
        steps_ms: list(number(MS, > 0)) or "(the scene's)",
        /// Values of `integrator`.
        integrators: list(text, "list") or "(the scene's)",
        /// Values of `correction`.
        corrections: list(text, "list") or "(the scene's)",
        /// Grid of `--quick`.
        quick_grid: number(PLAIN, > 0) or "(the coarsest)",
        /// Grid of the reference.
        reference_grid: number(PLAIN, > 0) or "(finer than all)",
        /// Step of the reference.
        reference_step_ms: number(MS, > 0) or "(shorter than all)",
    }
}
