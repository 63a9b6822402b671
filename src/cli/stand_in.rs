//! `cutis haply-mock`: stand-in for Haply's Inverse Service until it is ended.

use super::args::HaplyMock;
use super::print;
use super::refused::{Refused, Result};
use cutis::haptic::haply::mock::{Event, Mock, Options};
use cutis::haptic::haply::wire::{ArmKind, GripKind};
use cutis::scene::{self, Pose, Tool};
use std::path::Path;

/// Serves until the program is ended, or standard input where that is asked for.
pub fn stand_in(args: &HaplyMock) -> Result<u8> {
    let mut options = Options { port: args.port, tell: Some(tell), keep: args.keep, ..Options::default() };
    options.arms = vec![(ArmKind::Inverse3, args.device.clone())];
    options.grips = if args.no_grip { Vec::new() } else { vec![(GripKind::Wired, args.grip.clone())] };
    options.path = args.scene.as_deref().map_or(Ok(Vec::new()), |scene| hand(scene, args.tool.as_deref()))?;
    let mock = Mock::start(options)?;
    let with = if args.no_grip { String::new() } else { format!(" with verse_grip {}", args.grip) };
    let end = if args.until_stdin_ends { "Ctrl-C or the end of standard input ends it" } else { "Ctrl-C ends it" };
    print::line(&format!("listens at {} as inverse3 {}{with}; {end}", mock.url(), args.device))?;
    if !args.until_stdin_ends {
        loop {
            std::thread::park();
        }
    }
    // an unreadable input counts as ended
    std::io::copy(&mut std::io::stdin(), &mut std::io::sink()).ok();
    Ok(0)
}

/// Recorded hand trajectory of a scene's tool.
fn hand(path: &Path, wanted: Option<&str>) -> Result<Vec<Pose>> {
    let scene = scene::read(path)?;
    let held: Vec<Tool> = scene.tools.into_iter().filter(|tool| tool.free.is_none()).collect();
    let names: Vec<String> = held.iter().map(|tool| format!("\"{}\"", tool.name)).collect();
    let found = held.into_iter().find(|tool| wanted.is_none_or(|name| name == tool.name));
    let scene = path.to_path_buf();
    found.map(|tool| tool.trajectory).ok_or_else(|| match wanted {
        Some(name) if !names.is_empty() => Refused::NoTool { scene, name: name.into(), known: names.join(", ") },
        _ => Refused::NoHand { scene },
    })
}

fn tell(event: Event) {
    let line = match event {
        Event::Connected(from) => format!("connected: {from}"),
        Event::Left(from, frames) => format!("left: {from} after {frames} frames"),
    };
    // clients are served whether somebody reads this or not
    print::line(&line).ok();
}
