//! What a watcher asks of a session.

use super::mouse::Target;
use super::quantity::Asked;
use crate::view::Clip;
use glam::DVec3;
use serde::Deserialize;

/// Where a watcher wants a tool's hand.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Number of the tool.
    pub tool: usize,
    /// m
    pub position: [f64; 3],
    /// rad about z
    #[serde(default)]
    pub turn: f64,
    /// The button that a blade cuts with.
    #[serde(default)]
    pub pressed: bool,
}

/// See the module.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Go on.
    Play,
    /// Stand still.
    Pause,
    /// One step, then stand still.
    Step,
    /// Begin anew, with the present settings.
    Reset,
    /// Scene time per wall time.
    Speed(f64),
    /// Move a tool's hand.
    Hand(Hand),
    /// Give a tool's hand back to its recording.
    Release(usize),
    /// Go back to a kept state, counted from the oldest.
    Seek(usize),
    /// Coefficient of friction.
    Friction(f64),
    /// Factor on Young's moduli and spring stiffnesses of the scene as read.
    Stiffness(f64),
    /// Residual of a solve.
    Tolerance(f64),
    /// Length of a step, ms; begins anew.
    StepMs(f64),
    /// Read this too for every picture, for all who watch.
    Look(Asked),
    /// A page has drawn a frame; no matter of the session.
    Drawn(u32),
}

/// Farthest that a watcher may move a hand, or put a plane from the origin, m.
const FARTHEST: f64 = 10.0;

impl Command {
    /// Reads a command.
    ///
    /// # Errors
    /// What is wrong with the text, for the one who sent it.
    pub fn read(text: &str) -> Result<Self, String> {
        serde_json::from_str::<Self>(text).map_err(|error| format!("no command: {error}"))?.checked()
    }

    /// The command, if its values can be.
    ///
    /// # Errors
    /// Which value cannot, for the one who sent it.
    pub fn checked(self) -> Result<Self, String> {
        let within = |what: &str, value: f64, [low, high]: [f64; 2]| match (low..=high).contains(&value) {
            true => Ok(self),
            false => Err(format!("{what} = {value}; wanted a number from {low} to {high}")),
        };
        match self {
            Self::Speed(v) => within("speed", v, [0.01, 10.0]),
            Self::Friction(v) => within("friction", v, [0.0, 10.0]),
            Self::Stiffness(v) => within("stiffness", v, [0.01, 100.0]),
            Self::Tolerance(v) => within("tolerance", v, [1e-9, 0.5]),
            Self::StepMs(v) => within("step_ms", v, [0.01, 1000.0]),
            Self::Hand(Hand { position, turn, .. }) => {
                position.into_iter().try_for_each(|v| within("position", v, [-FARTHEST, FARTHEST]).map(drop))?;
                within("turn", turn, [-1e3, 1e3])
            }
            Self::Look(Asked { plane: Some(Clip { normal, offset }), .. }) => {
                // its length scales the offset
                let length = DVec3::from(normal).length();
                within("length of the plane's normal", length, [1e-3, 1e3])?;
                within("offset of the plane", offset, [-FARTHEST * length, FARTHEST * length])
            }
            _ => Ok(self),
        }
    }
}

impl Hand {
    /// As a target.
    pub fn target(&self) -> Target {
        Target { position: self.position.into(), turn: self.turn, pressed: self.pressed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::Quantity;

    #[test]
    fn commands_are_read_or_refused_with_words() {
        assert_eq!(Command::read("\"pause\""), Ok(Command::Pause));
        assert_eq!(Command::read("{\"speed\": 0.5}"), Ok(Command::Speed(0.5)));
        let hand = Hand { tool: 0, position: [0.0, 0.01, 0.02], turn: 0.0, pressed: true };
        let text = "{\"hand\": {\"tool\": 0, \"position\": [0, 0.01, 0.02], \"pressed\": true}}";
        assert_eq!(Command::read(text), Ok(Command::Hand(hand)));
        let text = "{\"look\": {\"quantity\": \"von_mises\", \"plane\": {\"normal\": [0, 1, 0], \"offset\": 0.001}}}";
        let plane = Some(Clip { normal: [0.0, 1.0, 0.0], offset: 1e-3 });
        assert_eq!(Command::read(text), Ok(Command::Look(Asked { quantity: Some(Quantity::VonMises), plane })));
        assert_eq!(Command::read("{\"look\": {}}"), Ok(Command::Look(Asked::default())));
        for wrong in [
            "",
            "{}",
            "\"fly\"",
            "{\"speed\": -1}",
            "{\"speed\": 1e999}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 1e9, 0]}}",
            "{\"hand\": {\"tool\": -1, \"position\": [0, 0, 0]}}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 0]}}",
            "{\"hand\": {\"tool\": 0, \"position\": [0, 0, 0], \"more\": 1}}",
            "{\"friction\": null}",
            "{\"look\": {\"quantity\": \"beauty\"}}",
            "{\"look\": {\"plane\": {\"normal\": [0, 0, 0], \"offset\": 0}}}",
            "{\"look\": {\"plane\": {\"normal\": [0, 1, 0], \"offset\": 11}}}",
        ] {
            let words = Command::read(wrong).expect_err(wrong);
            assert!(words.contains("no command") || words.contains("wanted a number"), "{wrong}: {words}");
        }
    }
}
