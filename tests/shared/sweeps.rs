//! Random segments that move, turn and stretch from state to state, and a blade's edge that passes through them on a known path.
//!
//! The path is drawn where the segment rests: across it `x` and `y`, along it `z`, in its lengths, the axes turned with the segment and
//! never about it. The edge runs from `y < 0` to `y > 0`. So it passes the segment, whatever it does in between.

use cutis::math::random;
use cutis::math::{Real, V3, V4};
use glam::{DQuat, DVec3};

/// Consecutive sweeps of a case.
pub const SWEEPS: usize = 5;
const STATES: usize = SWEEPS + 1;
/// Length of a segment, m.
const LENGTH: f64 = 1e-3;
/// How far a segment turns in a step at most, rad.
const TURN: f64 = 0.4;

/// Numbers from −1 to 1.
pub struct Random(random::Random);

impl Random {
    /// From a seed.
    pub fn new(seed: u64) -> Self {
        Self(random::Random::split_mix(seed))
    }
    /// The next one.
    pub fn next(&mut self) -> f64 {
        self.0.signed()
    }
    /// Between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (self.next() + 1.0)
    }
    /// Of length 1.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array([0; 3].map(|_| self.next()));
            if v.length() > 0.1 && v.length() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// What the edge does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Path {
    /// From one side to the other, back and forth between; every other edge lies exactly across the segment.
    Through,
    /// From one side to the other, in small steps near the segment.
    Near,
    /// From one side onto the segment, which it rests on for some steps, and to the other side.
    Rests,
    /// Through the point where two segments in line meet, at slopes up to a half, once.
    Between,
}

/// Segments in line, of which the path meets the middle one or two, and their ends and the edge's in each state, m.
pub struct Case {
    /// [end]
    pub rest: Vec<DVec3>,
    /// [state][end]
    pub points: Vec<Vec<DVec3>>,
    /// [state]
    pub edges: Vec<[DVec3; 2]>,
}

impl Case {
    /// Somewhere near a point.
    pub fn new(random: &mut Random, path: Path, centre: DVec3) -> Self {
        let along: &[f64] = if path == Path::Between { &[-2.0, -1.0, 0.0, 0.7, 2.0] } else { &[-1.5, -0.5, 0.5, 1.5] };
        let mut length = LENGTH * random.between(0.5, 1.5);
        let own = random.direction();
        let rest = along.iter().map(|z| centre + own * (z * length)).collect();
        let mut axes = DQuat::from_axis_angle(random.direction(), random.between(0.0, std::f64::consts::PI));
        let to_own = DQuat::from_rotation_arc(DVec3::Z, own);
        axes *= to_own; // where z of the path lies along the segment
        let mut middle = centre + 0.3 * LENGTH * random.direction();
        let mut case = Self { rest, points: vec![], edges: vec![] };
        for state in 0..STATES {
            let at = |c: DVec3| middle + axes * c * length;
            case.points.push(along.iter().map(|z| at(DVec3::Z * *z)).collect());
            case.edges.push(edge(random, path, state).map(at));
            let across = (axes * DVec3::Z).cross(random.direction()).normalize();
            axes = DQuat::from_axis_angle(across, random.between(0.0, TURN)) * axes;
            length *= random.between(0.8, 1.2);
            middle += 0.3 * LENGTH * random.direction();
        }
        case
    }

    /// Displacements of the ends.
    pub fn displacements<R: Real>(&self, state: usize) -> Vec<V4<R>> {
        self.points[state].iter().zip(&self.rest).map(|(p, rest)| pad(*p - *rest)).collect()
    }

    /// What the edge sweeps from a state to the next.
    pub fn quad(&self, state: usize) -> [DVec3; 4] {
        let ([a0, b0], [a1, b1]) = (self.edges[state], self.edges[state + 1]);
        [a0, b0, b1, a1]
    }

    /// The segments of its points, the first of them having that number.
    pub fn segments(&self, first: u32) -> Vec<[u32; 2]> {
        (1..self.rest.len() as u32).map(|k| [first + k - 1, first + k]).collect()
    }
}

/// Rounded, as it lies in buffers.
pub fn pad<R: Real>(p: DVec3) -> V4<R> {
    V3::of(p.to_array()).pad(R::zero())
}

/// Both ends of the edge where the segment rests.
fn edge(random: &mut Random, path: Path, state: usize) -> [DVec3; 2] {
    let last = state + 1 == STATES;
    let side = if state == 0 { -1.0 } else { 1.0 };
    let x = match path {
        Path::Rests if state > 0 && !last => 0.0,
        Path::Between if 2 * state == STATES => 0.0,
        Path::Between => random.between(0.1, 0.5) * if 2 * state < STATES { -1.0 } else { 1.0 },
        _ if state == 0 || last => side * random.between(0.1, 0.5),
        Path::Near => 0.04 * (state as f64 - 0.5 * SWEEPS as f64) + 0.02 * random.next(),
        _ if state.is_multiple_of(2) => 0.0,
        _ => 0.5 * random.next(),
    };
    let (above, below) = (random.between(0.6, 3.0), random.between(0.6, 3.0));
    let slant = 0.1 * random.next();
    // where it passes along the segment, and its slope
    let (z, rise) =
        if path == Path::Between { (0.0, 0.5 * random.next()) } else { (0.4 * random.next(), 0.02 * random.next()) };
    let at = |y: f64| DVec3::new(x + slant * y, y, z + rise * y);
    [at(above), at(-below)]
}
