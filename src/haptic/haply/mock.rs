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

mod hand;
mod options;
mod whole;

pub use options::{Event, Faults, Options, Record};

use super::command::{Command, SetForce, Version};
use super::refused::Refused;
use super::wire::{ArmState, Buttons, Config, Entry, Frame, GripState, Status};
use crate::error::Result;
use crate::http::{self, Door, PATIENCE};
use glam::DVec3;
use hand::Hand;
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
const MOST_GUESTS: usize = 32;
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
        let door = Door::open("haply-mock", listener, MOST_GUESTS, &shared.stop, receive).map_err(refused)?;
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
