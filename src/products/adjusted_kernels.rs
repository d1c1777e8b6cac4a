//! Adjusted orientations as SPICE kernels that are loaded after the original ones.
//!
//! Time tags of the attitude follow the rule of the kernels that they replace: the attitude of an exposure at
//! `t` stands at `t` + bias. ISIS and ALE read MOC attitude 1.15 s before the exposure of their own accord
//! (`SetTimeBias(-1.15)` in ISIS, `instrument_time_bias` in ALE), as areograph does with its usual bias, so
//! that one kernel serves all three. A second one without the bias would be wrong in each of them.
//!
//! A shift of line times is folded into both kernels: at the tag of a line they have the orientation of the
//! instant at which it was exposed. Therefore each pair belongs to its image alone, and to nothing else that
//! happened meanwhile, laser shots among them.
//!
//! Between two images the kernels end half way. Of two that were exposed at once, or nearer to each other than
//! the tolerance with which attitude is asked (CSPICE takes the last file that has any within it), the later
//! one wins in `adjusted.tm`; with its own pair alone each is right.

mod columns;

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    error::ProductError,
    files::write_text,
    product::{Content, Context, Declaration, Product, Program, Role, Use, Write, Written},
    site::AdjustmentProducts,
};
use crate::{
    config::{KernelsConfig, PointingConfig},
    error::{IoError, Locate, Result},
    frames::MarsIau2000,
    geom::{attitude::rotation_vector, mars_rotation::mars_rotation, statistics::largest},
    spice::{Kernel, KernelSet, Session},
    stages::{sample_orientation::Orientation, tag_times::ImageTimes},
    time::{Et, Interval},
};
use columns::Source;

/// What may be lost on the way into a kernel and back, metres: 30 times the 3e-5 m that MGS flies in the
/// 7e-9 s to which ET is rounded.
const POSITION_TOLERANCE_M: f64 = 1e-3;
/// The same for rotations, radians: 100 times what the bus turns in the 1.5e-8 s to which ticks are rounded.
const ROTATION_TOLERANCE_RAD: f64 = 1e-9;

/// Positions reach this far beyond attitudes, seconds: light from MGS to the centre of Mars takes 0.013 s.
const LIGHT_TIME_S: f64 = 0.1;
/// A bias this near to the usual one is the usual one, seconds.
const BIAS_TOLERANCE_S: f64 = 1e-9;

/// An image with its adjusted orientation.
#[derive(Debug, Clone, Copy)]
pub struct AdjustedImage<'a> {
    /// Line times.
    pub times: &'a ImageTimes,
    /// The orientation by the tags of the lines, see [`crate::stages::reorient`].
    pub orientation: &'a Orientation,
}

/// Where the kernels go and what they replace.
#[derive(Debug, Clone, Copy)]
pub struct AdjustedKernels<'a> {
    /// Folder that is written to.
    pub directory: &'a Path,
    /// Folder of the site, where the files will lie in the end: paths in `adjusted.tm` count from there.
    pub site_folder: &'a Path,
    /// The original kernels.
    pub originals: &'a KernelSet,
    /// Padding and tolerance with which the images were sampled.
    pub kernels: &'a KernelsConfig,
    /// The pointing bias that readers of the kernels will apply.
    pub pointing: &'a PointingConfig,
}

pub(super) static ATTITUDE: Declaration = Declaration {
    path: "adjusted/<image>.bc",
    what: "adjusted attitude of the bus around the image, J2000 (CK type 3)",
    readers: "SPICE, ISIS, ALE",
    rows: "epochs",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::WithAnother,
    uses: &[Use {
        program: Program::AdjustedKernels,
        lines: "spiceinit from=<image>.cub spk=../adjusted/<image>.bsp ck=../adjusted/<image>.bc",
    }],
};

pub(super) static POSITION: Declaration = Declaration {
    path: "adjusted/<image>.bsp",
    what: "adjusted position of MGS from Mars around the image, geometric, J2000 (SPK type 13)",
    readers: "SPICE, ISIS, ALE",
    rows: "epochs",
    role: Role::Data,
    content: Content::Foreign,
    write: Write::WithAnother,
    uses: &[],
};

pub(super) static METAKERNEL: Declaration = Declaration {
    path: "adjusted.tm",
    what: "the kernels of the site, and then the adjusted ones",
    readers: "SPICE",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Several(of_site),
    uses: &[],
};

