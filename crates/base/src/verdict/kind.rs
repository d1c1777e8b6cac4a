//! Kinds of checks of sites, nets, calibrations and matches.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of a check: independent data first, then data that entered the result, then the agreement of images with each
/// other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum CheckKind {
    /// A contradiction without a number: described in the reasons.
    Contradiction,
    /// Footprints in the windows.
    Footprints,
    /// A requested adjustment.
    AdjustmentMade,
    /// Median height of tie points above the MOLA surface, with the orientation from the kernels.
    HeightBefore,
    /// Mean difference of the surfaces of two profiles, in standard deviations.
    ProfilesApart,
    /// Mean of range minus distance of a profile, without outliers.
    RangeMean,
    /// Mean distance between the spacecraft positions of the PEDR file and of the kernels.
    OrbitsApart,
    /// Mean of range minus distance to the spacecraft position of the PEDR file itself.
    Decoding,
    /// Share of outliers among the ranges of a profile.
    RangeOutliers,
    /// Shots of the longest profile.
    Shots,
    /// Clock correction of least spread minus the configured one.
    ClockCorrection,
    /// Footprints of simultaneous shots in an image, of those that the mountings of camera and laser place in it.
    FootprintsInside,
    /// Distance between the spacecraft of support data and of the altimeter's file.
    SupportPosition,
    /// Angle along the track between the beam in the altimeter's file and its mounting by the attitude of the images.
    BeamAlong,
    /// The same across the track.
    BeamAcross,
    /// Epochs of an image at which its boresight meets the body.
    BoresightMeets,
    /// Median height of tie points above the MOLA surface, adjusted: MOLA is part of a default adjustment.
    HeightAfter,
    /// Share of tie points that lie farther from the MOLA surface than 3.29 of their standard deviations, or were
    /// rejected for it.
    HeightOutliers,
    /// Standard deviation of the mean height of the adjusted tie points.
    HeightSigma,
    /// Share of the common ground with heights in a terrain model.
    SurfaceFilled,
    /// Median height of the altimeter's shots above a terrain model.
    SurfaceHeight,
    /// Robust spread of the shots about a terrain model, in their standard deviations.
    SurfaceSpread,
    /// Images with a tie point in the adjustment.
    ImagesJoined,
    /// Pairs of images whose tie points were used in the adjustment.
    PairsJoined,
    /// Distance along the flight between two images at their tie points, adjusted.
    ParallaxAfter,
    /// The same with the orientation from the kernels.
    ParallaxBefore,
    /// Standard deviation of unit weight of tie points along the track.
    TieResidualsAlong,
    /// The same across the track.
    TieResidualsAcross,
    /// Standard deviation of unit weight of the other kinds of observation, the one that exceeds most of what chance
    /// explains.
    VarianceComponents,
    /// Share of the tie points not used in the adjustment.
    TiesRejected,
    /// Tie points used in the adjustment.
    TiesUsed,
    /// Largest correction of an image, in a priori standard deviations.
    Correction,
    /// Boresight of the laser or position of a profile, by the images of a common bus, in standard deviations.
    Boresight,
    /// Time by which the attitude of an image is extrapolated beyond the permitted time: a sentence among the
    /// reasons.
    Attitude,
    /// RMSE of the second-order polynomials of position.
    PositionRmse,
    /// RMSE of the second-order rotation vector.
    PointingRmse,
    /// Error of the camera tables between their nodes.
    TableError,
    /// Records that could not be read.
    SkippedRecords,
    /// Error in plan of laser control withheld from a calibration, over the expected error.
    HeldBackPlane,
    /// The same in height.
    HeldBackHeight,
    /// Error in plan of laser control used by a calibration, over the expected error.
    ControlPlane,
    /// The same in height.
    ControlHeight,
    /// Degradation of the control of an orbit that was not used in a calibration, in standard deviations.
    OtherOrbits,
    /// Standard deviation of a tie point in plan after a calibration, over the a priori one.
    PlaceKnown,
    /// The same in height.
    HeightKnown,
    /// Root mean square of the residuals of tie points between the lines of a camera.
    LinesAgree,
    /// Shift of the image of a camera by a calibration.
    CameraMoved,
    /// Share of the tie points that a calibration left out.
    TiesLeftOut,
    /// Share of its control.
    ControlLeftOut,
    /// Median shift of the units of the last round of a calibration.
    RoundShift,
    /// Change of the residuals of control in that round.
    RoundControl,
    /// Laser shots withheld from a match: root mean square of model minus laser, bias removed.
    HeldOutShots,
    /// Units of laser shots that were matched and kept.
    UnitsKept,
    /// Share of the matching units that agree with each other.
    UnitsAgree,
    /// Terrain model above the laser.
    ModelBias,
    /// Redundant equations of a net, by which its measurements test each other.
    Redundancy,
    /// Share of the measurements of a net that were left out as blunders.
    MeasurementsRemoved,
    /// Share of used measurements beyond 3.5 robust standard deviations.
    MeasurementsFlagged,
    /// Controls of a net that were kept.
    ControlsKept,
    /// Controls of a net that were left out.
    ControlsRefused,
    /// Differences of bricks at their seams.
    Seams,
    /// Scale of a picture by the controls against its stated scale.
    PictureScale,
    /// Stretch of the controls of a net against its pictures.
    ControlStretch,
    /// Mean offset of the control of an orbit that was not used in a calibration, in standard deviations of one point.
    OtherOrbitsOffset,
    /// Share of withheld stretches of profiles beyond the interval that contains 99.7 % of them as stated.
    WithheldStretches,
    /// Share of the pulses of a profile that have no shot.
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
            Self::HeightOutliers => "Tie points beyond 3.29 σ of {altimeter}",
            Self::ProfilesApart => "Disagreement of {altimeter} profiles",
            Self::WithheldStretches => "Withheld profiles beyond the stated 99.7 %",
            Self::SurfaceFilled => "Terrain model, completeness",
            Self::SurfaceHeight => "{altimeter} above the terrain model (median)",
            Self::SurfaceSpread => "Spread of {altimeter} about the terrain model",
            Self::ImagesJoined => "Images joined by tie points",
            Self::PairsJoined => "Pairs joined by tie points",
            Self::HeightSigma => "Uncertainty of the mean height",
            Self::RangeMean => "Range − distance (mean)",
            Self::OrbitsApart => "Orbit of the {shot_source} against kernels",
            Self::Decoding => "Range − distance, orbit of the {shot_source}",
            Self::RangeOutliers => "Outliers among ranges",
            Self::Shots => "Shots in the longest profile",
            Self::ShotsMissing => "Missing shots of a profile",
            Self::ClockCorrection => "Clock correction, best − configured",
            Self::FootprintsInside => "Simultaneous footprints in the image",
            Self::SupportPosition => "Position in support data against the {shot_source}",
            Self::BeamAlong => "Laser beam by the attitude, along track",
            Self::BeamAcross => "Laser beam by the attitude, across track",
            Self::BoresightMeets => "Boresight meets the body (epochs)",
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
            Self::HeldBackPlane => "Withheld control, error in plan",
            Self::HeldBackHeight => "Withheld control, error in height",
            Self::ControlPlane => "Control used, error in plan",
            Self::ControlHeight => "Control used, error in height",
            Self::OtherOrbits => "Control of other orbits, degradation",
            Self::PlaceKnown => "Tie point uncertainty in plan",
            Self::HeightKnown => "Tie point uncertainty in height",
            Self::LinesAgree => "Tie points between lines",
            Self::CameraMoved => "Image moved by the calibration",
            Self::TiesLeftOut => "Tie points left out",
            Self::ControlLeftOut => "Control left out",
            Self::RoundShift => "Units shifted in the last round (median)",
            Self::RoundControl => "Control, change in the last round",
            Self::HeldOutShots => "Withheld shots, model − laser",
            Self::UnitsKept => "Units kept",
            Self::UnitsAgree => "Matching units that agree",
            Self::ModelBias => "Model above the laser (median)",
            Self::Redundancy => "Redundancy",
            Self::MeasurementsRemoved => "Measurements left out as blunders",
            Self::MeasurementsFlagged => "Measurements beyond 3.5 robust σ",
            Self::ControlsKept => "Controls kept",
            Self::ControlsRefused => "Controls left out",
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
