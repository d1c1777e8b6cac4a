//! Corners of the index compared with those computed from kernels.

use std::path::Path;

use crate::{
    config::{ImageConfig, KernelsConfig, OrientationConfig, PointingConfig},
    error::{Kind, Result},
    geom::{
        ellipsoid::spherical_to_xyz_m,
        image_outline::{INDEX_LATITUDE_RAD, INDEX_LONGITUDE_RAD},
    },
    image::ImageFields,
    pds::image_index::IndexedImage,
    spice::{KernelSet, Session},
    stages::{
        sample_orientation::sample_orientation,
        select_images::{Found, RADIUS_M, camera_of, identifier},
        tag_times::tag_times,
    },
    units::METRES_PER_KM,
};

/// Records the largest distance of a corner of each image from its position according to the kernels, and warns of
/// images for which it exceeds the tolerance of the search. Images that the kernels do not cover remain unchanged.
///
/// # Errors
/// Kernels that cannot be read; an image that no camera can have taken.
pub(super) fn compare(found: &mut [Found], metakernel: &Path) -> Result<()> {
    let session = Session::open(&KernelSet::from_metakernel(metakernel)?)?;
    // Tolerance of the search for errors of the index.
    let allowed_m = RADIUS_M * INDEX_LATITUDE_RAD.hypot(INDEX_LONGITUDE_RAD);
    let kilometres = |metres: f64| metres / METRES_PER_KM;
    let mut distances_m = Vec::new();
    for found in found.iter_mut() {
        found.off_kernels_m = off_kernels_m(&found.image, &session)?;
        distances_m.extend(found.off_kernels_m);
        if let Some(off_m) = found.off_kernels_m.filter(|off_m| !(*off_m <= allowed_m)) {
            tracing::warn!(
                "{}: the corners are up to {:.1} km from the positions computed from the kernels; the search allows \
                 {:.1} km, so similar images may have been missed",
                found.image.product_id,
                kilometres(off_m),
                kilometres(allowed_m)
            );
        }
    }
    distances_m.sort_by(f64::total_cmp);
    if let Some(largest_m) = distances_m.last() {
        tracing::info!(
            "distances of the corners of {} images from those computed from the kernels: median {:.1} km, largest {:.1} km",
            distances_m.len(),
            kilometres(distances_m[distances_m.len() / 2]),
            kilometres(*largest_m)
        );
    } else {
        tracing::warn!("the kernels cover none of the images with corners");
    }
    Ok(())
}

/// Largest offset of a corner, metres; `None` if the index or the kernels give no corners.
fn off_kernels_m(image: &IndexedImage, session: &Session) -> Result<Option<f64>> {
    let [Some(a), Some(b), Some(c), Some(d)] = image.corners_rad else {
        return Ok(None);
    };
    let outline = tag_times(&[entry(image)], session).and_then(|times| {
        let sampled = times.iter().map(|times| {
            sample_orientation(
                session,
                times,
                &KernelsConfig::default(),
                &PointingConfig::default(),
                &OrientationConfig::default(),
            )
        });
        sampled.collect::<Result<Vec<_>>>()
    });
    let outline = match outline {
        Ok(sampled) => sampled
            .into_iter()
            .next()
            .and_then(|sampled| sampled.outline),
        Err(failure) if failure.kind() == Kind::Coverage => None,
        Err(failure) => return Err(failure),
    };
    let Some(outline) = outline.filter(|outline| !outline.is_empty()) else {
        return Ok(None);
    };
    // Along the first samples, and back along the last ones.
    let last = outline.len() / 2 - 1;
    let corners = [0, outline.len() - 1, last + 1, last].map(|corner| &outline[corner]);
    let on_sphere_m =
        |longitude_rad, latitude_rad| spherical_to_xyz_m(longitude_rad, latitude_rad, RADIUS_M);
    let distances_m = [a, b, c, d].into_iter().zip(corners).map(|(index, seen)| {
        let seen_m = on_sphere_m(seen.longitude_rad, seen.latitude_rad);
        (on_sphere_m(index[0], index[1]) - seen_m).norm()
    });
    Ok(distances_m.max_by(f64::total_cmp))
}

/// The image as an entry of a site file.
fn entry(image: &IndexedImage) -> ImageConfig {
    let [crosstrack_summing, downtrack_summing] = image.summing;
    let [samples, lines] = image.size;
    ImageConfig {
        id: identifier(image),
        instrument: camera_of(image).cloned(),
        fields: ImageFields {
            sclk_start: image.sclk_start.clone(),
            utc_start: image.sclk_start.is_none().then(|| image.utc_start.clone()),
            exposure_s: image.exposure_s,
            downtrack_summing,
            crosstrack_summing,
            lines_header: Some(lines),
            samples: Some(samples),
            first_detector: image.first_detector,
            ..ImageFields::default()
        },
        ..ImageConfig::default()
    }
}
