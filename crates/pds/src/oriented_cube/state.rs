//! The state of a camera model in a cube: the string `CSMState` of `csminit`.
//!
//! Camera, line times and orientation come from the state; the label only names the image. ISIS takes the state where a cube
//! has tables as well, and so does areograph.
//!
//! # Source
//! `csminit`, `StringBlob` and `CameraFactory` of ISIS: object `String` with `Name`, `StartByte`, `Bytes`, `ModelName` and
//! `PluginName`.

use std::fs::File;

use super::{
    Orientation, OrientedCube, Part,
    error::CubeError,
    label_text, projection_name,
    table::{BYTES_MAX, read_bytes},
};
use crate::{
    image_label::ImageLabel,
    isd::{StateError, support_of_state},
    label::Label,
    moc,
    read_label::product_named,
};
use areograph_base::{constants::SPACECRAFT, error::Result, instruments::Instrument};

const NAME: &str = "CSMState";

/// The description of a state in the label.
struct Described<'a> {
    label: &'a Label,
    block: usize,
}

impl Described<'_> {
    fn keyword(&self, key: &str) -> &str {
        let mut own = self.label.entries.iter();
        let found = own.find(|entry| entry.block == self.block && entry.key == key);
        found.map_or("", |entry| &entry.value)
    }

    fn refused(key: &str, value: &str, expected: String) -> CubeError {
        CubeError::Table {
            object: format!("string {NAME}"),
            key: key.to_owned(),
            value: format!("{value:?}"),
            expected,
        }
    }

    /// A place or length in bytes.
    fn count(&self, key: &'static str, max: u64) -> std::result::Result<u64, CubeError> {
        let value = self.keyword(&key.to_ascii_uppercase());
        let count = value.parse().ok();
        let count = count.filter(|count: &u64| (1..=max).contains(count));
        count.ok_or_else(|| Self::refused(key, value, format!("a count from 1 to {max}")))
    }

    fn text(&self, file: &File) -> Result<Vec<u8>> {
        let start = self.count("StartByte", i64::MAX.unsigned_abs())?;
        let bytes = self.count("Bytes", BYTES_MAX)?;
        read_bytes(file, &format!("string {NAME}"), [start, bytes])
    }
}

/// The cube by its state; `None` without one.
pub(super) fn read(
    label: &Label,
    file: &File,
    cameras: &[Instrument],
) -> Result<Option<OrientedCube>> {
    let mut entries = label.entries.iter();
    let Some(named) = entries.find(|entry| {
        entry.group == "STRING" && entry.key == "NAME" && entry.value.eq_ignore_ascii_case(NAME)
    }) else {
        return Ok(None);
    };
    let described = Described {
        label,
        block: named.block,
    };
    let model = described.keyword("MODELNAME");
    if !model.is_empty() {
        StateError::unless_line_scanner(model)?;
    }
    let text = described.text(file)?;
    let of_image = label_of_image(label, cameras)?;
    let camera = of_image.as_ref().map(|of| of.instrument.naif.instrument);
    let mut support = support_of_state(&text, camera)?;
    let size = [support.line_times.lines(), support.samples];
    of_this_size(label, size)?;
    let product = of_image.as_ref().and_then(|of| of.product_id.clone());
    let products =
        [&product, &support.identifier].map(|name| name.as_deref().and_then(product_named));
    if let [Some(of_label), Some(of_state)] = products
        && of_label != of_state
    {
        Err(CubeError::StateOfOther {
            state: of_state,
            label: of_label,
        })?;
    }
    support.identifier = product.or(support.identifier);
    Ok(Some(OrientedCube {
        support,
        label: of_image,
        part: Part::all(size),
        projection: projection_name(label),
        orientation: Orientation::State {
            model: crate::isd::LINE_SCANNER.to_owned(),
            plugin: described.keyword("PLUGINNAME").to_owned(),
        },
    }))
}

/// The label of an image of MOC; other cameras are known by their state only.
fn label_of_image(label: &Label, cameras: &[Instrument]) -> Result<Option<ImageLabel>> {
    let spacecraft = label_text(label, "INSTRUMENT", "SPACECRAFTNAME").unwrap_or_default();
    if spacecraft.eq_ignore_ascii_case(&SPACECRAFT.label_name) {
        return Ok(Some(moc::label_of_camera(label, cameras)?));
    }
    Ok(None)
}

/// The state must have the cube's own lines and samples, which a map projection replaces by others.
fn of_this_size(label: &Label, state: [u32; 2]) -> std::result::Result<(), CubeError> {
    let (group, keys) = if projection_name(label).is_some() {
        ("ALPHACUBE", ["BETALINES", "BETASAMPLES"])
    } else {
        ("DIMENSIONS", ["LINES", "SAMPLES"])
    };
    let [lines, samples] = keys.map(|key| {
        let count = label_text(label, group, key)?.parse().ok();
        count.filter(|count: &u32| *count > 0)
    });
    match lines.zip(samples) {
        Some((lines, samples)) if state != [lines, samples] => Err(CubeError::StateSize {
            state,
            cube: [lines, samples],
        }),
        _ => Ok(()),
    }
}
