//! Progress of a run on standard error: a bar on a terminal, about ten lines elsewhere.

use cutis::report::run::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// Lines over a run when standard error is no terminal.
const LINES: u64 = 10;

/// What the user sees while a scene runs.
pub struct Shown {
    bar: Option<ProgressBar>,
    start: Instant,
}

impl Shown {
    /// Before the first step.
    pub fn new(steps: u32) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} steps, {eta} left, {msg}");
            let bar = ProgressBar::new(u64::from(steps));
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { bar, start: Instant::now() }
    }

    /// After a step.
    pub fn update(&mut self, p: &Progress) {
        let state = format!("force {:.3} N, cut {:.1} mm", p.force, p.cut * 1e3);
        if let Some(bar) = &self.bar {
            bar.set_position(u64::from(p.step));
            bar.set_message(state);
            return;
        }
        let line = |step: u32| u64::from(step) * LINES / u64::from(p.steps);
        if line(p.step) > line(p.step - 1) {
            let spent = self.start.elapsed().as_secs_f64();
            let left = spent / f64::from(p.step) * f64::from(p.steps - p.step);
            eprintln!("step {}/{}, {:.3} s, {state}; {spent:.0} s spent, {left:.0} s left", p.step, p.steps, p.time);
        }
    }

    /// After the last one.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
