//! A perceptual colour map: equal steps of the value are equal steps of lightness, for any kind of colour vision.
//! Source: `viridis` of matplotlib (Smith, van der Walt 2015, CC0), at eleven values, linear between them.

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

#[cfg(test)]
mod tests {
    use super::*;

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
