//! Plan of a campaign: its places, and the images of each in one of five mission phases.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::super::{
    error::SceneError,
    kernels::clock_reading,
    orbit::Orbit,
    plan::{Look, PlannedImage, Site},
    random::Random,
    sun::mars_from_sun_m,
};
use areograph_base::{
    body::MARS_IAU2000,
    error::Result,
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY, SECONDS_PER_MS, wrap_pi},
};
use areograph_geom::{body_rotation::body_matrix, ellipsoid::Spherical};
use areograph_spice::Session;

/// A month of the mission, by the first part of the identifiers of its images.
#[derive(Debug)]
pub(super) struct Phase {
    /// First part of the identifiers.
    pub(super) id: &'static str,
    /// Mission phase in labels and in the index.
    pub(super) mission_phase: &'static str,
    /// Its first day.
    first_day: &'static str,
}

/// The phases in order of time. M01/00115 was taken on 1999-05-06, M19/00850 on 2000-09-13, E02-00665 on 2001-03-08: a phase is
/// a month.
pub(super) static PHASES: [Phase; 5] = [
    Phase {
        id: "M01",
        mission_phase: "MAPPING",
        first_day: "1999-05-01T00:00:00",
    },
    Phase {
        id: "M10",
        mission_phase: "MAPPING",
        first_day: "1999-12-01T00:00:00",
    },
    Phase {
        id: "M20",
        mission_phase: "MAPPING",
        first_day: "2000-10-01T00:00:00",
    },
    Phase {
        id: "E02",
        mission_phase: "EXTENDED",
        first_day: "2001-03-01T00:00:00",
    },
    Phase {
        id: "E10",
        mission_phase: "EXTENDED",
        first_day: "2001-11-01T00:00:00",
    },
];

/// Days of a phase in which images begin.
const PHASE_DAYS: f64 = 29.0;
/// The first orbit of the mapping mission begins here.
const FIRST_ORBIT: &str = "1999-03-09T00:00:00";
/// Numbers of images in a day of a phase: identifiers grow with time.
const NUMBERS_PER_DAY: f64 = 100.0;
/// Largest latitude of a place, and its largest distance from the latitude of the Sun, degrees: at 14 h the Sun is then at least
/// 15 degrees above the horizon.
const LATITUDE_MAX_DEG: f64 = 70.0;
const FROM_SUN_MAX_DEG: f64 = 65.0;
/// Least distance of two places, degrees: their rough ground reaches 60 km.
const PLACES_APART_DEG: f64 = 3.0;
/// Draws of a place or a time before the plan is given up; a few are needed.
const DRAWS_MAX: u32 = 10_000;
/// Local solar time of images, and its largest departure, hours.
const LOCAL_TIME_H: f64 = 14.0;
const LOCAL_TIME_OFF_H: f64 = 0.3;
/// Mean solar day of Mars, seconds.
const SOL_S: f64 = 88_775.244;
/// Emission angles of images off nadir, degrees.
const ROLL_DEG: [f64; 2] = [6.0, 25.0];
/// Shortest and longest image, metres on the ground.
const LENGTH_M: [f64; 2] = [18_000.0, 34_000.0];
/// Speed of the ground track, metres per second.
const TRACK_M_S: f64 = 3_050.0;
/// Exposures of a detector line, milliseconds, as in Shan et al. 2005, Table 2.
const EXPOSURES_MS: [f64; 3] = [0.4821, 0.6026, 0.7231];
/// Lines of an image are a multiple of this.
const BLOCK_LINES: u32 = 128;
/// Share of PEDR files of version K, in IAU 1991.
const OLDER_SHARE: f64 = 0.25;
/// Noise of the tie points of a pair, pixels.
const TIE_NOISE_PX: [f64; 2] = [0.2, 1.0];

/// A place with one or two images.
#[derive(Debug)]
pub(super) struct Place {
    /// Identifier of its site: its images in order of time, lower case.
    pub(super) id: String,
    name: String,
    longitude_deg: f64,
    latitude_deg: f64,
    /// Index of its phase.
    pub(super) phase: usize,
    /// Stated noise of the tie points, pixels; a single image has none.
    pub(super) tie_noise_px: Option<f64>,
}

/// An image before its orbit is solved.
#[derive(Debug)]
pub(super) struct Exposure {
    /// Index of its place.
    pub(super) place: usize,
    id: String,
    utc_start: String,
    sclk_start: String,
    exposure_ms: f64,
    summing: u32,
    lines: u32,
    look: Look,
    /// Number of its orbit in the mapping mission.
    pub(super) orbit: u32,
    pedr_version: char,
    start: Et,
}

/// Places, and images in order of time.
#[derive(Debug)]
pub(super) struct CampaignPlan {
    pub(super) places: Vec<Place>,
    pub(super) exposures: Vec<Exposure>,
}

impl Place {
    /// The site of its images.
    pub(super) fn site(&self) -> Site<'_> {
        Site {
            id: &self.id,
            name: &self.name,
            latitude_deg: self.latitude_deg,
            longitude_deg: self.longitude_deg,
        }
    }
}

