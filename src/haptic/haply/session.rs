//! A connection to the Inverse Service: address, handshake, version, inventory, and readings of the selected devices; and what may be wrong
//! with it.

use super::command::{About, Version};
use super::wire::{ArmKind, Entry, Frame, GripKind, frame};
use super::{PATIENCE, Settings};
use crate::haptic::device::Reading;
use glam::DVec3;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tungstenite::client::client_with_config;
use tungstenite::http::Uri;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{HandshakeError, Message, WebSocket};

/// A WebSocket of the service.
pub(super) type Socket = WebSocket<TcpStream>;

/// Timeout of a read, so that the I/O thread regularly checks for a stop or a silent loop.
const SLICE: Duration = Duration::from_millis(5);

/// Timeout of a write: such a peer is gone, since a frame is a few hundred bytes, far below a socket's buffer.
const WRITE_PATIENCE: Duration = Duration::from_millis(100);

/// Largest frame, bytes: an inventory of a hundred devices. A larger one is a fault and must not exhaust the memory.
const LARGEST: usize = 1 << 20;

/// Address of the service.
#[derive(Clone, Debug)]
pub(super) struct Address {
    pub url: String,
    host: String,
    port: u16,
}

impl Address {
    /// Parses `ws://host:port`.
    pub fn of(url: &str) -> Result<Self> {
        let wrong = |problem: &str| Refused::Address { url: url.into(), problem: problem.into() };
        let uri: Uri = url.parse().map_err(|e| wrong(&format!("{e}")))?;
        if uri.scheme_str() != Some("ws") {
            return Err(wrong("it does not begin with ws://"));
        }
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(|| wrong("it has no host"))?;
        let port = uri.port_u16().ok_or_else(|| wrong("it has no port"))?;
        Ok(Self { url: url.into(), host: host.trim_matches(['[', ']']).into(), port })
    }

    fn dial(&self, patience: Duration) -> io::Result<TcpStream> {
        let mut last = io::Error::new(ErrorKind::NotFound, "the host has no address");
        for address in (self.host.as_str(), self.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, patience) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_read_timeout(Some(patience))?;
                    stream.set_write_timeout(Some(WRITE_PATIENCE))?;
                    return Ok(stream);
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    fn no_service(&self, found: String) -> Refused {
        Refused::NoService { url: self.url.clone(), found }
    }

    /// Connects and completes the WebSocket handshake.
    pub fn connect(&self, patience: Duration) -> Result<Socket> {
        let nobody = |e: io::Error| Refused::Nobody { url: self.url.clone(), reason: reason(&e, patience) };
        let stream = self.dial(patience).map_err(nobody)?;
        let config = WebSocketConfig::default().max_message_size(Some(LARGEST)).max_frame_size(Some(LARGEST));
        let (socket, _) = client_with_config(self.url.as_str(), stream, Some(config)).map_err(|e| match e {
            HandshakeError::Interrupted(_) => {
                self.no_service(format!("no answer to the WebSocket handshake within {} s", patience.as_secs_f64()))
            }
            HandshakeError::Failure(e) => self.no_service(format!("its answer to the WebSocket handshake: {e}")),
        })?;
        socket.get_ref().set_read_timeout(Some(SLICE)).map_err(nobody)?;
        Ok(socket)
    }

    /// Receives the first frame.
    pub fn inventory(&self, socket: &mut Socket, patience: Duration) -> Result<Frame> {
        let until = Instant::now() + patience;
        while Instant::now() < until {
            match hear(socket) {
                Heard::Text(text) => {
                    return frame(&text).map_err(|e| self.no_service(format!("its first frame is no inventory: {e}")));
                }
                Heard::Nothing => {}
                Heard::End(why) => return Err(self.no_service(format!("it ended the connection: {why}"))),
            }
        }
        Err(self.no_service(format!("no inventory came within {} s", patience.as_secs_f64())))
    }

    /// Asks for the service's version; an error if it is too old or not stated.
    pub fn version(&self) -> Result<Version> {
        let said = self.ask_version();
        let found = said.as_deref().ok().and_then(Version::of);
        match found.filter(|version| *version >= Version::OLDEST) {
            Some(version) => Ok(version),
            None => Err(Refused::Version {
                url: self.url.clone(),
                found: said.unwrap_or_else(|reason| format!("nothing ({reason})")),
                wanted: Version::OLDEST.to_string(),
            }),
        }
    }

    /// `GET /version` on the channel's port; `Err` with the reason.
    fn ask_version(&self) -> std::result::Result<String, String> {
        let reason = |e: io::Error| format!("GET /version: {}", reason(&e, PATIENCE));
        let mut stream = self.dial(PATIENCE).map_err(reason)?;
        let request = format!(
            "GET /version HTTP/1.1\r\nHost: {}:{}\r\nAccept: application/json\r\nConnection: close\r\n\r\n",
            self.host, self.port
        );
        stream.write_all(request.as_bytes()).map_err(reason)?;
        let (mut answer, mut piece) = (Vec::new(), [0; 4096]);
        let until = Instant::now() + PATIENCE;
        loop {
            let read = stream.read(&mut piece).map_err(reason)?;
            answer.extend_from_slice(&piece[..read]);
            if let Some(said) = version_of(&answer) {
                return Ok(said);
            }
            if read == 0 || answer.len() > LARGEST || Instant::now() > until {
                let line: String =
                    String::from_utf8_lossy(&answer).lines().next().unwrap_or("").chars().take(60).collect();
                return Err(format!("GET /version was answered by `{line}`"));
            }
        }
    }
}

/// Reason of a failed attempt; the system has only a number for a time that has run out.
fn reason(error: &io::Error, patience: Duration) -> String {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => format!("no answer within {} s", patience.as_secs_f64()),
        _ => error.to_string(),
    }
}

