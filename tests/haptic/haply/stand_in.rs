//! What the stand-in takes from whom, and what it leaves.

use super::{client, mock, moving, ticks};
use cutis::haptic::device::{Device, Limits};
use cutis::haptic::haply::mock::{Faults, Mock, Options};
use cutis::haptic::haply::{Settings, open};
use glam::DVec3;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::Message;
use tungstenite::protocol::frame::Frame as WsFrame;
use tungstenite::protocol::frame::coding::{Data, OpCode};

/// What a stand-in answers to a request: the whole answer, or the head alone where it goes on with a WebSocket.
fn answered(mock: &Mock, request: &str) -> String {
    let mut stream = TcpStream::connect(mock.url().trim_start_matches("ws://")).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(5))).expect("a time");
    stream.write_all(request.as_bytes()).expect("it reads");
    let (mut said, mut piece) = (Vec::new(), [0; 512]);
    while let Ok(read @ 1..) = stream.read(&mut piece) {
        said.extend_from_slice(&piece[..read]);
        if said.starts_with(b"HTTP/1.1 101") && said.windows(4).any(|end| end == b"\r\n\r\n") {
            break;
        }
    }
    String::from_utf8_lossy(&said).into_owned()
}

const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

#[test]
fn a_stand_in_serves_its_own_machine_alone() {
    let mock = mock(Faults::default());
    let port = mock.url().rsplit(':').next().expect("a port").to_string();
    let ask = |headers: &str| answered(&mock, &format!("GET / HTTP/1.1\r\n{headers}{UPGRADE}\r\n"));
    for local in ["localhost", "127.0.0.1", "[::1]"] {
        let said = ask(&format!("Host: {local}:{port}\r\nOrigin: http://{local}:3000\r\n"));
        assert!(said.starts_with("HTTP/1.1 101"), "{local}: {said}");
    }
    for foreign in [
        format!("Host: localhost:{port}\r\nOrigin: https://evil.example\r\n"),
        format!("Host: localhost:{port}\r\nOrigin: null\r\n"),
        format!("Host: evil.example:{port}\r\n"),
        format!("Host: localhost.evil.example:{port}\r\n"),
    ] {
        let said = ask(&foreign);
        assert!(said.starts_with("HTTP/1.1 403") && said.contains("\"error\""), "{foreign}: {said}");
    }
    // of a page that asks for the version, too
    let version = answered(&mock, "GET /version HTTP/1.1\r\nHost: evil.example\r\n\r\n");
    assert!(version.starts_with("HTTP/1.1 403"), "{version}");
    // a handshake without its key
    let said = answered(&mock, &format!("GET / HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\n\r\n"));
    assert!(said.starts_with("HTTP/1.1 400") && said.contains("\"error\""), "{said}");
}

#[test]
fn a_stand_in_limits_connections_and_forces() {
    let mock = mock(Faults::default());
    let address = mock.url().trim_start_matches("ws://").to_string();
    let idle: Vec<TcpStream> = (0..32).map(|_| TcpStream::connect(&address).expect("it listens")).collect();
    let begin = Instant::now();
    let mut said = String::new();
    while !said.starts_with("HTTP/1.1 503") && begin.elapsed() < Duration::from_millis(800) {
        said = answered(&mock, "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n");
    }
    assert!(said.starts_with("HTTP/1.1 503") && said.contains("too many connections"), "{said}");
    drop(idle);
    while !said.starts_with("HTTP/1.1 200") && begin.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(Duration::from_millis(10));
        said = answered(&mock, "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n");
    }
    assert!(said.starts_with("HTTP/1.1 200"), "{said}");
    // an arm has no 50 N
    let settings = Settings { limits: Limits { force: 50.0, torque: 0.0 }, url: mock.url(), ..Settings::default() };
    let mut strong = open(&settings).expect("a client");
    ticks(&mut strong, DVec3::Z * 40.0, |_, _| mock.record().peak > 0.0);
    ticks(&mut strong, DVec3::Z * 40.0, |_, n| n == 50);
    assert!((mock.record().peak - 10.0).abs() < 1e-9, "{:?}", mock.record());
}

