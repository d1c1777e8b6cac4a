//! Image labels become line times: spacecraft clock or UTC to ET, line period, header and delivered lines; or support
//! data, which contain them.

mod agreement;
mod camera;
mod detector;
mod error;
mod pieces;
mod support;

use std::sync::atomic::AtomicBool;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use agreement::Disagreement;
use agreement::{mounting_agrees, of_one_clock, start_agrees, stop_agrees};
use camera::{calibrated, calibrated_note, camera_agrees, labelled};
use detector::{PartOfLine, fits_detector};
use error::ImageError;
use pieces::{Pieces, rows_of};
pub use support::SupportFile;
use support::supported;

use areograph_base::{
    body::Body,
    error::{Locate, Result},
    image::ImageFields,
    instruments::Instrument,
    line_times::LineTimes,
    time::{Et, Interval},
};
use areograph_config::{ImageConfig, PointingConfig, UsedBias, all_instruments};
use areograph_geom::pushbroom::Detector;
use areograph_spice::{KernelView, Session};
use areograph_store::{
    files::HashedFile,
    stage::{InOrder, Stage},
    stage_inputs,
};

/// Times and settings of the exposure of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageTimes {
    /// Image identifier.
    pub id: String,
    /// The body that it shows.
    pub body: Body,
    /// The camera.
    pub instrument: Instrument,
    /// Exposure times of its lines: all of the header image.
    pub line_times: LineTimes,
    /// Source of their start.
    pub start_from: StartFrom,
    /// Clock string of the start, where the label has one.
    pub sclk_start: Option<String>,
    /// UTC of the start.
    pub utc_start: String,
    /// Exposure of one detector line at the start of the image, seconds.
    pub exposure_s: f64,
    /// Detector lines summed along the track.
    pub downtrack_summing: u32,
    /// Detector pixels summed across the track.
    pub crosstrack_summing: u32,
    /// Lines in the delivered file.
    pub lines_delivered: u32,
    /// Samples per line.
    pub samples: u32,
    /// First detector pixel, counted from 0.
    pub first_detector: u32,
    /// Whether its label states the end of its lines, with which their period was compared.
    pub has_stop_time: bool,
    /// Notes for the reader, one sentence each.
    pub notes: Vec<String>,
    /// Disagreements that must be weighed, one sentence each.
    pub remarks: Vec<Disagreement>,
    /// Support data that its orientation comes from; `None` for an image that kernels orient.
    pub support: Option<SupportFile>,
}

/// Source of an image's start time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StartFrom {
    /// Spacecraft clock.
    Sclk,
    /// Coordinated universal time.
    Utc,
    /// Ephemeris time of support data.
    Support,
    /// Ephemeris time of the configuration.
    Exposures,
    /// Ephemeris time that the file states for every line.
    Lines,
}

impl ImageTimes {
    /// Whether its positions belong to the spacecraft with the laser, so that ranges are measured from them.
    #[must_use]
    pub fn has_laser(&self) -> bool {
        match &self.support {
            Some(support) => support.has_laser,
            None => self.instrument.spacecraft.has_laser(),
        }
    }

    /// Name of its spacecraft in labels or support data, capitals, blanks for underscores.
    #[must_use]
    pub fn spacecraft_name(&self) -> String {
        let name = match &self.support {
            Some(support) => &support.platform,
            None => &self.instrument.spacecraft.label_name,
        };
        name.to_uppercase().replace('_', " ")
    }

    /// Serial number that ISIS composes for the image; `None` when its label has no clock string, or where ISIS names
    /// images of its camera differently.
    ///
    /// # Source
    /// `MgsMocSerialNumber.trn` of ISIS (spacecraft, clock, instrument, filter) and the network of M01/00115, which names
    /// that image `MGS/610472061:131/MOC-NA/BROAD_BAND`.
    #[must_use]
    pub fn isis_serial_number(&self) -> Option<String> {
        let clock = self.sclk_start.as_ref()?;
        let camera = self.instrument.label.serial.as_ref()?;
        let spacecraft = &self.instrument.spacecraft.name;
        Some(format!("{spacecraft}/{}/{camera}", clock.trim()))
    }

    /// Viewing directions of the samples of a line.
    #[must_use]
    pub fn detector(&self) -> Detector {
        Detector::new(
            &self.instrument,
            self.crosstrack_summing,
            self.first_detector,
            self.samples,
        )
    }

    /// Exposure of the complete header image, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.line_times.duration_s()
    }

    /// From the start of the first line to the end of the last header line.
    #[must_use]
    pub fn exposures(&self) -> Interval {
        self.line_times.interval()
    }

    /// Middle of the header image, where the polynomial models have their origin.
    #[must_use]
    pub fn middle(&self) -> Et {
        self.line_times.middle()
    }

    /// Centre of the exposure of image line `line`, counted from 0.
    #[must_use]
    pub fn line_centre(&self, line: u32) -> Et {
        self.line_times.et(f64::from(line) + 0.5)
    }

    /// Time in the unit of the sensor models, see [`LineTimes::offset`]; positive along flight.
    #[must_use]
    pub fn line_offset(&self, instant: Et) -> f64 {
        self.line_times.offset(instant)
    }
}

