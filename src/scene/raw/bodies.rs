//! Tables of bodies: `[skin]`, `[[block]]` and their layers, `[[rigid]]`, `[[plane]]`.

use super::*;
use crate::scene::{Element, Mass};

table! {
    /// The skin stands at the origin, z up from the middle of its bottom. Blocks take the same keys and are placed.
    struct Skin = "`[skin]` and `[[block]]`" {
        /// Name of a block; the skin is called `skin`.
        name: text or "",
        /// Middle of a block's bottom.
        position_mm: vector(3, MM) or "",
        /// Size along x and y; not with `mesh`, but for `embed`, where it is that of the surface if absent.
        size_mm: vector(2, MM, > 0) or "",
        /// Hexahedra along x and y; not with `mesh`, but for `embed`.
        cells: counts(1 ..= 4294967295) or "",
        /// File of tetrahedra (.msh, .vtu, .vtk) that the body is made of in place of a grid; the middle of the bottom of its bounding box
        /// is put where a grid's would be. With `embed` a closed surface (also .stl, .obj, .ply).
        mesh: text or "(none)",
        /// Of `mesh`: one unit of the file.
        mesh_unit_mm: number(MM, > 0) or "(1)",
        /// The body is what the surface of `mesh` encloses of a grid: its triangles, or the boundary of its tetrahedra.
        embed: choice((): "bricks" => ()) or "(none)",
        /// Large strain: compressible neo-Hookean or Mooney–Rivlin material, or neo-Hookean with collagen fibres (Holzapfel–Gasser–Ogden);
        /// corotational linear elasticity; linear elasticity; or a mass–spring lattice. With `mesh` `"neo_hookean"`, `"mooney_rivlin"`,
        /// `"corotational"`, `"linear"`, or `"springs"` along the edges of its tetrahedra.
        law: words("neo_hookean", "mooney_rivlin", "holzapfel", "corotational", "linear", "springs") = "neo_hookean",
        /// Of `law = "corotational"` and `"linear"`: hexahedra with mean dilatation, with nine inner modes, or that lock; of these laws,
        /// `"neo_hookean"` and `"mooney_rivlin"`: six tetrahedra to a cell or those of `mesh`, smoothed or that lock (preconditioner
        /// `"block"` by default, `"multigrid"` for statics).
        element: choice(Element:
            "bbar" => Element::Bbar, "enhanced" => Element::Enhanced, "plain" => Element::Plain,
            "tetra" => Element::Tetra, "plain_tetra" => Element::PlainTetra
        ) or "(`\"bbar\"`; with `mesh` `\"tetra\"`)",
        /// Mass matrix: an eighth of each cell at its corners, the same at each node, or consistent (with `law = "corotational"` or
        /// `"linear"`).
        mass: choice(Mass:
            "lumped" => Mass::Lumped, "uniform" => Mass::Uniform, "consistent" => Mass::Consistent
        ) = "lumped",
        /// What a blade does: sever links and duplicate nodes, or remove cells, or tetrahedra of `mesh`. Springs are removed.
        cut: choice(bool: "split" => false, "remove" => true) = "split",
        /// Columns of nodes that can be duplicated; of tetrahedra nodes (4 times the 2/3 power of their number).
        cut_reserve_columns: count(1 ..= 4294967295) or "(room for two cuts right across)",
        /// Of `law = "springs"`, of each. If absent, each edge of the mesh has its own, such that the layers give way to even loads as
        /// material of their `young_kpa` with Poisson's ratio ¼ does (irregular meshes of several edges per layer within a tenth; regular
        /// or coarser ones are up to a half too stiff across; under a small probe a third too soft).
        spring_stiffness_n_m: number(STIFFNESS, > 0) or "(of a `mesh`: fitted)",
        /// Of `law = "springs"`.
        spring_damping_n_s_m: number(DAMPING, >= 0) or "",
        /// Rayleigh damping by mass.
        rayleigh_mass_per_s: number(PER_SECOND, >= 0) = 0.01,
        /// Rayleigh damping by stiffness: that of small strain, rotated with the cells; of volume in its present direction.
        rayleigh_stiffness_s: number(SECOND, >= 0) = 0.01,
        /// At the start.
        velocity_m_s: vector(3, SPEED) = [0.0, 0.0, 0.0],
        /// At the start, of all nodes.
        displacement_mm: vector(3, MM) = [0.0, 0.0, 0.0],
        /// Shape at the start, for tests of recovery.
        start: words("rest", "random", "flat", "inside_out", "twist") = "rest",
        /// Of `start = "random"`: largest offset of a coordinate.
        start_mm: number(MM, > 0) or "",
        /// Of `start = "random"`; 1 if absent.
        start_seed: count(0 ..= 4294967295) or "",
        /// Of `start = "twist"`: turn of the top.
        start_deg: number(DEGREE) or "",
    }
    beside {
        #[serde(default)]
        layer: Vec<Table<Layer>>,
    }
}

