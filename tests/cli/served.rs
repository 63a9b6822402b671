//! `cutis serve` from outside; tests/session/serve.rs has what goes over its socket.

use crate::work::{PRESS, Work};
use crate::{Outcome, Test, ensure};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

pub const TESTS: &[Test] = &[
    ("a_served_scene_has_a_page_until_a_signal", a_served_scene_has_a_page_until_a_signal),
    ("an_address_that_cannot_be_listened_on_is_told", an_address_that_cannot_be_listened_on_is_told),
];

/// Ends the program with the test.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

fn start(work: &Work) -> Result<(Served, String), String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
    command.args(["serve", "scene.toml", "--backend", "cpu", "--listen", "127.0.0.1:0"]).current_dir(work.path(""));
    let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(|e| e.to_string())?;
    let out = process.stdout.take().ok_or("no output")?;
    let (served, mut line) = (Served(process), String::new());
    BufReader::new(out).read_line(&mut line).map_err(|e| e.to_string())?;
    let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next());
    Ok((served, address.ok_or(format!("no address in {line:?}"))?.into()))
}

fn page(address: &str) -> Result<String, String> {
    let mut stream = TcpStream::connect(address).map_err(|e| e.to_string())?;
    write!(stream, "GET / HTTP/1.1\r\nHost: {address}\r\n\r\n").map_err(|e| e.to_string())?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).map_err(|e| e.to_string())?;
    Ok(answer)
}

fn a_served_scene_has_a_page_until_a_signal() -> Outcome {
    let work = Work::with(PRESS)?;
    let (mut served, address) = start(&work)?;
    let answer = page(&address)?;
    ensure!(answer.starts_with("HTTP/1.1 200 OK") && answer.ends_with("</html>\n"), "{answer:.200}");
    #[cfg(unix)]
    {
        let killed = Command::new("kill").args(["-TERM", &served.0.id().to_string()]).status();
        ensure!(killed.is_ok_and(|status| status.success()), "kill");
        let status = served.0.wait().map_err(|e| e.to_string())?;
        ensure!(status.code() == Some(143), "{status}");
        ensure!(page(&address).is_err(), "it listens on");
    }
    Ok(())
}

fn an_address_that_cannot_be_listened_on_is_told() -> Outcome {
    let work = Work::with(PRESS)?;
    let (_served, address) = start(&work)?;
    let said = work.cutis(&["serve", "scene.toml", "--backend", "cpu", "--listen", &address])?;
    ensure!(said.code == 1 && said.err.contains("take another --listen address"), "{} {}", said.code, said.err);
    let said = work.cutis(&["serve", "scene.toml", "--listen", "localhost"])?;
    ensure!(said.code == 2 && said.err.contains("wanted an address with a port"), "{} {}", said.code, said.err);
    let said = work.cutis(&["serve", "missing.toml"])?;
    ensure!(said.code == 2 && said.err.contains("missing.toml"), "{} {}", said.code, said.err);
    Ok(())
}
