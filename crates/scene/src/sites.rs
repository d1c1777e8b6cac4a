//! Site configurations, image labels and the README of a synthetic mission.

use std::fmt::Write as _;

use super::{
    arc::Arc,
    error_sources::SceneErrors,
    further_passes::FurtherPass,
    images::image_name,
    plan::{Look, Site},
    ties::ties_name,
    truth::TiesTruth,
};
use areograph_base::error::Result;
use areograph_config::{ShotFormat, usual_altimeter, usual_instrument};
use areograph_spice::Session;

/// Source stated in the products.
const INJECTED: &str = "injected by areograph scene";

/// Option for matching tie points in pixels, as a comment.
const MATCH: &str =
    "# match = true  # also measures tie points in the image pixels, with or without files\n";

/// A window of a site file, degrees.
pub(super) struct Window {
    /// Identifier.
    pub id: String,
    /// Western and eastern edge.
    pub longitude_deg: [f64; 2],
    /// Southern and northern edge.
    pub latitude_deg: [f64; 2],
}

/// An image of a site file.
pub(super) struct SiteImage {
    /// Identifier.
    pub id: String,
    /// Path of the label.
    pub label: String,
    /// Lines delivered, when fewer than the label's.
    pub lines_delivered: Option<u32>,
    /// Path of its pixels, if any.
    pub pixels: Option<String>,
}

/// Tie points of a site file.
pub(super) struct SiteTies {
    /// Path of the file.
    pub file: String,
    /// Note on their noise in the site file.
    pub note: String,
    /// Standard deviations along and across the track, focal-plane pixels.
    pub sigma_px: [f64; 2],
}

