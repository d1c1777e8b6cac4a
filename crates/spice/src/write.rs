//! Kernels of a synthetic mission and of adjusted orientations, written with CSPICE's own writers.

use std::{
    ffi::c_int,
    fs::{self, OpenOptions},
    io::{self, Write as _},
    path::Path,
};

use super::{
    daf,
    error::SpiceError,
    ffi::{CkColumns, Cspice, StateKm},
    session::Session,
    state::State,
};
use areograph_base::{
    error::{IoError, Locate, Result},
    time::Et,
    units::METRES_PER_KM,
};

/// Longest segment name that a DAF holds.
const SEGMENT_NAME_MAX: usize = 40;

/// More than the part of CSPICE's last buffer that may remain unwritten on a full disk.
const PROBE_BYTES: usize = 1 << 16;

/// Hermite-interpolated states (SPK type 13), J2000.
#[derive(Debug, Clone, Copy)]
pub struct SpkSegment<'a> {
    /// NAIF id of the body.
    pub target: i32,
    /// NAIF id of the body to which states are relative.
    pub centre: i32,
    /// Name of the segment, at most 40 characters.
    pub name: &'a str,
    /// Degree of the interpolating polynomial, odd, at most 27.
    pub degree: i32,
    /// Instants, increasing.
    pub epochs: &'a [Et],
    /// One state per instant.
    pub states: &'a [State],
}

/// Linearly interpolated attitudes with rates (CK type 3) of the bus of the session's spacecraft, base frame J2000.
#[derive(Debug, Clone, Copy)]
pub struct CkSegment<'a> {
    /// Name of the segment, at most 40 characters.
    pub name: &'a str,
    /// Instants in the time of the kernel, increasing.
    pub instants: &'a [Et],
    /// Quaternions of J2000 to bus, scalar first, SPICE's convention, one per instant.
    pub quaternions: &'a [[f64; 4]],
    /// Angular velocities, J2000 components, radians per second, one per instant.
    pub angular_velocities_rad_s: &'a [[f64; 3]],
    /// Instants at which an interpolation interval begins; the first is the first instant.
    pub interval_starts: &'a [Et],
}

/// Attitudes with instants encoded by the spacecraft clock; writing them needs no kernel.
#[derive(Debug, Clone, Copy)]
pub struct EncodedCkSegment<'a> {
    /// NAIF id of the bus.
    pub bus: i32,
    /// Name of the segment, at most 40 characters.
    pub name: &'a str,
    /// Encoded clock of every attitude, increasing.
    pub ticks: &'a [f64],
    /// As in [`CkSegment`].
    pub quaternions: &'a [[f64; 4]],
    /// As in [`CkSegment`].
    pub angular_velocities_rad_s: &'a [[f64; 3]],
    /// Encoded clock at which an interpolation interval begins; the first is the first of `ticks`.
    pub interval_starts: &'a [f64],
}

/// Writes a new SPK; `comment` goes into its comment area.
///
/// # Errors
/// [`SpiceError::Segment`] for columns that do not match, [`SpiceError::Spice`] from CSPICE (an existing file is never
/// overwritten), [`SpiceError::SessionOpen`] when this thread has a session, [`IoError`] when the kernel cannot be
/// written. An incomplete kernel is removed.
pub fn write_spk(path: &Path, segments: &[SpkSegment], comment: &str) -> Result<()> {
    for segment in segments {
        check_lengths(segment.name, segment.epochs, &[segment.states.len()])?;
    }
    let cspice = Cspice::lock()?;
    let lines = comment_lines(comment);
    let create = || Ok(cspice.create_spk(path, comment_size(&lines))?);
    fill(&cspice, path, create, |handle| {
        cspice.add_comments(handle, &lines)?;
        for segment in segments {
            let epochs_s: Vec<f64> = segment.epochs.iter().map(|epoch| epoch.seconds()).collect();
            let states_km: Vec<StateKm> =
                segment.states.iter().map(|state| state.to_km()).collect();
            cspice.write_spk_13(
                handle,
                (segment.target, segment.centre),
                segment.name,
                segment.degree,
                &epochs_s,
                &states_km,
            )?;
        }
        Ok(())
    })
}

/// Writes a new CK; `session` must have the leap seconds and the clock loaded.
///
/// # Errors
/// As [`write_spk`].
pub fn write_ck(
    path: &Path,
    session: &Session,
    segments: &[CkSegment],
    comment: &str,
) -> Result<()> {
    let ticks = |instants: &[Et]| -> Result<Vec<f64>> {
        let encode = |instant: &Et| session.et_to_ticks(*instant);
        instants.iter().map(encode).collect()
    };
    let mut encoded = Vec::new();
    for segment in segments {
        encoded.push((ticks(segment.instants)?, ticks(segment.interval_starts)?));
    }
    let encoded = segments.iter().zip(&encoded);
    let encoded = encoded.map(|(segment, (ticks, starts))| EncodedCkSegment {
        bus: session.spacecraft().bus,
        name: segment.name,
        ticks,
        quaternions: segment.quaternions,
        angular_velocities_rad_s: segment.angular_velocities_rad_s,
        interval_starts: starts,
    });
    fill_ck(
        session.cspice(),
        path,
        &encoded.collect::<Vec<_>>(),
        comment,
    )
}

