//! The whole invented mission, from plan to folder.

use std::path::Path;

use super::{
    SceneOptions, SceneSummary,
    arc::Arc,
    error::SceneError,
    files::{Draft, put},
    kernels::{
        clock_session, image_starts, versions, write_attitude, write_orbits, write_text_kernels,
    },
    pedr::{PedrRequest, frame_tags, write_pedr},
    plan::{IMAGES, SITES},
    sites::{README, image_label, planned_site},
    terrain::Terrain,
    ties::write_ties,
    truth::{FileTruth, ImageTruth, KeptShot, OrbitDifference, ProfileTruth, Truth},
};
use crate::{
    constants::MARS_IAU2000,
    error::{IoFault, Place, Result},
    geom::{ellipsoid::Spherical, mars_rotation::mars_matrix},
};

/// Fewest and most seconds of frames in a day's file.
const DAY_S: [f64; 2] = [600.0, 90_000.0];

/// Writes the synthetic mission into `directory`, replacing an older one that nobody added to or changed.
///
/// The same seed gives the same bytes. Everything is written beside `directory` and renamed at the end.
/// No session may be open on this thread.
///
/// # Errors
/// [`SceneError::NotAScene`], [`SceneError::Foreign`] and [`SceneError::Changed`] when the folder holds
/// something else, [`SceneError::Day`], the system's refusal to write.
pub fn write_scene(directory: &Path, options: &SceneOptions) -> Result<SceneSummary> {
    let [least, most] = DAY_S;
    if !(least..=most).contains(&options.day_s) {
        return Err(SceneError::Day {
            day_s: options.day_s,
            least,
            most,
        }
        .into());
    }
    let draft = Draft::begin(directory, README)?;
    let arcs = write_kernels(&draft, options)?;

    let directions = SITES.map(super::plan::Site::direction);
    let terrain = Terrain::new(options.seed, &directions);
    let mut truth = Truth::new(options.seed);
    let pedr = draft.folder("pedr")?;
    for arc in &arcs {
        truth
            .images
            .push(ImageTruth::of(arc, &versions(arc, options.seed)));
        let (file, profile) = write_day(&pedr, arc, &terrain, options.seed)?;
        truth.files.push(file);
        truth.profiles.push(profile);
    }
    let sites = draft.folder("sites")?;
    let ties = draft.folder("ties")?;
    for site in SITES {
        let own: Vec<&Arc> = arcs
            .iter()
            .filter(|arc| arc.image.site.id == site.id)
            .collect();
        put(
            &sites.join(format!("{}.toml", site.id)),
            &planned_site(site, &own).to_toml(),
        )?;
        if let [first, second] = own[..] {
            let pair = write_ties(&ties, [first, second], &terrain, options.seed)?;
            truth.ties.push(pair);
        }
    }
    write_truth(&draft, &truth)?;
    draft.finish()?;
    Ok(SceneSummary::of(directory, &truth, SITES.len()))
}

/// Writes `truth.json`.
pub(super) fn write_truth(draft: &Draft, truth: &Truth) -> Result<()> {
    let path = draft.root().join("truth.json");
    let text = serde_json::to_string(truth)
        .map_err(|error| IoFault {
            action: "write",
            source: error.into(),
        })
        .in_file(&path)?;
    put(&path, &text)
}

/// Solves the six arcs and writes their kernels and labels.
fn write_kernels(draft: &Draft, options: &SceneOptions) -> Result<Vec<Arc>> {
    let kernels = draft.folder("kernels")?;
    let labels = draft.folder("labels")?;
    write_text_kernels(&kernels)?;
    let session = clock_session(&kernels)?;
    let starts = image_starts(&session)?;
    let arcs = IMAGES
        .iter()
        .zip(starts)
        .map(|(image, start)| Arc::new(image, start, image.pedr_duration_s(options.day_s)))
        .collect::<Result<Vec<Arc>>>()?;
    for arc in &arcs {
        put(
            &labels.join(format!("{}.lbl", arc.image.id)),
            &image_label(arc, &session)?,
        )?;
    }
    write_attitude(&kernels, &session, &arcs)?;
    drop(session);
    write_orbits(&kernels, &arcs, options.seed)?;
    Ok(arcs)
}

/// Writes the PEDR file of one day; the profile is that over the day's site.
fn write_day(
    folder: &Path,
    arc: &Arc,
    terrain: &Terrain,
    seed: u64,
) -> Result<(FileTruth, ProfileTruth)> {
    let image = arc.image;
    let first = arc.orbit.revolution(arc.frames.start);
    let name = image.pedr_name();
    let request = PedrRequest {
        name: &name,
        tags: &frame_tags(arc.frames),
        datum: image.datum(),
        // Names of the mapping phase are orbit numbers plus 10 000.
        orbit: &|et| {
            (image.pedr_number - 10_000).saturating_add_signed(arc.orbit.revolution(et) - first)
        },
        seed: seed ^ u64::from(image.pedr_number),
    };
    let (file, kept) = write_pedr(folder, arc, terrain, &request, |shot| {
        let ground = Spherical::from_xyz_m(&shot.ground_m);
        image.site.contains(ground.longitude_rad, ground.latitude.0)
    })?;
    let mut profile = ProfileTruth::new(image.site.id, &name, &kept);
    profile.image = Some(image.id);
    for version in versions(arc, seed) {
        let mean_m = mean(kept.iter().map(|kept| {
            let KeptShot { truth, .. } = kept;
            let rival_m =
                mars_matrix(&MARS_IAU2000, truth.et) * version.position_m(&arc.orbit, truth.et);
            (truth.spacecraft_m - truth.ground_m).norm() - (rival_m - truth.ground_m).norm()
        }));
        let difference = OrbitDifference {
            radial_along_cross_m: version.offset_m.into(),
            expected_range_minus_distance_mean_m: mean_m,
        };
        profile.orbit_differences.insert(version.family, difference);
    }
    Ok((file, profile))
}

/// Mean of some values, 0 of none.
fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}