/// The adjusted kernels of a site.
fn of_site(of: &Context, adjustment: &AdjustmentProducts) -> Result<Vec<Written>> {
    let to = AdjustedKernels {
        directory: of.directory,
        site_folder: adjustment.folder,
        originals: adjustment.kernels,
        kernels: &of.site.config.kernels,
        pointing: &of.site.config.pointing,
    };
    let images = adjustment.images.iter().map(|image| AdjustedImage {
        times: image.times,
        orientation: image.orientation,
    });
    written(&to, &images.collect::<Vec<_>>())
}

/// Writes an SPK and a CK of every image, and the metakernel; reads every sample back through them.
///
/// Attitudes are those of samples and camera tables; positions those of the original kernels with the
/// difference at the samples, interpolated, added. Around the image, where there are neither, the original
/// motion goes on with the difference at the end. Sampling an image with its pair loaded gives its
/// orientation back within 1 mm and 1e-9 rad.
///
/// # Errors
/// [`Kind::Coverage`](crate::error::Kind::Coverage) where the original kernels do not reach around an image;
/// [`Kind::Bug`](crate::error::Kind::Bug) for orientations that do not come back, and for a session that is
/// open on this thread; [`Kind::Io`](crate::error::Kind::Io).
pub fn write_adjusted_kernels(
    to: &AdjustedKernels,
    images: &[AdjustedImage],
) -> Result<Vec<Product>> {
    let written = written(to, images)?.into_iter();
    Ok(written.map(|(product, _)| product).collect())
}

fn written(to: &AdjustedKernels, images: &[AdjustedImage]) -> Result<Vec<Written>> {
    let mut written = Vec::new();
    if images.is_empty() {
        return Ok(written);
    }
    let mut add = |path: String, rows: u64, declaration| {
        let path = PathBuf::from(path);
        written.push((Product { path, rows }, declaration));
    };
    let folder = to.directory.join("adjusted");
    fs::create_dir_all(&folder)
        .map_err(IoError::on("make the folder"))
        .in_file(&folder)?;
    let session = Session::open(to.originals)?;
    let mut states = Vec::new();
    for (index, image) in images.iter().enumerate() {
        let source = Source {
            session: &session,
            to,
            image,
            attitude_span: span(images, index, to.kernels.padding_s),
            orbit_span: span(images, index, to.kernels.padding_s + LIGHT_TIME_S),
        };
        let segment = source.attitudes()?;
        let name = attitude_name(image);
        let rows = segment.write(&to.directory.join(&name), &session, &comment(image, to))?;
        add(name, rows, &ATTITUDE);
        states.push(source.states()?);
    }
    // CSPICE has one user at a time.
    drop(session);
    for (image, states) in images.iter().zip(&states) {
        let name = position_kernel(&image.times.id);
        let rows = states.write(&to.directory.join(&name), &comment(image, to))?;
        add(name, rows, &POSITION);
    }
    for image in images {
        read_back(to, image).in_file(position_kernel(&image.times.id))?;
    }
    let path = to.directory.join(METAKERNEL.path);
    write_text(&path, &metakernel(to, images)?)?;
    add(METAKERNEL.path.to_owned(), 0, &METAKERNEL);
    Ok(written)
}

/// Path of the SPK of an image below the folder of the products, the longest that CSPICE writes there.
#[must_use]
pub fn position_kernel(image: &str) -> String {
    POSITION.path_of(image)
}

fn attitude_name(image: &AdjustedImage) -> String {
    ATTITUDE.path_of(&image.times.id)
}

/// The time that the kernels of an image hold: its exposures with padding, half way to other images at most.
fn span(images: &[AdjustedImage], index: usize, padding_s: f64) -> Interval {
    let exposed = images[index].times.exposures();
    let mut span = exposed.padded(padding_s);
    for other in images {
        let others = other.times.exposures();
        if others.stop <= exposed.start {
            let middle = others.stop.plus(0.5 * exposed.start.since(others.stop));
            span.start = later(span.start, middle);
        } else if exposed.stop <= others.start {
            let middle = exposed.stop.plus(0.5 * others.start.since(exposed.stop));
            span.stop = earlier(span.stop, middle);
        }
    }
    span
}

fn later(a: Et, b: Et) -> Et {
    if a < b { b } else { a }
}

fn earlier(a: Et, b: Et) -> Et {
    if b < a { b } else { a }
}

