//! The coverage of each kernel and its use by the site, for the manifest and the report.

use std::{collections::BTreeSet, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use areograph_base::{
    body::Body,
    constants::{SPACECRAFT, Spacecraft},
    error::Result,
    time::{Et, Interval, Intervals},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{attitude::rotation_vector, body_rotation::body_rotation};
use areograph_spice::{KernelView, RequiredCoverage, Session};
use areograph_store::{
    stage::{Input, Inputs, Stage},
    stage_inputs,
};

/// A PCK that turns the body by more than this against the formula of the products holds another model, radians
/// (1e-7 rad is 0.3 m on the ground; the models differ by 4e-3 rad).
const PCK_TOLERANCE_RAD: f64 = 1e-7;

/// Kernels in load order, with notes on them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KernelDescription {
    /// One entry per kernel, in load order.
    pub kernels: Vec<KernelLine>,
    /// A planetary constants kernel that does not follow the frame of the products, in a sentence.
    pub pck_note: Option<String>,
    /// C-kernels whose attitudes have no angular rates and are not read, in a sentence.
    pub rates_note: Option<String>,
}

/// A kernel as manifest and report show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KernelLine {
    /// File name.
    pub name: String,
    /// Role by its content: `LSK`, `SCLK`, `PCK`, `FK`, `IK`, `SPK`, `CK`.
    pub role: String,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its bytes, hexadecimal.
    pub blake3: String,
    /// Times at which it covers a spacecraft of the site: its position in an SPK, its attitude in a CK; `None` for
    /// other kernels.
    pub held: Option<Intervals>,
    /// Required intervals that are read from this kernel; where several kernels hold an instant, the last one is read.
    pub used: Vec<Interval>,
}

stage_inputs! {
    /// The kernels, and the times at which the site reads them.
    pub struct DescribeKernels<'a> {
        /// The body of the site.
        pub body: &'a Body,
        /// All kernels.
        pub kernels: &'a KernelView,
        /// Times at which they are read.
        pub required: Required<'a>,
        /// Largest distance from its intervals at which a C-kernel may be read, seconds.
        pub ck_tolerance_s: &'a f64,
    }
}

/// The times at which a site reads kernels; `None` while they are unknown.
#[derive(Debug, Clone, Copy)]
pub struct Required<'a>(pub Option<&'a RequiredCoverage>);

impl Input for Required<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        match self.0 {
            Some(required) => {
                inputs.setting(&format!("{field} positions"), &required.positions);
                inputs.setting(&format!("{field} attitudes"), &required.attitudes);
                inputs.setting(&format!("{field} others"), &required.others);
            }
            None => inputs.not_known_yet(&format!("key {field}"), &format!("key {field}")),
        }
    }
}

impl Stage for DescribeKernels<'_> {
    const NAME: &'static str = "describe_kernels";
    const METHOD: u32 = 4;
    type Output = KernelDescription;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<KernelDescription> {
        let nothing = RequiredCoverage::default();
        let required = self.required.0.unwrap_or(&nothing);
        describe_kernels(
            *self.body,
            self.kernels.session()?,
            required,
            *self.ck_tolerance_s,
        )
    }
}

/// Describes the kernels of `session`.
///
/// * `ck_tolerance_s` – largest distance from its intervals at which a C-kernel may be read, seconds
///
/// # Errors
/// As [`Session::coverage`].
pub fn describe_kernels(
    body: Body,
    session: &Session,
    required: &RequiredCoverage,
    ck_tolerance_s: f64,
) -> Result<KernelDescription> {
    let (mut in_use, mut held) = (Vec::new(), Vec::new());
    let mut without_rates = BTreeSet::new();
    for (spacecraft, required) in by_spacecraft(required) {
        let session = session.of(spacecraft);
        in_use.extend(session.coverage_in_use(required, ck_tolerance_s)?);
        held.extend_from_slice(&session.coverage()?.per_kernel);
        without_rates.extend(session.coverage()?.without_rates.iter().copied());
    }
    let of = |entries: &[(usize, Intervals)], index: usize| {
        let entries = entries.iter().filter(|(of, _)| *of == index);
        let intervals: Vec<&Intervals> = entries.map(|(_, intervals)| intervals).collect();
        let all = intervals.iter().flat_map(|of| of.as_slice()).copied();
        (!intervals.is_empty()).then(|| Intervals::union_of(all))
    };
    let kernels = session.kernels().kernels().iter().enumerate();
    let kernels = kernels.map(|(index, kernel)| KernelLine {
        name: kernel.file_name(),
        role: kernel.role.to_string(),
        bytes: kernel.bytes,
        blake3: kernel.blake3.clone(),
        held: of(&held, index),
        used: of(&in_use, index).map_or_else(Vec::new, |used| used.as_slice().to_vec()),
    });
    Ok(KernelDescription {
        kernels: kernels.collect(),
        pck_note: pck_note(body, session, &required.of_all()[0]),
        rates_note: rates_note(session, &without_rates),
    })
}

/// CSPICE silently ignores attitudes without rates; users of such kernels should know.
fn rates_note(session: &Session, without: &BTreeSet<usize>) -> Option<String> {
    let kernels = session.kernels().kernels();
    let names: Vec<String> = without
        .iter()
        .map(|index| kernels[*index].file_name())
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}: attitudes without angular rates are not read; if another C-kernel covers the time, its attitudes are \
             used",
            names.join(", ")
        )
    })
}

/// The times that the site reads for each spacecraft; the spacecraft of the laser comes first, even if it is not read.
fn by_spacecraft(
    required: &RequiredCoverage,
) -> impl Iterator<Item = (&'static Spacecraft, &RequiredCoverage)> {
    let others = required.others.iter();
    let others = others.filter_map(|(id, of)| Some((Spacecraft::of_id(id)?, of)));
    std::iter::once((*SPACECRAFT, required)).chain(others)
}

/// Products use their own formula instead of the PCK; users of `kernels.tm` should know.
fn pck_note(body: Body, session: &Session, positions: &Intervals) -> Option<String> {
    let at = positions
        .as_slice()
        .first()
        .map_or(Et::from_seconds(0.0), |interval| interval.start);
    let ours = *body_rotation(body, at).matrix();
    // Without a PCK there is nothing to compare.
    let theirs = session.body_matrix(body, at).ok()?;
    let turn_rad = rotation_vector(&(theirs * ours.transpose())).norm();
    (turn_rad > PCK_TOLERANCE_RAD).then(|| {
        format!(
            "the PCK rotates {} by {:.5}° relative to {frame}; products use the {frame} constants",
            body.naif().pck_frame,
            turn_rad / RADIANS_PER_DEGREE,
            frame = body.names().short_frame
        )
    })
}
