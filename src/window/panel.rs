//! The panel beside the picture, and what lies on it.

use super::state::State;
use crate::session::audience::Pace;
use crate::session::{Command, Figures, Quantity};
use crate::view::{ColorBar, color_of};
use eframe::egui::{
    self, Align2, Button, Color32, FontId, Rect, RichText, ScrollArea, Sense, Slider, Stroke, StrokeKind, Ui, Vec2,
    pos2, vec2,
};

/// Size of the bar on the picture, points.
const BAR: Vec2 = vec2(14.0, 180.0);
/// Width of a slider, points.
const SLIDER: f32 = 96.0;
/// Steps of the bar.
const TENTHS: u32 = 30;
/// Colour of words that go away again.
const SAID: Color32 = Color32::from_rgb(160, 32, 32);
const INK: Color32 = Color32::from_rgb(38, 42, 50);

/// Axes that the clipping plane is across.
const AXES: [&str; 3] = ["x", "y", "z"];

/// The whole panel.
pub fn show(ui: &mut Ui, state: &mut State) {
    let Some(figures) = state.shot.as_ref().map(|shot| shot.figures.clone()) else {
        ui.label("no state yet");
        return;
    };
    ScrollArea::vertical().show(ui, |ui| {
        ui.spacing_mut().slider_width = SLIDER;
        ui.set_max_width(ui.available_width());
        light(ui, &figures);
        running(ui, state, &figures);
        ui.separator();
        tools(ui, state);
        ui.separator();
        changes(ui, state, &figures);
        ui.separator();
        looks(ui, state);
        ui.separator();
        state.plots.show(ui);
    });
}

/// Whether it is in real time, and what to coarsen where it is not.
fn light(ui: &mut Ui, figures: &Figures) {
    let share = figures.share();
    let (color, words) = match figures.pace() {
        Pace::Still => (Color32::from_gray(187), "stands still".into()),
        Pace::InTime => (Color32::from_rgb(46, 158, 79), in_time(share)),
        Pace::Tight => (Color32::from_rgb(224, 176, 32), in_time(share)),
        Pace::Late => {
            (Color32::from_rgb(204, 51, 51), format!("not in real time: a step takes {share:.1} times its time"))
        }
    };
    // one line whatever the pace, so that no button below moves under the mouse
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(Vec2::splat(16.0), Sense::hover());
        ui.painter().circle_filled(rect.center(), 7.0, color);
        let label = ui.add(egui::Label::new(words).truncate());
        if figures.pace() == Pace::Late {
            label.on_hover_text("fewer [skin] cells, a longer step, a looser tolerance or less speed");
        }
    });
    ui.label(RichText::new(format!("{:.3} s", figures.time_s)).monospace());
}

fn in_time(share: f64) -> String {
    format!("in real time: a step takes {:.0} % of its time", 100.0 * share)
}

/// Play, step, begin anew, speed, kept states.
fn running(ui: &mut Ui, state: &mut State, figures: &Figures) {
    ui.horizontal(|ui| {
        if ui.button(if figures.playing { "Pause" } else { "Play" }).clicked() {
            state.toggle();
        }
        if ui.button("Step").clicked() {
            state.send(Command::Step);
        }
        if ui.button("Begin anew").clicked() {
            state.send(Command::Reset);
        }
    });
    ui.horizontal(|ui| {
        ui.label("save");
        if ui.button("Picture").clicked() {
            state.saves = true;
        }
        ui.toggle_value(&mut state.films, "Film");
        if ui.button("Motion of the hand").clicked() {
            state.saves_motion = true;
        }
    });
    if let Some(speed) = changed(ui, "speed", "×", figures.speed, [0.25, 2.0], true) {
        state.send(Command::Speed(speed));
    }
    let last = figures.kept.len().saturating_sub(1);
    let id = ui.scope_id().with("kept");
    let mut number = ui.data(|data| data.get_temp::<usize>(id)).unwrap_or(last).min(last);
    let time = figures.kept.get(number).copied().unwrap_or_default();
    let text = move |_: f64, _: std::ops::RangeInclusive<usize>| format!("{time:.2} s");
    let slider = Slider::new(&mut number, 0..=last).custom_formatter(text).text("back to");
    let response = ui.add_enabled(last > 0, slider);
    ui.data_mut(|data| match response.dragged() {
        true => drop(data.insert_temp(id, number)),
        false => data.remove::<usize>(id),
    });
    if response.drag_stopped() || (response.changed() && !response.dragged()) {
        state.send(Command::Seek(number));
    }
}

