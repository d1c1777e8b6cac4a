//! A comparison as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::{Compared, Uncovered};
use crate::{
    geom::statistics::Summary,
    schema::{DocumentSchema, none_negative},
    stages::compare_kernels::{AttitudeComparison, Comparison, Deviation, Size},
    units::RADIANS_PER_ARCSECOND,
};

/// Schema of [`Answer`].
#[must_use]
pub fn comparison_schema() -> DocumentSchema {
    DocumentSchema::of::<Answer>("kernel_comparison")
}

/// Answer of `areograph kernels compare --json`.
#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Comparison of rival kernel sets",
    description = "Answer of `areograph kernels compare --json`: differences of the orbit and the attitude of each set from \
                   the mean of all sets. Member names end in the unit; unknown values are omitted."
)]
pub struct Answer<'a> {
    #[schemars(extend("const" = "areograph kernel comparison 1"))]
    format: &'static str,
    rule: &'static str,
    /// Positions of MGS relative to Mars minus the mean of all sets, along the axes of the mean orbit.
    orbit: Table<'a, OrbitSet<'a>, OrbitDifference<'a>>,
    /// Attitudes relative to their mean, as rotations about the axes of the mean orbit; ground distances along the
    /// boresight, at epochs where the boresight meets Mars.
    #[serde(skip_serializing_if = "Option::is_none")]
    attitude: Option<Attitude<'a>>,
    start_utc: &'a str,
    stop_utc: &'a str,
    left_out: Vec<LeftOut<'a>>,
    notes: &'a [String],
}

#[derive(Serialize, JsonSchema)]
struct Table<'a, S, D> {
    closest: &'a str,
    equally_close: Vec<&'a str>,
    #[schemars(length(min = 1))]
    epochs_et_s: Vec<f64>,
    #[schemars(length(min = 2))]
    sets: Vec<S>,
    #[schemars(length(min = 1))]
    differences: Vec<D>,
}

#[derive(Serialize, JsonSchema)]
struct Attitude<'a> {
    #[serde(flatten)]
    turns: Table<'a, AttitudeWithGround<'a>, AttitudeDifference<'a>>,
    ground_epochs_et_s: Vec<f64>,
}

#[derive(Serialize, JsonSchema)]
struct AttitudeWithGround<'a> {
    #[serde(flatten)]
    turns: AttitudeSet<'a>,
    #[schemars(transform = none_negative)]
    ground_m: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    ground_rms_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    ground_max_m: Option<f64>,
}

/// Time that a set does not cover.
#[derive(Serialize, JsonSchema)]
struct LeftOut<'a> {
    set: &'a str,
    #[schemars(extend("enum" = ["position", "attitude"]))]
    what: &'static str,
    start_et_s: f64,
    stop_et_s: f64,
    start_utc: &'a str,
    stop_utc: &'a str,
}

/// Statistics in the unit of the member name.
#[derive(Serialize, JsonSchema)]
struct Moments {
    mean: f64,
    #[schemars(range(min = 0.0))]
    standard_deviation: f64,
    min: f64,
    max: f64,
}

/// Size, deviation of a set and difference of two, whose members end in one unit.
macro_rules! in_unit {
    (
        $unit:expr, $size:ident, $set:ident, $difference:ident,
        $rms:ident, $max:ident, $radial:ident, $along:ident, $cross:ident, $series:ident
    ) => {
        #[derive(Serialize, JsonSchema)]
        struct $size {
            #[schemars(range(min = 0.0))]
            $rms: f64,
            #[schemars(range(min = 0.0))]
            $max: f64,
            $radial: Moments,
            $along: Moments,
            $cross: Moments,
        }

        #[derive(Serialize, JsonSchema)]
        struct $set<'a> {
            set: &'a str,
            #[serde(flatten)]
            size: $size,
            $series: Vec<[f64; 3]>,
        }

        #[derive(Serialize, JsonSchema)]
        struct $difference<'a> {
            set: &'a str,
            minus: &'a str,
            #[serde(flatten)]
            size: $size,
        }

        impl From<&Size> for $size {
            fn from(size: &Size) -> Self {
                let [radial, along, cross] = size.components.map(|of| Moments::of(&of, $unit));
                Self {
                    $rms: size.rms / $unit,
                    $max: size.max / $unit,
                    $radial: radial,
                    $along: along,
                    $cross: cross,
                }
            }
        }

        impl<'a> From<&'a Deviation> for $set<'a> {
            fn from(deviation: &'a Deviation) -> Self {
                let series = deviation.radial_along_cross.iter();
                Self {
                    set: &deviation.set,
                    size: (&deviation.size).into(),
                    $series: series.map(|of| of.map(|value| value / $unit)).collect(),
                }
            }
        }

        impl<'a> From<(&'a str, &'a str, Size)> for $difference<'a> {
            fn from((set, minus, size): (&'a str, &'a str, Size)) -> Self {
                let size = (&size).into();
                Self { set, minus, size }
            }
        }
    };
}

