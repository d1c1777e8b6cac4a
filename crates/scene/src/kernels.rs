//! Kernels of the synthetic mission: text ones as shipped, binary ones by CSPICE's own writers.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    arc::{Arc, KERNEL_MARGIN_S},
    files::put,
    further_passes::FurtherPass,
    orbit::Orbit,
    plan::PlannedImage,
    sun::mars_state_from_sun,
    versions::{FAMILIES, Version},
};
use areograph_base::{
    constants::{NAIF_MARS, NAIF_SOLAR_SYSTEM_BARYCENTRE, NAIF_SUN, SPACECRAFT},
    error::{IoError, Locate, Result},
    frames::Position,
    time::{Et, Interval},
    units::SECONDS_PER_DAY,
};
use areograph_config::usual_instrument;
use areograph_geom::attitude::make_continuous;
use areograph_spice::{CkSegment, KernelSet, Session, SpkSegment, State, write_ck, write_spk};

/// NAIF id of the barycentre of Mars and its moons.
const NAIF_MARS_BARYCENTRE: i32 = 4;
/// Seconds between states of an arc: degree 7 over four states leaves nanometres.
const SPK_STEP_S: f64 = 60.0;
/// Degree of Hermite interpolation.
const SPK_DEGREE: i32 = 7;
/// Name of the kernel with the frames of the wide-angle cameras.
const WIDE_ANGLE_NAME: &str = "moc_wa.ti";
/// Name of the kernel with Mars and the Sun.
const PLANETS_NAME: &str = "mars_sun_scene.bsp";
/// The first words of every comment area.
const SYNTHETIC: &str = "SYNTHETIC: written by areograph scene, not from mission data.";

/// Text kernels by file name, in load order of the first four.
const TEXT_KERNELS: [(&str, &str); 7] = [
    (
        "leapseconds.tls",
        include_str!("../../../kernels.example/leapseconds.tls"),
    ),
    (
        "mgs_clock.tsc",
        include_str!("../../../kernels.example/mgs_clock.tsc"),
    ),
    (
        "mars_iau2000.tpc",
        include_str!("../../../kernels.example/mars_iau2000.tpc"),
    ),
    ("moc.ti", include_str!("../../../kernels.example/moc.ti")),
    (
        "mars_iau1991.tpc",
        include_str!("../../../kernels.example/mars_iau1991.tpc"),
    ),
    (
        "mars_iau1994.tpc",
        include_str!("../../../kernels.example/mars_iau1994.tpc"),
    ),
    (
        WIDE_ANGLE_NAME,
        include_str!("../../../kernels.example/moc_wa.ti"),
    ),
];
/// Number of them that a metakernel loads; the other Mars models would replace the first.
const LOADED: usize = 4;

/// Number of them that an archive's metakernel loads: an archive has no images.
const ARCHIVE_LOADED: usize = 3;
/// Its name.
pub(super) const ARCHIVE_METAKERNEL: &str = "archive.tm";
/// Margin of an archive's orbit beyond its files, seconds.
const ARCHIVE_MARGIN_S: f64 = 60.0;

/// Part of a mission that has kernels of its own, as names of files contain it: here, all of it.
pub(super) const WHOLE: &str = "scene";

/// File name of the orbit of one family.
pub(super) fn spk_name(family: &str) -> String {
    spk_name_of(family, WHOLE)
}

/// File name of the orbit of one family in a part of the mission.
fn spk_name_of(family: &str, part: &str) -> String {
    format!("mgs_{family}_{part}.bsp")
}

/// File name of the attitude in a part of the mission.
fn ck_name_of(part: &str) -> String {
    format!("mgs_sc_{part}.bc")
}

/// Writes text kernels and metakernels into `folder`.
pub(super) fn write_text_kernels(folder: &Path) -> Result<()> {
    write_texts(folder)?;
    write_metakernels(folder, &[WHOLE])
}