/// Version in an HTTP answer, once its JSON is complete.
fn version_of(answer: &[u8]) -> Option<String> {
    let text = std::str::from_utf8(answer).ok()?;
    let (head, body) = text.split_once("\r\n\r\n")?;
    let ok = head.split_whitespace().nth(1) == Some("200");
    let json = ok.then(|| body.find('{')).flatten()?;
    let about = serde_json::Deserializer::from_str(&body[json..]).into_iter::<About>().next()?.ok()?;
    about.said().map(String::from)
}

/// Result of one read of the socket.
pub(super) enum Heard {
    Text(tungstenite::Utf8Bytes),
    Nothing,
    End(String),
}

/// Waits for a frame until the timeout; answers pings.
pub(super) fn hear(socket: &mut Socket) -> Heard {
    match socket.read() {
        Ok(Message::Text(text)) => Heard::Text(text),
        // not part of the protocol: an empty text counts as malformed
        Ok(Message::Binary(_)) => Heard::Text("".into()),
        Ok(_) => Heard::Nothing,
        Err(tungstenite::Error::Io(e)) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            Heard::Nothing
        }
        Err(error) => Heard::End(error.to_string()),
    }
}

/// Devices that a client uses.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    pub arm: ArmKind,
    pub device: String,
    pub grip: Option<(GripKind, String)>,
}

impl Chosen {
    /// Selects the named devices, or the first ones.
    pub fn of(inventory: &Frame, settings: &Settings) -> Result<Self> {
        let url = || settings.url.clone();
        let arms = ArmKind::ALL.iter().flat_map(|k| inventory.arms(*k).iter().map(|e| (*k, e.device_id.clone())));
        let arms: Vec<(ArmKind, String)> = arms.collect();
        let grips = GripKind::ALL.iter().flat_map(|k| inventory.grips(*k).iter().map(|e| (*k, e.device_id.clone())));
        let grips: Vec<(GripKind, String)> = grips.collect();
        let named: Vec<String> = (arms.iter().map(|(kind, id)| format!("{} {id}", kind.word())))
            .chain(grips.iter().map(|(kind, id)| format!("{} {id}", kind.word())))
            .collect();
        let there = if named.is_empty() { "no device at all".into() } else { named.join(", ") };
        if arms.is_empty() {
            return Err(Refused::NoArm { url: url(), there });
        }
        let unknown = |what, id: &String| Refused::Unknown { url: url(), what, id: id.clone(), there: there.clone() };
        let (arm, device) = match &settings.device {
            Some(id) => arms.into_iter().find(|(_, found)| found == id).ok_or_else(|| unknown("arm", id))?,
            None => arms.into_iter().next().expect("the list was found not to be empty above"),
        };
        let grip = match &settings.grip {
            Some(id) => Some(grips.into_iter().find(|(_, found)| found == id).ok_or_else(|| unknown("grip", id))?),
            None => grips.into_iter().next(),
        };
        Ok(Self { arm, device, grip })
    }
}

