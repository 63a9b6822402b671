//! Keys as the tables declare them: name, range and default of each, for the reader.

use super::{At, Counts, Numbers, Points, Table};
use std::collections::BTreeMap;
use std::marker::PhantomData;

/// Largest magnitude in SI units; larger values become infinite in the kernels' f32.
const LARGEST: f64 = f32::MAX as f64;
/// Smallest positive value in SI units; smaller ones lose digits in the kernels' f32, and divisions by them overflow.
const LEAST: f64 = f32::MIN_POSITIVE as f64;

/// Unit of a key. Division by `per` rounds once, so that 0.3 mm is the same number as 0.3e-3 m.
#[derive(Clone, Copy)]
pub struct Unit {
    pub name: &'static str,
    pub times: f64,
    pub per: f64,
}

const fn unit(name: &'static str, times: f64, per: f64) -> Unit {
    Unit { name, times, per }
}

pub const PLAIN: Unit = unit("no unit", 1.0, 1.0);
pub const MM: Unit = unit("mm", 1.0, 1e3);
pub const MS: Unit = unit("ms", 1.0, 1e3);
pub const SECOND: Unit = unit("s", 1.0, 1.0);
pub const PER_SECOND: Unit = unit("1/s", 1.0, 1.0);
pub const SPEED: Unit = unit("m/s", 1.0, 1.0);
pub const RADIAN_PER_SECOND: Unit = unit("rad/s", 1.0, 1.0);
pub const ACCELERATION: Unit = unit("m/s²", 1.0, 1.0);
pub const NEWTON: Unit = unit("N", 1.0, 1.0);
pub const KPA: Unit = unit("kPa", 1e3, 1.0);
pub const KJ_M2: Unit = unit("kJ/m²", 1e3, 1.0);
pub const KG_M3: Unit = unit("kg/m³", 1.0, 1.0);
pub const GRAM: Unit = unit("g", 1.0, 1e3);
pub const G_MM2: Unit = unit("g·mm²", 1.0, 1e9);
pub const STIFFNESS: Unit = unit("N/m", 1.0, 1.0);
pub const DAMPING: Unit = unit("N·s/m", 1.0, 1.0);
pub const ANGULAR_STIFFNESS: Unit = unit("N·m/rad", 1.0, 1.0);
pub const ANGULAR_DAMPING: Unit = unit("N·m·s/rad", 1.0, 1.0);
pub const HERTZ: Unit = unit("Hz", 1.0, 1.0);
pub const MICRON: Unit = unit("µm", 1.0, 1e6);
pub const N_MM: Unit = unit("N·mm", 1.0, 1e3);
pub const DEGREE: Unit = unit("degrees", 1.0, 1.0);

/// Range of a number.
#[derive(Clone, Copy)]
pub enum Bound {
    Finite,
    Positive,
    NotNegative,
    Fraction,
    /// Pre-strain. A free cell relaxes to `I − e`; within these limits it is not inverted, including across the thickness: `e_z < 1` if
    /// `e_x + e_y > −1` and ν < 0.5.
    Strain,
}

impl Bound {
    /// True if `value` is in range and `si` remains in range in f32.
    pub fn holds(self, value: f64, si: f64) -> bool {
        si.abs() <= LARGEST
            && match self {
                Bound::Finite => true,
                Bound::Positive => si >= LEAST,
                Bound::NotNegative => value >= 0.0,
                Bound::Fraction => value > 0.0 && value < 1.0,
                Bound::Strain => value > -0.5 && value < 1.0,
            }
    }

    pub fn wanted(self) -> &'static str {
        match self {
            Bound::Finite => "a finite number (at most 3e38 in SI)",
            Bound::Positive => "a finite number above 0 (at least 1.2e-38 in SI)",
            Bound::NotNegative => "a finite number, 0 or more",
            Bound::Fraction => "a number between 0 and 1, both excluded",
            Bound::Strain => "a strain between -0.5 and 1, both excluded",
        }
    }

    pub fn example(self, found: f64) -> f64 {
        let magnitude = found.abs();
        match self {
            Bound::Fraction => 0.001,
            Bound::Strain => 0.1,
            Bound::Finite => 0.0,
            _ if magnitude > LEAST.sqrt() && magnitude < LARGEST.sqrt() => magnitude,
            _ => 1.0,
        }
    }
}

