//! Whether a scene fits into memory, from its number of nodes, before any of it is taken.
//!
//! The bytes of a node are the least that were measured (peak resident memory of one step, 78,000 to 214,000 nodes of hexahedra, linear law,
//! columns as preconditioner); other laws, multigrid and exact factors take more. A scene that is refused cannot fit; one that passes may
//! still meet an error of its own later. Where the system does not tell what is free (it does on Linux), nothing is refused.

use super::Refused;
use crate::error::Result;
use crate::scene::{Cut, Law, Scene, Skin, cells_of, free, reserve_of};
use crate::step::Platform;

/// What is to be done with a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To step it on the CPU path in f64.
    Double,
    /// To step it on the CPU path in f32.
    Single,
    /// To set it up for a GPU, without stepping it here.
    SetUp,
}

impl From<&Platform> for Purpose {
    fn from(platform: &Platform) -> Self {
        match platform {
            Platform::Cpu64 => Self::Double,
            Platform::Cpu32 => Self::Single,
            Platform::Gpu(_) => Self::SetUp,
        }
    }
}

impl Purpose {
    /// Bytes of a node of the grid, and of one in the reserve of a cut.
    fn of_node(self, skin: &Skin, contact: bool) -> [u64; 2] {
        let springs = matches!(skin.law, Law::Springs { .. });
        match (self, springs, contact) {
            (Self::SetUp, ..) => [180, 400],
            (_, true, _) => [4000, 0],
            (Self::Double, _, false) => [1300, 1000],
            (Self::Double, _, true) => [2600, 1000],
            (Self::Single, _, false) => [1000, 700],
            (Self::Single, _, true) => [1700, 700],
        }
    }
}

/// Refuses a scene that cannot fit.
///
/// # Errors
/// [`Refused::Memory`], with the key that takes the most.
pub fn fits(scene: &Scene, purpose: Purpose) -> Result<()> {
    let Some(free) = free() else { return Ok(()) };
    let cuts = scene.tools.iter().any(|tool| tool.blade.is_some());
    let (mut wanted, mut largest) = (0, (0, String::new(), ""));
    for skin in &scene.skins {
        let z = 1 + skin.layers.iter().map(|layer| u64::from(layer.cells)).sum::<u64>();
        let columns = (u64::from(skin.cells[0]) + 1) * (u64::from(skin.cells[1]) + 1);
        let (nodes, key) = match &skin.mesh {
            Some(mesh) => (mesh.nodes().len() as u64, "the number of tetrahedra in mesh"),
            None => (columns * z, "cells"),
        };
        let reserve = match skin.cut {
            Cut::Split { reserve_columns } if cuts => u64::from(reserve_columns),
            _ => 0,
        };
        let [of_grid, of_reserve] = purpose.of_node(skin, scene.contact.is_some());
        let parts = [
            (nodes * of_grid, cells_of(&skin.name), key),
            (reserve * z * of_reserve, reserve_of(&skin.name), "cut_reserve_columns"),
        ];
        for part in parts {
            wanted += part.0;
            largest = if part.0 > largest.0 { part } else { largest };
        }
    }
    if wanted <= free {
        return Ok(());
    }
    Err(Refused::Memory { at: scene.at(&largest.1), wanted, free, key: largest.2 }.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::incision;

    #[test]
    fn the_largest_part_is_the_one_to_lower() {
        let mut scene = incision().expect("the embedded scene is valid");
        fits(&scene, Purpose::Double).expect("it is small");
        let words = |scene: &Scene| fits(scene, Purpose::Double).map_err(|e| e.to_string());
        scene.skins[0].cut = Cut::Split { reserve_columns: u32::MAX };
        let Err(reserve) = words(&scene) else { return assert!(free().is_none()) };
        assert!(reserve.contains("cut_reserve_columns"), "{reserve}");
        scene.skins[0].cells = [1 << 20; 2];
        scene.skins[0].cut = Cut::Remove;
        assert!(words(&scene).expect_err("no machine has it").ends_with("lower cells, or close what takes memory"));
    }
}