/// The pointing biases with which kernels are read for `images`: without images the bias of the usual camera, and none
/// for images of support data only.
pub fn used_biases<'a>(
    pointing: &'a PointingConfig,
    images: impl IntoIterator<Item = &'a ImageTimes>,
) -> Vec<UsedBias<'a>> {
    let (supported, others): (Vec<_>, Vec<_>) = images
        .into_iter()
        .partition(|image| image.support.is_some());
    if others.is_empty() && !supported.is_empty() {
        return Vec::new();
    }
    pointing.used(others.into_iter().map(|image| &image.instrument))
}

stage_inputs! {
    /// Label and keys of one image, and the clocks.
    pub struct TagTimes<'a> {
        /// The body of the site.
        pub body: &'a Body,
        /// Identifier and keys written in the configuration.
        pub image: &'a ImageConfig,
        /// The label that the configuration names.
        pub label: Option<HashedFile>,
        /// The support data that it names instead.
        pub support: Option<HashedFile>,
        /// The oriented cube that it names instead.
        pub cube: Option<HashedFile>,
        /// The calibrated support data of `calibration.from`, for an image that kernels orient.
        pub calibration: InOrder<'a, HashedFile>,
        /// Text kernels.
        pub kernels: &'a KernelView,
    }
}

impl Stage for TagTimes<'_> {
    const NAME: &'static str = "tag_times";
    const METHOD: u32 = 14;
    const CHECKED: bool = true;
    type Output = ImageTimes;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        Some(self.image.id.clone())
    }

    fn run(&self, _stop: &AtomicBool) -> Result<ImageTimes> {
        tag_image(
            *self.body,
            self.image,
            self.support.as_ref().or(self.cube.as_ref()),
            self.calibration.0,
            self.kernels.session()?,
        )
    }

    fn findings(&self, times: &ImageTimes) -> Vec<String> {
        let remarks = times.remarks.iter();
        remarks
            .map(|remark| format!("image {}: {}", times.id, remark.text))
            .collect()
    }
}

/// Times of every image of Mars, in the order of the configuration.
///
/// # Errors
/// An unreadable label, a missing key, values that contradict each other, a time no kernel can convert.
pub fn tag_times(images: &[ImageConfig], session: &Session) -> Result<Vec<ImageTimes>> {
    images
        .iter()
        .map(|image| tag_image(Body::Mars, image, None, &[], session))
        .collect()
}

fn tag_image(
    body: Body,
    image: &ImageConfig,
    hashed: Option<&HashedFile>,
    calibration: &[HashedFile],
    session: &Session,
) -> Result<ImageTimes> {
    let times = match image.support() {
        Some(path) => supported(body, image, path, hashed, session),
        None => image_times(image, calibration, session),
    };
    match image.source() {
        Some(path) => times.in_file(path),
        None => times,
    }
}

