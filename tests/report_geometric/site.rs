//! A site of the synthetic mission as its run stored it, for pages of it and of what it might have been.

use std::{collections::BTreeMap, fs, path::Path};

use areograph::{
    config::{SiteConfig, load},
    products::{GeometricProducts, ImageProducts, SiteProducts},
    report,
    spice::{KernelSet, Wanted},
    stages::{
        adjust::Adjusted, check_ranges::RangeCheck, compare_pairs::PairComparison,
        convert_datum::Converted, fit_sensor_model::SensorModel, group_profiles::Profile,
        intersect::IntersectedTies, read_ties::Ties, register::ImageRegistration,
        sample_orientation::Orientation, tag_times::ImageTimes,
    },
};
use serde::de::DeserializeOwned;

use super::common::mission::{areograph, mission, succeed};

/// Outputs of the stages, and the page that was published.
pub(crate) struct Site {
    pub(crate) published: String,
    config: SiteConfig,
    kernels: KernelSet,
    pub(crate) times: Vec<ImageTimes>,
    converted: Converted,
    pub(crate) profiles: Vec<Profile>,
    pub(crate) ranges: RangeCheck,
    orientations: Vec<Orientation>,
    models: Vec<SensorModel>,
    pub(crate) registrations: Vec<ImageRegistration>,
    pub(crate) ties: Ties,
    pub(crate) intersected: IntersectedTies,
    pub(crate) pairs: Vec<PairComparison>,
    pub(crate) adjusted: Adjusted,
    pub(crate) adjusted_images: Vec<(Orientation, SensorModel, ImageRegistration)>,
    pub(crate) adjusted_intersected: IntersectedTies,
    pub(crate) adjusted_pairs: Vec<PairComparison>,
}

/// The stored output of a stage: parts, hash, payload.
fn stored<T: DeserializeOwned>(folder: &Path, stage: &str) -> T {
    let bytes = fs::read(folder.join(".cache").join(stage)).unwrap();
    let (_, _, payload): (BTreeMap<String, String>, String, Vec<u8>) =
        postcard::from_bytes(&bytes).unwrap();
    postcard::from_bytes(&payload).unwrap()
}

/// The same for every image.
fn each<T: DeserializeOwned>(folder: &Path, times: &[ImageTimes], stage: &str) -> Vec<T> {
    let of = |times: &ImageTimes| stored(folder, &format!("{stage}+{}", times.id));
    times.iter().map(of).collect()
}

impl Site {
    /// Gusev crater, run just now.
    pub(crate) fn gusev() -> Self {
        let out = tempfile::tempdir().unwrap();
        let site = mission().join("sites/gusev_crater.toml");
        let mut run = areograph();
        run.args(["--quiet", "run"]).arg(&site);
        succeed(run.arg("--out").arg(out.path()));
        let folder = out.path().join("gusev_crater");
        let times: Vec<ImageTimes> = stored(&folder, "tag_times");
        let (intersected, pairs) = stored(&folder, "intersect");
        let (adjusted_images, (adjusted_intersected, adjusted_pairs)) =
            stored(&folder, "apply_adjustment");
        Self {
            published: fs::read_to_string(folder.join("report/index.html")).unwrap(),
            config: load(&site).unwrap().site,
            kernels: KernelSet::from_metakernel(&mission().join("kernels/nav.tm")).unwrap(),
            converted: stored(&folder, "convert_datum"),
            profiles: stored(&folder, "group_profiles"),
            ranges: stored(&folder, "check_ranges"),
            orientations: each(&folder, &times, "sample_orientation"),
            models: each(&folder, &times, "fit_sensor_model"),
            registrations: each(&folder, &times, "register"),
            ties: stored(&folder, "read_ties"),
            adjusted: stored(&folder, "adjust"),
            times,
            intersected,
            pairs,
            adjusted_images,
            adjusted_intersected,
            adjusted_pairs,
        }
    }

    /// Calls `with` on the site as products want it, without kernels.
    pub(crate) fn with<T>(&self, with: impl FnOnce(&SiteProducts) -> T) -> T {
        let images: Vec<ImageProducts> = (0..self.times.len())
            .map(|index| ImageProducts {
                times: &self.times[index],
                orientation: &self.orientations[index],
                model: &self.models[index],
                registration: &self.registrations[index],
            })
            .collect();
        let adjusted = self.times.iter().zip(&self.adjusted_images);
        let adjusted_images: Vec<ImageProducts> = adjusted
            .map(
                |(times, (orientation, model, registration))| ImageProducts {
                    times,
                    orientation,
                    model,
                    registration,
                },
            )
            .collect();
        with(&SiteProducts {
            config: &self.config,
            kernels: &[],
            metakernel: "KPL/MK\n",
            wanted: &Wanted::default(),
            images: &images,
            conversions: &self.converted.files,
            footprints: &self.converted.footprints,
            utc: &vec![String::new(); self.converted.footprints.len()],
            profiles: &self.profiles,
            ranges: &self.ranges,
            rejected: &BTreeMap::new(),
            complaints: &[],
            notes: &[],
            warnings: &[],
            geometric: Some(GeometricProducts {
                kernels: &self.kernels,
                folder: Path::new(""),
                ties: &self.ties,
                intersected: &self.intersected,
                pairs: &self.pairs,
                adjusted: &self.adjusted,
                adjusted_images: &adjusted_images,
                adjusted_intersected: &self.adjusted_intersected,
                adjusted_pairs: &self.adjusted_pairs,
            }),
        })
    }

    /// Its report.
    pub(crate) fn page(&self) -> String {
        self.with(report::page).unwrap()
    }
}
