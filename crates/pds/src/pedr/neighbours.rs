//! Comparison of records with their neighbours: one or two records that are not continuous with those before and after.
//!
//! A file with a permanent jump is not reported, nor one in which no record continues another: then the expectation is
//! wrong rather than the records.

use std::f64::consts::TAU;

use super::{FieldGuard, Record, RecordError, quantity::Quantity};
use areograph_base::units::{METRES_PER_CM, RADIANS_PER_DEGREE, RADIANS_PER_MICRODEGREE, wrap_pi};

/// Records on either side with which a record is compared.
pub(super) const NEIGHBOURS: usize = 8;
/// Nominal length of a frame, seconds.
const FRAME_S: f64 = 2.0;
/// Largest time over which the rates of a record predict the next one, seconds.
const NEAR_S: f64 = 10.0;
/// Largest time over which the spacecraft's motion determines the time, seconds: 30 revolutions.
const FLIGHT_S: f64 = 30.0 * PERIOD_S;
/// Period of the mapping orbit, and of a turn of Mars, seconds.
const PERIOD_S: f64 = 7_064.0;
const TURN_S: f64 = 88_642.66;
/// Tolerances of the angle flown against the mean motion: a share of it, a maximum for the ellipse, and one for every
/// revolution, degrees.
const ELLIPSE_SHARE: f64 = 0.03;
const ELLIPSE_DEG: f64 = 2.5;
const DEGREES_PER_REVOLUTION: f64 = 0.5;
/// Frames nearer to a pole than this are not compared by longitude, microdegrees.
const POLE: i32 = 89_500_000;
/// Microdegrees of half and a full turn.
const HALF_TURN: f64 = 180e6;

/// Relation between two records.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Link {
    /// Too far apart to decide.
    Unknown,
    /// The later continues the earlier.
    Holds,
    /// It does not: the quantity, the deviation, and the limit.
    Broken(Quantity, f64, f64),
}

/// Parameters of the comparison.
#[derive(Debug, Clone, Copy)]
pub(super) struct Comparison {
    pub guard: FieldGuard,
    /// Whether the spacecraft was in its mapping orbit.
    pub mapping: bool,
}

impl Comparison {
    /// The faults of successive records (with their rows) that are individually valid and in order of time.
    ///
    /// `number` returns the number of a row as in complaints.
    pub(super) fn odd(
        &self,
        records: &[(usize, &Record)],
        number: impl Fn(usize) -> u32,
    ) -> Vec<(usize, RecordError)> {
        let mut left = records.to_vec();
        let mut found = Vec::new();
        // A second pass without those found: of two deviating records that agree with each other, the first exposes the
        // second.
        for _ in 0..2 {
            let odd: Vec<Option<RecordError>> = self.look(&left, &number);
            if odd.iter().all(Option::is_none) {
                break;
            }
            let told = left.iter().zip(&odd);
            found.extend(told.filter_map(|((row, _), error)| Some((*row, (*error)?))));
            let mut odd = odd.iter();
            left.retain(|_| odd.next().is_none_or(Option::is_none));
        }
        found
    }

    fn look(
        &self,
        records: &[(usize, &Record)],
        number: &impl Fn(usize) -> u32,
    ) -> Vec<Option<RecordError>> {
        let links: [Vec<Link>; 2] = [1, 2].map(|step| {
            let later = records.iter().skip(step);
            let pairs = records.iter().zip(later);
            pairs.map(|((_, a), (_, b))| self.link(a, b)).collect()
        });
        // Up to four links of a record, each with the index of its other end.
        let around = |index: usize| {
            [1_usize, 2].into_iter().flat_map(move |step| {
                [index.checked_sub(step), Some(index)].map(|from| {
                    let from = from?;
                    let other = if from == index { index + step } else { from };
                    Some((other, step - 1, from))
                })
            })
        };
        let links_of = |index: usize| {
            around(index)
                .flatten()
                .filter_map(|(other, step, from)| Some((other, *links[step].get(from)?)))
        };
        let continues: Vec<bool> = (0..records.len())
            .map(|index| links_of(index).any(|(_, link)| link == Link::Holds))
            .collect();
        (0..records.len())
            .map(|index| {
                if let Some(odd) = odd_one(records, index) {
                    return Some(odd);
                }
                let (mut holding, mut broken, mut first) = (0, 0, None);
                for (other, link) in links_of(index) {
                    match link {
                        Link::Holds => holding += 1,
                        Link::Broken(quantity, apart, limit) if continues[other] => {
                            broken += 1;
                            first = first.or(Some((other, quantity, apart, limit)));
                        }
                        Link::Broken(..) | Link::Unknown => {}
                    }
                }
                let (other, quantity, apart, limit) = first.filter(|_| broken > holding)?;
                Some(RecordError::Neighbours {
                    quantity,
                    value: quantity.of(records[index].1),
                    apart,
                    limit,
                    record: number(records[other].0),
                })
            })
            .collect()
    }

