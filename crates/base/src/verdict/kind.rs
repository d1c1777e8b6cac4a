//! Kinds of checks of sites, nets, calibrations and matches.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of a check. Checks of independent data come first, then those of data used in the result, then those of the
/// mutual agreement of images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum CheckKind {
    /// A contradiction without a value, which the reasons describe.
    Contradiction,
    /// Footprints in the windows.
    Footprints,
    /// A requested adjustment.
    AdjustmentMade,
    /// Median height of tie points above the MOLA surface, with the orientation from the kernels.
    HeightBefore,
    /// Mean difference between the surfaces of two profiles, in standard deviations.
    ProfilesApart,
    /// Mean of range minus distance of a profile, without outliers.
    RangeMean,
    /// Mean distance between the spacecraft positions in the PEDR file and in the kernels.
    OrbitsApart,
    /// Mean of range minus distance to the spacecraft position in the PEDR file.
    Decoding,
    /// Share of outliers among the ranges of a profile.
    RangeOutliers,
    /// Number of shots in the longest profile.
    Shots,
    /// Difference between the clock correction that minimises the spread of the ranges and the configured correction.
    ClockCorrection,
    /// Number of simultaneous footprints inside an image, among those expected from the mountings of camera and laser.
    FootprintsInside,
    /// Distance between the spacecraft positions in support data and in the altimeter file.
    SupportPosition,
    /// Along-track angle between the beam in the altimeter file and its mounting according to the image attitudes.
    BeamAlong,
    /// Across-track angle between the beam in the altimeter file and its mounting according to the image attitudes.
    BeamAcross,
    /// Number of epochs of an image at which the boresight meets the body.
    BoresightMeets,
    /// Median height of adjusted tie points above the MOLA surface, which a default adjustment uses.
    HeightAfter,
    /// Share of tie points that lie more than 3.29 standard deviations from the MOLA surface, or were rejected for
    /// their height.
    HeightOutliers,
    /// Standard deviation of the mean height of the adjusted tie points.
    HeightSigma,
    /// Share of the common ground for which a terrain model has heights.
    SurfaceFilled,
    /// Median height of the altimeter shots above a terrain model.
    SurfaceHeight,
    /// Robust spread of the altimeter shots about a terrain model, in standard deviations.
    SurfaceSpread,
    /// Number of images with a tie point in the adjustment.
    ImagesJoined,
    /// Number of image pairs with tie points in the adjustment.
    PairsJoined,
    /// Along-track parallax of two images at their tie points, adjusted orientation.
    ParallaxAfter,
    /// Along-track parallax of two images at their tie points, orientation from the kernels.
    ParallaxBefore,
    /// Standard deviation of unit weight of tie points along the track.
    TieResidualsAlong,
    /// Standard deviation of unit weight of tie points across the track.
    TieResidualsAcross,
    /// Standard deviation of unit weight of another kind of observation, the largest relative to the limit for chance.
    VarianceComponents,
    /// Share of the tie points not used in the adjustment.
    TiesRejected,
    /// Number of tie points used in the adjustment.
    TiesUsed,
    /// Largest orientation correction of an image, in a priori standard deviations.
    Correction,
    /// Largest standardised correction of an unknown of laser, profiles or line times on a common bus.
    Boresight,
    /// Extrapolation of the attitude of an image beyond the permitted time, which the reasons state in a
    /// sentence.
    Attitude,
    /// RMSE of the second-order polynomials of position.
    PositionRmse,
    /// RMSE of the second-order polynomials of the rotation vector.
    PointingRmse,
    /// Interpolation error of the camera tables between their nodes.
    TableError,
    /// Number of skipped records.
    SkippedRecords,
    /// Root mean square horizontal residual of laser control withheld from a calibration, divided by its expected
    /// value.
    HeldBackPlane,
    /// Root mean square height residual of laser control withheld from a calibration, divided by its expected value.
    HeldBackHeight,
    /// Root mean square horizontal residual of laser control used in a calibration, divided by its expected value.
    ControlPlane,
    /// Root mean square height residual of laser control used in a calibration, divided by its expected value.
    ControlHeight,
    /// Increase, due to a calibration, of the residuals of control of an orbit that the calibration does not use, in
    /// standard deviations.
    OtherOrbits,
    /// Standard deviation of a tie point in plan after a calibration; the limit is the a priori standard deviation.
    PlaceKnown,
    /// Standard deviation of a tie point in height after a calibration; the limit is the a priori standard deviation.
    HeightKnown,
    /// Root mean square residual of tie points between the lines of a camera.
    LinesAgree,
    /// Shift of the image of a camera due to a calibration.
    CameraMoved,
    /// Share of the tie points that a calibration rejected.
    TiesLeftOut,
    /// Share of the control that a calibration rejected.
    ControlLeftOut,
    /// Median shift of the units in the last round of a calibration.
    RoundShift,
    /// Change of the control residuals in the last round of a calibration.
    RoundControl,
    /// Root mean square of model minus laser at shots withheld from a match, bias removed.
    HeldOutShots,
    /// Number of units of laser shots that were matched and kept.
    UnitsKept,
    /// Share of the matched units that agree with each other.
    UnitsAgree,
    /// Median height of the terrain model above the laser points.
    ModelBias,
    /// Number of redundant equations of a net.
    Redundancy,
    /// Share of the measurements of a net that were rejected as blunders.
    MeasurementsRemoved,
    /// Share of used measurements beyond 3.5 robust standard deviations.
    MeasurementsFlagged,
    /// Number of controls of a net that were kept.
    ControlsKept,
    /// Number of controls of a net that were rejected.
    ControlsRefused,
    /// Misfit of bricks at their seams.
    Seams,
    /// Relative difference between the scale of a picture from the controls and its stated scale.
    PictureScale,
    /// Stretch of the controls of a net relative to the pictures.
    ControlStretch,
    /// Mean offset of the control of an orbit that a calibration does not use, in standard deviations of one point.
    OtherOrbitsOffset,
    /// Share of withheld profile stretches outside their stated 99.7 % interval.
    WithheldStretches,
    /// Share of missing shots among the pulses of a profile.
    ShotsMissing,
}

