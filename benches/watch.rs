//! What watching costs the one who is watched: the incision by a session whose pictures nobody takes, drawn as the window draws them, and
//! packed as for a page. Each is timed to the same time of the scene, as fast as it goes, in turn; a thread draws on the adapter beside the
//! one that simulates, and each picture is waited for. Checks the pictures first: skin must be seen, and a wound at the end. Prints the table
//! of `benches/results/two_cores/watch.md`.

use cutis::gpu::Gpu;
use cutis::report::frames::{Look, SkinSurface, camera, tool_positions, with_surfaces};
use cutis::scene::{Scene, incision};
use cutis::serve::wire::Vertices;
use cutis::session::{self, Audience, Command, Motion, Shown};
use cutis::step::Platform;
use cutis::view::{Drawn, Effort, Image, Renderer};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Time of the scene to which each run goes, s: through the first cuts.
const UNTIL: f64 = 0.6;
/// Runs of each kind.
const RUNS: usize = 5;
/// Pixels of the picture in a window as it opens; on the processor's own cores half of it each way while it runs.
const SIZE: [u32; 2] = [890, 800];
/// Time between two pictures of those cores: the window's.
const BETWEEN: Duration = Duration::from_millis(80);

/// Who watches.
#[derive(Clone, Copy, PartialEq)]
enum Watcher {
    Nobody,
    Window,
    Page,
}

/// What is handed from the thread that simulates to the one that draws.
type Slot = Mutex<Option<(SkinSurface, Vec<Vec<[f64; 3]>>)>>;

struct Watching<'a> {
    watcher: Watcher,
    scene: &'a Scene,
    commands: Receiver<(u64, Command)>,
    slot: &'a Slot,
    ready: &'a Mutex<Option<Instant>>,
    packed: &'a AtomicUsize,
}

