//! A camera that the site defines against the built-in camera of the same frame.

use super::agreement::{Disagreement, HEIGHT_M, ground, of_one_product};
use crate::calibrated_camera::calibrated_camera;
use areograph_base::{
    error::Result,
    instruments::{Calibrated, Instrument},
};
use areograph_config::{ImageConfig, built_in_instruments, usual_instrument};
use areograph_pds::{ImageLabel, read_label};
use areograph_store::files::HashedFile;

/// Pixel angles of one camera that differ by less are within what its files state: the kernel and ISIS differ by 1 %
/// for the narrow-angle camera, whose focal length is known to 2 %.
const SCALE_TOLERANCE: f64 = 0.02;

/// Pixels by which two files of one camera may place its boresight apart: one counts edges, another centres.
const BORESIGHT_PX: f64 = 1.0;

/// The known camera that another names, by number, and by frame or its name in support data.
pub(super) fn known_one<'a>(
    camera: &Instrument,
    known: &'a [Instrument],
) -> Option<&'a Instrument> {
    known.iter().find(|other| {
        let names = [&*other.naif.frame, other.sensor_name()];
        names.contains(&&*camera.naif.frame) && other.naif.instrument == camera.naif.instrument
    })
}

/// A remark on a camera with the frame of a known one, but another geometry: kernels cannot show a mirrored detector.
/// A calibrated camera may have another boresight.
pub(super) fn camera_agrees(camera: &Instrument, known: &[Instrument]) -> Option<Disagreement> {
    let other = known_one(camera, known)?;
    let pixel_rad = |of: &Instrument| of.optics.pixel_pitch_mm / of.optics.focal_length_mm;
    let scale = pixel_rad(camera) / pixel_rad(other);
    let apart_px = |of: fn(&Instrument) -> f64| {
        if camera.calibration.is_some() {
            return 0.0;
        }
        (of(camera) - of(other)).abs()
    };
    let across_px = apart_px(|of| of.detector.boresight_px);
    let along_px = apart_px(|of| of.detector.along_track_px);
    let is_mirrored = camera.detector.samples_along != other.detector.samples_along;
    // A mirrored line has its boresight at the other end. Written so that NaN counts, here and below.
    let is_apart = !(across_px <= BORESIGHT_PX) && !is_mirrored;
    let differences = [
        ("detector.samples_along", is_mirrored),
        ("detector.boresight_px", is_apart),
        ("detector.along_track_px", !(along_px <= BORESIGHT_PX)),
        ("optics", !((scale - 1.0).abs() <= SCALE_TOLERANCE)),
    ];
    let differs: Vec<&str> = differences
        .into_iter()
        .filter_map(|(key, differs)| differs.then_some(key))
        .collect();
    if differs.is_empty() {
        return None;
    }
    let moved_px = if is_apart { across_px } else { 0.0 }.hypot(along_px);
    let ground_m = if moved_px <= BORESIGHT_PX {
        0.0
    } else {
        moved_px * pixel_rad(other) * HEIGHT_M
    };
    let displaced = if ground_m > 0.0 {
        format!(", {} on the ground", ground(ground_m))
    } else {
        String::new()
    };
    Some(Disagreement {
        text: format!(
            "its camera differs in {} from the built-in file of {}, although both name the same frame{displaced}: \
             kernels do not test the geometry of a camera",
            differs.join(", "),
            other.name
        ),
        ground_m,
    })
}

/// The camera that the configuration names, else the label's, else the first known one; and the label.
pub(super) fn labelled(image: &ImageConfig) -> Result<(Instrument, Option<ImageLabel>)> {
    let Some(path) = &image.label else {
        let named = image.instrument.as_ref();
        let camera = named.unwrap_or_else(|| usual_instrument());
        return Ok((camera.clone(), None));
    };
    let cameras = match &image.instrument {
        Some(named) => std::slice::from_ref(named),
        None => built_in_instruments(),
    };
    let label = read_label(path, cameras)?;
    of_one_product(image, ("label belongs to", label.product_id.as_deref()))?;
    Ok((label.instrument.clone(), Some(label)))
}

