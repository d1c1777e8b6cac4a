//! What times and geometry need from text kernels, and how its absence is told.

use super::{
    error::SpiceFault,
    kernels::{Kernel, KernelRole, KernelSet, read_text},
    text_kernel::{self, values_of},
};

/// Something that one text kernel of a set must define.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Need {
    /// A variable by which it is recognised.
    pub(super) variable: &'static str,
    /// What it is.
    pub(super) what: &'static str,
    /// The kernel that usually holds it.
    pub(super) kernel: &'static str,
    /// A file of the mission's archive that holds it.
    pub(super) example: &'static str,
}

pub(super) const LEAP_SECONDS: Need = Need {
    variable: "DELTET/DELTA_AT",
    what: "leap seconds",
    kernel: "leap-second kernel (.tls)",
    example: "naif0012.tls",
};
pub(super) const CLOCK: Need = Need {
    variable: "SCLK_DATA_TYPE_94",
    what: "the MGS clock",
    kernel: "spacecraft clock kernel of MGS (.tsc)",
    example: "mgs_sclkscet_00061.tsc",
};
pub(super) const MARS: Need = Need {
    variable: "BODY499_PM",
    what: "the rotation of Mars",
    kernel: "planetary constants kernel (.tpc)",
    example: "pck00010.tpc",
};
pub(super) const BUS_FRAME: Need = Need {
    variable: "FRAME_-94000_NAME",
    what: "the frame of the MGS bus",
    kernel: "kernel that defines the frame MGS_SPACECRAFT (.tsc or .tf)",
    example: "mgs_sclkscet_00061.tsc",
};
pub(super) const CAMERA_FRAME: Need = Need {
    variable: "FRAME_-94031_NAME",
    what: "the frame of the MOC narrow-angle camera",
    kernel: "instrument kernel of MOC (.ti)",
    example: "moc20.ti",
};

/// What clock strings and attitude need.
pub(super) const CLOCKS: [Need; 2] = [LEAP_SECONDS, CLOCK];

/// A fault of CSPICE, or the kernel whose absence explains it: the first of `needs` that no text
/// kernel of `set` defines.
pub(super) fn explain(set: &KernelSet, fault: SpiceFault, needs: &[Need]) -> SpiceFault {
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
        let defines = |text| !values_of(text, need.variable).is_empty();
        !defined.iter().any(|text| defines(text))
    });
    match missing {
        None => fault,
        Some(need) => SpiceFault::MissingText {
            kernel: need.kernel,
            variable: need.variable,
            example: need.example,
            set: set.kernels().iter().map(Kernel::file_name).collect(),
        },
    }
}
