//! The synthetic mission, from plan to folder.

use std::path::Path;

use super::{
    SceneOptions, SceneSummary,
    arc::Arc,
    context::{CONTEXT_SITE, ContextImage, context_site, context_ties, in_window},
    drawn::{DayErrors, Flown},
    error::SceneError,
    error_sources::AltimeterErrors,
    files::{Draft, put},
    further_pairs::FurtherImage,
    further_passes::FurtherPass,
    images::{Coder, write_images},
    kernels::{
        Flightpath, WHOLE, clock_session, image_start, versions, write_attitude, write_orbits,
        write_planets_of, write_text_kernels,
    },
    laser::{LaserErrors, Shot},
    pedr::{PedrRequest, frame_tags, write_pedr},
    plan::{IMAGES, LOST_IMAGE, PlannedImage, SITES, Site},
    profile_shift::ProfileShift,
    sites::{README, planned_label, planned_site},
    terrain::Terrain,
    ties::{TieNoise, TiesWanted, ties_name, write_ties},
    truth::{
        ContextTruth, DrawnTruth, FileTruth, ImageTruth, KeptShot, OrbitDifference, ProfileTruth,
        Truth,
    },
};
use areograph_base::{
    body::Datum,
    error::{IoError, Locate, Result},
    time::Et,
    watch::Watch,
};
use areograph_geom::ellipsoid::Spherical;
use areograph_pds::ties::ties_table;
use nalgebra::Vector3;
use serde::Serialize;

/// Fewest and most seconds of frames in a day's file.
const DAY_S: [f64; 2] = [600.0, 90_000.0];
/// Fewest and most pairs of a site: earlier ones would precede the laser's mapping mission.
const PAIRS: [f64; 2] = [1.0, 5.0];
/// Fewest and most tie points of a site.
const TIES: [f64; 2] = [2.0, 10_000.0];
/// Least and largest noise of tie points, within the margin that images keep for it.
const TIE_NOISE_PX: [f64; 2] = [0.0, 5.0];

/// Writes the synthetic mission into `directory`, replacing an older one unless files were added or changed.
///
/// The same seed gives the same bytes. Everything is written beside `directory` and renamed at the end.
/// No session may be open on this thread.
///
/// # Errors
/// [`SceneError::NotAScene`], [`SceneError::Foreign`] and [`SceneError::Changed`] when the folder holds something else,
/// [`SceneError::Option`], errors of writing.
pub fn write_scene(directory: &Path, options: &SceneOptions) -> Result<SceneSummary> {
    write(directory, options, None)
}

/// Writes a scene with the pixels of the narrow-angle images (`images/*.imq`, named in the site files), which takes
/// minutes.
///
/// * `watch` – counts the lines of the images
///
/// # Errors
/// As [`write_scene`].
pub fn write_scene_with_images(
    directory: &Path,
    options: &SceneOptions,
    coder: Coder,
    watch: Watch<'_>,
) -> Result<SceneSummary> {
    write(directory, options, Some((coder, &SITES[..], watch)))
}

/// The ground of the mission that [`write_scene`] writes.
#[derive(Debug)]
pub struct TrueGround(pub(super) Terrain);

impl TrueGround {
    /// The ground of the mission with these options.
    #[must_use]
    pub fn of(options: &SceneOptions) -> Self {
        let directions = SITES.map(super::plan::Site::direction);
        let relief = options.errors.relief;
        Self(Terrain::new(options.seed, &directions, relief))
    }

    /// Its distance from the centre of the body in a direction, IAU 2000, metres.
    #[must_use]
    pub fn radius_m(&self, direction: &Vector3<f64>) -> f64 {
        self.0.radius_m(&direction.normalize())
    }
}