/// Kernels of a site file.
pub(super) enum SiteKernels {
    /// Path of a metakernel.
    Metakernel(String),
    /// Families of orbits and the metakernels that load them, to choose from.
    Rivals([(&'static str, String); 3]),
}

impl SiteKernels {
    /// The tables of the site file.
    fn to_toml(&self) -> String {
        match self {
            Self::Metakernel(path) => format!("[kernels]\nmetakernel = {}\n", quoted(path)),
            Self::Rivals(rivals) => {
                let sets = rivals.each_ref().map(|(id, path)| {
                    format!(
                        "[[kernels.sets]]\nid = {}\nmetakernel = {}\n",
                        quoted(id),
                        quoted(path)
                    )
                });
                sets.join("\n")
            }
        }
    }
}

/// Content of a site file.
pub(super) struct SiteFile<'a> {
    /// Identifier.
    pub id: &'a str,
    /// Free text.
    pub description: String,
    /// Its kernels.
    pub kernels: SiteKernels,
    /// Paths of the PEDR files.
    pub pedr: Vec<String>,
    /// Tie points, if any.
    pub ties: Option<SiteTies>,
    /// Windows.
    pub windows: Vec<Window>,
    /// Images.
    pub images: Vec<SiteImage>,
}

/// A string in TOML quotes.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

impl SiteFile<'_> {
    /// The file's text.
    pub(super) fn to_toml(&self) -> String {
        let files: Vec<String> = self.pedr.iter().map(|file| quoted(file)).collect();
        let mut text = format!(
            "# Written by `areograph scene`; paths are relative to the folder of this file.\n\
             site = {}\ndescription = {}\n\n{}\n\
             [pointing]\nck_bias_s = {}\nsource = {}\n\n\
             [altimeter_clock]\nbias_s = {}\nsign = \"late\"\nscope = \"spk_lookup\"\nsource = {}\n\n\
             [pedr]\nfiles = [{}]\ndatum = \"auto\"\n",
            quoted(self.id),
            quoted(&self.description),
            self.kernels.to_toml(),
            usual_instrument().pointing.ck_bias_s,
            quoted(INJECTED),
            usual_altimeter().clock_bias_s,
            quoted(INJECTED),
            files.join(", "),
        );
        if let Some(ties) = &self.ties {
            let has_pixels = self.images.iter().any(|image| image.pixels.is_some());
            let _infallible = write!(
                text,
                "\n[ties]\nfiles = [{}]\n{}\n[adjustment]\n# {}\ntie_sigma_px = {:?}\n",
                quoted(&ties.file),
                if has_pixels { MATCH } else { "" },
                ties.note,
                ties.sigma_px,
            );
        }
        let _infallible = write!(
            text,
            "\n# All footprint formats; without this table, a run writes only footprints.parquet.\n\
             [products]\nformats = [{}]\n",
            ShotFormat::WORDS.map(|(word, _)| quoted(word)).join(", "),
        );
        for window in &self.windows {
            let [west, east] = window.longitude_deg;
            let [south, north] = window.latitude_deg;
            let _infallible = write!(
                text,
                "\n[[windows]]\nid = {}\nlongitude_deg = [{west:?}, {east:?}]\nlatitude_deg = [{south:?}, {north:?}]\n",
                quoted(&window.id),
            );
        }
        for image in &self.images {
            let _infallible = write!(
                text,
                "\n[[images]]\nid = {}\nlabel = {}\n",
                quoted(&image.id),
                quoted(&image.label)
            );
            if let Some(lines) = image.lines_delivered {
                let _infallible = writeln!(text, "lines_delivered = {lines}");
            }
            if let Some(pixels) = &image.pixels {
                let _infallible = writeln!(text, "pixels = {}", quoted(pixels));
            }
        }
        text
    }
}

/// The window of this half width and height around a site.
pub(super) fn window(site: &Site, [east_deg, north_deg]: [f64; 2]) -> Window {
    let around = |centre: f64, half: f64| {
        // Whole hundredths of a degree are written without rounding noise.
        [centre - half, centre + half].map(|edge| (edge * 100.0).round() / 100.0)
    };
    Window {
        id: site.id.to_owned(),
        longitude_deg: around(site.longitude_deg, east_deg),
        latitude_deg: around(site.latitude_deg, north_deg),
    }
}

/// The site file of `site`, with the images and PEDR files of its arcs, further passes, and the tie points of `ties`; the images may
/// have pixels.
pub(super) fn planned_site<'a>(
    site: &'a Site,
    arcs: &[&Arc<'_>],
    passes: &[&FurtherPass],
    errors: &SceneErrors,
    ties: &TiesTruth,
    has_pixels: bool,
) -> SiteFile<'a> {
    let is_demo = *errors == SceneErrors::demo();
    let ties_of_demo = || {
        let note = "The noise of these tie points has a standard deviation of one line, which is 1.1 to 1.6 \
         focal-plane pixels.";
        (note.to_owned(), [1.6, 1.0])
    };
    let ties_with_noise = |noise_px: f64| {
        let per_line = ties.cameras.iter().map(|camera| camera.focal_px_per_line);
        let per_line: Vec<f64> = per_line.collect();
        let lines = if let [first, second] = per_line[..] {
            format!("{first:.2} and {second:.2} focal-plane pixels in the two images")
        } else {
            let least = per_line.iter().copied().fold(f64::INFINITY, f64::min);
            let most = per_line.iter().copied().fold(0.0, f64::max);
            let images = per_line.len();
            format!("{least:.2} to {most:.2} focal-plane pixels in the {images} images")
        };
        let note = format!(
            "The noise of these tie points has a standard deviation of {noise_px} lines and samples; a line is {lines}."
        );
        let along_px = per_line.iter().sum::<f64>() / per_line.len() as f64 * noise_px;
        (note, [(1_000.0 * along_px).round() / 1_000.0, noise_px])
    };
    let (note, sigma_px) = if is_demo {
        ties_of_demo()
    } else {
        ties_with_noise(errors.tie_noise_px)
    };
    SiteFile {
        id: site.id,
        description: format!("{}, synthetic", site.name),
        kernels: SiteKernels::Metakernel("../kernels/nav.tm".to_owned()),
        pedr: arcs
            .iter()
            .map(|arc| arc.image.pedr_name())
            .chain(passes.iter().map(|pass| pass.file()))
            .map(|file| format!("../pedr/{file}"))
            .collect(),
        ties: Some(SiteTies {
            file: format!("../ties/{}", ties_name(site.id)),
            note,
            sigma_px,
        }),
        windows: vec![window(
            site,
            [
                Site::WINDOW_HALF_LONGITUDE_DEG,
                Site::WINDOW_HALF_LATITUDE_DEG,
            ],
        )],
        images: arcs
            .iter()
            .map(|arc| {
                let image = arc.image;
                SiteImage {
                    id: image.id.to_owned(),
                    label: format!("../labels/{}.lbl", image.id),
                    lines_delivered: (image.lines_delivered < image.lines_header)
                        .then_some(image.lines_delivered),
                    pixels: has_pixels.then(|| format!("../images/{}", image_name(image.id))),
                }
            })
            .collect(),
    }
}

/// Content of a label.
pub(super) struct Label<'a> {
    /// Product id with `-` for `/`.
    pub id: &'a str,
    /// Mission phase.
    pub mission_phase: &'a str,
    /// Instrument.
    pub instrument: &'a str,
    /// Filter, if the camera has one.
    pub filter: Option<&'a str>,
    /// UTC of the first line.
    pub start: &'a str,
    /// UTC of the end of the last line.
    pub stop: &'a str,
    /// Clock string of the first line.
    pub sclk_start: &'a str,
    /// Exposure of a detector line, milliseconds.
    pub exposure_ms: f64,
    /// Detector lines and pixels summed.
    pub summing: u32,
    /// First detector pixel, counted from 0.
    pub first_detector: u32,
    /// Rationale of the image.
    pub rationale: &'a str,
    /// Lines.
    pub lines: u32,
    /// Samples per line.
    pub samples: u32,
}

