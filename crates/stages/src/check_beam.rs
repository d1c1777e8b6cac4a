//! Attitude of images against the beam of a laser on the same bus.
//!
//! The altimeter's file states spacecraft and footprint of every shot, hence the direction of its beam, without the
//! C-kernel of the images. Rotated into the bus by the attitude of an image that was exposed at that instant, this
//! direction must agree with the laser's mounting. The nominal mountings of laser and camera also place the footprint
//! in the image, whatever the attitude: footprints that the orientation places elsewhere contradict it.
//!
//! This tests an error that tie points cannot show: a rotation common to all images.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    sync::atomic::AtomicBool,
};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::{
    convert_datum::Converted,
    group_profiles::Profile,
    oriented::OrientedImage,
    register::RegisteredPoints,
    site_image::SiteImages,
    tag_times::{ImageTimes, SupportFile},
};
use areograph_base::{
    altimetry::MolaClock,
    constants::GROUND_SPEED_M_S,
    error::Result,
    footprints::{Footprint, Footprints},
    frames::BodyFixed,
    instruments::Altimeter,
    time::Et,
};
use areograph_config::all_instruments;
use areograph_geom::{
    attitude::bus_to_camera,
    pushbroom::{CameraModel, Pose},
    range_residuals::{footprint, own_spacecraft, states_spacecraft},
    statistics::Summary,
};
use areograph_store::{
    stage::{Output, Stage},
    stage_inputs,
};

/// A footprint is expected in an image if the mountings place it this far from the edges, radians: 3.8 times 0.45 mrad,
/// the attitude, the boresight and the position of footprints together. The spot in a full line of the narrow-angle
/// camera is 1.8 mrad from its edge.
const EDGE_RAD: f64 = 1.7e-3;
/// A footprint is expected only this far from the ends of the exposure, seconds: 3.8 times 0.45 mrad are 0.3 s along
/// the track.
const END_S: f64 = 0.5;

/// The beam of the laser by the attitude of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageBeam {
    /// Identifier of the image.
    pub image: String,
    /// The comparison, or why there is none.
    pub beam: std::result::Result<Beam, BeamGap>,
}

/// Beam of the simultaneous shots of an image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Beam {
    /// Middle of the image, ET seconds.
    pub middle_et_s: f64,
    /// Shots that were fired while the image was exposed.
    pub shots: u32,
    /// Median angles from the mounting of the laser to the beam, radians: along the track (towards X of the bus) and
    /// across it (towards Y).
    pub angles_rad: [f64; 2],
    /// Their normalised median absolute deviations, radians.
    pub spread_rad: [f64; 2],
    /// Mean range, metres.
    pub range_m: f64,
    /// Median distance between the spacecraft of the altimeter's file and the perspective centre, metres.
    pub apart_m: f64,
    /// Rotation rate of the bus in inertial space, radians per second.
    pub turn_rad_s: f64,
    /// Bias of the altimeter's clock, seconds, whose sign and scope are not published.
    pub clock_s: f64,
    /// Shots whose footprints the mountings of camera and laser place in the delivered image.
    pub expected_inside: u32,
    /// Number of these that the orientation also places there.
    pub inside: u32,
}

/// Reasons why the attitude of an image is not compared with a beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BeamGap {
    /// Support data contain no attitude of the bus.
    Support,
    /// The image is not from the spacecraft with the laser.
    OtherSpacecraft,
    /// The altimeter file has no direction of the beam.
    NoBeam,
    /// No shot of the site falls within its exposure.
    NoShot,
    /// Shots of tables without spacecraft positions have no beam direction.
    NoPosition,
}

impl fmt::Display for BeamGap {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Support => "support data do not state the bus attitude",
            Self::OtherSpacecraft => "another spacecraft carries the laser",
            Self::NoBeam => "the altimeter file does not state the beam direction (beam.bus)",
            Self::NoShot => "no shot was fired during the exposure",
            Self::NoPosition => "the shots do not state the spacecraft position",
        })
    }
}