    /// Whether `b` continues the earlier `a`.
    fn link(&self, a: &Record, b: &Record) -> Link {
        let apart_s = b.time_s.get() - a.time_s.get();
        if apart_s <= 0.0 {
            return Link::Unknown; // a misplaced block begins
        }
        let (quantity, apart, limit) = if apart_s <= NEAR_S {
            let steps = apart_s / FRAME_S;
            let wider = steps.max(1.0);
            let limit = |quantity: Quantity| {
                quantity.limit() * if quantity.is_of_beam() { wider } else { 1.0 }
            };
            let broken = self
                .steps(a, b, steps)
                .into_iter()
                .flatten()
                .map(|(quantity, apart)| (quantity, apart, limit(quantity)))
                .find(|(_, apart, limit)| !(apart <= limit));
            match broken {
                Some(broken) => broken,
                None => return Link::Holds,
            }
        } else if self.mapping {
            let (quantity, apart, limit) = flight(a, b, apart_s);
            if apart <= limit {
                return Link::Holds;
            }
            (quantity, apart, limit)
        } else {
            return Link::Unknown;
        };
        Link::Broken(quantity, apart, limit)
    }

    /// Deviation of `b` from the extrapolation of `a` over this number of frame lengths, by the mean of their rates.
    fn steps(&self, a: &Record, b: &Record, steps: f64) -> [Option<(Quantity, f64)>; 10] {
        use Quantity as Q;
        let step = |a: i32, b: i32, rate_a: i32, rate_b: i32| {
            let rate = 0.5 * (f64::from(rate_a) + f64::from(rate_b));
            f64::from(b) - f64::from(a) - rate * steps
        };
        let apart_m = |spacecraft: bool| {
            let [of_a, of_b] = [a, b].map(|record| places(record, spacecraft));
            let metres = of_a.metres_per_microdegree;
            let north = step(of_a.latitude, of_b.latitude, of_a.rates[1], of_b.rates[1]);
            let east = step(of_a.longitude, of_b.longitude, of_a.rates[0], of_b.rates[0]);
            let middle_rad = 0.5
                * RADIANS_PER_MICRODEGREE
                * (f64::from(of_a.latitude) + f64::from(of_b.latitude));
            // The shorter way around Mars.
            let east = (east + HALF_TURN).rem_euclid(2.0 * HALF_TURN) - HALF_TURN;
            [north.abs() * metres, east.abs() * metres * middle_rad.cos()]
        };
        let [craft_north_m, craft_east_m] = apart_m(true);
        let polar = |record: &Record| record.ground_latitude_microdegrees.get().abs() > POLE;
        let one_attitude = a.attitude_flag == b.attitude_flag;
        let ground = (one_attitude && !polar(a) && !polar(b)).then(|| apart_m(false));
        let centimetres = |a: u32, b: u32, rate_a: i32, rate_b: i32| {
            let rate = 0.5 * (f64::from(rate_a) + f64::from(rate_b));
            (f64::from(b) - f64::from(a) - rate * steps).abs() * METRES_PER_CM
        };
        let residuals = self.guard.crossover_m(a).zip(self.guard.crossover_m(b));
        let off_nadir =
            f64::from(b.off_nadir_microdegrees.get()) - f64::from(a.off_nadir_microdegrees.get());
        let orbits = i64::from(b.orbit.get()) - i64::from(a.orbit.get());
        // The number increases once per revolution.
        let orbits_off = if (0..=1).contains(&orbits) {
            0.0
        } else {
            orbits.abs() as f64 + Q::Orbit.limit()
        };
        [
            Some((Q::SpacecraftLatitude, craft_north_m)),
            Some((Q::SpacecraftLongitude, craft_east_m)),
            Some((
                Q::SpacecraftRadius,
                centimetres(
                    a.spacecraft_radius_cm.get(),
                    b.spacecraft_radius_cm.get(),
                    a.spacecraft_radius_change_cm.get(),
                    b.spacecraft_radius_change_cm.get(),
                ),
            )),
            ground.map(|[north_m, _]| (Q::GroundLatitude, north_m)),
            ground.map(|[_, east_m]| (Q::GroundLongitude, east_m)),
            ground.map(|_| {
                let apart_m = centimetres(
                    a.areoid_radius_cm.get(),
                    b.areoid_radius_cm.get(),
                    a.areoid_radius_change_cm.get(),
                    b.areoid_radius_change_cm.get(),
                );
                (Q::AreoidRadius, apart_m)
            }),
            residuals.map(|(a_m, b_m)| (Q::Crossover, (b_m - a_m).abs())),
            one_attitude.then_some((Q::OffNadir, off_nadir.abs() * 1e-6)),
            Some((
                Q::Frequency,
                (f64::from(b.clock_frequency_hz.get()) - f64::from(a.clock_frequency_hz.get()))
                    .abs(),
            )),
            Some((Q::Orbit, orbits_off)),
        ]
    }
}

