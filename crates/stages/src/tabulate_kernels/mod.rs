//! Adjusted orientations as states and attitudes for SPICE kernels that are loaded after the original ones.
//!
//! Time tags of the attitude follow the rule of the kernels that they replace: the attitude of an exposure at `t` is
//! stored at `t` + bias, with the bias of the readers. ISIS and ALE always read MOC attitude 1.15 s before the exposure
//! (`SetTimeBias(-1.15)` in ISIS, `instrument_time_bias` in ALE), whatever the bias of the site is.
//!
//! A shift of line times is folded into both kernels: at the tag of a line they have the orientation of the instant at
//! which it was exposed. Therefore each pair is valid for its image only, not for other events at that time such as
//! laser shots.
//!
//! Kernels hold geometric states, and every reader computes the camera by its own convention for light time. Therefore
//! there are two pairs for each image ([`AdjustedTables`]): one for readers with the convention of the run, and one for
//! ISIS and ALE. Both give the same adjusted rays; `orientation/centre.rs` has the derivation.
//!
//! Between two images the kernels end half way. Of two that were exposed at once, or closer in time than the tolerance
//! with which attitude is read (CSPICE uses the last file with an attitude within it), the later one takes precedence
//! in `adjusted.tm`; with only its own pair loaded, each is right.

mod read_back;
mod tables;

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::{orientation::Orientation, tag_times::ImageTimes};
use areograph_base::{
    error::{Cause, Result},
    instruments::Instrument,
    time::{Et, Interval, PointingBias},
};
use areograph_config::{KernelsConfig, PointingConfig};
use areograph_geom::{light_time::LightTime, pushbroom::SamplesError};
use areograph_spice::{KernelView, Session, State};
use areograph_store::{
    stage::{InOrder, Output, Stage},
    stage_inputs,
};
pub use read_back::require_same;
use tables::Source;

/// How readers of kernels compute a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KernelReading {
    /// Their convention for light time.
    pub light_time: LightTime,
    /// The bias at which they read the attitude.
    pub bias: PointingBias,
}

impl KernelReading {
    /// As the run does, whose bias may replace the camera's.
    #[must_use]
    pub fn of_run(light_time: LightTime, camera: &Instrument, pointing: &PointingConfig) -> Self {
        Self {
            light_time,
            bias: pointing.bias_of(camera),
        }
    }

    /// As ISIS and ALE do.
    #[must_use]
    pub fn of_isis(camera: &Instrument) -> Self {
        Self {
            light_time: LightTime::Centre,
            bias: camera.pointing_bias(),
        }
    }
}

/// Contents of the adjusted kernels of one image, by the convention of their readers; empty for an image of support data,
/// which has no original kernels.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AdjustedTables {
    /// For readers with the convention of the run.
    pub own: KernelTables,
    /// For ISIS and ALE, [`KernelReading::of_isis`].
    pub centre: KernelTables,
}

/// Contents of an SPK and a CK for one image.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelTables {
    /// Instants of the states, increasing.
    pub epochs: Vec<Et>,
    /// The spacecraft from Mars, geometric, J2000, for Hermite interpolation of [`Self::STATE_DEGREE`].
    pub states: Vec<State>,
    /// Encoded clock of the attitudes as the CK counts time, increasing.
    pub ticks: Vec<f64>,
    /// J2000 → bus, scalar first, SPICE's convention.
    pub quaternions: Vec<[f64; 4]>,
    /// Angular velocity of the bus in J2000, radians per second.
    pub rates_rad_s: Vec<[f64; 3]>,
}

impl KernelTables {
    /// Degree of the interpolation: with a state at every sample, a cubic represents the motion between two of them.
    pub const STATE_DEGREE: i32 = 3;
}

stage_inputs! {
    /// The adjusted orientation of one image, and the kernels around it.
    pub struct TabulateKernels<'a> {
        /// Identifier of the image.
        pub image: &'a str,
        /// Its index among the images.
        pub index: &'a usize,
        /// Line times of all images.
        pub times: InOrder<'a, Output<ImageTimes>>,
        /// Its orientation at the tags of the lines, see [`super::reorient`].
        pub orientation: &'a Output<Orientation>,
        /// The original kernels.
        pub kernels: &'a KernelView,
        /// Padding and tolerance with which the image was sampled.
        pub coverage: &'a KernelsConfig,
        /// The pointing bias that users of the kernels will apply, where it replaces the camera's.
        pub pointing: &'a PointingConfig,
    }
}