impl Audience for Watching<'_> {
    fn commands(&self) -> &Receiver<(u64, Command)> {
        &self.commands
    }

    fn watchers(&self) -> usize {
        1
    }

    fn is_ready(&self) -> bool {
        let ready = *self.ready.lock().unwrap_or_else(PoisonError::into_inner);
        self.watcher != Watcher::Nobody && ready.is_some_and(|ready| ready <= Instant::now())
    }

    fn begin(&mut self, _: &Scene, _: &[bool]) {}

    fn show(&mut self, shown: Shown) {
        match self.watcher {
            Watcher::Nobody => {}
            Watcher::Window => {
                let tools = tool_positions(self.scene, shown.simulation);
                *self.ready.lock().unwrap_or_else(PoisonError::into_inner) = None;
                *self.slot.lock().unwrap_or_else(PoisonError::into_inner) = Some((shown.surface, tools));
            }
            Watcher::Page => {
                let vertices = Vertices::new(&shown.surface, self.scene);
                let bytes = vertices.message(1, &shown.surface).len() + vertices.frame([1, 1], &shown).len();
                assert!(bytes > 10_000, "the surface is packed");
                self.packed.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    fn refuse(&mut self, _: Option<u64>, words: &str) {
        panic!("the session refuses: {words}");
    }
}

/// Shares of pixels that are skin, and a wound's rim.
fn seen(image: &Image) -> [f64; 2] {
    let pixels = || image.rgb.chunks_exact(3);
    let share = |count: usize| count as f64 / pixels().len() as f64;
    let skin = pixels().filter(|p| u32::from(p[0]) > u32::from(p[2]) + 40).count();
    let rim = pixels().filter(|p| p[1] < 55 && p[2] < 55 && p[0] > p[1] + 50).count();
    [share(skin), share(rim)]
}

/// Time to the end, s, and pictures per second.
fn timed(scene: &Scene, watcher: Watcher, renderer: &mut Renderer, on_cores: bool) -> [f64; 2] {
    let size = if on_cores { SIZE.map(|side| side / 2) } else { SIZE };
    let (sender, commands): (SyncSender<(u64, Command)>, _) = sync_channel(8);
    let (slot, ready, packed) = (Slot::default(), Mutex::new(Some(Instant::now())), AtomicUsize::new(0));
    let (motion, interrupt) = (Motion::default(), Arc::new(AtomicBool::new(false)));
    let options = session::Options { platform: Platform::Cpu64, paused: true, interrupt: interrupt.clone() };
    let mut watching = Watching { watcher, scene, commands, slot: &slot, ready: &ready, packed: &packed };
    let (recorded, began) = (motion.clone(), AtomicBool::new(false));
    let mut pictures = 0;
    let time = thread::scope(|scope| {
        scope.spawn(|| {
            session::run(scene, &options, &mut watching, motion, &mut || began.store(true, Ordering::Release))
                .expect("the scene runs");
        });
        while !began.load(Ordering::Acquire) {
            thread::sleep(Duration::from_millis(1));
        }
        sender.send((0, Command::Speed(10.0))).expect("a session that listens");
        sender.send((0, Command::Play)).expect("a session that listens");
        let start = Instant::now();
        let at = || {
            let rows = recorded.lock().unwrap_or_else(PoisonError::into_inner);
            rows[0].last().map_or(0.0, |row| row[0])
        };
        while at() < UNTIL {
            let taken = slot.lock().unwrap_or_else(PoisonError::into_inner).take();
            let Some((skin, tools)) = taken else {
                thread::sleep(Duration::from_millis(1));
                continue;
            };
            let begun = Instant::now();
            with_surfaces(scene, &skin, &tools, &Look::default(), |bodies, tools| {
                renderer.load(&Drawn { clipped: bodies, whole: tools, in_front: &[] })
            });
            renderer.draw(&camera(scene), size, None);
            let [skin, _] = seen(&renderer.read().expect("the adapter draws"));
            assert!(skin > 0.1, "skin is seen on {skin} of the picture");
            pictures += 1;
            let took = begun.elapsed();
            let rest = if on_cores { took.max(BETWEEN.saturating_sub(took)) } else { Duration::ZERO };
            *ready.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now() + rest);
        }
        let time = start.elapsed().as_secs_f64();
        interrupt.store(true, Ordering::Release);
        time
    });
    if watcher == Watcher::Window {
        let [_, rim] = seen(&renderer.read().expect("the adapter draws"));
        assert!(rim > 1e-4, "a wound is seen on {rim} of the last picture");
    }
    let count = if watcher == Watcher::Page { packed.load(Ordering::Relaxed) } else { pictures };
    [time, count as f64 / time]
}

fn main() {
    let scene = incision().expect("the built-in scene");
    let gpu = Gpu::open(None).expect("an adapter that draws");
    let (device, queue) = gpu.handles();
    let on_cores = gpu.adapter.software;
    let effort = if on_cores { Effort::Light } else { Effort::Full };
    let mut renderer = Renderer::new(device, queue, effort);
    println!("CPU path, f64; pictures by {}\n", gpu.adapter.name);
    let watchers = [Watcher::Nobody, Watcher::Window, Watcher::Page];
    let mut found = watchers.map(|_| vec![]);
    for _ in 0..RUNS {
        for (k, watcher) in watchers.into_iter().enumerate() {
            found[k].push(timed(&scene, watcher, &mut renderer, on_cores));
        }
    }
    println!("| watched by | time to the same state, nobody = 1: median (least to most) | pictures per second |");
    println!("|---|---|---|");
    for (k, name) in ["nobody", "a window", "a page"].into_iter().enumerate() {
        let mut ratios: Vec<f64> = (0..RUNS).map(|run| found[k][run][0] / found[0][run][0]).collect();
        let mut rates: Vec<f64> = found[k].iter().map(|run| run[1]).collect();
        ratios.sort_by(f64::total_cmp);
        rates.sort_by(f64::total_cmp);
        let middle = RUNS / 2;
        println!(
            "| {name} | {:.2} ({:.2} to {:.2}) | {:.1} |",
            ratios[middle],
            ratios[0],
            ratios[RUNS - 1],
            rates[middle]
        );
    }
}
