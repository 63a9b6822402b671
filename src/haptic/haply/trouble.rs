//! What went wrong on a connection, counted by the I/O thread and read by anyone.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counts since the device was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trouble {
    /// Frames that were not JSON, or not of a frame's shape.
    pub malformed: u64,
    /// Frames with a number that is none, or a quaternion that is no rotation.
    pub non_finite: u64,
    /// Frames without the arm, or without its state.
    pub absent: u64,
    /// Frames of an arm that is not calibrated: where it is, is not known.
    pub uncalibrated: u64,
    /// Frames without the grip, or without its state: the last rotation was kept and its buttons let go.
    pub grip_absent: u64,
    /// Answers that took more than five ticks of 1 kHz.
    pub late: u64,
    /// Frames that answered none of ours.
    pub unasked: u64,
    /// Connections lost.
    pub disconnects: u64,
    /// Connections taken up again.
    pub reconnects: u64,
    /// Forces of the loop beyond the limit; they were cut to it.
    pub clamped: u64,
    /// Forces of the loop that were no numbers; zero was sent.
    pub refused: u64,
}

impl Trouble {
    /// Frames that were of no use, and connections lost.
    pub fn faults(&self) -> u64 {
        self.malformed + self.non_finite + self.absent + self.uncalibrated + self.grip_absent + self.disconnects
    }
}

/// The counters behind [`Trouble`], and the count of sound states.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub frames: AtomicU64,
    pub malformed: AtomicU64,
    pub non_finite: AtomicU64,
    pub absent: AtomicU64,
    pub uncalibrated: AtomicU64,
    pub grip_absent: AtomicU64,
    pub late: AtomicU64,
    pub unasked: AtomicU64,
    pub disconnects: AtomicU64,
    pub reconnects: AtomicU64,
    pub clamped: AtomicU64,
    pub refused: AtomicU64,
}

/// One more.
pub(super) fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

impl Counts {
    /// As they are now.
    pub fn trouble(&self) -> Trouble {
        let now = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Trouble {
            malformed: now(&self.malformed),
            non_finite: now(&self.non_finite),
            absent: now(&self.absent),
            uncalibrated: now(&self.uncalibrated),
            grip_absent: now(&self.grip_absent),
            late: now(&self.late),
            unasked: now(&self.unasked),
            disconnects: now(&self.disconnects),
            reconnects: now(&self.reconnects),
            clamped: now(&self.clamped),
            refused: now(&self.refused),
        }
    }
}
