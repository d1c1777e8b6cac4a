//! Exterior orientation of an image: position and rotation of the camera at equally spaced epochs, by kernels or by
//! support data.

mod against_kernels;
mod camera_tables;
mod conventions;
mod support;

use std::{fmt, sync::atomic::AtomicBool};

use self::{
    against_kernels::{Comparison, compare},
    support::support_orientation,
};
use super::{orientation::CameraReader, tag_times::ImageTimes};
use areograph_base::{error::Result, time::Et};
use areograph_config::{KernelsConfig, OrientationConfig, PointingConfig};
use areograph_geom::{light_time::LightTime, statistics::largest};
use areograph_spice::{KernelView, Session};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

pub use super::orientation::{
    BoresightGround, CameraTables, GroundPoint, InterpolationCheck, LightTimeEffect, Orientation,
    OrientationSample, OtherConvention, SeenFromCentre,
};

/// Time between the attitude samples of the mission's C-kernels, seconds: their spacing does not explain an attitude
/// that is held for longer, and the bus turns by 0.2° in that time.
const ATTITUDE_SPACING_S: f64 = 4.0;

stage_inputs! {
    /// The times of one image, the kernels, and how they are sampled.
    pub struct SampleOrientation<'a> {
        /// Identifier of the image.
        pub image: &'a str,
        /// Its line times.
        pub times: &'a Output<ImageTimes>,
        /// All kernels: attitude may pass through any frame.
        pub kernels: &'a KernelView,
        /// Tolerance and padding.
        pub coverage: &'a KernelsConfig,
        /// A pointing bias that replaces the camera's.
        pub pointing: &'a PointingConfig,
        /// Number of samples, and the convention for light time.
        pub orientation: &'a OrientationConfig,
    }
}

impl Stage for SampleOrientation<'_> {
    const NAME: &'static str = "sample_orientation";
    const METHOD: u32 = 9;
    type Output = Orientation;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        Some(self.image.to_owned())
    }

    fn run(&self, _stop: &AtomicBool) -> Result<Orientation> {
        let times = self.times.value()?;
        if let Some(support) = &times.support {
            let epochs = epochs(times, self.orientation.intervals);
            let mut orientation = support_orientation(times, &support.tables, &epochs)?;
            let compared = self.against_kernels(times);
            orientation.invalid_because.extend(compared.contradiction);
            orientation.notes.extend(compared.note);
            return Ok(orientation);
        }
        sample_orientation(
            self.kernels.session()?,
            times,
            self.coverage,
            self.pointing,
            self.orientation,
        )
    }

    /// Whether position and attitude can be read throughout the image, and are valid.
    fn examine(&self) -> Vec<Result<String>> {
        // Failures of times or kernels have been reported.
        let Some(times) = self.times.get() else {
            return Vec::new();
        };
        if let Some(support) = &times.support {
            let epochs = epochs(times, self.orientation.intervals);
            let sampled = support_orientation(times, &support.tables, &epochs);
            let contradiction = |_| self.against_kernels(times).contradiction;
            let invalid = sampled.map(contradiction);
            return vec![invalid.map(|reason| finding(times, reason.as_slice()))];
        }
        if self.kernels.kernels().is_none() {
            return Vec::new();
        }
        let session = self.kernels.session();
        let invalid = session.and_then(|session| {
            require_orientation(
                session,
                times,
                self.coverage,
                self.pointing,
                self.orientation,
            )
        });
        vec![invalid.map(|reasons| finding(times, &reasons))]
    }
}

impl SampleOrientation<'_> {
    /// Support data compared with the kernels beside them.
    fn against_kernels(&self, times: &ImageTimes) -> Comparison {
        compare(times, self.kernels, self.coverage, self.pointing)
    }
}

/// The finding on an image whose orientation can be read, with the reasons why it would be invalid.
fn finding(times: &ImageTimes, invalid_because: &[String]) -> String {
    let invalid = invalid_because.iter();
    let invalid = invalid.map(|reason| format!("; the products would be invalid: {reason}"));
    format!(
        "image {}: {} lines from {} UTC, first line centre {}, position and attitude covered{}",
        times.id,
        times.line_times.lines(),
        times.utc_start,
        times.line_centre(0),
        invalid.collect::<String>()
    )
}

