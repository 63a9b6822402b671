//! Stand-in for the Inverse Service: the same frames on a port of this machine, with simulated hands behind them.
//!
//! Each connection has a thread and gets the inventory, then one state frame per frame of the client. A hand (a mass on a damped spring to
//! a path) advances by 1 ms per frame under the force of the frame: the stand-in's output depends on the frames only, not on the clock.
//! After 500 ms without a frame, or without a connection, the force is zero. `GET /version` is answered on the same port. [`Faults`] make
//! it misbehave, for tests.
//!
//! ```
//! use cutis::haptic::{device::Device, haply};
//! # fn main() -> cutis::error::Result<()> {
//! let mock = haply::mock::Mock::start(haply::mock::Options { port: 0, ..Default::default() })?;
//! let settings = haply::Settings { url: mock.url(), ..Default::default() };
//! let mut device = haply::open(&settings)?;
//! assert!(device.read(0.0).position.z > 0.1);
//! # Ok(())
//! # }
//! ```
//!
//! The hand's law is `m v' = f + k (target − x) − d v`, by semi-implicit Euler with a step far below its period (0.14 s); at rest `x =
//! target + f/k`. Time counts frames, not seconds: each frame of the client advances the hand by one tick with the frame's force held. The
//! output of a stand-in therefore depends on the frames only. Units: x m, v m/s, f N, m kg, d N·s/m, k N/m.

mod whole;

use super::command::{Command, SetForce, Version};
use super::session::Refused;
use super::wire::{ArmKind, ArmState, Buttons, Config, Entry, Frame, GripKind, GripState, Status};
use crate::bodies::rigid::along;
use crate::error::Result;
use crate::http::{self, Door, PATIENCE};
use crate::scene::Pose;
use glam::{DQuat, DVec3};
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

/// Port of the service's simulation channel.
pub const PORT: u16 = 10001;

/// Time without a command after which a device is idle: ten times the client's own time-out.
const IDLE: Duration = Duration::from_millis(500);
/// Most connections at once; an arm and a person have two or three.
const MOST_CLIENTS: usize = 32;
/// Longest message of a client, bytes; commands have a few hundred.
const LONGEST: usize = 1 << 16;
/// Largest force of an arm, N; the specification of the Inverse3 has 10 N at its peak.
const STRONGEST: f64 = 10.0;
/// Longest interval between checks for a stop.
const SLICE: Duration = Duration::from_millis(20);

struct State {
    hands: Vec<Hand>,
    record: Record,
}

struct Shared {
    options: Options,
    version: Version,
    state: Mutex<State>,
    stop: Arc<AtomicBool>,
}

/// Stand-in that serves until it is dropped.
pub struct Mock {
    door: Door,
    shared: Arc<Shared>,
}

impl Mock {
    /// Starts listening on the loopback interface.
    ///
    /// # Errors
    /// If the port is taken or the version is malformed.
    pub fn start(options: Options) -> Result<Self> {
        let wanted = SocketAddr::from((Ipv4Addr::LOCALHOST, options.port));
        let refused = |source: io::Error| Refused::Port { address: wanted.to_string(), source };
        let named = || Refused::StandInVersion { version: options.version.clone() };
        let version = Version::of(&options.version).ok_or_else(named)?;
        let listener = TcpListener::bind(wanted).map_err(refused)?;
        let hands = vec![Hand::at_start(&options.path); options.arms.len()];
        let record = Record { forces: vec![DVec3::ZERO; hands.len()], ..Record::default() };
        let state = Mutex::new(State { hands, record });
        let shared = Arc::new(Shared { options, version, state, stop: Arc::default() });
        let inside = shared.clone();
        let receive = move |stream, from| inside.receive(stream, from);
        let door = Door::open("haply-mock", listener, MOST_CLIENTS, &shared.stop, receive).map_err(refused)?;
        Ok(Self { door, shared })
    }

    /// Address for clients.
    pub fn url(&self) -> String {
        format!("ws://{}", self.door.address())
    }

    /// Record so far.
    pub fn record(&self) -> Record {
        self.shared.state().record.clone()
    }
}

/// Sends an old frame `times` times, then a new one; false if it could not.
fn say(socket: &mut WebSocket<TcpStream>, old: &str, times: u32, new: &str) -> bool {
    let mut send = |text: &str| socket.send(Message::text(text)).is_ok();
    (0..times).all(|_| send(old)) && send(new)
}