/// Waits for the end of a connection; what was said before, and how long it took.
fn ended(stream: &mut TcpStream) -> (String, Duration) {
    let begin = Instant::now();
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time");
    let mut said = Vec::new();
    // a reset ends a connection too
    if let Err(error) = stream.read_to_end(&mut said) {
        assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset, "it goes on: {error}");
    }
    (String::from_utf8_lossy(&said).into_owned(), begin.elapsed())
}

#[test]
fn a_handshake_without_an_end_is_ended_and_holds_nobody_up() {
    let mock = mock(Faults::default());
    let address = mock.url().trim_start_matches("ws://").to_string();
    let begun = |text: &str| {
        let mut stream = TcpStream::connect(&address).expect("it listens");
        stream.write_all(text.as_bytes()).expect("it reads");
        stream
    };
    let half = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{UPGRADE}");
    // nothing at all, half a request, and a request of which a byte comes now and then
    let mut slow: Vec<TcpStream> = (0..10).flat_map(|_| [begun(""), begun(&half)]).collect();
    let mut drips = begun(&half);
    let dripping = std::thread::spawn(move || {
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_secs(20) && drips.write_all(b"a").is_ok() {
            std::thread::sleep(Duration::from_millis(50));
        }
        (begin.elapsed(), drips)
    });
    // meanwhile others are served
    let begin = Instant::now();
    let mut other = client(&mock);
    ticks(&mut other, DVec3::Z, |_, n| n == 50);
    let served = begin.elapsed();
    assert!(mock.record().peak > 0.0, "{:?}", mock.record());
    let first = ended(&mut slow[0]);
    println!("another client had its 50 ticks after {served:?}; the first handshake was ended after {:?}", first.1);
    for stream in &mut slow[1..] {
        let (said, took) = ended(stream);
        assert!(took < Duration::from_secs(10), "{took:?}");
        assert!(said.is_empty() || said.starts_with("HTTP/1.1 408"), "{said}");
    }
    let (took, _) = dripping.join().expect("it ends");
    assert!(took < Duration::from_secs(10), "{took:?}");
    assert_eq!(mock.record().connections, 1, "none of them was a client");
}

#[test]
fn a_request_or_a_message_that_is_too_long_is_refused() {
    let mock = mock(Faults::default());
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX-Long: {}\r\n{UPGRADE}\r\n", "a".repeat(5000));
    let said = answered(&mock, &long);
    assert!(said.starts_with("HTTP/1.1 431") && said.contains("at most 4 KiB"), "{said}");
    // a message of 64 KiB is read and answered, a longer one ends its connection, whole or in fragments
    const LONGEST: usize = 1 << 16;
    let connect = || {
        let (mut socket, _) = tungstenite::connect(mock.url()).expect("it listens");
        socket.read().expect("the inventory");
        socket
    };
    let mut fits = connect();
    fits.send(Message::text(" ".repeat(LONGEST))).expect("it reads");
    assert!(fits.read().expect("it answers").is_text());
    let mut whole = connect();
    whole.send(Message::text(" ".repeat(LONGEST + 1))).ok();
    assert!(until_end(&mut whole), "a message of 64 KiB and a byte is answered");
    let mut fragments = connect();
    for number in 0..64 {
        let code = if number == 0 { Data::Text } else { Data::Continue };
        let fragment = WsFrame::message(vec![b' '; 4096], OpCode::Data(code), false);
        if fragments.send(Message::Frame(fragment)).is_err() {
            break;
        }
    }
    assert!(until_end(&mut fragments), "fragments of 256 KiB in all are taken");
    // and those of others go on
    fits.send(Message::text("{}")).expect("it reads");
    assert!(fits.read().expect("it answers").is_text());
}

/// True if a connection ends without an answer.
fn until_end<S: Read + Write>(socket: &mut tungstenite::WebSocket<S>) -> bool {
    loop {
        match socket.read() {
            Ok(Message::Text(_)) => return false,
            Ok(_) => {}
            Err(_) => return true,
        }
    }
}