/// Writes the mission; with the pixels of the narrow-angle images of some sites.
pub(super) fn write(
    directory: &Path,
    options: &SceneOptions,
    images: Option<(Coder, &[&Site], Watch<'_>)>,
) -> Result<SceneSummary> {
    check(options)?;
    let draft = Draft::begin(directory, README)?;
    let fly = |arc| {
        let errors = DayErrors::draw(&options.errors, &arc, options.seed);
        Flown { arc, errors }
    };
    let further = further_images(&draft, options.pairs)?;
    let further: Vec<PlannedImage<'_>> = further.iter().map(FurtherImage::image).collect();
    let planned: Vec<&PlannedImage<'_>> =
        { IMAGES.iter().chain([&LOST_IMAGE]).chain(&further) }.collect();
    let (arcs, passes) = write_kernels(&draft, &planned, options)?;
    let days: Vec<Flown> = arcs.into_iter().map(fly).collect();

    let TrueGround(terrain) = TrueGround::of(options);
    let mut truth = Truth::new(options.seed, &options.errors);
    let pedr = draft.folder("pedr")?;
    let mut kept = Vec::new();
    let mut recorded_m: Vec<Recorded<'_>> = Vec::new();
    for flown in &days {
        let day = write_day(&pedr, flown, &terrain, options)?;
        truth.files.push(day.file);
        kept.push(day.kept);
        recorded_m.push(day.recorded);
        if flown.arc.image.is_delivered() {
            let versions = versions(&flown.arc, options.seed);
            truth.images.push(ImageTruth::of(&flown.arc, &versions));
            truth.errors_drawn.push(DrawnTruth::of(flown));
            truth.profiles.push(day.profile);
        }
    }
    for pass in &passes {
        let (file, profile, recorded) = write_pass(&pedr, pass, &terrain, options)?;
        truth.files.push(file);
        truth.profiles.push(profile);
        recorded_m.push(recorded);
    }
    let sites = draft.folder("sites")?;
    let ties = draft.folder("ties")?;
    for site in SITES {
        let own: Vec<&Flown> = days
            .iter()
            .filter(|flown| flown.arc.image.site.id == site.id)
            .collect();
        if own.len() > 1 {
            let recorded = recorded_m
                .iter()
                .filter(|of| options.ties_at_shots && of.site == site.id);
            let shots_m: Vec<Vector3<f64>> = recorded.flat_map(|of| &of.shots_m).copied().collect();
            let wanted = TiesWanted {
                count: options.ties,
                noise: TieNoise::of(&options.errors),
                shots_m: &shots_m,
            };
            let measured = write_ties(&ties, &own, &terrain, &wanted, options.seed)?;
            let arcs: Vec<&Arc<'_>> = own.iter().map(|flown| &flown.arc).collect();
            let has_pixels = images.is_some_and(|(_, sites, _)| is_of(site, sites));
            let passes: Vec<&FurtherPass> = passes
                .iter()
                .filter(|pass| pass.site.id == site.id)
                .collect();
            let file = planned_site(site, &arcs, &passes, &options.errors, &measured, has_pixels);
            put(&sites.join(format!("{}.toml", site.id)), &file.to_toml())?;
            truth.ties.push(measured);
        }
    }
    truth.wide_angle = write_context(&draft, &days, &kept, &terrain, options)?;
    if let Some((coder, sites, watch)) = images {
        let session = clock_session(&draft.folder("kernels")?)?;
        let folder = draft.folder("images")?;
        let how = (options.seed, coder);
        let shown = |flown: &&Flown| is_of(flown.arc.image.site, sites);
        let days: Vec<&Flown> = days.iter().filter(shown).collect();
        truth.rendered = write_images(&folder, &days, &terrain, how, &session, watch)?;
    }
    write_as_truth(&draft, &truth)?;
    draft.finish()?;
    Ok(SceneSummary::of(directory, &truth, SITES.len() + 1))
}

fn is_of(site: &Site, sites: &[&Site]) -> bool {
    sites.iter().any(|of| of.id == site.id)
}

/// Shots of a profile over a site where its file has them, IAU 2000, metres.
struct Recorded<'a> {
    site: &'a str,
    shots_m: Vec<Vector3<f64>>,
}

impl<'a> Recorded<'a> {
    fn of(site: &'a str, shift: &ProfileShift, kept: &[KeptShot]) -> Self {
        let shots = kept
            .iter()
            .map(|kept| shift.rotation() * kept.truth.ground_m);
        Self {
            site,
            shots_m: shots.collect(),
        }
    }
}