impl CheckKind {
    /// Name of the check, with terms of the site in braces.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Contradiction => "Inputs consistent",
            Self::Footprints => "Footprints in the windows",
            Self::AdjustmentMade => "Adjustment converged",
            Self::HeightAfter => "Tie points above {altimeter}, adjusted (median)",
            Self::HeightBefore => "Tie points above {altimeter}, before (median)",
            Self::HeightOutliers => "Tie points more than 3.29 σ from {altimeter}",
            Self::ProfilesApart => "Disagreement of {altimeter} profiles",
            Self::WithheldStretches => "Withheld profiles outside the stated 99.7 % interval",
            Self::SurfaceFilled => "Terrain model, completeness",
            Self::SurfaceHeight => "{altimeter} above the terrain model (median)",
            Self::SurfaceSpread => "Spread of {altimeter} about the terrain model",
            Self::ImagesJoined => "Images joined by tie points",
            Self::PairsJoined => "Pairs joined by tie points",
            Self::HeightSigma => "Uncertainty of the mean height",
            Self::RangeMean => "Range − distance (mean)",
            Self::OrbitsApart => "Orbit in the {shot_source} against kernels",
            Self::Decoding => "Range − distance, orbit in the {shot_source}",
            Self::RangeOutliers => "Outliers among ranges",
            Self::Shots => "Shots in the longest profile",
            Self::ShotsMissing => "Missing shots of a profile",
            Self::ClockCorrection => "Clock correction, best − configured",
            Self::FootprintsInside => "Simultaneous footprints in the image",
            Self::SupportPosition => "Position in support data against the {shot_source}",
            Self::BeamAlong => "Laser beam against its mounting, along track",
            Self::BeamAcross => "Laser beam against its mounting, across track",
            Self::BoresightMeets => "Boresight intersects the body (epochs)",
            Self::ParallaxAfter => "Along-track parallax, adjusted",
            Self::ParallaxBefore => "Along-track parallax, before",
            Self::TieResidualsAlong => "Tie residuals along track",
            Self::TieResidualsAcross => "Tie residuals across track",
            Self::VarianceComponents => "Variance component, other observations",
            Self::TiesRejected => "Tie points rejected",
            Self::TiesUsed => "Tie points used",
            Self::Correction => "Largest orientation correction",
            Self::Boresight => "Laser against its mounting",
            Self::Attitude => "Attitude covered",
            Self::PositionRmse => "Position model, RMSE",
            Self::PointingRmse => "Pointing model, RMSE",
            Self::TableError => "Camera table, interpolation error",
            Self::SkippedRecords => "Records skipped",
            Self::HeldBackPlane => "Withheld control, plan residual / expected (RMS)",
            Self::HeldBackHeight => "Withheld control, height error",
            Self::ControlPlane => "Control used, plan error",
            Self::ControlHeight => "Control used, height error",
            Self::OtherOrbits => "Control of other orbits, degradation",
            Self::PlaceKnown => "Tie point uncertainty in plan",
            Self::HeightKnown => "Tie point uncertainty in height",
            Self::LinesAgree => "Tie points between lines",
            Self::CameraMoved => "Image shift due to the calibration",
            Self::TiesLeftOut => "Tie points rejected by the calibration",
            Self::ControlLeftOut => "Control rejected by the calibration",
            Self::RoundShift => "Unit shift in the last round (median)",
            Self::RoundControl => "Control residuals, change in the last round",
            Self::HeldOutShots => "Withheld shots, model − laser",
            Self::UnitsKept => "Units kept",
            Self::UnitsAgree => "Matched units that agree",
            Self::ModelBias => "Model above the laser (median)",
            Self::Redundancy => "Redundancy",
            Self::MeasurementsRemoved => "Measurements rejected as blunders",
            Self::MeasurementsFlagged => "Measurements beyond 3.5 robust σ",
            Self::ControlsKept => "Controls kept",
            Self::ControlsRefused => "Controls rejected",
            Self::Seams => "Misfit of bricks at their seams",
            Self::PictureScale => "Scale of a picture against metres_per_unit",
            Self::ControlStretch => "Stretch of the controls",
            Self::OtherOrbitsOffset => "Control of other orbits, mean offset",
        }
    }

    /// Unit of value and limit; empty for a count or without values.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::HeightAfter
            | Self::HeightBefore
            | Self::HeightSigma
            | Self::SurfaceHeight
            | Self::RangeMean
            | Self::OrbitsApart
            | Self::SupportPosition
            | Self::Decoding
            | Self::ParallaxAfter
            | Self::ParallaxBefore
            | Self::PositionRmse
            | Self::PlaceKnown
            | Self::HeightKnown
            | Self::HeldOutShots
            | Self::ModelBias
            | Self::Seams => "m",
            Self::HeightOutliers
            | Self::RangeOutliers
            | Self::ShotsMissing
            | Self::WithheldStretches
            | Self::SurfaceFilled
            | Self::TiesRejected
            | Self::TiesLeftOut
            | Self::ControlLeftOut
            | Self::UnitsAgree
            | Self::RoundControl
            | Self::MeasurementsRemoved
            | Self::MeasurementsFlagged
            | Self::PictureScale
            | Self::ControlStretch => "%",
            Self::ProfilesApart
            | Self::SurfaceSpread
            | Self::TieResidualsAlong
            | Self::TieResidualsAcross
            | Self::VarianceComponents
            | Self::Correction
            | Self::Boresight
            | Self::HeldBackPlane
            | Self::HeldBackHeight
            | Self::ControlPlane
            | Self::ControlHeight
            | Self::OtherOrbits
            | Self::OtherOrbitsOffset => "σ",
            Self::BeamAlong | Self::BeamAcross => "mrad",
            Self::RoundShift => "cells",
            Self::ClockCorrection => "s",
            Self::PointingRmse => "″",
            Self::TableError | Self::LinesAgree | Self::CameraMoved => "px",
            Self::Contradiction
            | Self::Footprints
            | Self::FootprintsInside
            | Self::BoresightMeets
            | Self::AdjustmentMade
            | Self::ImagesJoined
            | Self::PairsJoined
            | Self::Shots
            | Self::TiesUsed
            | Self::Attitude
            | Self::SkippedRecords
            | Self::UnitsKept
            | Self::Redundancy
            | Self::ControlsKept
            | Self::ControlsRefused => "",
        }
    }

    /// Whether the limit is a lower limit.
    #[must_use]
    pub const fn at_least(self) -> bool {
        matches!(
            self,
            Self::Footprints
                | Self::FootprintsInside
                | Self::BoresightMeets
                | Self::ImagesJoined
                | Self::PairsJoined
                | Self::Shots
                | Self::SurfaceFilled
                | Self::TiesUsed
                | Self::UnitsKept
                | Self::UnitsAgree
                | Self::Redundancy
                | Self::ControlsKept
        )
    }

    /// Whether values have a sign, and the limit applies to both.
    #[must_use]
    pub const fn is_signed(self) -> bool {
        matches!(
            self,
            Self::HeightAfter
                | Self::HeightBefore
                | Self::SurfaceHeight
                | Self::RangeMean
                | Self::Decoding
                | Self::ClockCorrection
                | Self::BeamAlong
                | Self::BeamAcross
                | Self::ParallaxAfter
                | Self::ParallaxBefore
                | Self::ProfilesApart
                | Self::ModelBias
        )
    }

    /// Decimals of a value that is not near its limit.
    pub(super) const fn least_decimals(self, is_small: bool) -> usize {
        match self {
            Self::ParallaxAfter | Self::PointingRmse if is_small => 2,
            Self::ClockCorrection | Self::TableError => 4,
            Self::RangeMean
            | Self::Decoding
            | Self::BeamAlong
            | Self::BeamAcross
            | Self::PositionRmse
            | Self::LinesAgree
            | Self::VarianceComponents
            | Self::HeldBackPlane
            | Self::HeldBackHeight
            | Self::ControlPlane
            | Self::ControlHeight
            | Self::OtherOrbitsOffset
            | Self::RoundShift => 2,
            _ => 1,
        }
    }
}
