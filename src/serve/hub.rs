//! The server: one embedded page over HTTP, and a WebSocket for each page that is open.
//!
//! A page gets the newest frame only, and the next one once it has drawn what it has: a slow one gets fewer frames, and nothing piles up.
//! Commands go to the session through a bounded queue. By default the server listens on this machine's own interface and answers no page
//! of another site; on another interface a page needs the token of the printed address.

use super::Refused;
use super::wire::LONGEST;
use crate::error::Result;
use crate::http::{self, Door, PATIENCE};
use crate::session::audience::{Command, MOST_COMMANDS, Motion, lock, trajectory};
use std::collections::VecDeque;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

/// The page: markup, style and script in one.
const PAGE: &str = include_str!("page.html");

/// Most connections at once.
const MOST_CLIENTS: usize = 16;
/// Texts that wait for a page; beyond, the oldest goes.
const MOST_TEXTS: usize = 16;
/// Messages that are no commands after which a page is disconnected.
const MOST_FAULTS: u32 = 100;
/// Frames on their way to a page that it has not drawn yet.
const AHEAD: u32 = 2;
/// Longest time before a new frame is noticed, and between looks for a stop.
const SLICE: Duration = Duration::from_millis(4);

/// A picture's data, shared by all pages.
#[derive(Clone)]
pub struct Frame {
    /// Number of the frame, from 1.
    pub number: u32,
    /// Number of the surface that it moves.
    pub surface: u32,
    /// The surface's message.
    pub shape: Arc<[u8]>,
    /// The frame's message.
    pub motion: Arc<[u8]>,
    /// Figures of the state, JSON.
    pub figures: Arc<str>,
}

/// What waits for one page.
#[derive(Default)]
struct Mailbox {
    frame: Option<Frame>,
    texts: VecDeque<Arc<str>>,
}

struct Client {
    number: u64,
    mailbox: Mutex<Mailbox>,
}

struct Shared {
    token: Option<String>,
    stop: Arc<AtomicBool>,
    commands: SyncSender<(u64, Command)>,
    rooms: Mutex<Rooms>,
    motion: Motion,
}

#[derive(Default)]
struct Rooms {
    clients: Vec<Arc<Client>>,
    invited: u64,
    /// The scene, JSON, and the newest frame: what a page that joins gets first.
    scene: Option<Arc<str>>,
    newest: Option<Frame>,
}

/// Server that runs until it is dropped.
pub struct Hub {
    door: Door, // first: the threads of the pages end before what they use
    shared: Arc<Shared>,
    commands: Receiver<(u64, Command)>,
}

/// 128 random bits by the keys that the standard library takes from the system.
fn token() -> String {
    let word = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", word(), word())
}

impl Hub {
    /// Starts listening; 0 is any free port.
    ///
    /// # Errors
    /// [`Refused::Port`].
    pub fn start(wanted: SocketAddr) -> Result<Self> {
        let refused = |source: io::Error| Refused::Port { address: wanted, source };
        let listener = TcpListener::bind(wanted).map_err(refused)?;
        let (sender, commands) = sync_channel(MOST_COMMANDS);
        let shared = Arc::new(Shared {
            token: (!wanted.ip().is_loopback()).then(token),
            stop: Arc::default(),
            commands: sender,
            rooms: Mutex::default(),
            motion: Motion::default(),
        });
        let inside = shared.clone();
        let receive = move |stream, _| inside.receive(stream);
        let door = Door::open("serve", listener, MOST_CLIENTS, &shared.stop, receive).map_err(refused)?;
        Ok(Self { door, shared, commands })
    }

    /// Address for a browser, with the token where one is needed.
    pub fn url(&self) -> String {
        match &self.shared.token {
            None => format!("http://{}/", self.door.address()),
            Some(token) => format!("http://{}/?token={token}", self.door.address()),
        }
    }

    /// Commands in the order of their arrival, with the number of the page that sent them.
    pub fn commands(&self) -> &Receiver<(u64, Command)> {
        &self.commands
    }

    /// Number of pages that are open.
    pub fn clients(&self) -> usize {
        lock(&self.shared.rooms).clients.len()
    }

    /// Has every page begin with this scene, JSON.
    pub fn set_scene(&self, scene: &str) {
        let scene: Arc<str> = scene.into();
        let rooms = &mut *lock(&self.shared.rooms);
        rooms.scene = Some(scene.clone());
        rooms.newest = None;
        rooms.clients.iter().for_each(|client| client.tell(scene.clone()));
    }

    /// Shows a frame to all pages.
    pub fn show(&self, frame: Frame) {
        let rooms = &mut *lock(&self.shared.rooms);
        rooms.clients.iter().for_each(|client| lock(&client.mailbox).frame = Some(frame.clone()));
        rooms.newest = Some(frame);
    }

    /// Sends a text to a page, or with `None` to all.
    pub fn tell(&self, to: Option<u64>, text: &str) {
        let text: Arc<str> = text.into();
        let rooms = lock(&self.shared.rooms);
        let named = rooms.clients.iter().filter(|client| to.is_none_or(|number| number == client.number));
        named.for_each(|client| client.tell(text.clone()));
    }

