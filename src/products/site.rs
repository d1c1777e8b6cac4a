//! Everything of one site that products are made of.

use std::{collections::BTreeMap, path::Path};

use super::fault::ProductFault;
use crate::{
    config::SiteConfig,
    error::Result,
    footprints::Footprints,
    frames::MarsIau2000,
    spice::{KernelSet, Wanted},
    stages::{
        adjust::{Adjusted, PointKind},
        check_ranges::{BiasScan, RangeCheck},
        compare_pairs::PairComparison,
        convert_datum::FileConversion,
        fit_sensor_model::SensorModel,
        group_profiles::Profile,
        intersect::IntersectedTies,
        read_ties::Ties,
        register::ImageRegistration,
        sample_orientation::Orientation,
        tag_times::ImageTimes,
    },
    time::Intervals,
};

/// One site, borrowed from the flow.
#[derive(Debug, Clone, Copy)]
pub struct SiteProducts<'a> {
    /// The configuration.
    pub config: &'a SiteConfig,
    /// Kernels in load order.
    pub kernels: &'a [KernelLine],
    /// Text of the metakernel that loads them again, its paths relative to the folder of the products.
    pub metakernel: &'a str,
    /// The instants that the site asks of the kernels.
    pub wanted: &'a Wanted,
    /// Images in the order of the configuration.
    pub images: &'a [ImageProducts<'a>],
    /// What the conversion of the datum did, in the order of the footprints' files.
    pub conversions: &'a [FileConversion],
    /// Footprints in IAU 2000.
    pub footprints: &'a Footprints<MarsIau2000>,
    /// UTC of every footprint's corrected time, ISO 8601, without a zone letter.
    pub utc: &'a [String],
    /// Profiles in order.
    pub profiles: &'a [Profile],
    /// The range check, one entry per profile.
    pub ranges: &'a RangeCheck,
    /// Rejected shots by reason.
    pub rejected: &'a BTreeMap<String, u64>,
    /// What was wrong with input that was read around, one sentence each.
    pub complaints: &'a [String],
    /// What the reader should know, one sentence each.
    pub notes: &'a [String],
    /// What the reader must weigh before trusting the site, one sentence each.
    pub warnings: &'a [String],
    /// Intersection and adjustment; nothing for a site without tie points.
    pub geometric: Option<GeometricProducts<'a>>,
}

/// What tie points make of a site, before and after the adjustment.
#[derive(Debug, Clone, Copy)]
pub struct GeometricProducts<'a> {
    /// The kernels that the adjusted ones follow.
    pub kernels: &'a KernelSet,
    /// Folder of the site's products, where `adjusted.tm` will lie.
    pub folder: &'a Path,
    /// The tie points.
    pub ties: &'a Ties,
    /// Their ground points with the orientation of the kernels.
    pub intersected: &'a IntersectedTies,
    /// Every pair of images with tie points in both, likewise.
    pub pairs: &'a [PairComparison],
    /// The adjustment.
    pub adjusted: &'a Adjusted,
    /// The images with their adjusted orientation, in the order of the site's.
    pub adjusted_images: &'a [ImageProducts<'a>],
    /// Ground points of the tie points with the adjusted orientation.
    pub adjusted_intersected: &'a IntersectedTies,
    /// Every pair with the adjusted orientation.
    pub adjusted_pairs: &'a [PairComparison],
}

/// A kernel as reports show it.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelLine {
    /// File name.
    pub name: String,
    /// What it holds: `LSK`, `SCLK`, `PCK`, `FK`, `IK`, `SPK`, `CK`.
    pub role: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hexadecimal.
    pub blake3: String,
    /// When it holds MGS itself, its position in an SPK, its attitude in a CK; `None` for other kernels.
    pub held: Option<Intervals>,
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

