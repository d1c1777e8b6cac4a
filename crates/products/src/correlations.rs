//! Correlations of the adjusted orientation of each image, as Parquet.

use super::{
    AdjustmentProducts, parquet,
    product::{Content, Declaration, Role, Write},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_geom::bundle::{ORIENTATION_UNKNOWNS, Unknown};
use areograph_stages::adjust::CorrectedImage;

pub(super) static TABLE: Declaration = Declaration {
    path: "correlations.parquet",
    what: "correlations between the orientation coefficients of each image, from covariances that include the delay \
           of lines",
    readers: "scripts",
    rows: "pairs of unknowns",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Adjustment(|path, of, _, adjustment| {
        let table = Table::new(columns(), rows(adjustment)).in_terms(&of.site.config.terms());
        parquet::write(path, &table, Vec::new()).map(Some)
    }),
    uses: &[],
};

/// Two unknowns of an image.
struct Pair<'a> {
    image: &'a str,
    unknowns: [String; 2],
    correlation: f64,
}

fn rows<'a>(adjustment: &AdjustmentProducts<'a>) -> Vec<Pair<'a>> {
    let images = adjustment.adjusted.images.iter().enumerate();
    images
        .flat_map(|(index, image)| of_image(index, image))
        .collect()
}

/// Pairs of unknowns that are not fixed.
fn of_image(index: usize, image: &CorrectedImage) -> Vec<Pair<'_>> {
    let name = |coefficient| {
        Unknown::Orientation {
            image: index,
            coefficient,
        }
        .quantity()
    };
    let is_solved = |unknown: &usize| image.covariance[(*unknown, *unknown)] > 0.0;
    let solved: Vec<usize> = (0..ORIENTATION_UNKNOWNS).filter(is_solved).collect();
    let mut pairs = Vec::new();
    for (place, first) in solved.iter().copied().enumerate() {
        for second in solved[place + 1..].iter().copied() {
            let [one, other] = [first, second].map(|at| image.covariance[(at, at)].sqrt());
            pairs.push(Pair {
                image: &image.id,
                unknowns: [first, second].map(name),
                correlation: image.covariance[(first, second)] / (one * other),
            });
        }
    }
    pairs
}

fn columns<'a>() -> Vec<Column<Pair<'a>>> {
    vec![
        column("image", Unit::None, "image identifier", |row: &Pair| {
            row.image.to_owned()
        }),
        column(
            "unknown",
            Unit::None,
            "an unknown: constant, linear or quadratic part of X, Y or Z, or of a rotation about a camera axis",
            |row: &Pair| row.unknowns[0].clone(),
        ),
        column(
            "other_unknown",
            Unit::None,
            "another unknown of the same image",
            |row: &Pair| row.unknowns[1].clone(),
        ),
        column(
            "correlation",
            Unit::None,
            "correlation of the two unknowns, -1 to 1; beyond ±0.95, do not interpret single values",
            |row: &Pair| row.correlation,
        ),
    ]
}