    /// Motion of the hands, which `/motion.csv` answers.
    pub fn motion(&self) -> Motion {
        self.shared.motion.clone()
    }
}

impl Client {
    fn tell(&self, text: Arc<str>) {
        let texts = &mut lock(&self.mailbox).texts;
        if texts.len() == MOST_TEXTS {
            texts.pop_front();
        }
        texts.push_back(text);
    }
}

impl Shared {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Whether a request may be answered: without a token those of this machine, otherwise those that have it.
    fn admits(&self, head: &str, query: &str) -> bool {
        match &self.token {
            None => http::is_local(head) && http::is_same_origin(head),
            Some(token) => {
                http::is_same_origin(head) && query.split('&').any(|p| p.strip_prefix("token=") == Some(token))
            }
        }
    }

    /// Serves a WebSocket or an HTTP request.
    fn receive(&self, mut stream: TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let head = http::head(&mut stream)?;
        let (path, query) = http::asked(&head).unwrap_or_default();
        let admitted = self.admits(&head, query);
        if !(admitted && path == "/stream" && http::is_upgrade(&head)) {
            let own = "this server answers pages of its own machine, or with the token of the printed address";
            return match path {
                _ if !admitted => http::refuse(&mut stream, "403 Forbidden", own),
                "/" => http::answer(&mut stream, "200 OK", "text/html; charset=utf-8", PAGE.as_bytes()),
                "/motion.csv" => {
                    let table = self.motion_of(query);
                    http::answer(&mut stream, "200 OK", "text/csv", table.as_bytes())
                }
                _ => http::refuse(&mut stream, "404 Not Found", "there are /, /stream and /motion.csv"),
            };
        }
        let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
        let socket = tungstenite::accept_with_config(stream, Some(config)).map_err(io::Error::other)?;
        socket.get_ref().set_read_timeout(Some(SLICE))?;
        let client = self.invite();
        self.talk(socket, &client);
        lock(&self.rooms).clients.retain(|other| other.number != client.number);
        Ok(())
    }

    /// Recorded motion of a tool (`tool=NUMBER`, otherwise the first one) as a trajectory that a scene reads.
    fn motion_of(&self, query: &str) -> String {
        let asked = query.split('&').find_map(|part| part.strip_prefix("tool=")?.parse().ok()).unwrap_or(0);
        trajectory(&self.motion, asked)
    }

    fn invite(&self) -> Arc<Client> {
        let rooms = &mut *lock(&self.rooms);
        rooms.invited += 1;
        let mailbox = Mailbox { frame: rooms.newest.clone(), texts: rooms.scene.iter().cloned().collect() };
        let client = Arc::new(Client { number: rooms.invited, mailbox: Mutex::new(mailbox) });
        rooms.clients.push(client.clone());
        client
    }

    /// Takes commands and sends what waits, until one of both leaves.
    fn talk(&self, mut socket: WebSocket<TcpStream>, client: &Client) {
        let (mut sent, mut drawn, mut has, mut faults) = (0u32, 0u32, 0u32, 0);
        while !self.stopped() {
            let fault = match socket.read() {
                Ok(Message::Text(text)) => match Command::read(&text) {
                    Ok(Command::Drawn(count)) => {
                        drawn = count;
                        None
                    }
                    Ok(command) => self.pass(client.number, command).err(),
                    Err(words) => Some(words),
                },
                Ok(Message::Binary(_)) => Some("no command: binary".into()),
                Ok(Message::Close(_)) => return,
                Ok(_) => None,
                Err(tungstenite::Error::Io(e)) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    None
                }
                Err(_) => return,
            };
            if let Some(words) = fault {
                faults += 1;
                if faults > MOST_FAULTS {
                    break;
                }
                client.tell(serde_json::json!({ "error": words }).to_string().into());
            }
            // texts, then the newest frame if the page keeps up; its surface first if that is new to the page
            let (texts, frame) = {
                let mailbox = &mut *lock(&client.mailbox);
                let keeps_up = sent.wrapping_sub(drawn) < AHEAD;
                (std::mem::take(&mut mailbox.texts), if keeps_up { mailbox.frame.take() } else { None })
            };
            let mut messages: Vec<Message> = texts.iter().map(|text| Message::text(&**text)).collect();
            if let Some(frame) = frame {
                sent += 1;
                if has != frame.surface {
                    has = frame.surface;
                    messages.push(Message::binary(frame.shape.to_vec()));
                }
                messages.extend([Message::binary(frame.motion.to_vec()), Message::text(&*frame.figures)]);
            }
            if messages.into_iter().any(|message| socket.send(message).is_err()) {
                return;
            }
        }
        socket.close(None).and_then(|()| socket.flush()).ok();
    }

    fn pass(&self, client: u64, command: Command) -> std::result::Result<(), String> {
        self.commands.try_send((client, command)).map_err(|error| match error {
            TrySendError::Full(_) => "too many commands wait; send fewer".into(),
            TrySendError::Disconnected(_) => "the session has ended".into(),
        })
    }
}