table! {
    /// From the bottom up.
    struct Layer = "`[[skin.layer]]` and `[[block.layer]]`" {
        /// Name, each once in a body.
        name: text,
        /// Thickness; not with `mesh`, but for `embed`, where that of a single layer is the surface's height if absent. A cell is at most
        /// 10⁴ times as long as wide.
        thickness_mm: number(MM, > 0) or "",
        /// Hexahedra over the thickness; not with `mesh`, but for `embed`.
        cells: count(1 ..= 4294967295) or "",
        /// Physical group of the mesh's tetrahedra that the layer is, by name, or by number where it has no name.
        group: text or "(its name)",
        /// Young's modulus; not of springs with `spring_stiffness_n_m`, nor of Mooney–Rivlin.
        young_kpa: number(KPA, > 0) or "",
        // at most: the bulk modulus is 5000 times the shear modulus. The hard cases go up to it (`scenes/hard/nu_04999.toml`, in f32 too);
        // beyond it the accuracy of a solve is unknown
        /// Poisson's ratio; not of springs, nor of Mooney–Rivlin.
        poisson: within(PLAIN, 0 ..= 0.4999) or "",
        /// First constant of `law = "mooney_rivlin"`.
        c10_kpa: number(KPA, > 0) or "",
        /// Second constant of `law = "mooney_rivlin"`.
        c01_kpa: number(KPA, >= 0) or "",
        /// Bulk modulus of `law = "mooney_rivlin"`.
        bulk_kpa: number(KPA, > 0) or "",
        /// Of `law = "holzapfel"`, as the four keys below: stiffness k1 of each of the two families of fibres.
        fibre_kpa: number(KPA, >= 0) = 0.0,
        /// Exponent k2: how fast stretched fibres stiffen.
        fibre_growth: number(PLAIN, > 0) = 1.0,
        /// κ: 0 all fibres of a family along its direction, 1/3 every way.
        fibre_dispersion: within(PLAIN, 0.0 ..= 1.0 / 3.0, "0.0 … 0.3333") = 0.0,
        /// Angle of both families to Langer's lines, one to each side.
        fibre_angle_deg: number(DEGREE) = 0.0,
        /// Direction of Langer's lines, from the x axis towards y.
        langer_deg: number(DEGREE) = 0.0,
        /// Density.
        density_kg_m3: number(KG_M3, > 0),
        /// Elastic strain along x and y at rest; not of springs.
        pre_strain: vector(2, PLAIN, -0.5 < x < 1) = [0.0, 0.0],
        /// Work per area that a cut takes.
        toughness_kj_m2: number(KJ_M2, >= 0) = 2.0,
        /// Of `law = "springs"`: strain beyond which a spring breaks at the end of a step.
        break_strain: number(PLAIN, > 0) or "(none)",
        /// Colour in pictures.
        color: text("`\"#rrggbb\"`") or "(by its place)",
    }
}

table! {
    /// A box or a sphere that nothing holds.
    struct Rigid = "`[[rigid]]`" {
        /// Name, each once.
        name: text,
        /// Edges of a box.
        box_mm: vector(3, MM, > 0) or "",
        /// Of a sphere.
        radius_mm: number(MM, > 0) or "",
        /// Mass.
        mass_g: number(GRAM, > 0),
        /// Centre.
        position_mm: vector(3, MM),
        /// Rotation vector.
        turn_deg: vector(3, DEGREE) = [0.0, 0.0, 0.0],
        /// At the start.
        velocity_m_s: vector(3, SPEED) = [0.0, 0.0, 0.0],
        /// Angular velocity at the start.
        spin_rad_s: vector(3, RADIAN_PER_SECOND) = [0.0, 0.0, 0.0],
    }
}

table! {
    struct Plane = "`[[plane]]`" {
        /// Name, each once.
        name: text,
        /// A point of the wall.
        through_mm: vector(3, MM),
        /// Out of the wall.
        normal: vector(3, PLAIN),
    }
}