/// Reason why a frame has no pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Absent,
    Uncalibrated,
    NonFinite,
}

fn entry<'a, S>(entries: &'a [Entry<S>], device: &str) -> Option<&'a Entry<S>> {
    entries.iter().find(|entry| entry.device_id == device)
}

/// Reading of the selected devices, and whether the frame has the grip (`true` without a grip). A missing grip keeps `last`'s rotation and
/// releases all buttons.
pub(super) fn reading(frame: &Frame, chosen: &Chosen, last: Reading) -> std::result::Result<(Reading, bool), Fault> {
    let arm = entry(frame.arms(chosen.arm), &chosen.device).ok_or(Fault::Absent)?;
    let state = arm.state.ok_or(Fault::Absent)?;
    if arm.status.calibrated == Some(false) {
        return Err(Fault::Uncalibrated);
    }
    let (mut rotation, mut buttons, mut whole) = (last.rotation, 0, true);
    if let Some((kind, id)) = &chosen.grip {
        let grip = entry(frame.grips(*kind), id).and_then(|entry| entry.state);
        whole = grip.is_some();
        if let Some(grip) = grip {
            rotation = grip.orientation.rotation().ok_or(Fault::NonFinite)?;
            buttons = grip.buttons.bits();
        }
    }
    let position = state.cursor_position.ok_or(Fault::Absent)?.into();
    let velocity = state.cursor_velocity.into();
    let reading = Reading { position, rotation, velocity, angular_velocity: DVec3::ZERO, buttons, age: 0.0 };
    if reading.is_valid() { Ok((reading, whole)) } else { Err(Fault::NonFinite) }
}

/// Result of opening such a device.
type Result<T> = std::result::Result<T, Refused>;

/// Errors of opening a device of Haply's Inverse Service.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Invalid force limit.
    #[error("a force limit of {limit} N for {url}; wanted a number from 0 up, in N; 2 is a careful one")]
    ForceLimit {
        /// The address.
        url: String,
        /// Requested limit, N.
        limit: f64,
    },

    /// Invalid address.
    #[error(
        "{url}: no address of an Inverse Service ({problem}); write ws://host:port, for example ws://localhost:10001"
    )]
    Address {
        /// The text given.
        url: String,
        /// What is wrong with it.
        problem: String,
    },

    /// Nothing listens at the address.
    #[error(
        "{url}: nothing listens there ({reason}); start Haply's Inverse Service, or `cutis haply-mock` as a stand-in, or change the address"
    )]
    Nobody {
        /// The address.
        url: String,
        /// Reason given by the system.
        reason: String,
    },

    /// The listener at the address is no Inverse Service.
    #[error(
        "{url}: what listens there is no Inverse Service ({found}); wanted a WebSocket that sends its inventory; look at the port: the service's simulation channel is 10001 unless its settings say otherwise"
    )]
    NoService {
        /// The address.
        url: String,
        /// What it did instead.
        found: String,
    },

    /// Inverse Service of an unsupported or unknown version.
    #[error(
        "{url}: the Inverse Service says version {found}; wanted {wanted} or newer; update the service, or state its version if it does not tell"
    )]
    Version {
        /// The address.
        url: String,
        /// The version stated, or why there is none.
        found: String,
        /// Oldest supported version.
        wanted: String,
    },

    /// Inverse Service without an arm.
    #[error(
        "{url}: the Inverse Service has no Inverse3; devices present: {there}; plug one in, switch it on and calibrate it"
    )]
    NoArm {
        /// The address.
        url: String,
        /// Devices that are present.
        there: String,
    },

    /// Device that the Inverse Service does not have.
    #[error(
        "{url}: the Inverse Service has no {what} \"{id}\"; devices present: {there}; plug it in, or name one of these"
    )]
    Unknown {
        /// The address.
        url: String,
        /// "arm" or "grip".
        what: &'static str,
        /// The name requested.
        id: String,
        /// Devices that are present.
        there: String,
    },

    /// Invalid version of the stand-in.
    #[error("a stand-in of version \"{version}\"; wanted numbers with dots, such as 3.5.0")]
    StandInVersion {
        /// The text given.
        version: String,
    },

    /// Port that the stand-in cannot listen on.
    #[error(
        "{address}: cannot listen there ({source}); end what listens there (the Inverse Service itself, or another stand-in), or choose another port: --port 0 takes a free one"
    )]
    Port {
        /// The address.
        address: String,
        /// Reason given by the system.
        source: std::io::Error,
    },
}

