//! `cutis serve`, driven over its own socket as a page drives it: it shows, presses, cuts, goes back, and survives what is no page.
#![cfg(feature = "serve")]

use cutis::scene::{Scene, incision};
use cutis::serve::{Options, serve};
use cutis::session;
use cutis::step::Platform;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket, client};

/// Longest wait for anything; a loaded machine takes its time.
const LONG: Duration = Duration::from_secs(120);

/// A session in a thread.
struct Session {
    url: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<cutis::error::Result<()>>>,
}

impl Session {
    /// The built-in incision on few cells, standing still.
    fn start(listen: &str) -> Self {
        Self::of(incision().expect("the built-in scene").in_test_form(), listen)
    }

    fn of(scene: Scene, listen: &str) -> Self {
        let stop: Arc<AtomicBool> = Arc::default();
        let session = session::Options { platform: Platform::Cpu64, paused: true, interrupt: stop.clone() };
        let options = Options { listen: listen.parse().expect("an address"), session };
        let (sender, urls) = channel();
        let thread = std::thread::spawn(move || serve(&scene, &options, &mut |url| drop(sender.send(url.to_string()))));
        let url = urls.recv_timeout(LONG).expect("the address of a session that listens");
        Self { url, stop, thread: Some(thread) }
    }

    fn address(&self) -> SocketAddr {
        let host = self.url.trim_start_matches("http://").split('/').next().unwrap_or_default();
        let port: u16 = host.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    fn page(&self) -> Page {
        Page::new(self.address(), "/stream", &[]).expect("a session takes a page")
    }

    fn get(&self, path: &str, more: &str) -> String {
        let mut stream = TcpStream::connect(self.address()).expect("a session that listens");
        let host = self.address();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n").expect("a request");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let ended = self.thread.take().map(JoinHandle::join);
        if !std::thread::panicking() {
            let ended = ended.expect("a thread").expect("a session that does not panic");
            assert!(ended.is_ok(), "{ended:?}");
        }
    }
}

/// A page without a picture: what it was sent last.
struct Page {
    socket: WebSocket<TcpStream>,
    scene: Value,
    figures: Value,
    /// Number, vertices, triangles, and whether a wound's wall is among them.
    surface: (u32, u32, u32, bool),
    /// Largest displacement in the last frame, m, and the positions of the tools.
    moved: f64,
    tools: Vec<[f32; 3]>,
    /// Number of the quantity that colours are of, its values, and those on the slice with the slice's vertices, m.
    quantity: u32,
    values: Vec<f64>,
    slice: (Vec<f64>, Vec<[f32; 3]>),
    frames: u32,
    errors: Vec<String>,
    draws: bool,
}

impl Page {
    fn new(address: SocketAddr, path: &str, fields: &[(&'static str, &str)]) -> Result<Self, String> {
        let mut request = format!("ws://{address}{path}").into_client_request().map_err(|e| e.to_string())?;
        for (name, value) in fields {
            request.headers_mut().insert(*name, value.parse().expect("a field"));
        }
        let stream = TcpStream::connect(address).map_err(|e| e.to_string())?;
        stream.set_read_timeout(Some(LONG)).map_err(|e| e.to_string())?;
        let (socket, _) = client(request, stream).map_err(|e| e.to_string())?;
        let (figures, surface) = (Value::Null, (0, 0, 0, false));
        Ok(Self {
            socket,
            scene: Value::Null,
            figures,
            surface,
            moved: 0.0,
            tools: vec![],
            quantity: 0,
            values: vec![],
            slice: (vec![], vec![]),
            frames: 0,
            errors: vec![],
            draws: true,
        })
    }

    fn send(&mut self, command: &Value) {
        self.socket.send(Message::text(command.to_string())).expect("a session that listens");
    }

    /// Takes the next message; false at the end.
    fn next(&mut self) -> bool {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                let tree: Value = serde_json::from_str(&text).expect("JSON");
                for (key, value) in tree.as_object().expect("an object") {
                    match key.as_str() {
                        "scene" => self.scene = value.clone(),
                        "figures" => self.figures = value.clone(),
                        "error" => self.errors.push(value.as_str().unwrap_or_default().into()),
                        _ => panic!("unknown text {key}"),
                    }
                }
            }
            Ok(Message::Binary(bytes)) if bytes[0] == 1 => self.take_surface(&bytes),
            Ok(Message::Binary(bytes)) => self.take_frame(&bytes),
            Ok(Message::Close(_)) | Err(_) => return false,
            Ok(_) => {}
        }
        true
    }

