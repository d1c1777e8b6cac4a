//! Blunders: measurements that contradict the adjustment of the complete net more than chance explains.
//!
//! A deviation is judged by its own standard deviation, which is small where a measurement alone holds a picture.
//! Compared with the deviations of others only, the far ties of a picture that hangs on points close together would look
//! wrong, although they are right and carry it.

use std::collections::{BTreeMap, BTreeSet};

use crate::statistics::NORMAL_MAD;

use super::{
    Place,
    bricks::rough_guesses,
    net::{Net, PlaneError},
    solve::{Solution, solve},
};

/// Robust standard deviations beyond which a deviation within a brick is flagged.
pub const FLAG_LIMIT: f64 = 3.5;
/// Probability that a net without blunders loses a measurement.
const FALSE_ALARM: f64 = 0.01;
/// Measurements of less redundancy are not tested: their errors leave no deviation.
const REDUNDANCY_MIN: f64 = 1e-6;
/// Deviations below this share of a figure's extent are rounding.
const ROUNDING: f64 = 1e-9;

/// Standard deviation of a coordinate from the median of the absolute values; 0 without any.
#[must_use]
pub fn robust_sigma(deviations: impl Iterator<Item = Place>) -> f64 {
    let mut sizes: Vec<f64> = deviations
        .flat_map(|deviation| [deviation.re.abs(), deviation.im.abs()])
        .collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    NORMAL_MAD * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The measurements of a net that are blunders, ascending, by their deviations in the adjustment of all pictures without
/// controls.
///
/// The largest standardised deviations are removed, deviations of different pictures at once, and the net is adjusted
/// again, until none exceeds what chance leaves in one net of a hundred. A removed measurement that agrees with the
/// others at the end is restored. Both measurements of a point on two pictures are removed: the deviation does not
/// identify which is wrong. A measurement without which a picture would be free stays.
///
/// # Errors
/// [`PlaneError`] for a net without a solution.
/// # Source
/// Baarda 1968, *A testing procedure for use in geodetic networks* (data snooping), with a robust standard deviation.
pub fn find_blunders(net: &Net) -> Result<Vec<usize>, PlaneError> {
    let mut search = Search {
        net,
        removed: BTreeSet::new(),
        fixed: BTreeSet::new(),
        confirmed: BTreeSet::new(),
        adjusted: Adjusted::without(net, &BTreeSet::new())?,
    };
    // No measurement is removed, or tried again, twice: restored ones are fixed, and what was tried is confirmed.
    while search.remove() || search.restore() {}
    Ok(search.removed.into_iter().collect())
}

struct Search<'a> {
    net: &'a Net,
    removed: BTreeSet<usize>,
    /// Measurements that remain: restored ones, and those without which the net would have no solution.
    fixed: BTreeSet<usize>,
    /// Removed measurements that are not tried again.
    confirmed: BTreeSet<usize>,
    adjusted: Adjusted,
}

impl Search<'_> {
    /// Removes the worst measurements, of different pictures; returns whether there were any.
    fn remove(&mut self) -> bool {
        let tested = self.adjusted.tested();
        let limit = self.adjusted.limit(&tested);
        let mut flagged: Vec<(usize, f64)> = tested
            .into_iter()
            .map(|(index, of)| (index, of.norm()))
            .filter(|(index, size)| *size > limit && !self.fixed.contains(index))
            .collect();
        flagged.sort_by(|one, two| two.1.total_cmp(&one.1).then(one.0.cmp(&two.0)));
        let (mut groups, mut busy) = (Vec::new(), BTreeSet::new());
        for (index, _) in flagged {
            let of_point = self.adjusted.of_point(self.net.measurements[index].point);
            let pictures: Vec<usize> = of_point
                .iter()
                .map(|at| self.net.measurements[*at].picture)
                .collect();
            if pictures.iter().any(|picture| busy.contains(picture)) {
                continue;
            }
            busy.extend(pictures);
            let both = of_point.len() == 2;
            groups.push(if both { of_point } else { vec![index] });
        }
        if !self.go_on(self.and(&groups.concat())) {
            for group in &groups {
                if !self.go_on(self.and(group)) {
                    self.fixed.extend(group);
                }
            }
        }
        !groups.is_empty()
    }

    /// Restores removed measurements, of different pictures, that agree with the others once they take part again; returns
    /// whether any was left to try.
    fn restore(&mut self) -> bool {
        let limit = self.adjusted.limit(&self.adjusted.tested());
        let (mut groups, mut busy) = (Vec::new(), BTreeSet::new());
        for (group, kept) in self.left_to_try() {
            // One that cannot agree would disturb those that are tried with it.
            if self.adjusted.apart(self.net, &group, &kept) > limit {
                self.confirmed.extend(group);
                continue;
            }
            let of_point = group.iter().chain(&kept);
            let pictures: Vec<usize> = of_point
                .map(|at| self.net.measurements[*at].picture)
                .collect();
            if !pictures.iter().any(|picture| busy.contains(picture)) {
                busy.extend(pictures);
                groups.push(group);
            }
        }
        let tried: BTreeSet<usize> = groups.iter().flatten().copied().collect();
        let others = self.removed.difference(&tried).copied().collect();
        if let Ok(with) = Adjusted::without(self.net, &others) {
            let tested: BTreeMap<usize, Place> = with.tested().into_iter().collect();
            let agrees = |at: &usize| tested.get(at).is_some_and(|of| of.norm() <= limit);
            for group in groups.iter().filter(|group| group.iter().all(agrees)) {
                self.fixed.extend(group);
            }
        }
        // Also where they cannot be restored, so that none is tried twice.
        self.confirmed.extend(&tried);
        let removed: BTreeSet<usize> = self.removed.difference(&self.fixed).copied().collect();
        if removed.len() < self.removed.len() {
            self.go_on(removed);
        }
        !groups.is_empty()
    }

    /// Removed measurements that are not confirmed, all of a point together where it has no others, and those others.
    fn left_to_try(&self) -> Vec<(Vec<usize>, Vec<usize>)> {
        let mut of_points: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for index in self.removed.difference(&self.confirmed) {
            let point = self.net.measurements[*index].point;
            of_points.entry(point).or_default().push(*index);
        }
        let mut groups = Vec::new();
        for (point, gone) in of_points {
            let kept = self.adjusted.of_point(point);
            if kept.is_empty() {
                groups.push((gone, kept));
            } else {
                groups.extend(gone.into_iter().map(|one| (vec![one], kept.clone())));
            }
        }
        groups
    }

    fn and(&self, these: &[usize]) -> BTreeSet<usize> {
        self.removed.iter().chain(these).copied().collect()
    }

    /// Adjusts the net without these, if it has a solution.
    fn go_on(&mut self, removed: BTreeSet<usize>) -> bool {
        let adjusted = Adjusted::without(self.net, &removed);
        adjusted.is_ok_and(|adjusted| {
            self.adjusted = adjusted;
            self.removed = removed;
            true
        })
    }
}

