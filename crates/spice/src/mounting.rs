//! Mountings of cameras on the bus by the frame kernels, read once where they are constant.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    ffi::{CStr, CString},
};

use super::ffi::{Called, Cspice, Rows};
use areograph_base::time::Et;

/// Class of frames with a constant rotation from another frame (`TK`).
const CONSTANT_CLASS: i32 = 4;
/// Longest chain of such frames that is followed; the limit of CSPICE is the same.
const CHAIN_MAX: usize = 10;

/// Mountings that the kernels of a session define as constant, by the frames of bus and camera; `None` for one that
/// depends on time.
#[derive(Debug, Default)]
pub(super) struct FixedMountings(RefCell<BTreeMap<[CString; 2], Option<Rows>>>);

impl FixedMountings {
    /// Matrix from the frame of the bus to that of the camera, by rows.
    pub(super) fn rows(&self, cspice: &Cspice, frames: [CString; 2], et: Et) -> Called<Rows> {
        let known = self.0.borrow().get(&frames).copied();
        if let Some(Some(rows)) = known {
            return Ok(rows);
        }
        let [bus, camera] = &frames;
        let rows = cspice.frame_matrix(bus, camera, et.seconds())?;
        if known.is_none() {
            let constant = is_constant(cspice, bus, camera)?.then_some(rows);
            self.0.borrow_mut().insert(frames, constant);
        }
        Ok(rows)
    }
}

/// Whether a chain of constant rotations leads from `camera` to `bus`.
fn is_constant(cspice: &Cspice, bus: &CStr, camera: &CStr) -> Called<bool> {
    let Some((bus, _)) = cspice.frame(bus)? else {
        return Ok(false);
    };
    let mut name = camera.to_owned();
    for _ in 0..CHAIN_MAX {
        match cspice.frame(&name)? {
            Some((code, _)) if code == bus => return Ok(true),
            Some((code, CONSTANT_CLASS)) => match relative_to(cspice, code, &name)? {
                Some(relative) => name = relative,
                None => return Ok(false),
            },
            _ => return Ok(false),
        }
    }
    Ok(false)
}

/// The frame from which a constant frame is turned: a variable with its code or its name.
fn relative_to(cspice: &Cspice, code: i32, name: &CStr) -> Called<Option<CString>> {
    for frame in [code.to_string(), name.to_string_lossy().into_owned()] {
        let variable = CString::new(format!("TKFRAME_{frame}_RELATIVE")).unwrap_or_default();
        if let Some(relative) = cspice.first_text(&variable)? {
            return Ok(Some(relative));
        }
    }
    Ok(None)
}
