//! A campaign: image pairs and single images of five mission phases, with index, kernels, PEDR files and tie points.

mod errors;
mod index;
mod misregistration;
mod plan;
mod seen;
mod settings;
mod truth;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use self::{
    errors::CampaignErrors,
    index::{Row, Value, write_index},
    misregistration::{ByKernels, Misregistration, Stated, mean},
    plan::{CampaignPlan, PHASES},
    seen::Seen,
    settings::{EMISSION_MAX_DEG, INCIDENCE_MAX_DEG, README, campaign_toml},
    truth::{CampaignTruth, ImageTruth, PairTruth, RejectedTruth},
};
use super::{
    arc::Arc,
    drawn::Flown,
    error::SceneError,
    files::{Draft, put},
    kernels::{
        Flightpath, clock_session, image_start, write_attitude, write_metakernels, write_orbits,
        write_planets_of, write_texts,
    },
    mission::{write_as_truth, write_file_of_day},
    plan::{PlannedImage, Site},
    random::Random,
    sites::planned_label,
    terrain::Terrain,
    ties::{TieNoise, TrueImage, exact_ties, spoil, ties_name},
};
use areograph_base::{error::Result, watch::Watch};
use areograph_pds::ties::ties_table;

/// Seconds of frames in the file of an image: the slews of an image off nadir take longer.
const PEDR_S: f64 = 300.0;
/// Tie points of a pair.
const TIES: u32 = 154;
/// Fewest and most pairs, and single images.
const PAIRS: [f64; 2] = [1.0, 200.0];
const SINGLES: [f64; 2] = [0.0, 200.0];

/// Options of a synthetic campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CampaignOptions {
    /// Seed of all drawn values.
    pub seed: u64,
    /// Pairs of images, 1 to 200.
    pub pairs: u32,
    /// Images in no pair, 0 to 200.
    pub singles: u32,
}

/// Summary of the campaign written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignSummary {
    /// Its folder.
    pub directory: PathBuf,
    /// Pairs of images.
    pub pairs: usize,
    /// Images.
    pub images: usize,
    /// Rows of the index.
    pub rows: usize,
}

impl fmt::Display for CampaignSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let directory = self.directory.display();
        write!(
            formatter,
            "{directory}: {} image{} in {} phases, {} pair{}, {} rows in index/cumindex.tab; next: areograph campaign \
             {directory}/campaign.toml",
            self.images,
            if self.images == 1 { "" } else { "s" },
            PHASES.len(),
            self.pairs,
            if self.pairs == 1 { "" } else { "s" },
            self.rows,
        )
    }
}

