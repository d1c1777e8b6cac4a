//! A site of the synthetic mission as its run stored it, for pages of it and of what it might have been.

use std::{collections::BTreeMap, fs, path::Path};

use areograph::{
    capabilities::page,
    config::{Document as _, SiteConfig},
    products::{AdjustmentProducts, GeometricProducts, ImageProducts, Program, SiteProducts},
    spice::{KernelSet, RequiredCoverage},
    stages::{
        adjust::Adjusted,
        check_heights::HeightCheck,
        check_profiles::ProfileCheck,
        check_ranges::RangeCheck,
        compare_pairs::PairComparison,
        convert_datum::Converted,
        fit_sensor_model::SensorModel,
        group_profiles::Profile,
        intersect::IntersectedTies,
        judge::{AdjustmentEvidence, BeamEvidence, Evidence, JudgedImage, Verdict, judge},
        read_ties::Ties,
        register::ImageRegistration,
        sample_orientation::Orientation,
        tag_times::ImageTimes,
    },
    store::book::Book,
    utc::Utc,
};
use serde::de::DeserializeOwned;

use super::common::mission::{mission, site_run};

/// Outputs of the stages, and the page that was published.
pub(crate) struct Site {
    pub(crate) published: String,
    pub(crate) manifest: serde_json::Value,
    pub(crate) config: SiteConfig,
    kernels: KernelSet,
    pub(crate) times: Vec<ImageTimes>,
    converted: Converted,
    pub(crate) profiles: Vec<Profile>,
    profile_check: ProfileCheck,
    pub(crate) ranges: RangeCheck,
    orientations: Vec<Orientation>,
    models: Vec<SensorModel>,
    pub(crate) registrations: Vec<ImageRegistration>,
    pub(crate) ties: Ties,
    pub(crate) intersected: IntersectedTies,
    pub(crate) pairs: Vec<PairComparison>,
    pub(crate) heights: HeightCheck,
    pub(crate) adjusted: Adjusted,
    pub(crate) adjusted_heights: HeightCheck,
    pub(crate) adjusted_images: Vec<(Orientation, SensorModel, ImageRegistration)>,
    pub(crate) adjusted_intersected: IntersectedTies,
    pub(crate) adjusted_pairs: Vec<PairComparison>,
}

/// The stored output of a stage: inputs, hash, payload.
fn stored<T: DeserializeOwned>(folder: &Path, stage: &str) -> T {
    let bytes = fs::read(folder.join(".cache").join(stage)).unwrap();
    let (_, _, payload): (BTreeMap<String, String>, String, Vec<u8>) =
        postcard::from_bytes(&bytes).unwrap();
    postcard::from_bytes(&payload).unwrap()
}

/// The same for every image.
fn each<T: DeserializeOwned>(folder: &Path, ids: &[&str], stage: &str, round: &str) -> Vec<T> {
    let of = |id: &&str| stored(folder, &format!("{stage}+{id}{round}"));
    ids.iter().map(of).collect()
}