/// The camera by its calibration among `files`, with a note and a remark; unchanged where none applies.
pub(super) fn calibrated(
    camera: Instrument,
    files: &[HashedFile],
    (notes, remarks): (&mut Vec<String>, &mut Vec<Disagreement>),
) -> Result<Instrument> {
    let names = [&*camera.spacecraft.label_name, camera.sensor_name()];
    let paths = files.iter().map(|file| &*file.path);
    let Some(found) = calibrated_camera(&camera, names, paths)? else {
        return Ok(camera);
    };
    notes.push(calibrated_note(&found.origin));
    remarks.extend(other_orbit_remark(&found.origin));
    Ok(Instrument {
        calibration: Some(found.origin),
        ..found.camera
    })
}

/// A remark on a camera that was calibrated in another orbit.
pub(super) fn other_orbit_remark(of: &Calibrated) -> Option<Disagreement> {
    of.is_of_other_orbit.then(|| {
        Disagreement::from(format!(
            "the offset angles of the calibration {} contain the mean error of the calibrated orbit, which the stated \
             standard deviations do not include",
            of.calibration
        ))
    })
}

/// A note on an image with a calibrated camera.
pub(super) fn calibrated_note(of: &Calibrated) -> String {
    format!(
        "the camera is the result of the calibration {}: the boresight is not compared with that of the built-in camera",
        of.calibration
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::instruments::{Calibrated, Sense};
    use areograph_config::{all_instruments, usual_instrument};

    #[test]
    fn support_data_of_every_camera_name_it_alone() {
        for camera in all_instruments() {
            let mut written = camera.clone();
            camera.sensor_name().clone_into(&mut written.naif.frame);
            written.naif.frame_id = written.naif.instrument;
            let known = known_one(&written, all_instruments());
            assert_eq!(known.map(|known| &known.id), Some(&camera.id));
            let all = all_instruments().iter();
            let named = all.filter(|other| other.sensor_name() == written.sensor_name());
            assert_eq!(named.count(), 1, "{}", camera.id);
        }
    }

    #[test]
    fn a_mirrored_detector_is_reported_and_rounding_is_not() {
        for camera in all_instruments() {
            assert_eq!(
                camera_agrees(camera, all_instruments()),
                None,
                "{}",
                camera.id
            );
        }
        let remark = |change: fn(&mut Instrument)| {
            let mut camera = usual_instrument().clone();
            change(&mut camera);
            camera_agrees(&camera, all_instruments())
        };
        let mirrored = remark(|camera| camera.detector.samples_along = Sense::MinusY).unwrap();
        let expected = "differs in detector.samples_along from";
        assert!(mirrored.text.contains(expected), "{mirrored:?}");
        // 500 pixels of 3.75 µrad from 380 km.
        let moved = remark(|camera| camera.detector.boresight_px += 500.0).unwrap();
        assert!((moved.ground_m - 712.0).abs() < 1.0 && moved.is_beyond_accuracy());
        assert!(moved.text.contains("712 m on the ground"), "{moved:?}");
        assert_eq!(remark(|camera| camera.detector.boresight_px += 0.5), None);
        assert_eq!(remark(|camera| camera.optics.pixel_pitch_mm *= 0.99), None);
        assert!(remark(|camera| camera.optics.focal_length_mm *= 1.1).is_some());
        assert!(remark(|camera| camera.optics.focal_length_mm = f64::NAN).is_some());
        // A calibration moves the boresight, and does not mirror the detector.
        let calibrated = |change: fn(&mut Instrument)| {
            let mut camera = usual_instrument().clone();
            change(&mut camera);
            camera.calibration = Some(Calibrated {
                calibration: "orbit".to_owned(),
                camera: "line".to_owned(),
                valid: true,
                is_of_other_orbit: false,
            });
            camera_agrees(&camera, all_instruments())
        };
        assert_eq!(
            calibrated(|camera| camera.detector.boresight_px += 500.0),
            None
        );
        let mirrored = calibrated(|camera| camera.detector.samples_along = Sense::MinusY);
        assert!(mirrored.unwrap().text.contains(expected));
        assert!(calibrated(|camera| camera.optics.focal_length_mm *= 1.1).is_some());
        // A camera that no file describes.
        assert_eq!(remark(|camera| camera.naif.frame = "OWN".to_owned()), None);
    }
}