impl Stage for TabulateKernels<'_> {
    const NAME: &'static str = "tabulate_kernels";
    const METHOD: u32 = 3;
    type Output = AdjustedTables;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        Some(self.image.to_owned())
    }

    fn run(&self, _stop: &AtomicBool) -> Result<AdjustedTables> {
        let times = self.times.0.iter().map(Output::value);
        let times = times.collect::<Result<Vec<_>>>()?;
        if times[*self.index].support.is_some() {
            return Ok(AdjustedTables::default());
        }
        let (session, orientation) = (self.kernels.session()?, self.orientation.value()?);
        let tabulate = |reading| {
            let kernels = self.coverage;
            let index = *self.index;
            tabulate_kernels(
                session,
                &times,
                index,
                orientation,
                reading,
                kernels,
                self.pointing,
            )
        };
        let camera = &times[*self.index].instrument;
        let light_time = orientation.light_time.convention;
        let of_run = KernelReading::of_run(light_time, camera, self.pointing);
        let of_isis = KernelReading::of_isis(camera);
        let own = tabulate(of_run)?;
        let centre = if of_run == of_isis {
            own.clone()
        } else {
            tabulate(of_isis)?
        };
        Ok(AdjustedTables { own, centre })
    }
}

/// An orientation that kernels cannot hold.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Bug)]
enum TabulateError {
    #[error("image {image}: {source}")]
    #[cause("report this with the site's configuration and the log")]
    Samples { image: String, source: SamplesError },
    #[error("read back differently: {what}")]
    #[cause(
        "check the disk and run again; if the error persists, report it with the site's configuration"
    )]
    ReadBack { what: String },
}

/// States and attitudes around one of `images`, whose adjusted orientation is `orientation`, for readers that compute
/// cameras by `reading`.
///
/// Attitudes come from samples and camera tables, positions from the original kernels plus the interpolated difference
/// at the samples; positions are geometric, so that readers with their convention obtain the positions of `orientation`. Around the image, where neither is available, the original motion continues with the difference at the
/// end. Sampling an image with its kernels loaded reproduces its orientation within 1 mm and 1e-9 rad.
///
/// # Errors
/// [`Kind::Coverage`](areograph_base::error::Kind::Coverage) where the original kernels do not reach around an image; [`Kind::Bug`](areograph_base::error::Kind::Bug) for too few samples.
pub fn tabulate_kernels(
    session: &Session,
    images: &[&ImageTimes],
    index: usize,
    orientation: &Orientation,
    reading: KernelReading,
    kernels: &KernelsConfig,
    pointing: &PointingConfig,
) -> Result<KernelTables> {
    let source = Source {
        session: &session.of(images[index].instrument.spacecraft),
        times: images[index],
        orientation,
        reading,
        tolerance_s: kernels.ck_tolerance_s,
        bias: pointing.bias_of(&images[index].instrument),
        attitude_span: span(images, index, kernels.padding_s),
        orbit_span: span(images, index, kernels.padding_s + LightTime::REACH_S),
    };
    source.tables()
}

/// The time that the kernels of an image cover: its exposures with padding, at most half way to other images of its
/// spacecraft.
fn span(images: &[&ImageTimes], index: usize, padding_s: f64) -> Interval {
    let spacecraft = images[index].instrument.spacecraft;
    let exposed = images[index].exposures();
    let mut span = exposed.padded(padding_s);
    // Kernels of another spacecraft do not interfere.
    for other in images
        .iter()
        .filter(|other| other.instrument.spacecraft == spacecraft)
    {
        let others = other.exposures();
        if others.stop <= exposed.start {
            let middle = others.stop.plus(0.5 * exposed.start.since(others.stop));
            span.start = later(span.start, middle);
        } else if exposed.stop <= others.start {
            let middle = exposed.stop.plus(0.5 * others.start.since(exposed.stop));
            span.stop = earlier(span.stop, middle);
        }
    }
    span
}

fn later(a: Et, b: Et) -> Et {
    if a < b { b } else { a }
}

fn earlier(a: Et, b: Et) -> Et {
    if b < a { b } else { a }
}
