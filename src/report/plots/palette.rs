//! The colours of all plots.

use plotters::style::RGBColor;

/// Colours of series. Any two are apart for readers with deuteranopia too, on white paper and, as the page's style maps
/// them, on dark screens; after Okabe and Ito 2008.
pub(in crate::report) const COLOURS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xc2, 0x50, 0x00),
    RGBColor(0x3c, 0x96, 0x69),
    RGBColor(0xb0, 0x51, 0x8a),
    RGBColor(0x69, 0x4b, 0x00),
    RGBColor(0x69, 0x96, 0xc3),
    RGBColor(0x44, 0x44, 0x44),
];
/// Index of the grey among the colours.
pub(in crate::report) const GREY: usize = 6;
/// Marks, limits and outliers.
pub(in crate::report) const MARK: RGBColor = RGBColor(0xb3, 0x26, 0x1e);
/// Letters and axes.
pub(in crate::report) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Grid lines.
pub(in crate::report) const GRID: RGBColor = RGBColor(0xe2, 0xe2, 0xe2);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::STYLE;

    /// Least distance of two colours of series in CIELAB, 1976: ten times what an eye tells apart side by side.
    const APART: f64 = 20.0;

    /// What remains of linear red, green and blue without the cones for medium wavelengths.
    ///
    /// # Source
    /// Machado, Oliveira and Fernandes 2009, IEEE Trans. Vis. Comput. Graph. 15, table 1, deuteranomaly at 1.0.
    const DEUTERANOPIA: [[f64; 3]; 3] = [
        [0.367_322, 0.860_646, -0.227_968],
        [0.280_085, 0.672_501, 0.047_413],
        [-0.011_820, 0.042_940, 0.968_881],
    ];

    /// Linear sRGB to CIE XYZ over its white, D65.
    const XYZ: [[f64; 3]; 3] = [
        [0.433_953, 0.376_219, 0.189_828],
        [0.212_673, 0.715_152, 0.072_175],
        [0.017_758, 0.109_477, 0.872_766],
    ];

    fn times(matrix: &[[f64; 3]; 3], by: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|row| (0..3).map(|at| matrix[row][at] * by[at]).sum())
    }

    /// A colour as a deuteranope sees it, in CIELAB.
    fn seen(rgb: [u8; 3]) -> [f64; 3] {
        let linear = rgb.map(|channel| {
            let share = f64::from(channel) / 255.0;
            if share <= 0.040_45 {
                share / 12.92
            } else {
                ((share + 0.055) / 1.055).powf(2.4)
            }
        });
        let linear = times(&DEUTERANOPIA, linear).map(|channel| channel.clamp(0.0, 1.0));
        let [x, y, z] = times(&XYZ, linear).map(|share| {
            if share > 216.0 / 24_389.0 {
                share.cbrt()
            } else {
                (24_389.0 / 27.0 * share + 16.0) / 116.0
            }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn apart(one: [u8; 3], other: [u8; 3]) -> f64 {
        let squares = seen(one)
            .into_iter()
            .zip(seen(other))
            .map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    }

    /// The colours that a part of the page's style gives to `--c0` and so on.
    fn styled(style: &str) -> Vec<[u8; 3]> {
        let colour = |index: usize| {
            let name = format!("--c{index}:#");
            let digits = &style[style.find(&name).unwrap() + name.len()..][..6];
            [0, 2, 4].map(|at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap())
        };
        (0..COLOURS.len()).map(colour).collect()
    }

    #[test]
    fn series_are_apart_for_deuteranopes_on_light_and_dark_pages() {
        let dark_from = STYLE.find("prefers-color-scheme:dark").unwrap();
        for style in [&STYLE[..dark_from], &STYLE[dark_from..]] {
            let colours = styled(style);
            for (index, one) in colours.iter().enumerate() {
                for (place, other) in colours[..index].iter().enumerate() {
                    let apart = apart(*one, *other);
                    assert!(apart > APART, "{place} and {index}: {apart:.1}");
                }
            }
        }
        // The orange and the ochre of earlier pages would not pass.
        assert!(apart([0xc2, 0x50, 0x00], [0xa8, 0x6f, 0x00]) < 2.0);
    }

    #[test]
    fn the_style_maps_the_colours_that_are_drawn() {
        let light: Vec<[u8; 3]> = COLOURS.iter().map(|of| [of.0, of.1, of.2]).collect();
        assert_eq!(styled(STYLE), light);
        for (index, [red, green, blue]) in light.into_iter().enumerate() {
            for paint in ["fill", "stroke"] {
                let rule = format!(
                    "svg [{paint}=\"#{red:02X}{green:02X}{blue:02X}\"]{{{paint}:var(--c{index})}}"
                );
                assert!(STYLE.contains(&rule), "{rule}");
            }
        }
    }
}
