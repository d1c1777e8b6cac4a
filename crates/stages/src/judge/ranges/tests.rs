//! Remarks on crossover corrections by profiles with known means.

use super::*;
use areograph_geom::statistics::Summary;

/// Shots of a profile that is judged.
const SHOTS: u32 = 200;

fn summary(mean: f64) -> Summary {
    Summary {
        n: SHOTS,
        mean,
        ..Summary::default()
    }
}

/// A profile at nadir whose ranges agree with the uncorrected radii, and whose crossover correction changes radii by
/// `correction_m`, metres.
fn corrected_by(name: &str, correction_m: f64) -> ProfileRanges {
    ProfileRanges {
        profile: name.to_owned(),
        shots: SHOTS,
        off_nadir_rad: 0.0,
        range_minus_distance_m: summary(1.5),
        range_minus_distance_crossover_m: summary(1.5 + correction_m),
        decoding_m: summary(0.0),
        spacecraft_m: [Summary::default(); 3],
        mean_without_outliers_m: 1.5,
        decoding_without_outliers_m: 0.0,
        trend_m_s: None,
        outliers: 0,
        scan: None,
        invalid_because: Vec::new(),
    }
}

fn limits() -> RangeCheckConfig {
    RangeCheckConfig {
        mean_max_m: 10.0,
        ..RangeCheckConfig::default()
    }
}

fn remarks_on(profiles: &[ProfileRanges]) -> Vec<String> {
    corrected_too_far(profiles, &limits())
}

#[test]
fn a_correction_beyond_the_limit_for_an_orbit_error_has_a_remark() {
    let remarks = remarks_on(&[corrected_by("site/1", 10.5)]);
    assert_eq!(remarks.len(), 1, "{remarks:?}");
    for part in [
        "profile site/1: ",
        "by +10.5 m",
        "at most ±10.0 m",
        "range_check.mean_max_m",
    ] {
        assert!(remarks[0].contains(part), "{part}: {remarks:?}");
    }
    let remarks = remarks_on(&[corrected_by("site/1", -10.5)]);
    assert!(remarks[0].contains("by −10.5 m"), "{remarks:?}");
    assert!(remarks_on(&[corrected_by("site/1", 9.5)]).is_empty());
    assert!(remarks_on(&[]).is_empty());
    // No number is within the limit.
    assert_eq!(remarks_on(&[corrected_by("site/1", f64::NAN)]).len(), 1);
}

/// Errors of single orbits are independent: the mean of four corrections may reach half the limit of one.
#[test]
fn the_mean_of_many_profiles_has_a_narrower_limit() {
    let all = |correction_m: f64| {
        ["site/1", "site/2", "site/3", "site/4"].map(|name| corrected_by(name, correction_m))
    };
    let remarks = remarks_on(&all(5.5));
    assert_eq!(remarks.len(), 1, "{remarks:?}");
    assert!(
        remarks[0].starts_with("4 profiles at nadir, on average: ")
            && remarks[0].contains("by +5.5 m")
            && remarks[0].contains("at most ±5.0 m"),
        "{remarks:?}"
    );
    assert!(remarks_on(&all(4.5)).is_empty());
    // A single large correction, whose mean with the others is small.
    let mut mixed = all(-3.0);
    mixed[2] = corrected_by("site/3", 10.5);
    let remarks = remarks_on(&mixed);
    assert_eq!(remarks.len(), 1, "{remarks:?}");
    assert!(remarks[0].starts_with("profile site/3: "), "{remarks:?}");
}

#[test]
fn profiles_whose_ranges_confirm_nothing_do_not_count() {
    let far = corrected_by("site/1", 30.0);
    let silent = [
        // Too short to be judged.
        ProfileRanges {
            shots: limits().shots_min - 1,
            ..far.clone()
        },
        // The orbit error across the track contributes.
        ProfileRanges {
            off_nadir_rad: 0.3,
            ..far.clone()
        },
        // Tables without a spacecraft.
        ProfileRanges {
            decoding_m: Summary::default(),
            ..far.clone()
        },
        // No uncorrected or no corrected radius.
        ProfileRanges {
            range_minus_distance_m: Summary::default(),
            ..far.clone()
        },
        ProfileRanges {
            range_minus_distance_crossover_m: Summary::default(),
            ..far.clone()
        },
        // Ranges beyond their own limit.
        ProfileRanges {
            mean_without_outliers_m: 12.0,
            ..far.clone()
        },
    ];
    for profile in &silent {
        assert!(
            remarks_on(std::slice::from_ref(profile)).is_empty(),
            "{profile:?}"
        );
    }
    assert_eq!(remarks_on(&[far]).len(), 1);
}