/// Writes a campaign into `directory`, replacing an older one unless files were added or changed.
///
/// The same options give the same bytes with any number of threads. No session may be open on this thread.
///
/// * `watch` – counts the images
///
/// # Errors
/// Too few or too many images; a folder that holds something else; errors of writing.
pub fn write_campaign(
    directory: &Path,
    options: &CampaignOptions,
    watch: Watch<'_>,
) -> Result<CampaignSummary> {
    check(options)?;
    let [pairs, singles] = [options.pairs, options.singles].map(|count| count as usize);
    let seed = options.seed;
    let draft = Draft::begin(directory, README)?;
    let kernels = draft.folder("kernels")?;
    write_texts(&kernels)?;
    let session = clock_session(&kernels)?;
    let plan = CampaignPlan::draw(pairs, singles, seed, &session)?;
    let sites: Vec<Site<'_>> = plan.places.iter().map(plan::Place::site).collect();
    let images = plan.exposures.iter();
    let images: Vec<PlannedImage<'_>> = images
        .map(|image| image.image(&sites[image.place]))
        .collect();
    let phase = |index: usize| plan.places[plan.exposures[index].place].phase;

    let starts = images.iter().map(|image| image_start(&session, image));
    let starts = starts.collect::<Result<Vec<_>>>()?;
    let arcs = images.par_iter().zip(starts);
    let arcs = arcs.map(|(image, start)| Arc::new(image, start, PEDR_S));
    let arcs = arcs.collect::<Result<Vec<_>>>()?;
    let labels = draft.folder("labels")?;
    for (index, arc) in arcs.iter().enumerate() {
        let label = planned_label(arc, PHASES[phase(index)].mission_phase, &session)?;
        put(&labels.join(format!("{}.lbl", arc.image.id)), &label)?;
    }
    // As in the archive, a phase has kernels of its own.
    let paths: Vec<Flightpath<'_>> = arcs
        .iter()
        .map(|arc| Flightpath::of_arc(arc, seed))
        .collect();
    let of_phase = |number: usize| (0..arcs.len()).filter(move |index| phase(*index) == number);
    let parts = PHASES.each_ref().map(|phase| phase.id.to_ascii_lowercase());
    let parts: Vec<(usize, &str)> = parts.iter().map(|part| &**part).enumerate().collect();
    let flown = parts
        .into_iter()
        .filter(|(number, _)| of_phase(*number).next().is_some());
    let flown: Vec<(usize, &str)> = flown.collect();
    for (number, part) in &flown {
        let own: Vec<&Arc<'_>> = of_phase(*number).map(|index| &arcs[index]).collect();
        write_attitude(&kernels, part, &session, &own)?;
    }
    drop(session);
    for (number, part) in &flown {
        let own: Vec<&Flightpath<'_>> = of_phase(*number).map(|index| &paths[index]).collect();
        write_orbits(&kernels, part, &own)?;
    }
    write_planets_of(&kernels, &paths)?;
    let parts: Vec<&str> = flown.into_iter().map(|(_, part)| part).collect();
    write_metakernels(&kernels, &parts)?;

    let errors = CampaignErrors::draw(seed);
    let days: Vec<Flown<'_>> = (0..)
        .zip(arcs)
        .map(|(index, arc)| Flown {
            errors: errors.of_day(&arc, phase(index), seed),
            arc,
        })
        .collect();
    let directions: Vec<_> = sites.iter().map(Site::direction).collect();
    let terrain = Terrain::new(seed, &directions, errors.sizes.relief);
    watch.announce(days.len());
    let pedr = draft.folder("pedr")?;
    let files = days.par_iter().map(|flown| {
        let altimeter = &errors.sizes.altimeter;
        let written = write_file_of_day(&pedr, flown, &terrain, altimeter, seed, |_| false);
        watch.step(1, "images");
        Ok(written?.0)
    });
    let files = files.collect::<Result<Vec<_>>>()?;

    let ties = draft.folder("ties")?;
    let surveyed = (0..plan.places.len()).into_par_iter().map(|place| {
        let own = days.iter().zip(&plan.exposures);
        let own: Vec<&Flown<'_>> = own
            .filter(|(_, exposure)| exposure.place == place)
            .map(|(flown, _)| flown)
            .collect();
        survey(&ties, &plan.places[place], &own, &terrain, &errors, seed)
    });
    let surveyed = surveyed.collect::<Result<Vec<Surveyed<'_>>>>()?;
    let mut rows = Vec::new();
    let (mut of_pairs, mut of_images) = (Vec::new(), Vec::new());
    for place in surveyed {
        of_pairs.extend(place.pair);
        for (row, truth) in place.images {
            rows.push(row);
            of_images.push(truth);
        }
    }
    let (lines, rejected) = with_rejected(&rows);
    write_index(&draft.folder("index")?, &lines)?;
    put(&draft.root().join("campaign.toml"), &campaign_toml())?;
    let summary = CampaignSummary {
        directory: directory.to_owned(),
        pairs: of_pairs.len(),
        images: of_images.len(),
        rows: lines.len(),
    };
    let truth = CampaignTruth::new(seed, errors, of_pairs, of_images, rejected, files);
    write_as_truth(&draft, &truth)?;
    draft.finish()?;
    Ok(summary)
}

/// Rejects options that are out of range.
fn check(options: &CampaignOptions) -> Result<()> {
    let counts = [
        ("pairs", options.pairs, PAIRS),
        ("singles", options.singles, SINGLES),
    ];
    for (option, count, [least, most]) in counts {
        let value = f64::from(count);
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

/// A place surveyed: rows of the index and true values of its images, and those of its pair.
struct Surveyed<'a> {
    images: Vec<(Row, ImageTruth<'a>)>,
    pair: Option<PairTruth<'a>>,
}

/// Surveys a place, and writes the tie points of its pair.
fn survey<'a>(
    folder: &Path,
    place: &'a plan::Place,
    days: &[&'a Flown<'a>],
    terrain: &Terrain,
    errors: &CampaignErrors,
    seed: u64,
) -> Result<Surveyed<'a>> {
    let truly = days.iter().map(|flown| TrueImage::new(flown, terrain));
    let truly = truly.collect::<Result<Vec<_>>>()?;
    let flights: Vec<ByKernels<'_>> = days
        .iter()
        .map(|flown| ByKernels::of(flown, seed))
        .collect();
    let cameras = flights.iter().map(|flight| flight.cameras(terrain));
    let cameras = cameras.collect::<Result<Vec<_>>>()?;
    let stated = cameras
        .iter()
        .map(Stated::new)
        .collect::<Result<Vec<_>>>()?;
    let mission_phase = PHASES[place.phase].mission_phase;
    let images = truly.iter().zip(&stated).map(|(image, stated)| {
        let misregistration = stated.of_image(image, terrain)?;
        let row = Seen::of(image, terrain)?.row(mission_phase);
        Ok((
            row,
            ImageTruth::new(image.flown, place.phase, misregistration),
        ))
    });
    let images = images.collect::<Result<Vec<_>>>()?;
    let pair = match (<[_; 2]>::try_from(truly), &stated[..], place.tie_noise_px) {
        (Ok(pair), [first, second], Some(noise_px)) => {
            let tied = Tied {
                pair: &pair,
                stated: [first, second],
                noise_px,
            };
            Some(tied.write(folder, place, terrain, errors, seed)?)
        }
        _ => None,
    };
    Ok(Surveyed { images, pair })
}