/// Rejects options that are out of range.
fn check(options: &SceneOptions) -> Result<()> {
    let named = [
        ("day_s", options.day_s, DAY_S),
        ("pairs", options.pairs.into(), PAIRS),
        ("ties", options.ties.into(), TIES),
        ("tie_noise_px", options.errors.tie_noise_px, TIE_NOISE_PX),
    ];
    for (option, value, [least, most]) in named {
        if !(least..=most).contains(&value) {
            return Err(SceneError::Option {
                option,
                value,
                least,
                most,
            }
            .into());
        }
    }
    Ok(())
}

/// Writes labels, tie points and the site file of the wide-angle images; `kept` are the shots of each day.
fn write_context(
    draft: &Draft,
    days: &[Flown],
    kept: &[Vec<KeptShot>],
    terrain: &Terrain,
    options: &SceneOptions,
) -> Result<Vec<ContextTruth>> {
    let session = clock_session(&draft.folder("kernels")?)?;
    let images = ContextImage::all(days, &session)?;
    let labels = draft.folder("labels")?;
    for image in &images {
        let path = labels.join(format!("{}.lbl", image.id()));
        put(&path, &image.label(&session)?)?;
    }
    let id = CONTEXT_SITE.id;
    let ties = context_ties(&images, terrain, options.seed);
    put(
        &draft.folder("ties")?.join(ties_name(id)),
        &ties_table(&ties),
    )?;
    let site = context_site(&images);
    let path = draft.folder("sites")?.join(format!("{id}.toml"));
    put(&path, &site.to_toml())?;
    let shots = |image: &ContextImage<'_>| {
        let days = days.iter().zip(kept);
        let mut own = days.filter(|(flown, _)| image.is_of(flown));
        own.next().map_or(&[][..], |(_, kept)| kept)
    };
    Ok(images
        .iter()
        .map(|image| image.truth(shots(image)))
        .collect())
}

/// Writes `truth.json`.
pub(super) fn write_as_truth(draft: &Draft, truth: &impl Serialize) -> Result<()> {
    let path = draft.root().join("truth.json");
    let text = serde_json::to_string(truth)
        .map_err(|error| IoError {
            action: "write",
            source: error.into(),
        })
        .in_file(&path)?;
    put(&path, &text)
}

/// Writes the text kernels; returns the images of further pairs by their clock.
fn further_images(draft: &Draft, pairs: u32) -> Result<Vec<FurtherImage>> {
    let kernels = draft.folder("kernels")?;
    write_text_kernels(&kernels)?;
    FurtherImage::all(pairs, &clock_session(&kernels)?)
}

/// Solves the arcs and writes their kernels, those of further passes, and labels of the delivered images.
fn write_kernels<'a>(
    draft: &Draft,
    planned: &[&'a PlannedImage<'a>],
    options: &SceneOptions,
) -> Result<(Vec<Arc<'a>>, Vec<FurtherPass>)> {
    let kernels = draft.folder("kernels")?;
    let labels = draft.folder("labels")?;
    let session = clock_session(&kernels)?;
    let mut arcs = planned
        .iter()
        .map(|image| {
            let start = image_start(&session, image)?;
            Arc::new(image, start, image.pedr_duration_s(options.day_s))
        })
        .collect::<Result<Vec<Arc<'_>>>>()?;
    arcs.sort_by(|a, b| {
        a.exposed
            .start
            .seconds()
            .total_cmp(&b.exposed.start.seconds())
    });
    for arc in arcs.iter().filter(|arc| arc.image.is_delivered()) {
        put(
            &labels.join(format!("{}.lbl", arc.image.id)),
            &planned_label(arc, "EXTENDED", &session)?,
        )?;
    }
    write_attitude(&kernels, WHOLE, &session, &arcs.iter().collect::<Vec<_>>())?;
    drop(session);
    let last = arcs
        .last()
        .map_or_else(|| Et::from_seconds(0.0), |arc| arc.frames.stop);
    let passes = FurtherPass::over(&SITES, options.passes, last, &options.errors, options.seed);
    let of_arcs = arcs.iter().map(|arc| Flightpath::of_arc(arc, options.seed));
    let of_passes = passes
        .iter()
        .map(|pass| Flightpath::of_pass(pass, options.seed));
    let paths: Vec<Flightpath<'_>> = of_arcs.chain(of_passes).collect();
    write_orbits(&kernels, WHOLE, &paths.iter().collect::<Vec<_>>())?;
    write_planets_of(&kernels, &paths)?;
    Ok((arcs, passes))
}

