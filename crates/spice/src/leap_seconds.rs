//! UTC of the loaded kernels against the published time scale.

use areograph_base::{
    error::{Locate, Result},
    time::Et,
};

use super::{error::SpiceError, role::KernelRole, session::Session};

/// Modified Julian date of each leap second's day, and TAI − UTC from then on, seconds (IERS, Bulletin C; the last
/// announced leap second is the one of 2017).
const LEAP_SECONDS: [(i32, f64); 28] = [
    (41_317, 10.0),
    (41_499, 11.0),
    (41_683, 12.0),
    (42_048, 13.0),
    (42_413, 14.0),
    (42_778, 15.0),
    (43_144, 16.0),
    (43_509, 17.0),
    (43_874, 18.0),
    (44_239, 19.0),
    (44_786, 20.0),
    (45_151, 21.0),
    (45_516, 22.0),
    (46_247, 23.0),
    (47_161, 24.0),
    (47_892, 25.0),
    (48_257, 26.0),
    (48_804, 27.0),
    (49_169, 28.0),
    (49_534, 29.0),
    (50_083, 30.0),
    (50_630, 31.0),
    (51_179, 32.0),
    (53_736, 33.0),
    (54_832, 34.0),
    (56_109, 35.0),
    (57_204, 36.0),
    (57_754, 37.0),
];
/// First and last year in which TAI − UTC is known.
const YEARS: std::ops::RangeInclusive<i32> = 1972..=2026;
/// First days of the quarters of a year, and the numbers of days of a common year that precede them. Leap seconds begin
/// on such a day; in April and October TDB − TT is largest.
const QUARTERS: [(&str, i32); 4] = [("01-01", 0), ("04-01", 90), ("07-01", 181), ("10-01", 273)];
/// Largest difference, seconds: 3 m of flight. Rounding of the constants leaves 1e-6 s.
const TOLERANCE_S: f64 = 1e-3;

/// Instant of the start of a day in UTC, seconds TDB past J2000.
///
/// # Source
/// IERS Bulletin C; TDB − TT as in NAIF's Time Required Reading: K sin E, E = M + EB sin M.
fn published_s(modified_julian_date: i32) -> f64 {
    let known = LEAP_SECONDS.partition_point(|(first, _)| *first <= modified_julian_date);
    let tai_minus_utc_s = LEAP_SECONDS[known.max(1) - 1].1;
    let utc_s = (f64::from(modified_julian_date) - 51_544.5) * 86_400.0;
    let tt_s = utc_s + tai_minus_utc_s + 32.184;
    let mean_anomaly = 6.239_996 + 1.990_968_71e-7 * tt_s;
    let eccentric_anomaly = mean_anomaly + 1.671e-2 * mean_anomaly.sin();
    tt_s + 1.657e-3 * eccentric_anomaly.sin()
}

/// The first days of quarters with their modified Julian dates.
fn quarters() -> impl Iterator<Item = (String, i32)> {
    YEARS.flat_map(|year| {
        let since = year - 1972;
        let first = 41_317 + 365 * since + (since + 3) / 4;
        QUARTERS.map(|(day, before)| {
            let leap_day = i32::from(since % 4 == 0 && before > 0);
            (format!("{year}-{day}"), first + before + leap_day)
        })
    })
}

impl Session {
    /// Requires that UTC of the kernels is the published one up to `until`, within 1 ms. Dates after 2026 are not checked.
    ///
    /// # Errors
    /// [`SpiceError::OtherUtc`] with the leap-second kernel: it is older than the data, or its constants are not
    /// NAIF's. [`SpiceError::MissingText`] without a leap-second kernel.
    pub fn require_published_utc(&self, until: Et) -> Result<()> {
        let relevant = quarters()
            .map(|(day, date)| (day, published_s(date)))
            .take_while(|(_, expected_s)| *expected_s <= until.seconds());
        for (day, expected_s) in relevant {
            let off_s = self.utc_to_et(&day)?.seconds() - expected_s;
            // Written so that NaN is an error.
            if !(off_s.abs() <= TOLERANCE_S) {
                let failure = SpiceError::OtherUtc { day, off_s };
                let kernels = self.kernels().of_roles(|role| role == KernelRole::Lsk);
                return match kernels.kernels() {
                    [kernel, ..] => Err(failure).in_file(&kernel.path),
                    [] => Err(failure.into()),
                };
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_begin_on_their_days() {
        let all: Vec<(String, i32)> = quarters().collect();
        // 2000-04-01 and 2026-10-01 (Fliegel and Van Flandern 1968).
        for known in [
            ("1972-01-01", 41_317),
            ("2000-04-01", 51_635),
            ("2026-10-01", 61_314),
        ] {
            assert!(all.contains(&(known.0.to_owned(), known.1)), "{known:?}");
        }
        let days: Vec<i32> = all.iter().map(|(_, date)| *date).collect();
        for (date, _) in LEAP_SECONDS {
            assert!(days.contains(&date), "{date} begins no quarter");
        }
    }
}
