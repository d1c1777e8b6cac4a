//! Image support data of an image for the Community Sensor Model, as `usgscsm` reads it.
//!
//! Keys and nesting follow ALE's image support data. Where ALE's file for MOC does not describe the camera, the numbers
//! here make `usgscsm` see the right pixel at the right time:
//!
//! * `line_scan_rate` holds the period of an *image* line, in a row for every piece of the image. `usgscsm` computes
//!   `t = start + rate · (line − 0.5 + 0.5)` with image lines and never multiplies by the summing
//!   (`UsgsAstroLsSensorModel::getImageTime`); ALE writes the exposure of one detector line.
//! * `usgscsm` puts the centre of the first sample at 0.5 and computes the detector coordinate
//!   `sample · summing + starting_detector_sample − detector_center.sample`. With the edge of the detector
//!   at 0 the centre of the narrow angle lies at 2048 / 2 = 1024; ALE's 1023.5 with a start of 1 is off by 1.5
//!   pixels.
//! * The line of the detector is taken at coordinate 0 (`losToEcf`), so its centre is 0, or the value that places a
//!   line off the boresight there.
//! * `usgscsm` corrects no light time itself: positions follow the convention of the run, and in `exchange/centre` the one
//!   of ISIS and ALE, seen from the centre of Mars. After an adjustment the rays are the same in both conventions, and so
//!   is the file.
//! * Pointing is sampled from before the first line to after the last; ALE's table starts 1.15 s late. Nodes are
//!   as dense as an interpolation error below 0.01 pixels requires, which is measured and stated.
//! * Distortion of the narrow angle is zero, as the instrument kernel states. ALE repeats the pixel pitch in these
//!   places, which `usgscsm` takes for radial coefficients per mm² and mm⁴: wrong by hundreds of pixels at the
//!   edges. Other cameras have the three coefficients that fit the image's samples best, and their residual.

mod document;
mod provenance;

use std::{collections::BTreeMap, path::Path};

use nalgebra::Vector3;

use self::provenance::provenance;
use super::{
    files::write_json,
    kernel_report::kernels_by_type,
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    site::{ImageProducts, SiteProducts},
};
use areograph_base::{
    body::Body,
    error::Result,
    frames::{self, Frame, J2000},
    instruments::{DistortionModel, Instrument, NaifNames},
    line_times::LinePiece,
    units::METRES_PER_KM,
};
use areograph_geom::attitude::continuous_quaternions;
use areograph_pds::isd::VALID;
use areograph_stages::{
    sample_orientation::{CameraTables, LightTimeEffect},
    tag_times::ImageTimes,
};
use areograph_store::stage::Round;
use document::{
    CalibratedBy, DetectorCentre, FocalLength, InstrumentPointing, Isd, Keyword, OpticalDistortion,
    Positions, Radial, Radii, ReferenceHeight, Rotation, Transverse, schema,
};

/// J2000 in NAIF's numbering of inertial frames.
const NAIF_J2000: i32 = 1;
/// Range of heights in which camera models search for the ground, metres above and below the ellipsoid (ALE's).
const REFERENCE_HEIGHT_M: i32 = 1_000;

pub(super) static ISD: Declaration = Declaration {
    path: "images/<image>/isd.json",
    what: "camera model of the Community Sensor Model (usgscsm)",
    readers: "usgscsm, Ames Stereo Pipeline, ISIS",
    rows: "table nodes",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Image(|path, of, image| write(path, of, &View::of(image, Round::Initial))),
    uses: &[Use {
        program: Program::CameraModel,
        lines: "usgscsm_cam_test --model ../images/<image>/isd.json --sample-rate 100",
    }],
};

pub(super) static CENTRE: Declaration = Declaration {
    path: "exchange/centre/<image>_isd.json",
    what: "camera model before the adjustment, as ISIS and ALE derive it from the kernels: light time to the centre \
           of {body}",
    readers: "ISIS, ALE, Ames Stereo Pipeline",
    rows: "table nodes",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::ImageWhere {
        images: "every image without support data",
        has: |site, index| site.images[index].times.support.is_none(),
        write: |path, of, index| {
            let image = &of.site.images[index];
            let (tables, light_time) = image.orientation.as_isis_sees(image.times);
            let view = View {
                tables: &tables,
                light_time,
                convention: ", the convention of ISIS and ALE",
                ..View::of(image, Round::Initial)
            };
            write(path, of, &view)
        },
    },
    uses: &[Use {
        program: Program::CameraModel,
        lines: "usgscsm_cam_test --model centre/<image>_isd.json --sample-rate 100",
    }],
};

pub(super) static ADJUSTED: Declaration = Declaration {
    path: "images/<image>/adjusted_isd.json",
    what: "adjusted camera model; its rays are those of all adjusted products, in every light-time convention",
    readers: "usgscsm, Ames Stereo Pipeline, ISIS",
    rows: "table nodes",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::AdjustedImage(|path, of, image| {
        write(path, of, &View::of(image, Round::Adjusted))
    }),
    uses: &[],
};

