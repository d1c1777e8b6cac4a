//! The only calls into CSPICE: each checks CSPICE's error state and turns it into a [`SpiceError`].
//!
//! CSPICE keeps global state and is not thread safe. Every call is a method of [`Cspice`], and a
//! `Cspice` exists only while the process-wide lock is held, so no call can happen without it.

#![allow(unsafe_code, reason = "CSPICE is a C library and is called only here")]
#![allow(clippy::unused_self, reason = "`self` proves that the lock is held")]

use std::{
    cell::Cell,
    ffi::{CStr, CString, c_int, c_void},
    path::Path,
    sync::{Mutex, MutexGuard, PoisonError},
};

use cspice_sys as naif;

use super::error::SpiceError;

mod write;

pub(super) use write::CkColumns;

/// Result of a CSPICE call.
pub(super) type Called<T> = Result<T, SpiceError>;

/// Longest file name that CSPICE accepts (`FILSIZ` in its kernel loader).
pub const PATH_LENGTH_MAX: usize = 255;
/// Lengths of CSPICE's short and long error messages, with the closing zero.
const SHORT_MESSAGE_SIZE: usize = 26;
const LONG_MESSAGE_SIZE: usize = 1_841;
/// Room for any time or clock string that CSPICE writes.
const TIME_TEXT_SIZE: usize = 64;
/// Room for a text of the kernel pool, whose values have up to 80 characters.
const POOL_TEXT_SIZE: usize = 81;
/// Doubles in front of a cell's data (`SPICE_CELL_CTRLSZ`).
const CELL_CONTROL_SIZE: usize = naif::SPICE_CELL_CTRLSZ as usize;
/// Sizes of the coverage window that are tried one after the other, in end points.
const WINDOW_SIZES: [usize; 3] = [20_000, 400_000, 8_000_000];

static CSPICE: Mutex<()> = Mutex::new(());
thread_local! {
    static HELD_HERE: Cell<bool> = const { Cell::new(false) };
}

/// The right to call CSPICE: holds the process-wide lock, and unloads every kernel when dropped.
///
/// It is not `Send`, like the guard of the lock.
#[derive(Debug)]
pub(super) struct Cspice {
    _lock: MutexGuard<'static, ()>,
}

/// A state in CSPICE's units: kilometres and kilometres per second.
pub(super) type StateKm = [f64; 6];
/// A 3 by 3 matrix by rows.
pub(super) type Rows = [[f64; 3]; 3];

/// Attitude from a C-kernel.
pub(super) struct Pointing {
    /// From the reference frame to the bus, by rows.
    pub(super) matrix: Rows,
    /// Angular velocity of the bus in the reference frame, rad/s.
    pub(super) angular_velocity_rad_s: [f64; 3],
    /// Encoded clock for which the attitude holds.
    pub(super) ticks: f64,
}

impl Cspice {
    /// Waits for the lock and makes CSPICE return on errors without printing.
    pub(super) fn lock() -> Called<Self> {
        if HELD_HERE.get() {
            return Err(SpiceError::SessionOpen);
        }
        // A thread that panicked inside a session unloaded its kernels while unwinding.
        let lock = CSPICE.lock().unwrap_or_else(PoisonError::into_inner);
        HELD_HERE.set(true);
        let cspice = Self { _lock: lock };
        let (set, returning, nothing) = (c"SET".as_ptr(), c"RETURN", c"NONE");
        // SAFETY: the lock is held; the strings are static and zero-ended, "SET" only reads them.
        unsafe {
            naif::reset_c();
            naif::erract_c(set.cast_mut(), 0, returning.as_ptr().cast_mut());
            naif::errprt_c(set.cast_mut(), 0, nothing.as_ptr().cast_mut());
        }
        cspice.check("erract_c")?;
        Ok(cspice)
    }

    /// Turns CSPICE's error state, if set, into an error and clears it.
    fn check(&self, call: &'static str) -> Called<()> {
        // SAFETY: the lock is held.
        if unsafe { naif::failed_c() } == 0 {
            return Ok(());
        }
        let message = |option: &CStr, size: usize| {
            let mut text = vec![0_u8; size];
            // SAFETY: the lock is held; `text` has the `size` bytes that are announced.
            unsafe {
                naif::getmsg_c(
                    option.as_ptr().cast_mut(),
                    length(size),
                    text.as_mut_ptr().cast(),
                );
            }
            text_of(&text)
        };
        let error = SpiceError::Spice {
            call: call.to_owned(),
            short: message(c"SHORT", SHORT_MESSAGE_SIZE),
            long: message(c"LONG", LONG_MESSAGE_SIZE),
        };
        // SAFETY: the lock is held.
        unsafe { naif::reset_c() };
        Err(error)
    }

