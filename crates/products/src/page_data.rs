//! All data of a site's page, unrounded, as a product: the page can be regenerated from it without other files.
//!
//! Tables and documents are written for their readers, with the digits and the selection that these need. The page
//! shows more: surfaces, histograms, spans of kernels. Its data are therefore kept completely. Tables for camera
//! models, which no page shows, are left out, and of many images the points of those without plots: a site of a
//! thousand images had a quarter of a gigabyte of them.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{
    error::ProductError,
    files::{create, finish, read},
    product::{self, Content, Declaration, Role},
    read::ReadError,
    site::{AdjustmentProducts, GeometricProducts, ImageProducts, Program, SiteProducts},
};
use areograph_base::{
    error::{IoError, Locate, Result},
    footprints::Footprints,
    frames::BodyFixed,
    stored::whole,
};
use areograph_config::SiteConfig;
use areograph_spice::{KernelSet, RequiredCoverage};
use areograph_stages::{
    adjust::Adjusted,
    check_heights::HeightCheck,
    check_profiles::ProfileCheck,
    check_ranges::RangeCheck,
    compare_pairs::PairComparison,
    convert_datum::FileConversion,
    describe_kernels::KernelLine,
    fit_sensor_model::SensorModel,
    group_profiles::Profile,
    intersect::IntersectedTies,
    judge::Verdict,
    lay_overlays::Overlays,
    map_surface::{Surface, SurfaceAccount, SurfaceModel},
    read_ties::Ties,
    rectify_images::{Orthoimage, OrthoimageAccount},
    register::ImageRegistration,
    sample_orientation::Orientation,
    tag_times::ImageTimes,
};
use areograph_store::files::{file_name, hash_file};

/// Bytes that are hashed at once.
const PIECE_BYTES: usize = 1 << 17;

/// Its path below a site's folder.
pub const PAGE_DATA: &str = "report/page.postcard";

pub(super) static DATA: Declaration = Declaration {
    path: PAGE_DATA,
    what: "all that the report shows, unrounded; BLAKE3 in the manifest, layout of this version of areograph",
    readers: "`areograph report`",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: product::Write::Site(|path, of| write(path, of.site).map(|()| Some(0))),
    uses: &[],
};

/// Data of a page, borrowed from a run or read from its product. The file is this struct in postcard.
#[derive(Debug, Serialize, Deserialize)]
pub struct PageData<'a> {
    /// The configuration in TOML: postcard cannot represent infinite or absent values.
    config: String,
    /// Names of the PEDR files, which the configuration leaves out when it is written.
    pedr_files: Vec<String>,
    /// In JSON, as in the manifest.
    verdict: String,
    kernels: Cow<'a, [KernelLine]>,
    required: Cow<'a, RequiredCoverage>,
    images: Vec<Image<'a>>,
    conversions: Cow<'a, [FileConversion]>,
    footprints: Cow<'a, Footprints<BodyFixed>>,
    utc: Cow<'a, [String]>,
    profiles: Cow<'a, [Profile]>,
    profile_check: Cow<'a, ProfileCheck>,
    ranges: Cow<'a, RangeCheck>,
    rejected: Cow<'a, BTreeMap<String, u64>>,
    complaints: Cow<'a, [String]>,
    notes: Cow<'a, [String]>,
    geometric: Option<Geometric<'a>>,
    overlays: Option<Cow<'a, Overlays>>,
    /// The page shows only the account of a terrain model.
    surface: Option<Cow<'a, SurfaceAccount>>,
    /// See `surface`.
    orthoimages: Vec<Cow<'a, OrthoimageAccount>>,
    program: Cow<'a, Program>,
}

/// See [`ImageProducts`].
#[derive(Debug, Serialize, Deserialize)]
struct Image<'a> {
    times: Cow<'a, ImageTimes>,
    orientation: Cow<'a, Orientation>,
    model: Cow<'a, SensorModel>,
    registration: Cow<'a, ImageRegistration>,
}

/// See [`GeometricProducts`].
#[derive(Debug, Serialize, Deserialize)]
struct Geometric<'a> {
    ties: Cow<'a, Ties>,
    intersected: Cow<'a, IntersectedTies>,
    pairs: Cow<'a, [PairComparison]>,
    heights: Cow<'a, HeightCheck>,
    adjustment: Option<Adjustment<'a>>,
}

