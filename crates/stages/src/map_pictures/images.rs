//! The images of the pictures of a net.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use areograph_base::error::{Cause, Locate as _, Result};
use areograph_config::{NetConfig, YAxis};
use areograph_geom::plane::Place;
use areograph_pds::plane_tables::{ImageOfPicture, read_pictures};
use areograph_store::{
    files::{HashedFile, file_name},
    stage::{Input, Inputs},
};

use super::{CELLS_MAX, ORTHOIMAGES_MAX};

/// The image of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct PictureImage {
    /// Name of the picture.
    pub picture: String,
    /// The file.
    pub path: PathBuf,
    /// Coordinates of the outer corner of its first pixel, y as in the measurements; `None` for a corner of the image at the origin.
    pub corner: Option<Place>,
    /// Edge of a pixel, units of the picture.
    pub pixel_units: f64,
}

/// The images of the pictures of a net, their files with their hashes, and the direction of y in all pictures.
#[derive(Debug, Clone, Copy)]
pub struct PictureImages<'a>(pub &'a [PictureImage], pub &'a [HashedFile], pub YAxis);

impl Input for PictureImages<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        let places = self.0.iter().map(|image| {
            let corner = image.corner.map(|at| [at.re, at.im]);
            (&image.picture, corner, image.pixel_units)
        });
        inputs.setting(&format!("{field} (places)"), &places.collect::<Vec<_>>());
        inputs.setting(&format!("{field} (y_axis)"), &self.2);
        for (place, file) in self.1.iter().enumerate() {
            inputs.file(field, &file.path, Some(place), &file.blake3);
        }
    }
}

/// Images that cannot be put on the map.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub(super) enum PicturesError {
    #[error("picture {picture}: the table names image {file}, which does not exist")]
    #[cause("correct the column image; paths are relative to the folder of the table")]
    Missing { picture: String, file: String },
    #[error("picture {picture}: the table names image {file}, which is a folder; expected a file")]
    #[cause("correct the column image; paths are relative to the folder of the table")]
    Folder { picture: String, file: String },
    #[error("pictures {} and {} name the same image {file}; expected an image of its own for each picture", pictures[0], pictures[1])]
    #[cause("correct the column image of one of them")]
    Shared { pictures: [String; 2], file: String },
    #[error("picture {picture} has two images; expected one row for each picture")]
    #[cause("remove one of the rows from pictures.files")]
    Twice { picture: String },
    #[error(
        "picture {picture} has an image, and film.files gives ticks; expected coordinates without film correction"
    )]
    #[cause(
        "remove the column image, or give measurements in pixels of the image without film.files"
    )]
    Film { picture: String },
    #[error("picture {picture} has an image and no place in the net: it has no measurements")]
    #[cause("measure points in the picture, or remove its image")]
    NotInNet { picture: String },
    #[error(
        "picture {picture}: point {point} is at line {line:.1}, sample {sample:.1} of its image, which has {lines} lines of {samples} samples"
    )]
    #[cause(
        "check image_x, image_y and pixel_units of the picture, measurements.y_axis, and whether the image is complete"
    )]
    Outside {
        picture: String,
        point: String,
        line: f64,
        sample: f64,
        lines: usize,
        samples: usize,
    },
    #[error("picture {picture}: no cell of {cell_m:.4} m shows its image")]
    #[cause("decrease map.cell_m; check that the image has pixels other than 0")]
    Empty { picture: String, cell_m: f64 },
    #[error("{count} pictures have images; expected at most {ORTHOIMAGES_MAX}")]
    #[cause("divide the net, or remove some images")]
    TooMany { count: usize },
    #[error("the mosaic requires {cells} cells of {cell_m:.4} m; expected at most {CELLS_MAX}")]
    #[cause("increase map.cell_m, or remove some images")]
    TooLarge { cell_m: f64, cells: u64 },
}

/// The images that the tables of pictures name.
///
/// # Errors
/// A table that cannot be read; a file that does not exist; two images of a picture, or two pictures of an
/// image; too many images; a film correction.
pub fn picture_images(config: &NetConfig) -> Result<Vec<PictureImage>> {
    let mut images: Vec<PictureImage> = Vec::new();
    let mut files: BTreeMap<PathBuf, String> = BTreeMap::new();
    for table in &config.pictures.files {
        // The stage that solves the net reports malformed rows.
        for row in read_pictures(table)?.rows {
            let Some(image) = row.image else { continue };
            let image = one(config, table, row.picture, image).in_file(table)?;
            if images.iter().any(|of| of.picture == image.picture) {
                let picture = image.picture;
                return Err(PicturesError::Twice { picture }).in_file(table);
            }
            // Also by another name of the file.
            let file = image.path.canonicalize();
            let file = file.unwrap_or_else(|_| image.path.clone());
            if let Some(other) = files.insert(file, image.picture.clone()) {
                let file = file_name(&image.path);
                let pictures = [other, image.picture];
                return Err(PicturesError::Shared { pictures, file }).in_file(table);
            }
            images.push(image);
        }
    }
    if images.len() > ORTHOIMAGES_MAX {
        let count = images.len();
        return Err(PicturesError::TooMany { count }).in_file(&config.file);
    }
    Ok(images)
}

fn one(
    config: &NetConfig,
    table: &Path,
    picture: String,
    image: ImageOfPicture,
) -> std::result::Result<PictureImage, PicturesError> {
    if !config.film.files.is_empty() {
        return Err(PicturesError::Film { picture });
    }
    let folder = table.parent().unwrap_or_else(|| Path::new(""));
    let ImageOfPicture {
        file,
        corner,
        pixel_units,
    } = image;
    let path = folder.join(file);
    if !path.is_file() {
        let file = file_name(&path);
        return Err(if path.is_dir() {
            PicturesError::Folder { picture, file }
        } else {
            PicturesError::Missing { picture, file }
        });
    }
    Ok(PictureImage {
        picture,
        path,
        corner,
        pixel_units,
    })
}
