//! Text kernels that times and geometry require, and the errors for missing ones.

use std::{borrow::Cow, path::PathBuf, sync::LazyLock};

use super::{
    error::SpiceError,
    kernels::{Kernel, KernelSet, read_text},
    role::KernelRole,
    text_kernel::{self, Assignment, values_of},
};
use areograph_base::{
    constants::{SPACECRAFT, Spacecraft},
    instruments::Instrument,
};

/// A variable that one text kernel of a set must define.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Need {
    /// The variable.
    pub(super) variable: Cow<'static, str>,
    /// Its meaning.
    pub(super) what: Cow<'static, str>,
    /// The kernel that usually holds it.
    pub(super) kernel: Cow<'static, str>,
    /// A file of the mission's archive that holds it.
    pub(super) example: Cow<'static, str>,
}

pub(super) const LEAP_SECONDS: Need = Need {
    variable: Cow::Borrowed("DELTET/DELTA_AT"),
    what: Cow::Borrowed("leap seconds"),
    kernel: Cow::Borrowed("leap-second kernel (.tls)"),
    example: Cow::Borrowed("naif0012.tls"),
};
/// The clock of a spacecraft.
pub(super) fn clock(of: &'static Spacecraft) -> Need {
    Need {
        variable: format!("SCLK_DATA_TYPE_{}", of.naif.unsigned_abs()).into(),
        what: format!("the {} clock", of.name).into(),
        kernel: format!("spacecraft clock kernel of {} (.tsc)", of.name).into(),
        example: Cow::Borrowed(&of.clock_kernel),
    }
}
pub(super) const MARS: Need = Need {
    variable: Cow::Borrowed("BODY499_PM"),
    what: Cow::Borrowed("the rotation of Mars"),
    kernel: Cow::Borrowed("planetary constants kernel (.tpc)"),
    example: Cow::Borrowed("pck00010.tpc"),
};
/// The frame of the bus of a spacecraft.
pub(super) fn bus_frame(of: &'static Spacecraft) -> Need {
    Need {
        variable: format!("FRAME_{}_NAME", of.bus).into(),
        what: format!("the frame of the {} bus", of.name).into(),
        kernel: format!(
            "kernel that defines the frame {} (.tsc or .tf)",
            of.bus_frame
        )
        .into(),
        example: Cow::Borrowed(&of.frame_kernel),
    }
}
/// The frame of a camera.
pub(super) fn camera_frame(instrument: &Instrument) -> Need {
    let naif = &instrument.naif;
    Need {
        variable: format!("FRAME_{}_NAME", naif.frame_id).into(),
        what: format!("the frame of the {} camera", instrument.name).into(),
        kernel: if naif.frame_id == naif.instrument {
            format!("instrument kernel of {} (.ti)", instrument.name).into()
        } else {
            format!("kernel that defines the frame {} (.tf or .ti)", naif.frame).into()
        },
        example: instrument.naif.kernel.clone().into(),
    }
}

/// Text kernels that clock strings and attitude require.
pub(super) fn clocks(of: &'static Spacecraft) -> [Need; 2] {
    [LEAP_SECONDS, clock(of)]
}

/// An error of CSPICE, or the missing kernel that explains it: the first of `needs` that no text kernel of `set`
/// defines.
pub(super) fn explain(set: &KernelSet, error: SpiceError, needs: &[Need]) -> SpiceError {
    let texts = set.kernels().iter().filter(|kernel| {
        !matches!(
            kernel.role,
            KernelRole::Spk | KernelRole::Ck | KernelRole::Meta
        )
    });
    // Binary planetary constants are not text, and define none of these.
    let defined: Vec<_> = texts
        .filter_map(|kernel| text_kernel::assignments(&read_text(&kernel.path).ok()?).ok())
        .collect();
    let missing = needs.iter().find(|need| {
        let defines = |text| !values_of(text, &need.variable).is_empty();
        !defined.iter().any(|text| defines(text))
    });
    match missing {
        None => error,
        Some(need) => SpiceError::MissingText {
            kernel: need.kernel.clone().into_owned(),
            variable: need.variable.clone().into_owned(),
            example: need.example.clone().into_owned(),
            set: set.kernels().iter().map(Kernel::file_name).collect(),
        },
    }
}

/// Text kernels that time tagging and geometry require, except the frame of the camera.
static NEEDS: LazyLock<[Need; 4]> = LazyLock::new(|| {
    [
        LEAP_SECONDS,
        clock(&SPACECRAFT),
        MARS,
        bus_frame(&SPACECRAFT),
    ]
});

/// Whether a text kernel gives a variable a value.
pub(super) fn defines(assignments: &[Assignment], variable: &str) -> bool {
    !values_of(assignments, variable).is_empty()
}

/// The requirements of all images, and the frames of those cameras that `texts` define: one at least.
pub(super) fn needs(texts: &[(PathBuf, Vec<Assignment>)], cameras: &[Instrument]) -> Vec<Need> {
    let cameras: Vec<Need> = cameras.iter().map(camera_frame).collect();
    let known = |need: &&Need| {
        texts
            .iter()
            .any(|(_, assignments)| defines(assignments, &need.variable))
    };
    let known_cameras: Vec<Need> = cameras.iter().filter(known).cloned().collect();
    let cameras = if known_cameras.is_empty() {
        cameras.into_iter().take(1).collect()
    } else {
        known_cameras
    };
    NEEDS.iter().cloned().chain(cameras).collect()
}
