//! Errors of the scene writer.

use areograph_base::error::Cause;

/// Errors of the scene writer.
#[derive(Debug, thiserror::Error, Cause)]
pub enum SceneError {
    /// The folder holds something that is not an older scene.
    #[error(
        "the folder is not empty and contains no areograph scene (its file list {list} is missing)"
    )]
    #[cause(Configuration: "choose an empty or new folder")]
    NotAScene {
        /// File by which a scene is recognised.
        list: &'static str,
    },
    /// The folder holds files outside an older scene.
    #[error("the folder contains {entry}, which `areograph scene` did not write")]
    #[cause(Configuration: "a new scene would remove it: move it elsewhere, or choose another folder")]
    Foreign {
        /// Path below the folder.
        entry: String,
    },
    /// A file of the older scene has been changed.
    #[error("{file} has been changed since `areograph scene` wrote it")]
    #[cause(like = Foreign)]
    Changed {
        /// Path below the folder.
        file: String,
    },
    /// The folder holds a scene of another kind, or of another version.
    #[error("the folder contains a scene of another kind, or of another version of areograph")]
    #[cause(Configuration: "choose another folder, or remove this one")]
    Other,
    /// No orbit shows the site as planned.
    #[error(
        "no orbit found from which {image} shows the planned ground: last step {step} rad after {iterations} \
         iterations; expected below 1e-13 rad"
    )]
    #[cause(Bug: "report this with the seed and the kernels that were used")]
    NoOrbit {
        /// Image id.
        image: String,
        /// Size of the last Newton step.
        step: f64,
        /// Steps taken.
        iterations: u32,
    },
    /// The true orientation of an image is invalid.
    #[error(
        "image {image} does not show its tie points according to its true orientation: {error}"
    )]
    #[cause(like = NoOrbit)]
    NoCamera {
        /// Image id.
        image: String,
        /// The reason.
        error: String,
    },
    /// An image that cannot be rendered or encoded.
    #[error("image {image}: {error}")]
    #[cause(like = NoOrbit)]
    Image {
        /// Image id.
        image: String,
        /// The reason.
        error: String,
    },
    /// The beam misses Mars.
    #[error("the laser beam misses Mars at ET {et_s:.3}")]
    #[cause(Input: "the attitude kernels do not point +Z at Mars at this time; omit them")]
    BeamMisses {
        /// True time of the shot.
        et_s: f64,
    },
    /// A frame needs an instant that was not tabulated.
    #[error("no beam was tabulated for ET {et_s:.6}")]
    #[cause(like = NoOrbit)]
    NotTabulated {
        /// The requested true time.
        et_s: f64,
    },
    /// An option out of its range: a day shorter than its image or longer than a file may be, more noise than the image
    /// margins allow.
    #[error("{option} is {value}; expected {least} to {most}")]
    #[cause(Configuration: "choose a value within these bounds")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The requested value.
        value: f64,
        /// Least value.
        least: f64,
        /// Largest value.
        most: f64,
    },
    /// A campaign with too many images for its places or times.
    #[error("no room for further {what} of the campaign")]
    #[cause(like = NoOrbit)]
    Crowded {
        /// What is used up.
        what: &'static str,
    },
    /// The kernels do not cover a single stretch of 20 s.
    #[error("the kernels contain no interval of {least_s} s or more with both orbit and attitude")]
    #[cause(Coverage: "check that the metakernel loads SPKs of -94 and 499 and a CK of -94000 that cover the same \
     time")]
    NothingToFly {
        /// Shortest stretch of flight, seconds.
        least_s: f64,
    },
}
