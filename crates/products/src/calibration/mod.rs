//! Products of a calibration: tables as Parquet and CSV, support data of every camera, a document, the report.

mod document;
mod images;
mod model;
mod points;
mod read;

use std::path::Path;

use super::{
    files::write_text,
    parquet,
    product::{Content, Declaration, Group, Product, Role, described, write_each},
    table::Table,
    text_table,
};
use areograph_base::error::{Locate as _, Result};
use areograph_config::CalibrationConfig;
use areograph_pds::isd::{CALIBRATED_BY, VALID};
use areograph_stages::calibrate::{Calibration, CameraResult};

pub use model::CalibrationModel;
pub use read::{PublishedCalibration, PublishedLine};

/// Placeholder of a camera in paths.
const CAMERA: &str = "<camera>";

/// Inputs of the products of a calibration.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationProducts<'a> {
    /// The configuration.
    pub config: &'a CalibrationConfig,
    /// The calibration.
    pub result: &'a Calibration,
    /// Terrain model and laser units; `None` for a calibration from tables.
    pub model: Option<CalibrationModel<'a>>,
    /// The report.
    pub page: &'a str,
}

/// Writer of a product of a calibration; returns its number of rows.
pub(super) type WriteCalibration = fn(&Path, &CalibrationProducts) -> Result<u64>;

/// The products of a calibration, in the order in which they are written; products of cameras come first.
static PRODUCTS: &[&Declaration<WriteCalibration>] = &[
    &points::TABLE,
    &points::CSV,
    &images::TABLE,
    &images::CSV,
    &document::DOCUMENT,
    &REPORT,
];

/// Writer of a product of a camera.
pub(super) type WriteCamera = fn(&Path, &CalibrationProducts, &CameraResult) -> Result<u64>;

/// Support data of a camera.
static CAMERA_SUPPORT: Declaration<WriteCamera> = Declaration {
    path: "cameras/<camera>/isd.json",
    what: "support data with the calibrated camera and orbit, for `[[images]] isd` and other readers of ISDs",
    readers: "areograph, usgscsm",
    rows: "",
    role: Role::Data,
    content: Content::Foreign,
    write: |path, of, camera| write_text(path, &named_by(of, camera)).map(|()| 0),
    uses: &[],
};

/// Support data that state by which calibration, with which verdict, and as which camera, they were calibrated.
fn named_by(of: &CalibrationProducts, camera: &CameraResult) -> String {
    let verdict = if of.result.verdict.valid {
        VALID
    } else {
        "invalid"
    };
    let origin = serde_json::json!({
        "calibration": of.config.calibration,
        "camera": camera.camera,
        "verdict": verdict,
    });
    let isd = &camera.isd;
    isd.replacen('{', &format!("{{\n  \"{CALIBRATED_BY}\": {origin},"), 1)
}

static REPORT: Declaration<WriteCalibration> =
    Declaration::report("the report of the calibration", |path, of| {
        write_text(path, of.page).map(|()| 0)
    });

/// The products in the documentation.
pub(super) fn group() -> Group {
    Group {
        heading: "Calibrations of the lines of a camera",
        source: "`areograph calibrate`, in the folder of the calibration",
        prefix: "calibration",
        placeholders: "; `<camera>` stands for a line of the camera",
        products: [
            described(&[&CAMERA_SUPPORT]),
            described(&model::PRODUCTS),
            described(PRODUCTS),
        ]
        .concat(),
    }
}

/// Writes every product of a calibration below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that
/// are not finite and files that read back differently.
pub fn write_calibration_products(
    directory: &Path,
    of: &CalibrationProducts,
) -> Result<Vec<Product>> {
    let mut products = Vec::new();
    for camera in &of.result.cameras {
        let relative = CAMERA_SUPPORT.path.replace(CAMERA, &camera.camera);
        let path = directory.join(&relative);
        let rows = (CAMERA_SUPPORT.write)(&path, of, camera).in_file(&path)?;
        products.push(Product {
            path: relative.into(),
            rows,
        });
    }
    let write = |write: &WriteCalibration, path: &Path| write(path, of);
    if of.model.is_some() {
        products.extend(write_each(directory, &model::PRODUCTS, write)?);
    }
    products.extend(write_each(directory, PRODUCTS, write)?);
    Ok(products)
}

/// Writes a table as Parquet with its metadata.
fn write_parquet(path: &Path, of: &CalibrationProducts, table: &Table) -> Result<u64> {
    let about = vec![("calibration", of.config.calibration.clone())];
    parquet::write(path, table, about)
}

/// Writes a table as CSV.
fn write_csv(path: &Path, table: Table) -> Result<u64> {
    text_table::write(path, table)
}