impl Shared {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // the state is consistent between any two statements that hold the lock
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, event: Event) {
        if let Some(tell) = self.options.tell {
            tell(event);
        }
    }

    /// Serves a WebSocket or an HTTP request.
    fn receive(&self, mut stream: TcpStream, from: SocketAddr) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let head = http::head(&mut stream)?;
        let local = http::is_local(&head);
        if !(local && http::is_upgrade(&head)) {
            return match http::asked(&head) {
                _ if !local => http::refuse(&mut stream, "403 Forbidden", "this stand-in serves its own machine alone"),
                Some(("/version", _)) => {
                    let text = whole::version(&self.options.version);
                    http::answer(&mut stream, "200 OK", "application/json", text.as_bytes())
                }
                _ => http::refuse(&mut stream, "404 Not Found", "this stand-in answers /version alone"),
            };
        }
        let mut refusal = stream.try_clone()?;
        let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
        let accepted = tungstenite::accept_with_config(stream, Some(config));
        let socket = accepted.map_err(|error| {
            let body = serde_json::json!({ "error": error.to_string() }).to_string();
            http::answer(&mut refusal, "400 Bad Request", "application/json", body.as_bytes()).ok();
            io::Error::other(error)
        })?;
        drop(refusal); // a descriptor
        socket.get_ref().set_read_timeout(Some(SLICE))?;
        {
            let state = &mut *self.state();
            let alone = state.record.connections == state.record.ended;
            if alone && !self.options.keep {
                state.hands.fill(Hand::at_start(&self.options.path));
            }
            state.record.connections += 1;
        }
        self.tell(Event::Connected(from));
        let frames = self.serve(socket);
        let state = &mut *self.state();
        let record = &mut state.record;
        record.ended += 1;
        record.last_forces.push(record.forces.clone());
        record.forces.fill(DVec3::ZERO);
        self.tell(Event::Left(from, frames));
        Ok(())
    }

    /// Sends the inventory, then answers frame by frame; returns the number of frames.
    fn serve(&self, mut socket: WebSocket<TcpStream>) -> u64 {
        let faults = self.options.faults;
        let (mut frames, mut heard, mut before) = (0, Instant::now(), String::new());
        if !faults.silent && socket.send(Message::text(self.frame(true, 0))).is_err() {
            return 0;
        }
        while !self.stopped() {
            match socket.read() {
                Ok(Message::Text(text)) => {
                    frames += 1;
                    heard = Instant::now();
                    self.obey(&text, frames == 1);
                    thread::sleep(faults.delay);
                    let now = self.frame(false, frames);
                    let old = if frames.is_multiple_of(10) { faults.burst } else { 0 };
                    if !say(&mut socket, &before, old, &now) {
                        return frames;
                    }
                    before = now;
                    if frames == faults.drop_after {
                        return frames;
                    }
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(e)) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if heard.elapsed() > IDLE {
                        self.let_go();
                    }
                }
                Err(_) => return frames,
            }
        }
        socket.close(None).and_then(|()| socket.flush()).ok();
        frames
    }

    /// Releases the force of a silent client.
    fn let_go(&self) {
        let record = &mut self.state().record;
        if record.forces.iter().any(|force| *force != DVec3::ZERO) {
            record.idled += 1;
            record.forces.fill(DVec3::ZERO);
        }
    }

    /// Applies a client's frame: forces of one frame on one arm add up, and the hands advance by a tick.
    fn obey(&self, text: &str, first: bool) {
        let command: Command = serde_json::from_str(text).unwrap_or_default();
        let mut state = self.state();
        let State { hands, record, .. } = &mut *state;
        record.frames += 1;
        for (i, (kind, id)) in self.options.arms.iter().enumerate() {
            let own = command.orders(*kind).iter().filter(|order| order.device_id == *id);
            let sets = own.filter_map(|order| order.commands.set_cursor_force);
            let force = sets.filter_map(|set| self.hear(set, record)).sum::<DVec3>();
            let force = if self.options.faults.deaf || !force.is_finite() { DVec3::ZERO } else { force };
            let force = force.clamp_length_max(STRONGEST);
            record.forces[i] = force;
            record.peak = record.peak.max(force.length());
            hands[i].advance(&self.options.path, force);
        }
        if first {
            record.first_forces.push(record.forces.clone());
        }
        // a session may be there without a profile
        if let Some(profile) = command.session.map(|session| session.configure.profile).filter(|p| !p.name.is_empty()) {
            record.profile = Some(profile.name);
            record.required_version = profile.required_version;
        }
    }

    /// Force in the format that this version accepts.
    fn hear(&self, set: SetForce, record: &mut Record) -> Option<DVec3> {
        let vector = set.vector.filter(|_| self.version >= Version::VECTOR);
        let word = if vector.is_some() { "vector" } else { "values" };
        let force = vector.or(set.values)?;
        record.wording = Some(word);
        Some(force.into())
    }

    /// State frame after `frames` frames of the client; faults apply to all but the inventory.
    fn frame(&self, inventory: bool, frames: u64) -> String {
        let faults = self.options.faults;
        let due = |every: u64| !inventory && every > 0 && frames.is_multiple_of(every);
        let mut frame = if due(faults.empty_every) { Frame::default() } else { self.devices(inventory) };
        if due(faults.null_every) {
            // a NaN is written as null
            for arm in frame.inverse3.iter_mut().chain(&mut frame.inverse3x).chain(&mut frame.minverse) {
                if let Some(position) = arm.state.as_mut().and_then(|state| state.cursor_position.as_mut()) {
                    position.y = f64::NAN;
                }
            }
        }
        let text = whole::text(&frame, inventory);
        if due(faults.malformed_every) { text[..text.len() / 2].into() } else { text }
    }

    fn devices(&self, inventory: bool) -> Frame {
        let state = self.state();
        let mut frame = Frame { session_id: inventory.then_some(state.record.connections), ..Frame::default() };
        let config =
            |word: &str| inventory.then(|| Config { kind: Some(word.into()), handedness: Some("right".into()) });
        for (((kind, id), hand), force) in self.options.arms.iter().zip(&state.hands).zip(&state.record.forces) {
            let arm = ArmState {
                cursor_position: Some(hand.encoded().into()),
                cursor_velocity: hand.velocity.into(),
                current_cursor_force: Some((*force).into()),
                transform: Default::default(),
            };
            let status = Status { calibrated: Some(!self.options.faults.uncalibrated), ready: Some(true) };
            let entry = Entry { device_id: id.clone(), config: config(kind.word()), state: Some(arm), status };
            frame.arms_mut(*kind).push(entry);
        }
        let hand = state.hands.first().copied().unwrap_or_else(|| Hand::at_start(&self.options.path));
        let pressed = self.options.buttons.partition_point(|(from, _)| *from <= hand.time());
        let bits = pressed.checked_sub(1).map_or(0, |k| self.options.buttons[k].1);
        for (kind, id) in &self.options.grips {
            let grip = GripState { orientation: hand.rotation.into(), buttons: Buttons::of(bits) };
            let status = Status { calibrated: None, ready: Some(true) };
            let entry = Entry { device_id: id.clone(), config: config(kind.word()), state: Some(grip), status };
            frame.grips_mut(*kind).push(entry);
        }
        frame
    }
}

