//! The configuration of one site: its tables, and what must hold between them.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use serde::Deserialize;
use serde_json::json;

use areograph_base::{
    altimetry::MolaClock,
    body::Body,
    instruments::{Altimeter, Instrument},
    kernel_source::KernelSource,
    terms::Terms,
    time::PointingBias,
};

use super::{
    adjustment::AdjustmentConfig,
    cameras::CamerasConfig,
    declare::{Keys, declare_table, key, no_repeats, of_the_file, table, tables},
    document::{Document, with_file},
    forms::{any_text, lower_case_identifier, words},
    images::{IMAGES, ImageConfig},
    instruments::{ALTIMETER, built_in_altimeters, usual_altimeter, usual_instrument},
    kernels::KernelsConfig,
    laser_surface::MolaSurfaceConfig,
    limits::LimitsConfig,
    orientation::{OrientationConfig, RegistrationConfig},
    pedr::PedrConfig,
    pointing::{PointingConfig, has_turned_sign},
    problems::SITE_EXAMPLE,
    products::ProductsConfig,
    range_check::RangeCheckConfig,
    shots::{SHOTS, ShotLayout, ShotTableConfig},
    surface::SurfaceConfig,
    ties::{IntersectionConfig, TiesConfig},
    windows::{WINDOWS, WINDOWS_MAX, WindowConfig},
};