impl Exposure {
    /// The image, with the site of its place.
    pub(super) fn image<'a>(&'a self, site: &'a Site<'a>) -> PlannedImage<'a> {
        PlannedImage {
            id: &self.id,
            site,
            utc_start: &self.utc_start,
            sclk_start: &self.sclk_start,
            exposure_ms: self.exposure_ms,
            summing: self.summing,
            lines_header: self.lines,
            lines_delivered: self.lines,
            time_bias_lines: 0.0,
            look: self.look,
            pedr_number: 10_000 + self.orbit,
            pedr_version: self.pedr_version,
            whole_day: false,
        }
    }
}

impl CampaignPlan {
    /// Draws `pairs` places with two images and `singles` with one, in turn from the five phases.
    ///
    /// # Errors
    /// [`SceneError::Crowded`]; errors of the clock kernels in `session`.
    pub(super) fn draw(pairs: usize, singles: usize, seed: u64, session: &Session) -> Result<Self> {
        let starts = PHASES
            .iter()
            .map(|phase| session.utc_to_et(phase.first_day))
            .collect::<Result<Vec<Et>>>()?;
        let mut random = Random::new(seed, "campaign");
        let mut places = draw_places(pairs, &starts, &mut random, "pair")?;
        let mut others = draw_places(singles, &starts, &mut random, "single")?;
        places.append(&mut others);
        move_apart(&mut places, &mut random)?;
        for place in &mut places[..pairs] {
            let [least_px, most_px] = TIE_NOISE_PX;
            let noise_px = random.between_log(least_px, most_px);
            place.tie_noise_px = Some((1e3 * noise_px).round() / 1e3);
        }
        let mut taken: Vec<Et> = Vec::new();
        let mut exposures = Vec::new();
        for (index, place) in places.iter().enumerate() {
            let of_pair = place.tie_noise_px.is_some();
            let mut times = Vec::new();
            for _ in 0..if of_pair { 2 } else { 1 } {
                let time = draw_time(starts[place.phase], place, &taken, &mut random)?;
                taken.push(time);
                times.push(time);
            }
            times.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
            let shapes = Shape::draw(times.len(), &mut random);
            exposures.extend(times.into_iter().zip(shapes).map(|(time, shape)| {
                let older = random.between(0.0, 1.0) < OLDER_SHARE;
                shape.exposure(index, time, if older { 'K' } else { 'L' })
            }));
        }
        exposures.sort_by(|a, b| a.start.seconds().total_cmp(&b.start.seconds()));
        name(&mut places, &mut exposures, &starts, session)?;
        Ok(Self { places, exposures })
    }
}

/// What a time does not decide about an image.
struct Shape {
    look: Look,
    summing: u32,
    exposure_ms: f64,
    lines: u32,
}

impl Shape {
    /// The images of a place in order of time: off nadir are images of ground that an earlier one showed, and some single ones.
    fn draw(count: usize, random: &mut Random) -> Vec<Self> {
        let summing = pick(random, &[2, 2, 3, 4]);
        let length_m = random.between(LENGTH_M[0], LENGTH_M[1]);
        let rolls = count > 1 || random.between(0.0, 1.0) < 0.4;
        let shapes = (0..count).map(|number| {
            let is_last = number + 1 == count;
            let differs = number > 0 && random.between(0.0, 1.0) < 0.3;
            let summing = if differs && summing < 4 {
                summing + 1
            } else {
                summing
            };
            let exposure_ms = pick(random, &EXPOSURES_MS);
            let look = if is_last && rolls {
                Look::Roll {
                    emission_deg: random.between(ROLL_DEG[0], ROLL_DEG[1]),
                    east: random.between(0.0, 1.0) < 0.5,
                }
            } else {
                Look::Nadir
            };
            let line_m = exposure_ms * SECONDS_PER_MS * f64::from(summing) * TRACK_M_S;
            Self {
                look,
                summing,
                exposure_ms,
                lines: blocks(length_m / line_m) * BLOCK_LINES,
            }
        });
        shapes.collect()
    }

    fn exposure(self, place: usize, start: Et, pedr_version: char) -> Exposure {
        Exposure {
            place,
            id: String::new(),
            utc_start: String::new(),
            sclk_start: String::new(),
            exposure_ms: self.exposure_ms,
            summing: self.summing,
            lines: self.lines,
            look: self.look,
            orbit: 0,
            pedr_version,
            start,
        }
    }
}

/// Blocks of lines in a number of lines.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an image has some thousand lines"
)]
fn blocks(lines: f64) -> u32 {
    (lines / f64::from(BLOCK_LINES)).round() as u32
}

fn pick<T: Copy>(random: &mut Random, among: &[T]) -> T {
    let index = random.bits() % among.len() as u64;
    among[usize::try_from(index).unwrap_or(0)]
}

/// Direction to the Sun, IAU 2000.
pub(super) fn towards_sun(et: Et) -> Vector3<f64> {
    (body_matrix(&MARS_IAU2000, et) * -mars_from_sun_m(et)).normalize()
}

