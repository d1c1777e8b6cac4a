//! The style of all pages: reports, and pages of the service.

/// The style sheet, CSS.
pub const STYLE: &str = include_str!("style.css");

/// Colours of the images of a mosaic, with their names.
///
/// # Source
/// Tol 2021, *Colour schemes*, "muted": distinct for colour-blind readers; and black.
pub const IMAGE_COLOURS: [(&str, [u8; 3]); 10] = [
    ("sand", [221, 204, 119]),
    ("indigo", [51, 34, 136]),
    ("cyan", [136, 204, 238]),
    ("wine", [136, 34, 85]),
    ("green", [17, 119, 51]),
    ("rose", [204, 102, 119]),
    ("teal", [68, 170, 153]),
    ("purple", [170, 68, 153]),
    ("olive", [153, 153, 51]),
    ("black", [0, 0, 0]),
];
