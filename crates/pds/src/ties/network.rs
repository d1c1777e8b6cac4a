//! ISIS control networks as text (PVL).
//!
//! Coordinates of a point are read if its type declares them as known: `Fixed` (formerly `Ground`), or `Constrained`
//! with a covariance matrix. They are Mars-fixed, IAU 2000, metres.
//!
//! Source: `ControlNetVersioner.cpp` of ISIS, version 5 of the format.

use nalgebra::{Matrix3, Vector3};

use super::{Gathered, TieFile, finite, sigmas};
use crate::label::{Entry, Label};
use areograph_base::{
    frames::Position,
    ties::{KnownGround, TieMeasure},
};

/// Complaint about a point without identifier.
pub(super) const WITHOUT_ID: &str = "a point without PointId";

/// The network of the label that `label` is.
pub(super) fn parse_text_network(label: &Label) -> TieFile {
    let mut gathered = Gathered::default();
    let mut point = Point::default();
    for block in label.entries.chunk_by(|a, b| a.block == b.block) {
        let block = BlockEntries(block);
        match block.0[0].group.as_str() {
            "CONTROLPOINT" => point = Point::of(block, &mut gathered),
            "CONTROLMEASURE" => add_block(&mut gathered, &point, &block),
            _ => {}
        }
    }
    gathered.file
}

/// The entries of one object or group.
#[derive(Clone, Copy, Default)]
struct BlockEntries<'a>(&'a [Entry]);

impl<'a> BlockEntries<'a> {
    fn value(&self, key: &str) -> Option<&'a str> {
        let entry = self.0.iter().find(|entry| entry.key == key);
        entry.map(|entry| entry.value.as_str())
    }

    fn ignored(&self) -> bool {
        self.value("IGNORE")
            .is_some_and(|value| value.eq_ignore_ascii_case("true"))
    }

    fn number(&self) -> u64 {
        self.0.first().map_or(0, |entry| entry.block as u64)
    }

    fn finite(&self, key: &str) -> Option<f64> {
        finite(self.value(key)?)
    }
}

/// Context of the measures of a point.
#[derive(Default)]
struct Point<'a> {
    id: Option<&'a str>,
    ignored: bool,
    known: Option<KnownGround>,
}

impl<'a> Point<'a> {
    fn of(block: BlockEntries<'a>, gathered: &mut Gathered) -> Self {
        let (id, ignored) = (block.value("POINTID"), block.ignored());
        gathered.file.ignored += usize::from(ignored);
        if id.is_none() {
            gathered.complain(block.number(), WITHOUT_ID.to_owned());
        }
        let known = if ignored {
            Ok(None)
        } else {
            known(&coordinates(&block))
        };
        Self {
            id,
            ignored,
            known: known.unwrap_or_else(|text| {
                let text = format!("point {}: {text}", id.unwrap_or_default());
                gathered.complain(block.number(), text);
                None
            }),
        }
    }
}

/// Coordinates of a point as a network states them.
pub(super) struct Coordinates<'a> {
    /// Type of the point.
    pub(super) kind: &'a str,
    /// Finite a priori coordinates.
    pub(super) xyz_m: [Option<f64>; 3],
    /// The a priori covariance, if it is numbers, and as written.
    pub(super) covariance: Option<(Option<Vec<f64>>, String)>,
}

fn coordinates<'a>(block: &BlockEntries<'a>) -> Coordinates<'a> {
    let covariance = block.value("APRIORICOVARIANCEMATRIX").map(|text| {
        let numbers = text.split(',').map(|number| finite(number.trim()));
        (numbers.collect(), text.to_owned())
    });
    Coordinates {
        kind: block.value("POINTTYPE").unwrap_or_default(),
        xyz_m: ["APRIORIX", "APRIORIY", "APRIORIZ"].map(|key| block.finite(key)),
        covariance,
    }
}

