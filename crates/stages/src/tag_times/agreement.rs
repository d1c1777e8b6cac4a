//! Agreement of double statements about an image: its product, its clock and UTC, its stop time and lines.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::StartFrom;
use areograph_base::{
    constants::{GROUND_SPEED_M_S, Spacecraft},
    error::Cause,
    instruments::Instrument,
    line_times::LinePiece,
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_MS},
};
use areograph_config::ImageConfig;
use areograph_geom::attitude::{bus_to_camera, rotation_vector};
use areograph_pds::product_named;

/// Clock and UTC, or stop time and lines, that differ by more than this get a remark, seconds.
///
/// UTC in MOC labels is truncated to 10 ms: in five labels it differs by 1 to 5 ms from the clock, and in three the
/// time from start to stop is 4 to 6 ms less than the time of the lines. The limit is 60 m on the ground.
pub(super) const CLOSE_S: f64 = 0.02;
/// With a larger difference they belong to two images, seconds.
const TOLERANCE_S: f64 = 1.0;

/// Largest displacement on the ground that stays a remark, metres: the position of a site is stated within 110 m per axis,
/// and one of the two statements is used without proof.
const DISPLACEMENT_MAX_M: f64 = 100.0;

/// Mountings of a camera in kernels and instrument file that differ by more than this contradict each other, radians: 4
/// m on the ground, a hundred times the rounding of angles in kernels.
const MOUNTING_RAD: f64 = 1e-5;
/// Height of the mapping orbit, metres: converts angles into distances on the ground.
pub(super) const HEIGHT_M: f64 = 380_000.0;

/// Two statements about an image that differ by less than an error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Disagreement {
    /// One sentence.
    pub text: String,
    /// Displacement of the image on the ground by the difference, metres; 0 where there is none.
    pub ground_m: f64,
}

impl Disagreement {
    /// Whether the displacement exceeds the stated accuracy.
    #[must_use]
    pub fn is_beyond_accuracy(&self) -> bool {
        // Written so that NaN counts.
        !(self.ground_m <= DISPLACEMENT_MAX_M)
    }
}

impl From<String> for Disagreement {
    fn from(text: String) -> Self {
        Self {
            text,
            ground_m: 0.0,
        }
    }
}

/// Two statements of which one belongs to another image.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(super) enum Contradiction {
    #[error(
        "image {image}: the {source_is} product {product}; expected {expected}, which the image identifier names"
    )]
    #[cause(
        "check that labels or support data are not exchanged; an identifier that names no product is valid with any of \
         these"
    )]
    Product {
        image: String,
        source_is: &'static str,
        product: String,
        expected: String,
    },
    #[error(
        "image {image}: the clock in serial number {serial} differs from {sclk}; expected agreement within {TOLERANCE_S} s"
    )]
    #[cause(
        "check that labels or serial numbers are not exchanged; ISIS writes the clock of the label into the serial number"
    )]
    Serial {
        image: String,
        serial: String,
        sclk: String,
    },
    #[error(
        "image {image}: clock {sclk} is {apart_s:.3} s away from UTC {utc}; expected at most {TOLERANCE_S} s"
    )]
    #[cause(
        "check which of the two belongs to this image, and check that the kernels contain all leap seconds before this \
         image; the run would use the clock"
    )]
    Start {
        image: String,
        sclk: String,
        utc: String,
        apart_s: f64,
    },
    #[error(
        "image {image}: its first exposure begins {apart_s:.3} s away from its {stated}; expected at most \
         {TOLERANCE_S} s"
    )]
    #[cause("check which of the two belongs to this image: the run would use the exposures")]
    Exposures {
        image: String,
        stated: &'static str,
        apart_s: f64,
    },
    #[error(
        "image {image}: STOP_TIME {stop} is {after_s:.3} s after the start, but its lines take {duration_s:.3} s; \
         expected agreement"
    )]
    #[cause(
        "check start and stop time, lines, exposure and downtrack summing; one of these values belongs to another image"
    )]
    Stop {
        image: String,
        stop: String,
        after_s: f64,
        duration_s: f64,
    },
}

