//! Faults of a connection, counted by the I/O thread and readable from anywhere.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counts since the device was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trouble {
    /// Frames that were not JSON, or not of a frame's shape.
    pub malformed: u64,
    /// Frames with a non-finite number, or a quaternion that is no rotation.
    pub non_finite: u64,
    /// Frames without the arm, or without its state.
    pub absent: u64,
    /// Frames of an uncalibrated arm, whose position is unknown.
    pub uncalibrated: u64,
    /// Frames without the grip or its state: the last rotation was kept and its buttons released.
    pub grip_absent: u64,
    /// Answers that took more than five ticks at 1 kHz.
    pub late: u64,
    /// Unsolicited frames.
    pub unasked: u64,
    /// Connections lost.
    pub disconnects: u64,
    /// Connections re-established.
    pub reconnects: u64,
    /// Forces of the loop above the limit, which were limited.
    pub clamped: u64,
    /// Non-finite forces of the loop; zero was sent instead.
    pub refused: u64,
}

impl Trouble {
    /// Number of unusable frames and lost connections.
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

/// Increments a counter.
pub(super) fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

impl Counts {
    /// Current values.
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