/// Ground coordinates of a fixed or constrained point; coordinates of a free point are initial values of its last
/// adjustment.
///
/// # Errors
/// The missing value of such a point, which then becomes free.
pub(super) fn known(of: &Coordinates<'_>) -> std::result::Result<Option<KnownGround>, String> {
    let kind = of.kind;
    let is = |word: &str| kind.eq_ignore_ascii_case(word);
    let fixed = is("Fixed") || is("Ground");
    if !fixed && !is("Constrained") {
        return Ok(None);
    }
    let [Some(x_m), Some(y_m), Some(z_m)] = of.xyz_m else {
        return Err(format!(
            "its type is {kind}, but AprioriX, AprioriY or AprioriZ is missing or invalid; the point is treated as free"
        ));
    };
    let covariance_m2 = match (fixed, &of.covariance) {
        (true, _) => None,
        (false, Some((numbers, text))) => Some(covariance_m2(numbers.as_deref(), text)?),
        (false, None) => {
            return Err(
                "its type is Constrained, but it has no AprioriCovarianceMatrix; the point is treated as free"
                    .to_owned(),
            );
        }
    };
    Ok(Some(KnownGround {
        ground: Position::new(Vector3::new(x_m, y_m, z_m)),
        covariance_m2,
    }))
}

/// The covariance with this upper triangle, row by row; `text` is its form in the file.
fn covariance_m2(numbers: Option<&[f64]>, text: &str) -> std::result::Result<Matrix3<f64>, String> {
    let matrix = match numbers {
        Some(&[xx, xy, xz, yy, yz, zz]) => Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)),
        _ => None,
    };
    matrix
        .filter(|matrix| matrix.cholesky().is_some())
        .ok_or_else(|| {
            format!(
                "AprioriCovarianceMatrix ({text}): expected the six numbers of the upper triangle of a positive definite \
                 matrix, m²; the point is treated as free"
            )
        })
}

fn add_block(gathered: &mut Gathered, point: &Point<'_>, measure: &BlockEntries<'_>) {
    if point.ignored || measure.ignored() {
        gathered.file.ignored += usize::from(measure.ignored());
        return;
    }
    let Some(id) = point.id else {
        return;
    };
    let measured = Measured {
        image: measure.value("SERIALNUMBER"),
        line: measure.value("LINE"),
        sample: measure.value("SAMPLE"),
        sigmas: ["LINESIGMA", "SAMPLESIGMA"].map(|key| measure.value(key)),
    };
    add_measure(gathered, measure.number(), id, point.known, &measured);
}

/// A measure as written.
pub(super) struct Measured<'a> {
    /// Serial number.
    pub(super) image: Option<&'a str>,
    /// Line.
    pub(super) line: Option<&'a str>,
    /// Sample.
    pub(super) sample: Option<&'a str>,
    /// Standard deviations of line and sample.
    pub(super) sigmas: [Option<&'a str>; 2],
}

