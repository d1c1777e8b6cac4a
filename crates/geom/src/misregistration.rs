//! Misregistration of footprints between two images, with tie points as reference.

use nalgebra::{DMatrix, DVector};

use super::statistics::{Summary, outliers};

/// A feature in two images: line and sample in each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Line and sample in the first image.
    pub first: [f64; 2],
    /// Line and sample in the second image.
    pub second: [f64; 2],
}

/// The transformation from the first image to the second, from tie points.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageToImage {
    transformation: Transformation,
    /// Number of tie points used.
    pub ties: usize,
    /// Tie points rejected as outliers.
    pub ties_rejected: usize,
    /// Residuals of the tie points' lines.
    pub tie_lines: Summary,
    /// Residuals of the tie points' samples.
    pub tie_samples: Summary,
    /// First and last line of the tie points in the first image.
    ends: [f64; 2],
}

/// Misregistration of footprints between two images, lines and samples of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misregistration {
    /// Transformed minus projected line of every footprint.
    pub lines: Summary,
    /// Transformed minus projected sample of every footprint.
    pub samples: Summary,
    /// Standard deviation of the mean of `lines` from the scatter of the tie points.
    pub lines_sigma: f64,
    /// Footprints omitted because their line lies beyond the tie points.
    pub beyond_ties: usize,
}

/// More tie points than this determine a transformation of second order.
const SECOND_ORDER_ABOVE: usize = 50;
/// A tie point farther from the median residual than this many robust standard deviations is an outlier.
const OUTLIER_SIGMA: f64 = 5.0;
/// Maximum number of fits with outliers removed.
const ROUNDS: u32 = 10;

impl ImageToImage {
    /// The transformation that `ties` determine.
    ///
    /// It takes positions of the first image to the second, by polynomials of first order in line and sample, or of
    /// second order with more than 50 tie points; outliers are removed in successive rounds. `None` for fewer than four
    /// tie points, for collinear tie points, and for coordinates that are not finite.
    ///
    /// # Source
    /// Shan et al. 2005 compare features by eye; they find about one MOLA spacing along the flight.
    #[must_use]
    pub fn through(ties: &[Pair]) -> Option<Self> {
        let order = if ties.len() > SECOND_ORDER_ABOVE {
            2
        } else {
            1
        };
        let frame = Frame::of(ties)?;
        let mut used = ties.to_vec();
        let mut fit = Transformation::through(&used, frame, order)?;
        for _ in 0..ROUNDS {
            let bad = [0, 1].map(|axis| outliers(&fit.residuals(&used, axis), OUTLIER_SIGMA));
            if !bad.iter().flatten().any(|bad| *bad) {
                break;
            }
            let mut row = 0;
            used.retain(|_| {
                row += 1;
                !(bad[0][row - 1] || bad[1][row - 1])
            });
            fit = Transformation::through(&used, frame, order)?;
        }
        let lines = used.iter().map(|tie| tie.first[0]);
        let ends = lines.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], line| {
            [low.min(line), high.max(line)]
        });
        Some(Self {
            ties: used.len(),
            ties_rejected: ties.len() - used.len(),
            tie_lines: Summary::of(&fit.residuals(&used, 0)),
            tie_samples: Summary::of(&fit.residuals(&used, 1)),
            transformation: fit,
            ends,
        })
    }

    /// Order of the polynomials, 1 or 2.
    #[must_use]
    pub const fn order(&self) -> u8 {
        self.transformation.order
    }

    /// Line and sample of the second image conjugate to `first` in the first image; `None` beyond the lines of the tie
    /// points.
    #[must_use]
    pub fn second(&self, first: [f64; 2]) -> Option<[f64; 2]> {
        let [low, high] = self.ends;
        // A residual is the transformed minus the measured position.
        let pair = Pair {
            first,
            second: [0.0; 2],
        };
        let lead = |axis| self.transformation.residuals(&[pair], axis);
        (low <= first[0] && first[0] <= high).then(|| [0, 1].map(|axis| lead(axis)[0]))
    }

    /// Misregistration of `footprints` in the second image against the tie points.
    ///
    /// Relief moves a tie point across the track between images of different emission: only tie points near the profile
    /// are valid for its samples.
    #[must_use]
    pub fn misregistration(&self, footprints: &[Pair]) -> Misregistration {
        let [low, high] = self.ends;
        let between = |footprint: &&Pair| low <= footprint.first[0] && footprint.first[0] <= high;
        let seen: Vec<Pair> = footprints.iter().filter(between).copied().collect();
        let summary = |axis| Summary::of(&self.transformation.residuals(&seen, axis));
        Misregistration {
            lines: summary(0),
            samples: summary(1),
            lines_sigma: self.mean_sigma(&seen),
            beyond_ties: footprints.len() - seen.len(),
        }
    }

    /// Standard deviation of the mean transformed line of `pairs`, from the residuals of the tie points: relief that no
    /// polynomial follows counts as scatter. Zero without pairs.
    fn mean_sigma(&self, pairs: &[Pair]) -> f64 {
        let fit = &self.transformation;
        let mut mean = DVector::zeros(fit.coefficients[0].len());
        for pair in pairs {
            mean += DVector::from_vec(fit.frame.terms(pair.first, fit.order)) / pairs.len() as f64;
        }
        let scatter = self.tie_lines.standard_deviation;
        // The summary divides by n − 1; the fit uses one degree of freedom per coefficient.
        let spare = (self.ties - 1) as f64 / (self.ties - mean.len()) as f64;
        scatter * (spare * mean.dot(&(&fit.cofactors * &mean))).sqrt()
    }
}