/// Event at a stand-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A client connected from this address.
    Connected(SocketAddr),
    /// It disconnected after this many frames.
    Left(SocketAddr, u64),
}

/// Configuration of a stand-in.
#[derive(Clone, Debug)]
pub struct Options {
    /// Port; 0 for any free one.
    pub port: u16,
    /// Version stated by `/version`; before 3.5 only the key `values` sets a force.
    pub version: String,
    /// Arms by kind and name.
    pub arms: Vec<(ArmKind, String)>,
    /// Grips by kind and name; all are held by the first arm's hand, or at rest without an arm.
    pub grips: Vec<(GripKind, String)>,
    /// Path of the hands, m; at rest without one.
    pub path: Vec<Pose>,
    /// Times of the hand, s, in ascending order, with the buttons pressed from then on.
    pub buttons: Vec<(f64, u32)>,
    /// Hands stay where the last client has left them; without it they begin anew with the first client of each run.
    pub keep: bool,
    /// Faults; none by default.
    pub faults: Faults,
    /// Called for each event.
    pub tell: Option<fn(Event)>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: PORT,
            version: "3.5.0".into(),
            arms: vec![(ArmKind::Inverse3, "MOCK".into())],
            grips: vec![(GripKind::Wired, "GRIP".into())],
            path: Vec::new(),
            buttons: Vec::new(),
            keep: false,
            faults: Faults::default(),
            tell: None,
        }
    }
}

/// Faults to simulate; 0 and `false` for none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    /// Connections end without a closing handshake after this many frames.
    pub drop_after: u64,
    /// Each n-th frame is cut in half.
    pub malformed_every: u64,
    /// Each n-th frame has `null` in a position, since JSON has no NaN.
    pub null_every: u64,
    /// Each n-th frame has no devices.
    pub empty_every: u64,
    /// Arms report that they are not calibrated.
    pub uncalibrated: bool,
    /// Delay before each answer.
    pub delay: Duration,
    /// Each 10th frame is preceded by this many old ones.
    pub burst: u32,
    /// Forces are ignored.
    pub deaf: bool,
    /// No inventory is sent.
    pub silent: bool,
}

