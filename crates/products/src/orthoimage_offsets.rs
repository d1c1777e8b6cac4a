//! Offsets between orthoimages, place by place, as CSV.

use std::collections::BTreeMap;

use super::{
    product::{Content, Declaration, Role, Write},
    site::SiteProducts,
    table::{Column, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::{error::Result, units::RADIANS_PER_DEGREE};
use areograph_stages::compare_orthoimages::{OrthoimageOffsets, PlaceOffset};
use areograph_store::stage::Round;

/// The product; a capability lists it.
pub static ORTHOIMAGE_OFFSETS: Declaration = Declaration {
    path: "orthoimage_offsets.csv",
    what: "offsets between the orthoimages of every two overlapping images at places on an even grid, before and after the \
           adjustment, by cross-correlation; no offset takes part in another product",
    readers: "scripts",
    rows: "places of a pair of orthoimages",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: Write::Where {
        sites: "a site with overlapping orthoimages",
        has: |site| {
            [Round::Initial, Round::Adjusted]
                .iter()
                .any(|round| !matches!(of_round(site, *round), Ok([])))
        },
        write: |path, of| {
            let table = Table::new(columns(), rows(of.site)?);
            text_table::write(path, table)
        },
    },
    uses: &[],
};

/// The offsets with the orientation of this round; empty if the site has none.
fn of_round<'a>(site: &SiteProducts<'a>, round: Round) -> Result<&'a [OrthoimageOffsets]> {
    let found = site.book.find::<Vec<OrthoimageOffsets>>(round)?;
    Ok(found.map_or(&[], Vec::as_slice))
}

/// A place of a pair.
struct Row<'a> {
    images: [&'a str; 2],
    place_rad: [f64; 2],
    before: Option<PlaceOffset>,
    after: Option<PlaceOffset>,
}

/// All places by pair and cell.
fn rows<'a>(site: &SiteProducts<'a>) -> Result<Vec<Row<'a>>> {
    let mut rows: BTreeMap<([usize; 2], [i64; 2]), Row<'a>> = BTreeMap::new();
    for (round, is_after) in [(Round::Initial, false), (Round::Adjusted, true)] {
        for pair in of_round(site, round)? {
            for place in &pair.places {
                let row = rows
                    .entry((pair.images, place.cell))
                    .or_insert_with(|| Row {
                        images: pair.images.map(|image| &*site.images[image].times.id),
                        place_rad: place.place_rad,
                        before: None,
                        after: None,
                    });
                let offset = if is_after {
                    &mut row.after
                } else {
                    &mut row.before
                };
                *offset = Some(*place);
            }
        }
    }
    Ok(rows.into_values().collect())
}

fn columns<'a>() -> Vec<Column<Row<'a>>> {
    let mut columns = vec![
        column(
            "first_image",
            Unit::None,
            "identifier of the image of the first orthoimage",
            |row: &Row| row.images[0].to_owned(),
        ),
        column(
            "second_image",
            Unit::None,
            "identifier of the image of the second orthoimage",
            |row: &Row| row.images[1].to_owned(),
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude in the first orthoimage",
            |row: &Row| row.place_rad[0] / RADIANS_PER_DEGREE,
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude in the first orthoimage",
            |row: &Row| row.place_rad[1] / RADIANS_PER_DEGREE,
        ),
    ];
    columns.extend(of_state(
        [
            ("before_east_m", "position of the same ground in the second orthoimage minus that in the first, towards east, with the orientation from the kernels; empty where it was not computed or does not match"),
            ("before_north_m", "as before_east_m, towards north"),
            ("before_east_sigma_m", "standard deviation of before_east_m"),
            ("before_north_sigma_m", "standard deviation of before_north_m"),
            ("before_correlation", "normalised cross-correlation there, at most 1"),
        ],
        |row| row.before,
    ));
    columns.extend(of_state(
        [
            ("after_east_m", "position of the same ground in the second orthoimage minus that in the first, towards east, with the adjusted orientation; empty without an adjustment, or where it does not match"),
            ("after_north_m", "as after_east_m, towards north"),
            ("after_east_sigma_m", "standard deviation of after_east_m"),
            ("after_north_sigma_m", "standard deviation of after_north_m"),
            ("after_correlation", "normalised cross-correlation there, at most 1"),
        ],
        |row| row.after,
    ));
    columns
}

/// Columns of an offset: east, north, their standard deviations, correlation.
fn of_state<'a>(
    names: [(&'static str, &'static str); 5],
    of: fn(&Row<'_>) -> Option<PlaceOffset>,
) -> impl Iterator<Item = Column<Row<'a>>> {
    let values: [fn(&PlaceOffset) -> f64; 5] = [
        |of| of.offset_m[0],
        |of| of.offset_m[1],
        |of| of.sigma_m[0],
        |of| of.sigma_m[1],
        |of| of.correlation,
    ];
    names
        .into_iter()
        .zip(values)
        .map(move |((name, what), value)| {
            let unit = if name.ends_with("_m") {
                Unit::Metre
            } else {
                Unit::None
            };
            column(name, unit, what, move |row: &Row<'_>| {
                of(row).map(|of| value(&of))
            })
        })
}
