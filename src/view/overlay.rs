//! What stands on a picture: captions and the bar of a colour map. Letters have smooth edges and a light rim, legible on any ground.
//!
//! The colour map is a perceptual one: equal steps of the value are equal steps of lightness, for any kind of colour vision.
//! Source: `viridis` of matplotlib (Smith, van der Walt 2015, CC0), at eleven values, linear between them.
//!
//! The font, of 5 × 7 dots, was drawn for this project: printable ASCII and `° ² × µ`.

use super::Image;

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

/// `[tenth]` sRGB.
pub const VIRIDIS: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];

/// Colour of a share of the largest value, sRGB; that of 0 below, that of 1 above, grey for what is no number.
pub fn color_of(share: f64) -> [u8; 3] {
    if share.is_nan() {
        return [128; 3];
    }
    let tenths = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let k = (tenths as usize).min(VIRIDIS.len() - 2);
    let t = tenths - k as f64;
    let mix = |a: u8, b: u8| ((1.0 - t) * f64::from(a) + t * f64::from(b)).round() as u8;
    [0, 1, 2].map(|n| mix(VIRIDIS[k][n], VIRIDIS[k + 1][n]))
}

/// Columns of a glyph, dots.
const WIDTH: usize = 5;
/// Rows of a glyph, dots.
const HEIGHT: usize = 7;

/// Rows of a character from the top; the most significant of the 5 bits is the left dot. Characters without a glyph are a hollow box.
fn glyph(character: char) -> [u8; HEIGHT] {
    match character {
        ' '..='~' => ASCII[character as usize - ' ' as usize],
        '°' => [0x0c, 0x12, 0x12, 0x0c, 0x00, 0x00, 0x00],
        '²' => [0x0c, 0x12, 0x04, 0x08, 0x1e, 0x00, 0x00],
        '×' => [0x00, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x00],
        'µ' | 'μ' => [0x00, 0x00, 0x11, 0x11, 0x13, 0x1d, 0x10],
        '−' | '–' => ASCII['-' as usize - ' ' as usize],
        _ => [0x1f, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1f],
    }
}

/// Strokes of a character: lines between the centres of neighbouring dots, in dots from the left and from the top; a lone dot is a line of
/// no length. Diagonal neighbours are joined where no other way leads from one to the other.
pub fn strokes(character: char) -> Vec<[[f64; 2]; 2]> {
    let rows = glyph(character);
    let dot = |x: isize, y: isize| {
        let inside = (0..WIDTH as isize).contains(&x) && (0..HEIGHT as isize).contains(&y);
        inside && rows[y as usize] >> (WIDTH as isize - 1 - x) & 1 == 1
    };
    let mut out = vec![];
    for (x, y) in
        (0..HEIGHT as isize).flat_map(|y| (0..WIDTH as isize).map(move |x| (x, y))).filter(|(x, y)| dot(*x, *y))
    {
        let here = [x as f64, y as f64];
        let mut lone = true;
        for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))).filter(|d| *d != (0, 0)) {
            let joined = dot(x + dx, y + dy) && (dx == 0 || dy == 0 || !(dot(x + dx, y) || dot(x, y + dy)));
            lone &= !joined;
            // each line once
            if joined && (dy, dx) > (0, 0) {
                out.push([here, [(x + dx) as f64, (y + dy) as f64]]);
            }
        }
        if lone {
            out.push([here; 2]);
        }
    }
    out
}

