//! `cutis view` from outside: what it says without a window, and the window itself, driven as a person drives it.

use std::process::Command;

fn cutis(words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cutis"));
    command.args(words).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    command
}

#[cfg(not(feature = "view"))]
#[test]
fn a_program_without_its_window_says_how_to_build_it() {
    let said = cutis(&["view"]).output().expect("the program");
    let words = String::from_utf8_lossy(&said.stderr);
    assert_eq!(said.status.code(), Some(2), "{words}");
    assert!(words.starts_with("error: ") && words.contains("--features view"), "{words}");
}

#[cfg(feature = "view")]
mod window {
    use super::cutis;
    use std::cell::Cell;
    use std::io::{BufRead, BufReader};
    use std::path::{Path, PathBuf};
    use std::process::{Child, Command, Stdio};
    use std::time::{Duration, Instant};

    /// Longest wait for anything; a loaded machine takes its time.
    const LONG: Duration = Duration::from_secs(240);
    /// Wait for what an act should do, before it is done again.
    const WHILE: Duration = Duration::from_secs(4);
    /// The button of the scalpel, and the colour of a tool that is in hand.
    const SCALPEL: (usize, usize) = (950, 155);
    const TAKEN: [u8; 3] = [144, 209, 255];

    #[cfg(target_os = "linux")]
    #[test]
    fn without_a_display_there_are_words_and_no_window() {
        let said = cutis(&["view", "--backend", "cpu"]).output().expect("the program");
        let words = String::from_utf8_lossy(&said.stderr);
        assert_eq!(said.status.code(), Some(1), "{words}");
        let error = words.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
        assert!(error.contains("needs a display") && error.contains("cutis serve"), "{words}");
        // a scene that cannot be is said before
        let said = cutis(&["view", "missing.toml"]).output().expect("the program");
        assert_eq!(said.status.code(), Some(2));
    }

    /// Ends a program with the test.
    struct Running(Child);

    impl Drop for Running {
        fn drop(&mut self) {
            self.0.kill().ok();
            self.0.wait().ok();
        }
    }

    /// A screen without a monitor.
    struct Screen {
        _server: Running,
        display: String,
        folder: PathBuf,
        /// Pictures that the window has saved.
        pictures: Cell<u32>,
    }

    impl Screen {
        fn start(folder: &Path) -> Self {
            let mut server = Command::new("Xvfb");
            // without `-noreset` it starts anew when its last client leaves, and turns away one that comes meanwhile
            server.args(["-noreset", "-displayfd", "1", "-screen", "0", "1240x800x24", "-fbdir"]).arg(folder);
            let mut server = server.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("Xvfb");
            let out = server.stdout.take().expect("its output");
            let server = Running(server);
            let mut number = String::new();
            BufReader::new(out).read_line(&mut number).expect("the number of the display");
            Self {
                _server: server,
                display: format!(":{}", number.trim()),
                folder: folder.into(),
                pictures: Cell::new(0),
            }
        }

        fn told(&self, words: &str) -> Result<(), String> {
            let done = Command::new("xdotool").args(words.split(' ')).env("DISPLAY", &self.display).output();
            let done = done.expect("xdotool");
            let said = String::from_utf8_lossy(&done.stderr);
            if done.status.success() { Ok(()) } else { Err(format!("{words}: {said}")) }
        }

        /// Mouse and keys, in `xdotool`'s words.
        fn act(&self, words: &str) {
            self.told(words).unwrap_or_else(|said| panic!("{said}"));
            std::thread::sleep(Duration::from_millis(120));
        }

        /// Gives the window the keys; one that is not shown yet refuses them.
        fn focus(&self) {
            until("a window that takes the keys", || self.told("search --name cutis: windowfocus").is_ok());
        }

        /// What is on the screen, `[pixel]` RGB: the frame buffer is a file of the X window dump format.
        fn pixels(&self) -> Vec<[u8; 3]> {
            let bytes = std::fs::read(self.folder.join("Xvfb_screen0")).expect("the frame buffer");
            let word = |k: usize| u32::from_be_bytes(bytes[4 * k..4 * k + 4].try_into().expect("four bytes")) as usize;
            // header size, colours of 12 bytes, then rows of blue, green, red, none
            let from = word(0) + 12 * word(19);
            assert_eq!((word(4), word(5), word(11)), (1240, 800, 32), "width, height, bits of a pixel");
            bytes[from..from + 4 * 1240 * 800].chunks_exact(4).map(|p| [p[2], p[1], p[0]]).collect()
        }

        /// The picture in the window, saved by its key: everything that was done before is in it.
        fn picture(&self) -> Vec<[u8; 3]> {
            self.pictures.set(self.pictures.get() + 1);
            self.act("key p");
            let path = self.folder.join(format!("view_{:04}.png", self.pictures.get()));
            until("a saved picture", || path.exists());
            saved(&path)
        }

