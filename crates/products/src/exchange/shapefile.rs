//! Points as a shapefile, three-dimensional, with a dBASE table of attributes.
//!
//! A shapefile is five files of one name. The table is encoded in memory: the library that encodes it hides
//! errors of the disk.

use std::{
    io::{BufReader, Cursor},
    path::Path,
};

use arrow_array::StringArray;
use shapefile::{
    NO_DATA, PointZ, ShapeReader, ShapeWriter,
    dbase::{
        self, FieldError, FieldName, FieldValue, FieldWriter, TableWriterBuilder, WritableRecord,
    },
};

use crate::{
    error::ProductError,
    files::{create, finish, open, write_bytes, write_text},
    footprints::features,
    gis::{Features, crs_wkt},
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    table::{DbaseField, Kind, Table, Values},
};
use areograph_base::error::{Error, IoError, Locate, Result};
use areograph_config::ShotFormat;

pub(crate) static POINTS: Declaration = Declaration {
    path: "exchange/footprints.shp",
    what: "the footprints as a shapefile of three-dimensional points",
    readers: "GIS",
    rows: "shots",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::Footprints(ShotFormat::Shp, |path, of| {
        let points = points(&features(of.site));
        write_points(path, points.iter().copied())?;
        read_points(path, points.iter().copied()).in_file(path)?;
        let index = path.with_extension("shx");
        check_index(&index, points.len()).in_file(&index)?;
        Ok(points.len() as u64)
    }),
    uses: &[Use {
        program: Program::Gis,
        lines: "ogrinfo -al -so footprints.shp                   3-D shapefile; column names of at most ten letters, \
                no windows",
    }],
};

/// A companion file of `footprints.shp`.
macro_rules! part {
    ($path:literal, $what:literal, $write:expr) => {
        Declaration {
            path: $path,
            what: $what,
            readers: "GIS",
            rows: "",
            role: Role::Data,
            content: Content::Foreign,
            write: Write::Footprints(ShotFormat::Shp, |path, of| {
                let write: fn(&Path, &Context) -> Result<()> = $write;
                write(path, of).map(|()| 0)
            }),
            uses: &[],
        }
    };
}

pub(crate) static INDEX: Declaration = part!(
    "exchange/footprints.shx",
    "index of footprints.shp",
    // Written with the points.
    |_, _| Ok(())
);

pub(crate) static ATTRIBUTES: Declaration = part!(
    "exchange/footprints.dbf",
    "attributes of footprints.shp",
    |path, of| {
        let features = features(of.site);
        write_attributes(path, &features.newest_utc, &features.attributes.for_dbase())
    }
);

pub(crate) static PROJECTION: Declaration = part!(
    "exchange/footprints.prj",
    "coordinate system of footprints.shp",
    |path, of| write_text(path, &crs_wkt(of.site.config.body))
);

pub(crate) static ENCODING: Declaration = part!(
    "exchange/footprints.cpg",
    "encoding of footprints.dbf",
    |path, _| write_text(path, "UTF-8")
);

/// dBASE counts the bytes of a field in one byte; shapefiles use at most this many.
const TEXT_MAX: usize = 254;
/// Bytes of the head of an index, and of a record in it.
const INDEX_BYTES: [u64; 2] = [100, 8];

fn points(features: &Features) -> Vec<PointZ> {
    let points = features.points.iter();
    points
        .map(|[x, y, z]| PointZ::new(*x, *y, *z, NO_DATA))
        .collect()
}

