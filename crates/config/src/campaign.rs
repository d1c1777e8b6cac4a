//! The configuration of a campaign: `areograph campaign` selects images of an index by rule and processes them as sites.

mod site_files;

use std::{collections::BTreeMap, path::PathBuf};

use serde::Serialize;
use serde_json::json;

use areograph_base::{altimetry::MolaClock, instruments::Altimeter, units::RADIANS_PER_DEGREE};

pub use site_files::{CampaignImage, SITE_FILE_MARK, SiteTemplate, load_campaign};

use super::{
    adjustment::AdjustmentConfig,
    cameras::CamerasConfig,
    declare::{Declare as _, Keys, Many, declare_table, key, of_the_file, table, tables},
    document::{Document, with_file},
    forms::{
        Matching, Switch, above_to, any_text, from_to, list, list_or_none, lower_case_identifier,
        matching, several, text, whole_from_to, words,
    },
    instruments::{ALTIMETER, built_in_instruments, usual_altimeter, usual_instrument},
    kernels::KernelsConfig,
    laser_surface::MolaSurfaceConfig,
    limits::LimitsConfig,
    orientation::{OrientationConfig, RegistrationConfig},
    paths::{FOLDER, Globs},
    pedr::PedrConfig,
    pointing::PointingConfig,
    products::ProductsConfig,
    range_check::RangeCheckConfig,
    shots::{SHOTS, ShotTableConfig},
    surface::SurfaceConfig,
    ties::{IntersectionConfig, TiesConfig},
    window_list::require_outlines,
    windows::WindowConfig,
};

/// Places of a campaign.
const PLACES: Many = Many {
    count: Some((1, 1_000)),
    ..Many::ANY
};
/// Part of a path that stands for the identifier of a site.
const SITE: &str = "{site}";
/// More than the mission has orbits.
const ORBITS_MAX: u32 = 1_000_000;

