//! What lies between the thread that simulates and the one that draws: the newest state, the scene, words. Locks are held for the time
//! that it takes to replace a pointer.

use crate::report::frames::{SkinSurface, caption, tool_positions};
use crate::scene::Scene;
use crate::session::audience::lock;
use crate::session::{Audience, Command, Figures, Read, Shown};
use eframe::egui;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// A state to draw.
pub struct Shot {
    /// Surface of the deformable bodies.
    pub skin: SkinSurface,
    /// What was asked for beside it.
    pub read: Read,
    /// `[tool][vertex]` m
    pub tools: Vec<Vec<[f64; 3]>>,
    /// `[tool]` position of the hand, m
    pub hands: Vec<[f64; 3]>,
    /// `[contact]` point, m, and force, N
    pub contacts: Vec<[[f64; 3]; 2]>,
    /// Figures of the last steps.
    pub figures: Figures,
    /// What stands on a saved picture.
    pub caption: Vec<String>,
}

/// A scene that has begun, with its present values.
pub struct Begun {
    /// The scene.
    pub scene: Scene,
    /// `[tool]` whether the mouse may hold it
    pub held: Vec<bool>,
}

/// See the module.
#[derive(Default)]
pub struct Link {
    shot: Mutex<Option<Box<Shot>>>,
    begun: Mutex<Option<Begun>>,
    words: Mutex<Vec<String>>,
    /// Time from which the next state would be looked at; none while the last one is not drawn yet.
    ready: Mutex<Option<Instant>>,
    pictures: AtomicU64,
    /// Bits of the scene's time, s.
    time: AtomicU64,
    ended: AtomicBool,
    /// What draws, once there is a window.
    pub context: OnceLock<egui::Context>,
    /// First error of the device that draws.
    pub fault: Mutex<Option<String>>,
}

impl Link {
    /// The newest state, if it has not been taken yet.
    pub fn take_shot(&self) -> Option<Box<Shot>> {
        lock(&self.shot).take()
    }

    /// The scene, if it has begun (anew).
    pub fn take_begun(&self) -> Option<Begun> {
        lock(&self.begun).take()
    }

    /// Words for the one who watches.
    pub fn take_words(&self) -> Vec<String> {
        std::mem::take(&mut *lock(&self.words))
    }

    /// What was taken is drawn: the next state would be looked at after some time.
    pub fn is_drawn(&self, after: Duration) {
        self.pictures.fetch_add(1, Ordering::Relaxed);
        *lock(&self.ready) = Some(Instant::now() + after);
    }

    /// Number of pictures drawn so far.
    pub fn pictures(&self) -> u64 {
        self.pictures.load(Ordering::Relaxed)
    }

    /// Time of the newest state, s.
    pub fn time(&self) -> f64 {
        f64::from_bits(self.time.load(Ordering::Relaxed))
    }

    /// Keeps the first error of the device and closes the window.
    pub fn fail(&self, message: String) {
        lock(&self.fault).get_or_insert(message);
        self.end();
    }

    /// Whether the window is to close.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    fn end(&self) {
        self.ended.store(true, Ordering::Release);
        self.wake();
    }

    fn wake(&self) {
        if let Some(context) = self.context.get() {
            context.request_repaint();
        }
    }
}

/// The window, as the session sees it.
pub struct Screen {
    commands: Receiver<(u64, Command)>,
    link: Arc<Link>,
    scene: Option<Scene>,
}

impl Screen {
    /// The session's side of a link.
    pub fn new(commands: Receiver<(u64, Command)>, link: Arc<Link>) -> Self {
        Self { commands, link, scene: None }
    }
}

impl Audience for Screen {
    fn commands(&self) -> &Receiver<(u64, Command)> {
        &self.commands
    }

    fn watchers(&self) -> usize {
        1
    }

    fn is_ready(&self) -> bool {
        lock(&self.link.ready).is_some_and(|ready| ready <= Instant::now())
    }

    fn begin(&mut self, scene: &Scene, held: &[bool]) {
        self.scene = Some(scene.clone());
        *lock(&self.link.begun) = Some(Begun { scene: scene.clone(), held: held.to_vec() });
    }

    fn show(&mut self, shown: Shown) {
        let Some(scene) = &self.scene else { return };
        let contact = &shown.report.contact;
        let forces = contact.contacts.iter().zip(&contact.forces);
        let shot = Shot {
            tools: tool_positions(scene, shown.simulation),
            hands: shown.hands.to_vec(),
            contacts: forces.map(|(at, force)| [at.point.to_array(), at.in_world(*force).to_array()]).collect(),
            caption: caption(scene, shown.simulation, shown.report),
            skin: shown.surface,
            read: shown.read,
            figures: shown.figures,
        };
        self.link.time.store(shot.figures.time_s.to_bits(), Ordering::Relaxed);
        *lock(&self.link.ready) = None;
        // the old one is dropped without the lock
        let old = lock(&self.link.shot).replace(Box::new(shot));
        drop(old);
        self.link.wake();
    }

    fn refuse(&mut self, _: Option<u64>, words: &str) {
        lock(&self.link.words).push(words.into());
        self.link.wake();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.link.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::{self, Motion};
    use crate::step::Platform;
    use std::sync::mpsc::sync_channel;

    #[test]
    fn a_window_that_draws_nothing_holds_no_step_up() {
        let scene = crate::scene::incision().expect("the built-in scene").in_test_form();
        let (sender, commands) = sync_channel(8);
        let (link, interrupt) = (Arc::new(Link::default()), Arc::new(AtomicBool::new(false)));
        let options = session::Options { platform: Platform::Cpu64, paused: false, interrupt: interrupt.clone() };
        let shot = |what: &str| {
            let begun = Instant::now();
            loop {
                match link.take_shot() {
                    Some(shot) => break shot,
                    None => assert!(begun.elapsed() < Duration::from_secs(120), "{what}"),
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        let mut screen = Screen::new(commands, link.clone());
        std::thread::scope(|scope| {
            let thread = scope.spawn(|| session::run(&scene, &options, &mut screen, Motion::default(), &mut || {}));
            assert_eq!(shot("the beginning").figures.time_s, 0.0);
            // nothing is drawn: no state is read for a picture, and the steps go on
            std::thread::sleep(Duration::from_millis(600));
            assert!(link.take_shot().is_none(), "a picture that nobody waits for");
            sender.send((0, Command::Pause)).expect("a session that listens");
            let stands = shot("the pause");
            assert!(!stands.figures.playing && stands.figures.time_s > 4.5 * scene.time.step, "{:?}", stands.figures);
            // drawn: the next one comes
            link.is_drawn(Duration::ZERO);
            sender.send((0, Command::Play)).expect("a session that listens");
            assert!(shot("the next").figures.time_s > stands.figures.time_s);
            interrupt.store(true, Ordering::Release);
            assert!(thread.join().expect("a session that does not panic").is_ok());
        });
        assert!(!link.has_ended(), "the screen is still there");
    }
}
