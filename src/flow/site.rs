//! The flow of one site, described once: [`site`] is driven by run and plan, its two halves by check.

use super::{
    LOAD_KERNELS, PUBLISH, calibrated_images,
    choice::{ChooseKernels, KernelChoice, RivalKernelSets, rival_positions},
    driver::{Exit, Flow, SiteDriver},
    kernels::{load_kernels, required_coverage},
    outputs::{Prepared, Site},
    overlays::overlays,
    publish::SitePublication,
    registered::registered,
    surface::surface,
    triangulate::triangulate,
};
use crate::{
    capabilities::MeasureSpacing,
    config::{ImageConfig, SiteConfig, WindowConfig},
    footprints::Footprints,
    geom::window::WindowShape,
    kernel_source::KernelSource,
    pds::{
        SizedFile,
        archive::{Index, Indexes},
    },
    spice::{KernelSet, KernelView, RequiredCoverage},
    stage::{InOrder, Output, Round, Stage},
    stages::{
        adjust::Adjust,
        check_beam::CheckBeam,
        check_heights::CheckHeights,
        check_profiles::CheckProfiles,
        check_ranges::{CheckRanges, CheckTableRanges},
        compare_orthoimages::CompareOrthoimages,
        compare_pairs::ComparePairs,
        convert_datum::ConvertDatum,
        describe_kernels::{DescribeKernels, Required},
        fit_sensor_model::FitSensorModel,
        group_profiles::GroupProfiles,
        interpolate_shots::InterpolateShots,
        intersect::Intersect,
        join_surfaces::JoinSurfaces,
        lay_overlays::LayOverlays,
        map_surface::MapSurface,
        match_ties::MatchTies,
        mosaic_images::MosaicImages,
        orientation::Orientation,
        outline_windows::{OutlineWindows, Windows},
        read_shots::{ReadShots, ShotFiles},
        read_ties::ReadTies,
        rectify_images::RectifyImages,
        register::Register,
        reorient::Reorient,
        sample_orientation::SampleOrientation,
        search_footprints::{KnownPlaces, PedrFiles, SearchFootprints, SearchResult},
        site_image::{SiteImage, SiteImages},
        tabulate_kernels::TabulateKernels,
        tag_times::{ImageTimes, TagTimes},
        tag_utc::TagUtc,
    },
    store::book::Book,
};

/// The names of all steps in order, for `--until`.
pub const STAGES: &[&str] = &[
    LOAD_KERNELS,
    TagTimes::NAME,
    OutlineWindows::NAME,
    SearchFootprints::NAME,
    ConvertDatum::NAME,
    TagUtc::NAME,
    GroupProfiles::NAME,
    ChooseKernels::NAME,
    CheckProfiles::NAME,
    MeasureSpacing::NAME,
    CheckRanges::NAME,
    SampleOrientation::NAME,
    DescribeKernels::NAME,
    FitSensorModel::NAME,
    Register::NAME,
    CheckBeam::NAME,
    ReadTies::NAME,
    MatchTies::NAME,
    Intersect::NAME,
    ComparePairs::NAME,
    Adjust::NAME,
    Reorient::NAME,
    CheckHeights::NAME,
    TabulateKernels::NAME,
    MapSurface::NAME,
    JoinSurfaces::NAME,
    InterpolateShots::NAME,
    RectifyImages::NAME,
    CompareOrthoimages::NAME,
    MosaicImages::NAME,
    LayOverlays::NAME,
    PUBLISH,
];

/// The flow of one site, from its configuration to its products.
pub(super) fn site<D: SiteDriver>(flow: &mut D, config: &SiteConfig) -> Flow<()> {
    let prepared = prepare(flow, config)?;
    finish(flow, config, prepared)
}

/// From the choice of kernels to the products.
pub(super) fn finish<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    prepared: Prepared,
) -> Flow<()> {
    let (choice, chosen) = choose(flow, config, prepared.required.as_ref())?;
    let kernels = match chosen {
        Some(chosen) => kernels(flow, config, prepared.required.as_ref(), chosen)?,
        None => None,
    };
    let mut site = orient(flow, config, prepared, kernels)?;
    if let Some(choice) = choice {
        site.book.enter(Round::Initial, choice)?;
    }
    match triangulate(flow, config, &mut site) {
        Ok(()) => {}
        // A failed adjustment does not prevent the other products.
        Err(Exit::NotAdjusted(failure)) => {
            tracing::warn!("{failure}");
            site.adjustment_failure = Some(failure);
        }
        Err(leave) => return Err(leave),
    }
    surface(flow, config, &mut site)?;
    overlays(flow, config, &mut site)?;
    flow.publish(&SitePublication {
        config,
        site: &site,
    })
}

