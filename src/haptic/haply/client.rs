//! The device as seen by the loop, and the I/O thread that keeps the socket in lock step with it.

use super::command::{Command, Configure, Profile, Session, Version};
use super::session::{Address, Chosen, Fault, Heard, Refused, Socket, hear, reading};
use super::wire::frame;
use super::{DEAD_MAN, PATIENCE, RESOLUTION, Settings};
use crate::error::Result;
use crate::haptic::device::{Device, Limits, Reading, Wrench};
use glam::DVec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use triple_buffer::{Input, Output, triple_buffer};
use tungstenite::Message;

/// Time after which an answer counts as late: five ticks at 1 kHz.
const LATE: Duration = Duration::from_millis(5);

/// Time without an answer after which the peer is gone.
const SILENCE: Duration = Duration::from_secs(1);

/// First delay before a lost connection is re-established; it doubles up to [`LONGEST_WAIT`]. Longer than the servo's timeout for a lost
/// device ([`LOST_AFTER`](crate::haptic::guard::LOST_AFTER)), so that the force ramps up again afterwards.
const FIRST_WAIT: Duration = Duration::from_millis(70);
/// Longest delay: a returning service is found within a second, and a missing one costs nothing.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Timeout of a further attempt, short so that closing does not have to wait for one.
const RETRY_PATIENCE: Duration = Duration::from_millis(500);

/// Timeout of the closing handshake.
const GOODBYE: Duration = Duration::from_millis(200);

/// Maximum number of frames received at once beyond the answer; a peer that sends more is slowed down by its socket.
const MOST_UNASKED: usize = 256;

/// Name of the program in Haply's hub.
const PROFILE: &str = "org.cutis.haptic";

/// Last reading of the device.
#[derive(Clone, Copy, Debug)]
struct Said {
    reading: Reading,
    at: Instant,
}

/// Last force of the loop.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    /// N
    force: DVec3,
    at: Instant,
}

#[derive(Debug, Default)]
struct Shared {
    counts: Counts,
    stop: AtomicBool,
}

impl Shared {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }
}

/// Arm of an Inverse Service, as a [`Device`]. Released when dropped.
pub struct Client {
    name: String,
    limits: Limits,
    said: Output<Said>,
    wanted: Input<Wanted>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Client {
    pub(super) fn open(settings: &Settings) -> Result<Self> {
        let limit = settings.limits.force;
        if !(limit.is_finite() && limit >= 0.0) {
            return Err(Refused::ForceLimit { url: settings.url.clone(), limit }.into());
        }
        let address = Address::of(&settings.url)?;
        let mut socket = address.connect(PATIENCE)?;
        let version = settings.version.map_or_else(|| address.version(), Ok)?;
        let inventory = address.inventory(&mut socket, PATIENCE)?;
        let chosen = Chosen::of(&inventory, settings)?;
        let mut name = format!("Haply {} {}", chosen.arm.word(), chosen.device);
        if let Some((kind, id)) = &chosen.grip {
            name += &format!(" with {} {id}", kind.word());
        }
        let now = Instant::now();
        let (said, out) = triple_buffer(&Said { reading: Reading::at_rest(f64::INFINITY), at: now });
        let (wanted, orders) = triple_buffer(&Wanted { force: DVec3::ZERO, at: now });
        let shared = Arc::new(Shared::default());
        let last = Reading::at_rest(f64::INFINITY);
        let mut pump = Pump { address, chosen, version, said, orders, shared: shared.clone(), last };
        pump.take(&inventory);
        let thread = thread::Builder::new().name("haply".into()).spawn(move || pump.run(socket));
        let thread = thread.map_err(|e| Refused::Nobody { url: settings.url.clone(), reason: e.to_string() })?;
        let limits = Limits { force: limit, torque: 0.0 };
        Ok(Self { name, limits, said: out, wanted, shared, thread: Some(thread) })
    }

    /// Faults since it was opened.
    pub fn trouble(&self) -> Trouble {
        self.shared.counts.trouble()
    }

    /// Number of valid states since it was opened.
    pub fn frames(&self) -> u64 {
        self.shared.counts.frames.load(Ordering::Relaxed)
    }

    fn end(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // a thread that panicked has released the device: its socket is closed
            thread.join().ok();
        }
    }
}