        /// Drags from place to place, each of them seen by the window before the next; the picture after it.
        fn drag(&self, places: &[&str]) -> Vec<[u8; 3]> {
            for (k, at) in places.iter().enumerate() {
                self.act(&format!("mousemove {at}"));
                if k == 0 {
                    self.act("mousedown 1");
                }
                self.picture();
            }
            self.act("mouseup 1");
            self.picture()
        }

        /// Clicks on a place; the picture after it.
        fn clicked(&self, at: &str) -> Vec<[u8; 3]> {
            self.act(&format!("mousemove {at}"));
            self.act("click 1");
            self.picture()
        }

        /// Clicks until it is done; a slow machine has taken some clicks for a press of long.
        fn click(&self, what: &str, at: &str, done: impl Fn() -> bool) {
            self.act(&format!("mousemove {at}"));
            until(what, || {
                self.act("click 1");
                let begun = Instant::now();
                while !done() && begun.elapsed() < WHILE {
                    std::thread::sleep(Duration::from_millis(50));
                }
                done()
            });
        }

        /// Whether the scalpel is in hand: around the words on its button.
        fn has_scalpel(&self) -> bool {
            let pixels = self.pixels();
            (SCALPEL.0 - 60..SCALPEL.0 + 60).any(|x| pixels[1240 * SCALPEL.1 + x] == TAKEN)
        }

        fn save(&self, name: &str) {
            let rgb = self.pixels().concat();
            let image = cutis::view::Image { width: 1240, height: 800, rgb, skipped: 0 };
            std::fs::write(self.folder.join(name), cutis::view::png(&image).expect("a picture")).expect("a file");
        }
    }

