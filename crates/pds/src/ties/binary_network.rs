//! Binary ISIS control networks: the points and measures of the text form, from messages.

use std::borrow::Cow;

use prost::Message as _;

use super::{
    Gathered, TieError, TieFile,
    messages::{HeaderV2, MeasureEntry, PointEntry, point_type},
    network::{Coordinates, Measured, WITHOUT_ID, add_measure, known},
};
use crate::label::Label;

/// Size of the number before each point of a version 5 network.
const SIZE_BYTES: usize = 4;

/// Reads the network whose label is `label`, the beginning of `bytes`.
///
/// # Errors
/// A version that ISIS no longer writes; places beyond the end of the file; a header or sizes of points that cannot be
/// read. A point that cannot be read is a complaint.
pub(super) fn parse_binary_network(label: &Label, bytes: &[u8]) -> Result<TieFile, TieError> {
    let layout = Layout::of(label)?;
    let points = match layout.version {
        2 => sized_by_header(layout.header(bytes)?, layout.points(bytes)?)?,
        _ => sized_one_by_one(layout.points(bytes)?)?,
    };
    let mut gathered = Gathered::default();
    for (record, point) in (1..).zip(points) {
        match PointEntry::decode(point) {
            Ok(point) => add_point(&mut gathered, record, &point),
            Err(error) => gathered.complain(record, format!("a damaged point: {error}")),
        }
    }
    Ok(gathered.file)
}

/// Places that the label states, bytes from the beginning of the file.
struct Layout {
    version: u64,
    header: [u64; 2],
    points: [u64; 2],
}

impl Layout {
    fn of(label: &Label) -> Result<Self, TieError> {
        let number = |group: &str, key: &'static str| {
            let entry = label.entries.iter();
            let mut entry =
                entry.filter(|entry| entry.group == group && entry.key.eq_ignore_ascii_case(key));
            let value = entry.next().map_or("missing", |entry| &*entry.value);
            let number = value.parse::<u64>();
            number.map_err(|_| TieError::BinaryLabel {
                key,
                value: value.to_owned(),
            })
        };
        // ISIS takes a label without a version for one of version 1, whose places have other names.
        let states_version = label.entries.iter().any(|entry| entry.key == "VERSION");
        let version = if states_version {
            number("CONTROLNETWORKINFO", "Version")?
        } else {
            1
        };
        if !matches!(version, 2 | 5) {
            return Err(TieError::BinaryVersion(version));
        }
        Ok(Self {
            version,
            header: [
                number("CORE", "HeaderStartByte")?,
                number("CORE", "HeaderBytes")?,
            ],
            points: [
                number("CORE", "PointsStartByte")?,
                number("CORE", "PointsBytes")?,
            ],
        })
    }

    fn header<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], TieError> {
        part(bytes, self.header, "header")
    }

    fn points<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], TieError> {
        part(bytes, self.points, "points")
    }
}

fn part<'a>(
    bytes: &'a [u8],
    [start, length]: [u64; 2],
    what: &'static str,
) -> Result<&'a [u8], TieError> {
    let end = start.saturating_add(length);
    let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
    let found = range.and_then(|(start, end)| bytes.get(start..end));
    found.ok_or(TieError::BinaryShort {
        what,
        end,
        bytes: bytes.len() as u64,
    })
}

/// The points of a version 2 network.
fn sized_by_header<'a>(header: &[u8], mut points: &'a [u8]) -> Result<Vec<&'a [u8]>, TieError> {
    let header = HeaderV2::decode(header);
    let header = header.map_err(|error| TieError::BinaryHeader(error.to_string()))?;
    let sizes = header.point_sizes.iter();
    let pieces = sizes.map(|size| {
        let size = usize::try_from(*size).unwrap_or(usize::MAX);
        let (point, rest) = points.split_at_checked(size).ok_or(TieError::BinarySizes)?;
        points = rest;
        Ok(point)
    });
    let pieces = pieces.collect::<Result<Vec<&[u8]>, TieError>>()?;
    require_all_read(points)?;
    Ok(pieces)
}

/// The points of a version 5 network.
fn sized_one_by_one(mut points: &[u8]) -> Result<Vec<&[u8]>, TieError> {
    let mut pieces = Vec::new();
    while let Some((size, rest)) = points.split_first_chunk::<SIZE_BYTES>() {
        let size = usize::try_from(u32::from_le_bytes(*size)).unwrap_or(usize::MAX);
        let (point, rest) = rest.split_at_checked(size).ok_or(TieError::BinarySizes)?;
        pieces.push(point);
        points = rest;
    }
    require_all_read(points)?;
    Ok(pieces)
}

