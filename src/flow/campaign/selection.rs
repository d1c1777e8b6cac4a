//! The rules of a campaign applied to its indexes.

use std::{
    collections::{BTreeMap, BTreeSet},
    f64::consts::{FRAC_PI_2, TAU},
    path::{Path, PathBuf},
};

use super::files::{ImageFiles, files_by_product};
use crate::{
    config::{CampaignConfig, CampaignImage, SelectionConfig, SiteTemplate, load_campaign, real},
    error::Result,
    geom::window::{Region, WindowShape},
    pds::{
        image_index::{IndexedImage, read_index},
        product_named,
    },
    stages::select_images::{
        Found, Pair, PairLimits, best_pairs, camera_of, cameras_of, identifier, merge,
        select_images,
    },
    units::{RADIANS_PER_DEGREE, SECONDS_PER_MS},
};

/// A campaign with its sites.
#[derive(Debug)]
pub struct Campaign {
    /// The rules.
    pub config: CampaignConfig,
    /// What the sites have in common.
    pub(super) template: SiteTemplate,
    /// Selected images, in the order of their products.
    pub images: Vec<Found>,
    /// Images at Mars of a known camera that the rules exclude.
    pub excluded: usize,
    /// Sites in the order of their identifiers.
    pub sites: Vec<PlannedSite>,
    /// Sites that cannot be formed, for want of a file.
    pub left_out: Vec<LeftOut>,
    /// Sentences on the indexes and the campaign file.
    pub remarks: Vec<String>,
}

/// A site of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedSite {
    /// Identifier: those of its images in order of time, in lower case.
    pub id: String,
    /// For the site file.
    pub(super) description: String,
    /// Positions of its images in [`Campaign::images`], in order of time.
    pub images: Vec<usize>,
    pub(super) entries: Vec<CampaignImage>,
    pub(super) ties: Option<PathBuf>,
}

/// A site that cannot be formed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Its identifier.
    pub site: String,
    /// The file that is missing, in words.
    pub lack: String,
    /// Positions of its images in [`Campaign::images`].
    pub(super) images: Vec<usize>,
}

/// Reads a campaign file and its indexes, and forms the sites.
///
/// # Errors
/// A campaign file with faults, indexes and folders that cannot be read.
pub fn select_campaign(path: &Path) -> Result<Campaign> {
    let (loaded, template) = load_campaign(path)?;
    let mut remarks = loaded.warnings;
    let config = loaded.config;
    let windows = config.windows.iter();
    let mut regions: Vec<(String, Region)> = windows
        .map(|window| (window.id.clone(), Region::new(&window.shape)))
        .collect();
    if regions.is_empty() {
        regions.push(("everywhere".to_owned(), everywhere()));
    }
    let (mut images, mut excluded) = (Vec::new(), BTreeSet::new());
    for index in &config.archive.indexes {
        let selection = select_images(
            read_index(index)?,
            |image| wants(&config.select, image),
            &regions,
        );
        excluded.extend(selection.excluded);
        images.extend(selection.found);
        let of_index = selection.remarks.into_iter();
        remarks.extend(of_index.map(|remark| format!("{}: {remark}", index.display())));
    }
    merge(&mut images);
    let files = match &config.archive.folder {
        Some(folder) => {
            let (files, repeated) = files_by_product(&real(folder)?)?;
            remarks.extend(repeated);
            Some(files)
        }
        None => None,
    };
    let mut campaign = Campaign {
        sites: Vec::new(),
        left_out: Vec::new(),
        config,
        template,
        images,
        excluded: excluded.len(),
        remarks,
    };
    let (mut sites, mut left_out) = (Vec::new(), Vec::new());
    for (members, description) in campaign.groups() {
        match campaign.site(members, description, files.as_ref()) {
            Ok(site) => sites.push(site),
            Err(lack) => left_out.push(lack),
        }
    }
    sites.sort_by(|a, b| a.id.cmp(&b.id));
    left_out.sort_by(|a, b| a.site.cmp(&b.site));
    campaign.sites = sites;
    campaign.left_out = left_out;
    Ok(campaign)
}

fn everywhere() -> Region {
    Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: TAU,
        south_rad: -FRAC_PI_2,
        north_rad: FRAC_PI_2,
    })
}

/// Whether a single image is within the limits; values missing from the index exclude no image, except phases and orbits.
fn wants(select: &SelectionConfig, image: &IndexedImage) -> bool {
    let [emission_rad, incidence_rad, _] = image.angles_rad;
    let [least_rad, most_rad] = select.incidence_rad;
    let of_phase = |phase: &String| {
        let of_index = image.orbit.as_ref().map(|(name, _)| name);
        of_index == Some(phase) || image.phase() == phase
    };
    let in_orbits = |[first, last]: [u32; 2]| {
        let orbit = image.orbit.as_ref().map(|(_, number)| *number);
        orbit.is_some_and(|orbit| (first..=last).contains(&orbit))
    };
    cameras_of(image).any(|camera| select.cameras.contains(&camera.id))
        && select
            .phases
            .as_ref()
            .is_none_or(|phases| phases.iter().any(of_phase))
        && select.orbits.is_none_or(in_orbits)
        && emission_rad.is_none_or(|angle| angle <= select.emission_max_rad)
        && incidence_rad.is_none_or(|angle| (least_rad..=most_rad).contains(&angle))
        && image
            .pixel_m
            .is_none_or(|pixel| pixel <= select.pixel_max_m)
}

