//! Image support data, or an oriented cube, as a source of times, camera and orientation, checked to belong to the
//! site's body.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{
    Disagreement, ImageTimes, StartFrom,
    agreement::{mounting_agrees, of_one_clock, of_one_product, start_agrees, stop_agrees},
    calibrated_note,
    camera::other_orbit_remark,
    camera::{camera_agrees, known_one},
    detector::within_detector,
};
use areograph_base::{
    body::Body,
    constants::Spacecraft,
    error::{Locate as _, Result},
};
use areograph_config::{ImageConfig, all_instruments, built_in_instruments};
use areograph_pds::{
    ImageLabel,
    isd::{ImageSupport, SupportTables, read_isd},
    oriented_cube::{OrientedCube, read_oriented_cube},
};
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
    /// Whether positions are geometric positions of the spacecraft with the laser.
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
    ) -> Result<(ImageSupport, Option<OrientedCube>, Self)> {
        let (support, cube) = if image.cube.is_some() {
            let cube = read_oriented_cube(path, built_in_instruments())?;
            (cube.support.clone(), Some(cube))
        } else {
            (read_isd(path)?, None)
        };
        support.sees(body, &image.id)?;
        of_one_product(
            image,
            ("support data belong to", support.identifier.as_deref()),
        )?;
        let file = Self {
            name: file_name(path),
            bytes: hashed.map_or(0, |file| file.bytes),
            blake3: hashed.map_or_else(String::new, |file| file.blake3.clone()),
            platform: support.platform.clone(),
            has_laser: image.has_laser,
            tables: support.tables.clone(),
        };
        Ok((support, cube, file))
    }

    /// Whether it names this spacecraft.
    #[must_use]
    pub fn is_of(&self, spacecraft: &Spacecraft) -> bool {
        spacecraft.label_name.eq_ignore_ascii_case(&self.platform)
    }

    /// A note on the data used from the file.
    fn note(&self) -> String {
        format!(
            "camera, line times and orientation come from the support data {}; no pointing bias, clock correction \
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
    let (said, cube, file) = SupportFile::read(body, image, path, hashed)?;
    let start = said.line_times.start();
    session.require_published_utc(start)?;
    let period_s = said.line_times.mean_period_s();
    let turned = file.tables.frame_remark(body, &file.name, start);
    let mut remarks: Vec<Disagreement> = turned.map(Disagreement::from).into_iter().collect();
    // A NAIF number is valid for its spacecraft only.
    if file.is_of(said.instrument.spacecraft) {
        if let Some(camera) = known_one(&said.instrument, all_instruments()) {
            let part = [said.first_detector, said.samples];
            within_detector(&image.id, camera, said.crosstrack_summing, part).in_file(path)?;
        }
        remarks.extend(camera_agrees(&said.instrument, all_instruments()));
    }
    let mut notes = vec![file.note()];
    if let Some(of) = &said.instrument.calibration {
        notes.push(calibrated_note(of));
        remarks.extend(other_orbit_remark(of));
        remarks.extend((!of.valid).then(|| {
            let name = &of.calibration;
            Disagreement::from(format!(
                "its camera is the result of the invalid calibration {name}"
            ))
        }));
    }
    let label = cube.as_ref().and_then(|cube| cube.label.as_ref());
    if let Some(cube) = &cube {
        notes.extend(cube.notes());
        if let Some(label) = label {
            remarks.extend(against_label(image, (cube, label), session)?);
        }
    }
    Ok(ImageTimes {
        id: image.id.clone(),
        body,
        start_from: StartFrom::Support,
        sclk_start: label.and_then(|label| label.fields.sclk_start.clone()),
        utc_start: session.et_to_utc(start)?,
        exposure_s: period_s / f64::from(said.downtrack_summing),
        downtrack_summing: said.downtrack_summing,
        crosstrack_summing: said.crosstrack_summing,
        lines_delivered: said.line_times.lines(),
        samples: said.samples,
        first_detector: said.first_detector,
        has_stop_time: label.is_some_and(|label| label.utc_stop.is_some()),
        notes,
        remarks,
        instrument: said.instrument,
        line_times: said.line_times,
        support: Some(file),
    })
}

/// Disagreements of the tables of a cube with its label.
fn against_label(
    image: &ImageConfig,
    (cube, label): (&OrientedCube, &ImageLabel),
    session: &Session,
) -> Result<Vec<Disagreement>> {
    let support = &cube.support;
    let sclk = label.fields.sclk_start.as_deref();
    of_one_clock(image, support.instrument.spacecraft, sclk)?;
    let mut remarks: Vec<Disagreement> =
        mounting_agrees(&support.instrument, &support.tables.pointing.constant)
            .into_iter()
            .collect();
    let lines = cube.part.lines;
    let period_s = support.line_times.mean_period_s() / f64::from(lines.factor);
    let whole_start = support
        .line_times
        .start()
        .plus(-f64::from(lines.first) * period_s);
    if let Some(utc) = label.fields.utc_start.as_deref() {
        let of_utc = session.utc_to_et(utc)?;
        let clock = (sclk.unwrap_or("of the tables"), whole_start);
        remarks.extend(start_agrees(&image.id, clock, (utc, of_utc))?);
        if let Some(stop) = label.utc_stop.as_deref() {
            let stop = (stop, session.utc_to_et(stop)?);
            let of_lines = ([lines.whole; 2], period_s);
            remarks.extend(stop_agrees(&image.id, of_utc, stop, of_lines)?);
        }
    }
    Ok(remarks)
}
