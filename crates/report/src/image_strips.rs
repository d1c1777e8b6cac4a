//! Images with their footprints before and after the adjustment, and the elevation profile of the footprints.
//!
//! Figure 1 of Shan et al. 2002 shows the profile of the altimeter on the image.

use std::cmp::Reverse;

use super::{
    html::{Markup, counted, html},
    map::relief,
    numbers::above_words,
    plots::{Extent, Panel, PanelPicture, Plot, Series, figure, thinned},
};
use areograph_base::error::Result;
use areograph_products::{SiteProducts, error::ProductError};
use areograph_stages::{
    lay_overlays::{Overlays, QuickLook},
    register::RegisteredPoints,
};

/// Number of images in the lead.
const IMAGES: usize = 2;
/// Pixels of the picture of an image.
const PIXELS: u64 = 160_000;
/// Largest number of footprints drawn with one orientation.
const DOTS: usize = 500;
/// Height of the panel with the image: enough for the name of its axis.
const PICTURE_HEIGHT: u32 = 200;
/// Colours of footprints before and after the adjustment.
const BEFORE: usize = 5;
const AFTER: usize = 1;

/// The images with pixels that show most footprints; empty for a site without pixels.
///
/// # Errors
/// A picture or a plot that the library rejects, which is a bug in areograph.
pub(super) fn figures(site: &SiteProducts) -> Result<Markup> {
    let strips = strips(site).into_iter().map(|strip| strip.figure(site));
    let strips: Vec<Markup> = strips.collect::<Result<_>>()?;
    Ok(html! { @for strip in strips { (strip) } })
}

/// An image with its footprints.
struct Strip<'a> {
    image: usize,
    look: &'a QuickLook,
    before: Shown,
    after: Option<Shown>,
}

/// Footprints in an image, thinned for the drawing.
struct Shown {
    /// Line and sample, 0 at the outer edge of the first one.
    places: Vec<(f64, f64)>,
    /// Line, and height above the areoid, metres.
    heights_m: Vec<(f64, f64)>,
    /// Number of all of them.
    count: usize,
}

fn strips<'a>(site: &SiteProducts<'a>) -> Vec<Strip<'a>> {
    let Some(overlays) = site.overlays else {
        return Vec::new();
    };
    let mut strips: Vec<Strip> = site
        .shown_images()
        .into_iter()
        .filter_map(|image| strip(site, overlays, image))
        .collect();
    strips.sort_by_key(|strip| Reverse(strip.latest().count));
    strips.truncate(IMAGES);
    strips
}

fn strip<'a>(site: &SiteProducts<'a>, overlays: &'a Overlays, image: usize) -> Option<Strip<'a>> {
    let look = overlays.quick_look(image)?;
    let adjusted = site.adjustment();
    let adjusted = adjusted.and_then(|(_, adjustment)| adjustment.images.get(image));
    Some(Strip {
        image,
        look,
        before: Shown::of(site, &site.images[image].registration.points),
        after: adjusted.map(|image| Shown::of(site, &image.registration.points)),
    })
}

impl Shown {
    fn of(site: &SiteProducts, points: &RegisteredPoints) -> Self {
        let inside: Vec<usize> = (0..points.len())
            .filter(|at| points.inside.at(*at))
            .collect();
        let height_m = |at: usize| site.footprints.topography_of_m(points.row.at(at) as usize);
        let drawn = thinned(&inside, DOTS);
        Self {
            places: drawn
                .iter()
                .map(|at| (points.line.at(*at), points.sample.at(*at)))
                .collect(),
            heights_m: drawn
                .iter()
                .map(|at| (points.line.at(*at), height_m(*at)))
                .collect(),
            count: inside.len(),
        }
    }
}

impl Strip<'_> {
    /// The footprints with the best orientation.
    fn latest(&self) -> &Shown {
        self.after.as_ref().unwrap_or(&self.before)
    }

    fn figure(&self, site: &SiteProducts) -> Result<Markup> {
        let image = &site.images[self.image];
        let (id, terms) = (&image.times.id, site.config.terms());
        let look = self.look.within(PIXELS);
        let reduction = f64::from(look.reduction);
        let [lines, samples] = [look.height, look.width].map(|count| f64::from(count) * reduction);
        let states = [
            ("orientation from the kernels", BEFORE, Some(&self.before)),
            ("adjusted orientation", AFTER, self.after.as_ref()),
        ];
        let series = |of: fn(&Shown) -> &Vec<(f64, f64)>| -> Vec<Series> {
            let each = states.iter().filter_map(|(name, colour, shown)| {
                let points = of((*shown)?).clone();
                Some(Series::dots(name, *colour, points))
            });
            each.collect()
        };
        let [along, across] = [lines, samples].map(|high| Extent { low: 0.0, high });
        let picture = Panel {
            height: PICTURE_HEIGHT,
            y: Extent::of([0.0, samples].into_iter()),
            picture: Some(PanelPicture {
                png: turned(&look)?,
                x: along,
                y: across,
            }),
            ..Panel::of("sample", series(|of| &of.places))
        };
        let ground = Panel {
            height: 240,
            ..Panel::of(above_words(terms.has_areoid), series(|of| &of.heights_m))
        };
        let count = self.latest().count;
        let thinned = match count.div_ceil(DOTS) {
            0 | 1 => String::new(),
            step => format!(", 1 in {step} drawn"),
        };
        let words = format!(
            "{id} with {}{thinned}, and heights from {}. Flight to the right; not to scale across the track. One pixel of the \
             picture is {} × {} pixels of the image.",
            counted(count, "footprint"),
            terms.altimeter,
            look.reduction,
            look.reduction,
        );
        figure(&Plot {
            x: Extent::of([0.0, lines].into_iter()),
            ..Plot::of(
                format!("{id} with its footprints"),
                words,
                "line",
                vec![picture, ground],
            )
        })
    }
}

/// The picture of an image with lines to the right and samples upwards, as PNG; missing pixels are transparent.
fn turned(look: &QuickLook) -> Result<Vec<u8>> {
    let [low, high] = look.range_dn.map(f64::from);
    let (columns, rows) = (look.height as usize, look.width as usize);
    let mut pixels = Vec::with_capacity(4 * columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let number = look.pixels[column * rows + (rows - 1 - row)];
            let share = (f64::from(number) - low) / (high - low).max(1.0);
            let grey = (255.0 * share.clamp(0.0, 1.0)).round() as u8;
            let opacity = if number == 0 { 0 } else { u8::MAX };
            pixels.extend([grey, grey, grey, opacity]);
        }
    }
    let png = relief::png(&pixels, look.height, look.width);
    Ok(png.map_err(ProductError::refused("draw an image"))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_run_to_the_right_and_samples_upwards() {
        // Two lines of three samples; the second sample of the second line is missing.
        let look = QuickLook {
            reduction: 1,
            width: 3,
            height: 2,
            pixels: vec![10, 20, 30, 40, 0, 60],
            range_dn: [10, 60],
            lines_missing: 0,
            lines_suspect: 0,
        };
        let file = turned(&look).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((frame.width, frame.height), (2, 3));
        let greys: Vec<[u8; 2]> = pixels
            .chunks_exact(4)
            .map(|pixel| [pixel[0], pixel[3]])
            .collect();
        // Upper row: the last sample of both lines; lower row: the first.
        assert_eq!(
            greys,
            [
                [102, 255],
                [255, 255],
                [51, 255],
                [0, 0],
                [0, 255],
                [153, 255]
            ]
        );
    }
}
