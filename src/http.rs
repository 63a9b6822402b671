//! What the servers of the program share: the thread that accepts connections, the head of a request, and answers.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Time that a peer has to state its request.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// Time that accepting waits for a descriptor, or for a peer that is turned away to leave: others wait meanwhile.
const SHORT: Duration = Duration::from_millis(4);

/// Thread that accepts connections until this is dropped.
pub struct Door {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Door {
    /// Has each connection received by a thread of its own, `most` at once, and further ones refused. Those that receive end once `stop` is
    /// set, which dropping does.
    ///
    /// # Errors
    /// When the listener has no address or the system starts no thread.
    pub fn open(
        name: &str,
        listener: TcpListener,
        most: usize,
        stop: &Arc<AtomicBool>,
        receive: impl Fn(TcpStream, SocketAddr) -> io::Result<()> + Clone + Send + 'static,
    ) -> io::Result<Self> {
        let (address, inside) = (listener.local_addr()?, stop.clone());
        let accepting = move || admit(&listener, most, &inside, &receive);
        let thread = thread::Builder::new().name(name.into()).spawn(accepting)?;
        Ok(Self { address, stop: stop.clone(), thread: Some(thread) })
    }

    /// Address that it listens at.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        // a connection wakes the thread that waits in accept
        let port = self.address.port();
        let own = match self.address {
            SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::LOCALHOST, port)),
            SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::LOCALHOST, port)),
        };
        let there = if self.address.ip().is_unspecified() { own } else { self.address };
        TcpStream::connect_timeout(&there, PATIENCE).ok();
        if let Some(thread) = self.thread.take() {
            thread.join().ok();
        }
    }
}

fn admit<F>(listener: &TcpListener, most: usize, stop: &AtomicBool, receive: &F)
where
    F: Fn(TcpStream, SocketAddr) -> io::Result<()> + Clone + Send + 'static,
{
    let mut clients: Vec<JoinHandle<()>> = Vec::new();
    while !stop.load(Ordering::Acquire) {
        clients.retain(|client| !client.is_finished());
        let Ok((mut stream, from)) = listener.accept() else {
            // out of descriptors, for instance: one becomes free when a client leaves
            thread::sleep(SHORT);
            continue;
        };
        if clients.len() >= most {
            stream.set_read_timeout(Some(SHORT)).ok();
            refuse(&mut stream, "503 Service Unavailable", "too many connections").ok();
            continue;
        }
        let receive = receive.clone();
        // if the handshake fails, closing the connection tells the peer
        clients.extend(thread::Builder::new().spawn(move || drop(receive(stream, from))));
    }
    for client in clients {
        client.join().ok();
    }
}

/// First bytes of a connection up to the empty line, in lower case, left in the socket: whole, so that nobody waits for the rest of a
/// handshake.
///
/// # Errors
/// [`ErrorKind::TimedOut`] after [`PATIENCE`], however many bytes have come by then, [`ErrorKind::FileTooLarge`] for more than 4 KiB; both
/// have been answered.
pub fn head(stream: &mut TcpStream) -> io::Result<String> {
    let until = Instant::now() + PATIENCE;
    let mut bytes = [0; 4096];
    let refused = loop {
        if Instant::now() >= until {
            break (ErrorKind::TimedOut, "408 Request Timeout");
        }
        match stream.peek(&mut bytes)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            read => {
                let text = String::from_utf8_lossy(&bytes[..read]);
                if text.contains("\r\n\r\n") {
                    return Ok(text.to_ascii_lowercase());
                }
                if read == bytes.len() {
                    break (ErrorKind::FileTooLarge, "431 Request Header Fields Too Large");
                }
            }
        }
        thread::sleep(Duration::from_millis(1));
    };
    refuse(stream, refused.1, "wanted a whole request of at most 4 KiB within 1 s").ok();
    Err(refused.0.into())
}

/// Value of a field of a request's head.
fn field<'a>(head: &'a str, name: &str) -> Option<&'a str> {
    head.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':')).map(str::trim)
}

fn names_this_machine(host: &str) -> bool {
    let name = host.strip_prefix('[').map_or_else(|| host.split(':').next(), |six| six.split(']').next());
    matches!(name, Some("localhost" | "127.0.0.1" | "::1"))
}

/// Whether the request is of this machine: a page of a browser says where it is from, and by which name it found the server.
pub fn is_local(head: &str) -> bool {
    let origin = |text: &str| text.split_once("://").is_some_and(|(_, host)| names_this_machine(host));
    field(head, "host").is_none_or(names_this_machine) && field(head, "origin").is_none_or(origin)
}