declare_table! {
    /// Everything that `areograph run` needs to know about a site: every value checked, metres, radians and
    /// seconds inside.
    pub struct SiteConfig: Deserialize {
        /// Identifier of the site, and name of its products folder.
        site: String = key(lower_case_identifier()).required().example(r#""eos_chasma""#),
        /// Free text for the report.
        description: String = key(any_text())
            .or(String::new())
            .example(r#""Eos Chasma, one of the three study sites of Shan et al. 2005""#),
        /// Body of the site: its rotation and shape in `config/bodies` determine the frame, heights and maps of all
        /// products. At a body other than Mars, images require support data, and shots are read from tables.
        body: Body = key(words([
            ("mars", Body::Mars, "in IAU 2000"),
            ("moon", Body::Moon, "in the mean Earth/polar axis frame, radius 1737.4 km"),
        ])).or(Body::Mars),
        /// Altimeter of the PEDR files or tables of shots: `mola`, `lola`, or the path of an altimeter file as in
        /// `config/altimeters`.
        altimeter: Altimeter = key(ALTIMETER).or(usual_altimeter().clone()),
        /// The file it was read from.
        file: PathBuf = of_the_file(),
        /// BLAKE3, hexadecimal, of the keys and values as written: comments, spacing, order of keys and the
        /// place of the file do not change it.
        blake3: String = of_the_file(),
        /// The same keys and values one by one: dots between tables, elements of lists by their `id`, else
        /// their place from 1.
        keys: BTreeMap<String, String> = of_the_file(),
        /// Source of the kernels.
        kernels: KernelsConfig = table(),
        /// Pointing (CK) bias.
        pointing: PointingConfig = table(),
        /// Clock bias of the altimeter.
        altimeter_clock: MolaClock = table().was("mola_clock"),
        /// PEDR files and filters; no files when only images are oriented.
        pedr: PedrConfig = table(),
        /// Tables of laser shots, in place of PEDR files.
        shots: Vec<ShotTableConfig> = tables(SHOTS),
        /// Windows on the ground, 1 to 64, or none when there are no PEDR files; bit `i` of
        /// `Footprints::windows` is entry `i`.
        windows: Vec<WindowConfig> = tables(WINDOWS),
        /// Images, possibly none.
        images: Vec<ImageConfig> = tables(IMAGES),
        /// Calibration of the cameras.
        calibration: CamerasConfig = table(),
        /// Limits of the range check.
        range_check: RangeCheckConfig = table(),
        /// Sampling of exterior orientation.
        orientation: OrientationConfig = table(),
        /// Projection of footprints into the images.
        registration: RegistrationConfig = table(),
        /// Tie points between the images.
        ties: TiesConfig = table(),
        /// Intersection of tie points.
        intersection: IntersectionConfig = table(),
        /// The ground between laser shots.
        laser_surface: MolaSurfaceConfig = table().was("mola_surface"),
        /// Combined adjustment.
        adjustment: AdjustmentConfig = table(),
        /// Terrain model from a pair of images.
        surface: SurfaceConfig = table(),
        /// Limits on tie points, their adjustment and the terrain model.
        limits: LimitsConfig = table(),
        /// Products on request.
        products: ProductsConfig = table(),
    }
    settle clock_of_altimeter
    check across_tables
}

impl Document for SiteConfig {
    const EXAMPLE: &'static str = SITE_EXAMPLE;
    const HEADER: &'static str = "\
# Site configuration of areograph: every key with its unit, range and default.
#
# Only `site`, one kernel source, and shots ([pedr] or [[shots]], with [[windows]]), [[images]] or both are required;
# an omitted key has the default given here. Relative paths are relative to the folder of this file.
# Angles are in degrees, exposures in milliseconds, times in seconds; longitudes are east and latitudes
# areocentric, in the frame of the body: IAU 2000 for Mars. Schema: ../schema/site.schema.json

";
    const SCHEMA: [&'static str; 2] = [
        "Site configuration of areograph",
        "The TOML file of one site as JSON. areograph checks more than a schema can: the existence of files, \
         the order within windows, and the agreement between keys.",
    ];

    with_file!();
}

impl SiteConfig {
    /// The terms of its texts.
    #[must_use]
    pub fn terms(&self) -> Terms<'_> {
        Terms {
            body: self.body,
            altimeter: &self.altimeter.name,
            has_tables: !self.shots.is_empty(),
            has_areoid: self.shots.is_empty() || self.has_areoid_in_tables(),
        }
    }

    /// Whether all tables of shots have heights above the areoid.
    fn has_areoid_in_tables(&self) -> bool {
        let of_tables = |table: &ShotTableConfig| table.layout == Some(ShotLayout::OdePedr);
        self.shots.iter().all(of_tables)
    }

    /// Whether the site has laser shots, of PEDR files or of tables.
    #[must_use]
    pub fn has_shots(&self) -> bool {
        !(self.pedr.files.is_empty() && self.shots.is_empty())
    }
}

/// The clock bias is the altimeter's where the site gives no other.
fn clock_of_altimeter(mut site: SiteConfig, keys: &Keys<'_, '_>) -> SiteConfig {
    let (clock, altimeter) = (&mut site.altimeter_clock, &site.altimeter);
    if !keys.writes("altimeter_clock", "bias_s") {
        clock.bias_s = altimeter.clock_bias_s;
    }
    if !keys.writes("altimeter_clock", "source") {
        clock.source.clone_from(&altimeter.clock_source);
    }
    site
}

fn across_tables(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| json!({"required": ["kernels"]}));
    keys.rule(|| {
        json!({"anyOf": [
            {"required": ["pedr", "windows"], "not": {"required": ["shots"]}},
            {"required": ["shots", "windows"], "not": {"required": ["pedr"]}},
            {"required": ["images"], "not": {"anyOf": [{"required": ["pedr"]}, {"required": ["shots"]}]}},
        ]})
    });
    something_to_do(site, keys);
    if ["campaign", "sites"].contains(&&*site.site) {
        keys.refuse(
            "site",
            "another identifier: a campaign has a folder of this name",
        );
    }
    altimeter_of_pedr(site, keys);
    other_bodies(site, keys);
    serial_numbers(keys);
    pointing_of_instruments(site, keys);
    kernels_of_spacecraft(site, keys);
    if site.images.len() < 2 {
        keys.refuse("ties", "at least two images that tie points can join");
    }
    matched_images(site, keys);
    images_of_surface(site, keys);
    priors_of_images(site, keys);
    images_of_windows(site, keys);
}

/// Matching requires at least two images with pixels.
fn matched_images(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let with_pixels = site.images.iter().filter(|image| image.pixels.is_some());
    if site.ties.matched && site.images.len() > 1 && with_pixels.count() < 2 {
        let expected = "at least two images with images.pixels, or false";
        keys.refuse_below("ties", "match", expected);
    }
}

