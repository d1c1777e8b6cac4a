//! Further laser passes over a site, on days without an image.

use nalgebra::Vector3;

use super::{
    arc::{Beam, Flight},
    error_sources::{PositionErrors, SceneErrors},
    orbit::Orbit,
    passes::Pass,
    plan::Site,
    profile_shift::ProfileShift,
    random::Random,
    versions::{FAMILIES, Version},
};
use areograph_base::{
    body::MARS_IAU2000,
    error::Result,
    time::{Et, Interval},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::{body_rotation::body_matrix, orbit_axes::radial_along_cross};

/// Time from the last image to the first pass and between passes, seconds.
const APART_S: f64 = 43_200.0;
/// Half the frames of a pass, seconds: the window of a site takes 20 s.
const HALF_S: f64 = 16.0;
/// Number in the name of the first file; the files of the images have smaller ones.
const FIRST_FILE: u32 = 20_001;

/// A pass at nadir, with the errors of its day.
#[derive(Debug)]
pub(super) struct FurtherPass {
    /// The site below it.
    pub(super) site: &'static Site<'static>,
    /// Number in the name of its file.
    pub(super) number: u32,
    /// When it is over the latitude of the site.
    pub(super) middle: Et,
    /// Offset of the profile in the file.
    pub(super) shift: ProfileShift,
    pass: Pass,
    /// True minus recorded position of the spacecraft, IAU 2000, metres.
    position_error_m: Vector3<f64>,
    /// Displacement of the end of the beam from nadir by the attitude error, IAU 2000, metres.
    aside_m: Vector3<f64>,
}

impl FurtherPass {
    /// `count` passes over each of `sites` after the instant `last`, distributed by chance over the width of the window, in both
    /// directions.
    pub(super) fn over(
        sites: &[&'static Site<'static>],
        count: u32,
        last: Et,
        errors: &SceneErrors,
        seed: u64,
    ) -> Vec<Self> {
        let all = sites
            .iter()
            .flat_map(|site| (0..count).map(move |_| *site))
            .zip(0..);
        all.map(|(site, index)| {
            let middle = last.plus(APART_S * f64::from(index + 1));
            Self::draw(site, FIRST_FILE + index, middle, errors, seed)
        })
        .collect()
    }

    fn draw(
        site: &'static Site<'static>,
        number: u32,
        middle: Et,
        errors: &SceneErrors,
        seed: u64,
    ) -> Self {
        let mut random = Random::new(seed, &format!("pass {number}"));
        let half_deg = Site::WINDOW_HALF_LONGITUDE_DEG;
        let longitude_deg = site.longitude_deg + random.between(-half_deg, half_deg);
        let northwards = random.between(0.0, 1.0) < 0.5;
        let pass = Pass::over(
            middle,
            longitude_deg * RADIANS_PER_DEGREE,
            site.latitude_deg * RADIANS_PER_DEGREE,
            northwards,
        );
        let state = pass.orbit().state(middle);
        let axes = body_matrix(&MARS_IAU2000, middle)
            * radial_along_cross(&state.position_m, &state.velocity_m_s);
        let mut normal = || Vector3::from_fn(|_axis, _column| random.normal());
        let position_error_m = match errors.position {
            PositionErrors::Camera { .. } => Vector3::zeros(),
            PositionErrors::Bus {
                sigma_radial_along_cross_m,
            } => axes * Vector3::from(sigma_radial_along_cross_m).component_mul(&normal()),
        };
        let [roll_rad, pitch_rad, _] = errors.attitude.constant_sigma_rad;
        let turn_rad = Vector3::new(0.0, pitch_rad, roll_rad).component_mul(&normal());
        let aside_m = axes * turn_rad * pass.height_m(middle);
        Self {
            site,
            number,
            middle,
            shift: ProfileShift::of_pass(&errors.altimeter, site, &aside_m, &mut random),
            pass,
            position_error_m,
            aside_m,
        }
    }

    /// Name of its file.
    pub(super) fn file(&self) -> String {
        format!("ap{}l.b", self.number)
    }

    /// Number of its orbit: names of files are this plus 10 000.
    pub(super) const fn orbit_number(&self) -> u32 {
        self.number - 10_000
    }

    /// From its first to its last frame.
    pub(super) fn frames(&self) -> Interval {
        Interval::new(self.middle, self.middle).padded(HALF_S)
    }

    /// The versions of its orbit.
    pub(super) fn versions(&self, seed: u64) -> [Version; 3] {
        FAMILIES.map(|family| Version::new(family, &self.file(), seed, self.middle))
    }

    /// Its orbit.
    pub(super) const fn orbit(&self) -> &Orbit {
        self.pass.orbit()
    }
}

impl Flight for FurtherPass {
    fn beam(&self, et: Et) -> Result<Beam> {
        let nadir = self.pass.beam(et)?;
        let aside_m = body_matrix(&MARS_IAU2000, et).tr_mul(&self.aside_m);
        let direction = (nadir.direction * self.pass.height_m(et) + aside_m).normalize();
        Ok(Beam {
            position_error_m: self.position_error_m,
            direction,
            steady_direction: direction,
            ..nadir
        })
    }
}