impl Device for Client {
    fn name(&self) -> &str {
        &self.name
    }

    fn limits(&self) -> Limits {
        self.limits
    }

    fn read(&mut self, _time: f64) -> Reading {
        let said = *self.said.read();
        // a device without any reading stays infinitely old
        Reading { age: said.reading.age + said.at.elapsed().as_secs_f64(), ..said.reading }
    }

    fn write(&mut self, _time: f64, wrench: Wrench) {
        let mut wanted = wrench;
        if !wanted.force.is_finite() {
            count(&self.shared.counts.refused);
            wanted = Wrench::default();
        }
        let (given, clamped) = self.limits.apply(wanted);
        if clamped {
            count(&self.shared.counts.clamped);
        }
        self.wanted.write(Wanted { force: given.force, at: Instant::now() });
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }

    fn resolution(&self) -> f64 {
        RESOLUTION
    }

    fn faults(&self) -> u64 {
        self.trouble().faults()
    }

    fn close(&mut self) -> Result<()> {
        self.end();
        Ok(())
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.end();
    }
}

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Lost,
    Stopped,
}

/// State of the I/O thread.
struct Pump {
    address: Address,
    chosen: Chosen,
    version: Version,
    said: Input<Said>,
    orders: Output<Wanted>,
    shared: Arc<Shared>,
    last: Reading,
}

/// Lock-step state of one connection.
struct Step {
    socket: Socket,
    /// Number of outstanding answers.
    owed: usize,
    /// The last force sent was not zero.
    pushing: bool,
    /// A valid answer has arrived: forces may be sent.
    trusted: bool,
}

impl Pump {
    fn run(mut self, socket: Socket) {
        let mut next = Some(socket);
        while let Some(socket) = next.take() {
            if self.serve(socket) == End::Stopped {
                return;
            }
            count(&self.shared.counts.disconnects);
            next = self.again();
        }
    }

    /// Reconnects, until stopped.
    fn again(&mut self) -> Option<Socket> {
        let mut wait = FIRST_WAIT;
        while !self.shared.stopped() {
            let until = Instant::now() + wait;
            // the loop's writes wake this thread too
            while !self.shared.stopped() && Instant::now() < until {
                thread::park_timeout(until.saturating_duration_since(Instant::now()));
            }
            wait = (wait * 2).min(LONGEST_WAIT);
            let Ok(mut socket) = self.address.connect(RETRY_PATIENCE) else { continue };
            let Ok(inventory) = self.address.inventory(&mut socket, RETRY_PATIENCE) else { continue };
            if self.take(&inventory) {
                count(&self.shared.counts.reconnects);
                return Some(socket);
            }
        }
        None
    }

    /// Exchanges frames in lock step with the loop until the connection is lost or the loop ends.
    fn serve(&mut self, socket: Socket) -> End {
        let mut step = Step { socket, owed: 0, pushing: false, trusted: false };
        let needed = if self.version >= Version::VECTOR { Version::VECTOR } else { Version::OLDEST };
        let profile = Profile { name: PROFILE.into(), required_version: Some(format!(">={needed}")) };
        let mut session = Some(Session { configure: Configure { profile } });
        loop {
            if self.shared.stopped() {
                self.leave(step, session);
                return End::Stopped;
            }
            if session.is_none() {
                self.wait_for_order();
            }
            let force = if step.trusted { self.force() } else { DVec3::ZERO };
            let sent = self.send(&mut step, force, session.take()).and_then(|()| self.answer(&mut step));
            if sent.is_err() {
                return End::Lost;
            }
        }
    }