/// See [`AdjustmentProducts`], without kernels, which the page does not show.
#[derive(Debug, Serialize, Deserialize)]
struct Adjustment<'a> {
    adjusted: Cow<'a, Adjusted>,
    heights: Cow<'a, HeightCheck>,
    images: Vec<Image<'a>>,
    intersected: Cow<'a, IntersectedTies>,
    pairs: Cow<'a, [PairComparison]>,
    images_agree: bool,
}

impl<'a> PageData<'a> {
    /// Data of the page of `site`; of paths only file names.
    fn of(site: &SiteProducts<'a>) -> std::result::Result<Self, ProductError> {
        let mut config = site.config.clone();
        config.file = PathBuf::from(file_name(&config.file));
        let config =
            toml::Table::try_from(&config).map_err(ProductError::refused("encode TOML"))?;
        let verdict =
            serde_json::to_string(site.verdict).map_err(ProductError::refused("encode JSON"))?;
        let pedr_files = site.config.pedr.files.iter();
        let shown = site.shown_images();
        let orthoimages = site.orthoimages.iter();
        Ok(Self {
            config: config.to_string(),
            pedr_files: pedr_files.map(|path| file_name(path)).collect(),
            verdict,
            kernels: site.kernels.into(),
            required: Cow::Borrowed(site.required),
            images: images(site.images, &shown),
            conversions: site.conversions.into(),
            footprints: Cow::Borrowed(site.footprints),
            utc: site.utc.into(),
            profiles: site.profiles.into(),
            profile_check: Cow::Borrowed(site.profile_check),
            ranges: Cow::Borrowed(site.ranges),
            rejected: Cow::Borrowed(site.rejected),
            complaints: site.complaints.into(),
            notes: site.notes.into(),
            geometric: site.geometric.map(|of| geometric(of, &shown)),
            overlays: site.overlays.map(Cow::Borrowed),
            surface: site.surface.map(|of| Cow::Borrowed(&of.account)),
            orthoimages: orthoimages.map(|of| Cow::Borrowed(&of.account)).collect(),
            program: Cow::Borrowed(site.program),
        })
    }

    /// Reads it from its product in the folder of a site.
    ///
    /// # Errors
    /// A file of kind input that this version did not write; an error of the disk.
    pub fn read(site_folder: &Path) -> Result<PageData<'static>> {
        let path = site_folder.join(PAGE_DATA);
        decoded(&read(&path)?).in_file(path)
    }

    /// Calls `with` on the site as the page needs it.
    ///
    /// # Errors
    /// A configuration or verdict that this version did not write; what `with` returns.
    pub fn with<T>(&self, with: impl FnOnce(&SiteProducts) -> Result<T>) -> Result<T> {
        let mut config: SiteConfig =
            toml::from_str(&self.config).map_err(ReadError::unreadable("a configuration"))?;
        config.pedr.files = self.pedr_files.iter().map(PathBuf::from).collect();
        let verdict: Verdict =
            serde_json::from_str(&self.verdict).map_err(ReadError::unreadable("a verdict"))?;
        let adjustment = self
            .geometric
            .as_ref()
            .and_then(|of| of.adjustment.as_ref());
        let adjusted_images = adjustment.map_or(&[][..], |of| &of.images);
        let (images, adjusted_images) = (borrowed(&self.images), borrowed(adjusted_images));
        let kernels = KernelSet::default();
        let adjustment = adjustment.map(|of| AdjustmentProducts {
            kernels: &kernels,
            folder: Path::new(""),
            adjusted: &of.adjusted,
            heights: &of.heights,
            images: &adjusted_images,
            tables: &[],
            intersected: &of.intersected,
            pairs: &of.pairs,
            images_agree: of.images_agree,
        });
        let orthoimages = self.orthoimages.iter().map(|account| Orthoimage {
            account: account.clone().into_owned(),
            brightness: Vec::new(),
            sigmas_m: Vec::new(),
        });
        let orthoimages: Vec<Orthoimage> = orthoimages.collect();
        let surface = self.surface.as_ref().map(|account| Surface {
            account: account.clone().into_owned(),
            model: SurfaceModel::nothing(),
        });
        with(&SiteProducts {
            config: &config,
            kernels: &self.kernels,
            metakernel: "",
            required: &self.required,
            images: &images,
            conversions: &self.conversions,
            footprints: &self.footprints,
            utc: &self.utc,
            profiles: &self.profiles,
            profile_check: &self.profile_check,
            ranges: &self.ranges,
            rejected: &self.rejected,
            complaints: &self.complaints,
            notes: &self.notes,
            verdict: &verdict,
            geometric: self.geometric.as_ref().map(|of| GeometricProducts {
                ties: &of.ties,
                intersected: &of.intersected,
                pairs: &of.pairs,
                heights: &of.heights,
                adjustment,
            }),
            overlays: self.overlays.as_deref(),
            surface: surface.as_ref(),
            orthoimages: &orthoimages,
            program: &self.program,
        })
    }
}

