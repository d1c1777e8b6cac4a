//! Registration: iterations, and how far footprints lie apart.

use areograph::{config::RegistrationConfig, geom::pushbroom::Projector};

use super::super::{
    row::{Account, Comparison, Kind, Row, derived, number},
    scene::{EOS_NADIR, EOS_OBLIQUE, GUSEV, Iterations, PAPER, Scene},
    table_2::TABLE_2,
};

fn iterations(scene: &Scene, shots: u32) -> Iterations {
    scene.iterations(&scene.profile_m(shots, 305.0), &PAPER)
}

fn tolerance() -> Vec<Comparison> {
    let config = RegistrationConfig::default();
    vec![number("px", "0.1", config.tolerance_lines, 1).exact()]
}

fn eos() -> Vec<Comparison> {
    let [nadir, oblique] = [EOS_NADIR, EOS_OBLIQUE].map(|scene| iterations(&scene, 174));
    let mean = |of: fn(&Iterations) -> f64| 0.5 * (of(&nadir) + of(&oblique));
    let mut all = vec![
        number("eq. 4, both images", "2.9", mean(|of| of.fixed_point), 2).departs(0.5),
        number(
            "frame first, both images",
            "13.6",
            mean(|of| of.frame_first),
            2,
        )
        .departs(0.5),
        number("eq. 4, E04-01275 alone", "2.9", oblique.fixed_point, 2).within(0.4),
    ];
    for (of, found) in [("E02-02855", nadir), ("E04-01275", oblique)] {
        let share = found.frame_first / found.fixed_point;
        all.push(derived(format!("{of}, frame first over eq. 4"), "4.7", share, 1).shown());
    }
    all
}

fn gusev() -> Vec<Comparison> {
    let found = iterations(&GUSEV, 142);
    vec![
        number("eq. 4", "5.6", found.fixed_point, 2).share(0.1),
        number("frame first", "17.1", found.frame_first, 2).departs(0.1 * 17.1),
    ]
}

fn gain() -> Vec<Comparison> {
    vec![
        number("Eos", "3–4", 13.6 / 2.9, 1).shown(),
        number("Gusev", "3–4", 17.1 / 5.6, 1).between(3.0, 4.0),
        number("Eos, above 4", "4", 13.6 / 2.9, 1).departs(0.5),
    ]
}

fn spacing() -> Vec<Comparison> {
    vec![
        number(
            "E02-02855, 305 m",
            "55",
            305.0 / TABLE_2[0].line_spacing_m(),
            1,
        )
        .within(0.5),
        number(
            "E02-01301, 340 m",
            "104",
            340.0 / TABLE_2[4].line_spacing_m(),
            1,
        )
        .within(0.5),
        derived("305 m over the published 5.5 m", "55", 305.0 / 5.5, 1).shown(),
        derived("340 m over the published 3.3 m", "104", 340.0 / 3.3, 1).shown(),
    ]
}

/// By how many footprints a profile moves in the image when the image's clock is off by the time between two shots.
fn same_place() -> Vec<Comparison> {
    let model = GUSEV.rotation_vector();
    let projector = Projector::new(&model, f64::from(GUSEV.lines)).unwrap();
    let lines: Vec<f64> = GUSEV
        .profile_m(142, 305.0)
        .iter()
        .map(|point_m| projector.project(point_m).unwrap().x)
        .collect();
    let spacing_lines = (lines[141] - lines[0]) / 141.0;
    let shot_s = 305.0 / super::super::table_2::ground_speed_m_s(true);
    let shifted = shot_s / GUSEV.line_period_s() / spacing_lines;
    vec![number("footprints for one shot interval", "1", shifted, 3).within(5e-3)]
}

fn measuring() -> Vec<Comparison> {
    let sigma_px = areograph::config::AdjustmentConfig::default().tie_sigma_px[0];
    vec![
        number(
            "standard deviation of a tie point, better than, px",
            "2",
            sigma_px,
            0,
        )
        .between(0.0, 2.0),
    ]
}

pub(super) static ROWS: [Row; 7] = [
    Row {
        id: "S05-42",
        kind: Kind::Constants,
        place: "registration",
        what: "tolerance of the iterations",
        account: Account::Input {
            from: "default of `registration.tolerance_lines`",
            ours: tolerance,
            test: "tests/stages/registration.rs::iterations_are_counted_for_every_point_within_the_lines",
        },
        note: "In x, one pixel is one line.",
    },
    Row {
        id: "S05-43",
        kind: Kind::Evidence,
        place: "registration",
        what: "iterations at Eos, 174 points in two images",
        account: Account::Explained {
            from: "circular orbit, both images, 174 points at 305 m",
            ours: eos,
        },
        note: "The off-nadir image alone requires 2.9 iterations. The paper does not state whether the sum was divided \
               by 174 or 348. In each image, eq. 4 requires fewer iterations than the frame-first method.",
    },
    Row {
        id: "S05-44",
        kind: Kind::Evidence,
        place: "registration",
        what: "iterations at Gusev, 142 points in E02-00665",
        account: Account::InPart {
            from: "circular orbit, nadir, 142 points at 305 m",
            ours: gusev,
        },
        note: "The row refers to one image, not to a pair. The frame-first method requires 11 % more iterations than \
               published; the paper does not state the initial values of the iterations.",
    },
    Row {
        id: "S05-45",
        kind: Kind::Arithmetic,
        place: "registration",
        what: "eq. 4 is 3–4 times faster",
        account: Account::Explained {
            from: "the published counts of both sites",
            ours: gain,
        },
        note: "At Eos, the ratio is 4.7.",
    },
    Row {
        id: "S05-46",
        kind: Kind::Arithmetic,
        place: "results",
        what: "one MOLA GSD, 55 to 104 px",
        account: Account::Agrees {
            from: "exposure time and ground speed",
            ours: spacing,
        },
        note: "According to the exposure times, the pixels are 5.51 and 3.27 m, which the paper rounds to 5.5 and 3.3 m.",
    },
    Row {
        id: "S05-47",
        kind: Kind::ClosedLoop,
        place: "results",
        what: "point 74 of ap19215 in the left image at the position of point 73 in the right image; 109 and 108 of ap18933",
        account: Account::Agrees {
            from: "circular orbit, E02-00665, a clock error equal to the time between two shots",
            ours: same_place,
        },
        note: "An inserted time shift of one shot interval is recovered as a shift of one footprint. The paper \
               compared the images visually.",
    },
    Row {
        id: "S05-48",
        kind: Kind::Constants,
        place: "intersection",
        what: "about 24 seed points per pair, measured to better than 2 px",
        account: Account::Input {
            from: "default of `adjustment.tie_sigma_px`",
            ours: measuring,
            test: "tests/stages/stereo_intersection.rs::noise_comes_out_as_simulated_and_as_the_covariance_says",
        },
        note: "areograph reads tie points, and measures them where pixels are given (`ties.match`); it requires no seed points.",
    },
];