stage_inputs! {
    /// The images with the orientation from the kernels, footprints, and the laser.
    pub struct CheckBeam<'a> {
        /// The images.
        pub images: SiteImages<'a>,
        /// Footprints in the frame of the products.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// The altimeter.
        pub altimeter: &'a Altimeter,
        /// Its clock.
        pub altimeter_clock: &'a MolaClock,
    }
}

impl Stage for CheckBeam<'_> {
    const NAME: &'static str = "check_beam";
    type Output = Vec<ImageBeam>;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Vec<ImageBeam>> {
        let (footprints, profiles) = (&self.converted.value()?.footprints, self.profiles.value()?);
        let oriented = self.images.oriented()?;
        let images = self.images.0.iter().zip(&oriented).enumerate();
        let images = images.map(|(index, (image, oriented))| {
            let orientation = image.orientation.value()?;
            let placed = Placed {
                oriented,
                bus_to_camera: orientation.tables.bus_to_camera.matrix(),
                turn_rad_s: mean_rate(&orientation.tables.bus_angular_velocity_rad_s),
                points: &image.registration.value()?.points,
            };
            let shots = simultaneous(index, oriented.image, footprints, profiles);
            Ok(ImageBeam {
                image: oriented.image.id.clone(),
                beam: placed.beam(
                    footprints,
                    &shots,
                    self.altimeter,
                    self.altimeter_clock.bias_s,
                ),
            })
        });
        images.collect()
    }
}

/// Rows of the shots that were fired while the image with this index was exposed.
fn simultaneous(
    index: usize,
    image: &ImageTimes,
    footprints: &Footprints<BodyFixed>,
    profiles: &[Profile],
) -> BTreeSet<u32> {
    let exposures = image.exposures();
    let profiles = profiles.iter();
    let with_image = profiles.filter(|of| of.simultaneous.iter().any(|of| of.image == index));
    let rows = with_image.flat_map(|profile| profile.rows.iter().copied());
    rows.filter(|row| exposures.contains(Et::from_seconds(footprints.et_s.at(*row as usize))))
        .collect()
}

/// An image with its orientation and its footprints.
struct Placed<'a> {
    oriented: &'a OrientedImage<'a>,
    bus_to_camera: &'a Matrix3<f64>,
    turn_rad_s: f64,
    points: &'a RegisteredPoints,
}

