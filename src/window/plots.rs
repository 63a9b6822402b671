//! Live curves of force, iterations, residual and step time.

use crate::session::Figures;
use eframe::egui::{Color32, RichText, Ui, Vec2b};
use egui_plot::{Line, LineStyle, Plot};
use std::collections::VecDeque;

/// Most points of a curve: some ten seconds.
const MOST: usize = 300;
/// Height of a plot, points.
const HEIGHT: f32 = 68.0;
/// Residual below which a curve is not drawn, as its logarithm.
const LOWEST: f64 = -12.0;
const INKS: [Color32; 4] = [
    Color32::from_rgb(11, 98, 164),
    Color32::from_rgb(200, 116, 27),
    Color32::from_rgb(75, 139, 59),
    Color32::from_rgb(138, 79, 160),
];
const FAINT: Color32 = Color32::from_rgb(176, 184, 192);

/// Figures of the past pictures.
#[derive(Default)]
pub struct Plots {
    past: VecDeque<Figures>,
}

/// One plot.
struct Kind {
    title: &'static str,
    digits: usize,
    /// Least and largest value that are always within.
    within: [f64; 2],
    values: fn(&Figures) -> Vec<f64>,
    /// Drawn in grey: what the values are to keep below.
    limit: Option<fn(&Figures) -> f64>,
}

const KINDS: [Kind; 4] = [
    Kind { title: "force, N", digits: 3, within: [0.0, 0.1], values: |f| f.force_n.clone(), limit: None },
    Kind {
        title: "iterations: solver, contact passes",
        digits: 0,
        within: [0.0, 10.0],
        values: |f| vec![f64::from(f.iterations), f64::from(f.passes)],
        limit: None,
    },
    Kind {
        title: "residual, log10",
        digits: 1,
        within: [LOWEST, 0.0],
        values: |f| vec![f.residual.log10().max(LOWEST)],
        limit: None,
    },
    Kind {
        title: "step, ms: median, 90 %, its time",
        digits: 1,
        within: [0.0, 1.0],
        values: |f| vec![f.step_ms, f.step_ms_90],
        limit: Some(|f| f.budget_ms),
    },
];

impl Plots {
    /// Takes the figures of a picture.
    pub fn take(&mut self, figures: &Figures) {
        if self.past.len() == MOST {
            self.past.pop_front();
        }
        self.past.push_back(figures.clone());
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        self.past.clear();
    }

    /// All plots, one below the other.
    pub fn show(&self, ui: &mut Ui) {
        for kind in &KINDS {
            let newest = self.past.back().map(kind.values).unwrap_or_default();
            let shown: Vec<String> = newest.iter().map(|v| format!("{v:.*}", kind.digits)).collect();
            ui.horizontal(|ui| {
                ui.label(RichText::new(kind.title).weak().small());
                ui.label(RichText::new(shown.join(" · ")).strong().small());
            });
            let mut lines = vec![];
            if let Some(limit) = kind.limit {
                lines.push(self.curve("its time", FAINT, |figures| Some(limit(figures))));
            }
            // tools without contact have no force: their curves begin with the first one
            let most = self.past.iter().map(|figures| (kind.values)(figures).len()).max().unwrap_or(0);
            for number in 0..most {
                let value = |figures: &Figures| (kind.values)(figures).get(number).copied();
                lines.push(self.curve(&format!("{number}"), INKS[number % INKS.len()], value));
            }
            Plot::new(kind.title)
                .width(ui.available_width())
                .height(HEIGHT)
                .allow_drag(false)
                .allow_zoom(false)
                .allow_scroll(false)
                .allow_boxed_zoom(false)
                .allow_axis_zoom_drag(false)
                .show_axes(Vec2b::new(false, true))
                .show_x(false)
                .y_axis_min_width(34.0)
                .include_x(0.0)
                .include_x(MOST as f64)
                .include_y(kind.within[0])
                .include_y(kind.within[1])
                .show(ui, |plot| lines.into_iter().for_each(|line| plot.line(line)));
        }
    }

    fn curve(&self, name: &str, ink: Color32, value: impl Fn(&Figures) -> Option<f64>) -> Line<'static> {
        let points: Vec<[f64; 2]> = self
            .past
            .iter()
            .enumerate()
            .filter_map(|(k, figures)| value(figures).filter(|v| v.is_finite()).map(|v| [k as f64, v]))
            .collect();
        Line::new(name, points).color(ink).width(1.5).style(LineStyle::Solid)
    }
}