    fn take_surface(&mut self, bytes: &[u8]) {
        let word = |k: usize| u32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().expect("four bytes"));
        let (vertices, triangles, lines) = (word(2), word(3), word(4) + word(5));
        assert_eq!(bytes.len() as u32, 24 + 16 * vertices + 12 * triangles + 8 * lines);
        let kinds = &bytes[24 + 12 * vertices as usize..][..4 * vertices as usize];
        let walls = kinds.chunks_exact(4).any(|kind| kind[1] == 1);
        let corners = &bytes[24 + 16 * vertices as usize..];
        let inside = corners.chunks_exact(4).all(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) < vertices);
        assert!(inside, "a corner beyond the vertices");
        self.surface = (word(1), vertices, triangles, walls);
    }

    fn take_frame(&mut self, bytes: &[u8]) {
        let word = |k: usize| u32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().expect("four bytes"));
        let float = |k: usize| f32::from_bits(word(k));
        let (vertices, tools, contacts) = (word(10) as usize, word(11) as usize, word(12) as usize);
        assert_eq!(word(1), self.surface.0, "a frame moves the surface that was sent before it");
        self.quantity = word(13);
        let (high, [cut, triangles, lines]) = (f64::from(float(14)), [15, 16, 17].map(|k| word(k) as usize));
        let mut at = 72;
        let mut take = |count: usize, bytes: usize| {
            let from = at;
            at += (count * bytes).next_multiple_of(4);
            from
        };
        let shares_at = |from: usize, count: usize| -> Vec<u16> {
            bytes[from..from + 2 * count].chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
        };
        let values_at =
            |from, count| shares_at(from, count).iter().map(|s| high * f64::from(*s) / 65535.0).collect::<Vec<_>>();
        // displacements are shares of a box
        let shares = shares_at(take(3 * vertices, 2), 3 * vertices);
        let valued = usize::from(self.quantity > 0);
        self.values = values_at(take(valued * vertices, 2), valued * vertices);
        let at_tools = take(13 * tools + 6 * contacts, 4);
        let positions = take(3 * cut, 4);
        take(cut, 4);
        let of_cut = values_at(take(valued * cut, 2), valued * cut);
        let corners = take(3 * triangles + 2 * lines, 4);
        assert_eq!(bytes.len(), at);
        assert!((corners / 4..at / 4).all(|k| (word(k) as usize) < cut), "a corner beyond the slice");
        let position = |n: usize| std::array::from_fn(|k| float(positions / 4 + 3 * n + k));
        self.slice = (of_cut, (0..cut).map(position).collect());
        let part = |n: usize, k: usize| {
            f64::from(float(4 + k)) + f64::from(float(7 + k)) * f64::from(shares[3 * n + k]) / 65535.0
        };
        let length = |n: usize| (0..3).map(|k| part(n, k).powi(2)).sum::<f64>().sqrt();
        self.moved = (0..vertices).map(length).fold(0.0, f64::max);
        self.tools = (0..tools).map(|tool| std::array::from_fn(|k| float(at_tools / 4 + 13 * tool + k))).collect();
        self.frames += 1;
        if self.draws {
            let frames = self.frames;
            self.socket.send(Message::text(json!({ "drawn": frames }).to_string())).ok();
        }
    }

    /// Takes messages until something holds.
    fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !holds(self) {
            assert!(begun.elapsed() < LONG, "{what}: {} {:?}", self.figures, self.errors);
            assert!(self.next(), "{what}: the session is gone");
        }
    }

    fn figure(&self, name: &str) -> f64 {
        self.figures[name].as_f64().unwrap_or(f64::NAN)
    }

    fn kept(&self) -> usize {
        self.figures["kept"].as_array().map_or(0, Vec::len)
    }
}