impl Placed<'_> {
    fn beam(
        &self,
        footprints: &Footprints<BodyFixed>,
        shots: &BTreeSet<u32>,
        laser: &Altimeter,
        clock_s: f64,
    ) -> std::result::Result<Beam, BeamGap> {
        let image = self.oriented.image;
        match &image.support {
            Some(support) if !knows_bus(image, support) => return Err(BeamGap::Support),
            None if !image.has_laser() => return Err(BeamGap::OtherSpacecraft),
            _ => {}
        }
        let axes = laser.axes_in_bus().ok_or(BeamGap::NoBeam)?;
        if shots.is_empty() {
            return Err(BeamGap::NoShot);
        }
        let is_directed = |row: &u32| states_spacecraft(footprints, *row as usize);
        let shots: Vec<u32> = shots.iter().copied().filter(is_directed).collect();
        if shots.is_empty() {
            return Err(BeamGap::NoPosition);
        }
        let inside: BTreeMap<u32, bool> = (0..self.points.len())
            .map(|index| (self.points.row.at(index), self.points.inside.at(index)))
            .collect();
        let (mut angles_rad, mut ranges_m) = ([Vec::new(), Vec::new()], Vec::new());
        let mut apart_m = Vec::new();
        let (mut expected_inside, mut inside_count) = (0, 0);
        for row in &shots {
            let shot = footprints.row(*row as usize);
            let angles = self.angles_rad(&shot, &axes);
            for (column, angle) in angles_rad.iter_mut().zip(angles) {
                column.push(angle);
            }
            ranges_m.push(shot.range_m);
            apart_m.push((own_spacecraft(&shot).xyz_m - self.pose(&shot).position_m).norm());
            if self.is_expected(&shot, &axes) {
                expected_inside += 1;
                inside_count += u32::from(inside.get(row).is_some_and(|is| *is));
            }
        }
        let of_axes = angles_rad.each_ref().map(|column| Summary::of(column));
        Ok(Beam {
            middle_et_s: image.middle().seconds(),
            shots: u32::try_from(shots.len()).unwrap_or(u32::MAX),
            angles_rad: of_axes.map(|axis| axis.median),
            spread_rad: of_axes.map(|axis| axis.nmad),
            range_m: Summary::of(&ranges_m).mean,
            apart_m: Summary::of(&apart_m).median,
            turn_rad_s: self.turn_rad_s,
            clock_s,
            expected_inside,
            inside: inside_count,
        })
    }

    /// The camera at the instant of a shot.
    fn pose(&self, shot: &Footprint) -> Pose {
        let instant = Et::from_seconds(shot.et_s);
        let line = self.oriented.image.line_offset(instant);
        self.oriented.orientation(CameraModel::Samples).pose(line)
    }

    /// Angles of the beam of a shot from its mounting, along and across the track, by the attitude at its instant.
    ///
    /// # Accuracy
    /// Both positions come from the altimeter's file, so that its orbit cancels. Its body-fixed axes belong to the
    /// corrected instant: within the bias of the clock they rotate by 8e-6 rad.
    fn angles_rad(&self, shot: &Footprint, axes: &Matrix3<f64>) -> [f64; 2] {
        let beam_m = footprint(shot, shot.radius_m).xyz_m - own_spacecraft(shot).xyz_m;
        let in_camera = self.pose(shot).mars_to_camera * beam_m;
        let in_bus = self.bus_to_camera.tr_mul(&in_camera);
        let [along, across, beam] = [0, 1, 2].map(|axis| axes.column(axis).dot(&in_bus));
        [along.atan2(beam), across.atan2(beam)]
    }

    /// Whether the nominal mountings of laser and camera place the footprint in the delivered image.
    fn is_expected(&self, shot: &Footprint, axes: &Matrix3<f64>) -> bool {
        let image = self.oriented.image;
        let beam: Vector3<f64> = bus_to_camera(&image.instrument.mounting) * axes.column(2);
        let detector = image.detector();
        let is_on_line = [-EDGE_RAD, EDGE_RAD].iter().all(|edge_rad| {
            let edge = beam + Vector3::new(0.0, *edge_rad, 0.0);
            let focal_px = detector.focal_px(&edge);
            focal_px.is_ok_and(|px| (0.0..=detector.samples).contains(&detector.sample(px.y)))
        });
        let reach_s = END_S + (beam.x / beam.z).abs() * shot.range_m / GROUND_SPEED_M_S;
        let delivered = f64::from(image.lines_delivered);
        let ends = [0.0, delivered].map(|line| image.line_times.et(line).seconds());
        is_on_line && shot.et_s >= ends[0] + reach_s && shot.et_s <= ends[1] - reach_s
    }
}

/// Whether support data contain the attitude of the bus with the laser: they name its spacecraft and its frame.
fn knows_bus(image: &ImageTimes, support: &SupportFile) -> bool {
    let camera = &image.instrument;
    let mut cameras = all_instruments().iter();
    camera.spacecraft.has_laser()
        && support.is_of(camera.spacecraft)
        && cameras.any(|of| of.spacecraft.has_laser() && of.naif.bus == camera.naif.bus)
}

/// Mean rate of rotation, radians per second.
fn mean_rate(rates_rad_s: &[Vector3<f64>]) -> f64 {
    let sum: Vector3<f64> = rates_rad_s.iter().sum();
    sum.norm() / rates_rad_s.len().max(1) as f64
}
