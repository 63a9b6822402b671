//! `cutis haply-mock` from outside: a client of the library meets it over its port.

use crate::work::{ALONE, PRESS, Work};
use crate::{Outcome, Test, ensure};
use cutis::haptic::device::{Device, Wrench};
use cutis::haptic::haply::{Client, Settings, open};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

pub const TESTS: &[Test] = &[
    ("haply_mock_serves_a_client_until_its_input_ends", haply_mock_serves_a_client_until_its_input_ends),
    ("haply_mock_follows_a_scenes_hand", haply_mock_follows_a_scenes_hand),
    ("haply_mock_without_a_grip_is_not_turned", haply_mock_without_a_grip_is_not_turned),
    ("haply_mock_without_an_input_goes_on", haply_mock_without_an_input_goes_on),
    ("haply_mock_waits_where_descriptors_are_short", haply_mock_waits_where_descriptors_are_short),
    ("a_second_haply_mock_on_a_port_is_refused", a_second_haply_mock_on_a_port_is_refused),
    ("haply_mock_explains_itself", haply_mock_explains_itself),
];

/// A stand-in that runs, and what it prints; ended when dropped.
struct StandIn {
    process: Child,
    out: BufReader<ChildStdout>,
    first: String,
}

impl StandIn {
    fn start(work: &Work, more: &[&str]) -> Result<Self, String> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
        command.args(["haply-mock", "--port", "0", "--until-stdin-ends"]).args(more).current_dir(work.path(""));
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map_err(|e| e.to_string())?;
        let out = process.stdout.take().ok_or("no output")?;
        let (mut out, mut first) = (BufReader::new(out), String::new());
        out.read_line(&mut first).map_err(|e| e.to_string())?;
        Ok(Self { process, out, first })
    }

    fn url(&self) -> Result<String, String> {
        let url = self.first.split_whitespace().find(|word| word.starts_with("ws://"));
        url.map(String::from).ok_or_else(|| format!("no address in `{}`", self.first))
    }

    fn client(&self) -> Result<Client, String> {
        open(&Settings { url: self.url()?, ..Settings::default() }).map_err(|e| e.to_string())
    }

    /// Ends its input: exit status, and what it has printed since the first line.
    fn end(mut self) -> Result<(Option<i32>, Vec<String>), String> {
        drop(self.process.stdin.take());
        let lines: Result<Vec<String>, _> = self.out.by_ref().lines().collect();
        let status = self.process.wait().map_err(|e| e.to_string())?;
        Ok((status.code(), lines.map_err(|e| e.to_string())?))
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Ticks until so many states have come; the last position, m, and rotation angle, rad.
fn follow(client: &mut Client, force: DVec3, states: u64) -> Result<(DVec3, f64), String> {
    let start = Instant::now();
    while client.frames() < states {
        ensure!(start.elapsed() < Duration::from_secs(20), "{} states only, {:?}", client.frames(), client.trouble());
        client.write(0.0, Wrench { force, torque: DVec3::ZERO });
        std::thread::sleep(Duration::from_millis(1));
    }
    let reading = client.read(0.0);
    Ok((reading.position, reading.rotation.to_scaled_axis().length()))
}

fn haply_mock_serves_a_client_until_its_input_ends() -> Outcome {
    let stand_in = StandIn::start(&Work::with(ALONE)?, &["--device", "049D"])?;
    ensure!(stand_in.first.contains("as inverse3 049D with verse_grip GRIP"), "{}", stand_in.first);
    let mut client = stand_in.client()?;
    let (rest, _) = follow(&mut client, DVec3::ZERO, 10)?;
    let (pushed, _) = follow(&mut client, DVec3::Z, 600)?;
    // 1 N on a spring of 200 N/m
    ensure!((pushed - rest - DVec3::Z * 5e-3).length() < 1e-4, "moved by {}", pushed - rest);
    client.close().map_err(|e| e.to_string())?;
    let (code, lines) = stand_in.end()?;
    ensure!(code == Some(0), "exit status {code:?}");
    ensure!(lines.len() == 2 && lines[0].starts_with("connected: 127.0.0.1:"), "{lines:?}");
    ensure!(lines[1].starts_with("left: 127.0.0.1:") && lines[1].ends_with(" frames"), "{lines:?}");
    Ok(())
}

fn haply_mock_follows_a_scenes_hand() -> Outcome {
    let work = Work::with(PRESS)?;
    let stand_in = StandIn::start(&work, &["--scene", "scene.toml"])?;
    let mut client = stand_in.client()?;
    // the recorded hand ends at rest after 20 ms
    let (end, _) = follow(&mut client, DVec3::ZERO, 400)?;
    ensure!((end - DVec3::new(0.3e-3, 0.2e-3, 1.7e-3)).length() < 2e-5, "ended at {end}");
    StandIn::start(&work, &["--scene", "scene.toml", "--tool", "tip"])?.client()?;
    let other = work.cutis(&["haply-mock", "--port", "0", "--scene", "scene.toml", "--tool", "needle"])?;
    let says = other.err.contains("no tool of this scene is called \"needle\"") && other.err.contains("are \"tip\"");
    ensure!(other.code == 2 && says, "{} {}", other.code, other.err);
    let none = work.cutis(&["haply-mock", "--port", "0", "--scene", "missing.toml"])?;
    ensure!(none.code == 2 && none.err.contains("missing.toml"), "{} {}", none.code, none.err);
    let bare = Work::with(ALONE)?.cutis(&["haply-mock", "--port", "0", "--scene", "scene.toml"])?;
    ensure!(bare.code == 2 && bare.err.contains("no tool of this scene"), "{} {}", bare.code, bare.err);
    Ok(())
}

fn haply_mock_without_a_grip_is_not_turned() -> Outcome {
    let work = Work::with(PRESS)?;
    // a quarter turn about z from the start on
    let half = 0.5_f64.sqrt();
    work.write("hand.csv", &format!("time_s,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,{half},{half}\n"))?;
    for (more, wanted) in [(&["--scene", "scene.toml"][..], FRAC_PI_2), (&["--scene", "scene.toml", "--no-grip"], 0.0)]
    {
        let stand_in = StandIn::start(&work, more)?;
        let (_, angle) = follow(&mut stand_in.client()?, DVec3::ZERO, 10)?;
        ensure!((angle - wanted).abs() < 1e-3, "{more:?}: turned by {angle}");
    }
    Ok(())
}

/// As in the background of a shell, or under a service manager.
fn haply_mock_without_an_input_goes_on() -> Outcome {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
    command.args(["haply-mock", "--port", "0"]).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut process = command.spawn().map_err(|e| e.to_string())?;
    let (mut out, mut first) = (BufReader::new(process.stdout.take().ok_or("no output")?), String::new());
    out.read_line(&mut first).map_err(|e| e.to_string())?;
    let mut stand_in = StandIn { process, out, first };
    std::thread::sleep(Duration::from_millis(300));
    ensure!(stand_in.process.try_wait().map_err(|e| e.to_string())?.is_none(), "it has ended by itself");
    follow(&mut stand_in.client()?, DVec3::ZERO, 10)?;
    ensure!(!stand_in.first.contains("standard input"), "{}", stand_in.first);
    Ok(())
}

/// Descriptors that it may have: its own, and those of a few clients.
const FEW: &str = "24";

/// Time that a process has computed, in ticks of 10 ms.
fn computed(id: u32) -> Result<u64, String> {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).map_err(|e| e.to_string())?;
    let after = text.rsplit(')').next().unwrap_or_default();
    let numbers = after.split_whitespace().skip(11).take(2).map(str::parse::<u64>);
    numbers.sum::<Result<u64, _>>().map_err(|e| e.to_string())
}

