//! Cubes that state no orientation.

use areograph_base::error::Cause;

/// A cube whose tables cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input: "run spiceinit on the cube again, or configure the image by label and kernels or by support data (isd)")]
pub(super) enum CubeError {
    #[error("not an ISIS cube: expected Object = IsisCube at the start of the file")]
    #[cause("name the cube in images.cube, and other labels in images.label")]
    NotACube,
    #[error("the label has no End; expected a complete cube label")]
    #[cause("fetch or regenerate the cube: it is truncated or damaged")]
    NoEnd,
    #[error(
        "the cube has no table {name}; expected InstrumentPosition, InstrumentPointing, BodyRotation and SunPosition, as spiceinit \
         writes them, or the string CSMState of csminit"
    )]
    NoTable { name: &'static str },
    #[error("{object} of the cube: {key} is {value}; expected {expected}")]
    Table {
        object: String,
        key: String,
        value: String,
        expected: String,
    },
    #[error("{object} of the cube ends at byte {needed}; the file has {found} bytes")]
    #[cause(like = NoEnd)]
    Short {
        object: String,
        needed: u64,
        found: u64,
    },
    #[error("group {group} of the cube: {key} is {value:?}; expected {expected}")]
    #[cause(
        "regenerate the cube from the archive image: its label is damaged, or was written by a program other than \
        ISIS"
    )]
    Label {
        group: &'static str,
        key: &'static str,
        value: String,
        expected: String,
    },
    #[error(
        "the position table of the cube spans {table_s:.4} s; expected {whole_s:.4} s (whole image) or {part_s:.4} s (part); \
         the first line of the table is unknown"
    )]
    Span {
        table_s: f64,
        whole_s: f64,
        part_s: f64,
    },
    #[error(
        "table {table} of the cube has epochs from {first_s} to {last_s}; expected epochs that cover the whole image, which was exposed from ET {start_s} s to {stop_s} s"
    )]
    Reach {
        table: &'static str,
        first_s: f64,
        last_s: f64,
        start_s: f64,
        stop_s: f64,
    },
    #[error(
        "the state of the camera model has {} lines and {} samples; expected {} and {}, as in the cube before any map \
         projection",
        state[0], state[1], cube[0], cube[1]
    )]
    #[cause(
        "run csminit again, with support data of this part of the image: the cube was cropped or reduced after csminit"
    )]
    StateSize { state: [u32; 2], cube: [u32; 2] },
    #[error(
        "the state of the camera model belongs to product {state}; expected {label}, the product in the label"
    )]
    #[cause("run csminit on the cube again, with the support data of its own image")]
    StateOfOther { state: String, label: String },
}
