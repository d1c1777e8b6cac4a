//! Tie points of a site, from files and matched; their ground points, and the adjustment.
//!
//! A site whose adjustment fails publishes all earlier products, marked invalid.

use super::{
    driver::{Driver, Flow, of_adjustment},
    outputs::{Intersection, Shots, Site},
    overlays::pixel_files,
    registered::registered,
};
use crate::{
    config::SiteConfig,
    error::Result,
    pds::SizedFile,
    spice::{KernelSet, KernelView},
    stage::{InOrder, Output, Round, Stage},
    stages::{
        adjust::{Adjust, Adjusted},
        check_heights::{CheckHeights, CheckedPoints},
        check_ranges::RangeCheck,
        compare_pairs::{ComparePairs, PairComparison},
        image_pixels::PixelFiles,
        intersect::{Intersect, IntersectedTies},
        match_ties::{Margin, MatchTies, TiesOfFiles},
        read_ties::{ImageNames, ReadTies, TieFiles, Ties},
        reorient::Reorient,
        site_image::{SiteImage, SiteImages},
        tabulate_kernels::{AdjustedTables, TabulateKernels},
        tag_times::ImageTimes,
    },
    store::book::Book,
};

/// Images and tie points, and the difference between the orbits of shots and kernels.
type Measured<'a> = (&'a [SiteImage], &'a Output<Ties>, &'a Output<RangeCheck>);
/// Outputs of the adjustment of a site.
struct Adjustment {
    adjusted: Output<Adjusted>,
    /// The images with their adjusted orientation.
    images: Vec<SiteImage>,
    /// Contents of the adjusted kernels of every image.
    tables: Vec<Output<AdjustedTables>>,
    /// With the adjusted orientation.
    intersection: Intersection,
}

/// Ground points of tie points, and comparisons of pairs of images.
type Ground<'a> = (&'a Output<IntersectedTies>, &'a Output<Vec<PairComparison>>);

/// Tie points, their ground points, and the adjustment, as far as it succeeds; `None` for a site without tie points.
pub(super) fn triangulate<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &mut Site,
) -> Flow<()> {
    let Some(ties) = ties(flow, config, site)? else {
        return Ok(());
    };
    site.book.enter(Round::Initial, ties.clone())?;
    let images = &site.images()?;
    let initial = intersect(flow, config, None, images, &ties, site.shots()?)?;
    initial.clone().enter(&mut site.book, Round::Initial)?;
    let kernels = &KernelView::all(site.kernels.as_ref());
    let measured = (&images[..], &ties, site.book.require(Round::Initial)?);
    let adjustment = adjust(flow, config, measured, &initial, site.shots()?, kernels)?;
    Ok(adjustment.enter(site)?)
}

/// The tie points of the site's files, followed by the matched ones; `None` for a site without either.
fn ties<D: Driver>(flow: &mut D, config: &SiteConfig, site: &Site) -> Flow<Option<Output<Ties>>> {
    let read = if config.ties.files.is_empty() {
        None
    } else {
        let times = site.book.outputs(Round::Initial)?.unwrap_or_default();
        Some(ties_of_files(flow, config, times)?)
    };
    if config.ties.matched {
        matched(flow, config, site, read.as_ref()).map(Some)
    } else {
        Ok(read)
    }
}

/// The tie points of the site's files.
pub(super) fn ties_of_files<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    times: &[Output<ImageTimes>],
) -> Flow<Output<Ties>> {
    let files = flow.hash_sized(ReadTies::NAME, SizedFile::Ties, &config.ties.files)?;
    flow.stage(&ReadTies {
        ties: &config.ties,
        files: TieFiles(&files),
        images: ImageNames(&config.images),
        times: InOrder(times),
    })
}

/// Tie points matched with the orientation from the kernels, and again with the orientation adjusted by these, which
/// predicts their positions better.
fn matched<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    site: &Site,
    read: Option<&Output<Ties>>,
) -> Flow<Output<Ties>> {
    let (images, round) = (&site.images()?[..], Round::Matching);
    let shots = site.shots()?;
    let ties = &match_ties(flow, config, Round::Initial, images, shots, read)?;
    let (intersected, pairs) = &ground(flow, config, round, images, ties, shots)?;
    let measured = (images, ties, site.book.require(Round::Initial)?);
    let ground = (intersected, pairs);
    let (_, images) = corrected(flow, config, round, measured, ground, shots)?;
    match_ties(flow, config, Round::Adjusted, &images, shots, read)
}

/// Tie points that are matched with one orientation, following the tie points of files.
pub(super) fn match_ties<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    round: Round,
    images: &[SiteImage],
    (converted, profiles): Shots,
    read: Option<&Output<Ties>>,
) -> Flow<Output<Ties>> {
    let pixels = pixel_files(flow, MatchTies::NAME, config)?;
    of_adjustment(flow.stage(&MatchTies {
        round,
        images: SiteImages(images),
        pixels: PixelFiles(&pixels),
        converted,
        profiles,
        margin: &Margin::of(config, images, round),
        read: TiesOfFiles(read),
    }))
}

