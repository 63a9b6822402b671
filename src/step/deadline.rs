//! Deadline of a step by the wall clock, and whether what may follow would miss it.
//!
//! Durations are those of the last steps on the host. On a GPU, work that nothing is read back from counts where it is waited for, in the next step.

use std::time::{Duration, Instant};

/// Share of a duration that remains from step to step, so that one long one is forgotten: less than a tenth after 20 steps.
const KEPT: (u32, u32) = (7, 8);

/// See the module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Deadline {
    of_step: Option<Instant>,
    of_substep: Option<Instant>,
    passes_ended: Option<Instant>,
    after_passes: Duration,
    column_batch: Duration,
    pass: Duration,
}

impl Deadline {
    /// Sets the end of the next step.
    pub fn set(&mut self, end: Option<Instant>) {
        self.of_step = end;
    }

    /// A substep begins; `left` of the step are left with it, and share the time.
    pub fn begin(&mut self, now: Instant, left: u32) {
        self.of_substep = self.of_step.map(|end| now + end.saturating_duration_since(now) / left.max(1));
    }

    /// The passes have ended; the longest of them took so long.
    pub fn end_passes(&mut self, now: Instant, longest: Duration) {
        self.passes_ended = Some(now);
        if longest > Duration::ZERO {
            self.pass = longest;
        }
    }

    /// The substep ends; after a `checked` one durations are not typical.
    pub fn end(&mut self, now: Instant, checked: bool) {
        if let Some(since) = self.passes_ended.take().filter(|_| !checked) {
            self.after_passes = (now - since).max(faded(self.after_passes));
        }
    }

    /// The step ends: the deadline holds for one.
    pub fn pass_by(&mut self) {
        self.of_step = None;
    }

    /// There is one.
    pub fn is_set(&self) -> bool {
        self.of_substep.is_some()
    }

    /// Another pass that takes as long as the `longest` so far would miss it.
    pub fn excludes_pass(&self, now: Instant, longest: Duration) -> bool {
        self.of_substep.is_some_and(|end| now + longest + self.after_passes > end)
    }

    /// A batch of columns would miss it, with a pass after it. The batch may have been slow by chance, so its duration fades each time that it is
    /// asked for in vain.
    pub fn excludes_batch(&mut self, now: Instant, longest: Duration) -> bool {
        let excluded = self.excludes_pass(now, self.column_batch + longest.max(self.pass));
        if excluded {
            self.column_batch = faded(self.column_batch);
        }
        excluded
    }

    /// A batch of columns took so long.
    pub fn batch_took(&mut self, duration: Duration) {
        self.column_batch = duration;
    }
}

fn faded(duration: Duration) -> Duration {
    duration * KEPT.0 / KEPT.1
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn of(end: Duration) -> (Deadline, Instant) {
        let (mut deadline, now) = (Deadline::default(), Instant::now());
        deadline.set(Some(now + end));
        (deadline, now)
    }

    #[test]
    fn without_one_nothing_is_excluded() {
        let (mut deadline, now) = (Deadline::default(), Instant::now());
        deadline.begin(now, 1);
        assert!(!deadline.is_set() && !deadline.excludes_pass(now, Duration::from_secs(9)));
    }

    #[test]
    fn what_follows_the_passes_is_reserved() {
        let (mut deadline, now) = of(10 * MS);
        deadline.begin(now, 1);
        assert!(!deadline.excludes_pass(now + 5 * MS, 4 * MS));
        assert!(deadline.excludes_pass(now + 5 * MS, 6 * MS));
        deadline.end_passes(now + 5 * MS, 2 * MS);
        deadline.end(now + 8 * MS, false);
        deadline.begin(now, 1);
        assert!(deadline.excludes_pass(now + 5 * MS, 4 * MS), "3 ms are reserved");
        // not those of a checked step
        deadline.end_passes(now + 5 * MS, 2 * MS);
        deadline.end(now + 800 * MS, true);
        deadline.begin(now, 1);
        assert!(!deadline.excludes_pass(now + 2 * MS, 4 * MS));
    }

    #[test]
    fn substeps_share_the_time() {
        let (mut deadline, now) = of(12 * MS);
        deadline.begin(now, 3);
        assert!(!deadline.excludes_pass(now, 4 * MS) && deadline.excludes_pass(now, 5 * MS));
        // the next one has half of what is left
        deadline.begin(now + 2 * MS, 2);
        assert!(!deadline.excludes_pass(now + 2 * MS, 5 * MS) && deadline.excludes_pass(now + 2 * MS, 6 * MS));
        // a late one none
        deadline.begin(now + 20 * MS, 1);
        assert!(deadline.is_set() && deadline.excludes_pass(now + 20 * MS, MS));
        deadline.pass_by();
        deadline.begin(now, 1);
        assert!(!deadline.is_set());
    }

    #[test]
    fn a_batch_that_was_slow_once_is_tried_again() {
        let (mut deadline, now) = of(10 * MS);
        deadline.begin(now, 1);
        deadline.batch_took(300 * MS);
        let vain = (0..100).take_while(|_| deadline.excludes_batch(now, MS)).count();
        assert!((5..40).contains(&vain), "{vain}");
    }
}
