//! Conditions that a net must satisfy before it is solved.

use super::{
    Place,
    net::{Net, PlaneError},
    rigid::rigid_parts,
};

/// Points closer than this share of the total extent are coincident.
const EQUAL: f64 = 1e-9;

/// Checks that every picture is tied to the net, every part of the net to two controls, and that no two points
/// coincide. `loose_picture` finds parts that hang on one point.
///
/// # Errors
/// [`PlaneError`]; for a part without controls its first picture.
pub fn check(net: &Net) -> Result<(), PlaneError> {
    equal_points(net)?;
    let (by_point, control_of) = (net.by_point(), net.control_of());
    equal_controls(net)?;
    let mut parts = Parts::new(net.pictures);
    let mut ties = vec![0; net.pictures];
    for (point, measured) in by_point.iter().enumerate() {
        if measured.len() < 2 && control_of[point].is_none() {
            continue;
        }
        for &index in measured {
            let picture = net.measurements[index].picture;
            ties[picture] += 1;
            parts.join(picture, net.measurements[measured[0]].picture);
        }
    }
    let seen = |point: usize| !by_point.get(point).is_empty();
    let shown: Vec<usize> = net
        .controls
        .iter()
        .map(|control| control.point)
        .filter(|point| seen(*point))
        .collect();
    if shown.len() < 2 {
        return Err(PlaneError::TooFewControls { found: shown.len() });
    }
    if let Some(picture) = (0..net.pictures).find(|picture| ties[*picture] < 2) {
        let ties = ties[picture];
        return Err(PlaneError::UnderconnectedPicture { picture, ties });
    }
    let mut controls = vec![0; net.pictures];
    for point in shown {
        let first = by_point.get(point)[0];
        controls[parts.root(net.measurements[first].picture)] += 1;
    }
    let loose = (0..net.pictures).find(|picture| controls[parts.root(*picture)] < 2);
    loose.map_or(Ok(()), |picture| {
        let ties = ties[picture];
        Err(PlaneError::UnderconnectedPicture { picture, ties })
    })
}

/// The first picture of the smallest part that shares fewer than two points with the others and the controls, with the
/// number of these points; `None` where the net is rigid.
pub(super) fn loose_picture(net: &Net) -> Option<PlaneError> {
    let map = net.pictures;
    let (by_point, control_of) = (net.by_point(), net.control_of());
    let points: Vec<Vec<usize>> = by_point
        .iter()
        .zip(&control_of)
        .map(|(measured, control)| {
            let pictures = measured.iter();
            let pictures = pictures.map(|index| net.measurements[*index].picture);
            pictures.chain(control.map(|_| map)).collect()
        })
        .collect();
    let part = rigid_parts(net.pictures + 1, &points);
    let mut size = vec![0; net.pictures + 1];
    for part in &part {
        size[*part] += 1;
    }
    let apart = (0..net.pictures).filter(|picture| part[*picture] != part[map]);
    let picture = apart.min_by_key(|picture| size[part[*picture]])?;
    // Points that pictures of one part share do not hold the part.
    let is_inside = |body: &usize| part[*body] == part[picture];
    let ties = points
        .iter()
        .filter(|bodies| bodies.iter().any(is_inside) && !bodies.iter().all(is_inside))
        .count();
    Some(PlaneError::UnderconnectedPicture { picture, ties })
}

fn equal_points(net: &Net) -> Result<(), PlaneError> {
    for (picture, measured) in net.by_picture().iter().enumerate() {
        let places = measured.iter();
        let places =
            places.map(|index| (net.measurements[*index].at, net.measurements[*index].point));
        if let Some((first, second)) = equal_pair(places.collect()) {
            return Err(PlaneError::EqualPoints {
                picture,
                first,
                second,
            });
        }
    }
    Ok(())
}

fn equal_controls(net: &Net) -> Result<(), PlaneError> {
    let places = net.controls.iter();
    let places = places.map(|control| (control.at, control.point));
    equal_pair(places.collect()).map_or(Ok(()), |(first, second)| {
        Err(PlaneError::EqualControls { first, second })
    })
}

/// Two coincident points, in the order in which they are named.
fn equal_pair(mut places: Vec<(Place, usize)>) -> Option<(usize, usize)> {
    places.sort_by(|(a, _), (b, _)| a.re.total_cmp(&b.re).then(a.im.total_cmp(&b.im)));
    let first = places.first()?.0;
    let extent = places
        .iter()
        .map(|(place, _)| (place - first).norm())
        .fold(0.0, f64::max);
    let pair = places
        .windows(2)
        .find(|pair| (pair[0].0 - pair[1].0).norm() <= EQUAL * extent)?;
    let (one, two) = (pair[0].1, pair[1].1);
    Some((one.min(two), one.max(two)))
}

/// The connected components of the pictures.
struct Parts(Vec<usize>);

impl Parts {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn root(&mut self, mut of: usize) -> usize {
        while self.0[of] != of {
            self.0[of] = self.0[self.0[of]];
            of = self.0[of];
        }
        of
    }

    fn join(&mut self, one: usize, two: usize) {
        let (one, two) = (self.root(one), self.root(two));
        self.0[one.max(two)] = one.min(two);
    }
}
