//! Footprints as a shapefile of three-dimensional points, as made from `pedr2tab` tables.

use std::{
    io::{BufReader, Seek as _, SeekFrom, Write},
    path::Path,
};

use shapefile::{
    NO_DATA, PointZ, ShapeReader, ShapeWriter,
    dbase::{
        self, FieldError, FieldName, FieldValue, FieldWriter, TableWriterBuilder, WritableRecord,
    },
};

use super::{CRS_WKT, SPHERE_RADIUS_M};
use crate::{
    error::{Failure, IoFault, Place, Result},
    products::{
        coordinates::degrees,
        fault::ProductFault,
        files::{create, finish, open, write_text},
        site::SiteProducts,
    },
};

/// Where a file's field ends: dBASE counts its bytes in one byte, of which shapefiles use this much.
const TEXT_MAX: usize = 254;

/// Fields of numbers: name (ten letters are all that dBASE holds), width, decimals.
const NUMBERS: [(&str, u8, u8); 10] = [
    ("et_s", 20, 6),
    ("orbit", 10, 0),
    ("record", 10, 0),
    ("shot", 3, 0),
    ("lon_deg", 14, 9),
    ("lat_deg", 14, 9),
    ("radius_m", 12, 3),
    ("radius_x_m", 12, 3),
    ("topo_m", 12, 3),
    ("range_m", 12, 3),
];
/// Fields of text.
const TEXTS: [&str; 2] = ["utc", "file"];

/// A record of the attribute table.
struct Attributes {
    numbers: [f64; NUMBERS.len()],
    texts: [String; TEXTS.len()],
}

impl WritableRecord for Attributes {
    fn write_using<W: Write>(
        &self,
        writer: &mut FieldWriter<'_, W>,
    ) -> std::result::Result<(), FieldError> {
        for number in &self.numbers {
            writer.write_next_field_value(number)?;
        }
        for text in &self.texts {
            writer.write_next_field_value(text)?;
        }
        Ok(())
    }
}