/// Writes the PEDR file of a further pass.
fn write_pass(
    folder: &Path,
    pass: &FurtherPass,
    terrain: &Terrain,
    options: &SceneOptions,
) -> Result<(FileTruth, ProfileTruth<'static>, Recorded<'static>)> {
    let name = pass.file();
    let request = PedrRequest {
        name: &name,
        tags: &frame_tags(pass.frames()),
        datum: Datum::Iau2000,
        orbit: &|_| pass.orbit_number(),
        seed: options.seed ^ u64::from(pass.number),
        errors: LaserErrors {
            altimeter: options.errors.altimeter,
            shift: pass.shift.clone(),
        },
    };
    let (file, kept) = write_pedr(folder, pass, terrain, &request, |shot| {
        let ground = Spherical::from_xyz_m(&shot.ground_m);
        pass.site.contains(ground.longitude_rad, ground.latitude.0)
    })?;
    let mut profile = ProfileTruth::new(pass.site.id, &name, &kept);
    profile.orbit_differences =
        OrbitDifference::of(&pass.versions(options.seed), pass.orbit(), &kept);
    profile.profile_shift = Some(pass.shift.clone());
    let recorded = Recorded::of(pass.site.id, &pass.shift, &kept);
    Ok((file, profile, recorded))
}

/// Output of one day.
struct Day<'a> {
    file: FileTruth,
    /// Over the day's site.
    profile: ProfileTruth<'a>,
    recorded: Recorded<'a>,
    /// Shots in the window of the wide-angle images.
    kept: Vec<KeptShot>,
}

/// Writes the PEDR file of the day of an image; returns its counts and the ground shots selected by `keep`.
///
/// # Errors
/// A beam that misses Mars; errors of writing.
pub(super) fn write_file_of_day(
    folder: &Path,
    flown: &Flown,
    terrain: &Terrain,
    sizes: &AltimeterErrors,
    seed: u64,
    keep: impl Fn(&Shot) -> bool,
) -> Result<(FileTruth, Vec<KeptShot>)> {
    let Flown { arc, errors } = flown;
    let image = arc.image;
    let first = arc.orbit.revolution(arc.frames.start);
    let request = PedrRequest {
        name: &image.pedr_name(),
        tags: &frame_tags(arc.frames),
        datum: image.datum(),
        // Names of the mapping phase are orbit numbers plus 10 000.
        orbit: &|et| {
            (image.pedr_number - 10_000).saturating_add_signed(arc.orbit.revolution(et) - first)
        },
        seed: seed ^ u64::from(image.pedr_number),
        errors: LaserErrors {
            altimeter: *sizes,
            shift: errors.profile_shift.clone(),
        },
    };
    write_pedr(folder, flown, terrain, &request, keep)
}

/// Writes the PEDR file of one day.
fn write_day<'a>(
    folder: &Path,
    flown: &Flown<'a>,
    terrain: &Terrain,
    options: &SceneOptions,
) -> Result<Day<'a>> {
    let arc = &flown.arc;
    let image = arc.image;
    let sizes = &options.errors.altimeter;
    let within = |holds: &dyn Fn(f64, f64) -> bool, shot: &Shot| {
        let ground = Spherical::from_xyz_m(&shot.ground_m);
        holds(ground.longitude_rad, ground.latitude.0)
    };
    let in_site = |shot: &Shot| within(&|east, north| image.site.contains(east, north), shot);
    let in_context = |shot: &Shot| within(&in_window, shot);
    let keep = |shot: &Shot| in_site(shot) || in_context(shot);
    let (file, shots) = write_file_of_day(folder, flown, terrain, sizes, options.seed, keep)?;
    let (mut kept, mut context) = (shots.clone(), shots);
    kept.retain(|kept| in_site(&kept.truth));
    context.retain(|kept| in_context(&kept.truth));
    let mut profile = ProfileTruth::new(image.site.id, &image.pedr_name(), &kept);
    profile.image = Some(image.id);
    profile.orbit_differences =
        OrbitDifference::of(&versions(arc, options.seed), &arc.orbit, &kept);
    Ok(Day {
        file,
        profile,
        recorded: Recorded::of(image.site.id, &flown.errors.profile_shift, &kept),
        kept: context,
    })
}
