//! Adjusted orientations as SPICE kernels that are loaded after the original ones; their contents are tabulated by
//! [`areograph_stages::tabulate_kernels`]. There are two pairs for each image, see [`KernelReaders`].

use std::{
    fs,
    path::{Path, PathBuf},
    ptr,
};

use super::{
    files::write_text,
    product::{Content, Context, Declaration, Product, Program, Role, Use, Write, Written},
    site::{AdjustmentProducts, SiteProducts},
};
use areograph_base::{
    constants::NAIF_MARS,
    error::{IoError, Locate, Result},
    instruments::Instrument,
};
use areograph_config::PointingConfig;
use areograph_geom::light_time::LightTime;
use areograph_spice::{
    EncodedCkSegment, Kernel, KernelSet, SpkSegment, write_encoded_ck, write_spk,
};
use areograph_stages::{
    tabulate_kernels::{AdjustedTables, KernelReading, KernelTables},
    tag_times::ImageTimes,
};

/// Tolerance within which a bias is the usual one, seconds.
const BIAS_TOLERANCE_S: f64 = 1e-9;

/// Longest name of a segment.
const SEGMENT_NAME_MAX: usize = 40;

/// An image with the contents of its adjusted kernels.
#[derive(Debug, Clone, Copy)]
pub struct AdjustedImage<'a> {
    /// Line times.
    pub times: &'a ImageTimes,
    /// States and attitudes.
    pub tables: &'a AdjustedTables,
    /// The convention of the run.
    pub light_time: LightTime,
    /// Whether its orientation is valid.
    pub is_valid: bool,
}

/// Destination of the kernels, and the kernels that they replace.
#[derive(Debug, Clone, Copy)]
pub struct AdjustedKernels<'a> {
    /// Folder to write to.
    pub directory: &'a Path,
    /// Final folder of the site: paths in `adjusted.tm` are relative to it.
    pub site_folder: &'a Path,
    /// The original kernels.
    pub originals: &'a KernelSet,
    /// The pointing bias that readers of the kernels will apply, if it replaces the camera's.
    pub pointing: &'a PointingConfig,
}

/// Readers of a pair of adjusted kernels. Kernels hold geometric states, from which a reader computes the camera by its own
/// convention for light time: each pair gives its readers the adjusted rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KernelReaders {
    /// Readers with the convention of the run: areograph, and SPICE.
    Run,
    /// ISIS and ALE.
    Centre,
}

impl KernelReaders {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Run, Self::Centre];

    /// Position and attitude.
    const fn declarations(self) -> [&'static Declaration; 2] {
        match self {
            Self::Run => [&POSITION, &ATTITUDE],
            Self::Centre => [&CENTRE_POSITION, &CENTRE_ATTITUDE],
        }
    }

    /// Paths of the SPK and the CK of an image below the folder of the products.
    #[must_use]
    pub fn paths(self, image: &str) -> [String; 2] {
        self.declarations().map(|of| of.path_of(image))
    }

    /// How these readers compute `camera`, in a run with the convention `run` and this bias.
    #[must_use]
    pub fn reading(
        self,
        run: LightTime,
        camera: &Instrument,
        pointing: &PointingConfig,
    ) -> KernelReading {
        match self {
            Self::Run => KernelReading::of_run(run, camera, pointing),
            Self::Centre => KernelReading::of_isis(camera),
        }
    }

    /// Whether they have a pair of an image whose orientation is valid or not. Where the attitude jumps, the light time along the
    /// boresight also jumps; only states for readers with the convention of the run reproduce it.
    #[must_use]
    pub const fn have(self, is_valid: bool) -> bool {
        matches!(self, Self::Run) || is_valid
    }

    const fn tables(self, of: &AdjustedTables) -> &KernelTables {
        match self {
            Self::Run => &of.own,
            Self::Centre => &of.centre,
        }
    }
}

/// A kernel of a pair.
const fn kernel(
    path: &'static str,
    what: &'static str,
    readers: &'static str,
    uses: &'static [Use],
) -> Declaration {
    Declaration {
        path,
        what,
        readers,
        rows: "epochs",
        role: Role::Data,
        content: Content::Foreign,
        write: Write::WithAnother,
        uses,
    }
}

/// Readers of the pair with the convention of the run.
const RUN: &str = "areograph, SPICE; ISIS and ALE only in a run with light time to the centre";
/// Readers of the pair with light time to the centre.
const CENTRE: &str = "ISIS, ALE";

