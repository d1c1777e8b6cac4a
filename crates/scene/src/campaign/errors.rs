//! Errors of a campaign: those of a realistic mission, and one offset of the attitude's clock for each phase.

use serde::Serialize;

use super::{
    super::{
        arc::Arc,
        drawn::DayErrors,
        error_sources::{Misregistration, Roughness, SceneErrors},
        random::Random,
    },
    plan::PHASES,
};

/// Standard deviation of the line times of an image before its size is drawn, lines: less than in a realistic mission, where it
/// is the cause of the misregistration.
const LINE_TIMES_LINES: f64 = 9.0;
/// Smallest and largest offset of the attitude's clock in a phase, seconds. A bus that points at nadir turns by 0.3 km on the
/// ground in a second: 46 to 140 m, below the 225 to 271 m of Shan et al. 2005, Table 5.
const CLOCK_S: [f64; 2] = [0.15, 0.45];

/// Sizes of the errors of a campaign, and the offsets of its phases.
#[derive(Debug, Clone, Serialize)]
pub(super) struct CampaignErrors {
    /// Standard deviations and ranges of the errors of single images.
    pub(super) sizes: SceneErrors,
    /// Range of the size of an offset; both signs are equally likely.
    clock_range_s: [f64; 2],
    /// Offset of each phase.
    #[serde(skip)]
    pub(super) clock_s: [f64; PHASES.len()],
}

impl CampaignErrors {
    /// Draws sizes and offsets.
    pub(super) fn draw(seed: u64) -> Self {
        // Attitude errors beside an offset of the clock are small.
        let realistic = SceneErrors::realistic(Roughness::Varied).with_attitude_clock(None);
        let sizes = SceneErrors {
            misregistration: Misregistration::LineTimes {
                sigma_lines: LINE_TIMES_LINES,
            },
            ..realistic
        };
        let clock_s = PHASES.each_ref().map(|phase| {
            let mut random = Random::new(seed, &format!("attitude clock {}", phase.id));
            let [least_s, most_s] = CLOCK_S;
            let size_s = random.between_log(least_s, most_s);
            if random.between(0.0, 1.0) < 0.5 {
                -size_s
            } else {
                size_s
            }
        });
        Self {
            sizes: sizes.with_drawn_sizes(seed),
            clock_range_s: CLOCK_S,
            clock_s,
        }
    }

    /// Errors of the day of an image of a phase.
    pub(super) fn of_day(&self, arc: &Arc<'_>, phase: usize, seed: u64) -> DayErrors {
        DayErrors {
            attitude_clock_s: self.clock_s[phase],
            ..DayErrors::draw(&self.sizes, arc, seed)
        }
    }
}
