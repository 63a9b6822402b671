//! The scene file as TOML has it: keys with units, every value with its location in the text.
//!
//! Lists are `Vec`, not arrays, because TOML arrays deserialise into shorter Rust arrays without an error.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range;

/// Value with its byte range in the text.
pub(super) type At<T> = toml::Spanned<T>;
/// Numbers of a vector.
pub(super) type Numbers = At<Vec<f64>>;
/// Counts of a vector.
pub(super) type Counts = At<Vec<u32>>;
/// A list of vectors.
pub(super) type Points = At<Vec<Numbers>>;

/// TOML table; a derived struct alone would also accept a list of its fields in order.
pub(super) struct Table<T> {
    /// Byte range of the header.
    pub span: Range<usize>,
    /// The keys.
    pub keys: T,
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Table<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Table<T>, D::Error> {
        let table = At::<Keys<T>>::deserialize(deserializer)?;
        Ok(Table { span: table.span(), keys: table.into_inner().0 })
    }
}

/// Keys of a table; the defaults for a missing one.
pub(super) fn keys<T: Default>(table: Option<Table<T>>) -> T {
    table.map(|table| table.keys).unwrap_or_default()
}

struct Keys<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Keys<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Keys<T>, D::Error> {
        deserializer.deserialize_map(KeysVisitor(PhantomData))
    }
}

