//! The rectified pictures of a net on its map, offsets between them, and their mosaic: the purpose of a plane triangulation.
//!
//! The similarity transformation of every picture gives the pixel of every cell; cubic convolution interpolates the brightness there
//! (`cells.rs`). Offsets and mosaic are those of orthoimages (`compare_orthoimages`, `mosaic_images`), on the conformal map of the
//! net. Pictures have no places before the triangulation, so that there is no mosaic before it.
//!
//! # Source
//! Arthur & McMacken 1977; cubic convolution: Keys 1981.

mod cells;
mod images;

use std::sync::atomic::AtomicBool;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

pub use self::images::{PictureImage, PictureImages, picture_images};
use self::{cells::View, images::PicturesError};
use super::{
    compare_orthoimages::{CompareOrthoimages, OrthoimageOffsets},
    mosaic_images::{Mosaic, MosaicImages, ORTHOIMAGES_MAX},
    raster::first_cell,
    rectify_images::{CELLS_MAX, Orthoimage},
    triangulate::Triangulation,
};
use areograph_base::{
    error::{Locate as _, Result},
    watch::Watch,
};
use areograph_config::all_instruments;
use areograph_geom::{plane::Place, statistics::median};
use areograph_pds::pixel_file::{PixelFile, Pyramid};
use areograph_store::{
    stage::{Called, Output, Stage, called},
    stage_inputs,
};

/// Radius of the sphere on which a plane map is written as a grid of longitude and latitude, metres: so large that the cosine of the latitude of
/// a place on the map is 1.
pub const PLANE_RADIUS_M: f64 = 1e15;

stage_inputs! {
    /// A triangulated net and the images of its pictures.
    pub struct MapPictures<'a> {
        /// The pictures on the map.
        pub triangulation: &'a Output<Triangulation>,
        /// Their images.
        pub images: PictureImages<'a>,
        /// Edge of a cell, metres; the median size of the pixels where it is not given.
        pub cell_m: &'a Option<f64>,
    }
}

/// The pictures of a net on its map; a net without images has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PicturesOnMap {
    /// Those with an image, in the order of the numbers of the mosaic.
    pub pictures: Vec<MappedPicture>,
    /// Offsets between them, by their places in [`Self::pictures`]. East and north of a place are angles on a sphere of [`PLANE_RADIUS_M`].
    pub offsets: Vec<OrthoimageOffsets>,
    /// The mosaic; its grid is one of the same sphere.
    pub mosaic: Mosaic,
}

/// A picture on the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MappedPicture {
    /// Its name.
    pub picture: String,
    /// Edge of a pixel on the map, metres.
    pub pixel_m: f64,
    /// Number of cells with a brightness.
    pub filled: u32,
}

impl PicturesOnMap {
    /// For every seam that matching squares cross its pictures, the number of these squares, and the root mean square offset in them, metres.
    pub fn seams(&self) -> impl Iterator<Item = ([usize; 2], usize, f64)> {
        self.mosaic.account.seams.iter().filter_map(|seam| {
            let mut pairs = self.offsets.iter();
            let pair = pairs.find(|of| of.images == seam.images)?;
            let cells = seam.cells.iter().copied().collect();
            Some((
                seam.images,
                seam.cells.len(),
                pair.in_cells(&cells).rms_m()?,
            ))
        })
    }
}

impl Stage for MapPictures<'_> {
    const NAME: &'static str = "map_pictures";
    const CALLS: &'static [Called] = &[
        called::<CompareOrthoimages<'_>>(),
        called::<MosaicImages<'_>>(),
    ];
    type Output = Option<PicturesOnMap>;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<Option<PicturesOnMap>> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Option<PicturesOnMap>> {
        let net = self.triangulation.value()?;
        let images = self.images.0;
        if images.is_empty() {
            return Ok(None);
        }
        let cameras = all_instruments();
        let mut views = Vec::new();
        for image in images {
            watch.check()?;
            let file = PixelFile::open(&image.path, cameras)?;
            let pixels = Pyramid::of(&file).in_file(&image.path)?;
            let view = View::of(image, pixels, net, self.images.2);
            views.push(view.in_file(&image.path)?);
        }
        let mut sizes_m: Vec<f64> = views.iter().map(|view| view.pixel_m).collect();
        let cell_m = self.cell_m.unwrap_or_else(|| median(&mut sizes_m));
        let of_map = views.iter().map(|view| view.span(cell_m));
        let corners = of_map.fold([[i64::MAX; 2], [i64::MIN; 2]], |of, [first, end]| {
            let [least, most] = of;
            [
                [0, 1].map(|axis| least[axis].min(first[axis])),
                [0, 1].map(|axis| most[axis].max(end[axis])),
            ]
        });
        let [rows, columns] = [0, 1].map(|axis| corners[1][axis].abs_diff(corners[0][axis]));
        let cells = rows.saturating_mul(columns);
        if cells > CELLS_MAX as u64 {
            return Err(PicturesError::TooLarge { cell_m, cells }.into());
        }
        let mut made: Vec<Orthoimage> = Vec::new();
        for (index, view) in views.iter().enumerate() {
            let rectified = view.rectified(index, cell_m, watch)?;
            let empty = || PicturesError::Empty {
                picture: images[index].picture.clone(),
                cell_m,
            };
            made.push(rectified.ok_or_else(empty).in_file(&images[index].path)?);
        }
        let mut pairs = Vec::new();
        for (at, first) in made.iter().enumerate() {
            for second in &made[at + 1..] {
                watch.check()?;
                if overlap(first, second) {
                    pairs.extend(OrthoimageOffsets::between(first, second));
                }
            }
        }
        let inside_m = |of: usize, place_rad: [f64; 2]| {
            let [east_m, north_m] = place_rad.map(|of| of * PLANE_RADIUS_M);
            let view: &View = &views[of];
            let place = view.pixel(Place::new(east_m, north_m));
            let size = Vector2::from(view.size_px());
            place.inf(&(size - place)).min().max(0.0) * view.pixel_m
        };
        let Some(mosaic) = Mosaic::of(&made, &pairs, inside_m, watch)? else {
            return Ok(None);
        };
        let pictures = made.iter().zip(images).map(|(of, image)| MappedPicture {
            picture: image.picture.clone(),
            pixel_m: of.account.pixel_m,
            filled: of.account.filled,
        });
        Ok(Some(PicturesOnMap {
            pictures: pictures.collect(),
            offsets: pairs,
            mosaic,
        }))
    }
}

/// Whether two pictures have cells in common.
fn overlap(one: &Orthoimage, other: &Orthoimage) -> bool {
    let spans = [one, other].map(|of| {
        let first = first_cell(&of.account.map);
        let size = of.account.map.size;
        [0, 1].map(|axis| {
            (
                first[axis],
                first[axis].saturating_add_unsigned(size[axis] as u64),
            )
        })
    });
    (0..2).all(|axis| {
        let [(one, one_end), (other, other_end)] = [spans[0][axis], spans[1][axis]];
        one.max(other) < one_end.min(other_end)
    })
}