in_unit!(
    1.0,
    OrbitSize,
    OrbitSet,
    OrbitDifference,
    rms_m,
    max_m,
    radial_m,
    along_track_m,
    cross_track_m,
    radial_along_cross_m
);
in_unit!(
    RADIANS_PER_ARCSECOND,
    AttitudeSize,
    AttitudeSet,
    AttitudeDifference,
    rms_arcsec,
    max_arcsec,
    radial_arcsec,
    along_track_arcsec,
    cross_track_arcsec,
    radial_along_cross_arcsec
);

impl Moments {
    fn of(summary: &Summary, unit: f64) -> Self {
        Self {
            mean: summary.mean / unit,
            standard_deviation: summary.standard_deviation / unit,
            min: summary.min / unit,
            max: summary.max / unit,
        }
    }
}

impl<'a> Answer<'a> {
    /// The findings.
    #[must_use]
    pub fn of(compared: &'a Compared) -> Self {
        Self {
            format: "areograph kernel comparison 1",
            rule: "least root mean square distance from the mean of all sets",
            orbit: table(&compared.orbit, |_, deviation| deviation.into()),
            attitude: compared.attitude.as_ref().map(attitude),
            start_utc: &compared.utc[0],
            stop_utc: &compared.utc[1],
            left_out: compared.uncovered.iter().map(left_out).collect(),
            notes: &compared.notes,
        }
    }
}

fn table<'a, S, D: From<(&'a str, &'a str, Size)>>(
    comparison: &'a Comparison,
    set: impl Fn(usize, &'a Deviation) -> S,
) -> Table<'a, S, D> {
    let sets = comparison.deviations.iter().enumerate();
    let name = |index: usize| &*comparison.deviations[index].set;
    let differences = comparison.pairs().map(|(first, second)| {
        let size = comparison.difference(first, second);
        (name(second), name(first), size).into()
    });
    Table {
        closest: &comparison.closest().set,
        equally_close: comparison.tied_sets().collect(),
        epochs_et_s: comparison.epochs.iter().map(|et| et.seconds()).collect(),
        sets: sets
            .map(|(index, deviation)| set(index, deviation))
            .collect(),
        differences: differences.collect(),
    }
}

fn attitude(attitude: &AttitudeComparison) -> Attitude<'_> {
    let with_ground = |set: usize, deviation| {
        let size = attitude.ground_size_m(set);
        AttitudeWithGround {
            turns: AttitudeSet::from(deviation),
            ground_m: &attitude.ground_m[set],
            ground_rms_m: size.map(|[rms_m, _]| rms_m),
            ground_max_m: size.map(|[_, max_m]| max_m),
        }
    };
    Attitude {
        turns: table(&attitude.turns, with_ground),
        ground_epochs_et_s: attitude.on_ground.iter().map(|et| et.seconds()).collect(),
    }
}

fn left_out(uncovered: &Uncovered) -> LeftOut<'_> {
    LeftOut {
        set: &uncovered.set,
        what: uncovered.what,
        start_et_s: uncovered.interval.start.seconds(),
        stop_et_s: uncovered.interval.stop.seconds(),
        start_utc: &uncovered.utc[0],
        stop_utc: &uncovered.utc[1],
    }
}
