//! True values of a campaign, for `truth.json`.

use serde::Serialize;

use super::{
    super::{
        drawn::{DayErrors, Flown},
        truth::{Biases, Crossover, FileTruth},
    },
    errors::CampaignErrors,
    misregistration::Misregistration,
    plan::PHASES,
};

/// All true values.
#[derive(Debug, Serialize)]
pub(super) struct CampaignTruth<'a> {
    made_by: &'static str,
    synthetic: &'static str,
    seed: u64,
    orbit: &'static str,
    errors: CampaignErrors,
    errors_rule: &'static str,
    biases: Biases,
    crossover: Crossover,
    misregistration_rule: &'static str,
    phases: Vec<PhaseTruth>,
    pairs: Vec<PairTruth<'a>>,
    images: Vec<ImageTruth<'a>>,
    rejected: Vec<RejectedTruth>,
    files: Vec<FileTruth>,
}

/// A phase.
#[derive(Debug, Serialize)]
struct PhaseTruth {
    phase: &'static str,
    images: usize,
    pairs: usize,
    /// Offset of the attitude's clock in all its images.
    attitude_clock_s: f64,
    /// Mean over its pairs of the part of the along-track misregistration that this offset causes.
    clock_along_m: Option<f64>,
    /// Mean of the along-track misregistration of its pairs, and its standard deviation from pair to pair.
    along_m: Option<f64>,
    along_standard_deviation_m: Option<f64>,
}

/// A pair of images.
#[derive(Debug, Serialize)]
pub(super) struct PairTruth<'a> {
    pub(super) site: &'a str,
    pub(super) phase: &'static str,
    /// In order of time; the second is off nadir.
    pub(super) images: [&'a str; 2],
    /// Tie points in its table, and their identifiers that are blunders.
    pub(super) ties: usize,
    pub(super) blunders: Vec<String>,
    /// Standard deviation of the noise of the tie points as the table states it, and the true one.
    pub(super) tie_noise_px: f64,
    pub(super) tie_noise_true_px: f64,
    /// Misregistration of the first image minus that of the second, mean over the tie points; `lines` and `samples` are those of the
    /// second image.
    pub(super) along_m: f64,
    pub(super) along_lines: f64,
    pub(super) across_m: f64,
    pub(super) across_samples: f64,
    pub(super) clock_along_m: f64,
}

/// An image.
#[derive(Debug, Serialize)]
pub(super) struct ImageTruth<'a> {
    image: &'a str,
    site: &'a str,
    phase: &'static str,
    start_et_s: f64,
    misregistration: Misregistration,
    errors: DayErrors,
}

/// A row of the index that a selection must reject.
#[derive(Debug, Serialize)]
pub(super) struct RejectedTruth {
    pub(super) product_id: String,
    pub(super) reason: &'static str,
}

impl<'a> ImageTruth<'a> {
    /// True values of an image of a phase.
    pub(super) fn new(flown: &Flown<'a>, phase: usize, misregistration: Misregistration) -> Self {
        let image = flown.arc.image;
        Self {
            image: image.id,
            site: image.site.id,
            phase: PHASES[phase].id,
            start_et_s: flown.arc.exposed.start.seconds(),
            misregistration,
            errors: flown.errors.clone(),
        }
    }
}

impl PhaseTruth {
    fn new(index: usize, attitude_clock_s: f64, pairs: &[PairTruth<'_>], images: usize) -> Self {
        let phase = PHASES[index].id;
        let own: Vec<&PairTruth<'_>> = pairs.iter().filter(|pair| pair.phase == phase).collect();
        let count = own.len() as f64;
        let mean = |value: fn(&PairTruth<'_>) -> f64| {
            let sum: f64 = own.iter().map(|pair| value(pair)).sum();
            (!own.is_empty()).then_some(sum / count)
        };
        let along_m = mean(|pair| pair.along_m);
        let squares = along_m.map(|mean_m| {
            let off_m = own.iter().map(|pair| (pair.along_m - mean_m).powi(2));
            off_m.sum::<f64>()
        });
        Self {
            phase,
            images,
            pairs: own.len(),
            attitude_clock_s,
            clock_along_m: mean(|pair| pair.clock_along_m),
            along_m,
            along_standard_deviation_m: squares
                .filter(|_| own.len() > 1)
                .map(|squares_m2| (squares_m2 / (count - 1.0)).sqrt()),
        }
    }
}

impl<'a> CampaignTruth<'a> {
    /// The true values of a campaign.
    pub(super) fn new(
        seed: u64,
        errors: CampaignErrors,
        pairs: Vec<PairTruth<'a>>,
        images: Vec<ImageTruth<'a>>,
        rejected: Vec<RejectedTruth>,
        files: Vec<FileTruth>,
    ) -> Self {
        let phases = errors.clock_s.iter().enumerate();
        let phases = phases.map(|(index, clock_s)| {
            let own = images
                .iter()
                .filter(|image| image.phase == PHASES[index].id);
            PhaseTruth::new(index, *clock_s, &pairs, own.count())
        });
        Self {
            made_by: "areograph scene",
            synthetic: "all values are invented",
            seed,
            orbit: "gsfc is true except for the errors of the images; campaign.toml uses nav, which differs from it",
            phases: phases.collect(),
            errors,
            errors_rule: "Members of errors.sizes are standard deviations and ranges; the errors of an image are values drawn from \
                them for its day. All images of a phase have its attitude_clock_s: the true attitude of the bus is the C-kernel \
                attitude without its bias, attitude_clock_s later, rotated by attitude: the matrix from J2000 to the bus is \
                exp([e]x) times the C-kernel matrix, with e = constant + linear x + quadratic x^2 + jitter and x = (et - middle) \
                / half_image, held beyond -4 and 4. Lines were exposed time_bias_lines later than the label states. \
                bus_position_m (camera and laser) is added to the orbit gsfc, IAU 2000. The laser points boresight_rad from +Z \
                of the bus towards its X and Y throughout the mission. tie_noise_px of a pair replaces that of errors.sizes. east_north_radial_m is the position of the shots in the \
                PEDR file minus their true position.",
            biases: Biases::injected(),
            crossover: Crossover::injected(),
            misregistration_rule: "The misregistration of an image is the line and the sample at which label and kernels (orbit \
                nav) place true ground, minus those at which the image shows it: the mean over the image, in lines and samples, \
                and in metres by line_spacing_m and pixel_m, perpendicular to the ray. That of a pair is the first image minus \
                the second, mean over the ground of its tie points. clock_along_m is the part that attitude_clock_s causes: a bus \
                at nadir turns, one that is held inertially off nadir does not.",
            pairs,
            images,
            rejected,
            files,
        }
    }
}
