//! Abstract, Table 1 and data preparation.

use areograph::{
    config::{built_in_instruments, usual_altimeter, usual_instrument},
    pds::pedr::{RECORD_BYTES, SHOTS},
    units::RADIANS_PER_DEGREE,
};

use super::super::{
    row::{Account, Comparison, Kind, Row, derived, number},
    scene::{GRAVITY, GUSEV, INCLINATION_DEG, ORBIT_RADIUS_M},
    table_2::{TABLE_2, ground_speed_m_s},
};

/// Altitude of Table 1, metres.
const ALTITUDE_M: f64 = 370e3;
/// Equatorial radius of Mars, metres.
const MARS_RADIUS_M: f64 = 3_396.19e3;
/// Period of the orbit as orbits are numbered, seconds; time between two records of a PEDR file.
const NODAL_PERIOD_S: f64 = 7_064.0;
const FRAME_S: f64 = 2.0;

fn registration_uncertainty() -> Vec<Comparison> {
    let spacings = TABLE_2
        .iter()
        .map(|image| image.shot_spacing_m.parse::<f64>().unwrap());
    let mean_m = spacings.sum::<f64>() / TABLE_2.len() as f64;
    vec![
        number("mean MOLA GSD of Table 2, m", "325", mean_m, 2).within(3.0),
        derived(
            "equivalent clock error, s",
            "not published",
            325.0 / ground_speed_m_s(true),
            3,
        )
        .shown(),
    ]
}

fn orbit() -> Vec<Comparison> {
    vec![
        number(
            "altitude, km",
            "370",
            (ORBIT_RADIUS_M - MARS_RADIUS_M) / 1e3,
            1,
        )
        // Farther off than the 2 % that S05-60 allows of altitudes.
        .departs(0.02 * 370.0),
        number("inclination, °", "92.9", INCLINATION_DEG, 1).exact(),
    ]
}

fn period() -> Vec<Comparison> {
    let hours =
        |radius_m: f64| std::f64::consts::TAU * (radius_m.powi(3) / GRAVITY).sqrt() / 3_600.0;
    vec![
        number("semi-major axis 3766 km, h", "1.9", hours(3_766e3), 3).between(1.9, 2.0),
        number("semi-major axis 3776 km, h", "1.9", hours(3_776e3), 3).between(1.9, 2.0),
    ]
}

fn revisit() -> Vec<Comparison> {
    const SOL_S: f64 = 88_775.244;
    let revolutions = (7.0 * SOL_S / NODAL_PERIOD_S).round();
    vec![number("sols", "7", revolutions * NODAL_PERIOD_S / SOL_S, 3).within(0.05)]
}

/// Both wide-angle cameras.
fn wide_angle() -> Vec<Comparison> {
    let cameras = built_in_instruments();
    let each = cameras
        .iter()
        .filter(|camera| camera.id.starts_with("moc_wa"));
    each.flat_map(|camera| {
        let of = |what: &str| format!("{}: {what}", camera.name);
        let (focal_length_mm, pixel_mm) =
            (camera.optics.focal_length_mm, camera.optics.pixel_pitch_mm);
        let pixel_m = ALTITUDE_M * pixel_mm / focal_length_mm;
        let pixels = f64::from(camera.detector.pixels);
        [
            number(of("detectors"), "3456", pixels, 0).exact(),
            number(of("focal length, mm"), "11.3", focal_length_mm, 1).shown(),
            number(of("pixel from 370 km, m"), "280", pixel_m, 0).departs(20.0),
        ]
    })
    .collect()
}

fn velocity() -> Vec<Comparison> {
    let fixed_m_s = (GUSEV.pose(0.5).position_m - GUSEV.pose(-0.5).position_m).norm();
    let inertial_m_s = (GRAVITY / ORBIT_RADIUS_M).sqrt();
    vec![
        number("inertial, km/s", "3.4", inertial_m_s / 1e3, 3).within(0.05),
        number("Mars-fixed, km/s", "3.4", fixed_m_s / 1e3, 3).within(0.05),
    ]
}

fn detector() -> Vec<Comparison> {
    let camera = usual_instrument();
    vec![
        number("detectors", "2048", f64::from(camera.detector.pixels), 0).exact(),
        number("focal length, mm", "3500", camera.optics.focal_length_mm, 0).exact(),
    ]
}

