//! Laser shots along given kernels, for a real flight without an available PEDR file.

use std::{
    fs,
    path::{Path, PathBuf},
};

use nalgebra::Vector3;

use super::{
    SceneSummary,
    arc::{Beam, Flight},
    error::SceneError,
    error_sources::{Relief, SceneErrors},
    files::{Draft, put},
    laser::{FRAME_S, LaserErrors},
    mission::write_as_truth,
    pedr::{PedrRequest, frame_tags, write_pedr},
    profile_shift::ProfileShift,
    sites::{README_ALONG, SiteFile, SiteImage, SiteKernels, Window},
    terrain::Terrain,
    truth::{KeptShot, ProfileTruth, Truth},
};
use areograph_base::{
    body::Datum,
    error::{IoError, Locate, Result},
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use areograph_config::{built_in_instruments, usual_altimeter, usual_instrument};
use areograph_geom::ellipsoid::Spherical;
use areograph_pds::read_label;
use areograph_spice::{KernelSet, Session};

/// Shortest stretch of flight, seconds.
const STRETCH_MIN_S: f64 = 20.0;
/// Beams are computed at multiples of this from a frame's mid-point: half the spacing of shots.
const BEAM_STEP_S: f64 = 0.05;
/// Margin of the windows around the shots, degrees.
const WINDOW_MARGIN_DEG: f64 = 0.1;
/// The synthetic orbit number; the file name has 10 000 more, as in the archive.
const ORBIT: u32 = 1;
/// Name of the file.
const PEDR_NAME: &str = "ap10001l.b";

/// Writes PEDR files for the flight of the kernels of `metakernel`, with a site configuration that has one window per
/// stretch of flight and one image per label.
///
/// The laser looks along the bus's +Z. Attitude is read 1.15 s early and time tags are 0.117 s late, as in
/// [`super::write_scene`]. Shots are exact. No session may be open on this thread.
///
/// # Errors
/// [`SceneError::NothingToFly`], [`SceneError::BeamMisses`]; [`SceneError::NotAScene`], [`SceneError::Foreign`] and
/// [`SceneError::Changed`] when the folder holds something else; errors of the kernels and labels.
pub fn write_scene_along(
    directory: &Path,
    metakernel: &Path,
    labels: &[PathBuf],
    seed: u64,
) -> Result<SceneSummary> {
    let metakernel = absolute(metakernel)?;
    let images = labels
        .iter()
        .map(|label| site_image(label))
        .collect::<Result<Vec<_>>>()?;
    let draft = Draft::begin(directory, README_ALONG)?;

    let session = Session::open(&KernelSet::from_metakernel(&metakernel)?)?;
    let stretches = stretches(&session)?;
    let flights = stretches
        .iter()
        .map(|stretch| TabulatedFlight::new(&session, frame_tags(*stretch)))
        .collect::<Result<Vec<_>>>()?;
    drop(session);

    let flight = Flights(flights);
    let tags = flight
        .0
        .iter()
        .flat_map(|flight| flight.tags.clone())
        .collect::<Vec<_>>();
    let request = PedrRequest {
        name: PEDR_NAME,
        tags: &tags,
        datum: Datum::Iau2000,
        orbit: &|_| ORBIT,
        seed,
        errors: LaserErrors {
            altimeter: SceneErrors::demo().altimeter,
            shift: ProfileShift::none(),
        },
    };
    let terrain = Terrain::new(seed, &[], Relief::Gentle);
    let (file, kept) = write_pedr(&draft.folder("pedr")?, &flight, &terrain, &request, |_| {
        true
    })?;

    let mut truth = Truth::new(seed, &SceneErrors::demo());
    truth.files.push(file);
    let mut windows = Vec::new();
    for (number, stretch) in (1..).zip(&stretches) {
        let id = format!("stretch-{number}");
        let own: Vec<KeptShot> = kept
            .iter()
            .filter(|kept| stretch.contains(kept.truth.et))
            .copied()
            .collect();
        windows.push(window_around(&id, &own));
        truth.profiles.push(ProfileTruth::new(&id, PEDR_NAME, &own));
    }
    let id = images
        .first()
        .map_or_else(|| "along".to_owned(), |image| image.id.to_lowercase());
    let site = SiteFile {
        id: &id,
        description: "Flight along given kernels over invented terrain, synthetic PEDR".to_owned(),
        kernels: SiteKernels::Metakernel(metakernel.display().to_string()),
        pedr: vec![format!("../pedr/{PEDR_NAME}")],
        ties: None,
        windows,
        images,
    };
    put(
        &draft.folder("sites")?.join(format!("{id}.toml")),
        &site.to_toml(),
    )?;
    write_as_truth(&draft, &truth)?;
    draft.finish()?;
    let images = site.images.len();
    Ok(SceneSummary {
        images,
        ..SceneSummary::of(directory, &truth, 1)
    })
}

/// Stretches of true time in which both orbit and attitude are known.
fn stretches(session: &Session) -> Result<Vec<Interval>> {
    /// Requested times stay this far inside the ends of kernels, seconds.
    const ROUNDING_S: f64 = 0.01;
    let coverage = session.coverage()?;
    let attitude = areograph_base::time::Intervals::union_of(
        coverage
            .ck
            .as_slice()
            .iter()
            .map(|held| held.shifted(-usual_instrument().pointing.ck_bias_s)),
    );
    let flown: Vec<Interval> = coverage
        .spk
        .intersection(&attitude)
        .as_slice()
        .iter()
        .map(|held| held.padded(-ROUNDING_S))
        .filter(|held| held.duration_s() >= STRETCH_MIN_S)
        .collect();
    if flown.is_empty() {
        return Err(SceneError::NothingToFly {
            least_s: STRETCH_MIN_S,
        }
        .into());
    }
    Ok(flown)
}

/// Beams of one stretch, read from the kernels at every instant that its frames need.
struct TabulatedFlight {
    tags: Vec<Et>,
    first: Et,
    beams: Vec<Beam>,
}

impl TabulatedFlight {
    fn new(session: &Session, tags: Vec<Et>) -> Result<Self> {
        let first = tags.first().map_or(Et::from_seconds(0.0), |tag| {
            tag.plus(-usual_altimeter().clock_bias_s - FRAME_S / 2.0)
        });
        let count = tags.len() * 40 + 1;
        let beams = (0..count)
            .map(|index| {
                let et = first.plus(BEAM_STEP_S * index as f64);
                let attitude =
                    session.attitude(usual_instrument().pointing_bias().lookup(et), et, 0.0)?;
                let direction = attitude.inertial_to_bus.matrix().row(2).transpose();
                Ok(Beam {
                    spacecraft_m: session.state(et)?.position.xyz_m,
                    position_error_m: Vector3::zeros(),
                    direction,
                    steady_direction: direction,
                })
            })
            .collect::<Result<Vec<Beam>>>()?;
        Ok(Self { tags, first, beams })
    }

    /// The beam at `et`, which must be one of the tabulated instants.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "negative and non-finite numbers become 0, which is not the requested instant"
    )]
    fn beam(&self, et: Et) -> Option<Beam> {
        let steps = et.since(self.first) / BEAM_STEP_S;
        let index = steps.round();
        // A microsecond is 3 mm of flight; sums of binary fractions are a thousand times more accurate.
        let tabulated = (steps - index).abs() * BEAM_STEP_S < 1e-6 && index >= 0.0;
        self.beams
            .get(index as usize)
            .filter(|_| tabulated)
            .copied()
    }
}