/// A terrain model requires at least two images with pixels, and orthoimages require one.
fn images_of_surface(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let with_pixels = site.images.iter().filter(|image| image.pixels.is_some());
    let known: Vec<&str> = with_pixels.map(|image| &*image.id).collect();
    if site.surface.cell_m.is_none() {
        if site.surface.orthoimage_cell_m.is_some() && known.is_empty() {
            let expected = "no orthoimage_cell_m, or an image with images.pixels";
            keys.refuse_below("surface", "orthoimage_cell_m", expected);
        }
        return;
    }
    match &site.surface.images {
        None if known.len() >= 2 => {}
        None => {
            let expected = "no cell_m, or at least two images with images.pixels";
            keys.refuse_below("surface", "cell_m", expected);
        }
        Some([one, other]) => {
            let is_known = |id: &String| known.contains(&&**id);
            if one == other || !is_known(one) || !is_known(other) {
                let expected = format!(
                    "two different images with images.pixels; the site has {}",
                    if known.is_empty() {
                        "none".to_owned()
                    } else {
                        known.join(", ")
                    }
                );
                keys.refuse_below("surface", "images", expected);
            }
        }
    }
}

/// Footprints need windows; a site needs footprints or images.
fn something_to_do(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let windows = keys.span_of("windows");
    if keys.span_of("shots").is_some() {
        keys.refuse("pedr", "PEDR files or tables [[shots]], not both");
    }
    if keys.span_of("pedr").is_some() || keys.span_of("shots").is_some() {
        if windows.is_none() {
            keys.missing("windows", &format!("1 to {WINDOWS_MAX} tables [[windows]]"));
        }
        return;
    }
    if let Some(windows) = windows {
        let text = "windows are never used without a table [pedr] or tables [[shots]]";
        keys.review().warn(windows, text.to_owned());
    }
    match keys.span_of("images") {
        Some(images) if !site.images.is_empty() => keys.review().warn(
            images,
            "images without a table [pedr] or tables [[shots]]: orientation only, no footprints and no range check"
                .to_owned(),
        ),
        _ => keys.missing(
            "pedr",
            "a table [pedr] (or tables [[shots]]), tables [[images]], or both: a site without either has nothing to do",
        ),
    }
}

/// PEDR files belong to MOLA; a file that describes MOLA with other numbers may be named.
fn altimeter_of_pedr(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let usual = usual_altimeter();
    let is_other = |known: &Altimeter| {
        let same = known.id == site.altimeter.id || known.name == site.altimeter.name;
        known.id != usual.id && same
    };
    if keys.span_of("pedr").is_some() && built_in_altimeters().iter().any(is_other) {
        let name = &usual.name;
        keys.refuse(
            "altimeter",
            format!("{}, because PEDR files contain its shots; shots of altimeters other than {name} require tables \
                 [[shots]]", usual.id),
        );
    }
}

/// Kernels, labels and PEDR files belong to Mars; a datum belongs to one body.
fn other_bodies(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let body = site.body;
    for table in keys.entries(&["shots"]) {
        let Some(datum) = table.get("datum") else {
            continue;
        };
        let of_body = site.shots.iter().filter_map(|table| table.datum);
        if of_body.clone().any(|datum| datum.body() != body) {
            let expected = format!("a datum of {body}, the body of the site");
            keys.review().refuse(datum.span(), "shots.datum", expected);
        }
    }
    if body == Body::Mars {
        return;
    }
    for table in keys.entries(&["shots"]) {
        let layout = table.get("layout");
        if let Some(layout) = layout.filter(|word| word.get_ref().as_str() == Some("ode_pedr")) {
            let expected =
                format!("the layout of a table of {body}: this layout is for MOLA shots at Mars");
            keys.review()
                .refuse(layout.span(), "shots.layout", expected);
        }
    }
    for table in keys.entries(&["windows"]) {
        let kind = table.get("latitude");
        if let Some(kind) = kind.filter(|word| word.get_ref().as_str() == Some("areographic")) {
            let expected =
                format!("areocentric: areographic latitudes are those of Mars, not of {body}");
            keys.review()
                .refuse(kind.span(), "windows.latitude", expected);
        }
    }
    let only_at_mars = format!("no such entry for {body}: it applies only to Mars Global Surveyor");
    for table in ["pedr", "altimeter_clock", "pointing"] {
        keys.refuse(table, &only_at_mars);
    }
    if site.images.iter().any(|image| image.isd.is_none()) {
        let text = format!(
            "images of {body} require support data (images.isd): labels and kernels are read only for spacecraft at Mars"
        );
        let span = keys.span_of("images");
        keys.review().problem(span, text);
    }
    if !site.shots.is_empty() && keys.span_of("altimeter").is_none() {
        keys.missing("altimeter", "the altimeter of the tables, such as lola");
    }
}

