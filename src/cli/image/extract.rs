//! `areograph image extract`.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::{
    body::Body,
    cli::{output, progress::Progress},
    config::all_instruments,
    error::{Cause, Locate as _, Result},
    files::require_apart,
    pds::{
        control_table::{ImageControl, read_image_control},
        image_file::{ImageFile, LineState, OddEven, Radiometry, Strip},
        pixel_file::PixelFile,
        product_named,
    },
    products::{PictureFile, PictureFormat, PictureHead},
};

/// Writes the pixels of an image as PNG, or as TIFF with tiles and overviews.
///
/// Pixels are those of the file, line 0 first and at the top: on the day side, south is up and east is left. Missing
/// lines are black; --mask distinguishes them from dark ones.
///
/// Example: areograph image extract m0100115.imq --out m0100115.png
#[derive(Debug, Args)]
#[allow(clippy::doc_markdown, reason = "help is printed verbatim")]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Image file of the archive (.imq, .img), ISIS cube, TIFF or PNG of one band of grey.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// File to write; its extension (.png, .tif, .tiff) determines the format.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// 16 bits: relative radiance from gain, offset and exposure, with the offset between odd and even detectors
    /// removed (narrow angle without summing). The values are not suited to geometric work. They are not
    /// reflectances, because the constants of that calibration are not public. The command refuses images whose
    /// gain changes from line to line.
    #[arg(long)]
    calibrate: bool,
    /// Also write a mask of good (255), suspect (128) and missing (0) lines, in one of the same formats.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Ground control points for the TIFF, with which QGIS and gdalwarp place it on a map: control_points.csv among the
    /// products of a site, or a table with its columns. Between the points, the image follows no relief.
    #[arg(long, value_name = "CSV")]
    control: Option<PathBuf>,
}

/// An unsupported extension.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{}; expected the extension .png, .tif or .tiff", .0.display())]
#[cause(Configuration: "name the file with one of these extensions")]
struct Ending(PathBuf);

/// An image without a readable line.
#[derive(Debug, thiserror::Error, Cause)]
#[error("no line of the image can be read")]
#[cause(Input: "fetch the file again; `areograph image info` lists the errors")]
struct NoLines;

/// A radiometric correction of a file whose label does not state gain and offset.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--calibrate requires an image file of the archive, whose label states gain and offset")]
#[cause(Configuration: "give the .imq or .img file, or omit --calibrate")]
struct NotOfTheArchive;

/// Control points that do not belong to the picture.
#[derive(Debug, thiserror::Error, Cause)]
enum ControlError {
    #[error("{}: PNG files have no ground control points", .0.display())]
    #[cause(Configuration: "write a TIFF: name the file with the extension .tif")]
    NotATiff(PathBuf),
    #[error("its points are in the image {control}, and the label states {product}")]
    #[cause(Input: "give the control points of this image")]
    Product { control: String, product: String },
    #[error("its points are on the body {0}, and the image shows mars")]
    #[cause(Input: "give the control points of this image")]
    Body(&'static str),
    #[error(
        "a point is at line {line} and sample {sample}; expected 0 to {lines} and 0 to {samples}, the edges of the image"
    )]
    #[cause(Input: "give the control points of this image, and check their lines and samples")]
    Outside {
        line: f64,
        sample: f64,
        lines: u32,
        samples: u32,
    },
}

/// Margin beyond the range of the pixels for the correction of odd and even samples, DN.
const ROOM_DN: f64 = 16.0;

/// Conversion of a DN to a 16-bit value.
struct Calibration {
    radiometry: Radiometry,
    odd_even_dn: f64,
    /// Radiance of the value 0, and increment per step.
    least: f64,
    step: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let format = format(&arguments.out)?;
    let mask_format = arguments.mask.as_deref().map(self::format).transpose()?;
    let outputs = std::iter::once(&arguments.out).chain(&arguments.mask);
    let inputs = std::iter::once(&arguments.file).chain(&arguments.control);
    require_apart(outputs.map(PathBuf::as_path), inputs.map(PathBuf::as_path))?;
    if arguments.control.is_some() && format != PictureFormat::Tiff {
        return Err(ControlError::NotATiff(arguments.out.clone()).into());
    }
    let progress = Progress::of_work("image extract");
    progress.show("decoding".to_owned());
    let image = PixelFile::open(&arguments.file, all_instruments())?;
    let (mut lines, mut odd_even, mut complaints) = (
        0,
        OddEven::default(),
        image
            .archive()
            .map_or(0, |image| image.complaints().count()),
    );
    complaints += each(&image, |strip| {
        lines += strip.states.len();
        odd_even.add(strip);
        Ok(())
    })?;
    let height = u32::try_from(lines).ok().filter(|height| *height > 0);
    let height = height.ok_or(NoLines).in_file(&arguments.file)?;
    let control = arguments.control.as_deref();
    let control = control.map(|path| control_of(path, &image, height));
    let calibration = arguments
        .calibrate
        .then(|| Calibration::new(image.archive().ok_or(NotOfTheArchive)?, &odd_even))
        .transpose()
        .in_file(&arguments.file)?;
    let head = PictureHead {
        width: image.samples(),
        height,
        is_deep: calibration.is_some(),
        notes: notes(&image, calibration.as_ref()),
        control: control.transpose()?,
    };
    let mut mask = match (&arguments.mask, mask_format) {
        (Some(path), Some(format)) => {
            let head = PictureHead {
                is_deep: false,
                notes: vec![("Description", "255 good, 128 suspect, 0 missing".to_owned())],
                ..head.clone()
            };
            Some(PictureFile::create(path, format, head)?)
        }
        _ => None,
    };
    let mut picture = PictureFile::create(&arguments.out, format, head)?;
    each(&image, |strip| {
        if let Some(mask) = &mut mask {
            mask.write(&mask_pixels(strip))?;
        }
        picture.write(&pixels(strip, calibration.as_ref()))
    })?;
    picture.finish()?;
    if let Some(mask) = mask {
        mask.finish()?;
    }
    drop(progress);
    if complaints > 0 {
        tracing::warn!(
            "{complaints} errors in {}; `areograph image info` lists them",
            arguments.file.display()
        );
    }
    output::line(format_args!(
        "{}: {} × {height} pixels",
        arguments.out.display(),
        image.samples()
    ));
    Ok(())
}

