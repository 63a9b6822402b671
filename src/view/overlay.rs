//! What stands on a picture: captions and the bar of a colour map. Letters have smooth edges and a light rim, legible on any ground.

use super::Image;
use super::font::{HEIGHT, WIDTH, strokes};
use super::map::color_of;

const INK: [u8; 3] = [38, 42, 50];
const RIM: [u8; 3] = [236, 238, 241];
/// Half the width of a letter's strokes, and that of its rim beyond them, dots.
const HALF: f32 = 0.52;
const BEYOND: f32 = 0.6;
/// Distances between letters and between lines, dots.
const ADVANCE: usize = WIDTH + 1;
const LINE: usize = HEIGHT + 3;
/// Height of the bar as a share of the picture's, and its width, dots.
const BAR_SHARE: f32 = 0.45;
const BAR_WIDTH: usize = 9;
/// Most labels above the one of 0.
const LABELS: f64 = 5.0;

/// Colour bar: values from 0 to the largest, with a title.
#[derive(Clone, Debug)]
pub struct ColorBar {
    /// Quantity and unit.
    pub title: String,
    /// Value at the upper end, in that unit.
    pub high: f64,
}

/// Size of a dot of the font, pixels.
fn dot(image: &Image) -> usize {
    (image.height as usize / 320).max(1)
}

/// Draws lines of text at the top left.
pub fn caption(image: &mut Image, lines: &[&str]) {
    let dot = dot(image);
    for (number, line) in lines.iter().enumerate() {
        text(image, 5 * dot, 5 * dot + number * LINE * dot, dot, line);
    }
}

/// Draws a line of text with its left top corner at a pixel; what is beyond the picture is left out.
fn text(image: &mut Image, left: usize, top: usize, dot: usize, line: &str) {
    let (size, half, rim) = (dot as f32, HALF * dot as f32, BEYOND * dot as f32);
    let margin = (half + rim).ceil() as usize;
    // the rims of all letters lie below them
    for (color, reach) in [(RIM, half + rim), (INK, half)] {
        for (number, character) in line.chars().enumerate() {
            let x0 = left + number * ADVANCE * dot;
            let ends: Vec<[[f32; 2]; 2]> =
                strokes(character).into_iter().map(|ends| ends.map(|p| p.map(|c| (c as f32 + 0.5) * size))).collect();
            for y in top.saturating_sub(margin)..top + HEIGHT * dot + margin {
                for x in x0.saturating_sub(margin)..x0 + WIDTH * dot + margin {
                    let at = [x as f32 + 0.5 - x0 as f32, y as f32 + 0.5 - top as f32];
                    let nearest = ends.iter().map(|ends| distance(at, *ends)).fold(f32::MAX, f32::min);
                    blend(image, x, y, color, 0.5 + reach - nearest);
                }
            }
        }
    }
}

/// Distance of a point from a line.
fn distance(p: [f32; 2], [a, b]: [[f32; 2]; 2]) -> f32 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = d[0] * d[0] + d[1] * d[1];
    let t = if squared > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (e[0] - t * d[0]).hypot(e[1] - t * d[1])
}

/// Covers a share of a pixel.
fn blend(image: &mut Image, x: usize, y: usize, color: [u8; 3], share: f32) {
    if x >= image.width as usize || y >= image.height as usize || share <= 0.0 {
        return;
    }
    let pixel = &mut image.rgb[3 * (y * image.width as usize + x)..][..3];
    for (channel, own) in pixel.iter_mut().zip(color) {
        *channel = (f32::from(*channel) + (f32::from(own) - f32::from(*channel)) * share.min(1.0)).round() as u8;
    }
}

/// Draws a colour bar at the left below the caption, with its title above and labels at round values; a picture that is too low for one
/// stays as it is.
pub fn color_bar(image: &mut Image, bar: &ColorBar) {
    let dot = dot(image);
    let height = (image.height as f32 * BAR_SHARE) as usize;
    let (left, bottom) = (6 * dot, (image.height as usize).saturating_sub(10 * dot));
    if height == 0 || bottom <= height {
        return;
    }
    let top = bottom - height;
    text(image, left, top.saturating_sub(2 * LINE * dot), dot, &bar.title);
    for y in top..bottom {
        let share = (bottom - y) as f64 / height.max(1) as f64;
        for x in left..left + BAR_WIDTH * dot {
            let edge = y == top || y + 1 == bottom || x == left || x + 1 == left + BAR_WIDTH * dot;
            blend(image, x, y, if edge { INK } else { color_of(share) }, 1.0);
        }
    }
    for (value, label) in labels(bar.high) {
        let y = bottom - ((value / bar.high * height as f64) as usize).min(height);
        for x in left + BAR_WIDTH * dot..left + (BAR_WIDTH + 3) * dot {
            blend(image, x, y.min(bottom - 1), INK, 1.0);
        }
        text(image, left + (BAR_WIDTH + 5) * dot, y.saturating_sub(HEIGHT * dot / 2), dot, &label);
    }
}

/// Round values from 0 to at most `high`, with their texts.
fn labels(high: f64) -> Vec<(f64, String)> {
    if !(high > 0.0 && high.is_finite()) {
        return vec![];
    }
    let rough = high / LABELS;
    let decade = 10f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade);
    let step = steps.into_iter().find(|step| *step >= 0.999 * rough).unwrap_or(rough);
    let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let count = (high / step * (1.0 + 1e-9)) as usize;
    (0..=count).map(|k| k as f64 * step).map(|value| (value, format!("{value:.digits$}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_fits_into_pictures_of_any_size() {
        let bar = ColorBar { title: "stress, kPa".into(), high: 3.0 };
        for (width, height) in [(0, 0), (1, 1), (7, 5), (3, 19), (40, 60), (96, 64), (960, 640)] {
            let blank = Image { width, height, rgb: vec![255; 3 * width as usize * height as usize], skipped: 0 };
            let mut image = blank.clone();
            color_bar(&mut image, &bar);
            assert_eq!(image != blank, height >= 19 && width > 6, "{width} × {height}");
        }
    }

    #[test]
    fn labels_are_round_and_within_the_bar() {
        let texts = |high| labels(high).into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(texts(1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(texts(0.73), ["0.0", "0.2", "0.4", "0.6"]);
        assert_eq!(texts(34.0), ["0", "10", "20", "30"]);
        assert!(texts(0.0).is_empty() && texts(f64::NAN).is_empty());
        for k in 1..500 {
            let high = 1.07f64.powi(k) * 1e-7;
            let found = labels(high);
            assert!((3..=6).contains(&found.len()) && found.iter().all(|(value, _)| *value <= high * 1.001), "{high}");
        }
    }
}