    /// `tkvrsn_c`: the version of the toolkit, for example `CSPICE_N0067`.
    pub(super) fn version(&self) -> Called<String> {
        // SAFETY: the lock is held; the argument is static and only read, the answer a static, zero-ended text.
        let version = unsafe {
            let text = naif::tkvrsn_c(c"TOOLKIT".as_ptr().cast_mut());
            (!text.is_null()).then(|| CStr::from_ptr(text).to_string_lossy().into_owned())
        };
        self.check("tkvrsn_c")?;
        Ok(version.unwrap_or_default())
    }

    /// `furnsh_c`: loads one kernel.
    pub(super) fn furnish(&self, path: &Path) -> Called<()> {
        let path = c_path(path)?;
        // SAFETY: the lock is held; `path` is zero-ended and outlives the call.
        unsafe { naif::furnsh_c(path.as_ptr().cast_mut()) };
        self.check("furnsh_c")
    }

    /// `str2et_c`: UTC to ET. (`utc2et_c` would accept a thirteenth month as the next January.)
    pub(super) fn utc_to_et(&self, utc: &str) -> Called<f64> {
        let text = c_text("a UTC string", utc)?;
        let mut et = 0.0;
        // SAFETY: the lock is held; `text` is zero-ended, `et` is a live double.
        unsafe { naif::str2et_c(text.as_ptr().cast_mut(), &raw mut et) };
        self.check("str2et_c")
            .map(|()| et)
            .map_err(|error| error.of(utc))
    }

    /// `et2utc_c`: ET to ISO calendar UTC with `decimals` digits of a second.
    pub(super) fn et_to_utc(&self, et: f64, decimals: u8) -> Called<String> {
        let mut text = [0_u8; TIME_TEXT_SIZE];
        // SAFETY: the lock is held; `text` has the announced size.
        unsafe {
            naif::et2utc_c(
                et,
                c"ISOC".as_ptr().cast_mut(),
                c_int::from(decimals),
                length(TIME_TEXT_SIZE),
                text.as_mut_ptr().cast(),
            );
        }
        self.check("et2utc_c").map(|()| text_of(&text))
    }

    /// `scs2e_c`: clock string to ET.
    pub(super) fn sclk_to_et(&self, clock: i32, sclk: &str) -> Called<f64> {
        let text = c_text("a clock string", sclk)?;
        let mut et = 0.0;
        // SAFETY: the lock is held; `text` is zero-ended, `et` is a live double.
        unsafe { naif::scs2e_c(clock, text.as_ptr().cast_mut(), &raw mut et) };
        self.check("scs2e_c")
            .map(|()| et)
            .map_err(|error| error.of(sclk))
    }

    /// `sce2s_c`: ET to clock string.
    pub(super) fn et_to_sclk(&self, clock: i32, et: f64) -> Called<String> {
        let mut text = [0_u8; TIME_TEXT_SIZE];
        // SAFETY: the lock is held; `text` has the announced size.
        unsafe {
            naif::sce2s_c(clock, et, length(TIME_TEXT_SIZE), text.as_mut_ptr().cast());
        }
        self.check("sce2s_c").map(|()| text_of(&text))
    }

    /// `sce2c_c`: ET to encoded, continuous clock ticks.
    pub(super) fn et_to_ticks(&self, clock: i32, et: f64) -> Called<f64> {
        let mut ticks = 0.0;
        // SAFETY: the lock is held; `ticks` is a live double.
        unsafe { naif::sce2c_c(clock, et, &raw mut ticks) };
        self.check("sce2c_c").map(|()| ticks)
    }

    /// `spkgeo_c`: geometric state of `target` relative to `observer` in J2000.
    pub(super) fn geometric_state(&self, target: i32, et: f64, observer: i32) -> Called<StateKm> {
        let (mut state, mut light_time_s) = ([0.0; 6], 0.0);
        // SAFETY: the lock is held; `state` holds the six doubles that are written.
        unsafe {
            naif::spkgeo_c(
                target,
                et,
                c"J2000".as_ptr().cast_mut(),
                observer,
                state.as_mut_ptr(),
                &raw mut light_time_s,
            );
        }
        self.check("spkgeo_c").map(|()| state)
    }

