//! The window: a picture of the newest state with its overlays, the mouse and the keys as a hand, saved pictures.

use super::link::Link;
use super::orbit::Orbit;
use super::overlays::{Arrows, BLUE, Opened};
#[cfg(feature = "gamepad")]
use super::pad::{self, Pad};
use super::panel;
use super::state::{Shows, State, WORDS};
use crate::error::Result;
use crate::output::{Failed, replace};
use crate::report::film::Filming;
use crate::report::frames::{Look, camera, with_surfaces};
use crate::session::audience::trajectory;
use crate::session::{Command, Motion, Values};
use crate::view::{self, Clip, ColorBar, Drawn, Effort, Image, Outline, Paint, Renderer, Surface, color_of};
use eframe::egui::{self, Color32, Key, PointerButton, Rect, Sense, Ui, Vec2, ViewportCommand};
use eframe::egui_wgpu::RenderState;
use eframe::{CreationContext, wgpu};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// Width of the panel, points.
const PANEL: f32 = 350.0;
/// Depth of a tool per point of the wheel's way, m: a notch is a tenth of a millimetre or so.
const DEPTH: f64 = 2e-6;
/// Time between two pictures that the processor's own cores draw beside the simulation.
const BETWEEN: Duration = Duration::from_millis(80);
/// Angle of a tool per press of Q or E, rad.
const TURN: f64 = 0.05;
/// Most points of a tip's way.
const MOST_POINTS: usize = 2000;
/// Fraction of the colour that remains under the way of a tip, and its width, pixels.
const WAY_INK: [f32; 3] = [0.05, 0.2, 0.5];
const WAY_WIDTH: f32 = 1.5;
/// Most files of a kind in a folder.
const MOST_FILES: u32 = 9999;

/// What a window begins with.
pub struct Start {
    /// The session's other end.
    pub link: Arc<Link>,
    /// Its commands.
    pub sender: SyncSender<(u64, Command)>,
    /// Folder of what is saved.
    pub folder: PathBuf,
    /// Recorded motion of the hands.
    pub motion: Motion,
}

/// What a picture on the device shows.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    orbit: Orbit,
    size: [u32; 2],
    clip: Option<Clip>,
}

/// What draws the pictures.
struct Renderers {
    full: Renderer,
    /// Where the adapter is the processor: for pictures beside the simulation.
    light: Option<Renderer>,
    /// The light one draws.
    is_light: bool,
}

impl Renderers {
    fn present(&mut self) -> &mut Renderer {
        self.light.as_mut().filter(|_| self.is_light).unwrap_or(&mut self.full)
    }

    fn last(&self) -> &Renderer {
        self.light.as_ref().filter(|_| self.is_light).unwrap_or(&self.full)
    }
}

/// See the module.
pub struct App {
    link: Arc<Link>,
    state: State,
    device: RenderState,
    renderers: Renderers,
    texture: Option<egui::TextureId>,
    orbit: Option<Orbit>,
    seen: Option<Seen>,
    /// Largest value of the colour bar, in its unit.
    bar: Option<ColorBar>,
    /// `[tool]` vertex that was the lowest at the beginning: its tip
    tips: Vec<usize>,
    /// Way of the tip in hand, or of the first one, m.
    way: Vec<[f64; 3]>,
    /// `Shows` of what is loaded.
    loaded: Option<Shows>,
    folder: PathBuf,
    motion: Motion,
    filming: Option<Filming>,
    /// Another picture was drawn than the one that was filmed last.
    drawn: bool,
    /// The texture in the window is not of the picture that is drawn next.
    texture_is_old: bool,
    /// Size of the picture in the window, pixels.
    whole: [u32; 2],
    #[cfg(feature = "gamepad")]
    pad: Option<Pad>,
    #[cfg(feature = "gamepad")]
    pad_cuts: bool,
}

