//! Tables of tools.

use super::*;
use crate::scene::{Rendering, Role};

/// Kind of a tool's device.
#[derive(Clone, Copy, PartialEq)]
pub enum KindOfDevice {
    Replay,
    Hand,
    Null,
    Haply,
}

table! {
    /// A rigid body that a hand holds: one of `blade`, `points_mm`, `round`, `lines`.
    struct Tool = "`[[tool]]`" {
        /// Name, each once.
        name: text,
        /// Wavefront OBJ for pictures; round tools need none.
        mesh: text("file") or "",
        /// Length of a unit of the mesh; 1 if absent.
        mesh_unit_mm: number(MM, > 0) or "",
        /// Mass.
        mass_g: number(GRAM, > 0),
        /// Principal moments of inertia; none is more than the other two together.
        inertia_g_mm2: vector(3, G_MM2, > 0),
        /// Contact points, in the tool's frame.
        points_mm: points(3, MM) or "",
        /// Of `points_mm`: radius of the disc that a point's force is spread over; 0 if absent.
        tip_radius_mm: number(MM, >= 0) or "",
        /// Recorded hand: `time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw`.
        trajectory: text("file") or "",
        /// Hand without a file, unturned.
        path_mm: points(4, MM, "rows of t_s, x, y, z") or "",
        /// Spring and damper between hand and tool.
        coupling: table(Coupling) or "(its defaults)",
        /// For tools that cut.
        blade: table(Blade) or "",
        /// For spheres and capsules.
        round: table(Round) or "",
        /// For tools of points and lines.
        lines: table(Lines) or "",
        /// For tools that remove the tissue which they touch, of bodies with `cut = "remove"`: space out of hexahedra of a large-strain law
        /// and of smoothed tetrahedra, or whole cells and tetrahedra.
        carve: table(Carve) or "",
        /// Haptic device that holds the tool.
        device: table(Device) or "(the recorded hand)",
    }
}

table! {
    struct Coupling: Default = "`[tool.coupling]`" {
        /// Translational stiffness.
        stiffness_n_m: number(STIFFNESS, > 0) = 1000.0,
        /// Translational damping.
        damping_n_s_m: number(DAMPING, >= 0) = 5.0,
        /// Rotational stiffness.
        angular_stiffness_n_m_rad: number(ANGULAR_STIFFNESS, > 0) = 1.0,
        /// Rotational damping.
        angular_damping_n_m_s_rad: number(ANGULAR_DAMPING, >= 0) = 0.01,
    }
}

table! {
    struct Blade = "`[tool.blade]`" {
        /// Polyline of the edge from the tip on, in the tool's frame.
        edge_mm: points(3, MM),
        /// Normal of the blade's plane. The edge faces `normal` × (heel − tip): with the other sign it moves backward and cuts nothing.
        normal: vector(3, PLAIN) = [0.0, 1.0, 0.0],
        /// Thickness of the blade.
        thickness_mm: number(MM, > 0),
        /// Length of a piece of edge: one contact each.
        edge_spacing_mm: number(MM, > 0) = 0.4,
        /// Distance of contact points on the flats.
        flat_spacing_mm: number(MM, > 0) = 1.0,
        /// How far the flats reach behind the edge.
        depth_mm: number(MM, > 0) = 2.0,
    }
}

table! {
    struct Round = "`[tool.round]`" {
        /// Radius.
        radius_mm: number(MM, > 0),
        /// Centre of a sphere, or ends of a capsule's axis.
        points_mm: points(3, MM, "1 or 2 points"),
    }
}

table! {
    struct Lines = "`[tool.lines]`" {
        /// Wavefront OBJ with `v`, `l` and `p`.
        mesh: text("file"),
        /// Length of a unit of the mesh.
        mesh_unit_mm: number(MM, > 0) = 1.0,
        /// How far the surface stands off the lines.
        radius_mm: number(MM, >= 0) = 0.0,
    }
}

table! {
    struct Carve = "`[tool.carve]`" {
        /// Reach from the tool's surface: what is nearer is removed at the end of a step.
        distance_mm: number(MM, >= 0) = 0.1,
        /// Normal force per area of the surface from which on a contact removes anything.
        pressure_kpa: number(KPA, >= 0) = 0.0,
        /// Removes the cells behind the faces that the tool touches, in place of the space that it reaches: of bodies of any law, and of
        /// plain tetrahedra.
        whole_cells: flag = false,
    }
}

table! {
    struct Device = "`[tool.device]`" {
        /// The recorded hand, a simulated hand that gives way, one at rest, or a Haply device.
        kind: choice(KindOfDevice:
            "replay" => KindOfDevice::Replay, "hand" => KindOfDevice::Hand, "null" => KindOfDevice::Null,
            "haply" => KindOfDevice::Haply
        ),
        /// Force of the coupling, or of the skin alone.
        rendering: choice(Rendering: "coupling" => Rendering::Coupling, "direct" => Rendering::Direct) = "coupling",
        /// Newtons on the hand per newton on the tool.
        force_scale: number(PLAIN, > 0) = 1.0,
        /// Largest force asked of the device.
        max_force_n: number(NEWTON, >= 0) or "(what the device can give)",
        /// Largest torque asked of the device.
        max_torque_n_mm: number(N_MM, >= 0) or "(what the device can give)",
        // default: larger than that of any device, so that only faulty readings exceed it
        /// Distance from its origin beyond which a reading is unsound.
        workspace_mm: number(MM, > 0) = 10000.0,
        /// Origin of the device's frame in the scene.
        position_mm: vector(3, MM) = [0.0, 0.0, 0.0],
        /// Rotation vector of the device's frame.
        turn_deg: vector(3, DEGREE) = [0.0, 0.0, 0.0],
        /// Metres of the scene per metre of the device.
        scale: number(PLAIN, > 0) = 1.0,
        /// Tool's origin in the frame of the end effector.
        tool_mm: vector(3, MM) = [0.0, 0.0, 0.0],
        /// Rotation vector of the tool there.
        tool_turn_deg: vector(3, DEGREE) = [0.0, 0.0, 0.0],
        /// Role of button 0, 1, …
        buttons: list(choice(Role:
            "active" => Role::Active, "clutch" => Role::Clutch, "freeze" => Role::Freeze, "none" => Role::None
        )) = [],
        /// Keep the device from giving energy.
        passivity: flag = true,
        /// Of `kind = "hand"`; 150 if absent.
        hand_mass_g: number(GRAM, > 0) or "",
        /// Of `kind = "hand"`: spring to the path; 300 if absent.
        hand_stiffness_n_m: number(STIFFNESS, > 0) or "",
        /// Of `kind = "hand"`; 5 if absent.
        hand_damping_n_s_m: number(DAMPING, >= 0) or "",
        /// Of `kind = "hand"`: step of the position sensors; 0 if absent.
        encoder_um: number(MICRON, >= 0) or "",
        /// Of `kind = "haply"`: the service; `ws://localhost:10001` if absent.
        url: text or "",
        /// Of `kind = "haply"`: the arm; the first if absent.
        device: text or "",
        /// Of `kind = "haply"`: the grip; the first if absent.
        grip: text or "",
    }
}
