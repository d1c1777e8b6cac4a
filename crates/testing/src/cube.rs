//! ISIS cubes with tables, as `spiceinit` leaves them, or strings, as `csminit` does, made for tests.

use std::fmt::Write as _;

/// First byte of the pixels, as ISIS writes it.
const START: usize = 65_537;

/// A table of numbers.
#[derive(Debug, Clone)]
pub struct CubeTable {
    /// Its name.
    pub name: &'static str,
    /// Lines of its description besides name, place and size.
    pub keywords: String,
    /// Names of its fields.
    pub fields: Vec<&'static str>,
    /// A row for each record.
    pub rows: Vec<Vec<f64>>,
}

impl CubeTable {
    /// A table with these rows.
    #[must_use]
    pub fn new(
        name: &'static str,
        keywords: &str,
        fields: &[&'static str],
        rows: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            name,
            keywords: keywords.to_owned(),
            fields: fields.to_vec(),
            rows,
        }
    }
}

/// A text.
#[derive(Debug, Clone)]
pub struct CubeString {
    /// Its name.
    pub name: &'static str,
    /// Lines of its description besides name, place and size.
    pub keywords: String,
    /// The text.
    pub text: String,
}

impl CubeString {
    /// The state of a line scanner of usgscsm.
    #[must_use]
    pub fn state(text: &str) -> Self {
        Self {
            name: "CSMState",
            keywords:
                "  ModelName = USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL\n  PluginName = UsgsAstroPluginCSM\n"
                    .to_owned(),
            text: text.to_owned(),
        }
    }
}

/// A cube of black bytes with these groups in its label, `size` lines and samples, and tables in the order of bytes.
#[must_use]
pub fn cube(groups: &str, size: [u32; 2], tables: &[CubeTable], is_msb: bool) -> Vec<u8> {
    cube_with(groups, size, (tables, &[]), is_msb)
}

/// The same, with strings after the tables.
#[must_use]
pub fn cube_with(
    groups: &str,
    [lines, samples]: [u32; 2],
    (tables, strings): (&[CubeTable], &[CubeString]),
    is_msb: bool,
) -> Vec<u8> {
    let order = if is_msb { "Msb" } else { "Lsb" };
    let mut label = format!(
        "Object = IsisCube\n  Object = Core\n    StartByte = {START}\n    Format = BandSequential\n    Group = Dimensions\n      \
         Samples = {samples}\n      Lines = {lines}\n      Bands = 1\n    End_Group\n    Group = Pixels\n      Type = UnsignedByte\n      \
         ByteOrder = {order}\n      Base = 0.0\n      Multiplier = 1.0\n    End_Group\n  End_Object\n{groups}End_Object\n\
         Object = Label\n  Bytes = {}\nEnd_Object\n",
        START - 1
    );
    let mut content = vec![1; (lines * samples) as usize];
    for table in tables {
        let bytes: Vec<u8> = table
            .rows
            .iter()
            .flatten()
            .flat_map(|number| {
                if is_msb {
                    number.to_be_bytes()
                } else {
                    number.to_le_bytes()
                }
            })
            .collect();
        let _ = write!(
            label,
            "Object = Table\n  Name = {}\n  StartByte = {}\n  Bytes = {}\n  Records = {}\n  ByteOrder = {order}\n{}",
            table.name,
            START + content.len(),
            bytes.len(),
            table.rows.len(),
            table.keywords
        );
        for field in &table.fields {
            let _ = write!(
                label,
                "  Group = Field\n    Name = {field}\n    Type = Double\n    Size = 1\n  End_Group\n"
            );
        }
        label.push_str("End_Object\n");
        content.extend(bytes);
    }
    for string in strings {
        let _ = write!(
            label,
            "Object = String\n  Name = {}\n  StartByte = {}\n  Bytes = {}\n{}End_Object\n",
            string.name,
            START + content.len(),
            string.text.len(),
            string.keywords
        );
        content.extend(string.text.bytes());
    }
    label.push_str("End\n");
    let mut file = label.into_bytes();
    file.resize(START - 1, 0);
    file.extend(content);
    file
}
