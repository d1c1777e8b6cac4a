//! Blunders in a brick: the largest deviations, and the solution without them.

use super::{
    Place,
    bricks::{Figure, brick},
    net::{Net, Part, PlaneError},
};

/// Robust standard deviations beyond which a deviation is flagged.
pub const FLAG_LIMIT: f64 = 3.5;
/// Factor from the median of absolute normal values to their standard deviation.
const NORMAL_MEDIAN: f64 = 1.4826;
/// Deviations below this share of a figure's extent are rounding.
const ROUNDING: f64 = 1e-9;
/// A removal is kept when it reduces the root mean square by more than this share.
const DROP: f64 = 0.30;
/// Measurements removed together where one reduces it too little: blunders of one size mask each other.
const TOGETHER: usize = 4;

/// A measurement removed from its brick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blunder {
    /// Index of the measurement; for a point on two pictures the first of both, which are not separable.
    pub measurement: usize,
    /// Its deviation when it was removed, figure units.
    pub deviation: Place,
    /// Root mean square of the brick's deviations before the removal and after it, figure units.
    pub rms: [f64; 2],
    /// Whether the whole point was removed, as it was on two pictures.
    pub whole_point: bool,
}

/// A brick without its blunders.
#[derive(Debug, Clone, PartialEq)]
pub struct Cleaned {
    /// The brick.
    pub figure: Figure,
    /// Removed measurements, in order.
    pub blunders: Vec<Blunder>,
    /// Indices of all removed measurements.
    pub removed: Vec<usize>,
}

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
    NORMAL_MEDIAN * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Solves a brick, removes the worst flagged deviation and solves again, as long as that reduces the root mean square
/// by more than 30 %.
///
/// A removal that reduces it less is tried with the next ones, up to four together. A point on two pictures is removed
/// as a whole.
///
/// # Errors
/// Those of [`brick`], for the net as it is given.
pub fn clean(net: &Net, pictures: &[usize]) -> Result<Cleaned, PlaneError> {
    let Part {
        net: part,
        points,
        measurements,
    } = net.part(pictures);
    let all: Vec<usize> = (0..pictures.len()).collect();
    let figure = brick(&part, &all).map_err(|error| error.of_part(&points, pictures))?;
    let mut best = State {
        figure,
        blunders: Vec::new(),
        kept: measurements.clone(),
        net: part,
    };
    loop {
        let before = best.rms();
        let (mut trial, mut accepted) = (None, None);
        for _ in 0..TOGETHER {
            let Some(worse) = trial.as_ref().unwrap_or(&best).without_the_worst(&all) else {
                break;
            };
            if worse.rms() < (1.0 - DROP) * before {
                accepted = Some(worse);
                break;
            }
            trial = Some(worse);
        }
        match accepted {
            Some(better) => best = better,
            None => break,
        }
    }
    let removed = measurements.iter().copied();
    Ok(Cleaned {
        removed: removed
            .filter(|index| best.kept.binary_search(index).is_err())
            .collect(),
        figure: best.figure.in_net(pictures, &points, &best.kept),
        blunders: best.blunders,
    })
}

/// An intermediate state of a part of a net.
struct State {
    figure: Figure,
    blunders: Vec<Blunder>,
    net: Net,
    /// Its measurements in the whole net.
    kept: Vec<usize>,
}

impl State {
    /// Root mean square of a coordinate of points on several pictures.
    fn rms(&self) -> f64 {
        let tied = self.tied();
        let squares: f64 = tied.iter().map(|(_, deviation)| deviation.norm_sqr()).sum();
        (squares / (2 * tied.len()).max(1) as f64).sqrt()
    }

    /// Deviations of points that several pictures of the brick show.
    fn tied(&self) -> Vec<(usize, Place)> {
        let mut count = vec![0; self.net.points];
        for (index, _) in &self.figure.deviations {
            count[self.net.measurements[*index].point] += 1;
        }
        let tied = self.figure.deviations.iter();
        let tied = tied.filter(|(index, _)| count[self.net.measurements[*index].point] > 1);
        tied.copied().collect()
    }

    /// The brick without its worst deviation, if that is flagged and the rest remains connected.
    fn without_the_worst(&self, all: &[usize]) -> Option<Self> {
        let tied = self.tied();
        let sigma = robust_sigma(tied.iter().map(|(_, deviation)| *deviation));
        let limit = (FLAG_LIMIT * sigma).max(ROUNDING * self.figure.extent());
        let worst = tied.iter().copied();
        let worst = worst.reduce(|a, b| if b.1.norm() > a.1.norm() { b } else { a });
        let (index, deviation) = worst.filter(|(_, of)| of.norm() > limit)?;
        let point = self.net.measurements[index].point;
        let of_point = |index: &usize| self.net.measurements[*index].point == point;
        let whole_point = tied.iter().filter(|(index, _)| of_point(index)).count() == 2;
        let goes = |at: usize| at == index || whole_point && of_point(&at);
        let mut net = self.net.clone();
        let mut at = 0;
        net.measurements.retain(|_| {
            at += 1;
            !goes(at - 1)
        });
        let figure = brick(&net, all).ok()?;
        let kept = self.kept.iter().enumerate();
        let mut without = Self {
            figure,
            blunders: self.blunders.clone(),
            kept: kept
                .filter(|(at, _)| !goes(*at))
                .map(|(_, index)| *index)
                .collect(),
            net,
        };
        without.blunders.push(Blunder {
            measurement: self.kept[index],
            deviation,
            rms: [self.rms(), without.rms()],
            whole_point,
        });
        Some(without)
    }
}