/// Writes text kernels into `folder`.
pub(super) fn write_texts(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)
        .map_err(IoError::on("create"))
        .in_file(folder)?;
    for (name, text) in TEXT_KERNELS {
        put(&folder.join(name), text)?;
    }
    Ok(())
}

/// Writes metakernels that load the kernels of these parts of the mission.
pub(super) fn write_metakernels(folder: &Path, parts: &[&str]) -> Result<()> {
    for family in FAMILIES {
        let mut names: Vec<String> = TEXT_KERNELS[..LOADED]
            .iter()
            .map(|(name, _)| (*name).to_owned())
            .collect();
        names.push(PLANETS_NAME.to_owned());
        names.extend(parts.iter().map(|part| spk_name_of(family, part)));
        names.extend(parts.iter().map(|part| ck_name_of(part)));
        put(
            &folder.join(format!("{family}.tm")),
            &metakernel(family, &names),
        )?;
        names.push(WIDE_ANGLE_NAME.to_owned());
        put(
            &folder.join(wide_angle_metakernel(family)),
            &metakernel(family, &names),
        )?;
    }
    Ok(())
}

/// Name of the metakernel that also loads the wide-angle cameras.
pub(super) fn wide_angle_metakernel(family: &str) -> String {
    format!("{family}_wa.tm")
}

fn metakernel(family: &str, names: &[String]) -> String {
    let list: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    format!(
        "KPL/MK\n\nKernels of a synthetic mission with the orbit of family {family}; written by\n\
         `areograph scene`. Paths are relative to the folder of this file.\n\n\\begindata\n\n\
         KERNELS_TO_LOAD = ( {} )\n\n\\begintext\n",
        list.join("\n                    ")
    )
}

/// A session with the clock and the leap seconds of `folder`.
pub(super) fn clock_session(folder: &Path) -> Result<Session> {
    let files: Vec<PathBuf> = TEXT_KERNELS[..2]
        .iter()
        .map(|(name, _)| folder.join(name))
        .collect();
    Session::open(&KernelSet::from_files(&files)?)
}

/// Start of the first line of a planned image, by its clock string.
pub(super) fn image_start(session: &Session, image: &PlannedImage) -> Result<Et> {
    session.sclk_to_et(image.sclk_start)
}

/// A clock string as in labels: seconds and ticks, without partition and leading zeros.
pub(super) fn clock_reading(clock: &str) -> String {
    let without_partition = clock.trim().rsplit('/').next().unwrap_or_default();
    let parts = without_partition.split(['.', ':', '-']);
    let parts: Vec<&str> = parts
        .map(|part| match part.trim_start_matches('0') {
            "" => "0",
            digits => digits,
        })
        .collect();
    parts.join(":")
}

/// Attitude samples of an arc in the columns of a C-kernel.
struct AttitudeColumns {
    instants: Vec<Et>,
    quaternions: Vec<[f64; 4]>,
    rates_rad_s: Vec<[f64; 3]>,
}

impl AttitudeColumns {
    fn of(arc: &Arc) -> Self {
        let samples = arc.attitude.samples();
        let mut quaternions: Vec<[f64; 4]> = samples
            .iter()
            .map(|sample| {
                let q = sample.j2000_to_bus;
                [q.w, q.i, q.j, q.k]
            })
            .collect();
        make_continuous(&mut quaternions);
        Self {
            instants: samples
                .iter()
                .map(|sample| {
                    usual_instrument()
                        .pointing_bias()
                        .lookup(sample.et)
                        .kernel_time()
                })
                .collect(),
            quaternions,
            rates_rad_s: samples
                .iter()
                .map(|sample| sample.rate_rad_s.into())
                .collect(),
        }
    }
}