#[cfg(test)]
mod tests {
    use super::super::wire::tests::INVENTORY;
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;
    use serde_json::Value;

    fn chosen() -> Chosen {
        let inventory = frame(INVENTORY).expect("a frame");
        Chosen::of(&inventory, &Settings::default()).expect("it has an arm")
    }

    fn said(text: &str) -> std::result::Result<(Reading, bool), Fault> {
        let turned = Reading { rotation: DQuat::from_rotation_x(1.0), buttons: 7, ..Reading::at_rest(0.0) };
        reading(&frame(text).expect("a frame"), &chosen(), turned)
    }

    #[test]
    fn an_arm_without_a_position_does_not_spoil_the_others() {
        let position = r#""cursor_position": {"x":0,"y":-0.12,"z":0.15}, "#;
        assert_eq!(said(&INVENTORY.replace(position, "")).err(), Some(Fault::Absent));
        // beside one that has one
        let (head, arm) = INVENTORY.split_once("\"inverse3\": [ ").expect("it has arms");
        let (arm, rest) = arm.split_once(" ],\n      \"wireless").expect("grips follow");
        let other = arm.replace("049D", "AAAA").replace(position, "");
        let both = format!("{head}\"inverse3\": [ {other}, {arm} ],\n      \"wireless{rest}");
        assert_eq!(said(&both).expect("the other one").0.position, DVec3::new(0.0, -0.12, 0.15));
    }