/// Adds a measure of the point `id`, or a complaint about it.
pub(super) fn add_measure(
    gathered: &mut Gathered,
    record: u64,
    id: &str,
    known: Option<KnownGround>,
    measured: &Measured<'_>,
) {
    let [line, sample] = [measured.line, measured.sample].map(|text| finite(text?));
    if let (Some(image), Some(line), Some(sample)) = (measured.image, line, sample) {
        let sigma_px = sigmas(measured.sigmas).unwrap_or_else(|text| {
            gathered.complain(record, format!("point {id}: {text}"));
            None
        });
        let measure = TieMeasure {
            image: image.to_owned(),
            line,
            sample,
            sigma_px,
        };
        gathered.add(id.to_owned(), known, measure);
    } else {
        let found = |value: Option<&str>| value.unwrap_or("missing").to_owned();
        let text = format!(
            "point {id}: SerialNumber {}, Line {}, Sample {}: expected a name and two numbers",
            found(measured.image),
            found(measured.line),
            found(measured.sample)
        );
        gathered.complain(record, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ties::{TieError, parse_network, tests::measure};

    const NETWORK: &str = "Object = ControlNetwork\n NetworkId = n\n \
        Object = ControlPoint\n PointId = p1\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = 1.0\n Sample = 2.5\n End_Group\n \
        Group = ControlMeasure\n Sample = 7.0\n Line = 8.0\n SerialNumber = B\n End_Group\n End_Object\n \
        Object = ControlPoint\n PointId = p2\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = x\n Sample = 1\n End_Group\n \
        Group = ControlMeasure\n SerialNumber = B\n Line = 3\n Sample = 1\n Ignore = True\n End_Group\n \
        Group = ControlMeasure\n SerialNumber = C\n Line = 4\n Sample = 5\n End_Group\n End_Object\n \
        Object = ControlPoint\n PointId = p3\n Ignore = True\n \
        Group = ControlMeasure\n SerialNumber = A\n Line = 1\n Sample = 1\n End_Group\n End_Object\n\
        End_Object\nEnd\n";

    #[test]
    fn a_network_is_read_and_what_is_left_out_is_told() {
        let file = parse_network(NETWORK.as_bytes()).unwrap();
        assert_eq!(file.ties.len(), 2);
        assert_eq!(file.ties[0].id, "p1");
        assert_eq!(
            file.ties[0].measures,
            [measure("A", 0.5, 2.0), measure("B", 7.5, 6.5)]
        );
        assert_eq!(file.ties[1].measures, [measure("C", 3.5, 4.5)]);
        assert_eq!(file.ignored, 2);
        assert_eq!(file.complaints.len(), 1);
        assert!(
            file.complaints[0]
                .text
                .contains("point p2: SerialNumber A, Line x")
        );
    }

    /// One point with these entries and a measurement with those.
    fn one(point: &str, measure: &str) -> TieFile {
        let text = format!(
            "Object = ControlNetwork\n NetworkId = n\n Object = ControlPoint\n PointId = p\n {point}\n Group = ControlMeasure\n \
             SerialNumber = A\n Line = 1\n Sample = 1\n {measure}\n End_Group\n End_Object\n End_Object\nEnd\n"
        );
        parse_network(text.as_bytes()).unwrap()
    }

    #[test]
    fn coordinates_are_read_of_points_that_are_known() {
        let xyz = "AprioriX = 1.5 <meters>\n AprioriY = -2.0 <meters>\n AprioriZ = 3 <meters>";
        let matrix = "AprioriCovarianceMatrix = (4, 1, 0,\n 9, 0, 16)";
        let read = |kind: &str, rest: &str| {
            let file = one(&format!("PointType = {kind}\n {xyz}\n {rest}"), "");
            (file.ties[0].known, file.complaints)
        };
        let (fixed, complaints) = read("Fixed", matrix);
        let fixed = fixed.unwrap();
        assert_eq!(fixed.ground.xyz_m, Vector3::new(1.5, -2.0, 3.0));
        assert_eq!((fixed.covariance_m2, complaints.len()), (None, 0));
        let (constrained, _) = read("Constrained", matrix);
        let expected = Matrix3::new(4.0, 1.0, 0.0, 1.0, 9.0, 0.0, 0.0, 0.0, 16.0);
        assert_eq!(constrained.unwrap().covariance_m2, Some(expected));
        assert_eq!(read("Free", matrix), (None, Vec::new()));
        for (rest, told) in [
            ("", "it has no AprioriCovarianceMatrix"),
            (
                "AprioriCovarianceMatrix = (4, 1, 0, 9)",
                "expected the six numbers",
            ),
            (
                "AprioriCovarianceMatrix = (4, x, 1, 0, 9, 0, 16)",
                "expected the six numbers",
            ),
            (
                "AprioriCovarianceMatrix = (4, 9, 0, 4, 0, 1)",
                "positive definite",
            ),
        ] {
            let (known, complaints) = read("Constrained", rest);
            assert_eq!(known, None);
            assert!(complaints[0].text.contains(told), "{}", complaints[0].text);
        }
        let nowhere = one("PointType = Fixed", "");
        assert!(nowhere.complaints[0].text.contains("AprioriX"));
        assert_eq!(nowhere.ties[0].measures.len(), 1);
    }

    #[test]
    fn standard_deviations_of_measures_are_read() {
        let sigmas = |text: &str| {
            let file = one("", text);
            (file.ties[0].measures[0].sigma_px, file.complaints.len())
        };
        let both = "SampleSigma = 0.2 <pixels>\n LineSigma = 0.3 <pixels>";
        assert_eq!(sigmas(both), (Some([0.3, 0.2]), 0));
        assert_eq!(sigmas("LineSigma = 0.3"), (None, 1));
        assert_eq!(sigmas("LineSigma = -1\n SampleSigma = 1"), (None, 1));
    }

    #[test]
    fn what_is_no_network_is_refused() {
        let binary = b"Object = ProtoBuffer\n Object = Core\n HeaderStartByte = 65536\n End_Object\nEnd_Object\nEnd\n\0\x01";
        assert_eq!(parse_network(binary), Err(TieError::BinaryVersion(1)));
        assert_eq!(parse_network(b"A = 1\n"), Err(TieError::NoNetwork));
        assert!(matches!(parse_network(b"\x00"), Err(TieError::Label(_))));
    }
}
