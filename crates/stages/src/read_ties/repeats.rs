//! Tie points that are one point under several names, and places that are measured as several points.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

use areograph_base::ties::{TieMeasure, TiePoint};
use areograph_pds::ties::ISIS_TO_EDGE;

/// Places closer than this are one, in pixels and lines: finer than any measurement, coarser than rounding in files.
const PLACE_PX: f64 = 0.001;

/// An image, a line and a sample.
type Place = (usize, i64, i64);

fn place(measure: &TieMeasure) -> Place {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a number that is too large saturates"
    )]
    let [line, sample] =
        [measure.line, measure.sample].map(|edge| (edge / PLACE_PX).round() as i64);
    (measure.image, line, sample)
}

/// Leaves out every point that was measured at the same places as an earlier one, and reports their number.
pub(super) fn leave_out(points: &mut Vec<TiePoint>) -> Option<String> {
    let mut known: BTreeMap<BTreeSet<Place>, String> = BTreeMap::new();
    let (mut repeated, mut example) = (0, None);
    points.retain(|point| {
        let places = point.measures.iter().map(place).collect();
        match known.get(&places) {
            None => {
                known.insert(places, point.id.clone());
                true
            }
            Some(first) => {
                repeated += 1;
                example.get_or_insert_with(|| format!("{}, a duplicate of {first}", point.id));
                false
            }
        }
    });
    example.map(|example| {
        format!(
            "{repeated} duplicate the measurements of another point and are omitted, for example {example}"
        )
    })
}

/// Places at which several points are measured, which then lie apart in other images.
#[derive(Debug)]
pub(super) struct SharedPlaces {
    /// Points at such places.
    pub(super) points: usize,
    /// Two of them, and where.
    example: String,
}

impl fmt::Display for SharedPlaces {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} are measured at the position of another point, for example {}",
            self.points, self.example
        )
    }
}

/// The points that share a place with another one; `name` gives the identifier of an image.
pub(super) fn shared_places<'a>(
    points: &[TiePoint],
    name: impl Fn(usize) -> &'a str,
) -> Option<SharedPlaces> {
    let mut first_at: BTreeMap<Place, usize> = BTreeMap::new();
    let (mut shared, mut example) = (BTreeSet::new(), None);
    for (index, point) in points.iter().enumerate() {
        for measure in &point.measures {
            let first = *first_at.entry(place(measure)).or_insert(index);
            if first != index {
                shared.extend([first, index]);
                example.get_or_insert_with(|| {
                    format!(
                        "{} and {} at line {:.2}, sample {:.2} of image {}",
                        points[first].id,
                        point.id,
                        measure.line - ISIS_TO_EDGE,
                        measure.sample - ISIS_TO_EDGE,
                        name(measure.image)
                    )
                });
            }
        }
    }
    example.map(|example| SharedPlaces {
        points: shared.len(),
        example,
    })
}
