//! The style sheet of all pages: reports, and pages of the service.

/// The style sheet, CSS.
pub const STYLE: &str = include_str!("style.css");