const fn require_all_read(rest: &[u8]) -> Result<(), TieError> {
    if rest.is_empty() {
        Ok(())
    } else {
        Err(TieError::BinarySizes)
    }
}

fn add_point(gathered: &mut Gathered, record: u64, point: &PointEntry) {
    if point.ignore == Some(true) {
        gathered.file.ignored += 1;
        // With its measures, of which those that are ignored themselves count too, as in the text form.
        gathered.file.ignored += point.measures.iter().filter(|of| is_ignored(of)).count();
        return;
    }
    let id = text_of(&point.id);
    if id.is_empty() {
        return gathered.complain(record, WITHOUT_ID.to_owned());
    }
    if !(point_type::TIE..=point_type::FIXED).contains(&point.point_type) {
        let text = format!(
            "point {id}: type {}; expected 0 to 4; the point is treated as free",
            point.point_type
        );
        gathered.complain(record, text);
    }
    let triangle = &point.apriori_covariance_m2;
    let ground = known(&Coordinates {
        kind: kind(point.point_type),
        xyz_m: [point.apriori_x_m, point.apriori_y_m, point.apriori_z_m]
            .map(|value_m| value_m.filter(|value_m| value_m.is_finite())),
        covariance: (!triangle.is_empty()).then(|| {
            let text: Vec<String> = triangle.iter().map(f64::to_string).collect();
            (Some(triangle.clone()), text.join(", "))
        }),
    });
    let ground = ground.unwrap_or_else(|text| {
        gathered.complain(record, format!("point {id}: {text}"));
        None
    });
    for measure in &point.measures {
        if is_ignored(measure) {
            gathered.file.ignored += 1;
            continue;
        }
        let image = text_of(&measure.serial_number);
        let text = |value: Option<f64>| value.map(|value| value.to_string());
        let [line, sample] = [measure.line, measure.sample].map(text);
        let sigmas = [measure.line_sigma_px, measure.sample_sigma_px].map(text);
        let measured = Measured {
            image: Some(&*image).filter(|name| !name.is_empty()),
            line: line.as_deref(),
            sample: sample.as_deref(),
            sigmas: sigmas.each_ref().map(Option::as_deref),
        };
        add_measure(gathered, record, &id, ground, &measured);
    }
}

/// A name, in UTF-8 or else in Latin-1, which ISIS writes.
fn text_of(bytes: &[u8]) -> Cow<'_, str> {
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
    }
}

fn is_ignored(measure: &MeasureEntry) -> bool {
    measure.ignore == Some(true)
}

