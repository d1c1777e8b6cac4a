//! The flow of one site, told once: [`site`] is driven by run and plan, its parts by check.

use super::{
    LOAD_KERNELS,
    choice::{ChooseKernels, KernelChoice, RivalKernelSets, rival_positions},
    driver::{Driver, Flow, Leave},
    kernels::{load_kernels, required_coverage},
    outputs::{Adjustment, Intersection, Prepared, Site},
};
use crate::{
    config::{ImageConfig, SiteConfig, WindowConfig},
    error::{Error, Kind},
    geom::window::WindowShape,
    kernel_source::KernelSource,
    pds::archive::{Index, Indexes},
    spice::{KernelSet, KernelView, RequiredCoverage},
    stage::{InOrder, Output, Round, Stage},
    stages::{
        adjust::{Adjust, Adjusted},
        check_heights::{CheckHeights, CheckedPoints},
        check_ranges::{CheckRanges, RangeCheck},
        compare_pairs::ComparePairs,
        convert_datum::{ConvertDatum, Converted},
        describe_kernels::{DescribeKernels, Required},
        fit_sensor_model::FitSensorModel,
        group_profiles::{GroupProfiles, Profile},
        intersect::Intersect,
        orientation::Orientation,
        outline_windows::{OutlineWindows, Windows},
        read_ties::{ImageNames, ReadTies, TieFiles, Ties},
        register::Register,
        reorient::Reorient,
        sample_orientation::SampleOrientation,
        search_footprints::{KnownPlaces, PedrFiles, SearchFootprints},
        site_image::SiteImage,
        tabulate_kernels::TabulateKernels,
        tag_times::{ImageTimes, TagTimes},
        tag_utc::TagUtc,
    },
};

/// Footprints and their profiles.
type Shots<'a> = (&'a Output<Converted>, &'a Output<Vec<Profile>>);

/// The flow of one site, from its configuration to its products.
pub(super) fn site<D: Driver>(flow: &mut D, config: &SiteConfig) -> Flow<()> {
    let prepared = prepare(flow, config)?;
    let (choice, chosen) = choose(flow, config, prepared.required.as_ref())?;
    let kernels = match chosen {
        Some(chosen) => kernels(flow, config, prepared.required.as_ref(), chosen)?,
        None => None,
    };
    let mut site = orient(flow, config, prepared, kernels)?;
    site.choice = choice;
    match triangulate(flow, config, &mut site) {
        Ok(()) => {}
        // What the measurements do not determine keeps no other product from its readers.
        Err(Leave::Failed(failure)) if is_of_adjustment(&failure) => {
            tracing::warn!("{failure}");
            site.adjustment_failure = Some(failure);
        }
        Err(leave) => return Err(leave),
    }
    flow.publish(config, &site)
}

