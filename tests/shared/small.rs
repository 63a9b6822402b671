//! Small bodies in code, for tests that need no scene file.

use cutis::scene::{Boundary, Element, Law, Layer, Region, Scene, Skin};

/// One of cells, thickness (m), Young's modulus (Pa), Poisson's ratio and density (kg/m³).
pub type Material = (u32, f64, f64, f64, f64);

/// A corotational block on the origin, of layers from the bottom up; nothing holds it.
pub fn block(size: [f64; 2], cells: [u32; 2], layers: &[Material]) -> Scene {
    let layer = |(number, &(cells, thickness, young, poisson, density)): (usize, &Material)| {
        let name = format!("layer {number}");
        Layer { name, cells, thickness, young, poisson, density, ..Layer::default() }
    };
    let layers = layers.iter().enumerate().map(layer).collect();
    let law = Law::Fem { element: Element::Bbar, corotational: true };
    let skin = Skin { size, cells, layers, law, ..Skin::default() };
    Scene { title: "block".into(), skins: vec![skin], ..Scene::default() }
}

/// What holds the nodes of a region in place, along x, y, z.
pub fn held(region: Region, axes: [bool; 3]) -> Boundary {
    Boundary { region, axes, ..Boundary::default() }
}