/// Times, footprints and profiles: the stages that need clocks but no orbit.
pub(super) fn prepare<D: SiteDriver>(flow: &mut D, config: &SiteConfig) -> Flow<Prepared> {
    let clocks = kernels(flow, config, Some(&RequiredCoverage::default()), 0)?;
    let images = {
        let kernels = &KernelView::text(clocks.as_ref());
        let calibration = &*calibrated_images::files(flow, config)?;
        let tag = |image: &ImageConfig| {
            let source = image.source().map_or(&[][..], std::slice::from_ref);
            // A cube has its pixels beside its label.
            let kind = match &image.isd {
                Some(_) => SizedFile::SupportData,
                None => SizedFile::Label,
            };
            let source = flow.hash_sized(TagTimes::NAME, kind, source)?.pop();
            let (label, support, cube) = match (&image.isd, &image.cube) {
                (Some(_), _) => (None, source, None),
                (None, Some(_)) => (None, None, source),
                (None, None) => (source, None, None),
            };
            flow.stage(&TagTimes {
                body: &config.body,
                image,
                label,
                // Support data and cubes have their own camera.
                calibration: InOrder(if image.support().is_some() {
                    &[]
                } else {
                    calibration
                }),
                support,
                cube,
                kernels,
            })
        };
        let images = config.images.iter().map(tag).collect::<Flow<Vec<_>>>()?;
        calibrated_images::require_one(flow, config, &images)?;
        images
    };
    let found = found(flow, config, &images, clocks.as_ref())?;
    let converted = flow.stage(&ConvertDatum {
        found: &found,
        altimeter_clock: &config.altimeter_clock,
        ground: &config.pedr.crossover,
    })?;
    // The unconverted shots are no longer needed; a million occupy 0.2 GB.
    let found = found.without_rows(|found| found.footprints = Footprints::new(Vec::new()));
    let utc = flow.stage(&TagUtc {
        converted: &converted,
        kernels: &KernelView::text(clocks.as_ref()),
    })?;
    let profiles = flow.stage(&GroupProfiles {
        converted: &converted,
        windows: &config.windows,
        images: InOrder(&flow.usable(&images)),
    })?;
    Ok(Prepared {
        required: flow.required(config, &images, &profiles),
        found,
        converted,
        utc,
        profiles,
        images,
    })
}

/// The shots in the windows, of PEDR files or of tables.
fn found<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    images: &[Output<ImageTimes>],
    clocks: Option<&KernelSet>,
) -> Flow<Output<SearchResult>> {
    let outlined = outlined(flow, config, images)?;
    let (stage, kind) = (SearchFootprints::NAME, SizedFile::Pedr);
    let files = flow.hash_sized(stage, kind, &config.pedr.files)?;
    let tables = config.shots.iter();
    let tables = tables.map(|table| flow.hash(ReadShots::NAME, &table.files));
    let tables = tables.collect::<Flow<Vec<_>>>()?;
    let windows = Windows {
        written: &config.windows,
        outlined: outlined.as_ref(),
    };
    let clock_correction_s = &config.altimeter_clock.correction_s();
    if !tables.is_empty() {
        return flow.stage(&ReadShots {
            body: &config.body,
            shots: &config.shots,
            files: ShotFiles(&tables),
            windows,
            clock_correction_s,
            kernels: &KernelView::text(clocks),
        });
    }
    let indexes = flow.attempt(stage, |files| {
        Ok(Indexes::beside(&config.pedr.files, |path| {
            files.admit(path).ok()?;
            Index::read(path)
        }))
    })?;
    let indexes = indexes.unwrap_or_default();
    flow.stage(&SearchFootprints {
        pedr: &config.pedr,
        files: PedrFiles(&files),
        index: KnownPlaces(&indexes),
        windows,
        clock_correction_s,
    })
}

/// Windows with the outlines of images, with the first of rival kernel sets; empty if no window is the outline of an
/// image.
fn outlined<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    images: &[Output<ImageTimes>],
) -> Flow<Option<Output<Vec<WindowConfig>>>> {
    let is_of_image = |window: &WindowConfig| matches!(window.shape, WindowShape::Image { .. });
    if !config.windows.iter().any(is_of_image) {
        return Ok(None);
    }
    let times: Option<Vec<&ImageTimes>> = images.iter().map(Output::get).collect();
    let required = times.map(|times| required_coverage(config, &times, &[]));
    let kernels = kernels(flow, config, required.as_ref(), 0)?;
    let outlined = flow.stage(&OutlineWindows {
        windows: &config.windows,
        images: InOrder(images),
        kernels: &KernelView::all(kernels.as_ref()),
        coverage: &config.kernels,
        pointing: &config.pointing,
        orientation: &config.orientation,
    })?;
    Ok(Some(outlined))
}

