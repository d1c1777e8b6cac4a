//! One PEDR file of the synthetic mission.

use std::path::Path;

use rayon::prelude::*;

use super::{
    arc::Flight,
    laser::{Echo, FRAME_S, Frame, FrameRequest, LaserErrors, Shot, fly_frame},
    random::mix,
    telemetry,
    terrain::Terrain,
    truth::{FileTruth, KeptShot},
};
use areograph_base::{
    body::Datum,
    error::{Locate, Result},
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use areograph_config::usual_altimeter;
use areograph_pds::pedr::{LABEL_RECORDS, LabelInfo, PedrWriter, Record};

/// Frames computed in parallel before they are written in order.
const BLOCK: usize = 4_096;
/// Required accuracy of the linear frame model, metres.
const FRAME_MODEL_LIMIT_M: f64 = 0.2;
/// Frames below this off-nadir angle point at nadir, radians.
const NADIR_MAX_RAD: f64 = 0.05 * RADIANS_PER_DEGREE;

/// Note in the labels of the files.
pub(super) const NOTE: &str = "SYNTHETIC: written by areograph scene, not from mission data";

/// Content of a file.
pub(super) struct PedrRequest<'a> {
    /// Name of the file, lower case.
    pub name: &'a str,
    /// Mid-points of the frames as tagged in the file.
    pub tags: &'a [Et],
    /// Datum of the coordinates.
    pub datum: Datum,
    /// Orbit number at a true time.
    pub orbit: &'a (dyn Fn(Et) -> u32 + Sync),
    /// Seed of clouds, missing returns and noise.
    pub seed: u64,
    /// Errors of the shots.
    pub errors: LaserErrors,
}

/// Mid-points of the frames that fit into `span`, as tagged by the late clock: whole microseconds, so that both forms
/// of time in a record agree.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a day has 43 200 frames"
)]
pub(super) fn frame_tags(span: Interval) -> Vec<Et> {
    let first_us =
        ((span.start.seconds() + FRAME_S / 2.0 + usual_altimeter().clock_bias_s) * 1e6).ceil();
    let count = (span.duration_s() / FRAME_S).floor().max(0.0) as u32;
    (0..count)
        .map(|index| Et::from_seconds((first_us + f64::from(index) * FRAME_S * 1e6) / 1e6))
        .collect()
}

/// Computes and writes one file; returns its counts and the ground shots selected by `keep`.
///
/// # Errors
/// Errors of the flight, a beam that misses Mars, errors of writing.
pub(super) fn write_pedr(
    folder: &Path,
    flight: &(impl Flight + Sync),
    terrain: &Terrain,
    request: &PedrRequest,
    keep: impl Fn(&Shot) -> bool,
) -> Result<(FileTruth, Vec<KeptShot>)> {
    let path = folder.join(request.name);
    let label = LabelInfo {
        product_id: request.name.to_uppercase(),
        software_version: 7.25,
        datum: request.datum,
        note: NOTE.to_owned(),
    };
    let mut writer = PedrWriter::create(&path, &label)?;
    let mut counts = FileTruth {
        file: request.name.to_owned(),
        datum: request.datum.model().name,
        frames: 0,
        shots_ground: 0,
        shots_cloud: 0,
        shots_missing: 0,
        shots_beyond_frame_model: 0,
        beyond_frame_model_from_latitude_deg: None,
    };
    let mut kept = Vec::new();
    for (block, tags) in request.tags.chunks(BLOCK).enumerate() {
        let frames: Vec<(Frame, Record)> = tags
            .par_iter()
            .enumerate()
            .map(|(index, tag)| {
                let frame_request = FrameRequest {
                    tag: *tag,
                    index: (block * BLOCK + index) as u64,
                    orbit: (request.orbit)(tag.plus(-usual_altimeter().clock_bias_s)),
                    datum: request.datum,
                    seed: request.seed,
                    errors: &request.errors,
                };
                let frame = fly_frame(flight, terrain, &frame_request)?;
                let mut record = Record::from_frame(&frame.values).in_file(&path)?;
                if request.errors.altimeter.tells_echoes {
                    let seed = mix(request.seed) ^ frame_request.index << 8;
                    telemetry::enter(&mut record, seed);
                }
                Ok((frame, record))
            })
            .collect::<Result<_>>()?;
        for (frame, record) in &frames {
            writer.write_record(record)?;
            let record =
                u32::try_from(LABEL_RECORDS as u64 + counts.frames + 1).unwrap_or(u32::MAX);
            counts.frames += 1;
            count(&mut counts, frame);
            kept.extend((1_u8..).zip(&frame.shots).filter_map(|(shot, truth)| {
                let required = truth.echo == Echo::Ground && keep(truth);
                required.then_some(KeptShot {
                    record,
                    shot,
                    truth: *truth,
                })
            }));
        }
    }
    writer.finish()?;
    Ok((counts, kept))
}

/// Adds a frame to the counts of its file.
fn count(counts: &mut FileTruth, frame: &Frame) {
    for shot in &frame.shots {
        match shot.echo {
            Echo::Ground => counts.shots_ground += 1,
            Echo::Cloud => counts.shots_cloud += 1,
            Echo::Missing => counts.shots_missing += 1,
        }
        if shot.frame_error_m > FRAME_MODEL_LIMIT_M {
            counts.shots_beyond_frame_model += 1;
            if frame.values.off_nadir_rad < NADIR_MAX_RAD {
                let latitude_deg =
                    (shot.ground_m.z / shot.ground_m.norm()).asin().abs() / RADIANS_PER_DEGREE;
                let lowest = counts
                    .beyond_frame_model_from_latitude_deg
                    .get_or_insert(latitude_deg);
                *lowest = lowest.min(latitude_deg);
            }
        }
    }
}