/// The word of a type of points in the text form.
const fn kind(point_type: i32) -> &'static str {
    match point_type {
        point_type::FIXED => "Fixed",
        point_type::GROUND => "Ground",
        point_type::CONSTRAINED => "Constrained",
        _ => "Free",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ties::{messages::LABEL_BYTES, parse_network, tests::measure};

    fn entry(id: &str, point_type: i32) -> PointEntry {
        PointEntry {
            id: id.as_bytes().to_vec(),
            point_type,
            measures: vec![
                MeasureEntry {
                    serial_number: b"A".to_vec(),
                    line: Some(1.0),
                    sample: Some(2.5),
                    line_sigma_px: Some(0.3),
                    sample_sigma_px: Some(0.2),
                    ..MeasureEntry::default()
                },
                MeasureEntry {
                    serial_number: b"B".to_vec(),
                    line: Some(8.0),
                    sample: Some(7.0),
                    ..MeasureEntry::default()
                },
            ],
            ..PointEntry::default()
        }
    }

    /// A network of this version with these points.
    fn network(version: u32, points: &[Vec<u8>]) -> Vec<u8> {
        let sizes = points
            .iter()
            .map(|point| i32::try_from(point.len()).unwrap());
        let header = HeaderV2 {
            point_sizes: sizes.collect(),
        };
        let header = match version {
            2 => header.encode_to_vec(),
            _ => Vec::new(),
        };
        let sized = |point: &Vec<u8>| {
            let size = u32::try_from(point.len()).unwrap().to_le_bytes();
            let size = if version == 2 { &[][..] } else { &size[..] };
            [size, point].concat()
        };
        let points: Vec<u8> = points.iter().flat_map(sized).collect();
        let start = LABEL_BYTES + header.len();
        let mut bytes = format!(
            "Object = ProtoBuffer\n Object = Core\n HeaderStartByte = {LABEL_BYTES}\n HeaderBytes = {}\n \
             PointsStartByte = {start}\n PointsBytes = {}\n End_Object\n \
             Group = ControlNetworkInfo\n Version = {version}\n End_Group\nEnd_Object\nEnd\n",
            header.len(),
            points.len()
        )
        .into_bytes();
        bytes.resize(LABEL_BYTES, 0);
        [bytes, header, points].concat()
    }

    #[test]
    fn points_of_both_versions_are_read() {
        let mut fixed = entry("fixed", point_type::FIXED);
        fixed.apriori_x_m = Some(1.5);
        fixed.apriori_y_m = Some(-2.0);
        fixed.apriori_z_m = Some(3.0);
        let mut constrained = entry("constrained", point_type::CONSTRAINED);
        constrained.apriori_covariance_m2 = vec![4.0, 1.0, 0.0, 9.0, 0.0, 16.0];
        let mut ignored = entry("ignored", point_type::FREE);
        ignored.ignore = Some(true);
        let mut partly = entry("partly", point_type::TIE);
        partly.measures[1].ignore = Some(true);
        let points = [
            fixed,
            constrained,
            ignored,
            partly,
            entry("", point_type::FREE),
        ];
        let points = points.map(|point| point.encode_to_vec());
        for version in [2, 5] {
            let file = parse_network(&network(version, &points)).unwrap();
            let ids: Vec<&str> = file.ties.iter().map(|tie| &*tie.id).collect();
            assert_eq!(ids, ["fixed", "constrained", "partly"]);
            let known = file.ties[0].known.unwrap();
            assert_eq!(known.ground.xyz_m.as_slice(), [1.5, -2.0, 3.0]);
            assert_eq!(file.ties[0].measures[0].sigma_px, Some([0.3, 0.2]));
            assert_eq!(file.ties[0].measures[1], measure("B", 7.5, 6.5));
            assert_eq!((file.ties[1].known, file.ties[2].measures.len()), (None, 1));
            assert_eq!(file.ignored, 2);
            let texts: Vec<&str> = file.complaints.iter().map(|of| &*of.text).collect();
            assert_eq!(texts.len(), 2);
            assert!(texts[0].contains("constrained: its type is Constrained, but AprioriX"));
            assert_eq!((texts[1], file.complaints[1].record), (WITHOUT_ID, 5));
        }
    }

    #[test]
    fn names_in_latin_1_and_unknown_types_are_read() {
        let mut named = entry("", point_type::FREE);
        named.id = b"H\xf6he".to_vec();
        let unknown = entry("unknown", 9);
        let points = [named, unknown].map(|point| point.encode_to_vec());
        let file = parse_network(&network(5, &points)).unwrap();
        assert_eq!((&*file.ties[0].id, file.ties.len()), ("Höhe", 2));
        assert!(
            file.complaints[0]
                .text
                .starts_with("point unknown: type 9; expected 0 to 4")
        );
    }

    #[test]
    fn damage_is_reported_and_never_a_panic() {
        let points = [entry("a", 2), entry("b", 2)].map(|point| point.encode_to_vec());
        for version in [2, 5] {
            let whole = network(version, &points);
            let at = whole.len() - points[1].len();
            let mut damaged = whole.clone();
            damaged[at + 1] = 0xff;
            let file = parse_network(&damaged).unwrap();
            assert_eq!(file.ties.len(), 1);
            assert!(file.complaints[0].text.starts_with("a damaged point"));
            // Every single bit of header, sizes and points, and every shorter file.
            for byte in LABEL_BYTES..whole.len() {
                for bit in 0..8 {
                    let mut flipped = whole.clone();
                    flipped[byte] ^= 1 << bit;
                    let _ = parse_network(&flipped);
                }
                let short = parse_network(&whole[..byte]);
                assert!(matches!(short, Err(TieError::BinaryShort { .. })));
            }
        }
        let text = |version| {
            let file = network(version, &points);
            parse_network(&file).unwrap_err()
        };
        assert_eq!(text(3), TieError::BinaryVersion(3));
        let first = b"Object = ProtoBuffer\n Object = Core\n StartByte = 65536\n Bytes = 9\n End_Object\nEnd_Object\nEnd\n";
        assert_eq!(parse_network(first), Err(TieError::BinaryVersion(1)));
        let mut unsized_points = network(5, &points);
        unsized_points[LABEL_BYTES] = 0xff;
        assert_eq!(parse_network(&unsized_points), Err(TieError::BinarySizes));
    }
}
