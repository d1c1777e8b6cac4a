//! Tables 1 and 2 and the text against real shots of the passes of two images.

use std::sync::LazyLock;

use super::{
    super::{
        real_shots::{self, Pass},
        row::{Account, Comparison, Kind, Row, derived, number},
        table_2::{Printed, TABLE_2},
    },
    table_2::start_s,
};

/// E02-00665, which looks down, and E02-01453, held inertially off nadir: the pair of Gusev.
const IMAGES: [&Printed; 2] = [&TABLE_2[2], &TABLE_2[3]];

static PASSES: LazyLock<[Pass; 2]> = LazyLock::new(|| {
    IMAGES.map(|image| real_shots::pass_after(start_s(image) + image.duration_s()))
});

fn rate() -> Vec<Comparison> {
    // The clock of the laser is good to a thousandth.
    vec![number("shots per second", "10", 1.0 / PASSES[0].interval_s, 4).within(0.01)]
}

fn spacing() -> Vec<Comparison> {
    let each = IMAGES.iter().zip(&*PASSES);
    each.map(|(image, pass)| number(image.id, image.shot_spacing_m, pass.spacing_m, 1).within(2.0))
        .collect()
}

fn orbits() -> Vec<Comparison> {
    let mut all = Vec::new();
    for (image, pass) in IMAGES.iter().zip(&*PASSES) {
        let first = f64::from(image.profile);
        let orbit = f64::from(pass.orbit);
        all.push(
            number(
                format!("{}, orbit", image.id),
                image.profile.to_string(),
                orbit,
                0,
            )
            .departs(0.5),
        );
        all.push(
            derived(
                format!("{}, orbits after the first of its file", image.id),
                "one of twelve",
                orbit - first,
                0,
            )
            .between(0.0, 11.0),
        );
        all.push(
            derived(
                format!("{}, from its end to the first shot, s", image.id),
                "not published",
                pass.after_s,
                1,
            )
            .shown(),
        );
    }
    let days = (PASSES[1].start_s - PASSES[0].start_s) / 86_400.0;
    all.push(number("days apart, less than", "10", days, 2).at_most(10.0));
    all
}

fn period() -> Vec<Comparison> {
    let orbits = f64::from(PASSES[1].orbit - PASSES[0].orbit);
    let hours = (PASSES[1].start_s - PASSES[0].start_s) / orbits / 3_600.0;
    // One decimal, which may be cut.
    vec![number("h", "1.9", hours, 3).within(0.1)]
}

fn velocity() -> Vec<Comparison> {
    vec![number("km/s", "3.4", PASSES[1].speed_m_s / 1e3, 3).within(0.05)]
}

fn altitude() -> Vec<Comparison> {
    let range_km = PASSES[0].range_m / 1e3;
    vec![
        number("altitude of Table 1, km", "370", range_km, 1).departs(0.02 * 370.0),
        number("H of eq. 9, km", "385", range_km, 1).share(0.02),
    ]
}

fn accuracy() -> Vec<Comparison> {
    let windows = real_shots::smooth_windows();
    let each = windows.map(|(name, crossings, sigma_m)| {
        number(
            format!("{name}, 1 σ of a shot from {crossings} crossovers, m"),
            "1",
            sigma_m,
            2,
        )
        .at_most(1.0)
    });
    each.to_vec()
}

pub(super) static ROWS: [Row; 7] = [
    Row {
        id: "S05-64",
        kind: Kind::Evidence,
        place: "Table 1",
        what: "MOLA: 10 Hz",
        account: Account::Agrees {
            from: "times of real shots, orbit 18940",
            ours: rate,
        },
        note: "",
    },
    Row {
        id: "S05-65",
        kind: Kind::Evidence,
        place: "Table 2",
        what: "MOLA GSD of the pair at Gusev, m",
        account: Account::Agrees {
            from: "distances between real shots of both passes, just after the images",
            ours: spacing,
        },
        note: "The spacing varies by 2 m with height and latitude. The 330 m of Table 1 is neither of the two spacings (S05-12).",
    },
    Row {
        id: "S05-66",
        kind: Kind::Evidence,
        place: "Table 2",
        what: "MOLA profiles of the pair at Gusev, and days between them",
        account: Account::Explained {
            from: "orbits and times of the real passes closest in time to the images",
            ours: orbits,
        },
        note: "The paper states file names: a file is named after the first of its twelve orbits, and the passes are \
               among these. The window of the shots begins after the end of each image.",
    },
    Row {
        id: "S05-67",
        kind: Kind::Evidence,
        place: "Table 1",
        what: "period",
        account: Account::Agrees {
            from: "time between the two real passes divided by the number of orbits",
            ours: period,
        },
        note: "The published value is truncated, not rounded.",
    },
    Row {
        id: "S05-68",
        kind: Kind::Evidence,
        place: "Table 1",
        what: "velocity",
        account: Account::Agrees {
            from: "real shots of orbit 19053, held inertially: the footprint moves at the speed of the spacecraft",
            ours: velocity,
        },
        note: "The speed is relative to the rotating surface.",
    },
    Row {
        id: "S05-69",
        kind: Kind::Evidence,
        place: "Table 1, text on eq. 9",
        what: "altitude about 370 km; height H 385 km",
        account: Account::InPart {
            from: "real ranges at nadir, orbit 18940",
            ours: altitude,
        },
        note: "The altitude of MGS is 370 km near the south pole, not over the sites.",
    },
    Row {
        id: "S05-70",
        kind: Kind::Evidence,
        place: "introduction",
        what: "accuracy of MOLA, 1 m vertically",
        account: Account::Agrees {
            from: "radii of real shots, all of equal weight: normalised median absolute deviation of the differences where \
                   ascending and descending passes cross over smooth ground, divided by √2",
            ours: accuracy,
        },
        note: "This is repeatability after the crossover adjustment of the MOLA team; it does not contain an error that all \
               passes share. Heights do not test the 100 m in plan.",
    },
];