/// Index of the rival kernel set to use; the first where there is one source. The index is `None` while it is not
/// known.
fn choose<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    required: Option<&RequiredCoverage>,
) -> Flow<(Option<Output<KernelChoice>>, Option<usize>)> {
    flow.enter(ChooseKernels::NAME)?;
    if !matches!(config.kernels.source, KernelSource::Sets(_)) {
        return Ok((None, Some(0)));
    }
    let rivals = flow.attempt(ChooseKernels::NAME, |files| rival_positions(config, files))?;
    let rivals = rivals.unwrap_or_default();
    let choice = flow.stage(&ChooseKernels {
        sets: RivalKernelSets::new(&rivals),
        required: Required(required),
        compare_clocks: &!config.images.is_empty(),
    })?;
    let chosen = choice.get().map(|choice| choice.chosen);
    Ok((Some(choice), chosen))
}

/// Ranges, orientation, sensor models and registration with the kernels that were chosen.
pub(super) fn orient<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    prepared: Prepared,
    kernels: Option<KernelSet>,
) -> Flow<Site> {
    let Prepared {
        found,
        converted,
        utc,
        profiles,
        images,
        required,
    } = prepared;
    let checked = flow.stage(&CheckProfiles {
        converted: &converted,
        profiles: &profiles,
        laser_surface: &config.laser_surface,
    })?;
    let spacing = flow.stage(&MeasureSpacing {
        converted: &converted,
        profiles: &profiles,
        windows: &config.windows,
        has_tables: &!config.shots.is_empty(),
    })?;
    // One session at a time: the session of the positions ends here.
    let ranges = {
        let view = |_: &_| KernelView::positions(kernels.as_ref());
        let view = flow.attempt(CheckRanges::NAME, view)?;
        let view = &view.unwrap_or_else(|| KernelView::all(None));
        if config.shots.is_empty() {
            flow.stage(&CheckRanges {
                converted: &converted,
                profiles: &profiles,
                kernels: view,
                altimeter_clock: &config.altimeter_clock,
                range_check: &config.range_check,
            })?
        } else {
            flow.stage(&CheckTableRanges {
                converted: &converted,
                profiles: &profiles,
                images: InOrder(&images),
                kernels: view,
                altimeter_clock: &config.altimeter_clock,
                range_check: &config.range_check,
            })?
        }
    };
    let (orientations, described) = {
        let view = &KernelView::all(kernels.as_ref());
        let orientations = orientations(flow, config, &images, view)?;
        let described = flow.stage(&DescribeKernels {
            body: &config.body,
            kernels: view,
            required: Required(required.as_ref()),
            ck_tolerance_s: &config.kernels.ck_tolerance_s,
        })?;
        (orientations, described)
    };
    let shots = (&converted, &profiles);
    let oriented = registered(flow, config, Round::Initial, &images, orientations, shots)?;
    let beam = flow.stage(&CheckBeam {
        images: SiteImages(&oriented),
        converted: &converted,
        profiles: &profiles,
        altimeter: &config.altimeter,
        altimeter_clock: &config.altimeter_clock,
    })?;
    let (mut book, round) = (Book::default(), Round::Initial);
    book.enter(round, found)?;
    book.enter(round, converted)?;
    book.enter(round, utc)?;
    book.enter(round, profiles)?;
    book.enter(round, checked)?;
    book.enter(round, spacing)?;
    book.enter(round, described)?;
    book.enter(round, ranges)?;
    book.enter(round, beam)?;
    book.enter_parts(round, images)?;
    SiteImage::enter(&mut book, round, &oriented)?;
    Ok(Site {
        book,
        required,
        kernels,
        adjustment_failure: None,
    })
}

/// Orientation of every image from the kernels, or from its support data.
fn orientations<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    images: &[Output<ImageTimes>],
    kernels: &KernelView,
) -> Flow<Vec<Output<Orientation>>> {
    let images = config.images.iter().zip(images);
    let sample = |(image, times): (&ImageConfig, _)| {
        flow.stage(&SampleOrientation {
            image: &image.id,
            times,
            // Support data replace the kernels, and are compared with them.
            kernels,
            coverage: &config.kernels,
            pointing: &config.pointing,
            orientation: &config.orientation,
        })
    };
    images.map(sample).collect()
}

/// The kernels of the configuration for the `required` times; `None` while these are not known.
pub(super) fn kernels<D: SiteDriver>(
    flow: &mut D,
    config: &SiteConfig,
    required: Option<&RequiredCoverage>,
    chosen: usize,
) -> Flow<Option<KernelSet>> {
    flow.enter(LOAD_KERNELS)?;
    let nothing = RequiredCoverage::default();
    let required = match (&config.kernels.source, required) {
        (KernelSource::Root(_), None) => return Ok(None),
        (_, required) => required.unwrap_or(&nothing),
    };
    flow.attempt(LOAD_KERNELS, |files| {
        load_kernels(config, required, chosen, files)
    })
}
