//! A camera on a sphere around a point, and rays through its picture.

use crate::view::Camera;
use glam::{DVec2, DVec3};

/// Angle per point of the mouse's way, rad; distance factor per point of its wheel.
const TURN: f64 = 0.006;
const ZOOM: f64 = 2e-3;
/// Lowest and highest angle of the eye above the level plane, rad: not straight down, where there is no up.
const HEIGHTS: [f64; 2] = [-0.3, 1.5];
/// The scene's camera fills its picture, which is wide and low; the window's stands so much farther off.
const ROOM: f64 = 1.25;
/// Nearest and farthest eye, in distances of the scene's camera.
const DISTANCES: [f64; 2] = [0.05, 20.0];

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    target: DVec3,
    distance: f64,
    azimuth: f64,
    height: f64,
    field_of_view_deg: f64,
    /// Distance at the beginning, m.
    own: f64,
}

impl Orbit {
    /// The orbit that a camera is on.
    pub fn of(camera: &Camera) -> Self {
        let off = DVec3::from(camera.eye) - DVec3::from(camera.target);
        let distance = off.length().max(1e-6);
        Self {
            target: camera.target.into(),
            distance: ROOM * distance,
            azimuth: off.y.atan2(off.x),
            height: (off.z / distance).asin(),
            field_of_view_deg: camera.field_of_view_deg,
            own: ROOM * distance,
        }
    }

    fn back(&self) -> DVec3 {
        let ((sin, cos), (up, level)) = (self.azimuth.sin_cos(), self.height.sin_cos());
        DVec3::new(level * cos, level * sin, up)
    }

    /// Level axes of the picture: to the right, and away from the eye.
    #[cfg(feature = "gamepad")]
    pub fn level_axes(&self) -> [DVec3; 2] {
        let (sin, cos) = self.azimuth.sin_cos();
        [DVec3::new(-sin, cos, 0.0), DVec3::new(-cos, -sin, 0.0)]
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        Camera {
            eye: (self.target + self.back() * self.distance).to_array(),
            target: self.target.to_array(),
            up: [0.0, 0.0, 1.0],
            field_of_view_deg: self.field_of_view_deg,
        }
    }

    /// Turns by a way of the mouse, points.
    pub fn turn(&mut self, way: DVec2) {
        self.azimuth -= way.x * TURN;
        self.height = (self.height + way.y * TURN).clamp(HEIGHTS[0], HEIGHTS[1]);
    }

    /// Comes nearer, or goes away where the wheel's way is negative.
    pub fn zoom(&mut self, way: f64) {
        self.distance = (self.distance * (-way * ZOOM).exp()).clamp(DISTANCES[0] * self.own, DISTANCES[1] * self.own);
    }

    /// Where the ray through a point of a picture meets the level plane at a height, m; `at` is from −1 to 1, y up, `aspect` width by
    /// height. None where it goes past it, or meets it far away.
    pub fn on_plane(&self, at: DVec2, aspect: f64, height: f64) -> Option<DVec3> {
        let back = self.back();
        let right = DVec3::Z.cross(back).try_normalize()?;
        let up = back.cross(right);
        let half = (0.5 * self.field_of_view_deg).to_radians().tan();
        let along = right * (at.x * half * aspect) + up * (at.y * half) - back;
        let eye = self.target + back * self.distance;
        let t = (height - eye.z) / along.z;
        (t > 0.0 && t < 20.0 * self.distance).then(|| eye + along * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera =
        Camera { eye: [0.03, -0.02, 0.04], target: [0.001, 0.002, 0.0], up: [0.0, 0.0, 1.0], field_of_view_deg: 40.0 };

    #[test]
    fn an_orbit_begins_at_its_camera() {
        let back = Orbit::of(&CAMERA).camera();
        let [eye, target] = [CAMERA.eye, CAMERA.target].map(DVec3::from);
        let apart = DVec3::from(back.eye).distance(target + (eye - target) * ROOM);
        assert!(apart < 1e-12, "{apart}");
        assert_eq!((back.target, back.field_of_view_deg), (CAMERA.target, 40.0));
    }

    #[test]
    fn the_middle_of_the_picture_is_the_target_and_its_sides_are_beside_it() {
        let mut orbit = Orbit::of(&CAMERA);
        for way in [DVec2::ZERO, DVec2::new(200.0, -30.0), DVec2::new(-50.0, 900.0)] {
            orbit.turn(way);
            orbit.zoom(40.0);
            let middle = orbit.on_plane(DVec2::ZERO, 1.5, 0.0).expect("below the eye");
            assert!(middle.distance(CAMERA.target.into()) < 1e-9, "{middle}");
            // to the right in the picture is along the camera's right
            let right = orbit.on_plane(DVec2::new(0.1, 0.0), 1.5, 0.0).expect("below the eye") - middle;
            assert!(right.normalize().dot(DVec3::Z.cross(orbit.back()).normalize()) > 1.0 - 1e-9);
        }
        let level = Orbit::of(&Camera { eye: [0.05, 0.0, 0.0], target: [0.0; 3], ..CAMERA });
        assert_eq!(level.on_plane(DVec2::new(0.0, 0.5), 1.0, -0.01), None, "the ray rises");
    }
}