/// More tie points than this share are not left out of a sound adjustment.
const LEFT_OUT_SHARE: f64 = 0.1;
/// An a posteriori standard deviation of unit weight above this contradicts the configured ones.
const SIGMA0_MAX: f64 = 2.0;
/// Fewer tie points than this do not outweigh the image coordinates of hundreds of footprints.
const TIES_FEW: usize = 10;
/// Images whose adjusted tie points lie farther apart than this along the flight, metres, were not brought together:
/// six lines of MOC's usual 4 m, and a thirteenth of a spacing of footprints.
const APART_MAX_M: f64 = 25.0;

fn is_together(pair: &PairComparison) -> bool {
    // Written so that NaN counts as apart.
    pair.disagreement_m <= APART_MAX_M
}

impl GeometricProducts<'_> {
    /// Why the adjusted orientation is invalid, one sentence per reason.
    fn invalid_because(&self) -> Vec<String> {
        let reasons = |image: &ImageProducts| -> Vec<String> {
            let id = &image.times.id;
            // What is wrong with the orientation of the kernels is told with it.
            let of_model = image.model.invalid_because.iter();
            of_model
                .map(|reason| format!("adjusted image {id}: {reason}"))
                .collect()
        };
        let mut invalid: Vec<String> = self.adjusted_images.iter().flat_map(reasons).collect();
        let (left_out, ties) = (self.left_out(), self.ties.joining());
        if 2 * left_out > ties {
            invalid.push(format!(
                "adjustment: {left_out} of {ties} tie points were left out; ties.parquet says why"
            ));
        }
        for pair in self.adjusted_pairs.iter().filter(|pair| !is_together(pair)) {
            invalid.push(format!(
                "adjustment: tie points of {} and {} still lie {:.1} m apart along the flight, expected at most {} m",
                pair.images[0], pair.images[1], pair.disagreement_m, APART_MAX_M
            ));
        }
        invalid
    }

    /// Tie points that took part in the adjustment.
    fn taken(&self) -> usize {
        let points = self.adjusted.points.iter();
        points.filter(|point| point.kind == PointKind::Tie).count()
    }

    /// Tie points that join images and yet took no part.
    fn left_out(&self) -> usize {
        self.ties.joining().saturating_sub(self.taken())
    }

    /// Whether the images of every pair place tie points together after the adjustment, and most of these took
    /// part in it.
    #[must_use]
    pub fn is_healed(&self) -> bool {
        2 * self.left_out() <= self.ties.joining()
            && !self.adjusted_pairs.is_empty()
            && self.adjusted_pairs.iter().all(is_together)
    }

    /// What a reader must weigh, one sentence each.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let (left_out, ties) = (self.left_out(), self.ties.joining());
        if left_out as f64 > LEFT_OUT_SHARE * ties as f64 && 2 * left_out <= ties {
            remarks.push(format!(
                "{left_out} of {ties} tie points were left out of the adjustment; ties.parquet says why"
            ));
        }
        let taken = self.taken();
        if taken < TIES_FEW {
            remarks.push(format!(
                "only {taken} tie points took part in the adjustment: image coordinates of footprints, where weighted \
                 (adjustment.footprint_image_coordinates), hold the images against so few"
            ));
        }
        let sigma0 = self.adjusted.summary.sigma0;
        if sigma0 > SIGMA0_MAX {
            remarks.push(format!(
                "the adjustment's standard deviation of unit weight is {sigma0:.2}: measurements are worse than \
                 configured, or a model does not hold"
            ));
        }
        remarks
    }
}

impl<'a> ImageProducts<'a> {
    /// Why the image is invalid: first its orientation, then its models; empty when it is valid.
    #[must_use]
    pub fn invalid_because(&self) -> Vec<&'a str> {
        let orientation = self.orientation.invalid_because.iter();
        let reasons = orientation.chain(&self.model.invalid_because);
        reasons.map(String::as_str).collect()
    }
}