/// A slider for a value of the session, which follows it until somebody holds it; the new value once it is let go.
fn changed(ui: &mut Ui, name: &str, unit: &str, now: f64, [low, high]: [f64; 2], logarithmic: bool) -> Option<f64> {
    let id = ui.scope_id().with(name);
    let mut value = ui.data(|data| data.get_temp::<f64>(id)).unwrap_or(now);
    let mut slider = Slider::new(&mut value, low..=high).logarithmic(logarithmic).text(name).suffix(unit);
    slider = if logarithmic && low < 1e-3 {
        slider.custom_formatter(|v, _| format!("{v:.1e}"))
    } else {
        slider.max_decimals(2)
    };
    let response = ui.add(slider);
    let held = response.dragged() || response.has_focus();
    ui.data_mut(|data| match held {
        true => drop(data.insert_temp(id, value)),
        false => data.remove::<f64>(id),
    });
    let let_go = response.drag_stopped() || response.lost_focus() || (response.changed() && !response.dragged());
    (let_go && (value - now).abs() > 1e-9 * now.abs()).then_some(value)
}

fn tools(ui: &mut Ui, state: &mut State) {
    let Some(begun) = &state.begun else { return };
    let tools: Vec<(String, bool)> =
        begun.scene.tools.iter().zip(&begun.held).map(|(tool, held)| (tool.name.clone(), *held)).collect();
    ui.horizontal_wrapped(|ui| {
        for (number, (name, may)) in tools.iter().enumerate() {
            let taken = state.held.is_some_and(|held| held.tool == number);
            let text = if *may { format!("Take the {name}") } else { name.clone() };
            if ui.add_enabled(*may, Button::selectable(taken, text)).clicked() {
                state.take(Some(number));
            }
        }
    });
}

fn changes(ui: &mut Ui, state: &mut State, figures: &Figures) {
    if let Some(friction) = figures.friction
        && let Some(value) = changed(ui, "friction", "", friction, [0.0, 1.0], false)
    {
        state.send(Command::Friction(value));
    }
    if let Some(value) = changed(ui, "stiffness", "×", figures.stiffness, [0.5, 2.0], true) {
        state.send(Command::Stiffness(value));
    }
    if let Some(value) = changed(ui, "tolerance", "", figures.tolerance, [1e-6, 0.1], true) {
        state.send(Command::Tolerance(value));
    }
    if let Some(value) = changed(ui, "step (begins anew)", " ms", figures.scene_step_ms, [1.0, 50.0], true) {
        state.send(Command::StepMs(value));
    }
}

fn looks(ui: &mut Ui, state: &mut State) {
    let Some(begun) = &state.begun else { return };
    let shows = &mut state.shows;
    for (body, skin) in begun.scene.skins.iter().enumerate() {
        ui.horizontal_wrapped(|ui| {
            for (number, layer) in skin.layers.iter().enumerate() {
                let id = [body as u32, number as u32];
                let mut shown = !shows.hidden.contains(&id);
                let [r, g, b] = layer.color;
                let (rect, _) = ui.allocate_exact_size(Vec2::splat(11.0), Sense::hover());
                ui.painter().rect_filled(rect, 2.0, Color32::from_rgb(r, g, b));
                if ui.checkbox(&mut shown, &layer.name).changed() {
                    match shown {
                        true => shows.hidden.remove(&id),
                        false => shows.hidden.insert(id),
                    };
                }
            }
        });
    }
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut shows.cells, "cells");
        ui.checkbox(&mut shows.forces, "forces");
        ui.checkbox(&mut shows.way, "way of the tip");
    });
    ui.horizontal_wrapped(|ui| {
        ui.label("colours");
        ui.selectable_value(&mut shows.colors, None, "layers");
        for quantity in Quantity::ALL {
            ui.selectable_value(&mut shows.colors, Some(quantity), quantity.name());
        }
    });
    ui.horizontal(|ui| {
        ui.add(Slider::new(&mut shows.clip.1, 0.0..=1.0).max_decimals(2).text("cut open at"));
        for (axis, name) in AXES.iter().enumerate() {
            ui.selectable_value(&mut shows.clip.0, axis, *name);
        }
    });
}