/// Has a page's hand draw the blade of the test form through its skin: down, along, up.
fn cut(page: &mut Page) {
    let at = page.tools[0].map(f64::from);
    let hand = |x: f64, z: f64, pressed: bool| json!({ "hand": { "tool": 0, "position": [at[0] + x, at[1], at[2] + z], "pressed": pressed } });
    page.send(&json!({ "speed": 10.0 }));
    page.send(&json!("play"));
    page.send(&hand(0.0, -2.5e-3, true));
    page.until("the skin is pressed", |page| page.figures["force_n"][0].as_f64().is_some_and(|force| force > 0.01));
    page.send(&hand(-8e-3, -2.5e-3, true));
    page.until("links are cut", |page| page.figure("severed") >= 3.0);
    page.until("the wound is shown", |page| page.surface.3);
}

#[test]
fn a_page_watches_presses_cuts_and_goes_back() {
    let session = Session::start("127.0.0.1:0");
    let mut page = session.page();
    page.until("the scene and a first frame", |page| {
        page.frames > 0 && !page.scene.is_null() && !page.figures.is_null()
    });
    assert_eq!(page.scene["layers"].as_array().map(Vec::len), Some(3), "{}", page.scene);
    assert_eq!(page.scene["tools"][0]["cuts"], json!(true));
    assert!(page.surface.1 > 50 && page.surface.2 > 100 && !page.surface.3, "{:?}", page.surface);
    assert!(page.figures["playing"] == json!(false) && page.figure("time_s") == 0.0 && page.moved < 1e-9);
    // single steps
    for number in 1..=2 {
        page.send(&json!("step"));
        page.until("a step", |page| (page.figure("time_s") - 0.005 * f64::from(number)).abs() < 1e-9);
    }
    // a cut by hand
    let whole = page.surface.2;
    cut(&mut page);
    assert!(page.surface.2 > whole && page.moved > 1e-5 && page.moved < 5e-3, "{:?} {}", page.surface, page.moved);
    // where the hand went is a trajectory that scenes read
    let table = session.get("/motion.csv?tool=0", "");
    let rows: Vec<&str> = table.split("\r\n\r\n").nth(1).unwrap_or_default().lines().collect();
    assert_eq!(rows[0], "time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw");
    assert!(rows.len() > 6 && rows.iter().all(|row| row.split(',').count() == 8), "{table}");
    // back before the cut: the skin is whole, and another cut can be made
    page.send(&json!({ "seek": 0 }));
    page.until("the kept state", |page| page.figure("time_s") == 0.0 && !page.surface.3);
    assert!(page.surface.2 == whole && page.figure("severed") == 0.0 && page.kept() == 1);
    page.send(&json!({ "release": 0 }));
    cut(&mut page);
    assert!(page.errors.is_empty(), "{:?}", page.errors);
}

#[test]
fn a_run_is_changed_while_it_goes_on_and_begun_anew() {
    let session = Session::start("127.0.0.1:0");
    let mut page = session.page();
    page.until("a first frame", |page| page.frames > 0 && !page.figures.is_null());
    for (command, key, wanted) in [
        (json!({ "friction": 0.1 }), "friction", 0.1),
        (json!({ "stiffness": 2.0 }), "stiffness", 2.0),
        (json!({ "tolerance": 1e-3 }), "tolerance", 1e-3),
        (json!({ "speed": 0.5 }), "speed", 0.5),
    ] {
        page.send(&command);
        page.send(&json!("step"));
        page.until(key, |page| page.figure(key) == wanted);
    }
    page.until("the steps", |page| page.figure("time_s") > 0.0199);
    page.send(&json!({ "step_ms": 10.0 }));
    page.until("another step begins anew", |page| page.figure("scene_step_ms") == 10.0 && page.figure("time_s") == 0.0);
    page.send(&json!("step"));
    page.until("its length", |page| (page.figure("time_s") - 0.01).abs() < 1e-9);
    assert_eq!(page.figure("stiffness"), 2.0, "what was changed stays");
    page.send(&json!("reset"));
    page.until("the beginning", |page| page.figure("time_s") == 0.0);
    // what cannot be is refused with words and changes nothing
    for (command, words) in [
        (json!({ "friction": -1.0 }), "friction = -1"),
        (json!({ "step_ms": 1e9 }), "step_ms = 1000000000"),
        (json!({ "fly": 1 }), "no command"),
    ] {
        page.errors.clear();
        page.send(&command);
        page.until(words, |page| page.errors.iter().any(|error| error.contains(words)));
    }
    assert_eq!([page.figure("friction"), page.figure("scene_step_ms")], [0.1, 10.0]);
}