/// An image by one light-time convention.
struct View<'a> {
    times: &'a ImageTimes,
    tables: &'a CameraTables,
    light_time: &'a LightTimeEffect,
    round: Round,
    /// Whose convention it is, a clause for readers.
    convention: &'static str,
}

impl<'a> View<'a> {
    /// The image by its own convention.
    const fn of(image: &ImageProducts<'a>, round: Round) -> Self {
        Self {
            times: image.times,
            tables: &image.orientation.tables,
            light_time: &image.orientation.light_time,
            round,
            convention: match image.times.support {
                Some(_) => "",
                None => ", the convention of the whole run",
            },
        }
    }
}

fn write(path: &Path, of: &Context, view: &View) -> Result<u64> {
    write_json(path, &isd(of.site, view))?;
    Ok(view.tables.et_s.len() as u64)
}

fn isd<'a>(site: &SiteProducts<'a>, view: &View<'a>) -> Isd<'a> {
    let &View { times, tables, .. } = view;
    let start_s = times.line_times.start().seconds();
    // Half the time of the delivered lines: camera models know no other lines.
    let half_s = 0.5 * times.line_times.seconds(f64::from(times.lines_delivered));
    let instrument = &times.instrument;
    let Instrument {
        naif,
        optics,
        detector,
        ..
    } = instrument;
    let pixels_per_mm = optics.pixel_pitch_mm.recip();
    Isd {
        isis_camera_version: 1,
        image_identifier: &times.id,
        image_lines: times.lines_delivered,
        image_samples: times.samples,
        name_platform: times
            .support
            .as_ref()
            .map_or(&instrument.spacecraft.label_name, |support| {
                &support.platform
            }),
        name_sensor: instrument.sensor_name(),
        reference_height: ReferenceHeight {
            maxheight: REFERENCE_HEIGHT_M,
            minheight: -REFERENCE_HEIGHT_M,
            unit: "m",
        },
        name_model: "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL",
        interpolation_method: "lagrange",
        line_scan_rate: line_scan_rate(times, half_s),
        starting_ephemeris_time: start_s,
        center_ephemeris_time: start_s + half_s,
        radii: Radii {
            semimajor: times.body.model().equatorial_radius_m / METRES_PER_KM,
            semiminor: times.body.model().polar_radius_m / METRES_PER_KM,
            unit: "km",
        },
        body_rotation: body_rotation(times.body, tables),
        instrument_pointing: instrument_pointing(tables, naif),
        naif_keywords: naif_keywords(site, times),
        detector_sample_summing: times.crosstrack_summing,
        detector_line_summing: times.downtrack_summing,
        focal_length_model: FocalLength {
            focal_length: optics.focal_length_mm,
        },
        detector_center: DetectorCentre {
            line: 0.0 - detector.along_track_px,
            sample: detector.boresight_px,
        },
        focal2pixel_lines: [0.0, pixels_per_mm, 0.0],
        focal2pixel_samples: [0.0, 0.0, detector.samples_along.sign() * pixels_per_mm],
        optical_distortion: distortion(times),
        starting_detector_line: 0,
        starting_detector_sample: times.first_detector,
        instrument_position: positions(&tables.et_s, &tables.position_m, &tables.velocity_m_s),
        sun_position: sun_position(tables),
        kernels: kernels_by_type(site),
        areograph: provenance(site, view),
        areograph_calibration: instrument.calibration.as_ref().map(|of| CalibratedBy {
            calibration: &of.calibration,
            camera: &of.camera,
            verdict: if of.valid { VALID } else { "invalid" },
            is_of_other_orbit: of.is_of_other_orbit,
        }),
    }
}

/// The distortion of a calibrated camera as it is; that of others as usgscsm's radial coefficients.
fn distortion(times: &ImageTimes) -> OpticalDistortion {
    match times.instrument.distortion {
        DistortionModel::Transverse {
            coefficients: [x, y],
        } => OpticalDistortion::Transverse(Transverse { x, y }),
        _ => OpticalDistortion::Radial(Radial {
            coefficients: times.detector().radial_fit(&times.instrument).coefficients,
        }),
    }
}

/// Line, time from the middle of the delivered lines and line period, for every piece of them.
///
/// `usgscsm` takes the last row whose line is not above the line coordinate, and there
/// `t = time + period · (coordinate − line + 0.5)`. The first row has the place that ALE gives it; rows of further
/// pieces begin at the top edge of their first line, so that the upper half of that line has its own period too.
fn line_scan_rate(times: &ImageTimes, half_s: f64) -> Vec<[f64; 3]> {
    let pieces = times.line_times.pieces();
    let delivered = pieces.filter(|piece| piece.first_line < times.lines_delivered);
    let row = |piece: LinePiece| {
        let top = f64::from(piece.first_line);
        let (after_s, period_s) = (times.line_times.seconds(top), piece.period_s);
        match piece.first_line {
            0 => [0.5, -half_s, period_s],
            _ => [top, after_s - 0.5 * period_s - half_s, period_s],
        }
    };
    delivered.map(row).collect()
}