/// All stretches.
struct Flights(Vec<TabulatedFlight>);

impl Flight for Flights {
    fn beam(&self, et: Et) -> Result<Beam> {
        let error = SceneError::NotTabulated { et_s: et.seconds() };
        Ok(self
            .0
            .iter()
            .find_map(|flight| flight.beam(et))
            .ok_or(error)?)
    }
}

/// A window around shots anywhere on the body.
fn window_around(id: &str, kept: &[KeptShot]) -> Window {
    let mut longitudes_deg = Vec::with_capacity(kept.len());
    let mut latitude_deg = [90.0_f64, -90.0];
    for shot in kept {
        let ground = Spherical::from_xyz_m(&shot.truth.ground_m);
        longitudes_deg.push(ground.longitude_rad / RADIANS_PER_DEGREE);
        let latitude = ground.latitude.0 / RADIANS_PER_DEGREE;
        latitude_deg = [latitude_deg[0].min(latitude), latitude_deg[1].max(latitude)];
    }
    let [south, north] = latitude_deg;
    Window {
        id: id.to_owned(),
        longitude_deg: longitudes_around(longitudes_deg),
        latitude_deg: [
            hundredths(south - WINDOW_MARGIN_DEG).max(-90.0),
            hundredths(north + WINDOW_MARGIN_DEG).min(90.0),
        ],
    }
}

/// The narrowest `[west, east]`, 0 to 360, that contains all longitudes; west may exceed east.
fn longitudes_around(mut longitudes_deg: Vec<f64>) -> [f64; 2] {
    longitudes_deg.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (longitudes_deg.first(), longitudes_deg.last()) else {
        return [0.0, 360.0];
    };
    // The widest gap between neighbours lies outside; the one over 0° closes the circle.
    let mut outside = (first + 360.0 - last, *last, *first);
    for pair in longitudes_deg.windows(2) {
        if pair[1] - pair[0] > outside.0 {
            outside = (pair[1] - pair[0], pair[0], pair[1]);
        }
    }
    let (gap_deg, east, west) = outside;
    if gap_deg < 1.0 {
        return [0.0, 360.0];
    }
    let margin = WINDOW_MARGIN_DEG;
    [west - margin, east + margin].map(|edge| hundredths(edge).rem_euclid(360.0))
}

fn hundredths(degrees: f64) -> f64 {
    (degrees * 100.0).round() / 100.0
}

/// An image of the site file, named after the product in its label.
fn site_image(label: &Path) -> Result<SiteImage> {
    let label = absolute(label)?;
    let product = read_label(&label, built_in_instruments())?.product_id;
    let stem = label
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let id = product
        .unwrap_or(stem)
        .replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    Ok(SiteImage {
        id,
        label: label.display().to_string(),
        lines_delivered: None,
        pixels: None,
    })
}

fn absolute(path: &Path) -> Result<PathBuf> {
    fs::canonicalize(path)
        .map_err(IoError::on("find"))
        .in_file(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longitudes_are_enclosed_the_short_way_round() {
        let cases = [
            (vec![10.0, 12.0, 11.0], [9.9, 12.1]),
            (vec![359.0, 1.0, 0.5], [358.9, 1.1]),
            (vec![200.0, 20.0, 100.0], [19.9, 200.1]),
            (vec![], [0.0, 360.0]),
        ];
        for (longitudes, expected) in cases {
            let found = longitudes_around(longitudes.clone());
            let off = (found[0] - expected[0])
                .abs()
                .max((found[1] - expected[1]).abs());
            assert!(off < 1e-9, "{longitudes:?}: {found:?}"); // degrees
        }
        let all_round = (0..720).map(|half| f64::from(half) / 2.0).collect();
        assert!((longitudes_around(all_round)[1] - 360.0).abs() < 1e-9);
    }
}
