//! Everything of one site that products are made of.

use std::collections::BTreeMap;

use super::fault::ProductFault;
use crate::{
    config::SiteConfig,
    error::Result,
    footprints::Footprints,
    frames::MarsIau2000,
    stages::{
        check_ranges::RangeCheck, fit_sensor_model::SensorModel, group_profiles::Profile,
        sample_orientation::Orientation, tag_times::ImageTimes,
    },
};

/// One site, borrowed from the flow.
#[derive(Debug, Clone, Copy)]
pub struct SiteProducts<'a> {
    /// The configuration.
    pub config: &'a SiteConfig,
    /// Kernels in load order.
    pub kernels: &'a [KernelLine],
    /// Images in the order of the configuration.
    pub images: &'a [ImageProducts<'a>],
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
}

/// A kernel as reports show it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KernelLine {
    /// File name.
    pub name: String,
    /// What it holds: `LSK`, `SCLK`, `PCK`, `FK`, `IK`, `SPK`, `CK`.
    pub role: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hexadecimal.
    pub blake3: String,
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
            let orientation = &image.orientation.invalid_because;
            for reason in orientation.iter().chain(&image.model.invalid_because) {
                reasons.push(format!("image {}: {reason}", image.times.id));
            }
        }
        reasons
    }

    /// Lengths that must agree.
    pub(super) fn check(&self) -> Result<()> {
        let shots = self.profiles.iter().map(|profile| profile.rows.len()).sum();
        let lengths = [
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