/// Times, footprints and profiles: what needs clocks and no orbit.
pub(super) fn prepare<D: Driver>(flow: &mut D, config: &SiteConfig) -> Flow<Prepared> {
    let clocks = kernels(flow, config, Some(&RequiredCoverage::default()), 0)?;
    let images = {
        let kernels = &KernelView::text(clocks.as_ref());
        let tag = |image: &ImageConfig| {
            let source = image.source().map_or(&[][..], std::slice::from_ref);
            let source = flow.hash(TagTimes::NAME, source)?.pop();
            let (label, support) = match &image.isd {
                Some(_) => (None, source),
                None => (source, None),
            };
            flow.stage(&TagTimes {
                image,
                label,
                support,
                kernels,
            })
        };
        config.images.iter().map(tag).collect::<Flow<Vec<_>>>()?
    };
    let files = flow.hash(SearchFootprints::NAME, &config.pedr.files)?;
    let indexes = Indexes::beside(&config.pedr.files, |path| {
        flow.files().admit(path).ok()?;
        Index::read(path)
    });
    let outlined = outlined(flow, config, &images)?;
    let found = flow.stage(&SearchFootprints {
        pedr: &config.pedr,
        files: PedrFiles(&files),
        index: KnownPlaces(&indexes),
        windows: Windows {
            written: &config.windows,
            outlined: outlined.as_ref(),
        },
        clock_correction_s: &config.mola_clock.correction_s(),
    })?;
    let converted = flow.stage(&ConvertDatum {
        found: &found,
        mola_clock: &config.mola_clock,
    })?;
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

/// Windows with the outlines of images, of the first of rival kernel sets; none where no window is what an image sees.
fn outlined<D: Driver>(
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

/// Of rival kernel sets the one to use, by its index; the first where there is one source. The index is `None`
/// while it is not known.
fn choose<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    required: Option<&RequiredCoverage>,
) -> Flow<(Option<Output<KernelChoice>>, Option<usize>)> {
    flow.enter(ChooseKernels::NAME)?;
    let rivals = rival_positions(config, flow.files());
    let rivals = flow
        .attempt(ChooseKernels::NAME, rivals)?
        .unwrap_or_default();
    if rivals.is_empty() {
        return Ok((None, Some(0)));
    }
    let choice = flow.stage(&ChooseKernels {
        sets: RivalKernelSets::new(&rivals),
        required: Required(required),
        compare_clocks: &!config.images.is_empty(),
    })?;
    let chosen = choice.get().map(|choice| choice.chosen);
    Ok((Some(choice), chosen))
}

/// Ranges, orientation, sensor models and registration with the kernels that were chosen.
pub(super) fn orient<D: Driver>(
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
    let ranges = {
        let view = KernelView::positions(kernels.as_ref());
        let view = flow.attempt(CheckRanges::NAME, view)?;
        flow.stage(&CheckRanges {
            converted: &converted,
            profiles: &profiles,
            kernels: &view.unwrap_or_else(|| KernelView::all(None)),
            mola_clock: &config.mola_clock,
            range_check: &config.range_check,
        })?
    };
    let (orientations, described) = {
        let view = &KernelView::all(kernels.as_ref());
        let orientations = orientations(flow, config, &images, view)?;
        let described = flow.stage(&DescribeKernels {
            kernels: view,
            required: Required(required.as_ref()),
            ck_tolerance_s: &config.kernels.ck_tolerance_s,
        })?;
        (orientations, described)
    };
    let shots = (&converted, &profiles);
    let images = registered(flow, config, Round::Initial, &images, orientations, shots)?;
    Ok(Site {
        found,
        converted,
        utc,
        profiles,
        required,
        choice: None,
        kernels,
        described,
        ranges,
        images,
        ties: None,
        intersection: None,
        adjustment: None,
        adjustment_failure: None,
    })
}

/// Orientation of every image by the kernels, or by its support data.
fn orientations<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    images: &[Output<ImageTimes>],
    kernels: &KernelView,
) -> Flow<Vec<Output<Orientation>>> {
    let images = config.images.iter().zip(images);
    let none = &KernelView::all(Some(&KernelSet::default()));
    let sample = |(image, times): (&ImageConfig, _)| {
        flow.stage(&SampleOrientation {
            image: &image.id,
            times,
            // Support data are read instead of kernels.
            kernels: if image.isd.is_some() { none } else { kernels },
            coverage: &config.kernels,
            pointing: &config.pointing,
            orientation: &config.orientation,
        })
    };
    images.map(sample).collect()
}

/// Every image with its orientation, sensor models and footprints.
fn registered<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    round: Round,
    times: &[Output<ImageTimes>],
    orientations: Vec<Output<Orientation>>,
    (converted, profiles): Shots,
) -> Flow<Vec<SiteImage>> {
    let oriented = config.images.iter().zip(times).zip(orientations);
    let register = |((image, times), orientation): ((&ImageConfig, &Output<_>), _)| {
        let image = &*image.id;
        let model = flow.stage(&FitSensorModel {
            image,
            round,
            samples: &orientation,
            orientation: &config.orientation,
        })?;
        let registration = flow.stage(&Register {
            image,
            round,
            times,
            orientation: &orientation,
            model: &model,
            converted,
            profiles,
            registration: &config.registration,
        })?;
        Ok(SiteImage {
            times: times.clone(),
            orientation,
            model,
            registration,
        })
    };
    oriented.map(register).collect()
}

/// Tie points, their ground points, and the adjustment, as far as it goes; nothing for a site without tie points.
fn triangulate<D: Driver>(flow: &mut D, config: &SiteConfig, site: &mut Site) -> Flow<()> {
    if config.ties.files.is_empty() {
        return Ok(());
    }
    let ties = &*site.ties.insert(ties(flow, config)?);
    let shots = (&site.converted, &site.profiles);
    let initial = intersect(flow, config, None, &site.images, ties, shots)?;
    let initial = &*site.intersection.insert(initial);
    let kernels = &KernelView::all(site.kernels.as_ref());
    let measured = (&site.images[..], ties, &site.ranges);
    let adjustment = adjust(flow, config, measured, initial, shots, kernels)?;
    site.adjustment = Some(adjustment);
    Ok(())
}