/// Longitude, latitude and their rates, microdegrees.
struct Places {
    longitude: i32,
    latitude: i32,
    rates: [i32; 2],
    metres_per_microdegree: f64,
}

fn places(record: &Record, spacecraft: bool) -> Places {
    if spacecraft {
        Places {
            longitude: record.spacecraft_longitude_microdegrees.get(),
            latitude: record.spacecraft_latitude_microdegrees.get(),
            rates: [
                record.spacecraft_longitude_change_microdegrees.get(),
                record.spacecraft_latitude_change_microdegrees.get(),
            ],
            metres_per_microdegree: f64::from(record.spacecraft_radius_cm.get())
                * METRES_PER_CM
                * RADIANS_PER_MICRODEGREE,
        }
    } else {
        Places {
            longitude: record.ground_longitude_microdegrees.get(),
            latitude: record.ground_latitude_microdegrees.get(),
            rates: [
                record.ground_longitude_change_microdegrees.get(),
                record.ground_latitude_change_microdegrees.get(),
            ],
            metres_per_microdegree: f64::from(record.areoid_radius_cm.get())
                * METRES_PER_CM
                * RADIANS_PER_MICRODEGREE,
        }
    }
}

/// Orbit number and orbit model where the nearest records on both sides agree on another value.
fn odd_one(records: &[(usize, &Record)], index: usize) -> Option<RecordError> {
    let (_, before) = records.get(index.checked_sub(1)?)?;
    let ((_, record), (_, after)) = (records.get(index)?, records.get(index + 1)?);
    if after.time_s.get() - before.time_s.get() > NEAR_S {
        return None;
    }
    let differs = |what: &'static str, [before, found, after]: [u32; 3]| {
        let odd = before == after && found != before;
        odd.then_some(RecordError::OddOne {
            what,
            found,
            expected: before,
        })
    };
    let three = [before, record, after];
    differs("orbit number", three.map(|record| record.orbit.get())).or_else(|| {
        let models = three.map(|record| u32::from(record.orbit_quality.get()));
        differs("orbit model (ORBIT_QUALITY_FLAG)", models)
    })
}

/// Elapsed time by the spacecraft's motion and by the count of its revolutions: the first that disagrees, otherwise the
/// count.
fn flight(a: &Record, b: &Record, apart_s: f64) -> (Quantity, f64, f64) {
    let revolutions = apart_s / PERIOD_S;
    if apart_s <= FLIGHT_S {
        let [of_a, of_b] = [a, b].map(|record| {
            let place = places(record, true);
            [place.longitude, place.latitude]
                .map(|angle| f64::from(angle) * RADIANS_PER_MICRODEGREE)
        });
        // East longitudes of objects at rest in inertial space decrease while Mars rotates.
        let east_rad = of_b[0] - of_a[0] + TAU * apart_s / TURN_S;
        let cosine = of_a[1].sin() * of_b[1].sin() + of_a[1].cos() * of_b[1].cos() * east_rad.cos();
        let flown_deg = cosine.clamp(-1.0, 1.0).acos() / RADIANS_PER_DEGREE;
        let mean_deg = wrap_pi(TAU * revolutions).abs() / RADIANS_PER_DEGREE;
        let limit_deg = Quantity::Time.limit()
            + (ELLIPSE_SHARE * 360.0 * revolutions).min(ELLIPSE_DEG)
            + DEGREES_PER_REVOLUTION * revolutions;
        let apart_deg = (flown_deg - mean_deg).abs();
        if !(apart_deg <= limit_deg) {
            return (Quantity::Time, apart_deg, limit_deg);
        }
    }
    let orbits = f64::from(b.orbit.get()) - f64::from(a.orbit.get());
    // The period is known to a part in a thousand.
    let limit = Quantity::Orbit.limit() + 1e-3 * revolutions;
    (Quantity::Orbit, (orbits - revolutions).abs(), limit)
}