/// Places of one kind, in turn from the phases; the latitudes of those of a phase are spread evenly over the sunlit ones.
fn draw_places(count: usize, starts: &[Et], random: &mut Random, kind: &str) -> Result<Vec<Place>> {
    let phases = starts.len();
    let places = (0..count).map(|number| {
        let phase = number % phases;
        let of_phase = (count - phase).div_ceil(phases);
        let middle = starts[phase].plus(0.5 * PHASE_DAYS * SECONDS_PER_DAY);
        let sun_deg = Spherical::from_xyz_m(&towards_sun(middle)).latitude.0 / RADIANS_PER_DEGREE;
        let south_deg = (sun_deg - FROM_SUN_MAX_DEG).max(-LATITUDE_MAX_DEG);
        let north_deg = (sun_deg + FROM_SUN_MAX_DEG).min(LATITUDE_MAX_DEG);
        let share = ((number / phases) as f64 + random.between(0.0, 1.0)) / of_phase as f64;
        Ok(Place {
            id: String::new(),
            name: format!("{kind} {:03}", number + 1),
            longitude_deg: hundredths(random.between(0.0, 360.0)),
            latitude_deg: hundredths(south_deg + share * (north_deg - south_deg)),
            phase,
            tie_noise_px: None,
        })
    });
    places.collect()
}

fn hundredths(angle_deg: f64) -> f64 {
    (angle_deg * 100.0).round() / 100.0
}

/// Draws new longitudes for places too near to those before them.
fn move_apart(places: &mut [Place], random: &mut Random) -> Result<()> {
    let limit = (PLACES_APART_DEG * RADIANS_PER_DEGREE).cos();
    for index in 1..places.len() {
        let mut draws = 0;
        loop {
            let (before, place) = places.split_at_mut(index);
            let place = &mut place[0];
            let own = place.site().direction();
            let is_near = |other: &Place| other.site().direction().dot(&own) > limit;
            if !before.iter().any(is_near) {
                break;
            }
            draws += 1;
            if draws > DRAWS_MAX {
                return Err(SceneError::Crowded { what: "places" }.into());
            }
            place.longitude_deg = hundredths(random.between(0.0, 360.0));
        }
    }
    Ok(())
}

/// An instant of the phase at which a place has its local solar time, a revolution or more from all `taken` ones: an image has
/// its orbit to itself.
fn draw_time(start: Et, place: &Place, taken: &[Et], random: &mut Random) -> Result<Et> {
    let longitude_rad = place.longitude_deg * RADIANS_PER_DEGREE;
    for _ in 0..DRAWS_MAX {
        let mut et = start.plus(random.between(0.5, PHASE_DAYS - 0.5) * SECONDS_PER_DAY);
        let hour = LOCAL_TIME_H + random.between(-LOCAL_TIME_OFF_H, LOCAL_TIME_OFF_H);
        // The second step corrects the change of the length of solar days.
        for _ in 0..2 {
            let sun_rad = Spherical::from_xyz_m(&towards_sun(et)).longitude_rad;
            let late_rad = wrap_pi(longitude_rad - sun_rad - (hour - 12.0) / 24.0 * TAU);
            et = et.plus(-late_rad / TAU * SOL_S);
        }
        if taken
            .iter()
            .all(|other| other.since(et).abs() > Orbit::period_s())
        {
            return Ok(et);
        }
    }
    Err(SceneError::Crowded { what: "times" }.into())
}

/// Names images and places, and enters clock readings and numbers of orbits; images are in order of time.
fn name(
    places: &mut [Place],
    exposures: &mut [Exposure],
    starts: &[Et],
    session: &Session,
) -> Result<()> {
    let first_orbit = session.utc_to_et(FIRST_ORBIT)?;
    let mut last = [0; PHASES.len()];
    for image in exposures {
        let place = &mut places[image.place];
        let days = image.start.since(starts[place.phase]) / SECONDS_PER_DAY;
        let number = whole(days * NUMBERS_PER_DAY).max(last[place.phase] + 1);
        last[place.phase] = number;
        image.id = format!("{}-{number:05}", PHASES[place.phase].id);
        let separator = if place.id.is_empty() { "" } else { "_" };
        place.id = format!("{}{separator}{}", place.id, image.id.to_lowercase());
        let clock = session.et_to_sclk(image.start)?;
        image.sclk_start = clock_reading(&clock);
        // The first line begins at a reading of the clock.
        image.start = session.sclk_to_et(&image.sclk_start)?;
        image.utc_start = session.et_to_utc_with(image.start, 2)?;
        image.orbit = 1 + whole(image.start.since(first_orbit) / Orbit::period_s());
    }
    Ok(())
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of images and orbits are positive and have five digits"
)]
fn whole(value: f64) -> u32 {
    value.floor() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_strings_are_those_of_labels() {
        assert_eq!(clock_reading("1/0668523205.082"), "668523205:82");
        assert_eq!(clock_reading("1/0668523205:000"), "668523205:0");
    }
}
