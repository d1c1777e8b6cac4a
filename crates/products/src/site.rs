//! Inputs of the products of one site.

use std::{borrow::Cow, collections::BTreeMap, path::Path};

use serde::{Deserialize, Serialize};

use super::error::ProductError;
use areograph_base::{
    column::Column,
    constants::{SPACECRAFT, Spacecraft},
    error::Result,
    footprints::Footprints,
    frames::BodyFixed,
    utc::Utc,
};
use areograph_config::{ShotFormat, SiteConfig, UsedBias};
use areograph_spice::{KernelSet, RequiredCoverage};
use areograph_stages::{
    adjust::{Adjusted, CorrectedPoint, PointKind, accuracy_withheld},
    check_heights::HeightCheck,
    check_profiles::ProfileCheck,
    check_ranges::{ProfileRanges, RangeCheck},
    compare_pairs::PairComparison,
    convert_datum::FileConversion,
    describe_kernels::KernelLine,
    fit_sensor_model::SensorModel,
    group_profiles::Profile,
    intersect::IntersectedTies,
    judge::Verdict,
    lay_overlays::Overlays,
    read_ties::Ties,
    register::ImageRegistration,
    sample_orientation::Orientation,
    tabulate_kernels::AdjustedTables,
    tag_times::{ImageTimes, used_biases},
};
use areograph_store::{
    book::{Book, Entered},
    stage::Round,
};

/// One site, borrowed from the flow.
#[derive(Debug, Clone, Copy)]
pub struct SiteProducts<'a> {
    /// The configuration.
    pub config: &'a SiteConfig,
    /// The outputs of all stages; the fields below are those that many products use.
    pub book: &'a Book,
    /// The products that the site has, for links.
    pub listed: &'a [Listed],
    /// Kernels in load order.
    pub kernels: &'a [KernelLine],
    /// Text of the metakernel that loads them again, its paths relative to the folder of the products.
    pub metakernel: &'a str,
    /// The instants at which the site needs the kernels.
    pub required: &'a RequiredCoverage,
    /// Images in the order of the configuration.
    pub images: &'a [ImageProducts<'a>],
    /// Effect of the datum conversion, in the order of the footprints' files.
    pub conversions: &'a [FileConversion],
    /// Footprints in IAU 2000.
    pub footprints: &'a Footprints<BodyFixed>,
    /// UTC of every footprint's corrected time.
    pub utc: &'a Column<Utc>,
    /// Profiles in order.
    pub profiles: &'a [Profile],
    /// The profiles against each other.
    pub profile_check: &'a ProfileCheck,
    /// The range check, one entry per profile.
    pub ranges: &'a RangeCheck,
    /// Rejected shots by reason.
    pub rejected: &'a BTreeMap<String, u64>,
    /// Errors of skipped records, one sentence each.
    pub complaints: &'a [String],
    /// Notes for the reader, one sentence each.
    pub notes: &'a [String],
    /// The verdict.
    pub verdict: &'a Verdict,
    /// Tie points and the adjustment; `None` for a site without tie points that could be intersected.
    pub geometric: Option<GeometricProducts<'a>>,
    /// Contents of images; `None` for a site without pixels.
    pub overlays: Option<&'a Overlays>,
    /// Software that computed the products.
    pub program: &'a Program,
}

/// A product that a site has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Path below the site's folder.
    pub path: String,
    /// Index of the image that it belongs to, if it is of one.
    pub image: Option<usize>,
    /// Contents of the file.
    pub what: Cow<'static, str>,
    /// Readers of it.
    pub readers: &'static str,
}

/// Software that computes products, besides this version of areograph.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Version of CSPICE as reported by it, for example `CSPICE_N0067`.
    pub cspice: String,
    /// Stages that the run passed, with the number of their method: it is raised when a stage computes different
    /// results.
    pub methods: Vec<(String, u32)>,
}

/// Results from the tie points of a site.
#[derive(Debug, Clone, Copy)]
pub struct GeometricProducts<'a> {
    /// The tie points.
    pub ties: &'a Ties,
    /// Their ground points with the orientation from the kernels.
    pub intersected: &'a IntersectedTies,
    /// Every pair of images with tie points in both, with the orientation from the kernels.
    pub pairs: &'a [PairComparison],
    /// Heights of these points above the MOLA surface.
    pub heights: &'a HeightCheck,
    /// `None` if the adjustment failed.
    pub adjustment: Option<AdjustmentProducts<'a>>,
}

/// Results of the adjustment of a site.
#[derive(Debug, Clone, Copy)]
pub struct AdjustmentProducts<'a> {
    /// The kernels that precede the adjusted ones.
    pub kernels: &'a KernelSet,
    /// Folder of the site's products, the future location of `adjusted.tm`.
    pub folder: &'a Path,
    /// The adjustment.
    pub adjusted: &'a Adjusted,
    /// Heights of the adjusted points.
    pub heights: &'a HeightCheck,
    /// The images with their adjusted orientation, in the order of the site's.
    pub images: &'a [ImageProducts<'a>],
    /// Contents of their adjusted kernels.
    pub tables: &'a [&'a AdjustedTables],
    /// Ground points of the tie points with the adjusted orientation.
    pub intersected: &'a IntersectedTies,
    /// Every pair with the adjusted orientation.
    pub pairs: &'a [PairComparison],
    /// Whether the images of every pair place their tie points together after the adjustment.
    pub images_agree: bool,
}