/// Writes the attitude of arcs of a part of the mission: the attitude of true time `t` is stored at `t − 1.15 s`.
pub(super) fn write_attitude(
    folder: &Path,
    part: &str,
    session: &Session,
    arcs: &[&Arc<'_>],
) -> Result<()> {
    let columns: Vec<AttitudeColumns> = arcs.iter().map(|arc| AttitudeColumns::of(arc)).collect();
    let segments: Vec<CkSegment> = arcs
        .iter()
        .zip(&columns)
        .map(|(arc, columns)| CkSegment {
            name: arc.image.id,
            instants: &columns.instants,
            quaternions: &columns.quaternions,
            angular_velocities_rad_s: &columns.rates_rad_s,
            interval_starts: &columns.instants[..1],
        })
        .collect();
    let comment = format!(
        "{SYNTHETIC}\nTime tags contain the error of the mission's kernels: the attitude of time t \
         is stored at t - 1.15 s."
    );
    write_ck(&folder.join(ck_name_of(part)), session, &segments, &comment)
}

/// An orbit with its rival versions over some time.
pub(super) struct Flightpath<'a> {
    name: String,
    orbit: &'a Orbit,
    /// What kernels cover.
    span: Interval,
    versions: [Version; 3],
}

impl<'a> Flightpath<'a> {
    /// The day of an image.
    pub(super) fn of_arc(arc: &'a Arc<'a>, seed: u64) -> Self {
        Self {
            name: arc.image.id.to_owned(),
            orbit: &arc.orbit,
            span: arc.kernel_span(),
            versions: versions(arc, seed),
        }
    }

    /// A further pass.
    pub(super) fn of_pass(pass: &'a FurtherPass, seed: u64) -> Self {
        Self {
            name: pass.file(),
            orbit: pass.orbit(),
            span: pass.frames().padded(KERNEL_MARGIN_S),
            versions: pass.versions(seed),
        }
    }
}

