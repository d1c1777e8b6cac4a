//! CSPICE's own writers of binary kernels, with the same checks.

use std::{ffi::c_int, path::Path};

use cspice_sys as naif;

use super::{Called, Cspice, StateKm, c_path, c_text, length};

/// Content of a type 3 segment of a C-kernel; the columns except the last have equal length.
pub(crate) struct CkColumns<'a> {
    /// Name of the segment.
    pub(crate) name: &'a str,
    /// Encoded clock, increasing.
    pub(crate) ticks: &'a [f64],
    /// Quaternions from J2000, scalar first.
    pub(crate) quaternions: &'a [[f64; 4]],
    /// Angular velocities in J2000, rad/s.
    pub(crate) rates_rad_s: &'a [[f64; 3]],
    /// Encoded clock at which an interpolation interval begins.
    pub(crate) starts: &'a [f64],
}

impl Cspice {
    /// `spkopn_c`: a new SPK with room for `comment_size` comment characters.
    pub(crate) fn create_spk(&self, path: &Path, comment_size: usize) -> Called<c_int> {
        let path = c_path(path)?;
        let mut handle = 0;
        // SAFETY: the lock is held; names are zero-ended.
        unsafe {
            naif::spkopn_c(
                path.as_ptr().cast_mut(),
                c"areograph".as_ptr().cast_mut(),
                length(comment_size),
                &raw mut handle,
            );
        }
        self.check("spkopn_c").map(|()| handle)
    }

    /// `ckopn_c`: a new CK with room for `comment_size` comment characters.
    pub(crate) fn create_ck(&self, path: &Path, comment_size: usize) -> Called<c_int> {
        let path = c_path(path)?;
        let mut handle = 0;
        // SAFETY: the lock is held; names are zero-ended.
        unsafe {
            naif::ckopn_c(
                path.as_ptr().cast_mut(),
                c"areograph".as_ptr().cast_mut(),
                length(comment_size),
                &raw mut handle,
            );
        }
        self.check("ckopn_c").map(|()| handle)
    }

    /// `dafac_c`: appends comment lines.
    pub(crate) fn add_comments(&self, handle: c_int, lines: &[&str]) -> Called<()> {
        if lines.is_empty() {
            return Ok(());
        }
        let width = lines.iter().map(|line| line.len()).max().unwrap_or(0) + 1;
        let mut buffer = vec![0_u8; width * lines.len()];
        for (slot, line) in buffer.chunks_exact_mut(width).zip(lines) {
            slot[..line.len()].copy_from_slice(line.as_bytes());
        }
        // SAFETY: the lock is held; `buffer` holds `lines.len()` zero-ended strings `width` apart.
        unsafe {
            naif::dafac_c(
                handle,
                length(lines.len()),
                length(width),
                buffer.as_ptr().cast(),
            );
        }
        self.check("dafac_c")
    }

    /// `spkw13_c`: one Hermite segment in J2000, kilometres; `epochs_s` and `states_km` pair up.
    pub(crate) fn write_spk_13(
        &self,
        handle: c_int,
        (target, centre): (i32, i32),
        name: &str,
        degree: i32,
        epochs_s: &[f64],
        states_km: &[StateKm],
    ) -> Called<()> {
        let name = c_text("a segment name", name)?;
        let (Some(first), Some(last)) = (epochs_s.first(), epochs_s.last()) else {
            return Ok(());
        };
        let count = epochs_s.len().min(states_km.len());
        // SAFETY: the lock is held; both arrays hold `count` entries and are only read.
        unsafe {
            naif::spkw13_c(
                handle,
                target,
                centre,
                c"J2000".as_ptr().cast_mut(),
                *first,
                *last,
                name.as_ptr().cast_mut(),
                degree,
                length(count),
                states_km.as_ptr().cast_mut(),
                epochs_s.as_ptr().cast_mut(),
            );
        }
        self.check("spkw13_c")
    }

    /// `ckw03_c`: one segment of `object` in J2000 with rates.
    pub(crate) fn write_ck_3(&self, handle: c_int, object: i32, columns: &CkColumns) -> Called<()> {
        let name = c_text("a segment name", columns.name)?;
        let (Some(first), Some(last)) = (columns.ticks.first(), columns.ticks.last()) else {
            return Ok(());
        };
        let count = columns
            .ticks
            .len()
            .min(columns.quaternions.len())
            .min(columns.rates_rad_s.len());
        // SAFETY: the lock is held; the arrays hold `count` and `starts.len()` entries, only read.
        unsafe {
            naif::ckw03_c(
                handle,
                *first,
                *last,
                object,
                c"J2000".as_ptr().cast_mut(),
                1,
                name.as_ptr().cast_mut(),
                length(count),
                columns.ticks.as_ptr().cast_mut(),
                columns.quaternions.as_ptr().cast_mut(),
                columns.rates_rad_s.as_ptr().cast_mut(),
                length(columns.starts.len()),
                columns.starts.as_ptr().cast_mut(),
            );
        }
        self.check("ckw03_c")
    }

    /// `dafcls_c`: closes a kernel that was written.
    pub(crate) fn close(&self, handle: c_int) -> Called<()> {
        // SAFETY: the lock is held; an unknown handle is ignored by CSPICE.
        unsafe { naif::dafcls_c(handle) };
        self.check("dafcls_c")
    }
}
