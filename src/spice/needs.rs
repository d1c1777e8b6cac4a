//! What times and geometry need from text kernels, and how its absence is told.

use std::borrow::Cow;

use super::{
    error::SpiceError,
    kernels::{Kernel, KernelRole, KernelSet, read_text},
    text_kernel::{self, values_of},
};
use crate::instruments::Instrument;

/// Something that one text kernel of a set must define.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Need {
    /// A variable by which it is recognised.
    pub(super) variable: Cow<'static, str>,
    /// What it is.
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
pub(super) const CLOCK: Need = Need {
    variable: Cow::Borrowed("SCLK_DATA_TYPE_94"),
    what: Cow::Borrowed("the MGS clock"),
    kernel: Cow::Borrowed("spacecraft clock kernel of MGS (.tsc)"),
    example: Cow::Borrowed("mgs_sclkscet_00061.tsc"),
};
pub(super) const MARS: Need = Need {
    variable: Cow::Borrowed("BODY499_PM"),
    what: Cow::Borrowed("the rotation of Mars"),
    kernel: Cow::Borrowed("planetary constants kernel (.tpc)"),
    example: Cow::Borrowed("pck00010.tpc"),
};
pub(super) const BUS_FRAME: Need = Need {
    variable: Cow::Borrowed("FRAME_-94000_NAME"),
    what: Cow::Borrowed("the frame of the MGS bus"),
    kernel: Cow::Borrowed("kernel that defines the frame MGS_SPACECRAFT (.tsc or .tf)"),
    example: Cow::Borrowed("mgs_sclkscet_00061.tsc"),
};
/// The frame of a camera.
pub(super) fn camera_frame(instrument: &Instrument) -> Need {
    Need {
        variable: format!("FRAME_{}_NAME", instrument.naif.instrument).into(),
        what: format!("the frame of the {} camera", instrument.name).into(),
        kernel: format!("instrument kernel of {} (.ti)", instrument.name).into(),
        example: instrument.naif.kernel.clone().into(),
    }
}

/// What clock strings and attitude need.
pub(super) const CLOCKS: [Need; 2] = [LEAP_SECONDS, CLOCK];

/// An error of CSPICE, or the kernel whose absence explains it: the first of `needs` that no text
/// kernel of `set` defines.
pub(super) fn explain(set: &KernelSet, error: SpiceError, needs: &[Need]) -> SpiceError {
    let texts = set.kernels().iter().filter(|kernel| {
        !matches!(
            kernel.role,
            KernelRole::Spk | KernelRole::Ck | KernelRole::Meta
        )
    });
    // Binary planetary constants are no text, and define none of these.
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
