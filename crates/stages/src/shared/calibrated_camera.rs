//! The camera of an image as a calibration determined it.

use std::path::{Path, PathBuf};

use areograph_base::{
    error::{Cause, Locate as _, Result},
    instruments::{Calibrated, DetectorLine, Instrument},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{attitude::bus_to_camera, pushbroom::Detector};
use areograph_pds::isd::read_isd;

/// Largest angle between look directions of the calibrated and of the uncalibrated camera, degrees: an orbit error of 1000 m
/// (Li et al. 2023, Table 2), which a calibration absorbs in angles, is 0.2 degrees at 300 km, and lines of the HRSC are 3
/// degrees apart.
const APART_DEG: f64 = 1.0;
/// Places of the detector line at which they are compared.
const COMPARED_AT: [f64; 3] = [0.0, 0.5, 1.0];

/// A calibration that does not apply to an image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum ForeignCalibration {
    #[error(
        "the calibration has no camera {sensor}, only {known}; expected a calibration of the line of this image"
    )]
    #[cause("leave this image out, or calibrate its line as well")]
    OtherLine { sensor: String, known: String },
    #[error(
        "attitudes of the camera {sensor} refer to the frame {found} in the calibration and to {expected} for this image; expected \
         one frame of the spacecraft"
    )]
    #[cause("calibrate support data whose attitudes refer to this frame")]
    OtherFrame {
        sensor: String,
        found: i32,
        expected: i32,
    },
    #[error("not the result of a calibration; expected the key areograph_calibration")]
    #[cause("name the folder that `areograph calibrate` wrote, with its files unchanged")]
    NotCalibrated,
    #[error("the calibration {0} is invalid; expected a valid calibration")]
    #[cause("read its report, correct its inputs and run `areograph calibrate` again")]
    Invalid(String),
    #[error(
        "the camera {sensor} of the calibration looks up to {apart_deg:.3}° from the uncalibrated camera; expected at most \
         {APART_DEG}°"
    )]
    #[cause(
        "name the calibration of this camera; support data of two lines may have been exchanged"
    )]
    OtherCamera { sensor: String, apart_deg: f64 },
}

/// A camera of a calibration.
pub(crate) struct CalibratedCamera {
    /// The uncalibrated camera with calibrated mounting, optics, detector line and distortion; it does not name its calibration.
    pub(crate) camera: Instrument,
    /// The calibration, of another orbit.
    pub(crate) origin: Calibrated,
    /// Its calibrated support data.
    pub(crate) file: PathBuf,
    /// Largest change of a look direction in the frame of the bus, radians.
    pub(crate) moved_rad: f64,
}

/// The calibration of `camera`, whose spacecraft and sensor have the names `platform` and `sensor` in support data, among the
/// calibrated support data `files`; `None` if these are of other spacecraft or there are none.
///
/// # Errors
/// A file that cannot be read or is not the result of a calibration; an invalid calibration; a calibration without this
/// line, or of another camera.
pub(crate) fn calibrated_camera<'a>(
    camera: &Instrument,
    [platform, sensor]: [&str; 2],
    files: impl IntoIterator<Item = &'a Path>,
) -> Result<Option<CalibratedCamera>> {
    let mut others = Vec::new();
    for file in files {
        let support = read_isd(file)?;
        let found = support.instrument;
        let Some(of) = found.calibration.clone() else {
            return Err(ForeignCalibration::NotCalibrated).in_file(file);
        };
        if plain(&support.platform) != plain(platform) {
            continue;
        }
        if found.name != sensor {
            others.push(found.name);
            continue;
        }
        if found.naif.bus != camera.naif.bus {
            let refused = ForeignCalibration::OtherFrame {
                sensor: found.name,
                found: found.naif.bus,
                expected: camera.naif.bus,
            };
            return Err(refused).in_file(file);
        }
        if !of.valid {
            return Err(ForeignCalibration::Invalid(of.calibration)).in_file(file);
        }
        let calibrated = Instrument {
            mounting: found.mounting,
            optics: found.optics,
            detector: DetectorLine {
                pixels: camera.detector.pixels,
                ..found.detector
            },
            distortion: found.distortion,
            ..camera.clone()
        };
        let moved_rad = moved_rad(camera, &calibrated);
        let apart_deg = moved_rad / RADIANS_PER_DEGREE;
        if apart_deg > APART_DEG {
            let sensor = sensor.to_owned();
            return Err(ForeignCalibration::OtherCamera { sensor, apart_deg }).in_file(file);
        }
        return Ok(Some(CalibratedCamera {
            camera: calibrated,
            origin: Calibrated {
                is_of_other_orbit: true,
                ..of
            },
            file: file.to_owned(),
            moved_rad,
        }));
    }
    if others.is_empty() {
        return Ok(None);
    }
    Err(ForeignCalibration::OtherLine {
        sensor: sensor.to_owned(),
        known: others.join(", "),
    }
    .into())
}

/// A name of a spacecraft without differences between programs.
fn plain(name: &str) -> String {
    name.replace('_', " ").to_ascii_uppercase()
}

/// Largest angle between the look directions of two cameras in the frame of the bus, radians.
fn moved_rad(one: &Instrument, other: &Instrument) -> f64 {
    let looks = |camera: &Instrument| {
        let pixels = camera.detector.pixels;
        let detector = Detector::new(camera, 1, 0, pixels);
        let to_bus = bus_to_camera(&camera.mounting).transpose();
        COMPARED_AT.map(|share| to_bus * detector.look(share * f64::from(pixels)))
    };
    let both = looks(one).into_iter().zip(looks(other));
    both.map(|(a, b)| a.angle(&b)).fold(0.0, f64::max)
}