/// The combined adjustment, and the images and tie points once more with the adjusted orientation.
fn adjust<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    measured: Measured,
    initial: &Intersection,
    shots: Shots,
    kernels: &KernelView,
) -> Flow<Adjustment> {
    let ground = (&initial.intersected, &initial.pairs);
    let (adjusted, images) = corrected(flow, config, Round::Adjusted, measured, ground, shots)?;
    let (_, ties, _) = measured;
    let intersection = intersect(flow, config, Some(&adjusted), &images, ties, shots)?;
    let times: Vec<_> = images.iter().map(|image| image.times.clone()).collect();
    // Images with support data do not use orbit and attitude of kernels.
    let none = &KernelView::all(Some(&KernelSet::default()));
    let tabulate = |(index, image): (usize, &SiteImage)| {
        flow.stage(&TabulateKernels {
            image: &config.images[index].id,
            index: &index,
            times: InOrder(&times),
            orientation: &image.orientation,
            kernels: if config.images[index].support().is_some() {
                none
            } else {
                kernels
            },
            coverage: &config.kernels,
            pointing: &config.pointing,
        })
    };
    let tables = images.iter().enumerate().map(tabulate);
    let tables = tables.collect::<Flow<Vec<_>>>()?;
    Ok(Adjustment {
        adjusted,
        images,
        tables,
        intersection,
    })
}

/// An adjustment, and the images with the adjusted orientation.
fn corrected<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    round: Round,
    (images, ties, ranges): Measured,
    (intersected, pairs): Ground,
    shots: Shots,
) -> Flow<(Output<Adjusted>, Vec<SiteImage>)> {
    let (converted, profiles) = shots;
    let adjusted = of_adjustment(flow.stage(&Adjust {
        round,
        images: SiteImages(images),
        converted,
        profiles,
        ties,
        intersected,
        ranges,
        pairs,
        altimeter: &config.altimeter,
        laser_surface: &config.laser_surface,
        adjustment: &config.adjustment,
    }))?;
    let reorient = |(index, image): (usize, &SiteImage)| {
        of_adjustment(flow.stage(&Reorient {
            round,
            image: &config.images[index].id,
            index: &index,
            times: &image.times,
            orientation: &image.orientation,
            adjusted: &adjusted,
        }))
    };
    let orientations = images.iter().enumerate().map(reorient);
    let orientations = orientations.collect::<Flow<Vec<_>>>()?;
    let times: Vec<_> = images.iter().map(|image| image.times.clone()).collect();
    let images = of_adjustment(registered(flow, config, round, &times, orientations, shots))?;
    Ok((adjusted, images))
}

/// Ground points of the tie points, the internal agreement of every pair of images, and heights against MOLA: with
/// the orientation from the kernels, or with the adjusted one.
fn intersect<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    adjusted: Option<&Output<Adjusted>>,
    images: &[SiteImage],
    ties: &Output<Ties>,
    shots: Shots,
) -> Flow<Intersection> {
    let round = adjusted.map_or(Round::Initial, |_| Round::Adjusted);
    let (intersected, pairs) = ground(flow, config, round, images, ties, shots)?;
    let (converted, profiles) = shots;
    let points = adjusted.map_or(
        CheckedPoints::Intersected(&intersected),
        CheckedPoints::Adjusted,
    );
    let heights = flow.stage(&CheckHeights {
        round,
        points,
        converted,
        profiles,
        laser_surface: &config.laser_surface,
    });
    let heights = of_round(round, heights)?;
    Ok(Intersection {
        intersected,
        pairs,
        heights,
    })
}

/// Ground points of the tie points, and the internal agreement of every pair of images.
fn ground<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    round: Round,
    images: &[SiteImage],
    ties: &Output<Ties>,
    (converted, profiles): Shots,
) -> Flow<(Output<IntersectedTies>, Output<Vec<PairComparison>>)> {
    let images = SiteImages(images);
    let intersected = of_adjustment(flow.stage(&Intersect {
        round,
        images,
        ties,
        intersection: &config.intersection,
    }))?;
    let pairs = flow.stage(&ComparePairs {
        round,
        images,
        ties,
        intersected: &intersected,
        converted,
        profiles,
    });
    Ok((intersected, of_round(round, pairs)?))
}

/// A step that belongs to the adjustment unless it uses the orientation from the kernels.
fn of_round<T>(round: Round, step: Flow<T>) -> Flow<T> {
    match round {
        Round::Initial => step,
        Round::Matching | Round::Adjusted => of_adjustment(step),
    }
}

impl Intersection {
    /// Enters the outputs in the book.
    fn enter(self, book: &mut Book, round: Round) -> Result<()> {
        book.enter(round, self.intersected)?;
        book.enter(round, self.pairs)?;
        book.enter(round, self.heights)
    }
}

impl Adjustment {
    /// Enters the outputs in the book of the site.
    fn enter(self, site: &mut Site) -> Result<()> {
        // There is one adjustment, of the orientation from the kernels.
        site.book.enter(Round::Initial, self.adjusted)?;
        site.book.enter_parts(Round::Adjusted, self.tables)?;
        self.intersection.enter(&mut site.book, Round::Adjusted)?;
        SiteImage::enter(&mut site.book, Round::Adjusted, &self.images)
    }
}