/// One image.
#[derive(Debug, Clone, Copy)]
pub struct ImageProducts<'a> {
    /// Line times.
    pub times: &'a ImageTimes,
    /// Orientation samples and camera tables.
    pub orientation: &'a Orientation,
    /// Polynomial models.
    pub model: &'a SensorModel,
    /// The footprints in the image.
    pub registration: &'a ImageRegistration,
}

impl AdjustmentProducts<'_> {
    /// The adjusted tie points.
    pub fn adjusted_ties(&self) -> impl Iterator<Item = &CorrectedPoint> {
        let points = self.adjusted.points.iter();
        points.filter(|point| point.kind == PointKind::Tie)
    }
}

impl<'a> ImageProducts<'a> {
    /// Reasons why the image is invalid: first its orientation, then its models; empty if it is valid.
    #[must_use]
    pub fn invalid_because(&self) -> Vec<&'a str> {
        let orientation = self.orientation.invalid_because.iter();
        let reasons = orientation.chain(&self.model.invalid_because);
        reasons.map(String::as_str).collect()
    }
}

impl<'a> SiteProducts<'a> {
    /// UTC of the latest shot as text, without shots of the first image, for formats that require a date: a clock would
    /// give different bytes each time.
    pub(super) fn newest_utc(&self) -> String {
        let newest = self.utc.iter().max().map(|utc| utc.to_string());
        let first = || Some(self.images.first()?.times.utc_start.clone());
        newest.or_else(first).unwrap_or_default()
    }

    /// The pointing biases with which kernels were read; empty if support data orient all images.
    #[must_use]
    pub fn pointing_biases(&self) -> Vec<UsedBias<'a>> {
        let cameras = self.images.iter().map(|image| image.times);
        used_biases(&self.config.pointing, cameras)
    }

    /// The tie points and their adjustment; `None` without an adjustment.
    #[must_use]
    pub fn adjustment(&self) -> Option<(GeometricProducts<'a>, AdjustmentProducts<'a>)> {
        let geometric = self.geometric?;
        Some((geometric, geometric.adjustment?))
    }

    /// Whether the footprints are written in `format`: there are some, and the site requests it.
    pub(super) fn has_footprints_in(&self, format: ShotFormat) -> bool {
        !self.footprints.is_empty() && self.config.products.formats.contains(&format)
    }

    /// An output of the orientation from the kernels, or of the site; `None` if the site does not have it.
    ///
    /// # Errors
    /// An output that cannot be read.
    pub fn find<T: Entered>(&self) -> Result<Option<&'a T>> {
        self.book.find(Round::Initial)
    }

    /// Whether the site has this output.
    #[must_use]
    pub fn has<T: Entered>(&self) -> bool {
        self.book.has::<T>(Round::Initial)
    }

    /// Reason why absolute accuracies are withheld, if they are.
    #[must_use]
    pub fn accuracy_withheld(&self) -> Option<String> {
        accuracy_withheld(self.config, self.images.iter().map(|image| image.times))
    }

    /// The spacecraft whose kernels are read: the one with the laser, unless only kernels of another are needed, and
    /// others.
    #[must_use]
    pub fn spacecraft_of_kernels(&self) -> Vec<&'static Spacecraft> {
        let required = self.required;
        let own = required.others.is_empty() || !required.positions.as_slice().is_empty();
        let others = required.others.keys();
        let others = others.filter_map(|id| Spacecraft::of_id(id));
        own.then_some(*SPACECRAFT)
            .into_iter()
            .chain(others)
            .collect()
    }

    /// The spacecraft of footprints and images: those whose kernels are read, and those that support data name; if none
    /// is named, the altimeter.
    pub(super) fn spacecraft(&self) -> String {
        let supports = || self.images.iter().map(|image| &image.times.support);
        // Tables of shots do not name theirs.
        let searched = self.config.shots.is_empty() && !self.footprints.is_empty();
        let mut names: Vec<&str> = Vec::new();
        names.extend(searched.then_some(&*SPACECRAFT.full_name));
        for image in self
            .images
            .iter()
            .filter(|image| image.times.support.is_none())
        {
            let name = &*image.times.instrument.spacecraft.full_name;
            if !names.contains(&name) {
                names.push(name);
            }
        }
        for support in supports().flatten() {
            let is_it = |name: &&str| name.eq_ignore_ascii_case(&support.platform);
            if !names.iter().any(is_it) {
                names.push(&support.platform);
            }
        }
        if names.is_empty() {
            names.push(&self.config.altimeter.full_name);
        }
        names.join(", ")
    }

    /// Lengths that must agree.
    pub(super) fn check(&self) -> Result<()> {
        // All, or of tables those that have a spacecraft besides their own.
        let shots = self
            .ranges
            .profiles
            .iter()
            .map(ProfileRanges::measured)
            .sum();
        let lengths = [
            (
                "datum decisions of PEDR files",
                self.conversions.len(),
                self.footprints.files.len(),
            ),
            ("UTC of footprints", self.utc.len(), self.footprints.len()),
            (
                "range statistics of profiles",
                self.ranges.profiles.len(),
                self.profiles.len(),
            ),
            (
                "range residuals of shots in profiles",
                self.ranges.shots.len(),
                shots,
            ),
            (
                "outlier flags of shots in profiles",
                self.ranges.shots.outlier.len(),
                shots,
            ),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(ProductError::Inconsistent {
                    what: what.to_owned(),
                    found,
                    expected,
                }
                .into());
            }
        }
        Ok(())
    }
}