/// What is written into the comment areas of both kernels.
fn comment(image: &AdjustedImage, to: &AdjustedKernels) -> String {
    let (times, bias_s) = (image.times, to.pointing.ck_bias.seconds());
    let usual_s = times.instrument.pointing.ck_bias_s;
    let others = if (bias_s - usual_s).abs() < BIAS_TOLERANCE_S {
        "ISIS and ALE read MOC attitude there by themselves: load the file as it is.".to_owned()
    } else {
        format!(
            "ISIS and ALE read MOC attitude {usual_s:.3} s from the exposure whatever the kernel says: this file is \n\
             not for them."
        )
    };
    format!(
        "Orientation of image {id} after an adjustment; written by areograph {version}.\n\
         Load it after the kernels of the mission. It holds for this image alone, which was exposed over\n\
         {exposed}\n\
         (UTC of the first line {utc}). Where the adjustment found that lines were exposed later or earlier\n\
         than their tags say, the orientation of a line stands at its tag, so that nothing else that\n\
         happened meanwhile, a laser shot for one, may be placed with this file.\n\
         \n\
         Positions: MGS relative to the centre of Mars, geometric, J2000. With the rotation of Mars of the\n\
         IAU 2000 report (pck00008 to pck00010) they give the adjusted positions. Programs that add light\n\
         time and stellar aberration (LT+S: ISIS, ALE) move MGS by some 140 m, adjusted or not.\n\
         \n\
         Attitudes: J2000 to MGS_SPACECRAFT. The attitude of an exposure at t stands at t {sign} {size:.3} s,\n\
         as in the kernels that this file replaces. {others}\n",
        id = times.id,
        version = env!("CARGO_PKG_VERSION"),
        exposed = times.exposures(),
        utc = times.utc_start,
        sign = if bias_s < 0.0 { '-' } else { '+' },
        size = bias_s.abs(),
    )
}

/// Reads every sample of `image` through the original kernels and its own pair.
fn read_back(to: &AdjustedKernels, image: &AdjustedImage) -> Result<()> {
    let own = [position_kernel(&image.times.id), attitude_name(image)]
        .map(|name| to.directory.join(name));
    let session = Session::open(&to.originals.followed_by(&own)?)?;
    let (mut distances_m, mut turns_rad) = (Vec::new(), Vec::new());
    for sample in &image.orientation.samples {
        let to_mars = mars_rotation::<MarsIau2000>(sample.et);
        let position = to_mars.apply(&session.state(sample.et)?.position);
        let lookup = to.pointing.ck_bias.lookup(sample.et);
        let attitude = session.attitude(lookup, sample.et, to.kernels.ck_tolerance_s)?;
        let to_camera =
            session.mounting(&image.times.instrument, sample.et)? * attitude.inertial_to_bus;
        let camera_to_mars = to_mars * to_camera.inverse();
        let expected = sample.pose().mars_to_camera;
        distances_m.push(position.distance_m(&sample.position));
        turns_rad.push(rotation_vector(&(camera_to_mars.matrix() * expected)).norm());
    }
    let distance_m = largest(distances_m).unwrap_or_default();
    let turn_rad = largest(turns_rad).unwrap_or_default();
    // Written so that NaN is refused too.
    if distance_m <= POSITION_TOLERANCE_M && turn_rad <= ROTATION_TOLERANCE_RAD {
        return Ok(());
    }
    let what = format!(
        "image {}: positions {distance_m:.1e} m and rotations {turn_rad:.1e} rad apart; expected at most \
         {POSITION_TOLERANCE_M} m and {ROTATION_TOLERANCE_RAD} rad",
        image.times.id
    );
    Err(ProductError::ReadBack { what }.into())
}

/// The original kernels and behind them those of all images.
fn metakernel(to: &AdjustedKernels, images: &[AdjustedImage]) -> Result<String> {
    let names = images
        .iter()
        .flat_map(|image| [position_kernel(&image.times.id), attitude_name(image)]);
    let names: Vec<PathBuf> = names.map(PathBuf::from).collect();
    let files: Vec<PathBuf> = names.iter().map(|name| to.directory.join(name)).collect();
    let own = KernelSet::from_files(&files)?;
    let own = own.kernels().iter().zip(names);
    let own: Vec<Kernel> = own
        .map(|(kernel, path)| Kernel {
            path,
            ..kernel.clone()
        })
        .collect();
    let text = to
        .originals
        .metakernel_text_before(Some(to.site_folder), &own);
    // Text before the first data block is comment.
    Ok(text.replacen(
        "\n\n",
        &format!(
            "\n\nThe last ones are adjusted: each pair for its image alone, not for laser shots nor other images, and with\n\
             the pointing bias of {} s.\n\n",
            to.pointing.ck_bias.seconds()
        ),
        1,
    ))
}
