//! The statistics by which the ranges of a profile are judged, common to all range checks.

use nalgebra::Vector3;

use areograph_base::minus::signed;
use areograph_config::RangeCheckConfig;
use areograph_geom::statistics::largest;

/// The judged statistics of the ranges of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeFigures {
    /// Shots.
    pub n: u32,
    /// Outliers among them.
    pub outliers: u32,
    /// Mean of range − distance with and without outliers, metres.
    pub mean_m: [f64; 2],
    /// Mean of range − distance to the spacecraft position in the file, with and without outliers, metres.
    pub decoding_m: [f64; 2],
    /// Mean of the file's own minus the kernels' spacecraft position, radial, along and across the track, metres.
    pub spacecraft_m: [f64; 3],
}

impl RangeFigures {
    /// Mean distance between the spacecraft positions of the file and of the kernels, metres.
    #[must_use]
    pub fn orbits_apart_m(&self) -> f64 {
        Vector3::from(self.spacecraft_m).norm()
    }

    fn outlier_share(&self) -> f64 {
        f64::from(self.outliers) / f64::from(self.n.max(1))
    }

    /// The largest of the figures as a share of its limit: above 1, or NaN, a limit is broken.
    ///
    /// The number of shots does not count.
    #[must_use]
    pub fn share_of_limits(&self, limits: &RangeCheckConfig) -> f64 {
        let shares = [
            self.mean_m[1].abs() / limits.mean_max_m,
            self.decoding_m[1].abs() / limits.decoding_max_m,
            self.orbits_apart_m() / limits.orbit_max_m,
            self.outlier_share() / limits.outlier_share_max,
        ];
        largest(shares).unwrap_or(f64::NAN)
    }

    /// Every broken limit, in words; `explain` gives the likely cause of an orbit difference. Too few shots are not
    /// compared with the other limits.
    #[must_use]
    pub fn broken_limits(
        &self,
        limits: &RangeCheckConfig,
        explain: impl FnOnce() -> String,
    ) -> Vec<String> {
        let n = self.n;
        if n < limits.shots_min {
            return Vec::new();
        }
        let mut broken = Vec::new();
        for (name, [with_outliers_m, mean_m], limit_m) in [
            ("range − distance", self.mean_m, limits.mean_max_m),
            (
                "range − distance to the spacecraft position in the file",
                self.decoding_m,
                limits.decoding_max_m,
            ),
        ] {
            // Written so that NaN breaks a limit.
            if !(mean_m.abs() <= limit_m) {
                let with = match self.outliers {
                    0 => String::new(),
                    outliers => {
                        format!(" without {outliers} outliers, {with_outliers_m:.3} m with them")
                    }
                };
                broken.push(format!(
                    "mean of {name} {mean_m:.3} m{with}; limit ±{limit_m} m"
                ));
            }
        }
        if !(self.outlier_share() <= limits.outlier_share_max) {
            broken.push(format!(
                "{} outliers of {n} shots; limit {:.1} %",
                self.outliers,
                100.0 * limits.outlier_share_max
            ));
        }
        broken.extend(self.orbits_apart(limits.orbit_max_m, explain));
        broken
    }

    /// States that the two orbits differ too much, with the likely cause by `explain`; `None` within the limit.
    fn orbits_apart(&self, limit_m: f64, explain: impl FnOnce() -> String) -> Option<String> {
        let apart_m = self.orbits_apart_m();
        let [radial, along, cross] = self.spacecraft_m;
        // Written so that NaN breaks the limit.
        (!(apart_m <= limit_m)).then(|| {
            format!(
                "the spacecraft position stated with the shots differs by {apart_m:.0} m from the position in the \
                 kernels ({} m up, {} m along the flight, {} m across it); limit {limit_m} m: {}",
                signed(radial, 0),
                signed(along, 0),
                signed(cross, 0),
                explain()
            )
        })
    }
}