    /// Waits until the loop has written or its time-out has passed.
    fn wait_for_order(&mut self) {
        let until = Instant::now() + DEAD_MAN;
        while !self.orders.update() && !self.shared.stopped() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            thread::park_timeout(left);
        }
    }

    /// Newest force; zero once the loop is silent.
    fn force(&mut self) -> DVec3 {
        let wanted = self.orders.read();
        if wanted.at.elapsed() > DEAD_MAN { DVec3::ZERO } else { wanted.force }
    }

    fn send(&self, step: &mut Step, force: DVec3, session: Option<Session>) -> std::result::Result<(), End> {
        let mut command = Command::force(self.chosen.arm, &self.chosen.device, force, self.version);
        command.session = session;
        let text = serde_json::to_string(&command).expect("strings and finite numbers always have a text");
        step.socket.send(Message::text(text)).map_err(|_| End::Lost)?;
        step.owed += 1;
        step.pushing = force != DVec3::ZERO;
        Ok(())
    }

    /// Waits for the answer, then receives other pending frames, so that the next frame answers the next force.
    fn answer(&mut self, step: &mut Step) -> std::result::Result<(), End> {
        let asked = Instant::now();
        while step.owed > 0 {
            match hear(&mut step.socket) {
                Heard::Text(text) => self.heard(step, &text),
                Heard::End(_) => return Err(End::Lost),
                Heard::Nothing if self.shared.stopped() => return Ok(()),
                Heard::Nothing if asked.elapsed() > SILENCE => return Err(End::Lost),
                // an extra frame, because the peer may hold this force as long as it stays silent
                Heard::Nothing if step.pushing && self.force() == DVec3::ZERO => {
                    self.send(step, DVec3::ZERO, None)?;
                }
                Heard::Nothing => {}
            }
        }
        if asked.elapsed() > LATE {
            count(&self.shared.counts.late);
        }
        let blocking = |step: &Step, on: bool| step.socket.get_ref().set_nonblocking(!on).map_err(|_| End::Lost);
        blocking(step, false)?;
        for _ in 0..MOST_UNASKED {
            match hear(&mut step.socket) {
                Heard::Text(text) => self.heard(step, &text),
                Heard::Nothing => break,
                Heard::End(_) => return Err(End::Lost),
            }
        }
        blocking(step, true)
    }

    fn heard(&mut self, step: &mut Step, text: &str) {
        if step.owed == 0 {
            count(&self.shared.counts.unasked);
        }
        step.owed = step.owed.saturating_sub(1);
        match frame(text) {
            Ok(frame) => step.trusted |= self.take(&frame),
            Err(_) => count(&self.shared.counts.malformed),
        }
    }

    /// Publishes the reading of a frame, if it has a valid pose.
    fn take(&mut self, frame: &super::wire::Frame) -> bool {
        let counts = &self.shared.counts;
        match reading(frame, &self.chosen, self.last) {
            Ok((reading, whole)) => {
                if !whole {
                    count(&counts.grip_absent);
                }
                self.last = reading;
                self.said.write(Said { reading, at: Instant::now() });
                count(&counts.frames);
                return true;
            }
            Err(Fault::Absent) => count(&counts.absent),
            Err(Fault::Uncalibrated) => count(&counts.uncalibrated),
            Err(Fault::NonFinite) => count(&counts.non_finite),
        }
        false
    }

    /// Sends zero force and closes the connection, as far as the peer cooperates.
    fn leave(&self, mut step: Step, session: Option<Session>) {
        let until = Instant::now() + GOODBYE;
        if self.send(&mut step, DVec3::ZERO, session).is_err() {
            return;
        }
        step.socket.close(None).ok();
        while Instant::now() < until && !matches!(hear(&mut step.socket), Heard::End(_)) {}
    }
}

/// Faults of a connection, counted by the I/O thread and readable from anywhere: counts since the device was opened.
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