/// The control points of an image of so many lines.
fn control_of(path: &Path, image: &PixelFile, lines: u32) -> Result<ImageControl> {
    let control = read_image_control(path)?;
    let label = image.label();
    let product = label.and_then(|label| label.product_id.as_deref());
    let named = [Some(&*control.image), product].map(|name| name.and_then(product_named));
    if let ([Some(one), Some(other)], Some(product)) = (&named, product)
        && one != other
    {
        let (control, product) = (control.image.clone(), product.to_owned());
        return Err(ControlError::Product { control, product }).in_file(path);
    }
    if image.archive().is_some() && control.body != Body::Mars {
        return Err(ControlError::Body(control.body.word())).in_file(path);
    }
    let samples = image.samples();
    let is_outside = |line: f64, sample: f64| {
        !(0.0..=f64::from(lines)).contains(&line) || !(0.0..=f64::from(samples)).contains(&sample)
    };
    let mut points = control.points.iter();
    if let Some(point) = points.find(|point| is_outside(point.line, point.sample)) {
        let (line, sample) = (point.line, point.sample);
        return Err(ControlError::Outside {
            line,
            sample,
            lines,
            samples,
        })
        .in_file(path);
    }
    Ok(control)
}

fn format(path: &Path) -> Result<PictureFormat> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    match ending.to_str() {
        Some("png") => Ok(PictureFormat::Png),
        Some("tif" | "tiff") => Ok(PictureFormat::Tiff),
        _ => Err(Ending(path.to_owned()).into()),
    }
}

/// Passes every strip of an image to `show`; returns the number of complaints.
fn each(image: &PixelFile, mut show: impl FnMut(&Strip) -> Result<()>) -> Result<u64> {
    let mut strips = image.strips()?;
    while let Some(strip) = strips.next_strip()? {
        show(&strip)?;
    }
    let (_, count) = strips.complaints();
    Ok(count)
}

fn notes(image: &PixelFile, calibration: Option<&Calibration>) -> Vec<(&'static str, String)> {
    let label = image.label();
    let mut notes = Vec::new();
    let product = label.and_then(|label| label.product_id.clone());
    notes.extend(product.map(|product| ("Title", product)));
    if let Some(calibration) = calibration {
        let zero = if calibration.radiometry.knows_zero {
            ""
        } else {
            ", less an unknown constant"
        };
        notes.push((
            "Description",
            format!(
                "relative radiance in DN/ms at gain 1{zero} = {:e} + {:e} * value; {:.3} DN added to odd samples and \
                 subtracted from even samples",
                calibration.least, calibration.step, calibration.odd_even_dn
            ),
        ));
    }
    notes
}

fn pixels(strip: &Strip, calibration: Option<&Calibration>) -> Vec<u16> {
    let Some(calibration) = calibration else {
        return strip.pixels.iter().map(|pixel| u16::from(*pixel)).collect();
    };
    let lines = strip.lines().flat_map(|(line, state)| {
        let is_there = *state != LineState::Missing;
        let values = line.iter().enumerate();
        values.map(move |(sample, pixel)| {
            if is_there {
                calibration.value(sample, *pixel)
            } else {
                0
            }
        })
    });
    lines.collect()
}

fn mask_pixels(strip: &Strip) -> Vec<u16> {
    let value = |state: &LineState| match state {
        LineState::Good => 255,
        LineState::Suspect => 128,
        LineState::Missing => 0,
    };
    let lines = strip.states.iter();
    lines
        .flat_map(|state| std::iter::repeat_n(value(state), strip.samples as usize))
        .collect()
}

impl Calibration {
    fn new(image: &ImageFile, odd_even: &OddEven) -> Result<Self> {
        let radiometry = Radiometry::of(image)?;
        let is_unsummed = image.label().fields.crosstrack_summing == Some(1);
        let is_narrow = image.label().instrument.label.filter.is_none();
        let odd_even_dn = odd_even
            .correction_dn()
            .filter(|_| is_unsummed && is_narrow);
        let least = radiometry.dn_per_ms(-ROOM_DN);
        let largest = radiometry.dn_per_ms(255.0 + ROOM_DN);
        Ok(Self {
            radiometry,
            odd_even_dn: odd_even_dn.unwrap_or_default(),
            least,
            step: (largest - least) / f64::from(u16::MAX),
        })
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the range of 16 bits before"
    )]
    fn value(&self, sample: usize, pixel: u8) -> u16 {
        let sign = if sample.is_multiple_of(2) { 1.0 } else { -1.0 };
        let dn = f64::from(pixel) + sign * self.odd_even_dn;
        let value = (self.radiometry.dn_per_ms(dn) - self.least) / self.step;
        value.round().clamp(0.0, f64::from(u16::MAX)) as u16
    }
}