/// The adjustment of a net without some measurements, in its own figure.
struct Adjusted {
    net: Net,
    /// Its measurements in the complete net.
    indices: Vec<usize>,
    of_point: Vec<Vec<usize>>,
    solution: Solution,
}

impl Adjusted {
    fn without(whole: &Net, removed: &BTreeSet<usize>) -> Result<Self, PlaneError> {
        let (mut net, indices) = whole.kept(|index| !removed.contains(&index));
        net.controls = rough_guesses(&net);
        Ok(Self {
            solution: solve(&net)?,
            of_point: Solution::measurements_of(&net),
            net,
            indices,
        })
    }

    /// Measurements of points on several pictures, and their deviations over the root of their redundancy.
    fn tested(&self) -> Vec<(usize, Place)> {
        let precision = self.solution.precision();
        let deviations = self.solution.deviations.iter().enumerate();
        let tested = deviations.filter_map(|(at, deviation)| {
            let of = &self.of_point[self.net.measurements[at].point];
            let redundancy = (of.len() > 1).then(|| precision.deviation(&self.net, of, at))?;
            let tested = redundancy > REDUNDANCY_MIN;
            tested.then(|| (self.indices[at], deviation / redundancy.sqrt()))
        });
        tested.collect()
    }

    /// Size of a standardised deviation that the largest of all exceeds by chance in one net of a hundred.
    fn limit(&self, tested: &[(usize, Place)]) -> f64 {
        let sigma = robust_sigma(tested.iter().map(|(_, of)| *of));
        let mut places = self.solution.places.iter().flatten();
        let first = places.next().copied().unwrap_or_default();
        let extent = places.map(|of| (of - first).norm()).fold(0.0, f64::max);
        // The size of a deviation of two normal coordinates follows Rayleigh's distribution.
        let limit = (2.0 * (tested.len().max(1) as f64 / FALSE_ALARM).ln()).sqrt();
        (limit * sigma).max(ROUNDING * extent)
    }

    /// The kept measurements of a point, in the complete net.
    fn of_point(&self, point: usize) -> Vec<usize> {
        let of = self.of_point[point].iter();
        of.map(|at| self.indices[*at]).collect()
    }

    /// Distance of removed measurements of a point from the mean of the kept ones, or of each other, over the largest
    /// standard deviation that it can have: covariances of pictures without a common point are not at hand.
    fn apart(&self, whole: &Net, group: &[usize], kept: &[usize]) -> f64 {
        let precision = self.solution.precision();
        let Some((one, rest)) = group.split_first() else {
            return 0.0;
        };
        let others = if kept.is_empty() { rest } else { kept };
        let share = 1.0 / others.len().max(1) as f64;
        let (mut apart, mut sigma) = (Place::new(0.0, 0.0), 0.0);
        for (index, share) in others.iter().map(|at| (at, -share)).chain([(one, 1.0)]) {
            let of = &whole.measurements[*index];
            apart += self.solution.pictures[of.picture].map(of.at) * share;
            sigma += share.abs() * precision.image(of).sqrt();
        }
        apart.norm() / (1.0 + share + sigma.powi(2)).sqrt()
    }
}