/// A detached PDS3 label of the arc's image.
///
/// * `mission_phase` – as the label names it
///
/// # Errors
/// Errors of the session in converting the time of the last line.
pub(super) fn planned_label(arc: &Arc, mission_phase: &str, session: &Session) -> Result<String> {
    let image = arc.image;
    let look = match image.look {
        Look::Nadir => "nadir",
        Look::Roll { .. } => "off nadir",
    };
    Ok(image_label(&Label {
        id: image.id,
        mission_phase,
        instrument: &usual_instrument().label.instrument,
        filter: None,
        start: image.utc_start,
        stop: &session.et_to_utc(arc.exposed.stop)?,
        sclk_start: image.sclk_start,
        exposure_ms: image.exposure_ms,
        summing: image.summing,
        first_detector: 0,
        rationale: &format!("SYNTHETIC {}, {look}", image.site.name),
        lines: image.lines_header,
        samples: image.samples(),
    }))
}

/// A detached PDS3 label in the archive's keywords.
pub(super) fn image_label(label: &Label<'_>) -> String {
    let mut lines = vec![
        "PDS_VERSION_ID = PDS3".to_owned(),
        "NOTE = \"SYNTHETIC: written by areograph scene; no image file exists\"".to_owned(),
        format!("FILE_NAME = \"{}.IMQ\"", label.id.replace('-', "")),
        "RECORD_TYPE = UNDEFINED".to_owned(),
        "SPACECRAFT_NAME = MARS_GLOBAL_SURVEYOR".to_owned(),
        format!("MISSION_PHASE_NAME = \"{}\"", label.mission_phase),
        "TARGET_NAME = MARS".to_owned(),
        format!("INSTRUMENT_ID = \"{}\"", label.instrument),
    ];
    lines.extend(
        label
            .filter
            .map(|filter| format!("FILTER_NAME = \"{filter}\"")),
    );
    lines.extend([
        "SOFTWARE_NAME = \"areograph scene\"".to_owned(),
        format!("PRODUCT_ID = \"{}\"", label.id.replace('-', "/")),
        format!("START_TIME = {}", label.start),
        format!("IMAGE_TIME = {}", label.start),
        format!("STOP_TIME = {}", label.stop),
        format!("SPACECRAFT_CLOCK_START_COUNT = \"{}\"", label.sclk_start),
        "SPACECRAFT_CLOCK_STOP_COUNT = \"N/A\"".to_owned(),
        format!(
            "LINE_EXPOSURE_DURATION = {:.6} <MILLISECONDS>",
            label.exposure_ms
        ),
        format!("DOWNTRACK_SUMMING = {}", label.summing),
        format!("CROSSTRACK_SUMMING = {}", label.summing),
        format!("EDIT_MODE_ID = \"{}\"", label.first_detector),
        format!("RATIONALE_DESC = \"{}\"", label.rationale),
        "DATA_QUALITY_DESC = \"OK\"".to_owned(),
        "OBJECT = IMAGE".to_owned(),
        format!("LINES = {}", label.lines),
        format!("LINE_SAMPLES = {}", label.samples),
        "SAMPLE_TYPE = UNSIGNED_INTEGER".to_owned(),
        "SAMPLE_BITS = 8".to_owned(),
        "END_OBJECT = IMAGE".to_owned(),
        "END".to_owned(),
    ]);
    lines.join("\r\n") + "\r\n"
}

/// Text of `README.txt` below its first line.
pub(super) const README: &str = "\
kernels/     text kernels; orbit (three rival versions), attitude, Mars and Sun as binary kernels;
             nav.tm, gsfc.tm and ipng.tm load one version of the orbit each with all other kernels; nav_wa.tm,
             gsfc_wa.tm and ipng_wa.tm also load the frames of the wide-angle cameras
pedr/        MOLA PEDR files: two whole days, five single revolutions; version K refers to IAU 1991, L to IAU 2000;
             from ap20001l.b on, with --passes only: further passes over the sites
images/      with --images only: the six narrow-angle images, as in the archive
labels/      labels of six narrow-angle and three wide-angle images
ties/        tie points measured in the images of a site; some are blunders
sites/       configurations for `areograph run`; gusev_context chooses among the three orbits, and has a profile
             that is not simultaneous with any image
truth.json   true values: biases, image orientations, footprints in the windows of the sites, errors of the rival
             orbits (the orbit `gsfc` is true), and the true time and position of each exposure of the tie points;
             drawn errors and the distributions from which they were drawn

Image ids, times, summing, line counts, line periods and emission angles are from Shan et al. 2005, Table 2. The
table reports 7424 lines for E04-01275; here 8064 are exposed, as Table 4 requires. Terrain, orbits and
attitudes are invented.
With --pairs, further pairs of the sites were taken 89, 178, … sols earlier; ids and times of their images are invented.
The wide-angle images of gusev_context and its profile of 2001-03-12 (ap18983l.b) are also invented.
";

/// Text of `README.txt` for a flight along given kernels.
pub(super) const README_ALONG: &str = "\
pedr/        a MOLA PEDR file, version L (IAU 2000), of shots flown along given kernels over invented terrain
sites/       a configuration for `areograph run`
truth.json   biases and true footprints
";
