//! Tables of a scene file, each declared once: `table!` makes of its rows the struct that serde reads, the keys with their ranges for the
//! reader, the list for `cutis keys`, and the part of the page `scene::keys`.
//!
//! A row is `/// meaning`, then `name: kind(unit, range)`, then `= default`, or `or "what happens without the key, in words"`: `""` if it
//! belongs to the choice that its meaning names; what stands for such a key if it is absent is its reader's. Without either the key is required. `beside` has fields that the page does not list.

/// Key of a scene file, as listed on the page above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Heading of its table: `[time]`, `[skin] and [[block]]`, or `The file`.
    pub table: &'static str,
    /// Name, with its unit.
    pub name: &'static str,
    /// Default as TOML, or in words in brackets; empty if the key is required or belongs to a choice.
    pub default: &'static str,
    /// Allowed values.
    pub range: &'static str,
    /// Meaning.
    pub meaning: &'static str,
}

/// Bound of a number: for the reader, and in words.
#[rustfmt::skip]
macro_rules! bound {
    (range) => { Bound::Finite };
    (text) => { "number" };
    (range > 0) => { Bound::Positive };
    (text > 0) => { "> 0" };
    (range >= 0) => { Bound::NotNegative };
    (text >= 0) => { "≥ 0" };
    (range 0 < x < 1) => { Bound::Fraction };
    (text 0 < x < 1) => { "0 < x < 1" };
    (range -0.5 < x < 1) => { Bound::Strain };
    (text -0.5 < x < 1) => { "-0.5 < x < 1" };
}

/// Words of a choice, as the page has them.
macro_rules! either {
    ($first:literal $(, $word:literal)*) => { concat!("`\"", $first, "\"`" $(, ", `\"", $word, "\"`")*) };
}

