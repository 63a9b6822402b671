//! A device that is lost after its first state and stays lost: each kind is a warning of the run, and fails a scene with a check.

use super::work::{PRESS, Work};
use super::{Outcome, Test};
use crate::ensure;
use cutis::haptic::haply::mock::{Mock, Options};
use cutis::scene::Pose;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use tungstenite::{Message, WebSocket};

/// Tests of this file.
pub const TESTS: &[Test] = &[
    ("every_kind_of_a_lost_device_is_a_warning_and_fails_a_check", every_kind_of_a_lost_device),
    ("a_lost_device_is_no_error_of_a_scene_without_checks", a_lost_device_without_checks),
    ("a_relayed_device_that_is_not_lost_is_no_warning", a_relayed_device),
];

/// What a service does after the first state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loss {
    /// Nothing: it goes on.
    None,
    /// Ends the connection by a closing handshake, and accepts no other.
    Closes,
    /// Drops the connection with bytes unread, which resets it, and each further one.
    Resets,
    /// Keeps the connection and says nothing.
    Silent,
    /// Text that is no JSON.
    Garbage,
    /// Binary messages.
    Binary,
    /// Bytes that are no frame of a WebSocket.
    Bytes,
    /// The first half of each state.
    Truncated,
    /// Another device in its place.
    OtherDevice,
    /// `null` in a position, as JSON has no NaN.
    NotANumber,
    /// A position of 1e300 m.
    Absurd,
    /// No `cursor_position`.
    NoPosition,
    /// An arm that says that it is not calibrated.
    Uncalibrated,
}

const ALL: [Loss; 12] = [
    Loss::Closes,
    Loss::Resets,
    Loss::Silent,
    Loss::Garbage,
    Loss::Binary,
    Loss::Bytes,
    Loss::Truncated,
    Loss::OtherDevice,
    Loss::NotANumber,
    Loss::Absurd,
    Loss::NoPosition,
    Loss::Uncalibrated,
];

/// States before the loss.
const SOUND: u64 = 1;
/// Longest wait of a socket.
const PATIENCE: Duration = Duration::from_millis(100);

/// Stands between a client and a stand-in: passes frames on, and does to them what is lost.
struct Relay {
    url: String,
    stop: Arc<AtomicBool>,
    door: Option<JoinHandle<()>>,
}

impl Relay {
    fn start(mock: &Mock, loss: Loss) -> Result<Self, String> {
        let listener = TcpListener::bind("127.0.0.1:0").map_err(|e| e.to_string())?;
        let url = format!("ws://{}", listener.local_addr().map_err(|e| e.to_string())?);
        let (stop, service) = (Arc::new(AtomicBool::new(false)), mock.url());
        let inside = stop.clone();
        let door = thread::spawn(move || {
            let states = Arc::new(AtomicU64::new(0));
            for stream in listener.incoming().flatten() {
                if inside.load(Ordering::Acquire) {
                    return;
                }
                let (states, stop, service) = (states.clone(), inside.clone(), service.clone());
                // ended by the flag, or by either side
                thread::spawn(move || serve(stream, &service, loss, &states, &stop));
            }
        });
        Ok(Self { url, stop, door: Some(door) })
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        TcpStream::connect(self.url.trim_start_matches("ws://")).ok();
        if let Some(door) = self.door.take() {
            door.join().ok();
        }
    }
}

/// Serves one connection; `None` when it is over.
fn serve(mut stream: TcpStream, service: &str, loss: Loss, states: &AtomicU64, stop: &AtomicBool) -> Option<()> {
    let gone = || states.load(Ordering::Acquire) >= SOUND && loss != Loss::None;
    let mut head = [0; 4];
    stream.set_read_timeout(Some(Duration::from_secs(2))).ok()?;
    stream.set_nodelay(true).ok()?;
    stream.peek(&mut head).ok()?;
    if gone() && matches!(loss, Loss::Closes | Loss::Resets) {
        return None;
    }
    let mut request = [0; 1024];
    let read = stream.peek(&mut request).ok()?;
    if request[..read].starts_with(b"GET /version") {
        let read = stream.read(&mut request).ok()?;
        assert!(read > 0);
        let body = "{\"project_version\": \"3.5.0\"}";
        return write!(stream, "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}", body.len()).ok();
    }
    let mut client = tungstenite::accept(stream).ok()?;
    let (mut behind, _) = tungstenite::connect(service).ok()?;
    let inventory = text(&mut behind)?;
    // after a loss the inventory of a further connection is lost with the rest
    pass(&mut client, &inventory, if gone() { loss } else { Loss::None })?;
    client.get_ref().set_read_timeout(Some(PATIENCE)).ok()?;
    while !stop.load(Ordering::Acquire) {
        match client.read() {
            Ok(Message::Text(order)) => {
                behind.send(Message::Text(order)).ok()?;
                let state = text(&mut behind)?;
                pass(&mut client, &state, if gone() { loss } else { Loss::None })?;
                states.fetch_add(1, Ordering::AcqRel);
            }
            Ok(_) => {}
            Err(tungstenite::Error::Io(e)) if e.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => return None,
        }
    }
    None
}