/// Title, figures, words and colour bar on the picture.
pub fn overlays(ui: &Ui, rect: Rect, state: &State, bar: Option<&ColorBar>) {
    let painter = ui.painter_at(rect);
    let font = FontId::proportional(13.0);
    let label = |at: egui::Pos2, anchor: Align2, text: String, color: Color32| {
        let galley = painter.layout(text, font.clone(), color, rect.width() - 28.0);
        let place = anchor.anchor_size(at, galley.size());
        painter.rect_filled(place.expand2(vec2(6.0, 2.0)), 4.0, Color32::from_white_alpha(208));
        painter.galley(place.min, galley, color);
        place
    };
    // title, figures and keys, messages
    if let Some(begun) = &state.begun {
        label(rect.left_top() + vec2(14.0, 10.0), Align2::LEFT_TOP, begun.scene.title.clone(), INK);
    }
    if let Some(shot) = &state.shot {
        let figures = &shot.figures;
        let warned: Vec<String> = figures.warnings.iter().map(|(name, count)| format!("{name} × {count}")).collect();
        let mut text = format!("{} contacts, {} links cut", figures.contacts, figures.severed);
        if !warned.is_empty() {
            text += &format!("; warnings: {}", warned.join(", "));
        }
        text += match state.held {
            Some(_) => {
                "; mouse moves, button cuts, wheel: depth, Q and E turn, right button turns the view, Esc releases"
            }
            None => "; drag turns, wheel zooms; space plays, . steps, P saves a picture, F a film, Ctrl+Q ends",
        };
        label(rect.left_bottom() + vec2(14.0, -10.0), Align2::LEFT_BOTTOM, text, INK);
    }
    let words: Vec<&str> = state.words.iter().map(|(_, words)| words.as_str()).collect();
    if !words.is_empty() {
        label(rect.left_bottom() + vec2(14.0, -36.0), Align2::LEFT_BOTTOM, words.join("\n"), SAID);
    }
    // colour bar
    let Some(bar) = bar else { return };
    let title = label(rect.left_top() + vec2(14.0, 38.0), Align2::LEFT_TOP, bar.title.clone(), INK);
    let place = Rect::from_min_size(pos2(title.left(), title.bottom() + 12.0), BAR);
    painter.rect_filled(place.expand(2.0), 0.0, Color32::WHITE);
    for k in 0..TENTHS {
        let [r, g, b] = color_of((f64::from(k) + 0.5) / f64::from(TENTHS));
        let y = |k: u32| place.bottom() - BAR.y * k as f32 / TENTHS as f32;
        let part = Rect::from_min_max(pos2(place.left(), y(k + 1)), pos2(place.right(), y(k)));
        painter.rect_filled(part, 0.0, Color32::from_rgb(r, g, b));
    }
    painter.rect_stroke(place, 0.0, Stroke::new(1.0, INK), StrokeKind::Outside);
    for share in [0.0, 0.5, 1.0] {
        let at = pos2(place.right() + 12.0, place.bottom() - BAR.y * share as f32);
        label(at, Align2::LEFT_CENTER, format!("{:.3}", bar.high * share), INK);
    }
}

#[cfg(test)]
mod tests {
    use super::super::link::{Begun, Shot};
    use super::*;
    use crate::report::frames::{Faces, SkinSurface};
    use crate::session::{Quantity, Read};
    use egui::accesskit::Role;
    use egui_kittest::Harness;
    use egui_kittest::kittest::{NodeT as _, Queryable as _};
    use std::sync::mpsc::{Receiver, sync_channel};

    /// A panel of the built-in scene that stands still, and what it sends.
    fn panel(figures: Figures) -> (Harness<'static, State>, Receiver<(u64, Command)>) {
        let (sender, commands) = sync_channel(64);
        let mut state = State::new(sender);
        let scene = crate::scene::incision().expect("the built-in scene");
        let held = vec![true; scene.tools.len()];
        let skin = SkinSurface {
            positions: vec![],
            displacements: vec![],
            velocities: vec![],
            skin: Faces::default(),
            walls: Faces::default(),
            rims: vec![],
        };
        state.shot = Some(Box::new(Shot {
            skin,
            read: Read::default(),
            tools: vec![],
            hands: vec![[1e-3, 2e-3, 3e-3]; scene.tools.len()],
            contacts: vec![],
            figures,
            caption: vec![],
        }));
        state.begun = Some(Begun { scene, held });
        let harness = Harness::builder().with_size([360.0, 900.0]).build_ui_state(show, state);
        (harness, commands)
    }

