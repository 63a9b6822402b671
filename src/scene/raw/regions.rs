//! Tables of regions of bodies: `[[boundary]]`, `[[rest_spring]]`, `[[inclusion]]`, `[[load]]`, `[[attach]]`.

use super::*;

/// Keys that define a region; they occur in the tables of boundaries, rest-shape springs, loads and probes.
pub struct Extent {
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
            pub fn extent(&mut self) -> Extent {
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
    pub fn extent(&mut self) -> Extent {
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

/// A table with the keys of a region between its rows.
macro_rules! region_table {
    (
        $(#[doc = $intro:literal])*
        struct $table:ident = $heading:literal { $($before:tt)* }
        region { $($after:tt)* }
    ) => {
        table! {
            $(#[doc = $intro])*
            struct $table = $heading {
                $($before)*
                /// As in `[[boundary]]`.
                box_mm: corners(3, MM) or "",
                /// As in `[[boundary]]`.
                centre_mm: vector(3, MM) or "",
                /// As in `[[boundary]]`.
                radius_mm: number(MM, > 0) or "",
                /// As in `[[boundary]]`.
                through_mm: vector(3, MM) or "",
                /// As in `[[boundary]]`.
                normal: vector(3, PLAIN) or "",
                /// As in `[[boundary]]`.
                within_mm: number(MM, >= 0) or "",
                /// As in `[[boundary]]`.
                margin_mm: number(MM, >= 0) or "",
                /// As in `[[boundary]]`.
                group: text or "",
                $($after)*
            }
        }
    };
}

table! {
    struct Boundary = "`[[boundary]]`" {
        /// Deformable body.
        body: text or "(the skin, or the only body)",
        /// Nodes that are held, by their rest positions.
        region: words(
            "bottom", "top", "sides", "sides_x", "sides_y", "side_x_min", "side_x_max", "side_y_min", "side_y_max",
            "all", "box", "sphere", "plane", "bottom_rim", "bottom_core", "group"
        ),
        /// Of `region = "box"`: two corners.
        box_mm: corners(3, MM) or "",
        /// Of `region = "sphere"`.
        centre_mm: vector(3, MM) or "",
        /// Of `region = "sphere"`.
        radius_mm: number(MM, > 0) or "",
        /// Of `region = "plane"`: a point of it.
        through_mm: vector(3, MM) or "",
        /// Of `region = "plane"`.
        normal: vector(3, PLAIN) or "",
        /// Of `region = "plane"`: distance on either side.
        within_mm: number(MM, >= 0) or "",
        /// Of `region = "bottom_rim"` and `"bottom_core"`: distance from the sides.
        margin_mm: number(MM, >= 0) or "",
        /// Of `region = "group"`: a physical group of the body's mesh, of triangles or of tetrahedra, by name, or by number where it has no
        /// name.
        group: text or "",
        /// Axes that are held. Where regions overlap, the last boundary holds an axis.
        axes: text("letters of `xyz`") = "xyz",
        /// Prescribed displacement along the held axes.
        displacement_mm: vector(3, MM) = [0.0, 0.0, 0.0],
        /// Prescribed turn about the vertical axis through the middle, where x and y are held.
        turn_deg: number(DEGREE) = 0.0,
        /// Prescribed displacement over time on top of both, linear between the times; implicit Euler and static steps.
        path_mm: points(4, MM, "rows of t_s, x, y, z") or "(none)",
    }
}

region_table! {
    /// Springs from the nodes of a region to their rest positions.
    struct RestSpring = "`[[rest_spring]]`" {
        /// Deformable body.
        body: text or "(the skin, or the only body)",
        /// Nodes.
        region: text("as in `[[boundary]]`"),
    }
    region {
        /// Stiffness of each spring.
        stiffness_n_m: number(STIFFNESS, > 0),
    }
}

table! {
    /// A part of a body with another stiffness than its layers, such as a nodule in skin.
    struct Inclusion = "`[[inclusion]]`" {
        /// Deformable body, with a hyperelastic law.
        body: text or "(the skin, or the only body)",
        /// Where it is; where inclusions overlap, the last one counts.
        region: words("sphere", "box"),
        /// As in `[[boundary]]`.
        box_mm: corners(3, MM) or "",
        /// As in `[[boundary]]`.
        centre_mm: vector(3, MM) or "",
        /// As in `[[boundary]]`.
        radius_mm: number(MM, > 0) or "",
        /// Young's modulus. Poisson's ratio, density, fibres' angles and toughness are those of the layer.
        young_kpa: number(KPA, > 0),
    }
}

region_table! {
    /// Forces on the outer surface of a body.
    struct Load = "`[[load]]`" {
        /// Deformable body.
        body: text or "(the skin, or the only body)",
        /// Pressure, along the inward normal at rest. One of this, `traction_kpa` and `force_n`.
        pressure_kpa: number(KPA) or "",
        /// Of `pressure_kpa`: normal and area are those of the shape at the start of each step, with `newton` of that at its end; not with
        /// the midpoint rule of hyperelastic bodies.
        follower: flag = false,
        /// Force per area at rest, along x, y, z.
        traction_kpa: vector(3, KPA) or "",
        /// Total force, spread evenly over the area at rest, or at a point.
        force_n: vector(3, NEWTON) or "",
        /// Of `force_n`: the point that it acts on, in place of `region`.
        at_mm: vector(3, MM) or "",
        /// Parts of the surface.
        region: text("as in `[[boundary]]`") or "(`\"top\"`)",
        /// Corners of a rectangle of the top, in place of `region`.
        rectangle_mm: corners(2, MM) or "",
    }
    region {
        /// From when on.
        start_s: number(SECOND, >= 0) = 0.0,
        /// Until when.
        end_s: number(SECOND, > 0) or "(never)",
    }
}

region_table! {
    /// Bilateral constraints on the nodes of a region.
    struct Attach = "`[[attach]]`" {
        /// Deformable body whose nodes are held.
        body: text or "(the skin, or the only body)",
        /// Body that they are held to, both ways.
        to: text or "(their place in the world)",
        /// Direction along which they may move.
        slide: vector(3, PLAIN) or "(held along all axes)",
        /// With `slide`: friction along it, as a share of the force that holds a node across it.
        friction: number(PLAIN, >= 0) or "(none)",
        /// With `slide`: friction of the path itself, shared evenly by the nodes of the region.
        resistance_n: number(NEWTON, >= 0) or "(none)",
        /// Nodes.
        region: text("as in `[[boundary]]`"),
    }
    region {
    }
}
