//! Further image pairs of the sites, a quarter of a year apart: the planned ones again, in earlier months.

use super::{
    kernels::clock_reading,
    orbit::Orbit,
    plan::{IMAGES, Look, PlannedImage},
};
use areograph_base::{error::Result, time::Et};
use areograph_spice::Session;

/// Time between two pairs of a site, seconds: 89 mean solar days of Mars, so that the local solar time is that of the planned
/// images, and identifiers of images (a phase is a month) go back by three months.
const APART_S: f64 = 89.0 * 88_775.244;
/// Phases of a pair and of the one before it.
const PHASES_APART: u32 = 3;
/// Phases with identifiers M01 to M23; E01 is the next.
const MAPPING_PHASES: u32 = 23;

/// An image of a further pair, with its identifier and clock reading. It looks at its site like a planned image, or from the other
/// side.
#[derive(Debug)]
pub(super) struct FurtherImage {
    planned: &'static PlannedImage<'static>,
    id: String,
    utc_start: String,
    sclk_start: String,
    /// Pairs between this image and the planned one, and 1.
    number: u32,
}

impl FurtherImage {
    /// The images that give every site `pairs` pairs, with the planned one.
    ///
    /// # Errors
    /// Errors of the clock kernels in `session`.
    pub(super) fn all(pairs: u32, session: &Session) -> Result<Vec<Self>> {
        let numbers = 1..pairs;
        let images = numbers.flat_map(|number| IMAGES.iter().map(move |image| (number, image)));
        images
            .map(|(number, image)| Self::new(image, number, session))
            .collect()
    }

    fn new(
        planned: &'static PlannedImage<'static>,
        number: u32,
        session: &Session,
    ) -> Result<Self> {
        let start = session.sclk_to_et(planned.sclk_start)?;
        let clock = session.et_to_sclk(start.plus(-APART_S * f64::from(number)))?;
        let sclk_start = clock_reading(&clock);
        // The first line begins at a reading of the clock.
        let start: Et = session.sclk_to_et(&sclk_start)?;
        Ok(Self {
            planned,
            id: earlier_id(planned.id, PHASES_APART * number),
            utc_start: session.et_to_utc_with(start, 2)?,
            sclk_start,
            number,
        })
    }

    /// The image; its lines were exposed later or earlier than the label states by as much as those of the planned one.
    pub(super) fn image(&self) -> PlannedImage<'_> {
        let planned = self.planned;
        let is_mirrored = self.number % 2 == 1;
        PlannedImage {
            id: &self.id,
            utc_start: &self.utc_start,
            sclk_start: &self.sclk_start,
            time_bias_lines: if is_mirrored {
                -planned.time_bias_lines
            } else {
                planned.time_bias_lines
            },
            look: match planned.look {
                Look::Roll { emission_deg, east } => Look::Roll {
                    emission_deg,
                    east: east ^ is_mirrored,
                },
                Look::Nadir => Look::Nadir,
            },
            pedr_number: planned.pedr_number - orbits(APART_S * f64::from(self.number)),
            whole_day: false,
            ..*planned
        }
    }
}

/// Orbits in a time.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "some thousands"
)]
fn orbits(time_s: f64) -> u32 {
    (time_s / Orbit::period_s()).round() as u32
}

/// The identifier of an image of an extended phase, some phases earlier.
fn earlier_id(id: &str, phases: u32) -> String {
    let (phase, number) = id.split_once('-').unwrap_or((id, "00000"));
    let phase: u32 = phase.trim_start_matches('E').parse().unwrap_or(0);
    let phase = (MAPPING_PHASES + phase).saturating_sub(phases);
    if phase > MAPPING_PHASES {
        format!("E{:02}-{number}", phase - MAPPING_PHASES)
    } else {
        format!("M{phase:02}-{number}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_those_of_earlier_months() {
        assert_eq!(earlier_id("E02-00665", 3), "M22-00665"); // December 2000
        assert_eq!(earlier_id("E02-00665", 6), "M19-00665"); // September 2000, as M19/00850
        assert_eq!(earlier_id("E04-01275", 3), "E01-01275"); // February 2001
    }
}