struct KeysVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for KeysVisitor<T> {
    type Value = Keys<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Keys<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(Keys)
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Scene {
    pub title: At<String>,
    pub time: Table<Time>,
    pub solver: Option<Table<Solver>>,
    pub skin: Option<Table<Skin>>,
    #[serde(default)]
    pub block: Vec<Table<Skin>>,
    #[serde(default)]
    pub rigid: Vec<Table<Rigid>>,
    #[serde(default)]
    pub plane: Vec<Table<Plane>>,
    #[serde(default)]
    pub attach: Vec<Table<Attach>>,
    #[serde(default)]
    pub boundary: Vec<Table<Boundary>>,
    #[serde(default)]
    pub rest_spring: Vec<Table<RestSpring>>,
    #[serde(default)]
    pub inclusion: Vec<Table<Inclusion>>,
    #[serde(default)]
    pub load: Vec<Table<Load>>,
    #[serde(default)]
    pub tool: Vec<Table<Tool>>,
    pub contact: Option<Table<Contact>>,
    pub haptic: Option<Table<Haptic>>,
    #[serde(default)]
    pub probe: Vec<Table<Probe>>,
    #[serde(default)]
    pub check: BTreeMap<At<String>, Table<Check>>,
    pub study: Option<Table<Study>>,
    pub test: Option<Table<Test>>,
    pub view: Option<Table<View>>,
    pub output: Option<Table<Output>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Time {
    pub step_ms: At<f64>,
    pub duration_s: At<f64>,
    pub gravity_m_s2: Option<Numbers>,
    pub substeps: Option<At<u32>>,
    pub integrator: Option<At<String>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Solver {
    pub preconditioner: Option<At<String>>,
    pub tolerance: Option<At<f64>>,
    pub floor_n: Option<At<f64>>,
    pub max_iterations: Option<At<u32>>,
    pub newton: Option<At<bool>>,
    pub refinements: Option<At<u32>>,
    pub true_residual_every: Option<At<u32>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Skin {
    pub name: Option<At<String>>,
    pub position_mm: Option<Numbers>,
    pub size_mm: Option<Numbers>,
    pub cells: Option<Counts>,
    pub mesh: Option<At<String>>,
    pub mesh_unit_mm: Option<At<f64>>,
    pub embed: Option<At<String>>,
    pub law: Option<At<String>>,
    pub element: Option<At<String>>,
    pub mass: Option<At<String>>,
    pub cut: Option<At<String>>,
    pub cut_reserve_columns: Option<At<u32>>,
    pub spring_stiffness_n_m: Option<At<f64>>,
    pub spring_damping_n_s_m: Option<At<f64>>,
    pub rayleigh_mass_per_s: Option<At<f64>>,
    pub rayleigh_stiffness_s: Option<At<f64>>,
    pub velocity_m_s: Option<Numbers>,
    pub displacement_mm: Option<Numbers>,
    pub start: Option<At<String>>,
    pub start_mm: Option<At<f64>>,
    pub start_seed: Option<At<u32>>,
    pub start_deg: Option<At<f64>>,
    #[serde(default)]
    pub layer: Vec<Table<Layer>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layer {
    pub name: At<String>,
    pub thickness_mm: Option<At<f64>>,
    pub cells: Option<At<u32>>,
    pub group: Option<At<String>>,
    pub young_kpa: Option<At<f64>>,
    pub poisson: Option<At<f64>>,
    pub c10_kpa: Option<At<f64>>,
    pub c01_kpa: Option<At<f64>>,
    pub bulk_kpa: Option<At<f64>>,
    pub fibre_kpa: Option<At<f64>>,
    pub fibre_growth: Option<At<f64>>,
    pub fibre_dispersion: Option<At<f64>>,
    pub fibre_angle_deg: Option<At<f64>>,
    pub langer_deg: Option<At<f64>>,
    pub density_kg_m3: At<f64>,
    pub pre_strain: Option<Numbers>,
    pub toughness_kj_m2: Option<At<f64>>,
    pub break_strain: Option<At<f64>>,
    pub color: Option<At<String>>,
}

/// Keys that define a region; they occur in the tables of boundaries, rest-shape springs, loads and probes.
pub(super) struct Extent {
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
}

macro_rules! with_extent {
    ($($table:ty),*) => {$(
        impl $table {
            /// Takes the keys of its region.
            pub(super) fn extent(&mut self) -> Extent {
                Extent {
                    box_mm: self.box_mm.take(),
                    centre_mm: self.centre_mm.take(),
                    radius_mm: self.radius_mm.take(),
                    through_mm: self.through_mm.take(),
                    normal: self.normal.take(),
                    within_mm: self.within_mm.take(),
                    margin_mm: self.margin_mm.take(),
                    group: self.group.take(),
                }
            }
        }
    )*};
}
with_extent!(Boundary, RestSpring, Load, Probe, Attach);

impl Inclusion {
    /// Takes the keys of its region, a solid.
    pub(super) fn extent(&mut self) -> Extent {
        let (box_mm, centre_mm, radius_mm) = (self.box_mm.take(), self.centre_mm.take(), self.radius_mm.take());
        Extent {
            box_mm,
            centre_mm,
            radius_mm,
            through_mm: None,
            normal: None,
            within_mm: None,
            margin_mm: None,
            group: None,
        }
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Boundary {
    pub body: Option<At<String>>,
    pub region: At<String>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
    pub axes: Option<At<String>>,
    pub displacement_mm: Option<Numbers>,
    pub turn_deg: Option<At<f64>>,
    pub path_mm: Option<Points>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Inclusion {
    pub body: Option<At<String>>,
    pub region: At<String>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub young_kpa: At<f64>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RestSpring {
    pub body: Option<At<String>>,
    pub region: At<String>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
    pub stiffness_n_m: At<f64>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Load {
    pub body: Option<At<String>>,
    pub pressure_kpa: Option<At<f64>>,
    pub follower: Option<At<bool>>,
    pub traction_kpa: Option<Numbers>,
    pub force_n: Option<Numbers>,
    pub at_mm: Option<Numbers>,
    pub region: Option<At<String>>,
    pub rectangle_mm: Option<Points>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
    pub start_s: Option<At<f64>>,
    pub end_s: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tool {
    pub name: At<String>,
    pub mesh: Option<At<String>>,
    pub mesh_unit_mm: Option<At<f64>>,
    pub mass_g: At<f64>,
    pub inertia_g_mm2: Numbers,
    pub points_mm: Option<Points>,
    pub tip_radius_mm: Option<At<f64>>,
    pub trajectory: Option<At<String>>,
    pub path_mm: Option<Points>,
    pub coupling: Option<Table<Coupling>>,
    pub blade: Option<Table<Blade>>,
    pub round: Option<Table<Round>>,
    pub lines: Option<Table<Lines>>,
    pub carve: Option<Table<Carve>>,
    pub device: Option<Table<Device>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rigid {
    pub name: At<String>,
    pub box_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub mass_g: At<f64>,
    pub position_mm: Numbers,
    pub turn_deg: Option<Numbers>,
    pub velocity_m_s: Option<Numbers>,
    pub spin_rad_s: Option<Numbers>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Plane {
    pub name: At<String>,
    pub through_mm: Numbers,
    pub normal: Numbers,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Attach {
    pub body: Option<At<String>>,
    pub to: Option<At<String>>,
    pub slide: Option<Numbers>,
    pub friction: Option<At<f64>>,
    pub resistance_n: Option<At<f64>>,
    pub region: At<String>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Round {
    pub radius_mm: At<f64>,
    pub points_mm: Points,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Lines {
    pub mesh: At<String>,
    pub mesh_unit_mm: Option<At<f64>>,
    pub radius_mm: Option<At<f64>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Coupling {
    pub stiffness_n_m: Option<At<f64>>,
    pub damping_n_s_m: Option<At<f64>>,
    pub angular_stiffness_n_m_rad: Option<At<f64>>,
    pub angular_damping_n_m_s_rad: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Carve {
    pub distance_mm: Option<At<f64>>,
    pub pressure_kpa: Option<At<f64>>,
    pub whole_cells: Option<bool>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Blade {
    pub edge_mm: Points,
    pub normal: Option<Numbers>,
    pub thickness_mm: At<f64>,
    pub edge_spacing_mm: Option<At<f64>>,
    pub flat_spacing_mm: Option<At<f64>>,
    pub depth_mm: Option<At<f64>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Contact {
    pub friction: Option<At<f64>>,
    pub alarm_mm: Option<At<f64>>,
    pub distance_mm: Option<At<f64>>,
    pub forces: Option<At<String>>,
    pub penalty_n_m: Option<At<f64>>,
    pub correction: Option<At<String>>,
    pub filter: Option<At<String>>,
    pub angle_cone: Option<At<f64>>,
    pub max_contacts: Option<At<u32>>,
    pub tolerance: Option<At<f64>>,
    pub column_tolerance: Option<At<f64>>,
    pub max_passes: Option<At<u32>>,
    pub lips: Option<At<bool>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Haptic {
    pub rate_hz: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Device {
    pub kind: At<String>,
    pub rendering: Option<At<String>>,
    pub force_scale: Option<At<f64>>,
    pub max_force_n: Option<At<f64>>,
    pub max_torque_n_mm: Option<At<f64>>,
    pub workspace_mm: Option<At<f64>>,
    pub position_mm: Option<Numbers>,
    pub turn_deg: Option<Numbers>,
    pub scale: Option<At<f64>>,
    pub tool_mm: Option<Numbers>,
    pub tool_turn_deg: Option<Numbers>,
    pub buttons: Option<Vec<At<String>>>,
    pub passivity: Option<At<bool>>,
    pub hand_mass_g: Option<At<f64>>,
    pub hand_stiffness_n_m: Option<At<f64>>,
    pub hand_damping_n_s_m: Option<At<f64>>,
    pub encoder_um: Option<At<f64>>,
    pub url: Option<At<String>>,
    pub device: Option<At<String>>,
    pub grip: Option<At<String>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Probe {
    pub name: At<String>,
    pub kind: At<String>,
    pub body: Option<At<String>>,
    pub from: Option<At<String>>,
    pub point_mm: Option<Numbers>,
    pub axis: Option<At<String>>,
    pub component: Option<At<String>>,
    pub region: Option<At<String>>,
    pub box_mm: Option<Points>,
    pub centre_mm: Option<Numbers>,
    pub radius_mm: Option<At<f64>>,
    pub through_mm: Option<Numbers>,
    pub normal: Option<Numbers>,
    pub within_mm: Option<At<f64>>,
    pub margin_mm: Option<At<f64>>,
    pub group: Option<At<String>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Check {
    pub min: Option<At<f64>>,
    pub max: Option<At<f64>>,
    pub cells: Option<At<f64>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Test {
    pub cells: Option<Counts>,
    pub steps: Option<At<u32>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Study {
    pub probes: Option<Vec<At<String>>>,
    pub known: Option<BTreeMap<At<String>, At<f64>>>,
    pub duration_s: Option<At<f64>>,
    pub laws: Option<At<Vec<At<String>>>>,
    pub preconditioners: Option<At<Vec<At<String>>>>,
    pub tolerances: Option<At<Vec<At<f64>>>>,
    pub iterations: Option<At<Vec<At<u32>>>>,
    pub grids: Option<Numbers>,
    pub steps_ms: Option<Numbers>,
    pub integrators: Option<At<Vec<At<String>>>>,
    pub corrections: Option<At<Vec<At<String>>>>,
    pub quick_grid: Option<At<f64>>,
    pub reference_grid: Option<At<f64>>,
    pub reference_step_ms: Option<At<f64>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct View {
    pub frames: Option<At<u32>>,
    pub size_px: Option<Counts>,
    pub eye_mm: Option<Numbers>,
    pub target_mm: Option<Numbers>,
    pub field_of_view_deg: Option<At<f64>>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Output {
    pub fields: Option<At<Vec<At<String>>>>,
    pub surface: Option<At<Vec<At<String>>>>,
}