/// Next text of the stand-in.
fn text<S: Read + Write>(socket: &mut WebSocket<S>) -> Option<String> {
    loop {
        if let Message::Text(text) = socket.read().ok()? {
            return Some(text.to_string());
        }
    }
}

/// Passes a frame on as the loss has it; `None` ends the connection.
fn pass(client: &mut WebSocket<TcpStream>, frame: &str, loss: Loss) -> Option<()> {
    let mut tree: Value = serde_json::from_str(frame).ok()?;
    let arm = &mut tree["inverse3"][0];
    match loss {
        Loss::None => {}
        Loss::Closes => {
            client.close(None).ok()?;
            client.flush().ok();
            return None;
        }
        Loss::Resets => return None,
        Loss::Silent => return Some(()),
        Loss::Garbage => return client.send(Message::text("~ no state at all ~")).ok(),
        Loss::Binary => return client.send(Message::binary(vec![0xff; 300])).ok(),
        Loss::Bytes => return client.get_mut().write_all(&[0xff; 300]).ok(),
        Loss::Truncated => return client.send(Message::text(&frame[..frame.len() / 2])).ok(),
        Loss::OtherDevice => arm["device_id"] = "ANOTHER".into(),
        Loss::NotANumber => arm["state"]["cursor_position"]["y"] = Value::Null,
        Loss::Absurd => arm["state"]["cursor_position"]["y"] = 1e300.into(),
        Loss::NoPosition => drop(arm["state"].as_object_mut()?.remove("cursor_position")?),
        Loss::Uncalibrated => arm["status"]["calibrated"] = false.into(),
    }
    client.send(Message::text(tree.to_string())).ok()
}

/// A run of half a second by the wall clock: its exit status, what it said, and its report.
fn run(loss: Loss, check: &str) -> Result<(i32, String, Value), String> {
    let pose = |time, z| Pose { time, position: [0.3e-3, 0.2e-3, z], rotation: [0.0, 0.0, 0.0, 1.0] };
    let path = vec![pose(0.0, 2.2e-3), pose(0.1, 1.9e-3), pose(10.0, 0.5e-3)];
    let mock = Mock::start(Options { port: 0, path, ..Options::default() }).map_err(|e| e.to_string())?;
    let relay = Relay::start(&mock, loss)?;
    let points = "points_mm = [[0.0, 0.0, 0.0]]";
    let device = format!("device = {{ kind = \"haply\", url = \"{}\" }}", relay.url);
    let scene = PRESS.replace(points, &format!("{points}\n{device}")).replace("= 0.025", "= 0.5");
    let work = Work::with(&(scene + check))?;
    let said = work.cutis(&["run", "scene.toml", "--backend", "cpu", "--realtime", "--frames", "0"])?;
    let report = work.read("out/report.json").map_err(|e| format!("{loss:?}: {e}: {}", said.err))?;
    Ok((said.code, said.err, serde_json::from_str(&report).map_err(|e| e.to_string())?))
}

const CHECK: &str = "\n[check]\n\"steps\" = { min = 100 }\n";

fn every_kind_of_a_lost_device() -> Outcome {
    for loss in ALL {
        let (code, said, report) = run(loss, CHECK)?;
        let lost = report["warnings"]["device_lost"].as_u64();
        println!("{loss:?}: {lost:?} of 500 ticks lost, {} faults", report["haptic"]["device_faults"]);
        ensure!(code == 1 && report["steps"] == 100, "{loss:?}: exit status {code}: {said}");
        ensure!(lost.is_some_and(|lost| lost > 200), "{loss:?}: {lost:?} of 500 ticks");
        ensure!(said.contains(&format!("warning: device_lost × {}", lost.unwrap_or(0))), "{loss:?}: {said}");
        ensure!(said.contains("check failed: warnings.device_lost = "), "{loss:?}: {said}");
        // nothing of it has entered the state
        let worst = report["haptic"]["force_n_max"].as_f64();
        ensure!(worst.is_some_and(|force| force < 10.0), "{loss:?}: {worst:?} N");
    }
    Ok(())
}

fn a_lost_device_without_checks() -> Outcome {
    let (code, said, report) = run(Loss::Silent, "")?;
    ensure!(code == 0 && said.contains("warning: device_lost"), "exit status {code}: {said}");
    ensure!(report["warnings"]["device_lost"].as_u64() > Some(200), "{report}");
    Ok(())
}

/// The counter-test: the relay alone loses nothing.
fn a_relayed_device() -> Outcome {
    let (code, said, report) = run(Loss::None, CHECK)?;
    ensure!(code == 0 && !said.contains("device_lost"), "exit status {code}: {said}");
    ensure!(report["warnings"].get("device_lost").is_none(), "{report}");
    Ok(())
}