/// Writes a new CK with encoded instants.
///
/// # Errors
/// As [`write_spk`].
pub fn write_encoded_ck(path: &Path, segments: &[EncodedCkSegment], comment: &str) -> Result<()> {
    fill_ck(&Cspice::lock()?, path, segments, comment)
}

fn fill_ck(
    cspice: &Cspice,
    path: &Path,
    segments: &[EncodedCkSegment],
    comment: &str,
) -> Result<()> {
    for segment in segments {
        let columns = [
            segment.quaternions.len(),
            segment.angular_velocities_rad_s.len(),
        ];
        check_lengths(segment.name, segment.ticks, &columns)?;
    }
    let lines = comment_lines(comment);
    let create = || Ok(cspice.create_ck(path, comment_size(&lines))?);
    fill(cspice, path, create, |handle| {
        cspice.add_comments(handle, &lines)?;
        for segment in segments {
            let columns = CkColumns {
                name: segment.name,
                ticks: segment.ticks,
                quaternions: segment.quaternions,
                rates_rad_s: segment.angular_velocities_rad_s,
                starts: segment.interval_starts,
            };
            cspice.write_ck_3(handle, segment.bus, &columns)?;
        }
        Ok(())
    })
}

/// Creates the kernel at `path`, writes into it, closes it, and checks that it is complete.
fn fill(
    cspice: &Cspice,
    path: &Path,
    create: impl FnOnce() -> Result<c_int>,
    write: impl FnOnce(c_int) -> Result<()>,
) -> Result<()> {
    let existed = path.exists();
    let written = create().and_then(|handle| {
        let written = write(handle);
        let closed = cspice.close(handle);
        written.and(closed.map_err(Into::into))
    });
    let complete = written.and_then(|()| complete_record(path).in_file(path));
    let whole = complete.and_then(|()| daf::segments(path)).map(|_| ());
    if existed || whole.is_ok() {
        return whole.in_file(path);
    }
    let refused = refusal(path);
    // The remainder is not a kernel; when even its removal fails, the first error is reported.
    let _ = fs::remove_file(path);
    refused
        .map_or(whole, |refused| Err(refused.into()))
        .in_file(path)
}

/// Completes the last record of a new kernel. A kernel whose segments fill their summary records, as 25 do, ends in an empty record of
/// names, of which CSPICE writes 1,000 of 1,024 bytes.
fn complete_record(path: &Path) -> std::result::Result<(), IoError> {
    let complete = || -> io::Result<()> {
        let file = OpenOptions::new().write(true).open(path)?;
        let bytes = file.metadata()?.len();
        file.set_len(bytes.next_multiple_of(daf::RECORD_SIZE as u64))
    };
    complete().map_err(IoError::on("write"))
}

/// Reason why the system cannot write at `path`: CSPICE's messages do not state it.
fn refusal(path: &Path) -> Option<IoError> {
    let probe = || -> io::Result<()> {
        let mut file = OpenOptions::new().append(true).create(true).open(path)?;
        file.write_all(&vec![0; PROBE_BYTES])?;
        file.sync_all()
    };
    probe().err().map(IoError::on("write"))
}

impl State {
    /// Kilometres and kilometres per second.
    fn to_km(self) -> StateKm {
        let (position, velocity) = (self.position.xyz_m, self.velocity_m_s);
        [
            position.x, position.y, position.z, velocity.x, velocity.y, velocity.z,
        ]
        .map(|value| value / METRES_PER_KM)
    }
}

fn check_lengths<T>(name: &str, instants: &[T], columns: &[usize]) -> Result<()> {
    let problem = if name.is_empty() || name.len() > SEGMENT_NAME_MAX {
        format!("its name must have 1 to {SEGMENT_NAME_MAX} characters")
    } else if instants.is_empty() {
        "it contains no instants".to_owned()
    } else if let Some(count) = columns.iter().find(|count| **count != instants.len()) {
        format!("column of {count} values for {} instants", instants.len())
    } else {
        return Ok(());
    };
    Err(SpiceError::Segment {
        segment: name.to_owned(),
        problem,
    }
    .into())
}

/// Lines of a comment; an empty one becomes a blank, since CSPICE accepts no empty strings.
fn comment_lines(comment: &str) -> Vec<&str> {
    let lines = comment
        .lines()
        .map(|line| if line.is_empty() { " " } else { line });
    lines.collect()
}

/// Characters that the comment area needs, line ends included.
fn comment_size(lines: &[&str]) -> usize {
    lines.iter().map(|line| line.len() + 1).sum()
}