impl Campaign {
    /// The images of every site, and its description.
    fn groups(&self) -> Vec<(Vec<usize>, String)> {
        let mut groups = Vec::new();
        let mut in_pairs = BTreeSet::new();
        let number: BTreeMap<&str, usize> = self
            .images
            .iter()
            .enumerate()
            .map(|(number, found)| (&*found.image.product_id, number))
            .collect();
        if self.config.has_pairs {
            let rules = &self.config.pairs;
            let limits = PairLimits {
                overlap_min: rules.overlap_min,
                convergence_rad: rules.convergence_rad,
                sun_max_rad: rules.sun_max_rad,
                pixel_ratio_max: rules.pixel_ratio_max,
            };
            for pair in best_pairs(&self.images, &limits, rules.per_image_max as usize) {
                let mut members: Vec<usize> = pair
                    .images
                    .iter()
                    .filter_map(|found| number.get(&*found.image.product_id).copied())
                    .collect();
                members.sort_by_key(|number| (self.images[*number].image.utc(), *number));
                in_pairs.extend(members.iter().copied());
                groups.push((members, description(&pair)));
            }
        }
        if !self.config.has_pairs || self.config.pairs.singles {
            let singles = (0..self.images.len()).filter(|number| !in_pairs.contains(number));
            groups.extend(singles.map(|number| (vec![number], String::new())));
        }
        groups
    }

    /// A site of these images.
    fn site(
        &self,
        images: Vec<usize>,
        description: String,
        files: Option<&BTreeMap<String, ImageFiles>>,
    ) -> std::result::Result<PlannedSite, LeftOut> {
        let found: Vec<&IndexedImage> = images.iter().map(|one| &self.images[*one].image).collect();
        let ids: Vec<String> = found.iter().map(|image| identifier(image)).collect();
        let id = ids.join("_").to_ascii_lowercase();
        let lacks = |lack: String| LeftOut {
            site: id.clone(),
            lack,
            images: images.clone(),
        };
        let mut entries = Vec::with_capacity(found.len());
        for (image, id) in found.iter().zip(ids) {
            entries.push(self.entry(image, id, files).map_err(lacks)?);
        }
        let ties = match self.template.ties_of(&id).filter(|_| images.len() > 1) {
            Some(path) if path.is_file() => Some(path),
            Some(path) if !self.config.ties.matched => {
                return Err(lacks(format!(
                    "the tie point file {} is missing",
                    path.display()
                )));
            }
            _ => None,
        };
        Ok(PlannedSite {
            id,
            description,
            images,
            entries,
            ties,
        })
    }

    /// The entry of an image in its site file, or the file that is missing.
    fn entry(
        &self,
        image: &IndexedImage,
        id: String,
        files: Option<&BTreeMap<String, ImageFiles>>,
    ) -> std::result::Result<CampaignImage, String> {
        let Some(files) = files else {
            return Ok(CampaignImage {
                id,
                label: None,
                pixels: None,
                fields: keys_of(image),
            });
        };
        let of_image = product_named(&image.product_id).and_then(|product| files.get(&product));
        let label = of_image.and_then(ImageFiles::label);
        let Some(label) = label else {
            return Err(format!(
                "archive.folder contains no file of {}",
                image.product_id
            ));
        };
        let pixels = of_image.and_then(ImageFiles::image);
        if self.config.archive.pixels && pixels.is_none() {
            return Err(format!(
                "archive.folder contains no image file of {}",
                image.product_id
            ));
        }
        Ok(CampaignImage {
            id,
            label: Some(label.clone()),
            pixels: pixels.filter(|_| self.config.archive.pixels).cloned(),
            fields: toml::Table::new(),
        })
    }
}

/// The quantities of a pair in words.
fn description(pair: &Pair<'_>) -> String {
    let ids = pair.images.map(|found| &*found.image.product_id);
    let degrees = |angle: Option<f64>| {
        angle.map_or_else(
            || "unknown".to_owned(),
            |angle| format!("{:.1}°", angle / RADIANS_PER_DEGREE),
        )
    };
    format!(
        "Pair {}: overlap {:.0} %, convergence {}, Sun {} apart, by the index",
        ids.join(" and "),
        100.0 * pair.overlap,
        degrees(pair.convergence_rad),
        degrees(pair.sun_rad),
    )
}

/// The keys of a site file that replace the label of an image, by the index.
fn keys_of(image: &IndexedImage) -> toml::Table {
    let mut keys = toml::Table::new();
    let mut put = |key: &str, value: Option<toml::Value>| {
        if let Some(value) = value {
            keys.insert(key.to_owned(), value);
        }
    };
    let text = |text: &String| toml::Value::from(text.as_str());
    let whole = |number: u32| toml::Value::from(i64::from(number));
    let [across, along] = image.summing;
    put(
        "instrument",
        camera_of(image).map(|camera| text(&camera.id)),
    );
    match &image.sclk_start {
        Some(clock) => put("sclk_start", Some(text(clock))),
        None => put("utc_start", Some(text(&image.utc_start))),
    }
    put(
        "exposure_ms",
        image
            .exposure_s
            .map(|exposure_s| toml::Value::from(exposure_s / SECONDS_PER_MS)),
    );
    put("downtrack_summing", along.map(whole));
    put("crosstrack_summing", across.map(whole));
    put("lines_header", Some(whole(image.size[1])));
    put("samples", Some(whole(image.size[0])));
    put("first_detector", image.first_detector.map(whole));
    keys
}