fn resolution() -> Vec<Comparison> {
    let camera = usual_instrument();
    let pixel_rad = camera.optics.pixel_pitch_mm / camera.optics.focal_length_mm;
    let field_rad = pixel_rad * f64::from(camera.detector.pixels);
    vec![
        number("pixel from 370 km, m", "1.4", ALTITUDE_M * pixel_rad, 3).within(0.05),
        number("field of view, °", "0.4", field_rad / RADIANS_PER_DEGREE, 3).within(0.05),
    ]
}

fn laser_rate() -> Vec<Comparison> {
    vec![number("shots per second", "10", SHOTS as f64 / FRAME_S, 0).exact()]
}

fn laser_spot() -> Vec<Comparison> {
    vec![number("0.4 mrad from 370 km, m", "130", 0.4e-3 * ALTITUDE_M, 0).departs(10.0)]
}

fn range_resolution() -> Vec<Comparison> {
    const LIGHT_M_S: f64 = 299_792_458.0;
    vec![
        number(
            "2.5 ns of two-way time, cm",
            "37.5",
            100.0 * LIGHT_M_S * 2.5e-9 / 2.0,
            2,
        )
        .within(0.1),
    ]
}

fn along_track() -> Vec<Comparison> {
    [("nadir, m", true), ("held inertially, m", false)]
        .map(|(of, nadir)| number(of, "330", 0.1 * ground_speed_m_s(nadir), 1).departs(5.0))
        .to_vec()
}

fn file_of_orbits() -> Vec<Comparison> {
    let seconds = 32e6 / RECORD_BYTES as f64 * FRAME_S;
    vec![number("orbits in 32 MB", "12", seconds / NODAL_PERIOD_S, 2).within(0.5)]
}

fn attitude_bias() -> Vec<Comparison> {
    vec![number("s", "-1.15", usual_instrument().pointing.ck_bias_s, 2).exact()]
}

fn clock_bias() -> Vec<Comparison> {
    vec![number("ms", "117", 1e3 * usual_altimeter().clock_bias_s, 0).exact()]
}

