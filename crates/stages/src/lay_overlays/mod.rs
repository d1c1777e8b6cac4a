//! Images at footprints and tie points: a quick look of every image with pixels, and image chips around some
//! footprints, rejected tie points and those with the largest residuals.
//!
//! Pieces of all images show the same ground in the same place: north up, one scale. They are centred where an
//! orientation places a point, so that two images agree if the orientation is right.
//!
//! Each file of pixels is read once, strip by strip, for a quick look of bounded size and for the parts that pieces
//! need. Overlaid pieces show the quality of an orientation.

mod chips;
mod pixels;
mod places;
mod views;

use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::{
    adjust::Adjusted, convert_datum::Converted, group_profiles::Profile, image_pixels::PixelFiles,
    intersect::IntersectedTies, read_ties::Ties, site_image::SiteImages, tag_times::ImageTimes,
};
use areograph_base::error::Result;
use areograph_store::{
    stage::{Input, Inputs, Output, Stage},
    stage_inputs,
};

pub use chips::{CHIP_EDGE, Chip, Mark};
pub use pixels::QuickLook;
pub use places::Subject;

/// Quick looks of the images of a site, and places in them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Overlays {
    /// Images with pixels, in the order of the site's.
    pub images: Vec<ShownImage>,
    /// Places in them: footprints, then tie points.
    pub places: Vec<Place>,
}

/// An image with pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShownImage {
    /// Index of the image.
    pub image: usize,
    /// Its quick look.
    pub quick_look: QuickLook,
    /// The image in more detail, for pages that can be zoomed; `None` where the quick look has all detail, or where the
    /// site has too many images.
    pub view: Option<QuickLook>,
    /// Lines of its file, missing ones included.
    pub lines: u32,
    /// Complaints about its file; at most 1000 are kept.
    pub complaints: Vec<String>,
    /// Number of all complaints.
    pub complaint_count: u64,
}

impl ShownImage {
    /// A sentence on missing or damaged pixels; `None` without any.
    #[must_use]
    pub fn damage(&self) -> Option<String> {
        let (missing, suspect) = (self.quick_look.lines_missing, self.quick_look.lines_suspect);
        let first = match (self.complaint_count, self.complaints.first()) {
            (1, Some(only)) => format!("1 complaint: {only}"),
            (count, Some(first)) => format!("{count} complaints, first: {first}"),
            (_, None) => "no complaint".to_owned(),
        };
        (missing > 0 || suspect > 0 || self.complaint_count > 0).then(|| {
            format!(
                "{missing} of {} lines are missing and {suspect} may be damaged; {first}",
                self.lines
            )
        })
    }
}

/// A place on the ground in one image or two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// The subject of the place.
    pub subject: Subject,
    /// Edge of a pixel of its pieces on the ground, metres.
    pub pixel_m: f64,
    /// The centres of the pieces, in the order of [`PlaceView::chips`].
    pub centres: Vec<Mark>,
    /// The images that show it.
    pub views: Vec<PlaceView>,
}

/// A place in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlaceView {
    /// Index of the image.
    pub image: usize,
    /// Distance by which the adjustment moves it on the ground, metres; `None` where there is no adjustment.
    pub moved_m: Option<f64>,
    /// One piece for each of [`Place::centres`].
    pub chips: Vec<Chip>,
}

impl Overlays {
    /// The overlays without the pixels of [`ShownImage::view`].
    #[must_use]
    pub fn without_views(&self) -> Self {
        let images = self.images.iter().map(|shown| ShownImage {
            view: None,
            ..shown.clone()
        });
        Self {
            images: images.collect(),
            places: self.places.clone(),
        }
    }

    /// The quick look of the image with this index.
    #[must_use]
    pub fn quick_look(&self, image: usize) -> Option<&QuickLook> {
        let shown = self.images.iter().find(|shown| shown.image == image);
        shown.map(|shown| &shown.quick_look)
    }
}

stage_inputs! {
    /// Images with pixels, and the places shown in them.
    pub struct LayOverlays<'a> {
        /// Images with the orientation from the kernels.
        pub images: SiteImages<'a>,
        /// Images with the adjusted orientation; empty without an adjustment.
        pub adjusted_images: SiteImages<'a>,
        /// Files of pixels.
        pub pixels: PixelFiles<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Tie points.
        pub ties: Option<MeasuredTies<'a>>,
    }
}

/// Tie points, their intersections and their adjustment.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredTies<'a> {
    /// The tie points.
    pub ties: &'a Output<Ties>,
    /// Their ground points with the orientation from the kernels.
    pub intersected: &'a Output<IntersectedTies>,
    /// The adjustment, and their ground points with its orientation.
    pub adjusted: Option<(&'a Output<Adjusted>, &'a Output<IntersectedTies>)>,
}

impl Input for MeasuredTies<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        self.ties.add_to(field, inputs);
        self.intersected.add_to(field, inputs);
        if let Some((adjusted, intersected)) = self.adjusted {
            adjusted.add_to(field, inputs);
            intersected.add_to(field, inputs);
        }
    }
}

impl Stage for LayOverlays<'_> {
    const NAME: &'static str = "lay_overlays";
    const METHOD: u32 = 4;
    type Output = Overlays;
    stage_inputs!(fingerprint);

    /// Whether every file of pixels belongs to its image.
    fn examine(&self) -> Vec<Result<String>> {
        let opened = self.pixels.examined(self.images.0);
        let opened = opened
            .map(|(times, file)| file.map(|_| format!("image {}: pixels available", times.id)));
        opened.collect()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Overlays> {
        let times: Vec<&ImageTimes> = (self.images.0.iter())
            .map(|image| image.times.value())
            .collect::<Result<_>>()?;
        let files = self.pixels.opened(&times)?;
        let has_pixels: Vec<bool> = files.iter().map(Option::is_some).collect();
        let before = views::cameras(self.images.0)?;
        let after = views::cameras(self.adjusted_images.0)?;
        let wanted = places::wanted(self, &has_pixels)?;
        let mut planned: Vec<views::PlannedPlace> = (wanted.into_iter())
            .filter_map(|wanted| views::plan(wanted, &before, &after, &times))
            .collect();
        let mut images = Vec::new();
        let count = files.iter().flatten().count() as u64;
        for (image, file) in files.iter().enumerate() {
            let Some(file) = file else { continue };
            let patches = planned.iter_mut().flat_map(|place| place.patches_of(image));
            images.push(pixels::read(
                file,
                (image, times[image]),
                count,
                patches.collect(),
                stop,
            )?);
        }
        let places = planned.into_iter().map(views::PlannedPlace::cut);
        Ok(Overlays {
            images,
            places: places.collect(),
        })
    }
}