    /// `spkssb_c`: geometric state of `target` relative to the barycentre of the solar system in J2000.
    pub(super) fn barycentric_state(&self, target: i32, et: f64) -> Called<StateKm> {
        let mut state = [0.0; 6];
        // SAFETY: the lock is held; `state` holds the six doubles that are written.
        unsafe { naif::spkssb_c(target, et, c"J2000".as_ptr().cast_mut(), state.as_mut_ptr()) };
        self.check("spkssb_c").map(|()| state)
    }

    /// `spkaps_c` with `LT+S`: apparent state of `target` in J2000, seen from an observer with this barycentric state and
    /// acceleration, km/s².
    pub(super) fn apparent_state(
        &self,
        target: i32,
        et: f64,
        mut observer: StateKm,
        mut acceleration: [f64; 3],
    ) -> Called<StateKm> {
        let (mut state, mut light_time_s, mut light_time_rate) = ([0.0; 6], 0.0, 0.0);
        // SAFETY: the lock is held; the arrays have the sizes that are read and written.
        unsafe {
            naif::spkaps_c(
                target,
                et,
                c"J2000".as_ptr().cast_mut(),
                c"LT+S".as_ptr().cast_mut(),
                observer.as_mut_ptr(),
                acceleration.as_mut_ptr(),
                state.as_mut_ptr(),
                &raw mut light_time_s,
                &raw mut light_time_rate,
            );
        }
        self.check("spkaps_c").map(|()| state)
    }

    /// `pxform_c`: matrix from one frame to another.
    pub(super) fn frame_matrix(&self, from: &CStr, to: &CStr, et: f64) -> Called<Rows> {
        let mut matrix = Rows::default();
        // SAFETY: the lock is held; names are zero-ended, `matrix` holds the nine doubles written.
        unsafe {
            naif::pxform_c(
                from.as_ptr().cast_mut(),
                to.as_ptr().cast_mut(),
                et,
                matrix.as_mut_ptr(),
            );
        }
        self.check("pxform_c").map(|()| matrix)
    }

    /// `namfrm_c` and `frinfo_c`: the code and the class of a frame; `None` for an unknown one.
    pub(super) fn frame(&self, name: &CStr) -> Called<Option<(i32, i32)>> {
        let (mut code, mut centre, mut class, mut class_id, mut found) = (0, 0, 0, 0, 0);
        // SAFETY: the lock is held; `name` is zero-ended, the others are live integers.
        unsafe {
            naif::namfrm_c(name.as_ptr().cast_mut(), &raw mut code);
            naif::frinfo_c(
                code,
                &raw mut centre,
                &raw mut class,
                &raw mut class_id,
                &raw mut found,
            );
        }
        self.check("frinfo_c")
            .map(|()| (found != 0).then_some((code, class)))
    }

    /// `gcpool_c`: the first text of a variable of the text kernels; `None` for an unknown one.
    pub(super) fn first_text(&self, variable: &CStr) -> Called<Option<CString>> {
        let mut text = [0_u8; POOL_TEXT_SIZE];
        let (mut count, mut found) = (0, 0);
        // SAFETY: the lock is held; `variable` is zero-ended, `text` has room for one value of the announced size.
        unsafe {
            naif::gcpool_c(
                variable.as_ptr().cast_mut(),
                0,
                1,
                length(POOL_TEXT_SIZE),
                &raw mut count,
                text.as_mut_ptr().cast(),
                &raw mut found,
            );
        }
        self.check("gcpool_c")?;
        let known = (found != 0).then(|| CString::new(text_of(&text)).unwrap_or_default());
        Ok(known)
    }

    /// `ckgpav_c` in J2000: attitude and rates, `None` without a sample within the tolerance.
    pub(super) fn pointing(
        &self,
        object: i32,
        ticks: f64,
        tolerance_ticks: f64,
    ) -> Called<Option<Pointing>> {
        let mut pointing = Pointing {
            matrix: Rows::default(),
            angular_velocity_rad_s: [0.0; 3],
            ticks: 0.0,
        };
        let mut found = 0;
        // SAFETY: the lock is held; outputs are live and of the sizes that are written.
        unsafe {
            naif::ckgpav_c(
                object,
                ticks,
                tolerance_ticks,
                c"J2000".as_ptr().cast_mut(),
                pointing.matrix.as_mut_ptr(),
                pointing.angular_velocity_rad_s.as_mut_ptr(),
                &raw mut pointing.ticks,
                &raw mut found,
            );
        }
        self.check("ckgpav_c")
            .map(|()| (found != 0).then_some(pointing))
    }

