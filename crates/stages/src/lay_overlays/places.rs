//! Selection of the places that are shown: footprints spread over every pair of images, the tie points with the largest
//! residuals, and those that were rejected.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::{LayOverlays, MeasuredTies};
use crate::{
    adjust::{Adjusted, PointKind, RejectionReason},
    group_profiles::Profile,
    intersect::IntersectedTies,
    register::ImageRegistration,
    site_image::SiteImage,
};
use areograph_base::{error::Result, footprints::Footprints, frames::BodyFixed, ties::TiePoint};
use areograph_geom::ellipsoid::spherical_to_xyz_m;

/// Footprints of a pair of images.
const FOOTPRINTS_OF_PAIR: usize = 4;
/// Footprints of all pairs.
const FOOTPRINTS_MAX: usize = 8;
/// Tie points with the largest residuals, and rejected ones.
const TIES_MAX: usize = 6;

/// The subject of a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Subject {
    /// A footprint.
    Footprint {
        /// Index of its profile.
        profile: usize,
        /// Number of the shot in the profile, from 1.
        number: usize,
        /// Row of the footprint.
        row: u32,
    },
    /// A tie point.
    Tie {
        /// Its identifier.
        id: String,
        /// Its residual, or the reason of its rejection.
        why: String,
        /// Whether it was rejected.
        is_rejected: bool,
    },
}

/// A place that is to be shown.
#[derive(Debug)]
pub(super) struct Wanted {
    pub(super) subject: Subject,
    /// Its position with the orientation from the kernels and with the adjusted orientation.
    pub(super) ground_m: [Option<Vector3<f64>>; 2],
    /// Images, with line and sample where it was measured in them.
    pub(super) images: Vec<(usize, Option<Vector2<f64>>)>,
}

/// The places of a site.
///
/// # Errors
/// An earlier stage without output.
pub(super) fn wanted(site: &LayOverlays, has_pixels: &[bool]) -> Result<Vec<Wanted>> {
    let images = match site.adjusted_images.0 {
        [] => site.images.0,
        adjusted => adjusted,
    };
    let registrations = images
        .iter()
        .map(|image: &SiteImage| image.registration.value());
    let registrations = registrations.collect::<Result<Vec<_>>>()?;
    let footprints = &site.converted.value()?.footprints;
    let mut wanted = of_footprints(
        &registrations,
        site.profiles.value()?,
        footprints,
        has_pixels,
    );
    if let Some(ties) = &site.ties {
        wanted.extend(of_ties(ties, has_pixels)?);
    }
    Ok(wanted)
}

/// Footprints that two images with pixels show; for an image without such a partner, those that it shows itself.
fn of_footprints(
    registrations: &[&ImageRegistration],
    profiles: &[Profile],
    footprints: &Footprints<BodyFixed>,
    has_pixels: &[bool],
) -> Vec<Wanted> {
    let with_pixels = || (0..registrations.len()).filter(|image| has_pixels[*image]);
    let seen: BTreeMap<usize, Inside> = with_pixels()
        .map(|image| (image, inside(registrations[image])))
        .collect();
    let mut groups: Vec<(Vec<usize>, Inside)> = Vec::new();
    for (one, rows) in &seen {
        for (other, others) in seen.range(one + 1..) {
            let common = rows.iter().filter(|(row, _)| others.contains_key(row));
            groups.push((
                vec![*one, *other],
                common.map(|(row, at)| (*row, *at)).collect(),
            ));
        }
    }
    groups.retain(|(_, common)| !common.is_empty());
    // Groups with most in common first; equal ones in the order of the images.
    groups.sort_by_key(|(_, common)| std::cmp::Reverse(common.len()));
    let paired: BTreeSet<usize> = groups
        .iter()
        .flat_map(|(images, _)| images.clone())
        .collect();
    let alone = seen
        .into_iter()
        .filter(|(image, _)| !paired.contains(image));
    groups.extend(alone.map(|(image, rows)| (vec![image], rows)));
    let shown = groups.into_iter().flat_map(|(images, rows)| {
        let images: Vec<_> = images.into_iter().map(|image| (image, None)).collect();
        spread(&rows)
            .into_iter()
            .map(move |place| (place, images.clone()))
    });
    let shown = shown.take(FOOTPRINTS_MAX);
    shown
        .filter_map(|((profile, row), images)| {
            let profile = profile as usize;
            let number = profiles
                .get(profile)?
                .rows
                .iter()
                .position(|of| *of == row)?
                + 1;
            let ground_m = ground_m(footprints, row);
            Some(Wanted {
                subject: Subject::Footprint {
                    profile,
                    number,
                    row,
                },
                ground_m: [Some(ground_m); 2],
                images,
            })
        })
        .collect()
}

/// Lines of the footprints inside an image, by profile and row.
type Inside = BTreeMap<(u32, u32), f64>;

fn inside(registration: &ImageRegistration) -> Inside {
    let points = &registration.points;
    let inside = (0..points.len()).filter(|at| points.inside.at(*at));
    inside
        .map(|at| {
            (
                (points.profile.at(at), points.row.at(at)),
                points.line.at(at),
            )
        })
        .collect()
}