/// Kind of a key: the type of its range, the range, and the range in words.
macro_rules! kind {
    (type number $range:tt) => { Number };
    (range number($unit:ident $(, $($bound:tt)+)?)) => {
        Number { unit: $unit, bound: bound!(range $($($bound)+)?) }
    };
    (text number($unit:ident $(, $($bound:tt)+)?)) => { bound!(text $($($bound)+)?) };

    (type within $range:tt) => { Within };
    (range within($unit:ident, $low:literal ..= $high:expr $(, $text:literal)?)) => {
        Within {
            unit: $unit,
            low: $low as f64,
            high: $high as f64,
            wanted: concat!("a number from ", stringify!($low), " to ", stringify!($high)),
        }
    };
    (text within($unit:ident, $low:literal ..= $high:literal)) => { concat!($low, " … ", $high) };
    (text within($unit:ident, $low:literal ..= $high:expr, $text:literal)) => { $text };

    (type vector($count:literal $($range:tt)*)) => { Vector<$count> };
    (range vector($count:literal, $($range:tt)*)) => { Vector(kind!(range number($($range)*))) };
    (text vector($count:literal, $unit:ident)) => { concat!($count, " numbers") };
    (text vector($count:literal, $unit:ident, $($bound:tt)+)) => { concat!($count, " numbers, ", bound!(text $($bound)+)) };

    (type points($count:literal $($range:tt)*)) => { Vectors<$count> };
    (range points($count:literal, $unit:ident $(, $text:literal)?)) => { Vectors { unit: $unit } };
    (text points($count:literal, $unit:ident)) => { "points" };
    (text points($count:literal, $unit:ident, $text:literal)) => { $text };

    (type corners($count:literal, $unit:ident)) => { Vectors<$count> };
    (range corners($count:literal, $unit:ident)) => { Vectors { unit: $unit } };
    (text corners(2, $unit:ident)) => { "2 points of x and y" };
    (text corners(3, $unit:ident)) => { "2 points" };

    (type count $range:tt) => { Count };
    (range count($min:literal ..= $max:literal)) => { Count { min: $min, max: $max } };
    (text count($min:literal ..= $max:literal)) => { concat!($min, " … ", $max) };

    (type counts $range:tt) => { TwoCounts };
    (range counts $range:tt) => { TwoCounts(kind!(range count $range)) };
    (text counts $range:tt) => { concat!("2 counts, ", kind!(text count $range)) };

    (type flag) => { Flag };
    (range flag) => { Flag };
    (text flag) => { "true or false" };

    (type choice($type:ty: $($words:tt)*)) => { Choice<$type> };
    (range choice($type:ty: $($word:literal => $value:expr),+)) => { Choice(&[$(($word, $value)),+]) };
    (text choice($type:ty: $($word:literal => $value:expr),+)) => { either!($($word),+) };

    (type words $words:tt) => { Choice<&'static str> };
    (range words($($word:literal),+)) => { Choice(&[$(($word, $word)),+]) };
    (text words($($word:literal),+)) => { either!($($word),+) };

    (type list($kind:ident $($range:tt)?)) => { List<kind!(type $kind $($range)?)> };
    (range list($kind:ident $($range:tt)?)) => { List(kind!(range $kind $($range)?)) };
    (text list(choice $words:tt)) => { concat!("list of ", kind!(text choice $words)) };
    (text list($kind:ident $range:tt)) => { concat!("list, ", kind!(text $kind $range)) };
    (type list($kind:ident, $text:literal)) => { List<kind!(type $kind)> };
    (range list($kind:ident, $text:literal)) => { List(kind!(range $kind)) };
    (text list($kind:ident, $text:literal)) => { $text };

    (type text $(($text:literal))?) => { Text };
    (range text $(($text:literal))?) => { Free(PhantomData) };
    (text text) => { "text" };
    (text text($text:literal)) => { $text };

    (type table($table:ident)) => { Tables<$table> };
    (range table($table:ident)) => { Free(PhantomData) };
    (text table($table:ident)) => { "table" };

    (type by_name) => { ByName };
    (range by_name) => { ByName };
    (text by_name) => { "table of numbers" };
}

/// Field of a key: `Option` unless it is required.
macro_rules! field {
    ($kind:ty;) => { <$kind as Kind>::File };
    ($kind:ty; $($default:tt)+) => { Option<<$kind as Kind>::File> };
}

/// Default of a key: its type, its value, and in words.
#[rustfmt::skip]
macro_rules! default {
    (type $kind:ty; = $default:tt) => { <$kind as Kind>::Default };
    (type $kind:ty; $(or $words:literal)?) => { () };
    (value = $default:tt) => { $default };
    (value $(or $words:literal)?) => { () };
    (text = $default:literal) => { concat!("`", stringify!($default), "`") };
    (text = [$($first:literal $(, $other:literal)*)?]) => { concat!("`[", $($first $(, ", ", $other)*,)? "]`") };
    (text $(or $words:literal)?) => { concat!($($words)?) };
}

macro_rules! table {
    (
        $(#[doc = $intro:literal])*
        struct $table:ident $(: $derived:ident)? = $heading:literal {
            $(
                $(#[doc = $meaning:literal])+
                $key:ident: $kind:ident $(($($range:tt)*))? $(= $default:tt)? $(or $words:literal)?,
            )*
        }
        $(beside { $($(#[$attribute:meta])* $field:ident: $type:ty,)* })?
    ) => {
        $(#[doc = $intro])*
        #[derive($($derived,)? serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $table {
            $(pub $key: field!(kind!(type $kind $(($($range)*))?); $(= $default)? $(or $words)?),)*
            $($($(#[$attribute])* pub $field: $type,)*)?
        }

        #[allow(non_upper_case_globals, reason = "they are called as in the file")]
        impl $table {
            $(
                $(#[doc = $meaning])+
                pub const $key: Row<
                    kind!(type $kind $(($($range)*))?),
                    default!(type kind!(type $kind $(($($range)*))?); $(= $default)? $(or $words)?),
                > = Row {
                    name: stringify!($key),
                    range: kind!(range $kind $(($($range)*))?),
                    default: default!(value $(= $default)? $(or $words)?),
                };
            )*

            /// The keys on the page.
            pub const KEYS: &[Key] = &[$(Key {
                table: $heading,
                name: Self::$key.name,
                default: default!(text $(= $default)? $(or $words)?),
                range: kind!(text $kind $(($($range)*))?),
                meaning: concat!($($meaning),+).trim_ascii(),
            }),*];
        }

        /// The table on the page.
        macro_rules! $table {
            () => {
                concat!(
                    "## ", $heading, "\n\n", $($intro, "\n",)*
                    "\n| key | default | range | meaning |\n| --- | --- | --- | --- |\n",
                    $(
                        "| `", stringify!($key), "` | ", default!(text $(= $default)? $(or $words)?), " | ",
                        kind!(text $kind $(($($range)*))?), " |", $($meaning,)+ " |\n",
                    )*
                    "\n"
                )
            };
        }
    };
}
