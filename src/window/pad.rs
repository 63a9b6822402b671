//! A game pad as a hand: the left stick moves the tool in the level plane as it is seen, the right one lowers and turns it, a trigger or the
//! lower button cuts, select takes the next tool, start plays.

use crate::scene::Scene;
use gilrs::{Axis, Button, Gilrs};
use glam::DVec3;
use std::time::{Duration, Instant};

/// Deflection that a stick may have at rest.
const REST: f64 = 0.15;
/// Speed of a tool at full deflection, m/s in the plane and up, and rad/s about z.
const SPEED: f64 = 0.02;
const DEPTH_SPEED: f64 = 0.01;
const TURN_SPEED: f64 = 1.0;
/// Longest time that a look at the sticks stands for: a window that hung does not throw the tool.
const LONGEST: Duration = Duration::from_millis(50);
/// Time between two looks while a pad is there.
pub const BETWEEN: Duration = Duration::from_millis(16);

/// What a pad's sticks and buttons say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Read {
    /// Deflections of the left and the right stick, right and up positive, −1 to 1.
    pub sticks: [[f64; 2]; 2],
    /// The tool cuts.
    pub cuts: bool,
    /// The next tool is to be taken.
    pub takes: bool,
    /// Play or pause.
    pub plays: bool,
}

/// Displacement and rotation, m and rad, of a tool over some time, as seen by a camera whose level axes are `right` and `forward`.
pub fn moved(sticks: [[f64; 2]; 2], [right, forward]: [DVec3; 2], time: Duration) -> (DVec3, f64) {
    // slow near the middle, where a blade is guided
    let curved = |v: f64| {
        let share = ((v.abs() - REST) / (1.0 - REST)).clamp(0.0, 1.0);
        v.signum() * share * share
    };
    let [[x, y], [turn, up]] = sticks.map(|stick| stick.map(curved));
    let time = time.min(LONGEST).as_secs_f64();
    let way = (right * x + forward * y) * SPEED + DVec3::Z * (up * DEPTH_SPEED);
    (way * time, -turn * TURN_SPEED * time)
}

/// The tool after one in hand that a watcher may hold, or the first; none after the last.
pub fn next(scene: &Scene, held: &[bool], now: Option<usize>) -> Option<usize> {
    (now.map_or(0, |tool| tool + 1)..scene.tools.len()).find(|tool| held.get(*tool) == Some(&true))
}

/// The pads of the machine.
pub struct Pad {
    pads: Gilrs,
    before: Read,
    looked: Instant,
}

impl Pad {
    /// Looks for pads; later ones are found too.
    ///
    /// # Errors
    /// What the system says.
    pub fn new() -> Result<Self, String> {
        let pads = Gilrs::new().map_err(|error| format!("game pads cannot be read ({error})"))?;
        Ok(Self { pads, before: Read::default(), looked: Instant::now() })
    }

    /// What the first pad says, with `takes` and `plays` at the press alone, and the time since the last look; none without a pad.
    pub fn read(&mut self) -> Option<(Read, Duration)> {
        while self.pads.next_event().is_some() {}
        let time = self.looked.elapsed();
        self.looked = Instant::now();
        let (_, pad) = self.pads.gamepads().next()?;
        let stick = |axes: [Axis; 2]| axes.map(|axis| f64::from(pad.value(axis)));
        let now = Read {
            sticks: [stick([Axis::LeftStickX, Axis::LeftStickY]), stick([Axis::RightStickX, Axis::RightStickY])],
            cuts: pad.is_pressed(Button::South) || pad.is_pressed(Button::RightTrigger2),
            takes: pad.is_pressed(Button::Select),
            plays: pad.is_pressed(Button::Start),
        };
        let before = std::mem::replace(&mut self.before, now);
        Some((Read { takes: now.takes && !before.takes, plays: now.plays && !before.plays, ..now }, time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sticks_move_a_tool_as_it_is_seen_and_rest_in_the_middle() {
        let axes = [DVec3::Y, DVec3::NEG_X];
        let time = Duration::from_millis(10);
        let close = |a: DVec3, b: DVec3| (a - b).length() < 1e-12;
        // full deflection: its speed times the time
        let (way, turn) = moved([[1.0, 0.0], [0.0, 0.0]], axes, time);
        assert!(close(way, DVec3::Y * 2e-4) && turn == 0.0, "{way}");
        let (way, _) = moved([[0.0, 1.0], [0.0, -1.0]], axes, time);
        assert!(close(way, DVec3::new(-2e-4, 0.0, -1e-4)), "{way}");
        let (way, turn) = moved([[0.0, 0.0], [1.0, 0.0]], axes, time);
        assert!(way == DVec3::ZERO && (turn + 0.01).abs() < 1e-12, "{turn}");
        // what a worn stick has in the middle moves nothing, half a stick a quarter or so
        let (way, turn) = moved([[0.14, -0.1], [0.1, -0.14]], axes, time);
        assert!(way == DVec3::ZERO && turn == 0.0);
        let (half, _) = moved([[0.5, 0.0], [0.0, 0.0]], axes, time);
        assert!((0.1..0.3).contains(&(half.length() / 2e-4)), "{half}");
        // a window that hung for a second
        let (way, _) = moved([[1.0, 0.0], [0.0, 0.0]], axes, Duration::from_secs(1));
        assert!(close(way, DVec3::Y * 1e-3), "{way}");
    }

    #[test]
    fn select_goes_through_the_tools_that_may_be_held() {
        let mut scene = crate::scene::incision().expect("the built-in scene");
        let tool = scene.tools[0].clone();
        scene.tools = vec![tool; 4];
        let held = [false, true, false, true];
        let mut now = None;
        let mut order = vec![];
        for _ in 0..3 {
            now = next(&scene, &held, now);
            order.push(now);
        }
        assert_eq!(order, [Some(1), Some(3), None]);
    }
}
