//! Mountings of cameras on the bus by the frame kernels, read once where they are constant.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    ffi::{CStr, CString},
};

use super::{
    ffi::{Called, Cspice, Rows},
    needs::{bus_frame, camera_frame},
    session::{Session, matrix},
};
use areograph_base::{
    error::Result,
    frames::{CameraFrame, Rotation, SpacecraftBus},
    instruments::Instrument,
    time::Et,
};
use areograph_geom::body_rotation::frame_rotation_3;

/// Class of frames with a constant rotation from another frame (`TK`).
const CONSTANT_CLASS: i32 = 4;
/// Longest chain of such frames that is followed; the limit of CSPICE is the same.
const CHAIN_MAX: usize = 10;

/// Mountings that the kernels of a session define as constant, by the frames of bus and camera; `None` for one that
/// depends on time.
#[derive(Debug, Default)]
pub(super) struct FixedMountings(RefCell<BTreeMap<[CString; 2], Option<Rows>>>);

impl Session {
    /// Mounting of `instrument` by the loaded kernels, converted to its camera axes.
    ///
    /// # Errors
    /// [`SpiceError::MissingText`](super::SpiceError::MissingText) when no loaded kernel defines the two frames.
    pub fn mounting(
        &self,
        instrument: &Instrument,
        et: Et,
    ) -> Result<Rotation<SpacecraftBus, CameraFrame>> {
        let frames = [&instrument.naif.bus_frame, &instrument.naif.frame]
            // A name with a zero byte is truncated there, and then no kernel defines it.
            .map(|name| CString::new(name.split('\0').next().unwrap_or_default()))
            .map(std::result::Result::unwrap_or_default);
        let rows = self.mounting_rows(frames, et).map_err(|error| {
            let needs = [camera_frame(instrument), bus_frame(instrument.spacecraft)];
            self.explain(error, &needs)
        })?;
        let turn = frame_rotation_3(instrument.naif.turn_rad);
        Ok(Rotation::new(turn * matrix(&rows), et))
    }

    fn mounting_rows(&self, frames: [CString; 2], et: Et) -> Called<Rows> {
        let known = self.mountings().0.borrow().get(&frames).copied();
        if let Some(Some(rows)) = known {
            return Ok(rows);
        }
        let [bus, camera] = &frames;
        let rows = self.cspice().frame_matrix(bus, camera, et.seconds())?;
        if known.is_none() {
            let constant = is_constant(self.cspice(), bus, camera)?.then_some(rows);
            self.mountings().0.borrow_mut().insert(frames, constant);
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