    /// `ckcov_c` at interval level, in ET: pairs of start and stop of attitude with rates.
    pub(super) fn ck_coverage(&self, path: &Path, object: i32) -> Called<Vec<[f64; 2]>> {
        let path = c_path(path)?;
        let mut outcome = Ok(Vec::new());
        for size in WINDOW_SIZES {
            outcome = self.ck_window(&path, object, size);
            match &outcome {
                // The window was too small for all intervals of the kernel.
                Err(SpiceError::Spice { short, .. }) if short.contains("EXCESS") => {}
                _ => break,
            }
        }
        outcome
    }

    fn ck_window(&self, path: &CStr, object: i32, size: usize) -> Called<Vec<[f64; 2]>> {
        let mut data = vec![0.0_f64; CELL_CONTROL_SIZE + size];
        let base = data.as_mut_ptr();
        let mut cell = naif::SpiceCell {
            dtype: naif::_SpiceDataType_SPICE_DP,
            length: 0,
            size: length(size),
            card: 0,
            isSet: 1,
            adjust: 0,
            init: 0,
            base: base.cast::<c_void>(),
            // SAFETY: `data` is longer than the control area.
            data: unsafe { base.add(CELL_CONTROL_SIZE) }.cast::<c_void>(),
        };
        // SAFETY: the lock is held; the cell describes `data`, which outlives the call.
        unsafe {
            naif::ckcov_c(
                path.as_ptr().cast_mut(),
                object,
                1,
                c"INTERVAL".as_ptr().cast_mut(),
                0.0,
                c"TDB".as_ptr().cast_mut(),
                &raw mut cell,
            );
        }
        self.check("ckcov_c")?;
        let used = usize::try_from(cell.card).unwrap_or(0).min(size);
        let (ends, _) = data[CELL_CONTROL_SIZE..CELL_CONTROL_SIZE + used].as_chunks::<2>();
        match ends
            .iter()
            .find(|[start, stop]| !(start <= stop && stop - start < f64::INFINITY))
        {
            Some([start, stop]) => Err(SpiceError::DamagedKernel {
                problem: format!("attitude from ET {start} to {stop}"),
            }),
            None => Ok(ends.to_vec()),
        }
    }
}

impl Drop for Cspice {
    fn drop(&mut self) {
        // SAFETY: the lock is still held: the field drops after this.
        unsafe {
            naif::reset_c();
            naif::kclear_c();
            naif::reset_c();
        }
        HELD_HERE.set(false);
    }
}

/// A length in CSPICE's type; larger ones saturate, and no slice here is that large.
fn length(size: usize) -> c_int {
    c_int::try_from(size).unwrap_or(c_int::MAX)
}

/// The text up to the first zero.
fn text_of(bytes: &[u8]) -> String {
    CStr::from_bytes_until_nul(bytes)
        .map(|text| text.to_string_lossy().trim_end().to_owned())
        .unwrap_or_default()
}

/// A zero-ended copy; rejected when CSPICE could not accept all of it.
fn c_text(what: &'static str, text: &str) -> Called<CString> {
    if text.len() > PATH_LENGTH_MAX {
        let problem = format!(
            "its length is {} bytes; expected at most {PATH_LENGTH_MAX}",
            text.len()
        );
        return Err(SpiceError::Unusable { what, problem });
    }
    if text.chars().any(char::is_control) {
        let problem = format!("{text:?} holds control characters");
        return Err(SpiceError::Unusable { what, problem });
    }
    CString::new(text).map_err(|error| SpiceError::Unusable {
        what,
        problem: error.to_string(),
    })
}

/// The path for CSPICE; rejected when CSPICE could not accept all of it.
pub(super) fn c_path(path: &Path) -> Called<CString> {
    let text = path.to_str().ok_or_else(|| SpiceError::Unusable {
        what: "a path",
        problem: format!("{} is not valid UTF-8", path.display()),
    })?;
    c_text("a path", text)
}
