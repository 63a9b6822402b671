//! The scene file as TOML has it: keys with units, every value with its location in the text. `table` declares the tables, `row` has what
//! a key of theirs is to the reader; `keys` lists them.
//!
//! Lists are `Vec`, not arrays, because TOML arrays deserialise into shorter Rust arrays without an error.

mod row;
#[macro_use]
mod table;
#[macro_use]
mod scene;
#[macro_use]
mod bodies;
#[macro_use]
mod regions;
#[macro_use]
mod tools;
#[macro_use]
mod outputs;

pub(super) use bodies::{Layer, Plane, Rigid, Skin};
pub(super) use outputs::{Check, KindOfProbe, Output, Probe, Study, View};
pub(super) use regions::{Attach, Boundary, Extent, Inclusion, Load, RestSpring};
pub(super) use row::*;
pub(super) use scene::{Contact, Haptic, Scene, Solver, Test, Time};
pub use table::Key;
pub(super) use tools::{Blade, Carve, Coupling, Device, KindOfDevice, Lines, Round, Tool};

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

/// The tables in the order of the page.
macro_rules! tables {
    ($($table:ident)*) => {
        /// Keys on the page, by table.
        pub(super) const KEYS: &[&[Key]] = &[$($table::KEYS),*];

        /// The tables on the page.
        macro_rules! page {
            () => { concat!($($table!()),*) };
        }
    };
}
tables! {
    Scene Time Solver Skin Layer Boundary RestSpring Inclusion Load Tool Coupling Blade Round Lines Carve Device Rigid Plane Attach
    Contact Haptic Probe Check Study Test View Output
}