/// An error of the disk or of the library.
fn refused(error: shapefile::Error) -> Error {
    match error {
        shapefile::Error::IoError(source) => IoError::on("write")(source).into(),
        error => ProductError::refused("encode shapefile")(error).into(),
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

/// Checks that the index has as many records as there are points.
fn check_index(path: &Path, points: usize) -> Result<()> {
    let found = open(path)?.metadata().map_err(IoError::on("read"))?.len();
    let [head, record] = INDEX_BYTES;
    if found == head + record * points as u64 {
        return Ok(());
    }
    Err(differs(format!("an index of {found} bytes")))
}

fn read_points(path: &Path, points: impl Iterator<Item = PointZ>) -> Result<()> {
    let unreadable = |error: shapefile::Error| Error::from(ProductError::unreadable(error));
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

/// A record of the attribute table, which borrows its values.
struct Record<'a> {
    values: &'a [Values],
    row: usize,
}

impl WritableRecord for Record<'_> {
    fn write_using<W: std::io::Write>(
        &self,
        writer: &mut FieldWriter<'_, W>,
    ) -> std::result::Result<(), FieldError> {
        for values in self.values {
            match cell(values, self.row) {
                Cell::Number(number) => writer.write_next_field_value(&number)?,
                Cell::Text(text) => writer.write_next_field_value(&text)?,
            }
        }
        Ok(())
    }
}

/// A value for dBASE.
enum Cell<'a> {
    Number(Option<f64>),
    Text(&'a str),
}

/// The values with instants as texts: dBASE has days only.
fn texts(values: Vec<Values>) -> Vec<Values> {
    let text = |values: Values| match values {
        Values::Time(times) => {
            let texts = times.iter().map(|utc| format!("{utc}Z"));
            Values::Text(StringArray::from_iter_values(texts))
        }
        values => values,
    };
    values.into_iter().map(text).collect()
}

fn cell(values: &Values, row: usize) -> Cell<'_> {
    match values {
        Values::Real(of) => Cell::Number(Some(of[row])),
        Values::OptionalReal(of) => Cell::Number(of[row]),
        Values::Natural(of) => Cell::Number(Some(of[row].into())),
        Values::Integer(of) => Cell::Number(Some(of[row].into())),
        Values::Flag(of) => Cell::Number(Some(of[row].into())),
        Values::Text(of) => Cell::Text(of.value(row)),
        // Instants are texts here, see `texts`.
        Values::Time(_) | Values::Bytes(_) => Cell::Text(""),
    }
}

/// Writes the table of attributes and reads it back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk or the encoder; records that are read back differently.
fn write_attributes(path: &Path, newest_utc: &str, table: &Table) -> Result<()> {
    let bytes = encode_attributes(newest_utc, table).in_file(path)?;
    write_bytes(path, &bytes)?;
    drop(bytes);
    read_attributes(path, table).in_file(path)
}

fn encode_attributes(newest_utc: &str, table: &Table) -> Result<Vec<u8>> {
    let refused = |error: dbase::Error| ProductError::refused("encode dBASE")(error);
    let mut fields = TableWriterBuilder::with_encoding(dbase::encoding::Unicode);
    for (field, width) in dbase_fields(table).zip(text_widths(table)?) {
        let name =
            FieldName::try_from(field.name).map_err(ProductError::refused("name a field"))?;
        fields = match width {
            Some(width) => fields.add_character_field(name, width),
            None => fields.add_numeric_field(name, field.width, field.decimals),
        };
    }
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = fields.build_with_dest(&mut bytes);
    for rows in table.pieces() {
        let values = &texts(table.values(rows.clone())?);
        for row in 0..rows.len() {
            let record = Record { values, row };
            writer.write_record(&record).map_err(refused)?;
        }
    }
    writer.finalize().map_err(refused)?;
    drop(writer);
    let mut bytes = bytes.into_inner();
    // The library has written today's date there.
    bytes[1..4].copy_from_slice(&day(newest_utc));
    Ok(bytes)
}

fn dbase_fields(table: &Table) -> impl Iterator<Item = DbaseField> {
    table.columns().filter_map(|column| column.dbase)
}

