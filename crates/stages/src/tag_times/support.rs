//! Image support data as a source of times, camera and orientation, checked to be those of the site's body.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{
    Disagreement, ImageTimes, StartFrom, agreement::of_one_product, camera::camera_agrees,
};
use areograph_base::{body::Body, constants::Spacecraft, error::Result};
use areograph_config::{ImageConfig, all_instruments};
use areograph_pds::isd::{ImageSupport, SupportTables, read_isd};
use areograph_spice::Session;
use areograph_store::files::{HashedFile, file_name};

/// Support data of an image, and their file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SupportFile {
    /// File name, without folders.
    pub name: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub blake3: String,
    /// Name of the spacecraft.
    pub platform: String,
    /// Whether positions are those of the spacecraft with the laser, geometric.
    pub has_laser: bool,
    /// Positions and rotations.
    pub tables: SupportTables,
}

impl SupportFile {
    /// Reads the support data of `image`, which shows `body`, from the file at `path`.
    ///
    /// # Errors
    /// As [`read_isd`]; support data of another body.
    fn read(
        body: Body,
        image: &ImageConfig,
        path: &Path,
        hashed: Option<&HashedFile>,
    ) -> Result<(ImageSupport, Self)> {
        let said = read_isd(path)?;
        said.sees(body, &image.id)?;
        of_one_product(
            image,
            ("support data are those", said.identifier.as_deref()),
        )?;
        let file = Self {
            name: file_name(path),
            bytes: hashed.map_or(0, |file| file.bytes),
            blake3: hashed.map_or_else(String::new, |file| file.blake3.clone()),
            platform: said.platform.clone(),
            has_laser: image.has_laser,
            tables: said.tables.clone(),
        };
        Ok((said, file))
    }

    /// Whether it names this spacecraft.
    #[must_use]
    pub fn is_of(&self, spacecraft: &Spacecraft) -> bool {
        spacecraft.label_name.eq_ignore_ascii_case(&self.platform)
    }

    /// A note on what is used from the file.
    fn note(&self) -> String {
        format!(
            "camera, line times and orientation are those of the support data {}; no pointing bias, clock correction \
             or light time is applied to them",
            self.name
        )
    }
}

/// Times and camera of an image from its support data.
pub(super) fn supported(
    body: Body,
    image: &ImageConfig,
    path: &Path,
    hashed: Option<&HashedFile>,
    session: &Session,
) -> Result<ImageTimes> {
    let (said, file) = SupportFile::read(body, image, path, hashed)?;
    let start = said.line_times.start();
    session.require_published_utc(start)?;
    let period_s = said.line_times.mean_period_s();
    let turned = file.tables.frame_remark(body, &file.name, start);
    let mut remarks: Vec<Disagreement> = turned.map(Disagreement::from).into_iter().collect();
    // A number of NAIF is that of its spacecraft only.
    if file.is_of(said.instrument.spacecraft) {
        remarks.extend(camera_agrees(&said.instrument, all_instruments()));
    }
    Ok(ImageTimes {
        id: image.id.clone(),
        body,
        start_from: StartFrom::Support,
        sclk_start: None,
        utc_start: session.et_to_utc(start)?,
        exposure_s: period_s / f64::from(said.downtrack_summing),
        downtrack_summing: said.downtrack_summing,
        crosstrack_summing: said.crosstrack_summing,
        lines_delivered: said.line_times.lines(),
        samples: said.samples,
        first_detector: said.first_detector,
        has_stop_time: false,
        notes: vec![file.note()],
        remarks,
        instrument: said.instrument,
        line_times: said.line_times,
        support: Some(file),
    })
}
