//! The colours of all plots.

use plotters::style::RGBColor;

/// Colours of series. Any two of them and of [`MARK`] are apart for readers with deuteranopia too, on white paper and,
/// as the page's style maps them, on dark screens; all contrast with the background.
pub(crate) const COLOURS: [RGBColor; 7] = [
    RGBColor(0x0e, 0x5a, 0x99),
    RGBColor(0xff, 0x61, 0x0d),
    RGBColor(0x47, 0xa4, 0x75),
    RGBColor(0xc8, 0x4a, 0x96),
    RGBColor(0x45, 0x2e, 0x00),
    RGBColor(0x01, 0x8d, 0xff),
    RGBColor(0x51, 0x51, 0x51),
];
/// Index of grey among the colours.
pub(crate) const GREY: usize = 6;
/// Marks, limits and outliers.
pub(crate) const MARK: RGBColor = RGBColor(0xc1, 0x00, 0x19);
/// Letters and axes.
pub(crate) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Names unrelated to the data.
pub(crate) const SOFT: RGBColor = RGBColor(0x55, 0x55, 0x55);
/// Grid lines.
pub(crate) const GRID: RGBColor = RGBColor(0xe2, 0xe2, 0xe2);

#[cfg(test)]
mod tests {
    use super::{super::colour_difference::ciede2000, *};
    use crate::STYLE;

    /// Least CIEDE2000 difference of two colours, for any colour vision: 1 is just noticeable side by side.
    const APART: f64 = 20.0;
    /// Least contrast of a line or mark with the page (WCAG 2.2, 1.4.11).
    const CONTRAST: f64 = 3.0;

    /// Linear red, green and blue as seen without the cones for medium wavelengths.
    ///
    /// # Source
    /// Machado, Oliveira and Fernandes 2009, IEEE Trans. Vis. Comput. Graph. 15, table 1, deuteranomaly at 1.0.
    const DEUTERANOPIA: [[f64; 3]; 3] = [
        [0.367_322, 0.860_646, -0.227_968],
        [0.280_085, 0.672_501, 0.047_413],
        [-0.011_820, 0.042_940, 0.968_881],
    ];
    const NORMAL: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// Linear sRGB to CIE XYZ over its white, D65.
    const XYZ: [[f64; 3]; 3] = [
        [0.433_953, 0.376_219, 0.189_828],
        [0.212_673, 0.715_152, 0.072_175],
        [0.017_758, 0.109_477, 0.872_766],
    ];

    fn times(matrix: &[[f64; 3]; 3], by: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|row| (0..3).map(|at| matrix[row][at] * by[at]).sum())
    }

    fn linear(rgb: [u8; 3]) -> [f64; 3] {
        rgb.map(|channel| {
            let share = f64::from(channel) / 255.0;
            if share <= 0.040_45 {
                share / 12.92
            } else {
                ((share + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// A colour as such eyes see it, in CIELAB.
    fn seen(rgb: [u8; 3], eyes: &[[f64; 3]; 3]) -> [f64; 3] {
        let linear = times(eyes, linear(rgb)).map(|channel| channel.clamp(0.0, 1.0));
        let [x, y, z] = times(&XYZ, linear).map(|share| {
            if share > 216.0 / 24_389.0 {
                share.cbrt()
            } else {
                (24_389.0 / 27.0 * share + 16.0) / 116.0
            }
        });
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn apart(one: [u8; 3], other: [u8; 3], eyes: &[[f64; 3]; 3]) -> f64 {
        ciede2000(seen(one, eyes), seen(other, eyes))
    }

    fn contrast(one: [u8; 3], other: [u8; 3]) -> f64 {
        let [one, other] = [one, other].map(|rgb| times(&XYZ, linear(rgb))[1] + 0.05);
        one.max(other) / one.min(other)
    }

    /// The colour that a part of the page's style gives to a name.
    fn named(style: &str, name: &str) -> [u8; 3] {
        let name = format!("--{name}:#");
        let digits = &style[style.find(&name).unwrap() + name.len()..];
        let digits = digits.split([';', '}']).next().unwrap();
        // Three digits stand for six.
        let digit = |at: usize| &digits[at * digits.len() / 6..][..1];
        [0, 2, 4].map(|at| {
            let both = [digit(at), digit(at + 1)].concat();
            u8::from_str_radix(&both, 16).unwrap()
        })
    }

    /// The colours that a part of the page's style gives to `--c0` and so on, and to marks.
    fn styled(style: &str) -> Vec<[u8; 3]> {
        let series = (0..COLOURS.len()).map(|index| format!("c{index}"));
        let names = series.chain(["mark".to_owned()]);
        names.map(|name| named(style, &name)).collect()
    }

    #[test]
    fn colours_are_apart_for_deuteranopes_on_light_and_dark_pages() {
        let dark_from = STYLE.find("prefers-color-scheme:dark").unwrap();
        for style in [&STYLE[..dark_from], &STYLE[dark_from..]] {
            let colours = styled(style);
            let paper = named(style, "paper");
            for (index, one) in colours.iter().enumerate() {
                for (place, other) in colours[..index].iter().enumerate() {
                    for eyes in [&NORMAL, &DEUTERANOPIA] {
                        let apart = apart(*one, *other, eyes);
                        assert!(apart > APART, "{place} and {index}: {apart:.1}");
                    }
                }
                let contrast = contrast(*one, paper);
                assert!(contrast >= CONTRAST, "{index}: {contrast:.2}");
            }
        }
        // The orange and the red, and the orange and the ochre, of earlier pages would not pass.
        assert!(apart([0xc2, 0x50, 0x00], [0xb3, 0x26, 0x1e], &DEUTERANOPIA) < 15.0);
        assert!(apart([0xc2, 0x50, 0x00], [0xa8, 0x6f, 0x00], &DEUTERANOPIA) < 5.0);
    }

    #[test]
    fn the_style_maps_the_colours_that_are_drawn() {
        let all = COLOURS.iter().chain([&MARK]);
        let light: Vec<[u8; 3]> = all.map(|of| [of.0, of.1, of.2]).collect();
        assert_eq!(styled(STYLE), light);
        for (index, [red, green, blue]) in light.into_iter().enumerate() {
            let name = if index < COLOURS.len() {
                format!("c{index}")
            } else {
                "mark".to_owned()
            };
            for paint in ["fill", "stroke"] {
                let rule = format!(
                    "svg [{paint}=\"#{red:02X}{green:02X}{blue:02X}\"]{{{paint}:var(--{name})}}"
                );
                assert!(STYLE.contains(&rule), "{rule}");
            }
        }
    }
}
