//! A session with CSPICE: times, states and attitudes from one set of kernels.
//!
//! CSPICE keeps global state. A session holds the process-wide lock, furnishes one kernel set, turns errors into
//! `SpiceError` with the short and long text of NAIF, and unloads on drop. All of its `unsafe` code is in `ffi.rs`. No
//! writer of products opens one: a stage tabulates the content of kernels, and `write` puts it into a file with the
//! writers of CSPICE, which need no loaded kernel. Parallel work uses the trajectory (Chebyshev pieces with a measured
//! error) and the closed formula of the rotation of Mars, neither of which needs a session.

use std::{cell::OnceCell, ffi::CString, rc::Rc, sync::OnceLock};

use nalgebra::{Matrix3, Vector3};

use super::{
    apparent::{MarsAcceleration, orbiter_seen_from_mars, seen_from_mars},
    coverage::Coverage,
    error::SpiceError,
    ffi::{Cspice, Rows, StateKm},
    kernels::KernelSet,
    mounting::FixedMountings,
    needs::{LEAP_SECONDS, Need, bus_frame, camera_frame, clocks, explain},
    origin::{self, Origin, all_finite},
    role::KernelRole,
    state::State,
    tabulated::Tabulated,
};
use areograph_base::{
    body::Body,
    constants::{NAIF_MARS, NAIF_SOLAR_SYSTEM_BARYCENTRE, NAIF_SUN, SPACECRAFT, Spacecraft},
    error::{Error, Locate, Result},
    frames::{CameraFrame, J2000, Rotation, SpacecraftBus},
    instruments::Instrument,
    time::{CkLookup, Et, Interval},
};
use areograph_geom::{attitude::bus_to_camera, body_rotation::frame_rotation_3};

/// Digits of a second in UTC strings for people.
const UTC_DECIMALS: u8 = 3;

/// Attitude of the bus at an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// From J2000 to the bus; stamped with the exposure's instant, not the kernel's.
    pub inertial_to_bus: Rotation<J2000, SpacecraftBus>,
    /// Angular velocity of the bus, J2000 components, radians per second.
    pub angular_velocity_rad_s: Vector3<f64>,
    /// Distance of the kernel's attitude from the requested instant, seconds; 0 inside its intervals.
    pub distance_s: f64,
}

/// The only access to CSPICE: holds the process-wide lock and one set of loaded kernels.
///
/// A second session on another thread waits for this one to end; on the same thread it is rejected. Kernels are
/// unloaded when the session is dropped. Clock, orbit and attitude belong to one spacecraft, the one with the laser
/// unless [`Session::of`] selects another.
///
/// ```
/// use std::path::Path;
///
/// use areograph_spice::{KernelSet, Session};
///
/// # fn main() -> areograph_base::error::Result<()> {
/// let kernels = KernelSet::from_metakernel(Path::new("../../kernels.example/example.tm"))?;
/// let session = Session::open(&kernels)?;
/// let start = session.sclk_to_et("619971158:28")?;
/// assert_eq!(session.et_to_utc(start)?, "1999-08-24T14:12:13.635");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Session {
    loaded: Rc<Loaded>,
    spacecraft: &'static Spacecraft,
    tabulated: Option<Tabulated>,
}

/// CSPICE with its kernels, and their coverage of every spacecraft, once requested.
#[derive(Debug)]
struct Loaded {
    cspice: Cspice,
    kernels: KernelSet,
    /// In the order of [`Spacecraft::all`].
    coverages: Vec<OnceCell<Coverage>>,
    mountings: FixedMountings,
    mars_acceleration: MarsAcceleration,
}

impl Session {
    /// Waits for the lock and loads `kernels` in order.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] with the file that failed to load; [`SpiceError::SessionOpen`].
    pub fn open(kernels: &KernelSet) -> Result<Self> {
        let cspice = Cspice::lock()?;
        for kernel in kernels.kernels() {
            cspice.furnish(&kernel.path).in_file(&kernel.path)?;
        }
        let loaded = Loaded {
            cspice,
            kernels: kernels.clone(),
            coverages: vec![OnceCell::new(); Spacecraft::all().len()],
            mountings: FixedMountings::default(),
            mars_acceleration: MarsAcceleration::default(),
        };
        Ok(Self {
            loaded: Rc::new(loaded),
            spacecraft: &SPACECRAFT,
            tabulated: None,
        })
    }