    fn until(what: &str, holds: impl Fn() -> bool) {
        let begun = Instant::now();
        while !holds() {
            assert!(begun.elapsed() < LONG, "{what}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Share of pixels that are skin, or wet with blood: much redder than blue.
    fn red(pixels: &[[u8; 3]]) -> f64 {
        pixels.iter().filter(|[r, _, b]| u32::from(*r) > u32::from(*b) + 40).count() as f64 / pixels.len() as f64
    }

    /// Share of pixels of a wound's rim: the reddest.
    fn wound(pixels: &[[u8; 3]]) -> f64 {
        let of_rim = |[r, g, b]: &&[u8; 3]| *g < 55 && *b < 55 && *r > *g + 50;
        pixels.iter().filter(of_rim).count() as f64 / pixels.len() as f64
    }

    /// Share of a picture that the rim of a wound of some millimetres has at least.
    const WOUND: f64 = 3e-4;

    /// Takes pictures until one is as it is wanted.
    fn wait(what: &str, picture: &mut dyn FnMut() -> Vec<[u8; 3]>, mut holds: impl FnMut(&[[u8; 3]]) -> bool) {
        let begun = Instant::now();
        while !holds(&picture()) {
            assert!(begun.elapsed() < LONG, "{what}");
        }
    }

    /// Pixels of a picture that the window has saved.
    fn saved(path: &Path) -> Vec<[u8; 3]> {
        let mut reader = png::Decoder::new(BufReader::new(std::fs::File::open(path).expect("a picture")))
            .read_info()
            .expect("a PNG");
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        reader.next_frame(&mut bytes).expect("a frame");
        bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
    }

    /// Number of pictures of a film, and their time, s.
    fn filmed(path: &Path) -> (u32, f64) {
        let mut reader =
            png::Decoder::new(BufReader::new(std::fs::File::open(path).expect("a film"))).read_info().expect("a PNG");
        let count = reader.info().animation_control().expect("an animated PNG").num_frames;
        let mut bytes = vec![0; reader.output_buffer_size().expect("a size")];
        let mut seconds = 0.0;
        for _ in 0..count {
            reader.next_frame(&mut bytes).expect("a picture");
            let control = reader.info().frame_control().expect("its time");
            seconds += f64::from(control.delay_num) / f64::from(control.delay_den);
        }
        (count, seconds)
    }

    fn differing(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
        let other = |(a, b): &(&[u8; 3], &[u8; 3])| (0..3).any(|k| a[k].abs_diff(b[k]) > 12);
        a.iter().zip(b).filter(other).count() as f64 / a.len() as f64
    }

    /// The window on a screen of its own, as a person has it, where `CUTIS_WINDOW` names a folder for its pictures; needs Xvfb and xdotool.
    #[test]
    fn a_person_presses_and_cuts_in_a_window() {
        let Some(folder) = std::env::var_os("CUTIS_WINDOW").map(PathBuf::from) else {
            println!("left out: CUTIS_WINDOW names no folder for pictures");
            return;
        };
        for n in 1..999 {
            for name in [format!("view_{n:04}.png"), format!("film_{n:04}.png"), format!("motion_{n:04}.csv")] {
                std::fs::remove_file(folder.join(name)).ok();
            }
        }
        let screen = Screen::start(&folder);
        let mut command = cutis(&["view", "--backend", "cpu", "--paused", "--out"]);
        let window = command.arg(&folder).env("DISPLAY", &screen.display).stdout(Stdio::piped()).spawn();
        let mut window = Running(window.expect("the program"));
        until("the patch is on the screen", || red(&screen.pixels()) > 0.1);
        // without a driver there is no picture
        let mut blind = cutis(&["view", "--backend", "cpu"]);
        blind.env("DISPLAY", &screen.display).env("VK_DRIVER_FILES", "none").env("VK_ICD_FILENAMES", "none");
        let said = blind.output().expect("the program");
        let words = String::from_utf8_lossy(&said.stderr);
        assert!(said.status.code() == Some(3) && words.contains("no usable GPU adapter"), "{words}");
        screen.focus();
        screen.act("mousemove 300 600");
        let whole = screen.picture();
        assert!(red(&whole) > 0.1 && wound(&whole) == 0.0, "{} {}", red(&whole), wound(&whole));
        screen.save("screen_1.png");
        // it runs: the recorded hand cuts
        screen.act("key f");
        screen.act("key space");
        wait("a wound", &mut || screen.picture(), |picture| wound(picture) > WOUND);
        screen.act("key space");
        // it stands still: two pictures are one
        let mut cut = screen.picture();
        wait("it stands still", &mut || screen.picture(), |next| {
            let apart = differing(&cut, next);
            cut = next.to_vec();
            apart == 0.0
        });
        screen.save("screen_2.png");
        // a film of it, and the motion of the hand so far
        screen.act("key f");
        let film = folder.join("film_0001.png");
        until("a film", || film.exists());
        let (count, seconds) = filmed(&film);
        assert!(count > 5 && (1.0..120.0).contains(&seconds), "{count} pictures, {seconds} s");
        let motion = folder.join("motion_0001.csv");
        screen.click("the hand's motion", "1109 76", || motion.exists());
        let table = std::fs::read_to_string(&motion).expect("a table");
        assert!(table.starts_with("time_s,x_mm") && table.lines().count() > 20, "{table}");
        screen.act("mousemove 300 600");
        // cut open by the slider, in the colours of a quantity over cells, and back
        let open = |open: &[[u8; 3]]| differing(&cut, open) > 0.05 && red(open) > 0.05;
        wait("it is cut open", &mut || screen.drag(&["904 403", "950 403"]), open);
        screen.save("screen_5.png");
        wait("the colours of von Mises' stress", &mut || screen.clicked("935 356"), |colored| red(colored) < 0.02);
        screen.save("screen_6.png");
        wait("the colours of layers", &mut || screen.clicked("973 333"), |layered| red(layered) > 0.05);
        wait("it is whole", &mut || screen.drag(&["950 403", "880 403"]), |whole| differing(&cut, whole) == 0.0);
        // dragging turns the view
        let mut turn = || screen.drag(&["300 600", "360 640", "420 600"]);
        wait("the view is turned", &mut turn, |turned| differing(&cut, turned) > 0.1);
        screen.save("screen_3.png");
        // anew, with the scalpel in hand: it waits above the skin, where the recorded one has cut by then
        wait("the skin is whole", &mut || screen.clicked("1015 53"), |picture| wound(picture) == 0.0);
        screen.click("the scalpel in hand", &format!("{} {}", SCALPEL.0, SCALPEL.1), || screen.has_scalpel());
        screen.act("mousemove 400 500");
        screen.act("key space");
        std::thread::sleep(Duration::from_secs(6));
        assert_eq!(wound(&screen.picture()), 0.0);
        // down by the wheel, along with the button
        (0..26).for_each(|_| screen.act("click 5"));
        screen.act("mousedown 1");
        (0..30).for_each(|_| screen.act("mousemove_relative -- 6 -3"));
        wait("a wound by hand", &mut || screen.picture(), |picture| wound(picture) > WOUND);
        screen.save("screen_4.png");
        screen.act("mouseup 1");
        // a signal ends it with its status
        let killed = Command::new("kill").args(["-TERM", &window.0.id().to_string()]).status();
        assert!(killed.is_ok_and(|status| status.success()), "kill");
        let status = window.0.wait().expect("an end");
        assert_eq!(status.code(), Some(143));
        let mut said = String::new();
        BufReader::new(window.0.stdout.take().expect("its output")).read_line(&mut said).expect("a line");
        assert!(said.contains(" pictures in "), "{said}");
        // closed by the one who watches: all is well
        let mut command = cutis(&["view", "--backend", "cpu"]);
        let window = command.env("DISPLAY", &screen.display).stdout(Stdio::null()).spawn().expect("the program");
        let mut window = Running(window);
        screen.focus();
        until("it draws", || red(&screen.pixels()) > 0.1);
        screen.act("mousemove 500 300 key ctrl+q");
        assert_eq!(window.0.wait().expect("an end").code(), Some(0));
    }
}