/// `[character − space][row]`.
#[rustfmt::skip]
const ASCII: [[u8; HEIGHT]; 95] = [
    // space ! " # $ % & '
    [0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00],
    [0x04, 0x04, 0x04, 0x04, 0x04, 0x00, 0x04],
    [0x0a, 0x0a, 0x0a, 0x00, 0x00, 0x00, 0x00],
    [0x0a, 0x0a, 0x1f, 0x0a, 0x1f, 0x0a, 0x0a],
    [0x04, 0x0f, 0x14, 0x0e, 0x05, 0x1e, 0x04],
    [0x18, 0x19, 0x02, 0x04, 0x08, 0x13, 0x03],
    [0x0c, 0x12, 0x14, 0x08, 0x15, 0x12, 0x0d],
    [0x04, 0x04, 0x08, 0x00, 0x00, 0x00, 0x00],
    // ( ) * + , - . /
    [0x02, 0x04, 0x08, 0x08, 0x08, 0x04, 0x02],
    [0x08, 0x04, 0x02, 0x02, 0x02, 0x04, 0x08],
    [0x00, 0x04, 0x15, 0x0e, 0x15, 0x04, 0x00],
    [0x00, 0x04, 0x04, 0x1f, 0x04, 0x04, 0x00],
    [0x00, 0x00, 0x00, 0x00, 0x0c, 0x04, 0x08],
    [0x00, 0x00, 0x00, 0x1f, 0x00, 0x00, 0x00],
    [0x00, 0x00, 0x00, 0x00, 0x00, 0x0c, 0x0c],
    [0x00, 0x01, 0x02, 0x04, 0x08, 0x10, 0x00],
    // 0 1 2 3 4 5 6 7
    [0x0e, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0e],
    [0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e],
    [0x0e, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1f],
    [0x1f, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0e],
    [0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02],
    [0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e],
    [0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e],
    [0x1f, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08],
    // 8 9 : ; < = > ?
    [0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e],
    [0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c],
    [0x00, 0x0c, 0x0c, 0x00, 0x0c, 0x0c, 0x00],
    [0x00, 0x0c, 0x0c, 0x00, 0x0c, 0x04, 0x08],
    [0x02, 0x04, 0x08, 0x10, 0x08, 0x04, 0x02],
    [0x00, 0x00, 0x1f, 0x00, 0x1f, 0x00, 0x00],
    [0x08, 0x04, 0x02, 0x01, 0x02, 0x04, 0x08],
    [0x0e, 0x11, 0x01, 0x02, 0x04, 0x00, 0x04],
    // @ A B C D E F G
    [0x0e, 0x11, 0x01, 0x0d, 0x15, 0x15, 0x0e],
    [0x0e, 0x11, 0x11, 0x11, 0x1f, 0x11, 0x11],
    [0x1e, 0x11, 0x11, 0x1e, 0x11, 0x11, 0x1e],
    [0x0e, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0e],
    [0x1c, 0x12, 0x11, 0x11, 0x11, 0x12, 0x1c],
    [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x1f],
    [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x10],
    [0x0e, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0f],
    // H I J K L M N O
    [0x11, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11],
    [0x0e, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e],
    [0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0c],
    [0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11],
    [0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f],
    [0x11, 0x1b, 0x15, 0x15, 0x11, 0x11, 0x11],
    [0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11],
    [0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e],
    // P Q R S T U V W
    [0x1e, 0x11, 0x11, 0x1e, 0x10, 0x10, 0x10],
    [0x0e, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0d],
    [0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11],
    [0x0f, 0x10, 0x10, 0x0e, 0x01, 0x01, 0x1e],
    [0x1f, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04],
    [0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e],
    [0x11, 0x11, 0x11, 0x11, 0x11, 0x0a, 0x04],
    [0x11, 0x11, 0x11, 0x15, 0x15, 0x15, 0x0a],
    // X Y Z [ \ ] ^ _
    [0x11, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x11],
    [0x11, 0x11, 0x11, 0x0a, 0x04, 0x04, 0x04],
    [0x1f, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1f],
    [0x0e, 0x08, 0x08, 0x08, 0x08, 0x08, 0x0e],
    [0x00, 0x10, 0x08, 0x04, 0x02, 0x01, 0x00],
    [0x0e, 0x02, 0x02, 0x02, 0x02, 0x02, 0x0e],
    [0x04, 0x0a, 0x11, 0x00, 0x00, 0x00, 0x00],
    [0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x1f],
    // ` a b c d e f g
    [0x08, 0x04, 0x02, 0x00, 0x00, 0x00, 0x00],
    [0x00, 0x00, 0x0e, 0x01, 0x0f, 0x11, 0x0f],
    [0x10, 0x10, 0x16, 0x19, 0x11, 0x11, 0x1e],
    [0x00, 0x00, 0x0e, 0x10, 0x10, 0x11, 0x0e],
    [0x01, 0x01, 0x0d, 0x13, 0x11, 0x11, 0x0f],
    [0x00, 0x00, 0x0e, 0x11, 0x1f, 0x10, 0x0e],
    [0x06, 0x09, 0x08, 0x1c, 0x08, 0x08, 0x08],
    [0x00, 0x0f, 0x11, 0x11, 0x0f, 0x01, 0x0e],
    // h i j k l m n o
    [0x10, 0x10, 0x16, 0x19, 0x11, 0x11, 0x11],
    [0x04, 0x00, 0x0c, 0x04, 0x04, 0x04, 0x0e],
    [0x02, 0x00, 0x06, 0x02, 0x02, 0x12, 0x0c],
    [0x10, 0x10, 0x12, 0x14, 0x18, 0x14, 0x12],
    [0x0c, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e],
    [0x00, 0x00, 0x1a, 0x15, 0x15, 0x11, 0x11],
    [0x00, 0x00, 0x16, 0x19, 0x11, 0x11, 0x11],
    [0x00, 0x00, 0x0e, 0x11, 0x11, 0x11, 0x0e],
    // p q r s t u v w
    [0x00, 0x00, 0x1e, 0x11, 0x1e, 0x10, 0x10],
    [0x00, 0x00, 0x0d, 0x13, 0x0f, 0x01, 0x01],
    [0x00, 0x00, 0x16, 0x19, 0x10, 0x10, 0x10],
    [0x00, 0x00, 0x0e, 0x10, 0x0e, 0x01, 0x1e],
    [0x08, 0x08, 0x1c, 0x08, 0x08, 0x09, 0x06],
    [0x00, 0x00, 0x11, 0x11, 0x11, 0x13, 0x0d],
    [0x00, 0x00, 0x11, 0x11, 0x11, 0x0a, 0x04],
    [0x00, 0x00, 0x11, 0x11, 0x15, 0x15, 0x0a],
    // x y z { | } ~
    [0x00, 0x00, 0x11, 0x0a, 0x04, 0x0a, 0x11],
    [0x00, 0x00, 0x11, 0x11, 0x0f, 0x01, 0x0e],
    [0x00, 0x00, 0x1f, 0x02, 0x04, 0x08, 0x1f],
    [0x02, 0x04, 0x04, 0x08, 0x04, 0x04, 0x02],
    [0x04, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04],
    [0x08, 0x04, 0x04, 0x02, 0x04, 0x04, 0x08],
    [0x00, 0x00, 0x08, 0x15, 0x02, 0x00, 0x00],
];

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

    #[test]
    fn lightness_rises_evenly() {
        // L* of CIE 1976
        let lightness = |share: f64| {
            let linear = color_of(share).map(|c| (f64::from(c) / 255.0).powf(2.2));
            let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
            116.0 * y.cbrt() - 16.0
        };
        let steps: Vec<f64> =
            (0..20).map(|k| lightness(f64::from(k + 1) / 20.0) - lightness(f64::from(k) / 20.0)).collect();
        assert!(steps.iter().all(|step| (1.5..6.5).contains(step)), "{steps:?}");
        assert_eq!((color_of(-1.0), color_of(2.0), color_of(f64::NAN)), (VIRIDIS[0], VIRIDIS[10], [128; 3]));
    }
}
