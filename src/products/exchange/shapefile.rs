//! Footprints as a shapefile of three-dimensional points, as made from `pedr2tab` tables.

use std::{
    fs::File,
    io::{BufReader, BufWriter, Seek as _, SeekFrom, Write},
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
        footprints::file_name,
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
    write_points(path, site, points)?;
    let table = path.with_extension("dbf");
    write_attributes(&table, site, points)?;
    write_text(&path.with_extension("prj"), CRS_WKT)?;
    write_text(&path.with_extension("cpg"), "UTF-8")?;
    read_points(path, site, points).in_file(path)?;
    read_attributes(&table, site, points).in_file(&table)?;
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
        texts: [site.utc[row].clone(), file_name(site, shot.file)],
    }
}

/// The disk's refusal, or the library's.
fn refused(error: shapefile::Error) -> Failure {
    match error {
        shapefile::Error::IoError(source) => IoFault::on("write")(source).into(),
        error => ProductFault::refused("encode shapefile")(error).into(),
    }
}

fn write_points(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<()> {
    let index = path.with_extension("shx");
    let (mut shp, mut shx) = (create(path)?, create(&index)?);
    let mut writer = ShapeWriter::with_shx(&mut shp, &mut shx);
    for (row, at) in points.iter().enumerate() {
        writer
            .write_shape(&point(site, row, at))
            .map_err(refused)
            .in_file(path)?;
    }
    writer.finalize().map_err(refused).in_file(path)?;
    drop(writer);
    finish(path, shp)?;
    finish(&index, shx)
}

fn write_attributes(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<()> {
    let mut file = create(path)?;
    let refused = |error: dbase::Error| ProductFault::refused("encode dBASE")(error);
    let mut fields = TableWriterBuilder::with_encoding(dbase::encoding::Unicode);
    for (name, width, decimals) in NUMBERS {
        fields = fields.add_numeric_field(field_name(name).in_file(path)?, width, decimals);
    }
    for (name, width) in TEXTS.into_iter().zip(text_widths(site)) {
        fields = fields.add_character_field(field_name(name).in_file(path)?, width);
    }
    let mut writer = fields.build_with_dest(&mut file);
    for row in 0..points.len() {
        writer
            .write_record(&attributes(site, row))
            .map_err(refused)
            .in_file(path)?;
    }
    writer.finalize().map_err(refused).in_file(path)?;
    drop(writer);
    date_by_newest_shot(&mut file, site)
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

/// The table's header holds a date: that of the newest shot instead of today's, for the same bytes each day.
fn date_by_newest_shot(file: &mut BufWriter<File>, site: &SiteProducts) -> std::io::Result<()> {
    let newest = site.utc.iter().max().map_or("", String::as_str);
    let digits = |range| newest.get(range).and_then(|text: &str| text.parse().ok());
    let year: u16 = digits(0..4).unwrap_or(1900);
    let [month, day] = [5..7, 8..10].map(|range| digits(range).and_then(|n| u8::try_from(n).ok()));
    let since_1900 = u8::try_from(year.saturating_sub(1900)).unwrap_or(0);
    file.seek(SeekFrom::Start(1))?;
    file.write_all(&[since_1900, month.unwrap_or(1), day.unwrap_or(1)])
}

fn differs(what: String) -> Failure {
    ProductFault::ReadBack { what }.into()
}

fn read_points(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<()> {
    let unreadable = |error: shapefile::Error| Failure::from(ProductFault::unreadable(error));
    let mut reader = ShapeReader::new(BufReader::new(open(path)?)).map_err(unreadable)?;
    let mut found = reader.iter_shapes_as::<PointZ>();
    for (row, at) in points.iter().enumerate() {
        let next = found.next().transpose().map_err(unreadable)?;
        if next != Some(point(site, row, at)) {
            return Err(differs(format!("point {}", row + 1)));
        }
    }
    if found.next().is_some() {
        return Err(differs(format!("more than {} points", points.len())));
    }
    Ok(())
}

fn read_attributes(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<()> {
    let unreadable = |error: dbase::Error| Failure::from(ProductFault::unreadable(error));
    let source = BufReader::new(open(path)?);
    let mut reader = dbase::Reader::new(source).map_err(unreadable)?;
    let mut rows = 0;
    for (row, record) in reader.iter_records().enumerate() {
        let record = record.map_err(unreadable)?;
        if row >= points.len() || !holds(&record, &attributes(site, row)) {
            return Err(differs(format!("attributes of point {}", row + 1)));
        }
        rows = row + 1;
    }
    if rows != points.len() {
        return Err(differs(format!("{rows} attributes of {}", points.len())));
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
