//! Contact forces as arrows.

use glam::DVec3;

/// Length of an arrow per force, m/N: a contact point of a blade bears some 10 mN.
const LENGTH: f64 = 0.05;
/// Shortest arrow that is drawn, m.
const SHORTEST: f64 = 1e-5;
/// Width of a head as a share of the camera's distance, its length in widths, the shaft's width as a share of it.
const HEAD: f64 = 0.006;
const HEAD_LENGTH: f64 = 3.0;
const SHAFT: f64 = 0.35;
/// Sides of an arrow.
const SIDES: u32 = 8;
/// Colour, sRGB.
pub const BLUE: [u8; 3] = [11, 98, 164];

/// Mesh of all arrows.
#[derive(Default)]
pub struct Arrows {
    /// `[vertex]` m
    pub positions: Vec<[f64; 3]>,
    /// `[triangle]` vertex ids
    pub triangles: Vec<[u32; 3]>,
}

impl Arrows {
    /// Arrows from points (m) along forces (N), as wide as a camera at this distance (m) wants them.
    pub fn new(forces: &[[[f64; 3]; 2]], distance: f64) -> Self {
        let mut out = Self::default();
        for [point, force] in forces {
            let along = DVec3::from(*force) * LENGTH;
            if along.is_finite() && along.length() > SHORTEST {
                out.add((*point).into(), along, HEAD * distance);
            }
        }
        out
    }

    /// A shaft, then a cone; both open below, where nobody looks.
    fn add(&mut self, from: DVec3, along: DVec3, width: f64) {
        let (length, axis) = (along.length(), along.normalize());
        let (u, v) = axis.any_orthonormal_pair();
        let neck = from + axis * (length - (HEAD_LENGTH * width).min(0.6 * length));
        let mut ring = |center: DVec3, radius: f64| {
            let first = self.positions.len() as u32;
            self.positions.extend((0..SIDES).map(|k| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(SIDES)).sin_cos();
                (center + (u * cos + v * sin) * radius).to_array()
            }));
            first
        };
        let rings = [ring(from, 0.5 * SHAFT * width), ring(neck, 0.5 * SHAFT * width), ring(neck, 0.5 * width)];
        let tip = self.positions.len() as u32;
        self.positions.push((from + along).to_array());
        for k in 0..SIDES {
            let next = (k + 1) % SIDES;
            let [a, b, c] = rings;
            self.triangles.push([a + k, a + next, b + k]);
            self.triangles.push([b + k, a + next, b + next]);
            self.triangles.push([c + k, c + next, tip]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_is_as_long_as_its_force_and_none_has_none() {
        let arrows = Arrows::new(&[[[0.0, 0.0, 0.01], [0.0, 0.0, 0.5]], [[0.0; 3], [0.0; 3]]], 0.05);
        let high = arrows.positions.iter().map(|p| p[2]).fold(f64::MIN, f64::max);
        assert!((high - 0.035).abs() < 1e-12 && arrows.triangles.len() == 3 * SIDES as usize, "{high}");
        assert!(Arrows::new(&[[[0.0; 3], [f64::NAN, 0.0, 0.0]]], 0.05).positions.is_empty());
    }
}