/// Middle and half width of the first image's coordinates, so that powers stay near one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    middle: [f64; 2],
    half_width: [f64; 2],
}

impl Frame {
    fn of(ties: &[Pair]) -> Option<Self> {
        let (mut middle, mut half_width) = ([0.0; 2], [0.0; 2]);
        for axis in 0..2 {
            let values = || ties.iter().map(|tie| tie.first[axis]);
            let (low, high) = (
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            );
            (middle[axis], half_width[axis]) = (0.5 * (low + high), 0.5 * (high - low));
            if !(half_width[axis] > 0.0 && half_width[axis].is_finite()) {
                return None;
            }
        }
        Some(Self { middle, half_width })
    }

    /// Products of powers up to `order` at a position of the first image.
    fn terms(&self, place: [f64; 2], order: u8) -> Vec<f64> {
        let [u, v] = [0, 1].map(|axis| (place[axis] - self.middle[axis]) / self.half_width[axis]);
        let mut terms = vec![1.0, u, v];
        if order > 1 {
            terms.extend([u * u, u * v, v * v]);
        }
        terms
    }
}

/// From the first image to the second.
#[derive(Debug, Clone, PartialEq)]
struct Transformation {
    frame: Frame,
    order: u8,
    coefficients: [DVector<f64>; 2],
    /// Inverse of the normal matrix of either axis.
    cofactors: DMatrix<f64>,
}

/// Singular values below this share of the largest indicate collinear tie points.
const SINGULAR_SHARE: f64 = 1e-9;

impl Transformation {
    fn through(ties: &[Pair], frame: Frame, order: u8) -> Option<Self> {
        let rows: Vec<Vec<f64>> = ties
            .iter()
            .map(|tie| frame.terms(tie.first, order))
            .collect();
        let terms = rows.first()?.len();
        let finite = ties
            .iter()
            .flat_map(|tie| tie.first.iter().chain(&tie.second))
            .all(|value| value.is_finite());
        if ties.len() <= terms || !finite {
            return None;
        }
        let design = DMatrix::from_fn(ties.len(), terms, |row, term| rows[row][term]);
        let cofactors = design.tr_mul(&design).try_inverse()?;
        let decomposition = design.svd(true, true);
        let least = SINGULAR_SHARE * decomposition.singular_values.max();
        if decomposition.rank(least) < terms {
            return None;
        }
        let solve = |axis: usize| {
            let values =
                DVector::from_iterator(ties.len(), ties.iter().map(|tie| tie.second[axis]));
            decomposition.solve(&values, least).ok()
        };
        Some(Self {
            frame,
            order,
            coefficients: [solve(0)?, solve(1)?],
            cofactors,
        })
    }

    /// Transformed minus measured coordinate in the second image.
    fn residuals(&self, pairs: &[Pair], axis: usize) -> Vec<f64> {
        let residual = |pair: &Pair| {
            let terms = self.frame.terms(pair.first, self.order);
            let coefficients = self.coefficients[axis].iter();
            let value: f64 = coefficients.zip(terms).map(|(c, term)| c * term).sum();
            value - pair.second[axis]
        };
        pairs.iter().map(residual).collect()
    }
}