    #[test]
    fn a_frame_says_position_velocity_rotation_and_buttons() {
        let text = INVENTORY
            .replace(r#""cursor_velocity": {"x":0"#, r#""cursor_velocity": {"x":0.25"#)
            .replace(r#""orientation": {"x":0,"y":0,"z":0,"w":1}"#, r#""orientation": {"x":0,"y":0,"z":1,"w":0}"#)
            .replace(r#""b":false"#, r#""b":true"#);
        let (reading, whole) = said(&text).expect("a pose");
        assert_eq!(reading.position, DVec3::new(0.0, -0.12, 0.15));
        assert_eq!(reading.velocity, DVec3::new(0.25, 0.0, 0.0));
        assert_eq!(reading.rotation, DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0));
        assert_eq!((reading.buttons, reading.age, whole), (2, 0.0, true));
    }

    #[test]
    fn without_its_grip_the_last_rotation_is_kept_and_no_button_is_down() {
        let (reading, whole) = said(&INVENTORY.replace("1402", "1403")).expect("a pose");
        assert_eq!((reading.rotation, reading.buttons, whole), (DQuat::from_rotation_x(1.0), 0, false));
    }

    #[test]
    fn what_is_no_pose_is_told_apart() {
        let fault = |from, to| said(&INVENTORY.replacen(from, to, 1)).expect_err("no pose");
        assert_eq!(fault("049D", "049E"), Fault::Absent);
        assert_eq!(fault("\"calibrated\": true", "\"calibrated\": false"), Fault::Uncalibrated);
        assert_eq!(fault("-0.12", "null"), Fault::NonFinite);
        assert_eq!(fault("\"orientation\": {\"x\":0", "\"orientation\": {\"x\":3"), Fault::NonFinite);
    }

    #[test]
    fn an_address_needs_a_scheme_a_host_and_a_port() {
        for good in ["ws://localhost:10001", "ws://[::1]:10001", "ws://10.0.0.7:1/path"] {
            assert!(Address::of(good).is_ok(), "{good}");
        }
        for bad in [
            "",
            "localhost:10001",
            "http://localhost:10001",
            "wss://localhost:10001",
            "ws://localhost",
            "ws://:1",
            "ws://a b:1",
        ] {
            let error = Address::of(bad).expect_err(bad).to_string();
            assert!(error.contains("write ws://host:port"), "{error}");
        }
    }

    #[test]
    fn a_version_is_read_once_it_is_whole() {
        let answer = "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n{\"project_version\": \"3.5.0.0\"}";
        assert_eq!(version_of(answer.as_bytes()).as_deref(), Some("3.5.0.0"));
        for end in 0..answer.len() {
            assert_eq!(version_of(&answer.as_bytes()[..end]), None, "{end}");
        }
        assert_eq!(version_of(answer.replace("200 OK", "404 Not Found").as_bytes()), None);
    }

    /// What any text gives: no pose, or a sound one.
    fn harmless(text: &str) -> bool {
        let pose = frame(text).ok().and_then(|frame| reading(&frame, &chosen(), Reading::at_rest(0.0)).ok());
        assert!(pose.is_none_or(|(reading, _)| reading.is_valid()), "{text}");
        pose.is_some()
    }

    /// JSON of the words that frames have, in any order and depth.
    fn tree() -> impl Strategy<Value = Value> {
        let number = prop_oneof![any::<f64>(), Just(0.0), Just(1.0)];
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            number.prop_map(Value::from),
            prop_oneof![Just("049D".to_string()), ".*"].prop_map(Value::from),
        ];
        const WORDS: [&str; 12] = [
            "inverse3",
            "device_id",
            "state",
            "status",
            "cursor_position",
            "cursor_velocity",
            "x",
            "y",
            "z",
            "w",
            "verse_grip",
            "orientation",
        ];
        let word = prop::sample::select(&WORDS[..]);
        leaf.prop_recursive(6, 64, 6, move |inner| {
            let table = prop::collection::vec((word.clone(), inner.clone()), 0..6);
            let table = table.prop_map(|rows| rows.into_iter().map(|(k, v)| (k.to_string(), v)).collect::<Value>());
            prop_oneof![prop::collection::vec(inner, 0..4).prop_map(Value::from), table]
        })
    }

    /// Pointers to all values of a tree.
    fn pointers(value: &Value, at: &str, into: &mut Vec<String>) {
        into.push(at.to_string());
        match value {
            Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| pointers(v, &format!("{at}/{i}"), into)),
            Value::Object(table) => table.iter().for_each(|(k, v)| pointers(v, &format!("{at}/{k}"), into)),
            _ => {}
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn random_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            harmless(&String::from_utf8_lossy(&bytes));
        }

        #[test]
        fn random_trees_do_no_harm(tree in tree()) {
            harmless(&tree.to_string());
        }

        #[test]
        fn a_frame_with_one_part_exchanged_does_no_harm(which in any::<prop::sample::Index>(), part in tree()) {
            let mut whole: Value = serde_json::from_str(INVENTORY).expect("JSON");
            let mut all = Vec::new();
            pointers(&whole, "", &mut all);
            *whole.pointer_mut(which.get::<String>(&all).as_str()).expect("one of its pointers") = part;
            harmless(&whole.to_string());
        }
    }

    #[test]
    fn the_frame_that_parts_are_exchanged_in_has_a_pose() {
        assert!(harmless(INVENTORY));
        assert!(!harmless(&INVENTORY.replace("-0.12", "null")));
    }
}