declare_table! {
    /// Everything that `areograph campaign` needs to know: how images are selected, and all that the sites have in common.
    pub struct CampaignConfig {
        /// Identifier of the campaign.
        campaign: String = key(lower_case_identifier()).required().example(r#""eos_2001""#),
        /// Free text for the page.
        description: String = key(any_text()).or(String::new())
            .example(r#""Stereo pairs of Eos Chasma, narrow angle""#),
        /// Altimeter, as in a site file.
        altimeter: Altimeter = key(ALTIMETER).or(usual_altimeter().clone()),
        /// The file it was read from.
        file: PathBuf = of_the_file(),
        /// BLAKE3, hexadecimal, of the keys and values as written.
        blake3: String = of_the_file(),
        /// The same keys and values one by one.
        keys: BTreeMap<String, String> = of_the_file(),
        /// Whether pairs are formed: whether the table `pairs` is written.
        has_pairs: bool = of_the_file(),
        /// The archive: index and files of the images.
        archive: CampaignArchiveConfig = table(),
        /// Places of the campaign: images that may show ground in one of these windows. Without a window, images anywhere
        /// are selected.
        windows: Vec<WindowConfig> = tables(PLACES),
        /// Limits on single images.
        select: SelectionConfig = table(),
        /// Pairs of images. Without this table, every image is a site.
        pairs: CampaignPairsConfig = table(),
        /// Where the sites run.
        executor: ExecutorConfig = table(),
        /// Kernels, as in a site file; this table and those that follow apply to every site.
        kernels: KernelsConfig = table(),
        /// Pointing (CK) bias, as in a site file.
        pointing: PointingConfig = table(),
        /// Clock bias of the altimeter, as in a site file.
        altimeter_clock: MolaClock = table(),
        /// PEDR files and filters, as in a site file. Each site searches all of them; an index of the archive
        /// (`areograph pedr index`) makes this search short.
        pedr: PedrConfig = table(),
        /// Tables of laser shots in place of PEDR files, as in a site file.
        shots: Vec<ShotTableConfig> = tables(SHOTS),
        /// Calibration of the cameras, as in a site file.
        calibration: CamerasConfig = table(),
        /// Limits of the range check, as in a site file.
        range_check: RangeCheckConfig = table(),
        /// Sampling of exterior orientation, as in a site file.
        orientation: OrientationConfig = table(),
        /// Projection of footprints into the images, as in a site file.
        registration: RegistrationConfig = table(),
        /// Tie points of all sites of several images, as in a site file; see also `pairs.ties`.
        ties: TiesConfig = table(),
        /// Intersection of tie points, as in a site file.
        intersection: IntersectionConfig = table(),
        /// The ground between laser shots, as in a site file.
        laser_surface: MolaSurfaceConfig = table(),
        /// Combined adjustment, as in a site file.
        adjustment: AdjustmentConfig = table(),
        /// Terrain model from a pair of images, as in a site file.
        surface: SurfaceConfig = table(),
        /// Limits of products, as in a site file.
        limits: LimitsConfig = table(),
        /// Products on request, as in a site file.
        products: ProductsConfig = table(),
    }
    settle pairs_on_request
    check across_tables
}

declare_table! {
    /// The archive: index and files of the images.
    pub struct CampaignArchiveConfig {
        /// Paths or globs of indexes (cumindex.tab, imgindex.tab) with their labels (.lbl) beside them. An image in several
        /// indexes is one image.
        #[serde(skip)]
        indexes: Vec<PathBuf> = key(Globs(&["tab"]))
            .required_as("paths or globs of indexes of the archive")
            .example(r#"["../index/cumindex.tab"]"#),
        /// Folder with the labels or files of the images, found by product in it and its subfolders: `e0202855.imq`,
        /// `E02-02855.lbl`. A detached label precedes the label in an image file. Sites of images without a file are left
        /// out and reported. Without this key, the index replaces the labels.
        #[serde(skip)]
        folder: Option<PathBuf> = key(FOLDER).example(r#""../labels""#),
        /// Whether sites use the pixels of the image files (.imq, .img, .cub) in this folder: for overlays, `ties.match`
        /// and `surface`.
        pixels: bool = key(Switch).or(false),
        /// Margin of the window around each image in which shots are searched.
        margin_km: f64 = key(from_to(0.0, 1_000.0)).or(5.0),
    }
}

declare_table! {
    /// Limits on single images. An image whose value is not in the index is kept, except by `phases` and `orbits`.
    pub struct SelectionConfig {
        /// Mission phases: the first three characters of the product (`E02` of `E02/02855`), or the name of the phase in
        /// the index. By default, all.
        phases: Option<Vec<String>> = key(list(text())).unused(r#"["E01", "E02"]"#),
        /// First and last orbit number, as the index counts orbits in each phase.
        orbits: Option<[u32; 2]> = key(several(whole_from_to(0, ORBITS_MAX), "two whole numbers [first, last]"))
            .unused("[1, 1200]"),
        /// Cameras, as in `images.instrument` of a site file. By default, the narrow-angle camera.
        cameras: Vec<String> = key(list(camera()).each_once("each camera once"))
            .or(vec![usual_instrument().id.clone()]),
        /// Largest emission angle at the centre.
        emission_max_rad as "emission_max_deg": f64 =
            key(from_to(0.0, 180.0)).or(180.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Smallest and largest incidence angle at the centre: the light.
        incidence_rad as "incidence_deg": [f64; 2] =
            key(several(from_to(0.0, 180.0), "two numbers [least, most]")).or([0.0, 180.0])
                .map(|angles| angles.map(|degrees| degrees * RADIANS_PER_DEGREE)),
        /// Largest width of a pixel on the ground.
        pixel_max_m: f64 = key(above_to(0.0, 1e7)).or(1e7),
    }
    check least_first
}

declare_table! {
    /// Pairs of images with common ground, of different orbits; best first as in `areograph image search`. A pair for which the
    /// index does not determine a quantity of this table is not formed.
    pub struct CampaignPairsConfig {
        /// Smallest share of the smaller outline that both images show, by the corners of the index.
        overlap_min: f64 = key(from_to(0.0, 1.0)).or(0.2),
        /// Smallest and largest angle between the rays to the spacecraft.
        convergence_rad as "convergence_deg": [f64; 2] =
            key(several(from_to(0.0, 180.0), "two numbers [least, most]")).or([5.0, 60.0])
                .map(|angles| angles.map(|degrees| degrees * RADIANS_PER_DEGREE)),
        /// Largest angle between the directions to the Sun.
        sun_max_rad as "sun_max_deg": f64 =
            key(from_to(0.0, 180.0)).or(60.0).map(|degrees| degrees * RADIANS_PER_DEGREE),
        /// Largest ratio of the pixel sizes.
        pixel_ratio_max: f64 = key(from_to(1.0, 1e6)).or(3.0),
        /// Largest number of pairs in which an image takes part; the best pairs are kept.
        per_image_max: u32 = key(whole_from_to(1, 64)).or(1),
        /// Whether an image in no pair is a site of its own.
        singles: bool = key(Switch).or(true),
        /// Tie point file of a pair, with `{site}` in place of the identifier of its site: `e02-00665_e02-01453`, the
        /// images in order of time. A pair without this file is left out and reported, unless `ties.match` is true.
        ties: Option<String> = key(matching(
            "a path with {site} in the name of the file",
            "\\{site\\}[^/]*$",
            |path| path.rsplit('/').next().is_some_and(|name| name.contains(SITE)),
        )).unused(r#""../ties/{site}.csv""#),
    }
    check least_first_of_pairs
}

declare_table! {
    /// Where the sites run: on this machine, or as tasks of a Slurm cluster whose nodes share the folders of inputs and
    /// products.
    pub struct ExecutorConfig {
        /// Kind of executor.
        kind: ExecutorKind = key(words([
            ("local", ExecutorKind::Local, "on this machine, as many sites at a time as --jobs states"),
            ("slurm", ExecutorKind::Slurm, "as array tasks, submitted with sbatch"),
        ])).or(ExecutorKind::Local),
        /// Number of sites of a task. Slurm starts 2 to 3 tasks per second.
        sites_per_task: u32 = key(whole_from_to(1, 10_000)).or(20),
        /// Largest number of tasks that run at the same time. By default, the cluster decides.
        tasks_max: Option<u32> = key(whole_from_to(1, 100_000)).unused("64"),
        /// Memory of a task; doubled whenever a task ends without a result.
        memory_mb: u32 = key(whole_from_to(100, 10_000_000)).or(2_000),
        /// Time limit of a task. By default, ten times the time that processed sites of the campaign took, at least 10
        /// minutes; 60 minutes before any site has been processed.
        minutes: Option<u32> = key(whole_from_to(1, 100_000)).unused("30"),
        /// Further options of sbatch.
        options: Vec<String> = key(list_or_none(text())).or(Vec::new()).unused(r#"["--partition=planetary"]"#),
    }
}

/// Kind of executor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ExecutorKind {
    /// Threads of the command.
    Local,
    /// Array tasks of Slurm.
    Slurm,
}

impl Document for CampaignConfig {
    const EXAMPLE: &'static str = "config/campaigns/example.toml";
    const HEADER: &'static str = "\
# Campaign for `areograph campaign`: every key with its unit, range and default.
#
# Only `campaign`, [archive] and one kernel source are required; an omitted key has the default given here.
# Every image or pair that the rules select becomes a site. [kernels], [pedr] and the tables after them apply to every
# site, with the keys of site files.
# Relative paths are relative to the folder of this file. Schema: ../schema/campaign.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Campaign for areograph",
        "The TOML file of one campaign as JSON. areograph checks more than a schema can: the existence of files and the \
         agreement between keys.",
    ];

    with_file!();
}

/// A camera that the index can name.
fn camera() -> Matching {
    let ids: Vec<&str> = built_in_instruments()
        .iter()
        .map(|camera| &*camera.id)
        .collect();
    matching(&ids.join(", "), "^[a-z0-9_]+$", |id| {
        built_in_instruments().iter().any(|camera| camera.id == id)
    })
}

fn pairs_on_request(mut campaign: CampaignConfig, keys: &Keys<'_, '_>) -> CampaignConfig {
    campaign.has_pairs = keys.span_of("pairs").is_some();
    campaign
}

/// Required tables, and tables that exclude each other.
fn across_tables(campaign: &CampaignConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(
        || json!({"required": ["archive", "kernels"], "not": {"required": ["pedr", "shots"]}}),
    );
    if keys.span_of("archive").is_none() {
        keys.missing("archive", "a table archive with indexes");
    }
    if keys.span_of("kernels").is_none() {
        keys.missing("kernels", "a table kernels with a source of kernels");
    }
    if !campaign.pedr.files.is_empty() && !campaign.shots.is_empty() {
        let expected = "no tables of shots, because pedr names PEDR files";
        keys.refuse("shots", expected);
    }
    if require_outlines(&campaign.windows).is_err() {
        keys.refuse(
            "windows",
            "boxes or polygons, because no image is known yet",
        );
    }
    let [pixels, folder] = [campaign.archive.pixels, campaign.archive.folder.is_some()];
    if pixels && !folder {
        let expected = "false, or archive.folder with the image files";
        keys.refuse_below("archive", "pixels", expected);
    }
    if campaign.ties.matched && !pixels {
        let expected = "false, or archive.pixels = true: tie points are matched in pixels";
        keys.refuse_below("ties", "match", expected);
    }
}

fn least_first(select: &SelectionConfig, keys: &mut Keys<'_, '_>) {
    let [least, most] = select.incidence_rad;
    if least > most {
        keys.refuse("incidence_deg", "the smaller angle first");
    }
    if select.orbits.is_some_and(|[first, last]| first > last) {
        keys.refuse("orbits", "the first orbit before the last one");
    }
}

fn least_first_of_pairs(pairs: &CampaignPairsConfig, keys: &mut Keys<'_, '_>) {
    let [least, most] = pairs.convergence_rad;
    if least > most {
        keys.refuse("convergence_deg", "the smaller angle first");
    }
}