    /// The session for the clock, orbit and attitude of `spacecraft`.
    #[must_use]
    pub fn of(&self, spacecraft: &'static Spacecraft) -> Self {
        Self {
            loaded: Rc::clone(&self.loaded),
            spacecraft,
            tabulated: None,
        }
    }

    /// The session for many states of its spacecraft in this interval: states are those of polynomials that agree with
    /// CSPICE within 0.3 mm and 0.01 mm/s at instants between their nodes. Where they do not agree, where a segment of a
    /// kernel ends in the interval, and outside the interval, states are read.
    #[must_use]
    pub fn tabulated(self, interval: Interval) -> Self {
        let is_inside = |seam: &Et| interval.start < *seam && *seam < interval.stop;
        let coverage = self.coverage();
        let is_smooth = coverage.is_ok_and(|of| !of.seams().iter().any(is_inside));
        Self {
            tabulated: is_smooth.then(|| Tabulated::new(interval)),
            ..self
        }
    }

    /// The spacecraft whose clock, orbit and attitude are read.
    #[must_use]
    pub const fn spacecraft(&self) -> &'static Spacecraft {
        self.spacecraft
    }

    pub(super) fn cspice(&self) -> &Cspice {
        &self.loaded.cspice
    }

    /// The version of CSPICE, for example `CSPICE_N0067`.
    ///
    /// # Errors
    /// [`SpiceError::SessionOpen`] for the first call, on a thread that holds a session.
    pub fn version_of_cspice() -> Result<String> {
        // Asked once: a site that publishes does not wait for the session of another.
        static VERSION: OnceLock<String> = OnceLock::new();
        if let Some(version) = VERSION.get() {
            return Ok(version.clone());
        }
        let version = Cspice::lock()?.version()?;
        Ok(VERSION.get_or_init(|| version).clone())
    }

    /// The kernels of this session.
    #[must_use]
    pub fn kernels(&self) -> &KernelSet {
        &self.loaded.kernels
    }

    /// Coverage of the spacecraft by all loaded kernels, at the level of intervals.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] when a C-kernel cannot be read; [`SpiceError::MissingText`] without a clock.
    pub fn coverage(&self) -> Result<&Coverage> {
        let known = &self.loaded.coverages[self.spacecraft.place()];
        if let Some(coverage) = known.get() {
            return Ok(coverage);
        }
        let coverage = Coverage::of(self.kernels(), self.cspice(), self.spacecraft)?;
        Ok(known.get_or_init(|| coverage))
    }

    /// An error of CSPICE, or the missing kernel that explains it.
    fn explain(&self, error: SpiceError, needs: &[Need]) -> SpiceError {
        explain(self.kernels(), error, needs)
    }

    /// Instant of a UTC string such as `1999-08-24T14:12:13.64`, with or without a closing `Z`.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] when the string is not a date; [`SpiceError::MissingText`].
    pub fn utc_to_et(&self, utc: &str) -> Result<Et> {
        let utc = utc.trim();
        let seconds = self
            .cspice()
            .utc_to_et(utc.strip_suffix('Z').unwrap_or(utc))
            .map_err(|error| self.explain(error, &[LEAP_SECONDS]))?;
        Ok(Et::from_seconds(seconds))
    }

    /// ISO calendar UTC with three decimals, for example `1999-08-24T14:12:13.635`.
    ///
    /// # Errors
    /// [`SpiceError::MissingText`] without a leap-second kernel.
    pub fn et_to_utc(&self, et: Et) -> Result<String> {
        self.et_to_utc_with(et, UTC_DECIMALS)
    }

    /// UTC of an instant with `decimals` digits of a second, ISO 8601 without a zone letter.
    ///
    /// # Errors
    /// [`SpiceError::MissingText`] without a leap-second kernel.
    pub fn et_to_utc_with(&self, et: Et, decimals: u8) -> Result<String> {
        let utc = self.cspice().et_to_utc(et.seconds(), decimals);
        Ok(utc.map_err(|error| self.explain(error, &[LEAP_SECONDS]))?)
    }

    /// Instant of a string of the spacecraft's clock, such as `619971158:28` or `1/0844996544.086`.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] when the string is not a clock reading; [`SpiceError::MissingText`].
    pub fn sclk_to_et(&self, sclk: &str) -> Result<Et> {
        let seconds = self.cspice().sclk_to_et(self.spacecraft.naif, sclk.trim());
        let seconds = seconds.map_err(|error| self.explain(error, &clocks(self.spacecraft)))?;
        Ok(Et::from_seconds(seconds))
    }

    /// String of the spacecraft's clock, with partition, rounded to a tick.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] outside the clock kernel's range; [`SpiceError::MissingText`].
    pub fn et_to_sclk(&self, et: Et) -> Result<String> {
        let sclk = self.cspice().et_to_sclk(self.spacecraft.naif, et.seconds());
        Ok(sclk.map_err(|error| self.explain(error, &clocks(self.spacecraft)))?)
    }

    /// Geometric state of the spacecraft relative to Mars: no light time, no aberration.
    ///
    /// # Errors
    /// [`SpiceError::Spice`], of kind coverage when the kernels do not cover the instant; [`SpiceError::NotFinite`]
    /// with the kernel that holds NaN or an infinity.
    pub fn state(&self, et: Et) -> Result<State> {
        let tabulated = self.tabulated.as_ref();
        match tabulated.and_then(|states| states.geometric(et, |et| self.read_state(et))) {
            Some(state) => Ok(state),
            None => self.read_state(et),
        }
    }

    fn read_state(&self, et: Et) -> Result<State> {
        let state = self
            .cspice()
            .geometric_state(self.spacecraft.naif, et.seconds(), NAIF_MARS)?;
        self.finite("position or velocity", &self.spacecraft.name, et, state)
    }

    /// State of the spacecraft as seen from the centre of Mars, corrected for light time and aberration (`LT+S`).
    ///
    /// The geometry uses it only where a run follows the convention of ISIS and ALE.
    ///
    /// # Errors
    /// As [`Self::state`].
    pub fn apparent_state(&self, et: Et) -> Result<State> {
        let tabulated = self.tabulated.as_ref();
        match tabulated.and_then(|states| states.apparent(et, |et| self.read_apparent_state(et))) {
            Some(state) => Ok(state),
            None => self.read_apparent_state(et),
        }
    }

    fn read_apparent_state(&self, et: Et) -> Result<State> {
        let state = orbiter_seen_from_mars(
            self.cspice(),
            &self.loaded.mars_acceleration,
            self.spacecraft.naif,
            et.seconds(),
        )?;
        self.finite(
            "apparent position or velocity",
            &self.spacecraft.name,
            et,
            state,
        )
    }

    /// Geometric state of Mars relative to the barycentre of the solar system.
    ///
    /// # Errors
    /// As [`Self::state`].
    pub fn mars_state(&self, et: Et) -> Result<State> {
        let state =
            self.cspice()
                .geometric_state(NAIF_MARS, et.seconds(), NAIF_SOLAR_SYSTEM_BARYCENTRE)?;
        self.finite("position or velocity", "Mars", et, state)
    }

    /// State of the Sun as seen from the centre of Mars (`LT+S`).
    ///
    /// # Errors
    /// [`SpiceError::NoSun`] when the kernels do not hold the Sun when its light left; as [`Self::state`].
    pub fn sun_state(&self, et: Et) -> Result<State> {
        let state = seen_from_mars(self.cspice(), NAIF_SUN, et.seconds()).map_err(|error| {
            if error.is_coverage() {
                let utc = self.et_to_utc(et).unwrap_or_else(|_| "unknown".to_owned());
                SpiceError::NoSun { seen: et, utc }
            } else {
                error
            }
        })?;
        self.finite("apparent position or velocity", "the Sun", et, state)
    }

    /// The state in metres; a non-finite one is rejected with the kernel that causes it.
    fn finite(&self, what: &str, of: &str, et: Et, state_km: StateKm) -> Result<State> {
        let state = State::from_km(state_km);
        let finite = all_finite(state.position.xyz_m.as_slice())
            && all_finite(state.velocity_m_s.as_slice());
        if finite {
            return Ok(state);
        }
        let origin = origin::of_state(self.kernels(), self.cspice(), et);
        Err(self.not_finite(format!("{what} of {of}"), et, origin))
    }

    fn not_finite(&self, what: String, instant: Et, origin: Option<Origin>) -> Error {
        let utc = self.et_to_utc(instant);
        let part = origin.as_ref().map(|origin| origin.part);
        let failure = Error::from(SpiceError::NotFinite {
            what,
            instant,
            utc: utc.unwrap_or_else(|_| "unknown".to_owned()),
            part: part.map_or_else(String::new, |part| format!(", in the interval {part}")),
        });
        match origin {
            Some(origin) => failure.in_file(origin.path),
            None => failure,
        }
    }

    /// Attitude of the bus at `exposure`, read from the C-kernel at `lookup`.
    ///
    /// * `lookup` – made by [`areograph_base::time::PointingBias::lookup`] from the same exposure
    /// * `tolerance_s` – largest distance from its intervals at which the C-kernel may be read, seconds
    ///
    /// # Errors
    /// [`SpiceError::NoAttitude`] when there is no attitude with rates within the tolerance;
    /// [`SpiceError::NotFinite`] with the kernel that holds NaN or an infinity;
    /// [`SpiceError::MissingText`] without a clock or leap seconds.
    pub fn attitude(&self, lookup: CkLookup, exposure: Et, tolerance_s: f64) -> Result<Attitude> {
        let kernel_time = lookup.kernel_time();
        let ticks = self.et_to_ticks(kernel_time)?;
        // Without a tolerance, the attitude belongs to the requested instant, and no distance has to be converted.
        let is_exact = tolerance_s.abs() <= 0.0;
        let ticks_per_s = if is_exact {
            1.0
        } else {
            self.et_to_ticks(kernel_time.plus(1.0))? - ticks
        };
        let pointing = self
            .cspice()
            .pointing(self.spacecraft.bus, ticks, tolerance_s * ticks_per_s)?
            .ok_or_else(|| SpiceError::NoAttitude {
                of: self.whom(KernelRole::Ck),
                kernel_time,
                tolerance_s,
            })?;
        let rows = pointing.matrix.as_flattened();
        let rates = &pointing.angular_velocity_rad_s;
        if !(all_finite(rows) && all_finite(rates) && pointing.ticks.is_finite()) {
            let reach_s = tolerance_s.max(0.0);
            let bus = self.spacecraft.bus;
            let (set, cspice) = (self.kernels(), self.cspice());
            let origin = origin::of_attitude(set, cspice, bus, kernel_time, reach_s);
            let what = format!("attitude or attitude rate of {}", self.spacecraft.name);
            return Err(self.not_finite(what, kernel_time, origin));
        }
        Ok(Attitude {
            inertial_to_bus: Rotation::new(matrix(&pointing.matrix), exposure),
            angular_velocity_rad_s: Vector3::from(pointing.angular_velocity_rad_s),
            distance_s: (pointing.ticks - ticks).abs() / ticks_per_s,
        })
    }

    /// Encoded clock of the spacecraft, ticks.
    ///
    /// # Errors
    /// As [`Self::et_to_sclk`].
    pub fn et_to_ticks(&self, et: Et) -> Result<f64> {
        let ticks = self
            .cspice()
            .et_to_ticks(self.spacecraft.naif, et.seconds());
        Ok(ticks.map_err(|error| self.explain(error, &clocks(self.spacecraft)))?)
    }

    /// Mounting of `instrument` by the loaded kernels, converted to its camera axes; that of its calibration, if it is
    /// calibrated.
    ///
    /// # Errors
    /// [`SpiceError::MissingText`] when no loaded kernel defines the two frames.
    pub fn mounting(
        &self,
        instrument: &Instrument,
        et: Et,
    ) -> Result<Rotation<SpacecraftBus, CameraFrame>> {
        if instrument.calibration.is_some() {
            return Ok(Rotation::new(bus_to_camera(&instrument.mounting), et));
        }
        let frames = [&instrument.naif.bus_frame, &instrument.naif.frame]
            // A name with a zero byte is truncated there, and then no kernel defines it.
            .map(|name| CString::new(name.split('\0').next().unwrap_or_default()))
            .map(std::result::Result::unwrap_or_default);
        let rows = self.loaded.mountings.rows(self.cspice(), frames, et);
        let rows = rows.map_err(|error| {
            let needs = [camera_frame(instrument), bus_frame(instrument.spacecraft)];
            self.explain(error, &needs)
        })?;
        let turn = frame_rotation_3(instrument.naif.turn_rad);
        Ok(Rotation::new(turn * matrix(&rows), et))
    }

    /// Matrix from J2000 to the frame of `body` in the loaded planetary constants, to identify the IAU report they
    /// follow.
    ///
    /// # Errors
    /// [`SpiceError::Spice`] when no planetary constants of the body are loaded.
    pub fn body_matrix(&self, body: Body, et: Et) -> Result<Matrix3<f64>> {
        // The name is one of the program's own.
        let frame = CString::new(&*body.naif().pck_frame).unwrap_or_default();
        let rows = self.cspice().frame_matrix(c"J2000", &frame, et.seconds())?;
        Ok(matrix(&rows))
    }
}

fn matrix(rows: &Rows) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}
