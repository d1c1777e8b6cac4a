//! A camera of the site's own against the built-in one of the same frame.

use crate::instruments::Instrument;

/// Pixel angles of one camera that differ by less are within what its files state: the kernel and ISIS differ by 1 %
/// for the narrow-angle camera, whose focal length is known to 2 %.
const SCALE_TOLERANCE: f64 = 0.02;

/// A remark on a camera with the frame of a known one, but another geometry: kernels cannot show a mirrored detector.
pub(super) fn camera_agrees(camera: &Instrument, known: &[Instrument]) -> Option<String> {
    let is_same = |other: &&Instrument| {
        other.naif.frame == camera.naif.frame && other.naif.instrument == camera.naif.instrument
    };
    let other = known.iter().find(is_same)?;
    let pixel_rad = |of: &Instrument| of.optics.pixel_pitch_mm / of.optics.focal_length_mm;
    let scale = pixel_rad(camera) / pixel_rad(other);
    let apart_px = |of: fn(&Instrument) -> f64| (of(camera) - of(other)).abs();
    let differences = [
        (
            "detector.samples_along",
            camera.detector.samples_along != other.detector.samples_along,
        ),
        (
            "detector.pixels",
            camera.detector.pixels != other.detector.pixels,
        ),
        // Half a pixel is the difference between counting edges and centres. Written so that NaN counts, here and below.
        (
            "detector.boresight_px",
            !(apart_px(|of| of.detector.boresight_px) <= 0.5),
        ),
        (
            "detector.along_track_px",
            !(apart_px(|of| of.detector.along_track_px) <= 0.5),
        ),
        ("optics", !((scale - 1.0).abs() <= SCALE_TOLERANCE)),
        ("distortion", camera.distortion != other.distortion),
    ];
    let differs: Vec<&str> = differences
        .into_iter()
        .filter_map(|(key, differs)| differs.then_some(key))
        .collect();
    (!differs.is_empty()).then(|| {
        format!(
            "its instrument file differs in {} from the built-in file of {}, whose frame it names: no kernel tests the \
             geometry of a camera",
            differs.join(", "),
            other.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        config::{all_instruments, usual_instrument},
        instruments::Sense,
    };

    #[test]
    fn a_mirrored_detector_is_reported_and_rounding_is_not() {
        for camera in all_instruments() {
            assert_eq!(camera_agrees(camera, all_instruments()), None, "{}", camera.id);
        }
        let remark = |change: fn(&mut Instrument)| {
            let mut camera = usual_instrument().clone();
            change(&mut camera);
            camera_agrees(&camera, all_instruments())
        };
        let mirrored = remark(|camera| camera.detector.samples_along = Sense::MinusY).unwrap();
        assert!(mirrored.contains("differs in detector.samples_along from"), "{mirrored}");
        assert_eq!(remark(|camera| camera.detector.boresight_px += 0.5), None);
        assert_eq!(remark(|camera| camera.optics.pixel_pitch_mm *= 0.99), None);
        assert!(remark(|camera| camera.optics.focal_length_mm *= 1.1).is_some());
        assert!(remark(|camera| camera.optics.focal_length_mm = f64::NAN).is_some());
        // A camera that no file describes.
        assert_eq!(remark(|camera| camera.naif.frame = "OWN".to_owned()), None);
    }
}