/// More clients than descriptors: those that it has no room for wait, and it does not burn a core on them; when others leave, they come in.
fn haply_mock_waits_where_descriptors_are_short() -> Outcome {
    if !cfg!(target_os = "linux") {
        return Ok(());
    }
    let mut command = Command::new("sh");
    let script = "ulimit -n \"$1\" && shift && exec \"$@\"";
    command.args(["-c", script, "sh", FEW, env!("CARGO_BIN_EXE_cutis"), "haply-mock", "--port", "0"]);
    let mut process = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().map_err(|e| e.to_string())?;
    let (mut out, mut first) = (BufReader::new(process.stdout.take().ok_or("no output")?), String::new());
    out.read_line(&mut first).map_err(|e| e.to_string())?;
    let mut stand_in = StandIn { process, out, first };
    let address = stand_in.url()?.trim_start_matches("ws://").to_string();
    // clients stay connected; the handshake of those beyond the limit is not answered
    let mut inside = vec![];
    let waiting = loop {
        ensure!(inside.len() < 30, "{} clients have come in", inside.len());
        let stream = TcpStream::connect(&address).map_err(|e| e.to_string())?;
        stream.set_read_timeout(Some(Duration::from_millis(700))).map_err(|e| e.to_string())?;
        let kept = stream.try_clone().map_err(|e| e.to_string())?;
        match tungstenite::client(format!("ws://{address}"), stream) {
            Ok((socket, _)) => inside.push(socket),
            Err(_) => break kept,
        }
    };
    ensure!(inside.len() > 5, "{} clients only", inside.len());
    drop(waiting);
    // nobody is served, and nothing is computed
    let waits = TcpStream::connect(&address).map_err(|e| e.to_string())?;
    let before = computed(stand_in.process.id())?;
    std::thread::sleep(Duration::from_secs(2));
    let ticks = computed(stand_in.process.id())? - before;
    ensure!(ticks < 50, "{ticks} ticks of 10 ms in 2 s");
    ensure!(stand_in.process.try_wait().map_err(|e| e.to_string())?.is_none(), "it has ended");
    // with room again it serves a new client
    drop((inside, waits));
    follow(&mut stand_in.client()?, DVec3::ZERO, 10)?;
    Ok(())
}

fn a_second_haply_mock_on_a_port_is_refused() -> Outcome {
    let work = Work::with(ALONE)?;
    let stand_in = StandIn::start(&work, &[])?;
    let url = stand_in.url()?;
    let port = url.rsplit(':').next().unwrap_or_default();
    let second = work.cutis(&["haply-mock", "--port", port])?;
    ensure!(second.code == 1, "exit status {}: {}", second.code, second.err);
    for word in [port, "cannot listen there", "--port 0 takes a free one"] {
        ensure!(second.err.contains(word), "no `{word}` in {}", second.err);
    }
    Ok(())
}

fn haply_mock_explains_itself() -> Outcome {
    let said = Work::with(ALONE)?.cutis(&["haply-mock", "--help"])?;
    ensure!(said.code == 0, "exit status {}", said.code);
    for word in
        ["--port", "10001", "--device", "--grip", "--no-grip", "--scene", "--tool", "--until-stdin-ends", "Ctrl-C"]
    {
        ensure!(said.out.contains(word), "no `{word}` in {}", said.out);
    }
    Ok(())
}