/// Bytes of the longest text of each text column; `None` for the others.
fn text_widths(table: &Table) -> Result<Vec<Option<u8>>> {
    let mut widths = vec![None; table.columns().count()];
    for (width, column) in widths.iter_mut().zip(table.columns()) {
        *width = matches!(column.kind, Kind::Text | Kind::List | Kind::Time).then_some(1);
    }
    for rows in table.pieces() {
        for (width, values) in widths.iter_mut().zip(texts(table.values(rows)?)) {
            if let (Some(width), Values::Text(texts)) = (width, values) {
                let longest = texts.iter().flatten().map(str::len).max().unwrap_or(0);
                let longest = u8::try_from(longest.min(TEXT_MAX)).unwrap_or(u8::MAX);
                *width = longest.max(*width);
            }
        }
    }
    Ok(widths)
}

/// Day of a time, for the same bytes each day: years since 1900, month, day.
fn day(utc: &str) -> [u8; 3] {
    let number = |range| -> u16 {
        let digits: Option<&str> = utc.get(range);
        digits.and_then(|text| text.parse().ok()).unwrap_or(0)
    };
    [
        number(0..4).saturating_sub(1900),
        number(5..7),
        number(8..10),
    ]
    .map(|value| u8::try_from(value).unwrap_or(u8::MAX))
}

fn differs(what: String) -> Error {
    ProductError::ReadBack { what }.into()
}

fn read_attributes(path: &Path, table: &Table) -> Result<()> {
    let unreadable = |error: dbase::Error| Error::from(ProductError::unreadable(error));
    let mut reader = dbase::Reader::new(BufReader::new(open(path)?)).map_err(unreadable)?;
    let mut found = reader.iter_records();
    for rows in table.pieces() {
        let values = texts(table.values(rows.clone())?);
        for row in 0..rows.len() {
            let record = found.next().transpose().map_err(unreadable)?;
            let holds = |record: dbase::Record| {
                let mut fields = dbase_fields(table).zip(&values);
                fields.all(|(field, values)| holds(&record, field, &cell(values, row)))
            };
            if !record.is_some_and(holds) {
                let number = rows.start + row + 1;
                return Err(differs(format!("attributes of point {number}")));
            }
        }
    }
    if found.next().is_some() {
        let rows = table.rows();
        return Err(differs(format!("attributes of more than {rows} points")));
    }
    Ok(())
}

/// Whether a record holds the value; numbers within half a unit of the last decimal.
fn holds(record: &dbase::Record, field: DbaseField, expected: &Cell) -> bool {
    match (record.get(field.name), expected) {
        (Some(FieldValue::Numeric(Some(found))), Cell::Number(Some(expected))) => {
            let digit = 10_f64.powi(-i32::from(field.decimals));
            let tolerance = 0.5 * digit + 4.0 * f64::EPSILON * expected.abs();
            (found - expected).abs() <= tolerance
        }
        (Some(FieldValue::Numeric(None)), Cell::Number(None)) => true,
        (Some(FieldValue::Character(found)), Cell::Text(expected)) => {
            found.as_deref().unwrap_or_default() == *expected
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    use crate::gis::tests::example;
    use areograph_base::error::Kind as FailureKind;

    fn table() -> Table<'static> {
        example().attributes.for_dbase()
    }

    #[test]
    fn a_changed_attribute_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dbf");
        write_attributes(&path, &example().newest_utc, &table()).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes[1..4], [99, 8, 24]);
        // The last written digit of a longitude.
        let digits = b"177.312345679";
        let at = bytes
            .windows(digits.len())
            .rposition(|window| window == digits);
        let mut changed = bytes;
        changed[at.unwrap() + digits.len() - 1] = b'8';
        write_bytes(&path, &changed).unwrap();
        let failure = read_attributes(&path, &table()).unwrap_err();
        assert_eq!(
            failure.cause.to_string(),
            "read back differently: attributes of point 2"
        );
    }

    /// The library would report a full disk as its own error.
    #[test]
    fn a_full_disk_is_reported_as_such() {
        let full = Path::new("/dev/full");
        let failure = write_attributes(full, &example().newest_utc, &table()).unwrap_err();
        assert_eq!(failure.kind(), FailureKind::Io);
        assert_eq!(failure.file.as_deref(), Some(full));
        assert!(failure.to_string().contains("free some space"), "{failure}");
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
                failure.cause.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
