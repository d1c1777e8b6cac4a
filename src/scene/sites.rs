//! Site configurations, image labels and the note that go with an invented mission.

use std::fmt::Write as _;

use super::{
    arc::Arc,
    plan::{Look, Site},
    ties::ties_name,
};
use crate::{
    config::{built_in_altimeter, usual_instrument},
    error::Result,
    spice::Session,
};

/// Sources that products repeat.
const INJECTED: &str = "injected by areograph scene";

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
}

/// What a site file says.
pub(super) struct SiteFile<'a> {
    /// Identifier.
    pub id: &'a str,
    /// Free text.
    pub description: String,
    /// Path of the metakernel.
    pub metakernel: String,
    /// Paths of the PEDR files.
    pub pedr: Vec<String>,
    /// Path of the tie points, where there are any.
    pub ties: Option<String>,
    /// Windows.
    pub windows: Vec<Window>,
    /// Images.
    pub images: Vec<SiteImage>,
}

/// A string as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

impl SiteFile<'_> {
    /// The file's text.
    pub(super) fn to_toml(&self) -> String {
        let files: Vec<String> = self.pedr.iter().map(|file| quoted(file)).collect();
        let mut text = format!(
            "# Written by `areograph scene`; paths count from the folder of this file.\n\
             site = {}\ndescription = {}\n\n[kernels]\nmetakernel = {}\n\n\
             [pointing]\nck_bias_s = {}\nsource = {}\n\n\
             [mola_clock]\nbias_s = {}\nsign = \"late\"\nscope = \"spk_lookup\"\nsource = {}\n\n\
             [pedr]\nfiles = [{}]\ndatum = \"auto\"\n",
            quoted(self.id),
            quoted(&self.description),
            quoted(&self.metakernel),
            usual_instrument().pointing.ck_bias_s,
            quoted(INJECTED),
            built_in_altimeter().clock_bias_s,
            quoted(INJECTED),
            files.join(", "),
        );
        if let Some(ties) = &self.ties {
            let _infallible = write!(
                text,
                "\n[ties]\nfiles = [{}]\n\n\
                 [adjustment]\n# A line, the noise of these tie points, is 1.3 to 1.6 focal pixels.\n\
                 tie_sigma_px = [1.6, 1.0]\n",
                quoted(ties)
            );
        }
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
        }
        text
    }
}

/// The site file of `site`, whose images and PEDR files are those of its arcs.
pub(super) fn planned_site<'a>(site: &'a Site, arcs: &[&Arc]) -> SiteFile<'a> {
    let around = |centre: f64, half: f64| {
        // Whole hundredths of a degree print without rounding noise.
        [centre - half, centre + half].map(|edge| (edge * 100.0).round() / 100.0)
    };
    SiteFile {
        id: site.id,
        description: format!("{}, synthetic", site.name),
        metakernel: "../kernels/nav.tm".to_owned(),
        pedr: arcs
            .iter()
            .map(|arc| format!("../pedr/{}", arc.image.pedr_name()))
            .collect(),
        ties: Some(format!("../ties/{}", ties_name(site.id))),
        windows: vec![Window {
            id: site.id.to_owned(),
            longitude_deg: around(site.longitude_deg, Site::WINDOW_HALF_LONGITUDE_DEG),
            latitude_deg: around(site.latitude_deg, Site::WINDOW_HALF_LATITUDE_DEG),
        }],
        images: arcs
            .iter()
            .map(|arc| {
                let image = arc.image;
                SiteImage {
                    id: image.id.to_owned(),
                    label: format!("../labels/{}.lbl", image.id),
                    lines_delivered: (image.lines_delivered < image.lines_header)
                        .then_some(image.lines_delivered),
                }
            })
            .collect(),
    }
}

/// A detached PDS3 label of the arc's image, in the archive's keywords.
///
/// # Errors
/// What the session says of the time of the last line.
pub(super) fn image_label(arc: &Arc, session: &Session) -> Result<String> {
    let image = arc.image;
    let stop = session.et_to_utc(arc.exposed.stop)?;
    let rationale = match image.look {
        Look::Nadir => format!("SYNTHETIC {}, nadir", image.site.name),
        Look::Roll { .. } => format!("SYNTHETIC {}, off nadir", image.site.name),
    };
    let lines = [
        "PDS_VERSION_ID = PDS3".to_owned(),
        "NOTE = \"SYNTHETIC: written by areograph scene, there is no such image file\"".to_owned(),
        format!("FILE_NAME = \"{}.IMQ\"", image.id.replace('-', "")),
        "RECORD_TYPE = UNDEFINED".to_owned(),
        "SPACECRAFT_NAME = MARS_GLOBAL_SURVEYOR".to_owned(),
        "MISSION_PHASE_NAME = \"EXTENDED\"".to_owned(),
        "TARGET_NAME = MARS".to_owned(),
        "INSTRUMENT_ID = \"MOC-NA\"".to_owned(),
        "SOFTWARE_NAME = \"areograph scene\"".to_owned(),
        format!("PRODUCT_ID = \"{}\"", image.id.replace('-', "/")),
        format!("START_TIME = {}", image.utc_start),
        format!("IMAGE_TIME = {}", image.utc_start),
        format!("STOP_TIME = {stop}"),
        format!("SPACECRAFT_CLOCK_START_COUNT = \"{}\"", image.sclk_start),
        "SPACECRAFT_CLOCK_STOP_COUNT = \"N/A\"".to_owned(),
        format!(
            "LINE_EXPOSURE_DURATION = {:.6} <MILLISECONDS>",
            image.exposure_ms
        ),
        format!("DOWNTRACK_SUMMING = {}", image.summing),
        format!("CROSSTRACK_SUMMING = {}", image.summing),
        "EDIT_MODE_ID = \"0\"".to_owned(),
        format!("RATIONALE_DESC = \"{rationale}\""),
        "DATA_QUALITY_DESC = \"OK\"".to_owned(),
        "OBJECT = IMAGE".to_owned(),
        format!("LINES = {}", image.lines_header),
        format!("LINE_SAMPLES = {}", image.samples()),
        "SAMPLE_TYPE = UNSIGNED_INTEGER".to_owned(),
        "SAMPLE_BITS = 8".to_owned(),
        "END_OBJECT = IMAGE".to_owned(),
        "END".to_owned(),
    ];
    Ok(lines.join("\r\n") + "\r\n")
}

/// What `README.txt` says below its first line.
pub(super) const README: &str = "\
kernels/     text kernels; orbit (three rival versions), attitude, Mars and Sun as binary kernels;
             nav.tm, gsfc.tm, ipng.tm load them with one version of the orbit each
pedr/        MOLA PEDR files: two whole days, four single revolutions; version K is in IAU 1991, L in IAU 2000
labels/      labels of six images
ties/        places that both images of a site show, as measured in them; some are blunders
sites/       configurations for `areograph run`
truth.json   what really happened: biases, orientation of the images, footprints in the sites' windows,
             how far the rival orbits are off (the orbit `gsfc` is the true one), and for the tie points when and
             from where the images were truly taken

Image ids, times, line counts and line periods are those of Shan et al. 2005, Table 2. Terrain, orbits and
attitudes are invented. Emission angles of E02-01301 and E02-01453 are invented too; the paper does not tell them.
";

/// What `README.txt` says of a flight along given kernels.
pub(super) const README_ALONG: &str = "\
pedr/        a MOLA PEDR file, version L (IAU 2000), of shots flown along given kernels over invented terrain
sites/       a configuration for `areograph run`
truth.json   biases and true footprints
";
