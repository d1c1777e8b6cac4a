//! Laser control in the terrain model of the lines of a camera.

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::{
    HeldBackGround, LaserMatch, MatchLaser, MatchOptions, ModelRequest, Survey, UnitShots,
    match_model,
};
use crate::{
    calibrate::CONTROLS_MIN,
    camera_lines::{CameraLines, LinesRound},
    convert_datum::ConvertDatum,
    map_surface::Surface,
};
use areograph_base::error::{Cause, Result};
use areograph_config::CalibrationLaserConfig;
use areograph_store::{
    files::HashedFile,
    stage::{Called, InOrder, Input, Inputs, Output, Stage, called},
    stage_inputs,
};

stage_inputs! {
    /// The terrain model of two lines, and laser passes.
    pub struct MatchModel<'a> {
        /// The round.
        pub round: LinesRound,
        /// The lines with which the model was made.
        pub lines: CameraLines<'a>,
        /// The two lines of the model.
        pub survey: &'a Output<Survey>,
        /// The model.
        pub surface: &'a Output<Surface>,
        /// How shots are selected and matched.
        pub laser: LaserKeys<'a>,
        /// Every *n*-th rectangle of ground is withheld.
        pub held_back_every: &'a u32,
        /// PEDR files.
        pub pedr: InOrder<'a, HashedFile>,
        /// The match of an earlier round whose units this round uses, so that rounds can be compared.
        pub earlier: Option<&'a Output<ModelMatch>>,
    }
}

/// The keys of the laser, except those of terrain model and rounds.
#[derive(Debug, Clone, Copy)]
pub struct LaserKeys<'a>(pub &'a CalibrationLaserConfig);

impl Input for LaserKeys<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        let laser = self.0;
        inputs.setting("laser.search_cells", &laser.search_cells);
        inputs.setting("laser.segment_points", &laser.segment_points);
        if let Some(drift) = laser.segment_drift_m_per_km {
            inputs.setting("laser.segment_drift_m_per_km", &drift);
        }
        inputs.setting("laser.least_variance_m2", &laser.least_variance_m2);
        inputs.setting("laser.least_score", &laser.least_score);
        inputs.setting("laser.limit_m", &laser.limit_m);
        inputs.setting("laser.seed", &laser.seed);
        inputs.setting("laser.crossover", &laser.crossover);
        inputs.setting("laser.filter", &laser.filter);
    }
}

/// Laser control, and the shots of each unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelMatch {
    /// The match; measurements only in the two lines of the model.
    pub found: LaserMatch,
    /// The shots of each unit.
    units: UnitShots,
}

/// Too little laser control was found.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "{used} of {} units of laser shots and {judging} of {} withheld units match the terrain model of the images; \
     expected at least {CONTROLS_MIN} of each. {commonest}", of[0], of[1]
)]
#[cause(Input: "check that cameras.pixels are not exchanged and that laser.files contain passes over this ground, \
    which must have relief; give more passes, or a larger laser.search_cells if errors of orbit and mounting are \
    larger")]
struct FewUnits {
    used: usize,
    judging: usize,
    of: [usize; 2],
    commonest: String,
}

impl Stage for MatchModel<'_> {
    const NAME: &'static str = "match_laser";
    const METHOD: u32 = 4;
    const CALLS: &'static [Called] = &[called::<MatchLaser<'_>>(), called::<ConvertDatum<'_>>()];
    type Output = ModelMatch;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<ModelMatch> {
        let LaserKeys(laser) = self.laser;
        let seed = u64::from(laser.seed);
        let options = MatchOptions {
            segment_points: laser.segment_points as usize,
            segment_drift: laser.segment_drift_m_per_km.map(|drift| drift / 1_000.0),
            least_variance_m2: laser.least_variance_m2,
            similarity: None,
            search_cells: laser.search_cells,
            least_score: laser.least_score,
            least_contrast: 1.0,
            limit_m: laser.limit_m,
            seed,
            ground: laser.crossover,
            filter: laser.filter.clone(),
        };
        let paths: Vec<_> = self.pedr.0.iter().map(|file| file.path.clone()).collect();
        let request = ModelRequest {
            model: &self.surface.value()?.model.heights,
            pedr: &paths,
            images: &self.lines.cameras()?,
            options: &options,
            held_back: HeldBackGround {
                every: *self.held_back_every,
                seed,
            },
        };
        let earlier = self.earlier.map(Output::value).transpose()?;
        let (mut found, units) = match_model(&request, earlier.map(|of| &of.units), stop)?;
        // Measurements of the other lines are removed: these lines are not part of the model.
        let pair = self.survey.value()?.pair;
        for point in &mut found.points {
            for (camera, seen) in point.in_images.iter_mut().enumerate() {
                *seen = seen.filter(|_| pair.contains(&camera));
            }
        }
        match few_units(&found) {
            Some(few) => Err(few.into()),
            None => Ok(ModelMatch { found, units }),
        }
    }
}

/// The lack of units, used or withheld; `None` if they suffice.
fn few_units(control: &LaserMatch) -> Option<FewUnits> {
    let units = |judges: bool| {
        let units = control.units.iter();
        units.filter(move |unit| unit.judges == judges).count()
    };
    let points = |judges: bool| {
        let points = control.points.iter();
        points.filter(|point| point.judges == judges).count()
    };
    // Reasons differ in their numbers.
    let kind = |reason: &str| reason.replace(|c: char| c.is_ascii_digit(), "");
    let mut reasons: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for unit in control.units.iter().filter(|unit| !unit.is_kept()) {
        let reason = &*unit.refused_because;
        reasons.entry(kind(reason)).or_default().push(reason);
    }
    let commonest = reasons.into_values().max_by_key(Vec::len);
    let few = FewUnits {
        used: points(false),
        judging: points(true),
        of: [false, true].map(units),
        commonest: commonest.map_or_else(String::new, |units| {
            format!(
                "Most frequent reason (units: {}): {}",
                units.len(),
                units[0]
            )
        }),
    };
    (few.used.min(few.judging) < CONTROLS_MIN).then_some(few)
}