/// Samples the orientation of `image`.
///
/// Position and Mars rotation belong to the exposure, or to the instant that the convention for light time requires;
/// attitude is read at the exposure plus the pointing bias.
/// `R(camera → Mars) = R(J2000 → Mars) · R(J2000 → bus)ᵀ · R(bus → camera)ᵀ`.
///
/// # Errors
/// Kernels that do not cover the image with its padding; the gap is named.
/// # Source
/// Shan et al. 2005, p. 99 (30 intervals) and eq. 1.
pub fn sample_orientation(
    session: &Session,
    image: &ImageTimes,
    kernels: &KernelsConfig,
    pointing: &PointingConfig,
    sampling: &OrientationConfig,
) -> Result<Orientation> {
    let reach = (sampling.light_time).read_over(image.exposures().padded(kernels.padding_s));
    let session = &session.of(image.instrument.spacecraft).tabulated(reach);
    let reader = CameraReader {
        session,
        instrument: &image.instrument,
        bias: pointing.bias_of(&image.instrument),
        tolerance_s: kernels.ck_tolerance_s,
        light_time: sampling.light_time,
    };
    reader.require_coverage(image, kernels.padding_s)?;
    let epochs = epochs(image, sampling.intervals);
    let mut samples = OrientationSample::at_epochs(image, &epochs, |et| reader.camera(et))?;
    for sample in &mut samples {
        sample.to_spacecraft_m = reader.geometric(sample.et)?.xyz_m - sample.position.xyz_m;
    }
    let (tables, of_nodes_s) = camera_tables::camera_tables(&reader, image, kernels.padding_s)?;
    let held = held_attitudes(&reader, &epochs, of_nodes_s)?;
    let far = held.as_ref().filter(|held| held.is_unexplained());
    Ok(Orientation {
        image: image.id.clone(),
        body: image.body,
        samples,
        outline: GroundPoint::outline(image, |et| reader.camera(et))?,
        light_time: reader.effect(image)?,
        centre: seen_from_centre(&reader, image, &tables)?,
        tables,
        invalid_because: far.map(HeldAttitudes::reason).into_iter().collect(),
        notes: held.iter().map(ToString::to_string).collect(),
    })
}

/// The image as ISIS and ALE see it, where the convention of the run differs.
fn seen_from_centre(
    reader: &CameraReader<'_>,
    image: &ImageTimes,
    tables: &CameraTables,
) -> Result<Option<SeenFromCentre>> {
    if reader.light_time == LightTime::Centre {
        return Ok(None);
    }
    let reader = reader.with(LightTime::Centre);
    SeenFromCentre::of(&reader, image, tables, reader.effect(image)?).map(Some)
}

/// Makes sure, with as few readings as possible, that [`sample_orientation`] succeeds; returns the reasons why its
/// orientation would be invalid.
///
/// Positions and attitudes are read at the samples, more often where the samples are farther apart than the C-kernels'
/// samples, and at the ends of the camera tables. How far attitudes are extrapolated depends on every reading: where
/// the tolerance permits them to be extrapolated too far, all are made.
fn require_orientation(
    session: &Session,
    image: &ImageTimes,
    kernels: &KernelsConfig,
    pointing: &PointingConfig,
    sampling: &OrientationConfig,
) -> Result<Vec<String>> {
    if kernels.ck_tolerance_s >= ATTITUDE_SPACING_S {
        let sampled = sample_orientation(session, image, kernels, pointing, sampling)?;
        return Ok(sampled.invalid_because);
    }
    let session = &session.of(image.instrument.spacecraft);
    let reader = CameraReader {
        session,
        instrument: &image.instrument,
        bias: pointing.bias_of(&image.instrument),
        tolerance_s: kernels.ck_tolerance_s,
        light_time: sampling.light_time,
    };
    reader.require_coverage(image, kernels.padding_s)?;
    let mut intervals = sampling.intervals;
    while image.duration_s() / f64::from(intervals) > ATTITUDE_SPACING_S {
        intervals *= 2;
    }
    for epoch in epochs(image, intervals) {
        reader.camera(epoch)?;
    }
    camera_tables::require_ends(&reader, image, kernels.padding_s)?;
    Ok(Vec::new())
}

/// Equally spaced epochs over the complete header image, both ends included.
fn epochs(image: &ImageTimes, intervals: u32) -> Vec<Et> {
    let step_s = image.duration_s() / f64::from(intervals);
    let epochs = (0..=intervals).map(|k| image.line_times.start().plus(f64::from(k) * step_s));
    epochs.collect()
}

/// Attitudes that were read outside the C-kernels' intervals, where the last or next one is held constant.
struct HeldAttitudes {
    lookups: usize,
    of: usize,
    distance_max_s: f64,
}

impl HeldAttitudes {
    fn is_unexplained(&self) -> bool {
        // Written so that NaN counts.
        !(self.distance_max_s <= ATTITUDE_SPACING_S)
    }

    fn reason(&self) -> String {
        format!(
            "attitude extrapolated for up to {:.3} s beyond the C-kernels; limit {ATTITUDE_SPACING_S} s, the time between \
             their samples",
            self.distance_max_s
        )
    }
}

impl fmt::Display for HeldAttitudes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} of {} attitudes lie outside the C-kernels' intervals, by up to {:.3} s; within kernels.ck_tolerance_s, \
             the nearest attitude is used, although the bus rotates",
            self.lookups, self.of, self.distance_max_s
        )
    }
}

/// Attitudes at `exposures`, and at nodes with these distances, that lie outside the C-kernels' intervals, if there are
/// any.
fn held_attitudes(
    reader: &CameraReader<'_>,
    exposures: &[Et],
    mut distances_s: Vec<f64>,
) -> Result<Option<HeldAttitudes>> {
    for exposure in exposures {
        distances_s.push(reader.attitude(*exposure)?.distance_s);
    }
    let lookups = distances_s.iter().filter(|s| !(**s <= 0.0)).count();
    Ok((lookups > 0).then(|| HeldAttitudes {
        lookups,
        of: distances_s.len(),
        distance_max_s: largest(distances_s.iter().copied()).unwrap_or_default(),
    }))
}
