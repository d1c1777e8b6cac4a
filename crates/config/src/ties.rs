//! `[ties]` and `[intersection]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;

use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::intersection::Weighting;

use super::{
    adjustment::SIGMA,
    declare::{Declare as _, Keys, declare_table, group, key},
    forms::{Switch, above_to, words},
    paths::{Globs, TIE_ENDINGS},
};

declare_table! {
    /// Tie points between the images. Without this table, there is no intersection and no adjustment.
    pub struct TiesConfig: Deserialize {
        /// Paths, folders or globs, as in `[pedr]`, of tables (.csv) or of ISIS control networks, binary or in PVL.
        /// Tables have one row per measurement: `point_id`, `serial_number`, `sample`, `line` and, where known, the
        /// standard deviations `line_sigma_px` and `sample_sigma_px`. Fixed or constrained points of control networks
        /// provide coordinates in IAU 2000. Lines and samples are counted as in ISIS: the middle of the first pixel is
        /// 1. The column `serial_number` contains the `serial_number`, the `id` or the ISIS serial number of an image
        /// of the site; measurements in other images are counted and excluded.
        #[serde(skip)]
        files: Vec<PathBuf> = key(Globs(TIE_ENDINGS))
            .or(Vec::new())
            .example(r#"["../ties/*.csv"]"#),
        /// Whether areograph measures tie points itself, in addition to tie points in files. Every pair of images with
        /// `pixels` is matched where both images show the same ground with sufficient texture, and again with the
        /// orientation adjusted with these tie points. Each measurement has the standard deviations of its match.
        matched as "match": bool = key(Switch).or(false),
    }
    check something_measures
}

/// Without files and without matching there is no tie point.
fn something_measures(ties: &TiesConfig, keys: &mut Keys<'_, '_>) {
    keys.rule(|| {
        json!({"anyOf": [
            {"required": ["files"]},
            {"required": ["match"], "properties": {"match": {"const": true}}},
        ]})
    });
    if !ties.matched && keys.span_of("files").is_none() {
        keys.missing(
            "files",
            "paths or globs of tie point files, or match = true (or no table [ties] at all)",
        );
    }
}

impl TiesConfig {
    /// Whether the site has tie points, of files or matched.
    #[must_use]
    pub fn are_there(&self) -> bool {
        self.matched || !self.files.is_empty()
    }
}

declare_table! {
    /// Intersection of tie points, with the orientation held fixed.
    pub struct IntersectionConfig: Copy, Deserialize, JsonSchema {
        /// Weights of the measurements.
        weighting: Weighting = group::<WeightingKeys>().map(WeightingKeys::weighting),
        /// Smallest permitted convergence angle, between the two most divergent rays of a point.
        convergence_min_rad as "convergence_min_deg": f64 =
            key(above_to(0.0, 90.0)).or(0.5).map(|degrees| degrees * RADIANS_PER_DEGREE),
    }
}

declare_table! {
    /// Weights of the measurements.
    struct WeightingKeys {
        /// Unit in which measurement errors are equal in all images.
        weighting: ErrorUnit = key(words([
            ("focal", ErrorUnit::Focal, "pixels of the focal plane, along and across the track"),
            (
                "line",
                ErrorUnit::Line,
                "lines along the track and pixels across it; this changes how a disagreement is distributed among the \
                 images",
            ),
        ])).or(ErrorUnit::Focal),
        /// Standard deviation of measurements; if `weighting` is "line", only across the track.
        sigma_px: f64 = key(SIGMA).or(1.0),
        /// Standard deviation of measurements along the track if `weighting` is "line".
        sigma_lines: f64 = key(SIGMA).or(1.0).unused("1.0"),
    }
    check lines_are_used
}

/// Unit of a measurement error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
enum ErrorUnit {
    Focal,
    Line,
}

fn lines_are_used(written: &WeightingKeys, keys: &mut Keys<'_, '_>) {
    if written.weighting == ErrorUnit::Focal {
        keys.unused("sigma_lines", "intersection.weighting is not \"line\"");
    }
}

impl WeightingKeys {
    fn weighting(self) -> Weighting {
        let sigma_px = self.sigma_px;
        match self.weighting {
            ErrorUnit::Focal => Weighting::Focal { sigma_px },
            ErrorUnit::Line => Weighting::Line {
                along_lines: self.sigma_lines,
                across_px: sigma_px,
            },
        }
    }
}
