//! Signals that end a run: the first one lets it release its devices and write its report, a second one ends it at once.
//!
//! SIGINT and SIGTERM everywhere, SIGHUP on Unix; a signal that the caller has the program ignore (`nohup`) stays ignored. SIGXFSZ is
//! caught, so that a file beyond the limit (`ulimit -f`) is an error of its write.

use super::refused::{Refused, Result};
use signal_hook::{consts, flag};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Signals by number.
#[cfg(unix)]
const ENDING: [i32; 3] = [consts::SIGINT, consts::SIGTERM, consts::SIGHUP];
#[cfg(not(unix))]
const ENDING: [i32; 2] = [consts::SIGINT, consts::SIGTERM];

/// Exit status of a program that a signal ended, less the signal's number, as shells have it.
const ENDED: i32 = 128;

/// What has arrived.
pub struct Signals {
    /// Set by the first signal.
    pub stop: Arc<AtomicBool>,
    /// Number of the last signal.
    number: Arc<AtomicUsize>,
}

impl Signals {
    /// Catches them from here on.
    pub fn catch() -> Result<Self> {
        let caught = Self { stop: Arc::default(), number: Arc::default() };
        let ignored = ignored();
        for signal in ENDING.into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0) {
            caught.register(signal).map_err(|source| Refused::Signals { source })?;
        }
        Ok(caught)
    }

    fn register(&self, signal: i32) -> io::Result<()> {
        // in this order: the first signal finds `stop` unset and sets it
        flag::register_conditional_shutdown(signal, ENDED + signal, self.stop.clone())?;
        flag::register_usize(signal, self.number.clone(), signal as usize)?;
        flag::register(signal, self.stop.clone()).map(drop)
    }

    /// Exit status of a run that they ended.
    pub fn exit_code(&self) -> u8 {
        (ENDED as usize + self.number.load(Ordering::Acquire)) as u8
    }
}

/// Has writes beyond the file size limit fail instead of ending the program.
pub fn survive_file_limits() {
    #[cfg(unix)]
    // without the handler such a write ends the program, which is no worse than before
    flag::register(consts::SIGXFSZ, Arc::default()).ok();
}

/// Bit mask of the signals that the program was started to ignore, where the system tells (Linux).
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
