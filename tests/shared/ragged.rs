//! A block of two layers as an irregular mesh of tetrahedra that a blade can cut.

use crate::small::block;
use cutis::bodies::Model;
use cutis::kernels::cut::{Hit, cut};
use cutis::math::random::Random;
use cutis::math::{V3, V4};
use cutis::mesh::Grid;
use cutis::scene::{Blade, Contact, Cut, Element, Law, Pose, Preconditioner, Scene, TetrahedralMesh, Tool};
use std::sync::Arc;

/// Cells of the block, 1 mm each.
const CELLS: [u32; 3] = [6, 4, 4];
/// Room for any cut of it.
const ENOUGH: u32 = 4000;

/// A block of two layers as an irregular mesh, six tetrahedra to a cell.
pub fn body(element: Element, cut: Cut) -> Scene {
    of_cells(CELLS, element, cut)
}

/// The same of any even number of levels of cells.
pub fn of_cells(cells: [u32; 3], element: Element, cut: Cut) -> Scene {
    let [x, y, z] = cells.map(|c| f64::from(c) * 1e-3);
    let half = cells[2] / 2;
    let layers = [(half, 0.5 * z, 30e3, 0.45, 1000.0), (half, 0.5 * z, 100e3, 0.4, 1200.0)];
    let mut scene = block([x, y], [cells[0], cells[1]], &layers);
    let skin = &mut scene.skins[0];
    let grid = Grid::new(skin);
    let (tetrahedra, layers): (Vec<_>, Vec<_>) =
        grid.tetrahedra().into_iter().map(|(corners, layer)| (corners, layer as u32)).unzip();
    let mut random = Random::new(3);
    let size = [x, y, z];
    let mut place = |node: usize| {
        let at = grid.rest(node);
        let low = [-0.5 * x, -0.5 * y, 0.0];
        // nodes of the box's faces stay in them
        std::array::from_fn(|n| {
            let inside = (1e-9..size[n] - 1e-9).contains(&(at[n] - low[n]));
            at[n] + if inside { 0.15e-3 * random.signed() } else { 0.0 }
        })
    };
    let nodes = (0..grid.node_count()).map(&mut place).collect();
    let mesh = TetrahedralMesh::new(nodes, tetrahedra, layers).unwrap_or_else(|e| panic!("{e}"));
    (skin.size, skin.cells, skin.cut) = ([mesh.size()[0], mesh.size()[1]], [0; 2], cut);
    skin.layers.iter_mut().for_each(|layer| (layer.thickness, layer.cells) = (0.0, 0));
    skin.law = Law::Fem { element, corotational: true };
    skin.mesh = Some(Arc::new(mesh));
    (skin.rayleigh_mass, skin.rayleigh_stiffness) = (0.0, 0.0);
    scene.solver.preconditioner = Preconditioner::Block;
    // a blade far away, which makes room for cuts
    let trajectory = vec![Pose { position: [0.0, 0.0, 0.5], ..Pose::default() }];
    scene.tools = vec![Tool { trajectory, round: None, blade: Some(Blade::default()), ..Tool::default() }];
    scene.contact = Some(Contact::default());
    scene
}

/// The block with room for any cut.
pub fn split(element: Element) -> Scene {
    body(element, Cut::Split { reserve_columns: ENOUGH })
}

/// Links that a blade crosses in the plane `x = at`, m.
pub fn through(model: &Model, at: f64) -> Vec<Hit<f64>> {
    let segments = model.mechanics().segments(model);
    let rest: Vec<V4<f64>> = segments.rest.iter().map(|x| V3::of(*x).pad(0.0)).collect();
    let still = vec![[0.0; 4]; rest.len()];
    let quad = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[y, z]| [at, y, z, 0.0]);
    cut(&segments.ends, &rest, &still, &still, &quad)
}
