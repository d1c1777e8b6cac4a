//! Rigid parts of a net: bodies that keep their places against each other.
//!
//! Two bodies with two points in common are one. A part that hangs on a single point can turn and change its size, and
//! as the residuals of its ties shrink with it, an adjustment shrinks it to that point: noise alone keeps the equations
//! from being singular.

use std::collections::{BTreeMap, BTreeSet};

use super::net::Net;

/// The rigid part of each of `bodies` bodies, named by its first one. `points` are the bodies that show each point.
///
/// Bodies with two points in common are joined, with the points of both, until no two have. Parts that hold only by
/// three or more single points of each other, as four pictures of which every two share one point, stay apart.
pub(super) fn rigid_parts(bodies: usize, points: &[Vec<usize>]) -> Vec<usize> {
    let mut part: Vec<usize> = (0..bodies).collect();
    loop {
        let mut common: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for bodies in points {
            let parts: BTreeSet<usize> = bodies.iter().map(|body| part[*body]).collect();
            for (one, two) in pairs(&parts) {
                *common.entry((one, two)).or_default() += 1;
            }
        }
        let mut joined = false;
        for ((one, two), _) in common.into_iter().filter(|(_, count)| *count > 1) {
            let (one, two) = (root(&mut part, one), root(&mut part, two));
            part[one.max(two)] = one.min(two);
            joined |= one != two;
        }
        if !joined {
            return part;
        }
        for body in 0..bodies {
            part[body] = root(&mut part, body);
        }
    }
}

fn pairs(of: &BTreeSet<usize>) -> impl Iterator<Item = (usize, usize)> {
    of.iter()
        .flat_map(|one| of.range(one + 1..).map(|two| (*one, *two)))
}

fn root(part: &mut [usize], mut of: usize) -> usize {
    while part[of] != of {
        part[of] = part[part[of]];
        of = part[of];
    }
    of
}

/// A picture that was tied in a brick other than its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moved {
    /// The picture.
    pub picture: usize,
    /// Index of its own brick.
    pub from: usize,
    /// Index of the other one.
    pub to: usize,
}

/// Moves pictures that hang on one point in their brick, or on none, to the brick with which they have most points in
/// common, at least two; a brick keeps its largest rigid part. Pictures that no other brick holds stay.
pub fn settle_bricks(net: &Net, bricks: &mut [Vec<usize>]) -> Vec<Moved> {
    let mut all: Vec<Moved> = Vec::new();
    // A picture is moved once at most.
    for _ in 0..net.pictures {
        let loose: Vec<Vec<usize>> = bricks.iter().map(|brick| loose(net, brick)).collect();
        let mut holder = vec![None; net.pictures];
        for (index, (brick, loose)) in bricks.iter().zip(&loose).enumerate() {
            for picture in brick.iter().filter(|picture| !loose.contains(picture)) {
                holder[*picture] = Some(index);
            }
        }
        let best = loose.iter().enumerate().flat_map(|(from, pictures)| {
            let holder = &holder;
            let unmoved = |picture: &&usize| !all.iter().any(|moved| moved.picture == **picture);
            pictures.iter().filter(unmoved).filter_map(move |picture| {
                let (to, common) = most_common(net, *picture, holder)?;
                let moved = Moved {
                    picture: *picture,
                    from,
                    to,
                };
                (to != from && common > 1).then_some((common, moved))
            })
        });
        // The first of those with most points.
        let best = best.reduce(|best, next| if next.0 > best.0 { next } else { best });
        let Some((_, moved)) = best else {
            break;
        };
        bricks[moved.from].retain(|picture| *picture != moved.picture);
        bricks[moved.to].push(moved.picture);
        bricks[moved.to].sort_unstable();
        all.push(moved);
    }
    all
}

/// Pictures of a brick outside its largest rigid part.
fn loose(net: &Net, brick: &[usize]) -> Vec<usize> {
    let mut place = vec![None; net.pictures];
    for (index, picture) in brick.iter().enumerate() {
        place[*picture] = Some(index);
    }
    let mut points: Vec<Vec<usize>> = vec![Vec::new(); net.points];
    for measured in &net.measurements {
        points[measured.point].extend(place[measured.picture]);
    }
    let part = rigid_parts(brick.len(), &points);
    let size = |of: usize| part.iter().filter(|part| **part == of).count();
    // The first of the largest.
    let largest = part.iter().copied();
    let largest = largest.reduce(|best, next| if size(next) > size(best) { next } else { best });
    let outside = brick.iter().zip(&part);
    outside
        .filter(|(_, part)| Some(**part) != largest)
        .map(|(picture, _)| *picture)
        .collect()
}

/// The brick whose held pictures show most points of a picture, and how many.
fn most_common(net: &Net, picture: usize, holder: &[Option<usize>]) -> Option<(usize, usize)> {
    let own = net.measurements.iter();
    let own: BTreeSet<usize> = own
        .filter(|measured| measured.picture == picture)
        .map(|measured| measured.point)
        .collect();
    let mut seen: BTreeSet<(usize, usize)> = BTreeSet::new();
    for measured in &net.measurements {
        if let Some(brick) = holder[measured.picture]
            && own.contains(&measured.point)
        {
            seen.insert((brick, measured.point));
        }
    }
    let mut count: BTreeMap<usize, usize> = BTreeMap::new();
    for (brick, _) in seen {
        *count.entry(brick).or_default() += 1;
    }
    count
        .into_iter()
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
}