/// The combined adjustment, and the images and tie points once more with the adjusted orientation.
fn adjust<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    (images, ties, ranges): (&[SiteImage], &Output<Ties>, &Output<RangeCheck>),
    initial: &Intersection,
    shots: Shots,
    kernels: &KernelView,
) -> Flow<Adjustment> {
    let (converted, profiles) = shots;
    let adjusted = flow.stage(&Adjust {
        images: InOrder(images),
        model: &config.registration.model,
        converted,
        profiles,
        ties,
        intersected: &initial.intersected,
        ranges,
        pairs: &initial.pairs,
        altimeter: &config.altimeter,
        mola_surface: &config.mola_surface,
        adjustment: &config.adjustment,
    })?;
    let reorient = |(index, image): (usize, &SiteImage)| {
        flow.stage(&Reorient {
            image: &config.images[index].id,
            index: &index,
            times: &image.times,
            orientation: &image.orientation,
            adjusted: &adjusted,
        })
    };
    let orientations = images.iter().enumerate().map(reorient);
    let orientations = orientations.collect::<Flow<Vec<_>>>()?;
    let times: Vec<_> = images.iter().map(|image| image.times.clone()).collect();
    let images = registered(flow, config, Round::Adjusted, &times, orientations, shots)?;
    let intersection = intersect(flow, config, Some(&adjusted), &images, ties, shots)?;
    let none = &KernelView::all(Some(&KernelSet::default()));
    let tabulate = |(index, image): (usize, &SiteImage)| {
        flow.stage(&TabulateKernels {
            image: &config.images[index].id,
            index: &index,
            times: InOrder(&times),
            orientation: &image.orientation,
            kernels: if config.images[index].isd.is_some() {
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

/// Whether a failure lies in what the tie points and the orientation determine, not in a file that cannot be read.
fn is_of_adjustment(failure: &Error) -> bool {
    let stage = failure.stage.as_deref().unwrap_or_default();
    let name = stage.split('/').next().unwrap_or_default();
    let of_adjustment = [Intersect::NAME, Adjust::NAME, Reorient::NAME].contains(&name);
    failure.kind() == Kind::Input && (of_adjustment || stage.ends_with("/adjusted"))
}

/// The tie points of the site's files.
pub(super) fn ties<D: Driver>(flow: &mut D, config: &SiteConfig) -> Flow<Output<Ties>> {
    let files = flow.hash(ReadTies::NAME, &config.ties.files)?;
    flow.stage(&ReadTies {
        ties: &config.ties,
        files: TieFiles(&files),
        images: ImageNames(&config.images),
    })
}

/// Ground points of the tie points, what every pair of images says of itself, and what MOLA says of heights: with the
/// orientation of the kernels, or with the adjusted one.
fn intersect<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    adjusted: Option<&Output<Adjusted>>,
    images: &[SiteImage],
    ties: &Output<Ties>,
    (converted, profiles): Shots,
) -> Flow<Intersection> {
    let round = adjusted.map_or(Round::Initial, |_| Round::Adjusted);
    let (images, model) = (InOrder(images), &config.registration.model);
    let intersected = flow.stage(&Intersect {
        round,
        images,
        model,
        ties,
        intersection: &config.intersection,
    })?;
    let pairs = flow.stage(&ComparePairs {
        round,
        images,
        model,
        ties,
        intersected: &intersected,
        converted,
        profiles,
    })?;
    let points = adjusted.map_or(
        CheckedPoints::Intersected(&intersected),
        CheckedPoints::Adjusted,
    );
    let heights = flow.stage(&CheckHeights {
        round,
        points,
        converted,
        profiles,
        mola_surface: &config.mola_surface,
    })?;
    Ok(Intersection {
        intersected,
        pairs,
        heights,
    })
}

/// The kernels of the configuration for the `required` times; `None` while it is not known which these are.
pub(super) fn kernels<D: Driver>(
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
    let loaded = load_kernels(config, required, chosen, flow.files());
    flow.attempt(LOAD_KERNELS, loaded)
}