fn image_times(
    image: &ImageConfig,
    calibration: &[HashedFile],
    session: &Session,
) -> Result<ImageTimes> {
    let (mut notes, mut remarks) = (Vec::new(), Vec::new());
    let (instrument, label) = labelled(image)?;
    let instrument = calibrated(instrument, calibration, (&mut notes, &mut remarks))?;
    let session = &session.of(instrument.spacecraft);
    let utc_stop = label.as_ref().and_then(|label| label.utc_stop.clone());
    let tells_lines = label.is_some() && !instrument.spacecraft.labels_tell_clock;
    let damage = label.iter().flat_map(|label| label.remarks.clone());
    remarks.extend(damage.map(Disagreement::from));
    let (of_label, label_lines) =
        label.map_or_else(Default::default, |label| (label.fields, label.lines));
    let fields = merged(&image.fields, of_label, &mut notes);
    let missing = |key| ImageError::Missing {
        image: image.id.clone(),
        key,
    };
    let lines_header = fields.lines_header.ok_or_else(|| missing("lines_header"))?;
    let lines_delivered = lines_delivered(image, &fields, lines_header, &mut notes)?;
    let downtrack_summing = fields
        .downtrack_summing
        .ok_or_else(|| missing("downtrack_summing"))?;
    let crosstrack_summing = fields.crosstrack_summing.unwrap_or(downtrack_summing);
    let samples = fields.samples.ok_or_else(|| missing("samples"))?;
    let first_detector = fields.first_detector.unwrap_or(0);
    fits_detector(
        &image.id,
        &instrument,
        [downtrack_summing, crosstrack_summing],
        [first_detector, samples],
    )?;
    let of_file = rows_of(image, label_lines.as_ref(), &mut notes);
    if fields.first_detector.is_none() && samples * crosstrack_summing < instrument.detector.pixels
    {
        let part = PartOfLine {
            instrument: &instrument,
            samples,
            crosstrack: crosstrack_summing,
        };
        remarks.push(part.on_first_pixel(&image.id, tells_lines)?.into());
    }
    remarks.extend(camera_agrees(&instrument, all_instruments()));
    of_one_clock(image, instrument.spacecraft, fields.sclk_start.as_deref())?;
    let stated_start = start_time(image, &fields, session, &mut notes, &mut remarks)?;
    let pieces = Pieces {
        image,
        fields: &fields,
        lines: lines_header,
        downtrack_summing,
    };
    let (line_times, exposure_s, start_from) =
        pieces.line_times(of_file, tells_lines, stated_start, &mut remarks)?;
    let start = line_times.start();
    session.require_published_utc(start)?;
    // Without the camera's frame, the orientation stage reports what is missing.
    if let Ok(mounting) = session.mounting(&instrument, start) {
        remarks.extend(mounting_agrees(&instrument, mounting.matrix()));
    }
    if let Some(utc) = &utc_stop {
        let stop = (&**utc, session.utc_to_et(utc)?);
        // Both are UTC of the label; the clock is compared with it elsewhere.
        let start = fields
            .utc_start
            .as_deref()
            .map_or(Ok(start), |utc| session.utc_to_et(utc))?;
        let of_lines = ([lines_header, lines_delivered], line_times.mean_period_s());
        remarks.extend(stop_agrees(&image.id, start, stop, of_lines)?);
    }
    Ok(ImageTimes {
        id: image.id.clone(),
        // Labels, clocks and kernels belong to a spacecraft at Mars.
        body: Body::Mars,
        instrument,
        line_times,
        start_from,
        utc_start: session.et_to_utc(start)?,
        sclk_start: fields.sclk_start,
        exposure_s,
        downtrack_summing,
        crosstrack_summing,
        lines_delivered,
        samples,
        first_detector,
        has_stop_time: utc_stop.is_some(),
        notes,
        remarks,
        support: None,
    })
}

/// Lines in the delivered file, with a note when they are fewer than in the header.
fn lines_delivered(
    image: &ImageConfig,
    fields: &ImageFields,
    header: u32,
    notes: &mut Vec<String>,
) -> std::result::Result<u32, ImageError> {
    let delivered = fields.lines_delivered.unwrap_or(header);
    if delivered > header {
        return Err(ImageError::Lines {
            image: image.id.clone(),
            delivered,
            header,
        });
    }
    if delivered < header {
        notes.push(format!(
            "{} of {header} header lines are not in the delivered file; line times refer to header lines",
            header - delivered
        ));
    }
    Ok(delivered)
}

/// Configuration over label, with a note for every key in which they differ.
fn merged(written: &ImageFields, label: ImageFields, notes: &mut Vec<String>) -> ImageFields {
    fn over<T: PartialEq + std::fmt::Debug + Clone>(
        key: &str,
        written: Option<&T>,
        label: Option<T>,
        notes: &mut Vec<String>,
    ) -> Option<T> {
        if let (Some(written), Some(label)) = (written, &label)
            && written != label
        {
            notes.push(format!(
                "{key} {written:?} of the configuration replaces {label:?} of the label"
            ));
        }
        written.cloned().or(label)
    }
    macro_rules! merge {
        ($($key:ident),*) => {
            ImageFields { $($key: over(stringify!($key), written.$key.as_ref(), label.$key, notes)),* }
        };
    }
    merge!(
        sclk_start,
        utc_start,
        exposure_s,
        line_period_s,
        downtrack_summing,
        crosstrack_summing,
        lines_header,
        lines_delivered,
        samples,
        first_detector
    )
}

/// The clock where it is given, else UTC; where both are given, they must agree.
fn start_time(
    image: &ImageConfig,
    fields: &ImageFields,
    session: &Session,
    notes: &mut Vec<String>,
    remarks: &mut Vec<Disagreement>,
) -> Result<Option<(Et, StartFrom)>> {
    let utc = fields.utc_start.as_deref();
    let from_utc = match utc {
        Some(utc) => Some((utc, session.utc_to_et(utc)?)),
        None => None,
    };
    let Some(sclk) = fields.sclk_start.as_deref() else {
        if from_utc.is_some() && session.spacecraft().labels_tell_clock {
            notes.push(
                "start time from UTC, which labels truncate to 10 ms; no clock string".to_owned(),
            );
        }
        return Ok(from_utc.map(|(_, start)| (start, StartFrom::Utc)));
    };
    let start = session.sclk_to_et(sclk)?;
    if let Some(utc) = from_utc {
        remarks.extend(start_agrees(&image.id, (sclk, start), utc)?);
    }
    Ok(Some((start, StartFrom::Sclk)))
}
