//! Equations 5 to 9: how far the two footprints of one point lie apart.

use areograph::geom::uncertainty::{
    BudgetInput, GroundPart, Misregistration, PairResiduals, PointUncertainty, UncertaintyBudget,
    uncertainty_budget,
};

use super::{
    super::{
        row::{Account, Comparison, Kind, Row, derived, number},
        shan_2002,
        table_2::TABLE_2,
    },
    TABLE_5,
};

/// The mean pixel of the paper, metres.
const PIXEL_M: f64 = 4.4;

/// The budget of the printed Table 5.
fn budget() -> UncertaintyBudget {
    uncertainty_budget(&BudgetInput {
        sites: TABLE_5
            .map(|site| PairResiduals::of_images(site.images))
            .to_vec(),
        misregistration: Some(Misregistration {
            mean_m: 325.0,
            rms_m: 325.0,
        }),
        pixel_size_m: PIXEL_M,
        height_over_base: 385.0 / 155.0,
    })
    .unwrap()
}

/// The paper rounds to a tenth after each step.
fn rounded(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// Mean over the sites of the disagreement of the two means, which have opposite signs.
fn means_apart_px() -> f64 {
    let apart = TABLE_5.map(|site| (site.images[0].mean_x - site.images[1].mean_x).abs());
    apart.iter().sum::<f64>() / 3.0
}

fn along() -> Vec<Comparison> {
    let budget = budget();
    vec![
        number("px", "41.0", budget.along_px, 3).between(40.982, 40.992),
        derived(
            "by eq. 5, means alone, px",
            "not published",
            means_apart_px(),
            1,
        )
        .shown(),
        derived(
            "by eq. 5, with the standard deviations, px",
            "not published",
            budget.equation_5.along_px,
            1,
        )
        .shown(),
    ]
}

fn total() -> Vec<Comparison> {
    vec![number("px", "74.0", total_px(&budget()), 2).within(0.2)]
}

fn total_px(budget: &UncertaintyBudget) -> f64 {
    budget.total_along_px.unwrap()
}

fn ground() -> Vec<Comparison> {
    let budget = budget();
    let GroundPart::Resolved { along_px } = budget.ground else {
        panic!("{budget:?}");
    };
    let with_roundings =
        (total_px(&budget).round().powi(2) - rounded(budget.along_px).powi(2)).sqrt();
    vec![
        number("with the paper's roundings, px", "61.6", with_roundings, 3).within(0.005),
        number("unrounded, px", "61.6", along_px, 2).shown(),
        derived(
            "with the means by eq. 5, px",
            "not published",
            (total_px(&budget).round().powi(2) - means_apart_px().powi(2)).sqrt(),
            1,
        )
        .shown(),
    ]
}

fn across() -> Vec<Comparison> {
    let budget = budget();
    vec![
        number(
            "average of the images, px",
            "2.8",
            budget.paper_average.across_px,
            3,
        )
        .within(0.05),
        number("by eq. 7, px", "2.8", budget.equation_7.across_px, 3).departs(1.0),
    ]
}

fn plan() -> Vec<Comparison> {
    let budget = budget();
    let PointUncertainty { across_px, .. } = budget.paper_average;
    let plan_px = rounded(budget.along_px).hypot(rounded(across_px));
    vec![
        number("with the paper's roundings, px", "41.1", plan_px, 3).within(0.05),
        number(
            "with the paper's roundings, m",
            "180.8",
            plan_px * PIXEL_M,
            2,
        )
        .within(0.1),
        number(
            "unrounded, m",
            "180.8",
            budget.paper_average.planimetric_m,
            2,
        )
        .shown(),
        number(
            "by eq. 7 across as well, m",
            "180.8",
            budget.equation_7.planimetric_m,
            2,
        )
        .shown(),
        derived(
            "by eq. 5, m",
            "not published",
            budget.equation_5.point.planimetric_m,
            1,
        )
        .shown(),
    ]
}

fn mean_pixel() -> Vec<Comparison> {
    let sum_m: f64 = TABLE_2
        .iter()
        .map(|image| image.pixel_m.parse::<f64>().unwrap())
        .sum();
    vec![number("mean of six, m", "4.4", sum_m / 6.0, 3).within(0.05)]
}

fn height_and_base() -> Vec<Comparison> {
    let table = shan_2002::base_and_height();
    vec![
        number(
            "H from the table of 2002, km",
            "385",
            table.altitude_m / 1e3,
            1,
        )
        .share(0.02),
        number("B from the table of 2002, km", "155", table.base_m / 1e3, 1).share(0.02),
    ]
}

fn height_over_base() -> Vec<Comparison> {
    let table = shan_2002::base_and_height();
    vec![
        number("385/155", "2.5", 385.0 / 155.0, 3).within(0.02),
        number(
            "from the table of 2002",
            "2.5",
            table.altitude_m / table.base_m,
            3,
        )
        .within(0.03),
    ]
}

fn height() -> Vec<Comparison> {
    let budget = budget();
    let height_px = 385.0 / 155.0 * rounded(budget.paper_average.across_px);
    vec![
        number("with the paper's roundings, px", "7.0", height_px, 3).within(0.05),
        number(
            "with the paper's roundings, m",
            "30.8",
            rounded(height_px) * PIXEL_M,
            2,
        )
        .within(0.3),
        number("unrounded, m", "30.8", budget.paper_average.height_m, 2).shown(),
        number("by eq. 7 across, px", "7.0", budget.equation_7.height_px, 2).shown(),
        number("by eq. 7 across, m", "30.8", budget.equation_7.height_m, 2).shown(),
        derived(
            "by eq. 5 across, m",
            "not published",
            budget.equation_5.point.height_m,
            1,
        )
        .shown(),
    ]
}

pub(super) static ROWS: [Row; 10] = [
    Row {
        id: "S05-54",
        kind: Kind::Arithmetic,
        place: "eq. 7",
        what: "D_Δx(EO)",
        account: Account::Agrees {
            from: "Table 5: squares averaged over the sites for each image, then added",
            ours: along,
        },
        note: "Averaging D instead of its square gives 40.7. Eq. 7 adds the means of both images in quadrature. \
               According to the paper's own eq. 5, Δx = Δx1 − Δx2, means of opposite sign add up: 54.3, 49.8 and 59.8 \
               px. This changes the conclusions that \
               follow (S05-56, S05-58, S05-62).",
    },
    Row {
        id: "S05-55",
        kind: Kind::Arithmetic,
        place: "text on eq. 6",
        what: "D_Δx(MOLA total)",
        account: Account::Agrees {
            from: "325 m over 4.4 m",
            ours: total,
        },
        note: "",
    },
    Row {
        id: "S05-56",
        kind: Kind::Arithmetic,
        place: "eq. 6",
        what: "D_Δx(MOLA)",
        account: Account::Agrees {
            from: "S05-54 and S05-55",
            ours: ground,
        },
        note: "The paper estimated a misregistration of one MOLA spacing visually; D_Δx(MOLA) is the remainder after \
               subtraction of S05-54 in quadrature. If means of opposite sign are added, the remainder is 49.9 px. A \
               planimetric error of a footprint moves both of its projections alike, so the remainder does not \
               represent the accuracy of MOLA.",
    },
    Row {
        id: "S05-57",
        kind: Kind::Arithmetic,
        place: "eq. 7, across the track",
        what: "D_Δy(EO)",
        account: Account::Explained {
            from: "Table 5",
            ours: across,
        },
        note: "The paper sums over both images along the track, as its eq. 7 states, and averages across the track. \
               The products and the report of areograph contain both results.",
    },
    Row {
        id: "S05-58",
        kind: Kind::Arithmetic,
        place: "eq. 8",
        what: "D_p",
        account: Account::Agrees {
            from: "S05-54 and S05-57, 4.4 m",
            ours: plan,
        },
        note: "D_p is the distance between the positions of one point according to the two images, not a standard \
               deviation of a point. According to eq. 5, it is larger (S05-54).",
    },
    Row {
        id: "S05-59",
        kind: Kind::Arithmetic,
        place: "text on eq. 8",
        what: "mean pixel",
        account: Account::Agrees {
            from: "Table 2",
            ours: mean_pixel,
        },
        note: "With the unrounded mean, D_p would be 182.2 m.",
    },
    Row {
        id: "S05-60",
        kind: Kind::Arithmetic,
        place: "text on eq. 9",
        what: "height H and base B, across the track",
        account: Account::Agrees {
            from: "Table 1 of Shan, Lee & Yoon 2002 (Eos)",
            ours: height_and_base,
        },
        note: "One pair represents three sites: with the published emission angles, B would be 123 km at Eos, 154 km at \
               Gusev and 88 km at Isidis.",
    },
    Row {
        id: "S05-61",
        kind: Kind::Arithmetic,
        place: "text on eq. 9",
        what: "H/B",
        account: Account::Agrees {
            from: "S05-60",
            ours: height_over_base,
        },
        note: "",
    },
    Row {
        id: "S05-62",
        kind: Kind::Arithmetic,
        place: "eq. 9",
        what: "D_h",
        account: Account::Agrees {
            from: "S05-57 and S05-61, 4.4 m",
            ours: height,
        },
        note: "D_h is likewise a distance, in height, not a standard deviation. If eq. 7 were applied across the track \
               as it is along the track, D_h would be larger by a factor of √2.",
    },
    Row {
        id: "S05-63",
        kind: Kind::Constants,
        place: "introduction, discussion",
        what: "results of others",
        account: Account::Cited {
            printed: "740 m of Pathfinder control; MOLA 1 m and 100 m; offsets of 10–20 km and 1.8 km; grids of \
                      1/256°; 3,000 images",
        },
        note: "",
    },
];