/// Images as the page needs them; `shown` are the images with separate plots.
fn images<'a>(images: &[ImageProducts<'a>], shown: &[usize]) -> Vec<Image<'a>> {
    let images = images.iter().enumerate().map(|(index, image)| Image {
        times: Cow::Borrowed(image.times),
        orientation: Cow::Owned(image.orientation.without_tables()),
        model: Cow::Borrowed(image.model),
        registration: if shown.binary_search(&index).is_ok() {
            Cow::Borrowed(image.registration)
        } else {
            Cow::Owned(image.registration.without_points())
        },
    });
    images.collect()
}

fn borrowed<'a>(images: &'a [Image]) -> Vec<ImageProducts<'a>> {
    let images = images.iter().map(|image| ImageProducts {
        times: &image.times,
        orientation: &image.orientation,
        model: &image.model,
        registration: &image.registration,
    });
    images.collect()
}

fn geometric<'a>(of: GeometricProducts<'a>, shown: &[usize]) -> Geometric<'a> {
    Geometric {
        ties: Cow::Borrowed(of.ties),
        intersected: Cow::Borrowed(of.intersected),
        pairs: of.pairs.into(),
        heights: Cow::Borrowed(of.heights),
        adjustment: of.adjustment.map(|of| Adjustment {
            adjusted: Cow::Borrowed(of.adjusted),
            heights: Cow::Borrowed(of.heights),
            images: images(of.images, shown),
            intersected: Cow::Borrowed(of.intersected),
            pairs: of.pairs.into(),
            images_agree: of.images_agree,
        }),
    }
}

/// Writes the data of the page of `site`, and checks that the file holds them.
///
/// It is not decoded: of a million shots the decoded data would be the largest part of a run's memory.
fn write(path: &Path, site: &SiteProducts) -> Result<()> {
    // Numbers are encoded one by one, and hashed in pieces.
    let mut written = BufWriter::with_capacity(PIECE_BYTES, Hashed::new(create(path)?));
    encode(site, &mut written).in_file(path)?;
    let written = written
        .into_inner()
        .map_err(|refusal| IoError::on("write")(refusal.into_error()))
        .in_file(path)?;
    let (file, hash) = written.end();
    finish(path, file)?;
    if hash_file(path)?.0 == *hash.to_hex() {
        return Ok(());
    }
    Err(ProductError::ReadBack {
        what: "the data of the report".to_owned(),
    })
    .in_file(path)
}

/// Writes data as they are encoded: a site with a million shots has half a gigabyte of them.
fn encode(site: &SiteProducts, to: &mut BufWriter<Hashed<impl Write>>) -> Result<()> {
    let data = PageData::of(site)?;
    let encoded = whole(|| postcard::to_io(&data, &mut *to).map(|_| ()));
    let flushed = to.flush();
    if let Some(refusal) = to.get_mut().refusal.take() {
        return Err(IoError::on("write")(refusal).into());
    }
    encoded.map_err(ProductError::refused("encode postcard"))?;
    Ok(flushed.map_err(IoError::on("write"))?)
}

/// A writer that hashes its data, and keeps the reason of an error, which postcard discards.
struct Hashed<W> {
    to: W,
    hash: blake3::Hasher,
    refusal: Option<io::Error>,
}

impl<W: Write> Hashed<W> {
    fn new(to: W) -> Self {
        Self {
            to,
            hash: blake3::Hasher::new(),
            refusal: None,
        }
    }

    fn end(self) -> (W, blake3::Hash) {
        (self.to, self.hash.finalize())
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.to.write(bytes) {
            Ok(count) => {
                self.hash.update(&bytes[..count]);
                Ok(count)
            }
            // Is tried again.
            Err(refusal) if refusal.kind() == io::ErrorKind::Interrupted => Err(refusal),
            Err(refusal) => {
                let kind = refusal.kind();
                self.refusal = Some(refusal);
                Err(kind.into())
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

fn decoded<T: DeserializeOwned>(bytes: &[u8]) -> std::result::Result<T, ReadError> {
    postcard::from_bytes(bytes).map_err(ReadError::unreadable("the data of a report"))
}