/// Whether a page of a browser that makes the request is the server's own; requests that name no page are not a browser's.
pub fn is_same_origin(head: &str) -> bool {
    let host = field(head, "host");
    let same = |text: &str| text.split_once("://").is_some_and(|(_, from)| Some(from) == host);
    field(head, "origin").is_none_or(same)
}

/// Whether the request asks for a WebSocket.
pub fn is_upgrade(head: &str) -> bool {
    field(head, "upgrade") == Some("websocket")
}

/// Path of a GET request, without what follows a question mark, and that; none of other requests.
pub fn asked(head: &str) -> Option<(&str, &str)> {
    let target = head.strip_prefix("get ")?.split(' ').next()?;
    Some(target.split_once('?').unwrap_or((target, "")))
}

/// Answers a request and ends the connection: the answer is one piece, and what the peer still says is read until it leaves, within the
/// stream's time limits. A system resets a connection that is closed over unread bytes, and a peer then loses the answer.
///
/// # Errors
/// When the peer does not take it.
pub fn answer(stream: &mut TcpStream, status: &str, kind: &str, body: &[u8]) -> io::Result<()> {
    let length = body.len();
    let head = format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n");
    let mut whole = format!("{head}Cache-Control: no-store\r\nConnection: close\r\n\r\n").into_bytes();
    whole.extend_from_slice(body);
    stream.write_all(&whole)?;
    stream.shutdown(Shutdown::Write)?;
    let (until, mut rest) = (Instant::now() + PATIENCE, [0; 4096]);
    while Instant::now() < until && stream.read(&mut rest).is_ok_and(|read| read > 0) {}
    Ok(())
}

/// Answers a request with words on what is wrong with it, as JSON; `words` have no quotes.
///
/// # Errors
/// As [`answer`].
pub fn refuse(stream: &mut TcpStream, status: &str, words: &str) -> io::Result<()> {
    answer(stream, status, "application/json", format!("{{\"error\": \"{words}\"}}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_of_another_site_is_known_by_its_origin() {
        let head = |host: &str, origin: &str| format!("get / http/1.1\r\nhost: {host}\r\norigin: {origin}\r\n\r\n");
        assert!(is_local(&head("localhost:80", "http://127.0.0.1:80")));
        assert!(is_local(&head("[::1]:80", "http://localhost")));
        assert!(!is_local(&head("localhost.evil.example", "http://localhost")));
        assert!(!is_local(&head("localhost", "http://evil.example")));
        assert!(is_same_origin(&head("box:8080", "http://box:8080")));
        assert!(!is_same_origin(&head("box:8080", "http://evil.example")));
        assert!(is_same_origin("get / http/1.1\r\nhost: box\r\n\r\n"));
        assert!(!is_same_origin("get / http/1.1\r\norigin: null\r\n\r\n"));
    }

    /// Closed over the unread rest of the request, the connection would be reset and the answer lost.
    #[test]
    fn an_answer_arrives_whole_whatever_is_left_of_the_request() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it has one");
        let server = thread::spawn(move || {
            let mut stream = listener.accept().expect("a client").0;
            stream.set_read_timeout(Some(PATIENCE)).expect("a time");
            head(&mut stream).expect("a request");
            answer(&mut stream, "200 OK", "text/plain", &[b'a'; 100_000])
        });
        let mut client = TcpStream::connect(address).expect("it listens");
        client.write_all(b"POST / HTTP/1.1\r\n\r\n").expect("it reads");
        client.write_all(&vec![b'b'; 20_000_000]).expect("it reads");
        let mut said = Vec::new();
        client.read_to_end(&mut said).expect("no reset");
        assert!(said.starts_with(b"HTTP/1.1 200 OK\r\n") && said.ends_with(&[b'a'; 100_000]), "{} bytes", said.len());
        drop(client);
        server.join().expect("it ends").expect("it is taken");
    }

    #[test]
    fn a_request_is_taken_apart() {
        assert_eq!(asked("get /stream?token=7 http/1.1\r\n\r\n"), Some(("/stream", "token=7")));
        assert_eq!(asked("get / http/1.1\r\n\r\n"), Some(("/", "")));
        assert_eq!(asked("post / http/1.1\r\n\r\n"), None);
        assert!(is_upgrade("get / http/1.1\r\nupgrade: websocket\r\n\r\n"));
        assert!(!is_upgrade("get / http/1.1\r\nx-upgrade: websocket\r\n\r\n"));
    }
}