/// A pointing bias of the site has the sign of the known bias of its cameras, and replaces it.
fn pointing_of_instruments(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let Some(used_s) = site.pointing.ck_bias.map(PointingBias::seconds) else {
        return;
    };
    let mut told = BTreeSet::new();
    for camera in cameras(&site.images) {
        if !told.insert(&*camera.id) {
            continue;
        }
        let spacecraft = camera.spacecraft;
        if used_s.abs() > spacecraft.ck_bias_max_s {
            let expected = format!(
                "no such key, because it applies to all images of the site, and the attitude kernels of {} (camera: {}) \
                 need no time correction; state the bias of any other camera in an instrument file",
                spacecraft.full_name, camera.name
            );
            keys.refuse_below("pointing", "ck_bias_s", expected);
            continue;
        }
        let known_s = camera.pointing.ck_bias_s;
        if has_turned_sign(used_s, known_s) {
            keys.refuse_below(
                "pointing",
                "ck_bias_s",
                format!(
                    "{known_s}, the known bias of {} with its sign: the attitude of an exposure at t is read at t + \
                     ck_bias_s",
                    camera.name
                ),
            );
        }
    }
}

/// Only for one spacecraft is a folder of kernels searched, and are rival sets compared.
fn kernels_of_spacecraft(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let key = match &site.kernels.source {
        KernelSource::Listed(_) => return,
        KernelSource::Root(_) => "root",
        KernelSource::Sets(_) => "sets",
    };
    let mut cameras = cameras(&site.images).into_iter();
    if let Some(camera) = cameras.find(|camera| !camera.spacecraft.has_laser()) {
        let expected = format!(
            "kernels.files or kernels.metakernel: the program does not select kernels of {} (camera: {})",
            camera.spacecraft.full_name, camera.name
        );
        keys.refuse_below("kernels", key, expected);
    }
}

/// The cameras of images with kernels; the default one where such an image, or no image, names one.
fn cameras(images: &[ImageConfig]) -> Vec<&Instrument> {
    let named = images
        .iter()
        .filter(|image| image.support().is_none())
        .map(|image| image.instrument.as_ref().unwrap_or(usual_instrument()));
    let usual = images.is_empty().then(usual_instrument);
    named.chain(usual).collect()
}

/// Names in tie point files are unique like identifiers; an image without a name has its identifier.
fn serial_numbers(keys: &mut Keys<'_, '_>) {
    let images = keys.entries(&["images"]);
    if images
        .iter()
        .any(|image| image.contains_key("serial_number"))
    {
        let names = images
            .iter()
            .filter_map(|image| image.get("serial_number").or_else(|| image.get("id")));
        no_repeats("images.serial_number", names, keys.review());
    }
}

/// What is expected of an identifier of one of these images.
fn one_of_images(images: &[&str]) -> String {
    match images {
        [] => "an image of the site, but the site has none".to_owned(),
        _ => format!("one of the site's images: {}", images.join(", ")),
    }
}

/// Windows that are outlines of images belong to images of the site.
fn images_of_windows(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let known: BTreeSet<&str> = site.images.iter().map(|image| &*image.id).collect();
    for window in keys.entries(&["windows"]) {
        let Some(id) = window.get("image") else {
            continue;
        };
        if id.get_ref().as_str().is_some_and(|id| !known.contains(id)) {
            let images: Vec<&str> = known.iter().copied().collect();
            let expected = one_of_images(&images);
            keys.review().refuse(id.span(), "windows.image", expected);
        }
    }
}

/// Individual standard deviations belong to images of the site.
fn priors_of_images(site: &SiteConfig, keys: &mut Keys<'_, '_>) {
    let known: BTreeSet<&str> = site.images.iter().map(|image| &*image.id).collect();
    for prior in keys.entries(&["adjustment", "images"]) {
        let Some(id) = prior.get("id") else { continue };
        if id.get_ref().as_str().is_some_and(|id| !known.contains(id)) {
            let images: Vec<&str> = site.images.iter().map(|image| &*image.id).collect();
            let expected = one_of_images(&images);
            keys.review()
                .refuse(id.span(), "adjustment.images.id", expected);
        }
    }
}