pub(super) static ATTITUDE: Declaration = kernel(
    "adjusted/<image>.bc",
    "adjusted attitude of the bus around the time of the image, J2000 (CK type 3)",
    RUN,
    &[],
);
pub(super) static POSITION: Declaration = kernel(
    "adjusted/<image>.bsp",
    "positions of the spacecraft relative to {body}, from which the light-time convention of the run gives the adjusted \
     camera of the image, J2000 (SPK type 13)",
    RUN,
    &[],
);
pub(super) static CENTRE_ATTITUDE: Declaration = kernel(
    "exchange/centre/<image>_adjusted.bc",
    "attitude of the bus from which ISIS and ALE compute the adjusted camera of a valid image, J2000 (CK type 3)",
    CENTRE,
    &[Use {
        program: Program::AdjustedKernels,
        lines: "spiceinit from=<image>.cub spk=centre/<image>_adjusted.bsp ck=centre/<image>_adjusted.bc",
    }],
);
pub(super) static CENTRE_POSITION: Declaration = kernel(
    "exchange/centre/<image>_adjusted.bsp",
    "positions of the spacecraft relative to {body}, from which ISIS and ALE compute the adjusted camera of a valid image, \
     J2000 (SPK type 13)",
    CENTRE,
    &[],
);

pub(super) static METAKERNEL: Declaration = Declaration {
    path: "adjusted.tm",
    what: "metakernel with the site kernels, followed by the adjusted kernels",
    readers: RUN,
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Several(of_site),
    uses: &[],
};

/// Whether the image with this index has this kernel. Images with support data have none.
pub(super) fn has(site: &SiteProducts, kernel: &Declaration, index: usize) -> bool {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.images);
    adjusted.is_some_and(|images| {
        let is_valid = images[index].invalid_because().is_empty();
        let mut readers = KernelReaders::ALL.into_iter();
        let readers = readers.find(|of| of.declarations().iter().any(|of| of.path == kernel.path));
        images[index].times.support.is_none() && readers.is_some_and(|of| of.have(is_valid))
    })
}

/// The adjusted kernels of a site.
fn of_site(of: &Context, adjustment: &AdjustmentProducts) -> Result<Vec<Written>> {
    let to = AdjustedKernels {
        directory: of.directory,
        site_folder: adjustment.folder,
        originals: adjustment.kernels,
        pointing: &of.site.config.pointing,
    };
    let images = adjustment.images.iter().zip(adjustment.tables);
    let images = images.filter(|(image, _)| image.times.support.is_none());
    let images = images.map(|(image, tables)| AdjustedImage {
        times: image.times,
        tables,
        light_time: image.orientation.light_time.convention,
        is_valid: image.invalid_because().is_empty(),
    });
    written(&to, &images.collect::<Vec<_>>())
}

/// Writes the pairs of an SPK and a CK of every image, and the metakernel of the pairs for readers with the convention of
/// the run.
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for tables that no kernel can hold, and for a session that is open on this
/// thread; [`Kind::Io`](areograph_base::error::Kind::Io).
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
    for readers in KernelReaders::ALL {
        for declaration in readers.declarations() {
            for image in images.iter().filter(|image| readers.have(image.is_valid)) {
                let name = declaration.path_of(&image.times.id);
                let path = to.directory.join(&name);
                if let Some(folder) = path.parent() {
                    fs::create_dir_all(folder)
                        .map_err(IoError::on("make the folder"))
                        .in_file(folder)?;
                }
                let tables = readers.tables(image.tables);
                let comment = comment(image, readers, to);
                let is_position = ptr::eq(declaration, readers.declarations()[0]);
                let rows = if is_position {
                    write_position(&path, image, tables, &comment)
                } else {
                    write_attitude(&path, image, tables, &comment)
                };
                add(name, rows?, declaration);
            }
        }
    }
    let path = to.directory.join(METAKERNEL.path);
    write_text(&path, &metakernel(to, images)?)?;
    add(METAKERNEL.path.to_owned(), 0, &METAKERNEL);
    Ok(written)
}

fn segment_name(image: &AdjustedImage) -> String {
    let id = image.times.id.chars();
    id.take(SEGMENT_NAME_MAX).collect()
}

fn write_attitude(
    path: &Path,
    image: &AdjustedImage,
    tables: &KernelTables,
    comment: &str,
) -> Result<u64> {
    let segment = EncodedCkSegment {
        bus: image.times.instrument.spacecraft.bus,
        name: &segment_name(image),
        ticks: &tables.ticks,
        quaternions: &tables.quaternions,
        angular_velocities_rad_s: &tables.rates_rad_s,
        interval_starts: tables.ticks.get(..1).unwrap_or_default(),
    };
    write_encoded_ck(path, &[segment], comment)?;
    Ok(tables.ticks.len() as u64)
}