pub(super) static ROWS: [Row; 16] = [
    Row {
        id: "S05-01",
        kind: Kind::Arithmetic,
        place: "abstract, results, conclusions",
        what: "along-track uncertainty of the registration: one MOLA GSD, nearly constant within an image",
        account: Account::Agrees {
            from: "MOLA GSD of Table 2; ground speed of a circular orbit",
            ours: registration_uncertainty,
        },
        note: "The published 325 m is a rounded mean. As a clock error, it corresponds to 0.107 s; the 0.117 s of the \
               data preparation (S05-15) is the bias of MOLA's own clock, a different quantity.",
    },
    Row {
        id: "S05-02",
        kind: Kind::Constants,
        place: "Table 1",
        what: "altitude about 370 km, inclination",
        account: Account::Explained {
            from: "the circular orbit of the rows below",
            ours: orbit,
        },
        note: "370 km is the lowest altitude, near the south pole; over the three sites, MGS is at 380 to 385 km \
               (S05-69). The inclination according to real kernels is 92.896°.",
    },
    Row {
        id: "S05-03",
        kind: Kind::Constants,
        place: "Table 1",
        what: "period",
        account: Account::Agrees {
            from: "2π√(a³/GM)",
            ours: period,
        },
        note: "The published value is truncated, not rounded.",
    },
    Row {
        id: "S05-04",
        kind: Kind::Constants,
        place: "Table 1",
        what: "velocity",
        account: Account::Agrees {
            from: "√(GM/a), and the same relative to the rotating surface",
            ours: velocity,
        },
        note: "",
    },
    Row {
        id: "S05-05",
        kind: Kind::Constants,
        place: "Table 1",
        what: "revisit",
        account: Account::Agrees {
            from: "revolutions of 7064 s in 7 sols of 88 775.244 s, rounded to a whole number",
            ours: revisit,
        },
        note: "Seven sols contain 88 revolutions.",
    },
    Row {
        id: "S05-06",
        kind: Kind::Constants,
        place: "Table 1",
        what: "MOC narrow angle: detectors, focal length",
        account: Account::Input {
            from: "config/instruments/moc_na.toml",
            ours: detector,
            test: "tests/products/products_site.rs::camera_model_times_and_detectors_are_those_of_a_summed_image",
        },
        note: "The paper does not state the pitch of the detectors (13 µm).",
    },
    Row {
        id: "S05-07",
        kind: Kind::Constants,
        place: "Table 1",
        what: "MOC narrow angle: resolution, field of view",
        account: Account::Agrees {
            from: "config/instruments/moc_na.toml, 370 km",
            ours: resolution,
        },
        note: "",
    },
    Row {
        id: "S05-08",
        kind: Kind::Constants,
        place: "Table 1",
        what: "MOC wide angle",
        account: Account::Explained {
            from: "config/instruments/moc_wa_red.toml and moc_wa_blue.toml, 370 km",
            ours: wide_angle,
        },
        note: "The paper does not use these cameras. The instrument files contain the focal length that belongs to the \
               distortion of each camera, 11.2 mm for both; 280 m would require an altitude of 450 km.",
    },
    Row {
        id: "S05-09",
        kind: Kind::Constants,
        place: "Table 1",
        what: "MOLA: 1064 nm, 10 Hz",
        account: Account::Input {
            from: "20 shots in the 2 s of a PEDR frame",
            ours: laser_rate,
            test: "tests/truth/scene_mission.rs::footprints_come_back_within_0_2_m_and_times_within_2_us",
        },
        note: "",
    },
    Row {
        id: "S05-10",
        kind: Kind::Arithmetic,
        place: "Table 1",
        what: "laser spot",
        account: Account::Explained {
            from: "0.4 mrad and 370 km of the same table",
            ours: laser_spot,
        },
        note: "130 m corresponds to 0.35 mrad.",
    },
    Row {
        id: "S05-11",
        kind: Kind::Constants,
        place: "Table 1",
        what: "range resolution",
        account: Account::Agrees {
            from: "half the distance that light travels in 2.5 ns",
            ours: range_resolution,
        },
        note: "2.5 ns is the resolution of MOLA's 400 MHz counter; the paper does not state this resolution.",
    },
    Row {
        id: "S05-12",
        kind: Kind::Constants,
        place: "Table 1",
        what: "spacing along the track, about 330 m",
        account: Account::Explained {
            from: "ground speed of a circular orbit, 0.1 s",
            ours: along_track,
        },
        note: "330 m is neither one of the two spacings in Table 2 nor a spacing of real shots (S05-65).",
    },
    Row {
        id: "S05-13",
        kind: Kind::Arithmetic,
        place: "data preparation",
        what: "a PEDR file: about 12 orbits, 32 MB (56 CDs searched)",
        account: Account::Agrees {
            from: "records of 776 bytes every 2 s, orbits of 7064 s",
            ours: file_of_orbits,
        },
        note: "",
    },
    Row {
        id: "S05-14",
        kind: Kind::Constants,
        place: "data preparation",
        what: "time offset of attitude look-ups, for pointing only",
        account: Account::Input {
            from: "config/instruments/moc_na.toml",
            ours: attitude_bias,
            test: "tests/commands/mission.rs::without_the_pointing_bias_a_nadir_image_moves_380_m",
        },
        note: "",
    },
    Row {
        id: "S05-15",
        kind: Kind::Constants,
        place: "data preparation",
        what: "bias of MOLA's clock",
        account: Account::Input {
            from: "config/altimeters/mola.toml",
            ours: clock_bias,
            test: "tests/commands/mission.rs::the_three_readings_of_the_clock_bias_differ_as_told",
        },
        note: "Neither sign nor formula is published. The key `altimeter_clock.scope` offers three interpretations: `spk_lookup` \
               (default), `both`, `rotation`.",
    },
    Row {
        id: "S05-16",
        kind: Kind::Evidence,
        place: "data preparation",
        what: "orbits of NAV, IPNG and GSFC",
        account: Account::Data {
            printed: "0–50 m apart, mostly across the track; NAV nearest to the mean",
        },
        note: "Closed loop: the shifts of synthetic orbits are recovered to within 1 m, and the orbit nearest to their \
               mean is chosen (tests/commands/compare_kernels.rs).",
    },
];