    fn still() -> Figures {
        let (kept, friction) = (vec![0.0, 0.1, 0.2], Some(0.3));
        Figures {
            kept,
            friction,
            speed: 1.0,
            stiffness: 1.0,
            tolerance: 1e-2,
            scene_step_ms: 5.0,
            ..Figures::default()
        }
    }

    #[test]
    fn buttons_send_their_commands_and_boxes_change_the_picture() {
        let (mut panel, commands) = panel(still());
        let mut click = |label: &str| {
            let of_slider = [Role::Slider, Role::SpinButton];
            {
                let mut named = panel.get_all_by_label(label);
                named.find(|node| !of_slider.contains(&node.accesskit_node().role())).expect("a button").click();
            }
            panel.run();
            let sent: Vec<Command> = commands.try_iter().map(|(_, command)| command).collect();
            (sent, panel.state().shows.clone(), panel.state().saves, panel.state().films)
        };
        for (label, command) in [("Play", Command::Play), ("Step", Command::Step), ("Begin anew", Command::Reset)] {
            assert_eq!(click(label).0, [command], "{label}");
        }
        let (sent, _, saves, films) = click("Picture");
        assert!(sent.is_empty() && saves && !films);
        assert!(click("Film").3 && !click("Film").3);
        // the scalpel is taken where it is, and let go
        let (sent, ..) = click("Take the scalpel");
        let [Command::Hand(hand)] = sent[..] else { panic!("{sent:?}") };
        assert!(hand.tool == 0 && hand.position == [1e-3, 2e-3, 3e-3] && !hand.pressed, "{hand:?}");
        assert_eq!(click("Take the scalpel").0, [Command::Release(0)]);
        // what is shown
        for quantity in Quantity::ALL {
            assert_eq!(click(quantity.name()).1.colors, Some(quantity));
        }
        assert_eq!(click("layers").1.colors, None);
        let (_, before, ..) = click("x");
        let (_, after, ..) = click("cells");
        assert!(before.clip.0 == 0 && before.cells && !after.cells);
        let (_, hidden, ..) = click("dermis");
        assert_eq!(hidden.hidden.len(), 1);
    }

    #[test]
    fn sliders_send_a_value_once_it_is_chosen() {
        let (mut panel, commands) = panel(still());
        for (label, wanted) in [
            ("friction", Command::Friction(0.0)),
            ("stiffness", Command::Stiffness(0.0)),
            ("tolerance", Command::Tolerance(0.0)),
            ("step (begins anew)", Command::StepMs(0.0)),
            ("speed", Command::Speed(0.0)),
            ("back to", Command::Seek(0)),
        ] {
            panel.get_by_role_and_label(Role::Slider, label).focus();
            panel.run();
            let key = if label == "back to" { egui::Key::ArrowLeft } else { egui::Key::ArrowRight };
            panel.key_press(key);
            panel.run();
            let sent: Vec<Command> = commands.try_iter().map(|(_, command)| command).collect();
            // the one before, whose value nobody has taken over here, says it once more as it loses the focus
            let same = |command: &&Command| std::mem::discriminant(*command) == std::mem::discriminant(&wanted);
            assert_eq!(sent.iter().filter(same).count(), 1, "{label}: {sent:?}");
        }
    }

    #[test]
    fn the_light_says_whether_it_is_in_real_time() {
        let with = |ms: f64, playing: bool| {
            let mut figures = still();
            (figures.playing, figures.step_ms_90, figures.budget_ms) = (playing, ms, 5.0);
            panel(figures).0
        };
        assert!(with(20.0, false).query_by_label("stands still").is_some());
        assert!(with(4.5, true).query_by_label_contains("a step takes 90 % of its time").is_some());
        let late = with(20.0, true);
        assert!(late.query_by_label_contains("a step takes 4.0 times its time").is_some());
        assert!(late.query_by_label("Pause").is_some() && late.query_by_label("Play").is_none());
    }
}
