//! Quantities of a record that are compared with its neighbours, their units and tolerances.

use super::Record;
use areograph_base::units::METRES_PER_CM;

/// A quantity that is compared with neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Areocentric latitude of the spacecraft.
    SpacecraftLatitude,
    /// East longitude of the spacecraft.
    SpacecraftLongitude,
    /// Its distance from the centre of Mars.
    SpacecraftRadius,
    /// Areocentric latitude of the ground.
    GroundLatitude,
    /// East longitude of the ground.
    GroundLongitude,
    /// Radius of the areoid.
    AreoidRadius,
    /// Crossover residual.
    Crossover,
    /// Off-nadir angle.
    OffNadir,
    /// Frequency of the clock.
    Frequency,
    /// Orbit number.
    Orbit,
    /// Time, by the spacecraft's motion.
    Time,
}

impl Quantity {
    /// Its name in messages.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::SpacecraftLatitude => "spacecraft latitude (with its change over the frame)",
            Self::SpacecraftLongitude => "spacecraft longitude (with its change over the frame)",
            Self::SpacecraftRadius => "spacecraft radius (with its change over the frame)",
            Self::GroundLatitude => "ground latitude (with its change over the frame)",
            Self::GroundLongitude => "ground longitude (with its change over the frame)",
            Self::AreoidRadius => "areoid radius (with its change over the frame)",
            Self::Crossover => "crossover residual",
            Self::OffNadir => "off-nadir angle",
            Self::Frequency => "clock frequency",
            Self::Orbit => "orbit number",
            Self::Time => "time",
        }
    }

    /// The unit of its value.
    pub(super) const fn unit(self) -> &'static str {
        match self {
            Self::SpacecraftLatitude
            | Self::SpacecraftLongitude
            | Self::GroundLatitude
            | Self::GroundLongitude
            | Self::OffNadir => "degrees",
            Self::SpacecraftRadius | Self::AreoidRadius | Self::Crossover => "m",
            Self::Frequency => "Hz",
            Self::Orbit => "by its count",
            Self::Time => "s",
        }
    }

    /// The unit of deviations between neighbours.
    pub(super) const fn step_unit(self) -> &'static str {
        match self {
            Self::OffNadir | Self::Time => "degrees",
            Self::Frequency => "Hz",
            Self::Orbit => "revolutions",
            _ => "m",
        }
    }

    /// Largest deviation of a valid record from its neighbour's extrapolation.
    ///
    /// The spacecraft flies a smooth orbit. The beam rotates irregularly, by less than 0.04° from one frame to the
    /// next. The areoid is a smooth surface and the residual a smooth function of time; a quartz oscillator does not
    /// jump by 1e-4.
    ///
    /// In the units of `step_unit`, from one frame to the next.
    pub(super) const fn limit(self) -> f64 {
        match self {
            Self::SpacecraftLatitude | Self::SpacecraftLongitude => 100.0,
            Self::SpacecraftRadius => 20.0,
            Self::GroundLatitude | Self::GroundLongitude => 300.0,
            Self::AreoidRadius => 5.0,
            Self::Crossover => 10.0,
            Self::OffNadir => 0.5,
            Self::Frequency => 1e4,
            Self::Orbit => 1.5,
            Self::Time => 0.2,
        }
    }

    /// Whether it depends on the rotation of the beam, so that the limit grows with time.
    pub(super) const fn is_of_beam(self) -> bool {
        matches!(
            self,
            Self::GroundLatitude | Self::GroundLongitude | Self::OffNadir
        )
    }

    /// The value of a record.
    pub(super) fn of(self, record: &Record) -> f64 {
        let degrees = |microdegrees: i32| f64::from(microdegrees) * 1e-6;
        match self {
            Self::SpacecraftLatitude => degrees(record.spacecraft_latitude_microdegrees.get()),
            Self::SpacecraftLongitude => degrees(record.spacecraft_longitude_microdegrees.get()),
            Self::SpacecraftRadius => f64::from(record.spacecraft_radius_cm.get()) * METRES_PER_CM,
            Self::GroundLatitude => degrees(record.ground_latitude_microdegrees.get()),
            Self::GroundLongitude => degrees(record.ground_longitude_microdegrees.get()),
            Self::AreoidRadius => f64::from(record.areoid_radius_cm.get()) * METRES_PER_CM,
            Self::Crossover => f64::from(record.crossover_residual_cm.get()) * METRES_PER_CM,
            Self::OffNadir => degrees(record.off_nadir_microdegrees.get()),
            Self::Frequency => f64::from(record.clock_frequency_hz.get()),
            Self::Orbit => f64::from(record.orbit.get()),
            Self::Time => record.time_s.get(),
        }
    }
}