impl Site {
    /// Gusev crater.
    pub(crate) fn gusev() -> Self {
        let folder = site_run("gusev_crater");
        let config = SiteConfig::load(&mission().join("sites/gusev_crater.toml"))
            .unwrap()
            .config;
        let ids: Vec<&str> = config.images.iter().map(|image| &*image.id).collect();
        let orientations: Vec<Orientation> = each(&folder, &ids, "reorient", "");
        let models: Vec<SensorModel> = each(&folder, &ids, "fit_sensor_model", "+adjusted");
        let registrations: Vec<ImageRegistration> = each(&folder, &ids, "register", "+adjusted");
        let adjusted_images = orientations.into_iter().zip(models).zip(registrations);
        let adjusted_images = adjusted_images
            .map(|((orientation, model), registration)| (orientation, model, registration));
        Self {
            published: fs::read_to_string(folder.join("report/index.html")).unwrap(),
            manifest: serde_json::from_slice(&fs::read(folder.join("manifest.json")).unwrap())
                .unwrap(),
            kernels: KernelSet::from_metakernel(&mission().join("kernels/nav.tm")).unwrap(),
            converted: stored(&folder, "convert_datum"),
            profiles: stored(&folder, "group_profiles"),
            profile_check: stored(&folder, "check_profiles"),
            ranges: stored(&folder, "check_ranges"),
            orientations: each(&folder, &ids, "sample_orientation", ""),
            models: each(&folder, &ids, "fit_sensor_model", ""),
            registrations: each(&folder, &ids, "register", ""),
            ties: stored(&folder, "read_ties"),
            heights: stored(&folder, "check_heights"),
            adjusted: stored(&folder, "adjust"),
            adjusted_heights: stored(&folder, "check_heights+adjusted"),
            times: each(&folder, &ids, "tag_times", ""),
            intersected: stored(&folder, "intersect"),
            pairs: stored(&folder, "compare_pairs"),
            adjusted_images: adjusted_images.collect(),
            adjusted_intersected: stored(&folder, "intersect+adjusted"),
            adjusted_pairs: stored(&folder, "compare_pairs+adjusted"),
            config,
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
        let verdict = self.verdict();
        with(&SiteProducts {
            config: &self.config,
            kernels: &[],
            metakernel: "KPL/MK\n",
            required: &RequiredCoverage::default(),
            images: &images,
            conversions: &self.converted.files,
            footprints: &self.converted.footprints,
            utc: &vec![Utc::from_microseconds(0); self.converted.footprints.len()].into(),
            profiles: &self.profiles,
            profile_check: &self.profile_check,
            ranges: &self.ranges,
            rejected: &BTreeMap::new(),
            complaints: &[],
            notes: &[],
            verdict: &verdict,
            overlays: None,
            book: &Book::default(),
            listed: &[],
            program: &Program::default(),
            geometric: Some(GeometricProducts {
                ties: &self.ties,
                intersected: &self.intersected,
                pairs: &self.pairs,
                heights: &self.heights,
                adjustment: Some(AdjustmentProducts {
                    kernels: &self.kernels,
                    folder: Path::new(""),
                    adjusted: &self.adjusted,
                    heights: &self.adjusted_heights,
                    images: &adjusted_images,
                    tables: &[],
                    intersected: &self.adjusted_intersected,
                    pairs: &self.adjusted_pairs,
                    images_agree: self.images_agree(),
                }),
            }),
        })
    }

    /// Calls `with` on what the site is judged by.
    fn judged<T>(&self, with: impl FnOnce(&Evidence, &AdjustmentEvidence) -> T) -> T {
        fn judged<'a>(
            times: &'a ImageTimes,
            orientation: &'a Orientation,
            model: &'a SensorModel,
        ) -> JudgedImage<'a> {
            JudgedImage {
                times,
                orientation,
                model,
            }
        }
        let oriented = self.orientations.iter().zip(&self.models);
        let images = self.times.iter().zip(oriented);
        let images: Vec<_> = images
            .map(|(times, (orientation, model))| judged(times, orientation, model))
            .collect();
        let adjusted = self.times.iter().zip(&self.adjusted_images);
        let adjusted: Vec<_> = adjusted
            .map(|(times, (orientation, model, _))| judged(times, orientation, model))
            .collect();
        let adjustment = AdjustmentEvidence {
            ties: &self.ties,
            adjusted: &self.adjusted,
            images: &adjusted,
            pairs: &self.pairs,
            adjusted_pairs: &self.adjusted_pairs,
            heights: &self.heights,
            adjusted_heights: &self.adjusted_heights,
        };
        let evidence = Evidence {
            terms: self.config.terms(),
            footprints: Some(self.converted.footprints.len()),
            ground: None,
            limits: &self.config.limits,
            rejected: &BTreeMap::new(),
            range_limits: &self.config.range_check,
            orientation_limits: &self.config.orientation,
            ranges: &self.ranges,
            clock_correction_s: self.config.altimeter_clock.correction_s(),
            images: &images,
            beam: BeamEvidence {
                images: &[],
                adjustment: &self.config.adjustment,
                surface: &self.config.laser_surface,
            },
            warnings: &[],
            complaints: &[],
            profiles: &self.profile_check,
            adjustment: Some(adjustment),
            findings: &[],
            adjustment_failure: None,
        };
        with(&evidence, &adjustment)
    }

    pub(crate) fn verdict(&self) -> Verdict {
        self.judged(|evidence, _| judge(evidence))
    }

    fn images_agree(&self) -> bool {
        self.judged(|_, adjustment| adjustment.images_agree(&self.config.limits))
    }

    /// Its report.
    pub(crate) fn page(&self) -> String {
        self.with(page).unwrap()
    }
}