/// Writes `.shp`, `.shx`, `.dbf`, `.prj` and `.cpg` beside each other and reads points and attributes back.
///
/// # Errors
/// What the disk or the encoder refuses; records that come back different.
pub(super) fn write(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<u64> {
    let shapes = || (points.iter().enumerate()).map(|(row, at)| point(site, row, at));
    let records = || (0..points.len()).map(|row| attributes(site, row));
    write_points(path, shapes())?;
    let table = path.with_extension("dbf");
    write_attributes(&table, text_widths(site), newest_day(site), records())?;
    write_text(&path.with_extension("prj"), CRS_WKT)?;
    write_text(&path.with_extension("cpg"), "UTF-8")?;
    read_points(path, shapes()).in_file(path)?;
    read_attributes(&table, records()).in_file(&table)?;
    Ok(points.len() as u64)
}

/// Files beside `.shp` that make it a shapefile.
pub(super) const COMPANIONS: [&str; 4] = ["shx", "dbf", "prj", "cpg"];

fn point(site: &SiteProducts, row: usize, [longitude_deg, latitude_deg]: &[f64; 2]) -> PointZ {
    let height_m = site.footprints.radius_crossover_m[row] - SPHERE_RADIUS_M;
    PointZ::new(*longitude_deg, *latitude_deg, height_m, NO_DATA)
}

fn attributes(site: &SiteProducts, row: usize) -> Attributes {
    let shot = site.footprints.row(row);
    Attributes {
        numbers: [
            shot.et_s,
            f64::from(shot.orbit),
            f64::from(shot.record),
            f64::from(shot.shot),
            degrees(shot.longitude_rad),
            degrees(shot.latitude_rad),
            shot.radius_m,
            shot.radius_crossover_m,
            shot.radius_crossover_m - shot.areoid_radius_m,
            shot.range_m,
        ],
        texts: [site.utc[row].clone(), site.file_name(shot.file)],
    }
}

/// The disk's refusal, or the library's.
fn refused(error: shapefile::Error) -> Failure {
    match error {
        shapefile::Error::IoError(source) => IoFault::on("write")(source).into(),
        error => ProductFault::refused("encode shapefile")(error).into(),
    }
}

fn write_points(path: &Path, points: impl Iterator<Item = PointZ>) -> Result<()> {
    let index = path.with_extension("shx");
    let (mut shp, mut shx) = (create(path)?, create(&index)?);
    let mut writer = ShapeWriter::with_shx(&mut shp, &mut shx);
    for point in points {
        writer.write_shape(&point).map_err(refused).in_file(path)?;
    }
    writer.finalize().map_err(refused).in_file(path)?;
    drop(writer);
    finish(path, shp)?;
    finish(&index, shx)
}

/// * `widths` – bytes of each field of text
/// * `day` – what the header holds as the date of the last change: years since 1900, month, day
fn write_attributes(
    path: &Path,
    widths: [u8; TEXTS.len()],
    day: [u8; 3],
    records: impl Iterator<Item = Attributes>,
) -> Result<()> {
    let mut file = create(path)?;
    let refused = |error: dbase::Error| ProductFault::refused("encode dBASE")(error);
    let mut fields = TableWriterBuilder::with_encoding(dbase::encoding::Unicode);
    for (name, width, decimals) in NUMBERS {
        fields = fields.add_numeric_field(field_name(name).in_file(path)?, width, decimals);
    }
    for (name, width) in TEXTS.into_iter().zip(widths) {
        fields = fields.add_character_field(field_name(name).in_file(path)?, width);
    }
    let mut writer = fields.build_with_dest(&mut file);
    for record in records {
        writer
            .write_record(&record)
            .map_err(refused)
            .in_file(path)?;
    }
    writer.finalize().map_err(refused).in_file(path)?;
    drop(writer);
    // The library has written today's date there.
    file.seek(SeekFrom::Start(1))
        .and_then(|_| file.write_all(&day))
        .map_err(IoFault::on("write"))
        .in_file(path)?;
    finish(path, file)
}

fn field_name(name: &str) -> std::result::Result<FieldName, ProductFault> {
    FieldName::try_from(name).map_err(|error| ProductFault::Refused {
        action: "name a field",
        reason: error.to_string(),
    })
}

/// Bytes of the longest text of each field.
fn text_widths(site: &SiteProducts) -> [u8; TEXTS.len()] {
    let longest = |lengths: &mut dyn Iterator<Item = usize>| {
        let width = lengths.max().unwrap_or(1).clamp(1, TEXT_MAX);
        u8::try_from(width).unwrap_or(u8::MAX)
    };
    [
        longest(&mut site.utc.iter().map(String::len)),
        longest(&mut site.footprints.files.iter().map(|file| file.name.len())),
    ]
}

/// Day of the newest shot, for the same bytes each day: years since 1900, month, day.
fn newest_day(site: &SiteProducts) -> [u8; 3] {
    let newest = site.utc.iter().max().map_or("", String::as_str);
    let number = |range| -> u16 {
        let digits: Option<&str> = newest.get(range);
        digits.and_then(|text| text.parse().ok()).unwrap_or(0)
    };
    [
        number(0..4).saturating_sub(1900),
        number(5..7),
        number(8..10),
    ]
    .map(|value| u8::try_from(value).unwrap_or(u8::MAX))
}

fn differs(what: String) -> Failure {
    ProductFault::ReadBack { what }.into()
}

fn read_points(path: &Path, points: impl Iterator<Item = PointZ>) -> Result<()> {
    let unreadable = |error: shapefile::Error| Failure::from(ProductFault::unreadable(error));
    let mut reader = ShapeReader::new(BufReader::new(open(path)?)).map_err(unreadable)?;
    let mut found = reader.iter_shapes_as::<PointZ>();
    let mut rows = 0;
    for expected in points {
        rows += 1;
        if found.next().transpose().map_err(unreadable)? != Some(expected) {
            return Err(differs(format!("point {rows}")));
        }
    }
    if found.next().is_some() {
        return Err(differs(format!("more than {rows} points")));
    }
    Ok(())
}

fn read_attributes(path: &Path, records: impl Iterator<Item = Attributes>) -> Result<()> {
    let unreadable = |error: dbase::Error| Failure::from(ProductFault::unreadable(error));
    let mut reader = dbase::Reader::new(BufReader::new(open(path)?)).map_err(unreadable)?;
    let mut found = reader.iter_records();
    let mut rows = 0;
    for expected in records {
        rows += 1;
        let record = found.next().transpose().map_err(unreadable)?;
        if !record.is_some_and(|record| holds(&record, &expected)) {
            return Err(differs(format!("attributes of point {rows}")));
        }
    }
    if found.next().is_some() {
        return Err(differs(format!("attributes of more than {rows} points")));
    }
    Ok(())
}

/// Whether a record holds the attributes, numbers within half a unit of their last decimal.
fn holds(record: &dbase::Record, expected: &Attributes) -> bool {
    let numbers = NUMBERS.iter().zip(&expected.numbers);
    let texts = TEXTS.iter().zip(&expected.texts);
    numbers.clone().all(|((name, _, decimals), expected)| {
        let tolerance =
            0.5 * 10_f64.powi(-i32::from(*decimals)) + 4.0 * f64::EPSILON * expected.abs();
        matches!(record.get(name), Some(FieldValue::Numeric(Some(found)))
            if (found - expected).abs() <= tolerance)
    }) && texts
        .clone()
        .all(|(name, expected)| match record.get(name) {
            Some(FieldValue::Character(found)) => found.as_deref().unwrap_or_default() == expected,
            _ => false,
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn records() -> impl Iterator<Item = Attributes> {
        [1.0, 2.0].into_iter().map(|shot| Attributes {
            numbers: [
                -11_224_002.182_053_322,
                9019.0,
                11.0,
                shot,
                175.312_345_678_9,
                -14.6,
                3_394_000.12,
                3_394_001.37,
                -1_498.63,
                380_000.1,
            ],
            texts: ["1999-08-24T14:12:13.000".to_owned(), "å.b".to_owned()],
        })
    }

    #[test]
    fn a_changed_attribute_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dbf");
        write_attributes(&path, [23, 5], [99, 8, 24], records()).unwrap();
        read_attributes(&path, records()).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes[1..4], [99, 8, 24]);
        let longer = read_attributes(&path, records().take(1)).unwrap_err();
        assert!(longer.fault.to_string().ends_with("more than 1 points"));
        // The last digit that stands there of a longitude.
        let digits = b"175.312345679";
        let at = bytes
            .windows(digits.len())
            .rposition(|window| window == digits);
        let mut changed = bytes;
        changed[at.unwrap() + digits.len() - 1] = b'8';
        fs::File::create(&path)
            .unwrap()
            .write_all(&changed)
            .unwrap();
        let failure = read_attributes(&path, records()).unwrap_err();
        assert_eq!(
            failure.fault.to_string(),
            "read back differently: attributes of point 2"
        );
    }

    #[test]
    fn a_changed_point_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.shp");
        let points = |z_m: f64| [0.1 + 0.2, 2.0].map(|x| PointZ::new(x, -0.0, z_m, NO_DATA));
        write_points(&path, points(-1950.25).into_iter()).unwrap();
        read_points(&path, points(-1950.25).into_iter()).unwrap();
        for (expected, complaint) in [
            (&points(-1950.0)[..], "point 1"),
            (&points(-1950.25)[..1], "more than 1 points"),
        ] {
            let failure = read_points(&path, expected.iter().copied()).unwrap_err();
            assert_eq!(
                failure.fault.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