/// A pair whose tie points are to be measured.
struct Tied<'a, 'b> {
    pair: &'b [TrueImage<'a>; 2],
    stated: [&'b Stated<'b>; 2],
    /// Stated noise.
    noise_px: f64,
}

impl<'a> Tied<'a, '_> {
    /// Writes the tie points of the pair; returns its true values.
    fn write(
        &self,
        folder: &Path,
        place: &'a plan::Place,
        terrain: &Terrain,
        errors: &CampaignErrors,
        seed: u64,
    ) -> Result<PairTruth<'a>> {
        let site = &place.id;
        let mut random = Random::new(seed, &format!("ties {site}"));
        let exact = exact_ties(self.pair, TIES, terrain, &mut random)?;
        let apart = exact.iter().filter_map(|tie| {
            let [(_, first), (_, second)] = &tie.measures[..] else {
                return None;
            };
            let first = self.stated[0].of_ground(&tie.ground_m, first)?;
            let second = self.stated[1].of_ground(&tie.ground_m, second)?;
            Some([first, second])
        });
        let (first, second): (Vec<Misregistration>, Vec<Misregistration>) =
            apart.map(|[first, second]| (first, second)).unzip();
        let [first, second] = [mean(&first), mean(&second)];
        let sizes = &errors.sizes;
        let noise = TieNoise::of(sizes).stated_as(sizes, self.noise_px);
        let (mut measured, truth) = spoil(exact, self.pair.len(), noise, &mut random);
        for measure in measured.iter_mut().flat_map(|tie| &mut tie.measures) {
            measure.sigma_px = Some([self.noise_px; 2]);
        }
        put(&folder.join(ties_name(site)), &ties_table(&measured))?;
        let blunders = truth.into_iter().filter(|tie| tie.blunder.is_some());
        let along_m = first.along_m - second.along_m;
        let across_m = first.across_m - second.across_m;
        Ok(PairTruth {
            site,
            phase: PHASES[place.phase].id,
            images: self.pair.each_ref().map(|image| image.flown.arc.image.id),
            ties: measured.len(),
            blunders: blunders.map(|tie| tie.id).collect(),
            tie_noise_px: self.noise_px,
            tie_noise_true_px: sizes.tie_noise_factor * self.noise_px,
            along_m,
            along_lines: along_m / second.line_spacing_m,
            across_m,
            across_samples: across_m / second.pixel_m,
            clock_along_m: first.clock_along_m - second.clock_along_m,
        })
    }
}

/// Lines of the index: the rows of the images, and rows that a selection must reject, of images that were never taken.
fn with_rejected(rows: &[Row]) -> (Vec<String>, Vec<RejectedTruth>) {
    let text = |text: &str| Value::Text(text.to_owned());
    let number = Value::Number;
    let changes: [(&'static str, &[(&str, Value)]); 7] = [
        (
            "emission",
            &[("EMISSION_ANGLE", number(EMISSION_MAX_DEG + 18.4))],
        ),
        (
            "incidence",
            &[("INCIDENCE_ANGLE", number(INCIDENCE_MAX_DEG + 9.7))],
        ),
        ("target", &[("TARGET_NAME", text("PHOBOS"))]),
        ("unknown camera", &[("INSTRUMENT_NAME", text("MOC-XX"))]),
        (
            "other camera",
            &[
                ("INSTRUMENT_NAME", text("MOC-WA")),
                ("FILTER_NAME", text("RED")),
            ],
        ),
        ("bad row: no lines", &[("LINES", number(0.0))]),
        ("bad row: too few fields", &[]),
    ];
    let (mut lines, mut rejected) = (Vec::new(), Vec::new());
    for (number, (reason, changed)) in (0..).zip(changes) {
        let Some(like) = rows.get(number % rows.len().max(1)) else {
            break;
        };
        let product_id = format!("{}/{:05}", like.phase(), 90_001 + number);
        let row = like
            .clone()
            .with("PRODUCT_ID", &Value::Text(product_id.clone()));
        let row = changed
            .iter()
            .fold(row, |row, (column, value)| row.with(column, value));
        let line = row.line();
        let half = line.split_at(line.len() / 2).0.to_owned();
        lines.push(if changed.is_empty() { half } else { line });
        rejected.push(RejectedTruth { product_id, reason });
    }
    let mut all: Vec<String> = rows.iter().map(Row::line).collect();
    all.append(&mut lines);
    (all, rejected)
}