fn write_position(
    path: &Path,
    image: &AdjustedImage,
    tables: &KernelTables,
    comment: &str,
) -> Result<u64> {
    let segment = SpkSegment {
        target: image.times.instrument.spacecraft.naif,
        centre: NAIF_MARS,
        name: &segment_name(image),
        degree: KernelTables::STATE_DEGREE,
        epochs: &tables.epochs,
        states: &tables.states,
    };
    write_spk(path, &[segment], comment)?;
    Ok(tables.epochs.len() as u64)
}

/// Text of the comment areas of both kernels.
fn comment(image: &AdjustedImage, readers: KernelReaders, to: &AdjustedKernels) -> String {
    let times = image.times;
    let reading = readers.reading(image.light_time, &times.instrument, to.pointing);
    let bias_s = reading.bias.seconds();
    let usual_s = times.instrument.pointing.ck_bias_s;
    let others = if (bias_s - usual_s).abs() < BIAS_TOLERANCE_S {
        "ISIS and ALE apply this offset, too.".to_owned()
    } else {
        format!(
            "ISIS and ALE always read the attitude at an offset of {usual_s:.3} s: load the files in\n\
             exchange/centre in these programs."
        )
    };
    format!(
        "Adjusted orientation of image {id}; written by areograph {version}.\n\
         Load this file after the mission kernels. It is valid only for this image, which was exposed during\n\
         {exposed}\n\
         (UTC of the first line {utc}). Where the adjustment found that lines were exposed later or earlier\n\
         than their tags, the orientation of a line is stored at its tag: do not use this file\n\
         to locate other observations of the same time, such as laser shots.\n\
         \n\
         Positions: {spacecraft} relative to the centre of Mars, geometric, J2000, with the Mars rotation of the\n\
         IAU 2000 report (pck00008 to pck00010). {positions}\n\
         Use positions and attitudes together: the adjustment does not separate them from line times along the track.\n\
         The camera may have been elsewhere along its orbit when a line was exposed; the attitude compensates for \
         this\n\
         on the ground (line_time_sigma_s in adjustment.json).\n\
         \n\
         Attitudes: J2000 to {bus_frame}. The attitude of an exposure at t is stored at t {sign} {size:.3} s,\n\
         as in the kernels that this file replaces. {others}\n",
        id = times.id,
        spacecraft = times.instrument.spacecraft.name,
        bus_frame = times.instrument.spacecraft.bus_frame,
        version = env!("CARGO_PKG_VERSION"),
        exposed = times.exposures(),
        utc = times.utc_start,
        positions = positions(reading.light_time),
        sign = if bias_s < 0.0 { '-' } else { '+' },
        size = bias_s.abs(),
    )
}

/// Readers for which the positions in an SPK are the adjusted ones.
const fn positions(light_time: LightTime) -> &'static str {
    match light_time {
        LightTime::Surface => {
            "This file is for readers that apply aberration and light\n\
             time to the surface: an exposure has the position of the instant at which the light left the\n\
             ground. Programs that compute the spacecraft position from the centre of Mars (LT+S: ISIS, ALE) obtain\n\
             a different position: load the files in exchange/centre in these programs."
        }
        LightTime::None | LightTime::Support => {
            "This file is for readers that apply no light time:\n\
             an exposure has the position of its own instant. Programs that compute the spacecraft position from\n\
             the centre of Mars (LT+S: ISIS, ALE) obtain a different position: load the files in exchange/centre in\n\
             these programs."
        }
        LightTime::Centre => {
            "This file is for programs that compute the position as\n\
             seen from the centre of Mars with light time and aberration (LT+S: ISIS, ALE): only these programs\n\
             obtain the adjusted positions."
        }
    }
}

/// The original kernels, followed by the kernels of all images.
fn metakernel(to: &AdjustedKernels, images: &[AdjustedImage]) -> Result<String> {
    let names = images.iter();
    let names = names.flat_map(|image| KernelReaders::Run.paths(&image.times.id));
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
    let cameras = images.iter().map(|image| &image.times.instrument);
    let biases = to.pointing.used(cameras).into_iter();
    let biases: Vec<String> = biases
        .map(|of| format!("{} s", of.bias.seconds()))
        .collect();
    // Text before the first data block is comment.
    Ok(text.replacen(
        "\n\n",
        &format!(
            "\n\nThe last kernels are adjusted: each pair is valid only for its image with the \
             pointing\n\
             bias of {}, not for laser shots or other images.\n\n",
            biases.join(", ")
        ),
        1,
    ))
}
