//! A label in the style of PDS4 (information model 1.21) for a table of delimited text.
//!
//! It describes the file as PDS4 does; it is not an archive product, as its identifier is not the PDS's.

use std::{
    fmt::Write as _,
    io::{BufRead as _, BufReader, Read as _},
    path::Path,
};

use md5::{Digest as _, Md5};

use super::{
    coordinates::frame,
    files::{open, write_text},
    site::SiteProducts,
    table::{Kind, Meaning, Table},
};
use areograph_base::{
    constants::SPACECRAFT,
    error::{IoError, Locate, Result},
    utc::Utc,
};

/// Entries of the label on the file.
struct Described {
    name: String,
    bytes: u64,
    header_bytes: u64,
    md5: String,
}

/// Writes the label of `table`, which is in the file `described` beside it.
///
/// # Errors
/// Errors of the disk; a label that is read back differently.
pub(super) fn write(
    path: &Path,
    described: &Path,
    table: Table,
    site: &SiteProducts,
) -> Result<u64> {
    let (file, table) = (describe(described)?, table.for_text());
    write_text(path, &label(&file, &table, site))?;
    Ok(table.rows() as u64)
}

fn describe(path: &Path) -> Result<Described> {
    let mut file = BufReader::with_capacity(1 << 16, open(path)?);
    let mut hasher = Md5::new();
    let mut header = Vec::new();
    let read = |error| IoError::on("read")(error);
    file.read_until(b'\n', &mut header)
        .map_err(read)
        .in_file(path)?;
    hasher.update(&header);
    let mut bytes = header.len() as u64;
    let mut piece = vec![0; 1 << 16];
    loop {
        let length = file.read(&mut piece).map_err(read).in_file(path)?;
        if length == 0 {
            break;
        }
        hasher.update(&piece[..length]);
        bytes += length as u64;
    }
    Ok(Described {
        name: areograph_store::files::file_name(path),
        bytes,
        header_bytes: header.len() as u64,
        md5: hasher
            .finalize()
            .iter()
            .fold(String::new(), |mut text, byte| {
                let _infallible = write!(text, "{byte:02x}");
                text
            }),
    })
}

/// Text between tags.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// `None` for columns of bytes.
const fn data_type(kind: Kind) -> Option<&'static str> {
    Some(match kind {
        Kind::Real => "ASCII_Real",
        Kind::Natural | Kind::Integer => "ASCII_Integer",
        Kind::Flag => "ASCII_Boolean",
        Kind::Time => "ASCII_Date_Time_YMD_UTC",
        Kind::Text | Kind::List => "UTF8_String",
        Kind::Bytes => return None,
    })
}

/// A field and its number, counted from 1; `None` for columns of bytes.
fn field(number: usize, column: &Meaning) -> Option<String> {
    let unit = column.unit.symbol().map_or(String::new(), |unit| {
        format!("          <unit>{unit}</unit>\n")
    });
    Some(format!(
        "        <Field_Delimited>\n\
         \x20         <name>{}</name>\n\
         \x20         <field_number>{number}</field_number>\n\
         \x20         <data_type>{}</data_type>\n\
         {unit}\
         \x20         <description>{}</description>\n\
         \x20       </Field_Delimited>\n",
        escaped(column.name),
        data_type(column.kind)?,
        escaped(&column.description),
    ))
}

fn label(file: &Described, table: &Table, site: &SiteProducts) -> String {
    let fields: String = (1..)
        .zip(table.columns())
        .filter_map(|(number, column)| field(number, column))
        .collect();
    let count = table.columns().count();
    let rows = table.rows();
    let table_bytes = file.bytes - file.header_bytes;
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<Product_Observational xmlns="http://pds.nasa.gov/pds4/pds/v1">
{identification}{observation}  <File_Area_Observational>
    <File>
      <file_name>{name}</file_name>
      <file_size unit="byte">{bytes}</file_size>
      <records>{lines}</records>
      <md5_checksum>{md5}</md5_checksum>
    </File>
    <Header>
      <offset unit="byte">0</offset>
      <object_length unit="byte">{header_bytes}</object_length>
      <parsing_standard_id>PDS DSV 1</parsing_standard_id>
      <description>names of the columns</description>
    </Header>
    <Table_Delimited>
      <offset unit="byte">{header_bytes}</offset>
      <object_length unit="byte">{table_bytes}</object_length>
      <parsing_standard_id>PDS DSV 1</parsing_standard_id>
      <description>{frame}</description>
      <records>{rows}</records>
      <record_delimiter>Line-Feed</record_delimiter>
      <field_delimiter>Comma</field_delimiter>
      <Record_Delimited>
        <fields>{count}</fields>
        <groups>0</groups>
{fields}      </Record_Delimited>
    </Table_Delimited>
  </File_Area_Observational>
</Product_Observational>
"#,
        identification = identification(site),
        observation = observation(site),
        name = escaped(&file.name),
        bytes = file.bytes,
        header_bytes = file.header_bytes,
        md5 = file.md5,
        lines = rows + 1,
        frame = escaped(frame(site.config.body)),
    )
}

fn identification(site: &SiteProducts) -> String {
    let identifier = site.config.site.to_lowercase();
    format!(
        "  <Identification_Area>
    <logical_identifier>urn:areograph:{spacecraft}:footprints:{}</logical_identifier>
    <version_id>1.0</version_id>
    <title>{altimeter} footprints of the site {} in {frame}</title>
    <information_model_version>1.21.0.0</information_model_version>
    <product_class>Product_Observational</product_class>
  </Identification_Area>
",
        escaped(&identifier),
        escaped(&site.config.site),
        altimeter = escaped(&site.config.altimeter.name),
        frame = site.config.body.names().short_frame,
        spacecraft = if site.config.shots.is_empty() {
            &SPACECRAFT.id
        } else {
            &site.config.altimeter.id
        },
    )
}

/// Time, instrument and target of the shots.
fn observation(site: &SiteProducts) -> String {
    let utc = |shot: Option<Utc>| shot.map_or(String::new(), |utc| format!("{utc}Z"));
    let mission = if site.config.shots.is_empty() {
        SPACECRAFT.full_name.clone()
    } else {
        site.spacecraft()
    };
    let mission_id = mission.to_lowercase().replace(' ', "_");
    let body = site.config.body.names();
    let altimeter = escaped(&site.config.altimeter.full_name);
    format!(
        "  <Observation_Area>
    <Time_Coordinates>
      <start_date_time>{}</start_date_time>
      <stop_date_time>{}</stop_date_time>
    </Time_Coordinates>
    <Primary_Result_Summary>
      <purpose>Science</purpose>
      <processing_level>Derived</processing_level>
    </Primary_Result_Summary>
    <Investigation_Area>
      <name>{mission}</name>
      <type>Mission</type>
      <Internal_Reference>
        <lid_reference>urn:nasa:pds:context:investigation:mission.{mission_id}</lid_reference>
        <reference_type>data_to_investigation</reference_type>
      </Internal_Reference>
    </Investigation_Area>
    <Observing_System>
      <Observing_System_Component>
        <name>{mission}</name>
        <type>Host</type>
      </Observing_System_Component>
      <Observing_System_Component>
        <name>{altimeter}</name>
        <type>Instrument</type>
      </Observing_System_Component>
    </Observing_System>
    <Target_Identification>
      <name>{target}</name>
      <type>{class}</type>
    </Target_Identification>
  </Observation_Area>
",
        utc(site.utc.iter().min()),
        utc(site.utc.iter().max()),
        target = body.name,
        class = body.class,
    )
}