#[test]
fn pages_are_coloured_by_a_quantity_and_cut_open_alike() {
    let session = Session::start("127.0.0.1:0");
    let mut page = session.page();
    page.until("a first frame", |page| page.frames > 0 && !page.figures.is_null() && !page.scene.is_null());
    let at = page.tools[0].map(f64::from);
    page.send(&json!({ "hand": { "tool": 0, "position": [at[0], at[1], at[2] - 2.5e-3], "pressed": false } }));
    page.send(&json!({ "speed": 10.0 }));
    page.send(&json!("play"));
    page.until("the skin is pressed", |page| page.figures["force_n"][0].as_f64().is_some_and(|force| force > 0.05));
    page.send(&json!("pause"));
    page.until("it stands still", |page| page.figures["playing"] == json!(false));
    assert!(page.quantity == 0 && page.values.is_empty() && page.slice.1.is_empty());
    let plane = json!({ "normal": [0.0, 1.0, 0.0], "offset": at[1] });
    let keys: Vec<String> = {
        let list = page.scene["quantities"].as_array().expect("a list");
        list.iter().map(|of| of["key"].as_str().unwrap_or_default().into()).collect()
    };
    assert!(keys.len() == 7 && keys[0] == "displacement" && keys[4] == "residual", "{keys:?}");
    let mut second = session.page();
    for (number, key) in keys.iter().enumerate() {
        let look = json!({ "quantity": key, "plane": plane });
        page.send(&json!({ "look": look }));
        if key == "residual" {
            page.send(&json!("step")); // it is that of a step
        }
        for page in [&mut page, &mut second] {
            page.until(key, |page| page.figures["look"] == look && page.quantity == number as u32 + 1);
            assert_eq!(page.values.len(), page.surface.1 as usize, "{key}");
            assert!(page.slice.0.len() == page.slice.1.len() && !page.slice.1.is_empty(), "{key}");
            // the plane through the moved cells
            assert!(page.slice.1.iter().all(|x| (f64::from(x[1]) - at[1]).abs() < 1e-7), "{key}");
            let largest = page.values.iter().copied().fold(0.0, f64::max);
            let (low, high) = match key.as_str() {
                "displacement" => (0.99 * page.moved, 1.01 * page.moved),
                "velocity" => (1e-5, 1.0),
                "von_mises" => (500.0, 1e6),
                "pressure" => (100.0, 1e6),
                "residual" => (1e-12, 1e-2),
                _ => (1.0, 1.0),
            };
            assert!((low..=high).contains(&largest), "{key}: {largest:e}, not in {low:e} to {high:e}");
        }
    }
    page.send(&json!({ "look": {} }));
    page.until("layers, whole", |page| page.quantity == 0 && page.slice.1.is_empty());
    page.send(&json!({ "look": { "plane": { "normal": [0, 0, 0], "offset": 0 } } }));
    page.until("a refusal", |page| page.errors.iter().any(|error| error.contains("plane's normal")));
}

#[test]
fn a_second_page_joins_and_a_slow_one_holds_nobody_up() {
    let session = Session::start("127.0.0.1:0");
    let mut page = session.page();
    page.until("a first frame", |page| page.frames > 0 && !page.figures.is_null());
    page.send(&json!("step"));
    page.until("a step", |page| page.figure("time_s") > 0.0);
    // what stands still is shown to the one who joins
    let mut second = session.page();
    second.until("the present state", |page| page.frames > 0 && page.figure("time_s") > 0.0 && !page.scene.is_null());
    assert_eq!(second.surface, page.surface);
    // the slow one draws nothing: it gets two frames, and the other all that there are
    let mut slow = session.page();
    slow.draws = false;
    second.send(&json!({ "speed": 10.0 }));
    second.send(&json!("play"));
    page.until("some frames", |page| page.frames >= 12);
    second.until("some frames", |page| page.frames >= 12);
    assert_eq!(page.figure("pages"), 3.0);
    slow.socket.get_ref().set_read_timeout(Some(Duration::from_millis(300))).expect("a time-out");
    while slow.next() {}
    assert_eq!(slow.frames, 2);
    // one that leaves without a word is no loss
    slow.socket.get_ref().shutdown(Shutdown::Both).expect("a socket");
    page.until("the one is gone", |page| page.figure("pages") == 2.0);
    second.send(&json!("pause"));
    page.until("a pause", |page| page.figures["playing"] == json!(false));
}

