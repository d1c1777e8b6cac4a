//! The kernels that a stage may read: kernels outside its fingerprint are not loaded.

use std::cell::OnceCell;

use super::{daf, kernels::KernelSet, role::KernelRole, session::Session};
use areograph_base::error::Result;
use areograph_store::stage::{Input, Inputs};

/// Frames of SPK segments with ids up to this are inertial (NAIF, Frames Required Reading).
const INERTIAL_MAX: i32 = 21;
/// Ids of the body-fixed frames that are built into SPICE, which need planetary constants only.
const BUILT_IN_BODY_FIXED: std::ops::Range<i32> = 10_000..11_000;

/// Some of a run's kernels, and the session that has them loaded.
#[derive(Debug)]
pub struct KernelView {
    /// `None` while the kernels of a run are not known.
    kernels: Option<KernelSet>,
    session: OnceCell<Session>,
}

impl KernelView {
    /// All kernels.
    #[must_use]
    pub fn all(kernels: Option<&KernelSet>) -> Self {
        Self {
            kernels: kernels.cloned(),
            session: OnceCell::new(),
        }
    }

    /// Text kernels: clocks, constants, frames.
    #[must_use]
    pub fn text(kernels: Option<&KernelSet>) -> Self {
        // A frame kernel by its header may contain a clock as well.
        let is_text = |role| !matches!(role, KernelRole::Spk | KernelRole::Ck);
        Self::all(kernels.map(|kernels| kernels.of_roles(is_text)).as_ref())
    }

    /// The kernels that positions may depend on: all except C-kernels, unless an ephemeris is given in a frame that may
    /// rotate with them.
    ///
    /// # Errors
    /// An ephemeris whose segments cannot be listed.
    pub fn positions(kernels: Option<&KernelSet>) -> Result<Self> {
        let view = kernels.map(position_kernels).transpose()?;
        Ok(Self::all(view.as_ref()))
    }

    /// The kernels; `None` while they are not known.
    #[must_use]
    pub const fn kernels(&self) -> Option<&KernelSet> {
        self.kernels.as_ref()
    }

    /// The session with these kernels, opened at the first call and closed with the view.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn session(&self) -> Result<&Session> {
        if let Some(session) = self.session.get() {
            return Ok(session);
        }
        let none = KernelSet::default();
        let session = Session::open(self.kernels.as_ref().unwrap_or(&none))?;
        Ok(self.session.get_or_init(|| session))
    }
}

/// The kernels that the positions of `kernels` may depend on; see [`KernelView::positions`].
///
/// # Errors
/// An ephemeris whose segments cannot be listed.
pub fn position_kernels(kernels: &KernelSet) -> Result<KernelSet> {
    let ephemerides = kernels.kernels().iter();
    let ephemerides = ephemerides.filter(|kernel| kernel.role == KernelRole::Spk);
    for kernel in ephemerides {
        for segment in daf::segments(&kernel.path)? {
            let [_, _, frame, ..] = segment.integers;
            if !(1..=INERTIAL_MAX).contains(&frame) && !BUILT_IN_BODY_FIXED.contains(&frame) {
                return Ok(kernels.clone());
            }
        }
    }
    Ok(kernels.of_roles(|role| role != KernelRole::Ck))
}

/// Kernels enter by content and position in the load order.
impl Input for &KernelView {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        let Some(kernels) = &self.kernels else {
            return inputs.not_known_yet("kernels", "kernel ");
        };
        for (place, kernel) in kernels.kernels().iter().enumerate() {
            inputs.file("kernel", &kernel.path, Some(place), &kernel.blake3);
        }
    }
}