/// The product of the label or of support data must be the one that the image's identifier names, where both name a
/// product.
pub(super) fn of_one_product(
    image: &ImageConfig,
    (source_is, product): (&'static str, Option<&str>),
) -> Result<(), Contradiction> {
    let (Some(product), Some(named)) = (product, product_named(&image.id)) else {
        return Ok(());
    };
    match product_named(product) {
        Some(found) if found != named => Err(Contradiction::Product {
            image: image.id.clone(),
            source_is,
            product: product.to_owned(),
            expected: named,
        }),
        _ => Ok(()),
    }
}

/// A serial number of ISIS, `MGS/<clock>/MOC-NA/…`, holds the clock of the image.
pub(super) fn of_one_clock(
    image: &ImageConfig,
    spacecraft: &Spacecraft,
    sclk: Option<&str>,
) -> Result<(), Contradiction> {
    let serial = image.serial_number.as_deref();
    let serial_clock = serial.and_then(|serial| {
        let of_spacecraft = serial.strip_prefix(&*spacecraft.name)?.strip_prefix('/')?;
        of_spacecraft.split('/').next()
    });
    let seconds = |clock: &str| -> Option<i64> {
        let count = clock.strip_prefix("1/").unwrap_or(clock);
        count.split([':', '.']).next()?.parse().ok()
    };
    let (Some(sclk), Some(serial)) = (sclk, serial) else {
        return Ok(());
    };
    match (serial_clock.and_then(seconds), seconds(sclk)) {
        (Some(held), Some(expected)) if held.abs_diff(expected) > 1 => Err(Contradiction::Serial {
            image: image.id.clone(),
            serial: serial.to_owned(),
            sclk: sclk.to_owned(),
        }),
        _ => Ok(()),
    }
}

/// A remark on a clock and a UTC of the start that do not agree.
pub(super) fn start_agrees(
    image: &str,
    (sclk, start): (&str, Et),
    (utc, utc_start): (&str, Et),
) -> Result<Option<Disagreement>, Contradiction> {
    let apart_s = start.since(utc_start).abs();
    // Written so that NaN contradicts.
    if !(apart_s <= TOLERANCE_S) {
        return Err(Contradiction::Start {
            image: image.to_owned(),
            sclk: sclk.to_owned(),
            utc: utc.to_owned(),
            apart_s,
        });
    }
    let lacks_second = if apart_s > TOLERANCE_S - CLOSE_S {
        "; a difference of a whole second may be a leap second that the kernels lack"
    } else {
        ""
    };
    let ground_m = apart_s * GROUND_SPEED_M_S;
    Ok((apart_s > close_s(utc)).then(|| Disagreement {
        text: format!(
            "clock {sclk} is {apart_s:.3} s away from UTC {utc}, {} on the ground; clock and UTC of a label usually \
             agree within 0.005 s; the clock is used{lacks_second}",
            ground(ground_m)
        ),
        ground_m,
    }))
}

/// A remark on exposures that do not begin within `close_s` of clock or UTC.
pub(super) fn pieces_agree(
    image: &str,
    first: Et,
    (stated, from): (Et, StartFrom),
    close_s: f64,
) -> Result<Option<Disagreement>, Contradiction> {
    let apart_s = first.since(stated).abs();
    let stated = match from {
        StartFrom::Sclk => "sclk_start",
        _ => "utc_start",
    };
    // Written so that NaN contradicts.
    if !(apart_s <= TOLERANCE_S) {
        return Err(Contradiction::Exposures {
            image: image.to_owned(),
            stated,
            apart_s,
        });
    }
    let ground_m = apart_s * GROUND_SPEED_M_S;
    Ok((apart_s > close_s).then(|| Disagreement {
        text: format!(
            "its first exposure begins {apart_s:.3} s away from {stated}, {} on the ground; the exposures are used",
            ground(ground_m)
        ),
        ground_m,
    }))
}

/// A remark on a piece of line times that does not follow the one before it.
pub(super) fn piece_follows(piece: &LinePiece, next: &LinePiece) -> Option<String> {
    let lines = f64::from(next.first_line - piece.first_line);
    let pause_s = next.start.since(piece.start) - lines * piece.period_s;
    // Written so that NaN is reported.
    (!(pause_s <= 0.5 * piece.period_s)).then(|| {
        format!(
            "no line is exposed for {pause_s:.4} s ({:.1} lines) before line {}; a first line or a start in its \
             exposures may be wrong",
            pause_s / piece.period_s,
            next.first_line
        )
    })
}

/// A stop time that does not agree with the lines of the header and the delivered lines.
///
/// The period of the lines and the stop time are two statements of which the period is used without proof: a difference
/// displaces the last line. A stop time of the delivered lines is a remark.
pub(super) fn stop_agrees(
    image: &str,
    start: Et,
    (utc, stop): (&str, Et),
    ([lines, delivered], line_period_s): ([u32; 2], f64),
) -> Result<Option<Disagreement>, Contradiction> {
    let after_s = stop.since(start);
    let [duration_s, delivered_s] =
        [lines, delivered].map(|count| f64::from(count) * line_period_s);
    let apart_s = (after_s - duration_s).abs();
    let close_s = close_s(utc) + line_period_s;
    if apart_s <= close_s {
        return Ok(None);
    }
    let alike = after_s <= 2.0 * duration_s && duration_s <= 2.0 * after_s;
    // Written so that NaN contradicts.
    if !(alike || apart_s <= TOLERANCE_S) {
        return Err(Contradiction::Stop {
            image: image.to_owned(),
            stop: utc.to_owned(),
            after_s,
            duration_s,
        });
    }
    let is_of_delivered = (after_s - delivered_s).abs() <= close_s;
    let ground_m = if is_of_delivered {
        0.0
    } else {
        apart_s * GROUND_SPEED_M_S
    };
    Ok(Some(Disagreement {
        text: format!(
            "STOP_TIME {utc} is {after_s:.3} s after the start, but {lines} lines of {:.4} ms take {duration_s:.3} s, \
             {} on the ground; lines, exposure or summing may belong to another image",
            line_period_s / SECONDS_PER_MS,
            ground(apart_s * GROUND_SPEED_M_S)
        ),
        ground_m,
    }))
}

/// A remark on a camera whose mounting differs between the kernels and its instrument file.
pub(super) fn mounting_agrees(camera: &Instrument, kernels: &Matrix3<f64>) -> Option<Disagreement> {
    let turn = kernels * bus_to_camera(&camera.mounting).transpose();
    let turn_rad = rotation_vector(&turn).norm();
    // Written so that NaN is reported.
    let ground_m = turn_rad * HEIGHT_M;
    (!(turn_rad <= MOUNTING_RAD)).then(|| Disagreement {
        text: format!(
            "the mounting of {} in the kernels differs by {:.4}° from its instrument file, {} on the ground; the \
             kernels are used",
            camera.name,
            turn_rad / RADIANS_PER_DEGREE,
            ground(ground_m)
        ),
        ground_m,
    })
}

/// Resolution of a UTC string as it is written, at least [`CLOSE_S`], seconds.
fn close_s(utc: &str) -> f64 {
    let decimals = utc.split_once('.').map_or(0, |(_, fraction)| {
        fraction.bytes().take_while(u8::is_ascii_digit).count()
    });
    let written_s = 0.1_f64.powi(i32::try_from(decimals).unwrap_or(i32::MAX));
    written_s.max(CLOSE_S)
}

pub(super) fn ground(metres: f64) -> String {
    if metres < 1_000.0 {
        format!("{metres:.0} m")
    } else {
        format!("{:.1} km", metres / 1_000.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::constants::SPACECRAFT;

    fn image(id: &str, serial_number: Option<&str>) -> ImageConfig {
        ImageConfig {
            id: id.to_owned(),
            serial_number: serial_number.map(str::to_owned),
            ..ImageConfig::default()
        }
    }

    /// The remark on a start `apart_s` after its UTC.
    fn start(apart_s: f64, utc: &str) -> Result<Option<Disagreement>, Contradiction> {
        let at = Et::from_seconds;
        start_agrees(
            "i",
            ("669788295:103", at(100.0 + apart_s)),
            (utc, at(100.0)),
        )
    }

    #[test]
    fn a_clock_is_close_to_its_utc_as_far_as_that_is_written() {
        const UTC: &str = "2001-03-23T04:17:44.58";
        for close_s in [0.0, 0.0048, -0.0199] {
            assert_eq!(start(close_s, UTC).unwrap(), None, "{close_s} s");
        }
        let remark = start(-0.9, UTC).unwrap().unwrap();
        assert!(remark.is_beyond_accuracy());
        assert!(
            remark
                .text
                .contains("is 0.900 s away from UTC 2001-03-23T04:17:44.58, 2.7 km on the ground"),
            "{remark:?}"
        );
        let small = start(0.021, UTC).unwrap().unwrap();
        assert!(small.text.contains("63 m") && !small.is_beyond_accuracy());
        assert!(start(1.001, UTC).is_err());
        assert!(start(f64::NAN, UTC).is_err());
        assert_eq!(start(0.6, "2001-03-23T04:17:44Z").unwrap(), None);
    }

    #[test]
    fn a_stop_time_belongs_to_the_lines() {
        let stop = |after_s: f64| {
            let at = Et::from_seconds;
            let lines = ([8_064, 7_680], 0.001_446_201);
            stop_agrees(
                "i",
                at(5.0),
                ("2001-03-23T04:17:56.238", at(5.0 + after_s)),
                lines,
            )
        };
        assert_eq!(stop(11.658).unwrap(), None);
        // The lines that the file lacks, of this image and of one with half as many.
        let delivered = stop(11.107).unwrap().unwrap();
        assert!(delivered.text.contains("take 11.662 s"), "{delivered:?}");
        assert!(!delivered.is_beyond_accuracy());
        for displaced_s in [22.0, 13.662, 11.662 / 1.2] {
            assert!(stop(displaced_s).unwrap().unwrap().is_beyond_accuracy());
        }
        for contradicting_s in [3_611.658, -0.1, 5.0, 24.0, f64::NAN] {
            assert!(stop(contradicting_s).is_err(), "{contradicting_s} s");
        }
    }

    #[test]
    fn identifier_and_serial_number_are_those_of_the_label() {
        let label = ("label belongs to", Some("E02/02016"));
        for id in ["E02-02016", "e0202016_part", "nadir"] {
            assert!(of_one_product(&image(id, None), label).is_ok(), "{id}");
        }
        assert!(of_one_product(&image("E02-01301", None), ("label belongs to", None)).is_ok());
        assert_eq!(
            of_one_product(&image("E02-01301", None), label)
                .unwrap_err()
                .to_string(),
            "image E02-01301: the label belongs to product E02/02016; expected E0201301, which the image identifier names"
        );
        let clock = Some("669788295:103");
        for serial in [
            "MGS/669788295:103/MOC-NA/BROAD_BAND",
            "MGS/669788296:001/MOC-NA",
            "A",
        ] {
            assert!(
                of_one_clock(&image("i", Some(serial)), &SPACECRAFT, clock).is_ok(),
                "{serial}"
            );
        }
        let exchanged = image("i", Some("MGS/669166526:3/MOC-NA/BROAD_BAND"));
        assert!(of_one_clock(&exchanged, &SPACECRAFT, clock).is_err());
        assert!(of_one_clock(&exchanged, &SPACECRAFT, None).is_ok());
    }
}