#[test]
fn what_is_no_page_is_refused_and_harms_nothing() {
    let session = Session::start("127.0.0.1:0");
    let address = session.address();
    // pages
    assert!(session.get("/", "").contains("<canvas id=\"view\">"));
    assert!(session.get("/nothing", "").starts_with("HTTP/1.1 404"));
    assert!(session.get("/", "Origin: http://evil.example\r\n").starts_with("HTTP/1.1 403"));
    for (field, value) in [("origin", "http://evil.example"), ("host", "evil.example")] {
        let refused = Page::new(address, "/stream", &[(field, value)]).err();
        assert!(refused.as_ref().is_some_and(|error| error.contains("403")), "{field}: {refused:?}");
    }
    // bytes that are no request, and nothing at all
    let mut stream = TcpStream::connect(address).expect("a session that listens");
    stream.write_all(&[0xff; 5000]).expect("bytes");
    drop(TcpStream::connect(address));
    // messages that are no commands: words, and in the end the door
    let mut rude = session.page();
    rude.socket.send(Message::binary(vec![7u8; 100])).expect("a message");
    rude.until("words", |page| page.errors.iter().any(|error| error.contains("binary")));
    let mut told = 0;
    for number in 0..200 {
        if rude.socket.send(Message::text(format!("{{\"hand\": {number}"))).is_err() {
            break;
        }
        told += 1;
    }
    while rude.next() {}
    assert!(rude.errors.len() < 110, "{told} {}", rude.errors.len());
    // a message beyond the limit closes
    let mut long = session.page();
    long.socket.send(Message::text("x".repeat(1 << 16))).ok();
    while long.next() {}
    // the others do not notice
    let mut page = session.page();
    page.send(&json!("step"));
    page.until("a step", |page| page.figure("time_s") > 0.0);
}

#[test]
fn on_another_interface_pages_need_the_token() {
    let session = Session::start("0.0.0.0:0");
    let token = session.url.split("?token=").nth(1).expect("a token in the address").to_string();
    assert_eq!(token.len(), 32);
    assert!(session.get("/", "").starts_with("HTTP/1.1 403"));
    assert!(session.get("/?token=0123456789abcdef0123456789abcdef", "").starts_with("HTTP/1.1 403"));
    assert!(session.get(&format!("/?token={token}"), "").starts_with("HTTP/1.1 200"));
    assert!(Page::new(session.address(), "/stream", &[]).is_err());
    let mut page = Page::new(session.address(), &format!("/stream?token={token}"), &[]).expect("a page with the token");
    page.until("a frame", |page| page.frames > 0);
    let other = Session::start("0.0.0.0:0");
    assert_ne!(other.url.split("?token=").nth(1), Some(&*token));
}

/// The page itself in a headless Chromium, as a person has it, where `CUTIS_BROWSER` names a folder with puppeteer-core and
/// @sparticuz/chromium in its `node_modules`; its pictures go there too.
#[test]
fn a_browser_watches_presses_and_cuts() {
    let Some(folder) = std::env::var_os("CUTIS_BROWSER").map(std::path::PathBuf::from) else {
        println!("left out: CUTIS_BROWSER names no folder with a browser");
        return;
    };
    let session = Session::of(incision().expect("the built-in scene"), "127.0.0.1:0");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/session/page.mjs");
    let driven = std::process::Command::new("node").arg(script).arg(&folder).arg(&session.url).arg(&folder).output();
    let driven = driven.expect("node");
    assert!(driven.status.success(), "{}", String::from_utf8_lossy(&driven.stderr));
}
