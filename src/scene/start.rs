//! Where the nodes of a deformable body are at the start: at rest, or far from it, for tests of what a body recovers from.

use super::invalid::Result;
use super::raw;
use super::text::{Bound, DEGREE, MM, SceneText, or};
use std::ops::Range;

/// Shape of a body at the start; nodes that a boundary holds are where it holds them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Undeformed.
    Rest,
    /// Each coordinate of each node off its rest position by up to `amplitude`, uniformly.
    Random {
        /// m
        amplitude: f64,
        /// Another one gives other places, the same one the same.
        seed: u32,
    },
    /// All nodes in the plane of the bottom.
    Flat,
    /// The corners of the cell in the middle of the body at the places of the opposite corners.
    InsideOut,
    /// Turned about the vertical axis through the middle: the bottom not, the top by this angle, rad, in proportion between.
    Twist(f64),
}

/// Reads `start` and the keys that belong to it.
pub(super) fn start(scene: &SceneText, raw: &raw::Skin, table: Range<usize>) -> Result<Start> {
    let word = or(raw.start.clone(), "rest".to_string());
    let known = ["rest", "random", "flat", "inside_out", "twist"].map(|word| (word, word));
    let word = scene.choice("start", &word, &known)?;
    if word != "random" {
        scene.needless("start_mm", &raw.start_mm, "it belongs to start = \"random\"")?;
        scene.needless("start_seed", &raw.start_seed, "it belongs to start = \"random\"")?;
    }
    if word != "twist" {
        scene.needless("start_deg", &raw.start_deg, "it belongs to start = \"twist\"")?;
    }
    Ok(match word {
        "random" => {
            let why = "start = \"random\" puts nodes off their rest positions by up to start_mm";
            let amplitude = scene.required("start_mm", raw.start_mm.clone(), table, why)?;
            Start::Random {
                amplitude: scene.number("start_mm", &amplitude, MM, Bound::Positive)?,
                seed: *or(raw.start_seed.clone(), 1).get_ref(),
            }
        }
        "flat" => Start::Flat,
        "inside_out" => Start::InsideOut,
        "twist" => {
            let why = "start = \"twist\" turns the top by start_deg";
            let angle = scene.required("start_deg", raw.start_deg.clone(), table, why)?;
            Start::Twist(scene.number("start_deg", &angle, DEGREE, Bound::Finite)?.to_radians())
        }
        _ => Start::Rest,
    })
}