/// A key of a table; its default, if it has one, is in the file's unit.
#[derive(Clone, Copy)]
pub struct Row<R, D = ()> {
    pub name: &'static str,
    pub range: R,
    pub default: D,
}

impl<R, D> Row<R, D> {
    /// The given value, or the default.
    pub fn or<T>(self, value: Option<At<T>>) -> At<T>
    where
        D: Into<T>,
    {
        value.unwrap_or_else(|| At::new(0..0, self.default.into()))
    }
}

/// Range of a key, with the types of its value in the file and of a default.
pub trait Kind {
    type File;
    type Default;
}

/// A number.
#[derive(Clone, Copy)]
pub struct Number {
    pub unit: Unit,
    pub bound: Bound,
}

impl Kind for Number {
    type File = At<f64>;
    type Default = f64;
}

/// A number from `low` to `high`; `wanted` says so.
#[derive(Clone, Copy)]
pub struct Within {
    pub unit: Unit,
    pub low: f64,
    pub high: f64,
    pub wanted: &'static str,
}

impl Kind for Within {
    type File = At<f64>;
    type Default = f64;
}

impl Within {
    /// A positive number, in the same unit.
    pub fn positive(&self) -> Number {
        Number { unit: self.unit, bound: Bound::Positive }
    }

    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// N numbers.
#[derive(Clone, Copy)]
pub struct Vector<const N: usize>(pub Number);

impl<const N: usize> Kind for Vector<N> {
    type File = Numbers;
    type Default = [f64; N];
}

/// Any number of finite vectors.
#[derive(Clone, Copy)]
pub struct Vectors<const N: usize> {
    pub unit: Unit,
}

impl<const N: usize> Kind for Vectors<N> {
    type File = Points;
    type Default = ();
}

impl<const N: usize, D> Row<Vectors<N>, D> {
    /// Each of the vectors.
    pub fn each(&self) -> Row<Vector<N>> {
        let range = Vector(Number { unit: self.range.unit, bound: Bound::Finite });
        Row { name: self.name, range, default: () }
    }
}

/// A count.
#[derive(Clone, Copy)]
pub struct Count {
    pub min: u32,
    pub max: u32,
}

impl Kind for Count {
    type File = At<u32>;
    type Default = u32;
}

/// Two counts.
#[derive(Clone, Copy)]
pub struct TwoCounts(pub Count);

impl Kind for TwoCounts {
    type File = Counts;
    type Default = [u32; 2];
}

/// True or false.
#[derive(Clone, Copy)]
pub struct Flag;

impl Kind for Flag {
    type File = At<bool>;
    type Default = bool;
}

/// One of these words, each with what it stands for.
#[derive(Clone, Copy)]
pub struct Choice<T: 'static>(pub &'static [(&'static str, T)]);

impl<T> Kind for Choice<T> {
    type File = At<String>;
    type Default = &'static str;
}

/// A list of values, each in a range.
#[derive(Clone, Copy)]
pub struct List<R>(pub R);

impl<R: Kind> Kind for List<R> {
    type File = At<Vec<R::File>>;
    type Default = [R::File; 0];
}

impl<R: Copy, D> Row<List<R>, D> {
    /// Each of the values.
    pub fn each(&self) -> Row<R> {
        Row { name: self.name, range: self.range.0, default: () }
    }
}

/// Finite numbers by name.
#[derive(Clone, Copy)]
pub struct ByName;

impl Kind for ByName {
    type File = BTreeMap<At<String>, At<f64>>;
    type Default = ();
}

impl<D> Row<ByName, D> {
    /// Each of the numbers.
    pub fn each(&self) -> Row<Number> {
        Row { name: self.name, range: Number { unit: PLAIN, bound: Bound::Finite }, default: () }
    }
}

/// What its reader alone knows the range of.
#[derive(Clone, Copy)]
pub struct Free<T>(pub PhantomData<T>);

impl<T> Kind for Free<T> {
    type File = T;
    type Default = &'static str;
}

/// Text.
pub type Text = Free<At<String>>;
/// A table.
pub type Tables<T> = Free<Table<T>>;
