//! The pictures of similarities on the page, against the result that they are made from.

use areograph::{report::match_page, stages::match_laser::UnitResult};
use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::MATCHED;

/// What stands between `from` and `to` in `text`.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let rest = &text[text.find(from).unwrap() + from.len()..];
    &rest[..rest.find(to).unwrap()]
}

fn number(text: &str, attribute: &str) -> f64 {
    between(text, &format!(" {attribute}=\""), "\"")
        .parse()
        .unwrap()
}

/// Every pixel of a picture by its place in the palette, which goes from dark to light, and pixels from side to side.
fn lightness(picture: &str) -> (Vec<u8>, usize) {
    let file = STANDARD.decode(between(picture, "base64,", "\"")).unwrap();
    let decoder = png::Decoder::new(std::io::Cursor::new(file));
    let mut reader = decoder.read_info().unwrap();
    let palette = reader.info().palette.clone().unwrap();
    let light = |at: usize| -> u32 {
        palette[3 * at..3 * at + 3]
            .iter()
            .map(|of| u32::from(*of))
            .sum()
    };
    // The first is no colour.
    assert!((2..palette.len() / 3).all(|at| light(at) > light(at - 1)));
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let head = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(
        (head.width, head.color_type),
        (head.height, png::ColorType::Indexed)
    );
    (pixels, head.width as usize)
}

#[test]
fn every_searched_unit_has_a_picture_whose_brightest_pixel_is_its_best_shift() {
    let page = match_page(&MATCHED).unwrap();
    let searched = MATCHED.units.iter().filter(|unit| unit.found.is_some());
    let searched: Vec<&UnitResult> = searched.collect();
    assert_eq!(page.matches("data:image/png").count(), searched.len());
    assert!(searched.iter().any(|unit| !unit.is_kept()));
    for unit in searched {
        let kept = if unit.is_kept() { "kept" } else { "not kept" };
        let name = format!("aria-label=\"Unit {}, {kept}: ", unit.unit);
        let picture = between(&page, &name, "</svg>");
        let (pixels, side) = lightness(picture);
        // Within 30 cells every shift has a pixel.
        assert_eq!(side, 61);
        let found = unit.found.unwrap();
        let brightest = pixels.iter().max().unwrap();
        let cells = |pixel: usize| [(pixel % side) as f64 - 30.0, 30.0 - (pixel / side) as f64];
        // Of pixels that are equally bright one is a cell from where a quadratic leads at most, and least squares lead one more.
        let mut at = pixels.iter().enumerate().filter(|(_, of)| *of == brightest);
        let is_best = at.any(|(pixel, _)| {
            let [east, north] = cells(pixel);
            let [off_east, off_north] = [east - found.shift_cells[0], north - found.shift_cells[1]];
            off_east.abs() <= 2.0 && off_north.abs() <= 2.0
        });
        assert!(is_best, "unit {}: {found:?}", unit.unit);
        // The mark of the best shift is where that is, to the digits of its place: 0.05 of 140 units of the drawing.
        let mark = between(picture, "#similarity-best\"", "/>");
        let cells = |axis: &str| (number(mark, axis) - number(picture, axis)) * 61.0 / 140.0;
        let [east, north] = [cells("x") - 30.5, 30.5 - cells("y")];
        let off = (east - found.shift_cells[0]).hypot(north - found.shift_cells[1]);
        assert!(off < 0.05, "unit {}: {off} cells", unit.unit);
    }
}