impl SiteProducts<'_> {
    /// Why the site is invalid, one sentence per reason; empty when it is valid.
    #[must_use]
    pub fn invalid_because(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        if !self.config.pedr.files.is_empty() && self.footprints.is_empty() {
            reasons.push("no footprint in any window".to_owned());
        }
        for profile in &self.ranges.profiles {
            for reason in &profile.invalid_because {
                reasons.push(format!("profile {}: {reason}", profile.profile));
            }
        }
        for image in self.images {
            for reason in image.invalid_because() {
                reasons.push(format!("image {}: {reason}", image.times.id));
            }
        }
        reasons.extend(
            self.geometric
                .iter()
                .flat_map(GeometricProducts::invalid_because),
        );
        reasons
    }

    /// What a reader must weigh although no limit is broken, one sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = self.warnings.to_vec();
        match self.complaints {
            [] => {}
            [only] => remarks.push(format!("input that was read around: {only}")),
            [first, rest @ ..] => remarks.push(format!(
                "input that was read around: {first} (and {} more)",
                rest.len()
            )),
        }
        for image in self.images {
            let notes = image.orientation.notes.iter();
            remarks.extend(notes.map(|note| format!("image {}: {note}", image.times.id)));
        }
        let images = self
            .images
            .iter()
            .filter(|image| image.model.near_gimbal_lock);
        remarks.extend(images.map(|image| {
            format!(
                "image {}: |cos φ| falls to {:.3}, where ω and κ are badly determined; use the rotation-vector form",
                image.times.id, image.model.cos_phi_min
            )
        }));
        let configured_s = self.config.mola_clock.correction_s();
        for ranges in &self.ranges.profiles {
            let doubt = ranges
                .scan
                .as_ref()
                .and_then(|scan| doubt(scan, configured_s));
            remarks.extend(doubt.map(|doubt| format!("profile {}: {doubt}", ranges.profile)));
        }
        remarks.extend(self.geometric.iter().flat_map(GeometricProducts::remarks));
        remarks
    }

    /// Name of a source file; its folder belongs to the machine, not to the product.
    pub(super) fn file_name(&self, file: u16) -> String {
        let source = self.footprints.files.get(usize::from(file));
        source.map_or_else(String::new, |source| source.name.clone())
    }

    /// Identifiers of the windows in `mask`, separated by semicolons.
    pub(super) fn window_ids(&self, mask: u64) -> String {
        let held = self
            .config
            .windows
            .iter()
            .enumerate()
            .filter(|(bit, _)| mask >> bit & 1 == 1);
        let ids: Vec<&str> = held.map(|(_, window)| window.id.as_str()).collect();
        ids.join(";")
    }

    /// Lengths that must agree.
    pub(super) fn check(&self) -> Result<()> {
        let shots = self.profiles.iter().map(|profile| profile.rows.len()).sum();
        let lengths = [
            (
                "datum decisions of PEDR files",
                self.conversions.len(),
                self.footprints.files.len(),
            ),
            (
                "UTC strings of footprints",
                self.utc.len(),
                self.footprints.len(),
            ),
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
                return Err(ProductFault::Inconsistent {
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

/// Differences from the configured clock correction below this are not remarked on, seconds: rival orbits
/// differ by tens of metres along the track, which the spacecraft flies in this time.
const CLOCK_DOUBT_S: f64 = 0.02;
/// Nor are those below so many standard uncertainties.
const CLOCK_DOUBT_SIGMA: f64 = 5.0;

/// What a scan says against the configured correction.
fn doubt(scan: &BiasScan, configured_s: f64) -> Option<String> {
    let (best_s, uncertainty_s) = (scan.best_s?, scan.uncertainty_s?);
    let apart_s = (best_s - configured_s).abs();
    (apart_s > CLOCK_DOUBT_S && apart_s > CLOCK_DOUBT_SIGMA * uncertainty_s).then(|| {
        format!(
            "its ranges want a clock correction of {best_s:+.4} ± {uncertainty_s:.4} s, not the configured \
             {configured_s:+.3} s"
        )
    })
}