/// Some of the footprints, evenly spread over the lines where there are any.
fn spread(rows: &Inside) -> Vec<(u32, u32)> {
    let mut by_line: Vec<_> = rows.iter().collect();
    by_line.sort_by(|one, other| one.1.total_cmp(other.1));
    let count = FOOTPRINTS_OF_PAIR.min(by_line.len());
    let places = (0..count).map(|part| (2 * part + 1) * by_line.len() / (2 * count));
    places.map(|place| *by_line[place].0).collect()
}

/// Position of a footprint, metres.
fn ground_m(footprints: &Footprints<BodyFixed>, row: u32) -> Vector3<f64> {
    let row = row as usize;
    spherical_to_xyz_m(
        footprints.longitude_rad.at(row),
        footprints.latitude_rad.at(row),
        footprints.radius_m.at(row),
    )
}

/// A tie point, how suspicious it is, and why.
struct Suspect {
    tie: usize,
    size: f64,
    why: String,
    is_rejected: bool,
}

/// The tie points with the largest residuals, and the rejected ones.
fn of_ties(measured: &MeasuredTies, has_pixels: &[bool]) -> Result<Vec<Wanted>> {
    let ties = &measured.ties.value()?.points;
    let before = measured.intersected.value()?;
    let (suspects, after) = match measured.adjusted {
        Some((adjusted, intersected)) => {
            (of_adjustment(adjusted.value()?), Some(intersected.value()?))
        }
        None => (of_intersection(before), None),
    };
    let mut wanted = Vec::new();
    for is_rejected in [false, true] {
        let mut own: Vec<&Suspect> = suspects
            .iter()
            .filter(|suspect| suspect.is_rejected == is_rejected)
            .collect();
        own.sort_by(|one, other| {
            other
                .size
                .total_cmp(&one.size)
                .then(one.tie.cmp(&other.tie))
        });
        let shown = own.into_iter().filter_map(|suspect| {
            let tie = ties.get(suspect.tie)?;
            let images = with_pixels(tie, has_pixels);
            let ground = |of: &IntersectedTies| {
                let point = of.points.iter().find(|point| point.tie == suspect.tie)?;
                Some(point.ground.xyz_m)
            };
            (images.len() > 1).then(|| Wanted {
                subject: Subject::Tie {
                    id: tie.id.clone(),
                    why: suspect.why.clone(),
                    is_rejected,
                },
                ground_m: [ground(before), after.and_then(ground)],
                images,
            })
        });
        wanted.extend(shown.take(TIES_MAX));
    }
    Ok(wanted)
}

/// The first two images with pixels in which a tie point was measured.
fn with_pixels(tie: &TiePoint, has_pixels: &[bool]) -> Vec<(usize, Option<Vector2<f64>>)> {
    let measures = tie
        .measures
        .iter()
        .filter(|measure| has_pixels[measure.image]);
    let places = measures.map(|measure| {
        (
            measure.image,
            Some(Vector2::new(measure.line, measure.sample)),
        )
    });
    places.take(2).collect()
}

fn of_adjustment(adjusted: &Adjusted) -> Vec<Suspect> {
    let mut largest: BTreeMap<usize, f64> = BTreeMap::new();
    for view in adjusted
        .views
        .iter()
        .filter(|view| view.kind == PointKind::Tie)
    {
        let residuals = [view.along_px.standardised, view.across_px.standardised];
        let size = residuals
            .into_iter()
            .flatten()
            .map(f64::abs)
            .fold(0.0, f64::max);
        let tie = adjusted.points[view.point].index;
        let known = largest.entry(tie).or_default();
        *known = known.max(size);
    }
    let kept = largest.into_iter().map(|(tie, size)| Suspect {
        tie,
        size,
        why: format!("standardised residual {size:.1}"),
        is_rejected: false,
    });
    let rejected = adjusted
        .rejected
        .iter()
        .filter(|point| point.kind == PointKind::Tie);
    let rejected = rejected.map(|point| Suspect {
        tie: point.index,
        size: match point.reason {
            RejectionReason::Blunder { standardised }
            | RejectionReason::Height { standardised, .. } => standardised,
            RejectionReason::NotIntersected | RejectionReason::Undetermined => f64::INFINITY,
        },
        why: point.reason.to_string(),
        is_rejected: true,
    });
    kept.chain(rejected).collect()
}

fn of_intersection(intersected: &IntersectedTies) -> Vec<Suspect> {
    let points = intersected.points.iter().map(|point| {
        let lines = point
            .measures
            .iter()
            .map(|measure| measure.reprojection_lines.abs());
        let size = lines.fold(0.0, f64::max);
        Suspect {
            tie: point.tie,
            size,
            why: format!("reprojection residual {size:.1} lines"),
            is_rejected: false,
        }
    });
    let rejected = intersected.rejected.iter().map(|tie| Suspect {
        tie: tie.tie,
        size: 0.0,
        why: tie.reason.to_string(),
        is_rejected: true,
    });
    points.chain(rejected).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_footprints_are_spread_over_the_lines() {
        let rows: Inside = (0..100)
            .map(|row| ((0, row), f64::from(99 - row)))
            .collect();
        let lines: Vec<f64> = spread(&rows).iter().map(|key| rows[key]).collect();
        assert_eq!(lines, [12.0, 37.0, 62.0, 87.0]);
        let few: Inside = [((0, 3), 5.0), ((1, 2), 1.0)].into();
        assert_eq!(spread(&few), [(1, 2), (0, 3)]);
        assert_eq!(spread(&Inside::new()), []);
    }
}