#[test]
fn a_hand_begins_anew_with_each_run_or_is_kept() {
    for keep in [false, true] {
        let mock = Mock::start(Options { port: 0, path: moving(), keep, ..Options::default() }).expect("a free port");
        let first = |mock: &Mock| {
            let mut client = client(mock);
            let start = client.read(0.0).position;
            ticks(&mut client, DVec3::Z, |_, n| n == 200);
            client.close().expect("it closes");
            let ended = mock.record().connections;
            let begin = Instant::now();
            while mock.record().ended < ended && begin.elapsed() < Duration::from_secs(5) {
                std::thread::sleep(Duration::from_millis(1));
            }
            start
        };
        let apart = (first(&mock) - first(&mock)).length();
        assert!(if keep { apart > 1e-3 } else { apart == 0.0 }, "keep: {keep}: {apart} m");
    }
}

/// The system has a number for this, and no words that help.
#[test]
fn a_client_names_the_time_that_it_waited() {
    let silent = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    let url = format!("ws://{}", silent.local_addr().expect("it has one"));
    let error = open(&Settings { url, ..Settings::default() }).err().expect("nobody answers").to_string();
    assert!(error.contains("no answer to the WebSocket handshake within ") && error.contains(" s"), "{error}");
    assert!(!error.contains("os error") && !error.contains("WouldBlock"), "{error}");
}

/// Of the documentation: what a client may rely on, and this crate's own does not read.
#[test]
fn frames_have_the_documented_keys_and_sessions_need_no_profile() {
    let mock = mock(Faults::default());
    let (mut socket, _) = tungstenite::connect(mock.url()).expect("it listens");
    let mut hear = |say: Option<&str>| -> serde_json::Value {
        say.into_iter().for_each(|text| socket.send(Message::text(text)).expect("it reads"));
        serde_json::from_str(socket.read().expect("it answers").to_text().expect("text")).expect("JSON")
    };
    let has = |tree: &serde_json::Value, keys: &[&str]| {
        let missing: Vec<&&str> = keys.iter().filter(|key| tree.pointer(key).is_none()).collect();
        assert!(missing.is_empty(), "{missing:?} are missing in {tree}");
    };
    let inventory = hear(None);
    let arm =
        ["type", "device_info/uuid", "port", "gravity_compensation/enabled", "torque_scaling", "basis", "filters"];
    let arm: Vec<String> = arm.iter().map(|key| format!("/inverse3/0/config/{key}")).collect();
    has(&inventory, &arm.iter().map(String::as_str).collect::<Vec<_>>());
    has(&inventory, &["/verse_grip/0/config/port", "/verse_grip/0/config/type", "/verse_grip/0/status/error"]);
    // a session without a profile does not spoil the force beside it
    let force = r#"{"set_cursor_force": {"vector": {"x": 0, "y": 0, "z": 1}, "execute": true}}"#;
    let order = format!(r#""inverse3": [{{"device_id": "MOCK", "commands": {force}}}]"#);
    for session in ["{}", r#"{"force_render_full_state": {}}"#, r#"{"configure": {"basis": {"permutation": "XYZ"}}}"#] {
        let state = hear(Some(&format!(r#"{{"session": {session}, {order}}}"#)));
        let keys = ["mode", "control_domain", "body_orientation/w", "angular_position/a0", "angular_velocity/a2"];
        let keys: Vec<String> = keys.iter().map(|key| format!("/inverse3/0/state/{key}")).collect();
        has(&state, &keys.iter().map(String::as_str).collect::<Vec<_>>());
        has(&state, &["/inverse3/0/status/in_use", "/inverse3/0/status/started", "/verse_grip/0/state/hall"]);
        assert_eq!(state["inverse3"][0]["state"]["control_mode"], "force", "{session}: {state}");
        assert!(state["inverse3"][0].get("config").is_none(), "{state}");
    }
    let version = answered(&mock, "GET /version HTTP/1.1\r\nHost: localhost\r\n\r\n");
    for key in ["project_version", "project_name", "build_time", "git_hash", "git_tag", "git_branch", "git_describe"] {
        assert!(version.contains(&format!("\"{key}\"")), "{key} is missing in {version}");
    }
}