/// Record of a stand-in.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// WebSocket connections.
    pub connections: u64,
    /// Connections that ended.
    pub ended: u64,
    /// Frames of clients.
    pub frames: u64,
    /// `[arm]` current force, N.
    pub forces: Vec<DVec3>,
    /// `[arm]` force of each connection's first frame, N.
    pub first_forces: Vec<Vec<DVec3>>,
    /// `[arm]` force of each ended connection's last frame, N.
    pub last_forces: Vec<Vec<DVec3>>,
    /// Number of forces released because no frame arrived.
    pub idled: u64,
    /// Largest force so far, N.
    pub peak: f64,
    /// Profile name of the last client.
    pub profile: Option<String>,
    /// Version that it required.
    pub required_version: Option<String>,
    /// Key of the last force.
    pub wording: Option<&'static str>,
}

/// Time per frame of the client, s.
const TICK: f64 = 1e-3;
/// Substeps of a tick.
const INNER: u32 = 10;
/// Mass of a hand that holds a stylus, of the order of a finger and the device's own, kg.
const MASS: f64 = 0.1;
/// Stiffness, N/m; of the order of a relaxed grip.
const STIFFNESS: f64 = 200.0;
/// Damping, N·s/m; 0.9 of critical.
const DAMPING: f64 = 8.0;
/// Resolution of the encoders, m.
const QUANTUM: f64 = 1e-5;

/// Rest position of an Inverse3's cursor without a path: in front of the device, above the table, m.
const REST: DVec3 = DVec3::new(0.0, -0.12, 0.15);

/// Simulated hand.
#[derive(Clone, Copy, Debug)]
struct Hand {
    pub position: DVec3,
    pub velocity: DVec3,
    pub rotation: DQuat,
    ticks: u64,
}

/// Target pose of the path at a time.
fn target(path: &[Pose], time: f64) -> (DVec3, DQuat) {
    along(path, time).unwrap_or((REST, DQuat::IDENTITY))
}

impl Hand {
    /// At rest at the start of the path.
    pub fn at_start(path: &[Pose]) -> Self {
        let (position, rotation) = target(path, 0.0);
        Self { position, velocity: DVec3::ZERO, rotation, ticks: 0 }
    }

    /// Time of the hand, s.
    pub fn time(&self) -> f64 {
        self.ticks as f64 * TICK
    }

    /// Advances by one tick with a constant force.
    pub fn advance(&mut self, path: &[Pose], force: DVec3) {
        let (from, h) = (self.time(), TICK / f64::from(INNER));
        for k in 1..=INNER {
            let (aim, rotation) = target(path, from + f64::from(k) * h);
            let push = force + (aim - self.position) * STIFFNESS - self.velocity * DAMPING;
            self.velocity += push * (h / MASS);
            self.position += self.velocity * h;
            self.rotation = rotation;
        }
        self.ticks += 1;
    }

    /// Position rounded to the encoders' resolution, m.
    pub fn encoded(&self) -> DVec3 {
        (self.position / QUANTUM).round() * QUANTUM
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_force_moves_the_hand_by_its_spring() {
        let mut hand = Hand::at_start(&[]);
        for _ in 0..2000 {
            hand.advance(&[], DVec3::new(0.0, 0.0, 1.0));
        }
        assert!((hand.position - REST - DVec3::Z / STIFFNESS).length() < 1e-9, "{hand:?}");
        assert!((hand.encoded() - hand.position).abs().max_element() <= QUANTUM / 2.0);
    }

    #[test]
    fn the_hand_follows_its_path_and_rests_at_its_end() {
        let pose = |time, x| Pose { time, position: [x, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0] };
        let path = [pose(0.0, 0.0), pose(1.0, 0.1)];
        let mut hand = Hand::at_start(&path);
        for _ in 0..800 {
            hand.advance(&path, DVec3::ZERO);
        }
        // a moving target is followed at a distance of d v / k
        assert!((hand.position.x - (0.08 - DAMPING * 0.1 / STIFFNESS)).abs() < 1e-4, "{hand:?}");
        for _ in 0..2000 {
            hand.advance(&path, DVec3::ZERO);
        }
        assert!((hand.position.x - 0.1).abs() < 1e-9, "{hand:?}");
    }
}