impl App {
    /// Begins to draw.
    ///
    /// # Errors
    /// If the window has no device.
    pub fn new(context: &CreationContext, start: Start) -> std::result::Result<Self, String> {
        let device = context.wgpu_render_state.clone().ok_or("the window has no device that draws")?;
        let (errors, lost) = (start.link.clone(), start.link.clone());
        device.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| errors.fail(error.to_string())));
        device.device.set_device_lost_callback(move |reason, message| {
            // the one at the end is no failure
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost.fail(format!("it was lost ({reason:?}): {message}"));
            }
        });
        context.egui_ctx.set_theme(egui::Theme::Light);
        start.link.context.get_or_init(|| context.egui_ctx.clone());
        let mut state = State::new(start.sender);
        #[cfg(feature = "gamepad")]
        let pad = Pad::new().map_err(|words| state.say(words)).ok();
        let on_cores = device.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        let renderer = |effort| Renderer::new(device.device.clone(), device.queue.clone(), effort);
        Ok(Self {
            texture_is_old: true,
            renderers: Renderers {
                full: renderer(Effort::Full),
                light: on_cores.then(|| renderer(Effort::Light)),
                is_light: false,
            },
            whole: [1; 2],
            #[cfg(feature = "gamepad")]
            pad,
            #[cfg(feature = "gamepad")]
            pad_cuts: false,
            link: start.link,
            state,
            device,
            texture: None,
            orbit: None,
            seen: None,
            bar: None,
            tips: vec![],
            way: vec![],
            loaded: None,
            folder: start.folder,
            motion: start.motion,
            filming: None,
            drawn: false,
        })
    }

    /// Takes what the session has left.
    fn take(&mut self) {
        if let Some(begun) = self.link.take_begun() {
            let orbit = Orbit::of(&camera(&begun.scene));
            self.orbit.get_or_insert(orbit);
            self.state.plots.clear();
            self.state.begun = Some(begun);
            self.tips.clear();
            self.way.clear();
            // every tool is where it begins, and in nobody's hand
            self.state.held = None;
        }
        self.link.take_words().into_iter().for_each(|words| self.state.say(words));
        self.state.forget();
        if let Some(shot) = self.link.take_shot() {
            self.state.plots.take(&shot.figures);
            if self.tips.is_empty() {
                let lowest = |mesh: &Vec<[f64; 3]>| (0..mesh.len()).min_by(|a, b| mesh[*a][2].total_cmp(&mesh[*b][2]));
                self.tips = shot.tools.iter().map(|mesh| lowest(mesh).unwrap_or(0)).collect();
            }
            if self.state.shot.as_ref().is_some_and(|before| before.figures.time_s > shot.figures.time_s) {
                self.way.clear();
            }
            self.state.shot = Some(shot);
            if let Some(at) = self.tip().filter(|at| self.way.last() != Some(at)) {
                if self.way.len() == MOST_POINTS {
                    self.way.remove(0);
                }
                self.way.push(at);
            }
            self.loaded = None;
        }
    }

    /// Where the tip of the tool in hand is, or of the first one, m.
    fn tip(&self) -> Option<[f64; 3]> {
        let tool = self.state.held.map_or(0, |held| held.tool);
        self.state.shot.as_ref()?.tools.get(tool)?.get(*self.tips.get(tool)?).copied()
    }

    /// Loads the newest state as it is wanted.
    fn load(&mut self, distance: f64) {
        let (Some(begun), Some(shot)) = (&self.state.begun, &self.state.shot) else { return };
        if self.loaded.as_ref() == Some(&self.state.shows) {
            return;
        }
        let shows = &self.state.shows;
        let mut look = Look { hidden: shows.hidden.clone(), plain: !shows.cells, colors: None };
        self.bar = None;
        // none of a quantity that the session has not read yet
        let values = shot.read.values.as_ref().filter(|values| shows.colors == Some(values.of));
        let high = values.map_or(0.0, Values::high);
        let color = |value: f64| color_of(if high > 0.0 { value / high } else { 0.0 });
        if let Some(Values { of, nodes, .. }) = values {
            look.colors = Some(nodes.iter().map(|value| color(*value)).collect());
            let (unit, factor) = of.unit();
            self.bar = Some(ColorBar { title: format!("{}, {unit}", of.name()), high: high * factor });
        }
        let slice = shot.read.slice.as_ref();
        let opened = slice.map(|slice| Opened::new(slice, &begun.scene, shows, values, color));
        let lines = opened.as_ref().map(Opened::lines);
        let opened: Vec<Surface> = opened.iter().zip(&lines).map(|(opened, lines)| opened.surface(lines)).collect();
        let arrows = if shows.forces { Arrows::new(&shot.contacts, distance) } else { Arrows::default() };
        let blue = vec![BLUE; arrows.triangles.len()];
        let steps: Vec<[u32; 2]> = (1..self.way.len() as u32).map(|k| [k - 1, k]).collect();
        let outlines = [Outline { lines: &steps, width: WAY_WIDTH, ink: WAY_INK }];
        let plain = |positions, triangles, colors, outlines| {
            let colors = Paint::Triangles(colors);
            Surface { positions, triangles, colors, smooth: true, outlines, shininess: 10.0 }
        };
        let forces = plain(&arrows.positions, &arrows.triangles, &blue, &[]);
        let way = plain(&self.way, &[], &[], &outlines);
        let renderer = self.renderers.present();
        with_surfaces(&begun.scene, &shot.skin, &shot.tools, &look, |bodies, tools| {
            let in_front = if shows.way { &[forces, way][..] } else { &[forces] };
            // the plane's own surface is not clipped by it
            renderer.load(&Drawn { clipped: bodies, whole: &[tools, &opened].concat(), in_front })
        });
        self.loaded = Some(self.state.shows.clone());
        self.seen = None;
    }

    /// Size of the next picture: half of the window's each way, lightly drawn, on the processor's own cores while they simulate or film.
    fn fitting(&mut self, whole: [u32; 2]) -> [u32; 2] {
        let playing = self.state.shot.as_ref().is_some_and(|shot| shot.figures.playing);
        self.draw_lightly(self.renderers.light.is_some() && (playing || self.state.films));
        if self.renderers.is_light { whole.map(|side| side.div_ceil(2)) } else { whole }
    }

    /// Has the next pictures drawn lightly, or in full.
    fn draw_lightly(&mut self, lightly: bool) {
        if self.renderers.is_light != lightly {
            self.renderers.is_light = lightly;
            (self.loaded, self.texture_is_old) = (None, true);
        }
    }

    /// Draws the picture if it is not the one that is there.
    fn draw(&mut self, size: [u32; 2]) {
        let Some(orbit) = self.orbit else { return };
        self.load(DVec3::from(orbit.camera().eye).distance(orbit.camera().target.into()));
        let asked = self.state.shot.as_ref().map(|shot| self.state.shows.asked(&shot.skin));
        let clip = asked.and_then(|asked| asked.plane);
        if let Some(asked) = asked.filter(|asked| self.state.asked != *asked) {
            self.state.asked = asked;
            self.state.send(Command::Look(asked));
        }
        let wanted = Seen { orbit, size, clip };
        if self.seen == Some(wanted) {
            return;
        }
        let resized = self.seen.is_none_or(|seen| seen.size != size) || self.texture_is_old;
        let begun = Instant::now();
        let is_light = self.renderers.is_light;
        let view = self.renderers.present().draw(&orbit.camera(), size, clip);
        let mut rest = Duration::ZERO;
        if is_light {
            // what fails here fails again where the picture is shown, and is said there
            self.device.device.poll(wgpu::PollType::wait_indefinitely()).ok();
            // the simulation has half of the time at least
            rest = begun.elapsed().max(BETWEEN.saturating_sub(begun.elapsed()));
        }
        if resized {
            let egui = &mut *self.device.renderer.write();
            let filter = wgpu::FilterMode::Linear;
            match self.texture {
                Some(id) => egui.update_egui_texture_from_wgpu_texture(&self.device.device, view, filter, id),
                None => self.texture = Some(egui.register_native_texture(&self.device.device, view, filter)),
            }
            self.texture_is_old = false;
        }
        self.seen = Some(wanted);
        self.drawn = true;
        self.link.is_drawn(rest);
    }

    /// The picture, what lies on it, and the mouse over it.
    fn picture(&mut self, ui: &mut Ui) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let dots = ui.ctx().pixels_per_point();
        let largest = self.device.device.limits().max_texture_dimension_2d as f32;
        let size = [rect.width(), rect.height()].map(|side| (side * dots).round().clamp(1.0, largest) as u32);
        self.whole = size;
        let size = self.fitting(size);
        self.draw(size);
        self.film(size);
        if let Some(texture) = self.texture {
            let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
        panel::overlays(ui, rect, &self.state, self.bar.as_ref());
        self.point(ui, &response);
    }

    /// The mouse: turns and zooms, or moves the tool in hand.
    fn point(&mut self, ui: &Ui, response: &egui::Response) {
        let tip = self.tip();
        let Some(orbit) = &mut self.orbit else { return };
        let (way, wheel, shift, pressed) = ui.input(|i| {
            (i.pointer.delta(), f64::from(i.smooth_scroll_delta().y), i.modifiers.shift, i.pointer.primary_down())
        });
        let turns = response.dragged_by(PointerButton::Secondary)
            || response.dragged_by(PointerButton::Middle)
            || (self.state.held.is_none() && response.dragged_by(PointerButton::Primary));
        if turns {
            orbit.turn(DVec2::new(f64::from(way.x), f64::from(way.y)));
        }
        let over = response.hovered() || response.dragged();
        match self.state.held {
            Some(mut held) if over => {
                if shift {
                    orbit.zoom(wheel);
                } else {
                    held.position.z += wheel * DEPTH;
                }
                // a mouse that comes in from beside the picture does not take the tool along
                let from = |now: &egui::Pos2| response.rect.contains(*now - way);
                if let (Some(now), false) = (response.hover_pos().filter(from), turns) {
                    held.position +=
                        moved(orbit, response.rect, now - way, now, tip.map_or(held.position.z, |tip| tip[2]));
                }
                held.pressed = pressed && !turns && response.is_pointer_button_down_on();
                self.state.hold(held);
            }
            None if over => orbit.zoom(wheel),
            _ => {}
        }
    }

    fn keys(&mut self, ui: &Ui) {
        let keys = [Key::Space, Key::Period, Key::Escape, Key::P, Key::F, Key::Q, Key::E];
        let [play, step, leave, save, film, left, right] = ui.input(|i| keys.map(|key| i.key_pressed(key)));
        if play {
            self.state.toggle();
        }
        if step {
            self.state.send(Command::Step);
        }
        if leave {
            self.state.take(None);
        }
        if let (Some(mut held), true) = (self.state.held, left != right) {
            held.turn += if left { TURN } else { -TURN };
            self.state.hold(held);
        }
        self.state.saves |= save;
        self.state.films ^= film;
        if ui.input(|i| i.modifiers.command && i.key_pressed(Key::Q)) {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
    }

    /// A game pad moves the tool in hand.
    #[cfg(feature = "gamepad")]
    fn pad(&mut self, ui: &Ui) {
        let Some((read, time)) = self.pad.as_mut().and_then(Pad::read) else { return };
        ui.ctx().request_repaint_after(pad::BETWEEN);
        if read.plays {
            self.state.toggle();
        }
        if read.takes
            && let Some(begun) = &self.state.begun
        {
            let now = self.state.held.map(|held| held.tool);
            // the one in hand lets go where there is no next
            self.state.take(pad::next(&begun.scene, &begun.held, now).or(now));
        }
        if let (Some(mut held), Some(orbit)) = (self.state.held, &self.orbit) {
            let (way, turn) = pad::moved(read.sticks, orbit.level_axes(), time);
            held.position += way;
            held.turn += turn;
            // the mouse's button stays its own
            if read.cuts != self.pad_cuts {
                (held.pressed, self.pad_cuts) = (read.cuts, read.cuts);
            }
            self.state.hold(held);
        }
    }

    /// The picture with its caption and bar.
    fn pictured(&self) -> Result<Image> {
        let caption = self.state.shot.as_ref().map(|shot| shot.caption.clone()).unwrap_or_default();
        let mut image = self.renderers.last().read()?;
        view::caption(&mut image, &caption.iter().map(String::as_str).collect::<Vec<_>>());
        if let Some(bar) = &self.bar {
            view::color_bar(&mut image, bar);
        }
        Ok(image)
    }

    /// Saves the picture.
    fn save(&mut self) {
        self.draw_lightly(false);
        self.draw(self.whole);
        let saved = self.pictured().and_then(|image| {
            let path = free_name(&self.folder, "view", "png");
            let bytes = view::png(&image).map_err(|source| Failed::Write { path: path.clone(), source })?;
            replace(&path, &bytes).map(|()| path)
        });
        self.state.say_saved(saved);
    }

    /// Saves the motion of the hand in use, or of the first one.
    fn save_motion(&mut self) {
        let tool = self.state.held.map_or(0, |held| held.tool);
        let path = free_name(&self.folder, "motion", "csv");
        let saved = replace(&path, trajectory(&self.motion, tool).as_bytes()).map(|()| path);
        self.state.say_saved(saved);
    }

    /// Begins, continues or ends a film.
    fn film(&mut self, size: [u32; 2]) {
        let ends = |filming: &Filming| !self.state.films || !filming.fits(size);
        if let Some(filming) = self.filming.take_if(|filming| ends(filming)) {
            self.state.films = false;
            self.state.say(filming.end());
        } else if self.state.films && self.filming.as_ref().is_none_or(|filming| self.drawn && filming.is_due()) {
            self.drawn = false;
            let added = self.pictured().and_then(|image| match &mut self.filming {
                Some(filming) => filming.add(image),
                None => {
                    self.filming = Some(Filming::new(&free_name(&self.folder, "film", "png"), image)?);
                    Ok(())
                }
            });
            if let Err(error) = added {
                // dropped, it leaves no file
                (self.filming, self.state.films) = (None, false);
                self.state.say(error.to_string());
            }
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        if self.link.has_ended() {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
        self.take();
        if !ui.ctx().egui_wants_keyboard_input() {
            self.keys(ui);
        }
        #[cfg(feature = "gamepad")]
        self.pad(ui);
        egui::Panel::right("panel").exact_size(PANEL).show(ui, |ui| panel::show(ui, &mut self.state));
        egui::CentralPanel::no_frame().show(ui, |ui| self.picture(ui));
        if std::mem::take(&mut self.state.saves) {
            self.save();
        }
        if std::mem::take(&mut self.state.saves_motion) {
            self.save_motion();
        }
        if !self.state.words.is_empty() {
            ui.ctx().request_repaint_after(WORDS);
        }
    }

    fn on_exit(&mut self) {
        if let Some(filming) = self.filming.take() {
            filming.end();
        }
    }
}

/// How far a tool moves between two points of the picture, on the level plane at the height of its tip, m.
fn moved(orbit: &Orbit, rect: Rect, from: egui::Pos2, to: egui::Pos2, height: f64) -> DVec3 {
    let aspect = f64::from(rect.width() / rect.height());
    let at = |p: egui::Pos2| {
        let share: Vec2 = (p - rect.center()) / (0.5 * rect.size());
        orbit.on_plane(DVec2::new(f64::from(share.x), -f64::from(share.y)), aspect, height)
    };
    match (at(from), at(to)) {
        (Some(a), Some(b)) => b - a,
        _ => DVec3::ZERO,
    }
}

/// First numbered name that no file of the folder has.
fn free_name(folder: &Path, what: &str, ending: &str) -> PathBuf {
    let mut names = (1..=MOST_FILES).map(|number| folder.join(format!("{what}_{number:04}.{ending}")));
    names.find(|path| !path.exists()).unwrap_or_else(|| folder.join(format!("{what}.{ending}")))
}