fn rotation<To: Frame>(
    tables: &CameraTables,
    frame: i32,
    rotations: &[frames::Rotation<J2000, To>],
    rates_rad_s: &[Vector3<f64>],
) -> Rotation {
    let (start, end) = ends(&tables.et_s);
    Rotation {
        time_dependent_frames: [frame, NAIF_J2000],
        ck_table_start_time: start,
        ck_table_end_time: end,
        ck_table_original_size: tables.et_s.len(),
        ephemeris_times: tables.et_s.clone(),
        quaternions: continuous_quaternions(rotations.iter().map(frames::Rotation::matrix)),
        angular_velocities: rates_rad_s.iter().map(|rate| (*rate).into()).collect(),
        reference_frame: NAIF_J2000,
    }
}

fn body_rotation(body: Body, tables: &CameraTables) -> Rotation {
    rotation(
        tables,
        body.naif().frame,
        &tables.inertial_to_mars,
        &tables.mars_angular_velocity_rad_s,
    )
}

fn instrument_pointing(tables: &CameraTables, naif: &NaifNames) -> InstrumentPointing {
    let camera_to_bus = tables.bus_to_camera.matrix().transpose();
    InstrumentPointing {
        bus: rotation(
            tables,
            naif.bus,
            &tables.inertial_to_bus,
            &tables.bus_angular_velocity_rad_s,
        ),
        constant_frames: [naif.instrument, naif.bus],
        constant_rotation: camera_to_bus.as_slice().to_vec(),
    }
}

fn positions(
    et_s: &[f64],
    position_m: &[Vector3<f64>],
    velocity_m_s: &[Vector3<f64>],
) -> Positions {
    let km = |rows: &[Vector3<f64>]| {
        rows.iter()
            .map(|row| (row / METRES_PER_KM).into())
            .collect()
    };
    let (start, end) = ends(et_s);
    Positions {
        spk_table_start_time: start,
        spk_table_end_time: end,
        spk_table_original_size: et_s.len(),
        ephemeris_times: et_s.to_vec(),
        positions: km(position_m),
        velocities: km(velocity_m_s),
        reference_frame: NAIF_J2000,
    }
}

/// The Sun at the first and the last epoch.
fn sun_position(tables: &CameraTables) -> Positions {
    let (start, end) = ends(&tables.et_s);
    positions(
        &[start, end],
        &tables.sun_position_m,
        &tables.sun_velocity_m_s,
    )
}

/// First and last epoch; tables are never empty.
fn ends(et_s: &[f64]) -> (f64, f64) {
    (
        et_s.first().copied().unwrap_or_default(),
        et_s.last().copied().unwrap_or_default(),
    )
}

/// The source keywords of the numbers above, under NAIF's names.
fn naif_keywords(site: &SiteProducts, times: &ImageTimes) -> BTreeMap<String, Keyword> {
    let instrument = &times.instrument;
    let (model, naif) = (times.body.model(), times.body.naif());
    let [a_km, c_km] =
        [model.equatorial_radius_m, model.polar_radius_m].map(|radius_m| radius_m / METRES_PER_KM);
    let ra = [model.pole_ra_deg, model.pole_ra_deg_per_century, 0.0];
    let dec = [model.pole_dec_deg, model.pole_dec_deg_per_century, 0.0];
    let meridian = [
        model.meridian_deg,
        model.meridian_deg_per_day,
        model.meridian_deg_per_day2,
    ];
    let of_body = |key: &str| format!("BODY{}_{key}", naif.body);
    let of_body = [
        ("BODY_CODE".to_owned(), Keyword::Code(naif.body)),
        ("BODY_FRAME_CODE".to_owned(), Keyword::Code(naif.frame)),
        (of_body("RADII"), Keyword::Numbers([a_km, a_km, c_km])),
        (of_body("POLE_RA"), Keyword::Numbers(ra)),
        (of_body("POLE_DEC"), Keyword::Numbers(dec)),
        (of_body("PM"), Keyword::Numbers(meridian)),
    ];
    let optics = &instrument.optics;
    let bias_s = match times.support {
        Some(_) => instrument.pointing.ck_bias_s,
        None => site.config.pointing.bias_of(instrument).seconds(),
    };
    let of_camera = [
        ("FOCAL_LENGTH", Keyword::Number(optics.focal_length_mm)),
        ("PIXEL_PITCH", Keyword::Number(optics.pixel_pitch_mm)),
        ("PIXEL_SAMPLES", Keyword::Pixels(instrument.detector.pixels)),
        ("CK_TIME_BIAS", Keyword::Number(bias_s)),
        ("SPK_TIME_BIAS", Keyword::Number(0.0)),
    ];
    let id = instrument.naif.instrument;
    let of_camera = of_camera.map(|(key, value)| (format!("INS{id}_{key}"), value));
    of_body.into_iter().chain(of_camera).collect()
}