/// Writes one SPK per family and one for Mars and the Sun, of paths in order of time.
pub(super) fn write_orbits(folder: &Path, part: &str, paths: &[&Flightpath<'_>]) -> Result<()> {
    for (index, family) in FAMILIES.iter().enumerate() {
        let tables: Vec<(Vec<Et>, Vec<State>)> = paths
            .iter()
            .map(|path| {
                let version = &path.versions[index];
                let epochs = epochs(path.span, SPK_STEP_S);
                let states = epochs
                    .iter()
                    .map(|et| kernel_state(&version.state(path.orbit, *et)))
                    .collect();
                (epochs, states)
            })
            .collect();
        let segments: Vec<SpkSegment> = paths
            .iter()
            .zip(&tables)
            .map(|(path, (epochs, states))| SpkSegment {
                target: SPACECRAFT.naif,
                centre: NAIF_MARS_BARYCENTRE,
                name: &path.name,
                degree: SPK_DEGREE,
                epochs,
                states,
            })
            .collect();
        let comment =
            format!("{SYNTHETIC}\nOrbit of family {family}; family gsfc is the true orbit.");
        write_spk(&folder.join(spk_name_of(family, part)), &segments, &comment)?;
    }
    Ok(())
}

/// Writes Mars and the Sun from the first path to the last.
pub(super) fn write_planets_of(folder: &Path, paths: &[Flightpath<'_>]) -> Result<()> {
    let earlier = |a: &Et, b: &Et| a.seconds().total_cmp(&b.seconds());
    let start = paths.iter().map(|path| path.span.start).min_by(earlier);
    let stop = paths.iter().map(|path| path.span.stop).max_by(earlier);
    match start.zip(stop) {
        Some((start, stop)) => {
            write_planets(folder, Interval::new(start, stop).padded(-KERNEL_MARGIN_S))
        }
        None => Ok(()),
    }
}

/// The three versions of an arc's orbit, in the order of [`FAMILIES`].
pub(super) fn versions(arc: &Arc, seed: u64) -> [Version; 3] {
    let middle = arc.exposed.start.plus(arc.exposed.duration_s() / 2.0);
    FAMILIES.map(|family| Version::new(family, arc.image.id, seed, middle))
}

/// Mars around the Sun; the Sun is at the solar system barycentre, and Mars at its own, since no moons are modelled.
fn write_planets(folder: &Path, span: Interval) -> Result<()> {
    let days = |days: f64| days * SECONDS_PER_DAY;
    let epochs = epochs(span.padded(days(4.0)), days(1.0));
    let at_rest = State {
        position: Position::new(nalgebra::Vector3::zeros()),
        velocity_m_s: nalgebra::Vector3::zeros(),
    };
    let resting = vec![at_rest; epochs.len()];
    let moving: Vec<State> = epochs
        .iter()
        .map(|et| kernel_state(&mars_state_from_sun(*et)))
        .collect();
    let segment = |target, centre, name, states| SpkSegment {
        target,
        centre,
        name,
        degree: SPK_DEGREE,
        epochs: &epochs,
        states,
    };
    let segments = [
        segment(
            NAIF_SUN,
            NAIF_SOLAR_SYSTEM_BARYCENTRE,
            "Sun at the barycentre",
            &resting,
        ),
        segment(
            NAIF_MARS_BARYCENTRE,
            NAIF_SOLAR_SYSTEM_BARYCENTRE,
            "Mars, Standish elements",
            &moving,
        ),
        segment(
            NAIF_MARS,
            NAIF_MARS_BARYCENTRE,
            "Mars without moons",
            &resting,
        ),
    ];
    let comment = format!(
        "{SYNTHETIC}\nMars from Standish's approximate elements; the Sun is fixed at the solar system barycentre."
    );
    write_spk(&folder.join(PLANETS_NAME), &segments, &comment)
}

/// Writes the kernels of an archive: text ones, the orbit over each of `spans`, Mars and the Sun, a metakernel.
pub(super) fn write_archive_kernels(
    folder: &Path,
    orbit: &Orbit,
    spans: &[Interval],
) -> Result<()> {
    let texts = &TEXT_KERNELS[..ARCHIVE_LOADED];
    for (name, text) in texts {
        put(&folder.join(name), text)?;
    }
    let spk = spk_name("archive");
    let names = texts.iter().map(|(name, _)| (*name).to_owned());
    let names: Vec<String> = names
        .chain([PLANETS_NAME.to_owned(), spk.clone()])
        .collect();
    let metakernel = metakernel("archive", &names);
    put(&folder.join(ARCHIVE_METAKERNEL), &metakernel)?;
    let tables: Vec<(Vec<Et>, Vec<State>)> = spans
        .iter()
        .map(|span| {
            let epochs = epochs(span.padded(ARCHIVE_MARGIN_S), SPK_STEP_S);
            let states = epochs.iter().map(|et| kernel_state(&orbit.state(*et)));
            let states = states.collect();
            (epochs, states)
        })
        .collect();
    let segments: Vec<SpkSegment> = tables
        .iter()
        .map(|(epochs, states)| SpkSegment {
            target: SPACECRAFT.naif,
            centre: NAIF_MARS_BARYCENTRE,
            name: "archive",
            degree: SPK_DEGREE,
            epochs,
            states,
        })
        .collect();
    let comment = format!("{SYNTHETIC}\nThe orbit of an invented archive of PEDR files.");
    write_spk(&folder.join(spk), &segments, &comment)?;
    match (spans.first(), spans.last()) {
        (Some(first), Some(last)) => write_planets(folder, Interval::new(first.start, last.stop)),
        _ => Ok(()),
    }
}

fn kernel_state(state: &super::orbit::OrbitState) -> State {
    State {
        position: Position::new(state.position_m),
        velocity_m_s: state.velocity_m_s,
    }
}

/// Instants `step_s` apart that reach from the start of `span` to its end or just beyond.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a day has 1,440 states"
)]
fn epochs(span: Interval, step_s: f64) -> Vec<Et> {
    let count = (span.duration_s() / step_s).ceil() as usize + 1;
    (0..count)
        .map(|index| span.start.plus(step_s * index as f64))
        .collect()
}
