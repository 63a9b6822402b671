//! Progress of a run on standard error: a bar on a terminal, about ten lines elsewhere.

use super::print;
use cutis::report::{run::Progress, study};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// Number of lines over a run when standard error is no terminal.
const LINES: u64 = 10;

/// Progress display of a run.
pub struct Shown {
    bar: Option<ProgressBar>,
    start: Instant,
}

impl Shown {
    /// Display before the first step.
    pub fn new(steps: u32) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} steps, {eta} left, {msg}");
            let bar = ProgressBar::new(u64::from(steps));
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { bar, start: Instant::now() }
    }

    /// Updates it after a step.
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
            print::note(format_args!(
                "step {}/{}, {:.3} s, {state}; {spent:.0} s spent, {left:.0} s left",
                p.step, p.steps, p.time
            ));
        }
    }

    /// Ends it after the last step.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress display of a study; runs differ in length, so the time left follows the share of the work.
pub struct Share {
    bar: Option<ProgressBar>,
    start: Instant,
    line: u64,
}

/// Length of the bar.
const PARTS: f64 = 1000.0;

impl Share {
    /// Display before the first run.
    pub fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:30} {msg}");
            let bar = ProgressBar::new(PARTS as u64);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { bar, start: Instant::now(), line: 0 }
    }

    /// Updates it after a step.
    pub fn update(&mut self, p: &study::Progress) {
        let spent = self.start.elapsed().as_secs_f64();
        let left = spent / p.share.max(1e-3) * (1.0 - p.share).max(0.0);
        let text = format!("run {}/{}, {spent:.0} s spent, about {left:.0} s left", p.run + 1, p.runs);
        if let Some(bar) = &self.bar {
            bar.set_position((p.share * PARTS) as u64);
            bar.set_message(text);
            return;
        }
        let line = (p.share * LINES as f64) as u64;
        if line > self.line {
            self.line = line;
            print::note(text);
        }
    }

    /// Ends it after the last run.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Files below this are read before anybody looks, bytes.
const LARGE: u64 = 64 << 20;

/// Progress display of a file that is read; nothing for a small one.
pub struct Reading {
    bar: Option<ProgressBar>,
    /// Whether lines are printed instead, and the last one.
    line: Option<u64>,
}

impl Reading {
    /// Display before a file of so many bytes.
    pub fn new(bytes: u64) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = (bytes >= LARGE && terminal).then(|| {
            let style = ProgressStyle::with_template("{bar:30} {percent} % read, {eta} left");
            let bar = ProgressBar::new(PARTS as u64);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { bar, line: (bytes >= LARGE && !terminal).then_some(0) }
    }

    /// Updates it.
    pub fn update(&mut self, share: f64) {
        if let Some(bar) = &self.bar {
            bar.set_position((share * PARTS) as u64);
        }
        let now = (share * LINES as f64) as u64;
        if let Some(line) = self.line.as_mut().filter(|line| now > **line) {
            *line = now;
            print::note(format_args!("{:.0} % read", 100.0 * share));
        }
    }

    /// Ends it.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress display of pictures.
pub struct Pictures {
    start: Instant,
    bar: Option<ProgressBar>,
}

impl Pictures {
    /// Display before the first one.
    pub fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} pictures, {eta} left");
            let bar = ProgressBar::new(0);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { start: Instant::now(), bar }
    }

    /// Updates it after a picture.
    pub fn update(&mut self, done: usize, all: usize) {
        if let Some(bar) = &self.bar {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            return;
        }
        let line = |done: usize| done * LINES as usize / all;
        if line(done) > line(done - 1) {
            let spent = self.start.elapsed().as_secs_f64();
            print::note(format_args!("picture {done}/{all}, {spent:.1} s spent"));
        }
    }

    /// Ends it.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
