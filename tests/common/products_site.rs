//! A small site made by hand: one orbit across the antimeridian, one image, one outlier.

use std::{collections::BTreeMap, path::Path, sync::atomic::AtomicBool};

use areograph::{
    altimetry::{BiasScope, DatumChoice, GroundRadius, MolaClock, ShotFilter, TagSign},
    body::Body,
    body::Datum,
    capabilities::declarations,
    column::Column,
    config::{
        KernelsConfig, OrientationConfig, PedrConfig, PointingConfig, ProductsConfig,
        RangeCheckConfig, ShotFormat, SiteConfig, WindowConfig, usual_instrument,
    },
    footprints::{Footprint, Footprints, SourceFile},
    frames::{BodyFixed, Frame, Position, Rotation},
    geom::{
        attitude::{OmegaPhiKappa, matrix_of_rotation_vector, matrix_of_spice_quaternion},
        ellipsoid::Spherical,
        light_time::LightTime,
        pushbroom::ExteriorOrientation,
        statistics::{Summary, Trend},
        window::WindowShape,
    },
    kernel_source::{KernelList, KernelSource},
    line_times::LineTimes,
    products::{ImageProducts, Program, SiteBook, SiteProducts, SiteStatements},
    spice::{KernelSet, RequiredCoverage},
    stage::{Output, Provenance, Round},
    stages::{
        check_profiles::{ProfileCheck, check_profiles},
        check_ranges::{BiasScan, ProfileRanges, RangeCheck, ScannedRadius, ShotResiduals},
        convert_datum::{Converted, FileConversion},
        describe_kernels::{KernelDescription, KernelLine},
        fit_sensor_model::{SensorModel, fit_sensor_model},
        group_profiles::{Profile, group_profiles},
        judge::{BeamEvidence, Evidence, JudgedImage, judge},
        register::{ImageRegistration, register},
        sample_orientation::{
            BoresightGround, CameraTables, GroundPoint, InterpolationCheck, LightTimeEffect,
            Orientation, OrientationSample, OtherConvention,
        },
        tag_times::{ImageTimes, StartFrom},
        tag_utc::ShotTimes,
    },
    store::book::{Book, Entered},
    time::{Et, Interval, Intervals},
    utc::Utc,
};
use areograph_testing::replace;
use nalgebra::{Matrix3, Vector3};

/// Shots of the profile; one in ten seconds lies on either side of the antimeridian.
pub(crate) const SHOTS: u32 = 60;
/// ET of the first shot and of the image, seconds.
pub(crate) const START_S: f64 = -11_224_002.182_053_322;

/// Owned parts of a site.
pub(crate) struct Site {
    pub(crate) config: SiteConfig,
    pub(crate) kernels: Vec<KernelLine>,
    pub(crate) required: RequiredCoverage,
    pub(crate) times: ImageTimes,
    pub(crate) orientation: Orientation,
    pub(crate) model: SensorModel,
    pub(crate) footprints: Footprints<BodyFixed>,
    pub(crate) utc: Column<Utc>,
    pub(crate) profiles: Vec<Profile>,
    pub(crate) ranges: RangeCheck,
    pub(crate) registration: ImageRegistration,
    pub(crate) rejected: BTreeMap<String, u64>,
    pub(crate) complaints: Vec<String>,
    pub(crate) notes: Vec<String>,
    pub(crate) warnings: Vec<String>,
    pub(crate) conversions: Vec<FileConversion>,
}

impl Site {
    pub(crate) fn small() -> Self {
        let config = config();
        let times = image_times();
        let orientation = orientation(&times);
        let footprints = footprints();
        let profiles = group_profiles(&footprints, &config.windows, std::slice::from_ref(&times));
        let model = fit_sensor_model(&orientation, &config.orientation, None).unwrap();
        // Shots and camera of this site have nothing to do with each other: without a move none would be seen.
        let mut seen = footprints.clone();
        move_under_the_camera(&mut seen, &model);
        let registration = register(
            &times,
            &orientation,
            &model,
            &seen,
            &profiles,
            &config.registration,
            &AtomicBool::new(false),
        )
        .unwrap();
        Self {
            kernels: vec![
                kernel("naif0012.tls", "LSK", None),
                kernel("nav.bsp", "SPK", Some(vec![seconds(-4e4, 4e4)])),
                // A gap of two seconds in what the image asks.
                kernel(
                    "sc.bc",
                    "CK",
                    Some(vec![seconds(-900.0, 1.0), seconds(3.0, 900.0)]),
                ),
            ],
            required: RequiredCoverage {
                positions: Intervals::union_of([seconds(-1.0, 8.0)]),
                attitudes: Intervals::union_of([seconds(-2.15, 6.0)]),
                ..RequiredCoverage::default()
            },
            warnings: Vec::new(),
            conversions: vec![FileConversion::default()],
            model,
            registration,
            utc: (0..footprints.len())
                .map(|row| {
                    let utc = format!("1999-08-24T14:12:{:06.3}", 13.0 + 0.1 * row as f64);
                    Utc::parse(&utc).unwrap()
                })
                .collect(),
            ranges: ranges(&profiles),
            rejected: BTreeMap::from([("class 0 <cloud>".to_owned(), 7)]),
            complaints: vec!["ap19019l.b record 4: <script>alert(1)</script> & more".to_owned()],
            notes: vec!["ap19019l.b: already in IAU 2000, not converted".to_owned()],
            config,
            times,
            orientation,
            footprints,
            profiles,
        }
    }

    /// The same site with its window, shots and image around the north pole, longitudes all round.
    #[allow(dead_code, reason = "not every test that shares this needs it")]
    pub(crate) fn polar() -> Self {
        let mut site = Self::small();
        site.config.windows[0].shape = WindowShape::Box {
            west_rad: 0.0,
            east_rad: std::f64::consts::TAU,
            south_rad: 1.45,
            north_rad: std::f64::consts::FRAC_PI_2,
        };
        // Up to the pole along one meridian and down along the opposite one.
        for k in 0..SHOTS {
            let row = k as usize;
            let from_pole_rad = 0.002 * (f64::from(k) - 29.5);
            let latitude_rad = std::f64::consts::FRAC_PI_2 - from_pole_rad.abs();
            let longitude_rad = if from_pole_rad < 0.0 { 1.0 } else { 4.2 };
            replace(&mut site.footprints.latitude_rad, row, latitude_rad);
            replace(&mut site.footprints.longitude_rad, row, longitude_rad);
        }
        site.orientation.outline = Some(
            [0.3, 1.9, 3.4, 5.0]
                .map(|longitude_rad| GroundPoint {
                    longitude_rad,
                    latitude_rad: 1.55,
                })
                .to_vec(),
        );
        site
    }

    /// The same site without shots and images.
    pub(crate) fn empty() -> Self {
        let mut site = Self::small();
        site.footprints = Footprints::new(site.footprints.files.clone());
        site.utc = Column::new();
        site.profiles.clear();
        site.ranges = ranges(&[]);
        site
    }

    fn profile_check(&self) -> ProfileCheck {
        let surface = &self.config.laser_surface;
        check_profiles(
            &self.footprints,
            &self.profiles,
            &surface.options(self.footprints.body),
        )
    }

    /// Calls `with` on the site as products want it, with or without its image.
    pub(crate) fn with<T>(&self, image: bool, with: impl FnOnce(&SiteProducts) -> T) -> T {
        let images = [ImageProducts {
            times: &self.times,
            orientation: &self.orientation,
            model: &self.model,
            registration: &self.registration,
        }];
        self.with_these(if image { &images } else { &[] }, with)
    }

    /// The same with so many copies of its image under other names, the last of which is invalid.
    #[allow(dead_code, reason = "not every test that shares this needs it")]
    pub(crate) fn with_copies<T>(&self, count: usize, with: impl FnOnce(&SiteProducts) -> T) -> T {
        self.with_changed_copies(count, |_, _| {}, with)
    }

    /// See [`Self::with_copies`]; `change` receives the index and the registration of every copy.
    pub(crate) fn with_changed_copies<T>(
        &self,
        count: usize,
        change: impl Fn(usize, &mut ImageRegistration),
        with: impl FnOnce(&SiteProducts) -> T,
    ) -> T {
        let copies = (0..count).map(|index| {
            let id = format!("M04-{index:05}");
            let (mut times, mut orientation) = (self.times.clone(), self.orientation.clone());
            let (mut model, mut registration) = (self.model.clone(), self.registration.clone());
            times.id.clone_from(&id);
            orientation.image.clone_from(&id);
            model.image.clone_from(&id);
            registration.image = id;
            change(index, &mut registration);
            if index + 1 == count {
                model.invalid_because.push("made so by hand".to_owned());
            }
            (times, orientation, model, registration)
        });
        let copies: Vec<_> = copies.collect();
        let images = copies.iter();
        let images = images.map(|(times, orientation, model, registration)| ImageProducts {
            times,
            orientation,
            model,
            registration,
        });
        self.with_these(&images.collect::<Vec<_>>(), with)
    }

    fn with_these<T>(&self, images: &[ImageProducts], with: impl FnOnce(&SiteProducts) -> T) -> T {
        let judged = images.iter().map(|image| JudgedImage {
            times: image.times,
            orientation: image.orientation,
            model: image.model,
        });
        let judged: Vec<JudgedImage> = judged.collect();
        let searched = !self.config.pedr.files.is_empty();
        let profile_check = self.profile_check();
        let verdict = judge(&Evidence {
            terms: self.config.terms(),
            footprints: searched.then_some(self.footprints.len()),
            ground: self.footprints.ground_choice(),
            ranges: &self.ranges,
            limits: &self.config.limits,
            rejected: &BTreeMap::new(),
            range_limits: &self.config.range_check,
            orientation_limits: &self.config.orientation,
            clock_correction_s: self.config.altimeter_clock.correction_s(),
            images: &judged,
            beam: BeamEvidence {
                images: &[],
                adjustment: &self.config.adjustment,
                surface: &self.config.laser_surface,
            },
            warnings: &self.warnings,
            complaints: &self.complaints,
            profiles: &profile_check,
            adjustment: None,
            findings: &[],
            adjustment_failure: None,
        });
        let mut book = Book::default();
        let kernels = KernelDescription {
            kernels: self.kernels.clone(),
            pck_note: None,
            rates_note: None,
        };
        book.enter_value("describe_kernels", kernels).unwrap();
        book.enter_value("required", self.required.clone()).unwrap();
        let converted = Converted {
            footprints: self.footprints.clone(),
            files: self.conversions.clone(),
            notes: Vec::new(),
        };
        book.enter_value("convert_datum", converted).unwrap();
        book.enter_value("tag_utc", ShotTimes(self.utc.clone()))
            .unwrap();
        book.enter_value("group_profiles", self.profiles.clone())
            .unwrap();
        book.enter_value("check_profiles", profile_check).unwrap();
        book.enter_value("check_ranges", self.ranges.clone())
            .unwrap();
        enter(&mut book, images, |image| image.times);
        enter(&mut book, images, |image| image.orientation);
        enter(&mut book, images, |image| image.model);
        enter(&mut book, images, |image| image.registration);
        let statements = SiteStatements {
            verdict,
            images_agree: false,
            rejected: self.rejected.clone(),
            complaints: self.complaints.clone(),
            notes: self.notes.clone(),
            program: Program {
                cspice: "CSPICE_N0067".to_owned(),
                methods: vec![("search_footprints".to_owned(), 2)],
            },
        };
        book.enter_value("statements", statements).unwrap();
        let site = SiteBook {
            config: &self.config,
            book: &book,
            kernels: &KernelSet::default(),
            folder: Path::new(""),
            declarations: declarations(),
        };
        site.with(|site| Ok(with(site))).unwrap()
    }
}

/// Enters a part of every image.
fn enter<'a, T: Entered + Clone>(
    book: &mut Book,
    images: &[ImageProducts<'a>],
    part: impl Fn(&ImageProducts<'a>) -> &'a T,
) {
    let nowhere = Provenance {
        blake3: String::new(),
        fingerprint: String::new(),
    };
    let outputs = images
        .iter()
        .map(|image| Output::known(String::new(), part(image).clone(), nowhere.clone()));
    book.enter_parts(Round::Initial, outputs.collect()).unwrap();
}

/// An interval in seconds from the first shot.
fn seconds(start_s: f64, stop_s: f64) -> Interval {
    Interval::new(
        Et::from_seconds(START_S + start_s),
        Et::from_seconds(START_S + stop_s),
    )
}

fn kernel(name: &str, role: &str, held: Option<Vec<Interval>>) -> KernelLine {
    KernelLine {
        name: name.to_owned(),
        role: role.to_owned(),
        bytes: 5257,
        blake3: "ab".repeat(32),
        held: held.map(Intervals::union_of),
        used: Vec::new(),
    }
}

fn config() -> SiteConfig {
    SiteConfig {
        site: "small".to_owned(),
        description: "One orbit & one image <made by hand>".to_owned(),
        file: "small.toml".into(),
        blake3: "ef".repeat(32),
        kernels: KernelsConfig {
            source: KernelSource::Listed(KernelList::Files(vec!["naif0012.tls".into()])),
            ..KernelsConfig::default()
        },
        pointing: PointingConfig {
            ck_bias: Some(usual_instrument().pointing_bias()),
            source: Some("mocAddendum004.ti".to_owned()),
        },
        altimeter_clock: MolaClock {
            bias_s: 0.117,
            sign: TagSign::Late,
            scope: BiasScope::SpkLookup,
            source: "Shan et al. 2005, data preparation".to_owned(),
        },
        pedr: PedrConfig {
            files: vec!["data/ap19019l.b".into()],
            datum: DatumChoice::Auto,
            crossover: GroundRadius::Corrected,
            filter: ShotFilter {
                classes: vec![1],
                channels: vec![1, 2, 3, 4],
                attitude_flags: vec![0],
                off_nadir_max_rad: 0.5,
                solar_longitude_rad: ShotFilter::ALL_SEASONS,
            },
        },
        windows: vec![WindowConfig {
            id: "antimeridian".to_owned(),
            shape: WindowShape::Box {
                west_rad: 3.1,
                east_rad: 3.2,
                south_rad: -0.3,
                north_rad: 0.0,
            },
        }],
        range_check: RangeCheckConfig {
            shots_min: 10,
            decoding_max_m: 1.0,
            scan_half_width_s: 0.3,
            scan_step_s: 0.1,
            ..RangeCheckConfig::default()
        },
        orientation: OrientationConfig {
            pointing_rmse_max_rad: 1e-4,
            ..OrientationConfig::default()
        },
        products: ProductsConfig {
            formats: ShotFormat::WORDS.map(|(_, format)| format).into(),
        },
        ..SiteConfig::default()
    }
}

/// Moves every footprint to where the camera looks, 40 lines apart; the last third lies beyond the image.
pub(crate) fn move_under_the_camera(footprints: &mut Footprints<BodyFixed>, model: &SensorModel) {
    let camera = model.rotation_vector_orientation();
    for row in 0..footprints.len() {
        let pose = camera.pose(line_offset(row));
        let boresight = pose.mars_to_camera.row(2).transpose();
        let ground = Spherical::from_xyz_m(&(pose.position_m + boresight * 380_000.0));
        replace(&mut footprints.radius_m, row, ground.radius_m);
        replace(&mut footprints.radius_crossover_m, row, ground.radius_m);
        replace(&mut footprints.latitude_rad, row, ground.latitude.0);
        replace(&mut footprints.longitude_rad, row, ground.longitude_rad);
    }
}

/// Line from the middle under which [`move_under_the_camera`] puts the footprint in `row`.
pub(crate) fn line_offset(row: usize) -> f64 {
    40.0 * (row as f64 - 20.0)
}

fn image_times() -> ImageTimes {
    ImageTimes {
        id: "m04-02852".to_owned(),
        body: Body::Mars,
        instrument: usual_instrument().clone(),
        line_times: LineTimes::even(Et::from_seconds(START_S), 1536, 8.0 * 0.000_482_1).unwrap(),
        start_from: StartFrom::Sclk,
        sclk_start: Some("619971158:28".to_owned()),
        utc_start: "1999-08-24T14:12:13.635".to_owned(),
        exposure_s: 0.000_482_1,
        downtrack_summing: 8,
        crosstrack_summing: 8,
        lines_delivered: 1280,
        samples: 256,
        first_detector: 0,
        has_stop_time: true,
        notes: vec!["256 of 1536 header lines are not in the delivered file".to_owned()],
        remarks: Vec::new(),
        support: None,
    }
}

/// A camera that moves along a slightly bent line, looks at Mars, flies along its −X and turns a little.
fn orientation(times: &ImageTimes) -> Orientation {
    let samples = (0..=30)
        .map(|k| {
            let et = times
                .line_times
                .start()
                .plus(f64::from(k) / 30.0 * times.duration_s());
            let u = f64::from(k) / 15.0 - 1.0;
            let angles = OmegaPhiKappa {
                omega_rad: 1.57 + 0.01 * u,
                phi_rad: -0.733 + 0.002 * u + 1e-6 * (5.0 * u).sin(),
                kappa_rad: 1.57 + 0.01 * u,
            };
            OrientationSample {
                et,
                line_offset: times.line_offset(et),
                position: Position::new(Vector3::new(
                    -3.7e6 + 10.0 * u * u,
                    1e4 * u,
                    -0.3e6 + 9e3 * u + 1e-3 * u * u * u,
                )),
                camera_to_mars: Rotation::new(angles.camera_to_mars(), et),
                angles,
                to_spacecraft_m: Vector3::zeros(),
                boresight: (k > 0).then(|| BoresightGround {
                    longitude_rad: 3.145 + 1e-4 * u,
                    latitude_rad: -0.1 + 0.005 * u,
                    range_m: 380_000.0,
                    emission_rad: 0.003,
                }),
            }
        })
        .collect();
    let et_s: Vec<f64> = (0..40).map(|k| START_S + 0.16 * f64::from(k)).collect();
    let nodes = et_s.len();
    Orientation {
        body: Body::Mars,
        image: times.id.clone(),
        samples,
        outline: Some(
            [(-0.05, -0.1), (-0.05, 0.05), (0.0, 0.05), (0.0, -0.1)]
                .map(|(longitude_rad, latitude_rad)| GroundPoint {
                    longitude_rad: std::f64::consts::PI + longitude_rad,
                    latitude_rad,
                })
                .to_vec(),
        ),
        tables: CameraTables {
            position_m: vec![Vector3::new(-1_745_703.3, 1_342_962.3, -3_030_553.6); nodes],
            velocity_m_s: vec![Vector3::new(-2_248.8, 1_571.6, 1_992.2); nodes],
            sun_position_m: [Vector3::new(-3.2e10, 1.9e11, 8.9e10); 2],
            sun_velocity_m_s: [Vector3::new(-24_866.9, -5_461.1, -1_832.5); 2],
            inertial_to_bus: turned(&et_s, [0.9, -0.1, -0.3, 0.3]),
            bus_angular_velocity_rad_s: vec![Vector3::new(5e-4, 7e-4, 8e-6); nodes],
            inertial_to_mars: turned(&et_s, [0.95, -0.2, -0.2, 0.0]),
            mars_angular_velocity_rad_s: vec![Vector3::new(3e-5, -3e-5, 6e-5); nodes],
            bus_to_camera: Rotation::new(
                matrix_of_rotation_vector(&Vector3::new(-0.002, 0.001, -0.003)),
                Et::from_seconds(START_S),
            ),
            interpolation: InterpolationCheck {
                error_max_px: 0.002,
                epochs: 117,
            },
            et_s,
        },
        light_time: LightTimeEffect {
            convention: LightTime::Surface,
            light_time_s: 1.27e-3,
            others: vec![OtherConvention {
                convention: LightTime::None,
                ground_m: 4.3,
                lines: -0.4,
                samples: 0.01,
            }],
        },
        centre: None,
        notes: Vec::new(),
        invalid_because: Vec::new(),
    }
}

/// The same rotation at every epoch.
fn turned<A: Frame, B: Frame>(et_s: &[f64], quaternion: [f64; 4]) -> Vec<Rotation<A, B>> {
    let matrix = matrix_of_spice_quaternion(quaternion);
    et_s.iter()
        .map(|et_s| Rotation::new(matrix, Et::from_seconds(*et_s)))
        .collect()
}

fn footprints() -> Footprints<BodyFixed> {
    let mut footprints = Footprints::new(vec![SourceFile {
        name: "ap19019l.b".to_owned(),
        version: Some('L'),
        datum: Datum::Iau2000,
        blake3: "cd".repeat(32),
        is_table: false,
    }]);
    for k in 0..SHOTS {
        let along = f64::from(k) / f64::from(SHOTS);
        let et_s = START_S + 0.1 * f64::from(k);
        footprints.push(&Footprint {
            et_tag_s: et_s + 0.117,
            et_s,
            orbit: 9019,
            file: 0,
            record: 11 + k / 20,
            shot: u8::try_from(k % 20 + 1).unwrap(),
            longitude_rad: std::f64::consts::PI + 1e-4 * (along - 0.5),
            latitude_rad: -0.1 + 0.005 * along,
            radius_m: 3_394_000.12,
            radius_crossover_m: 3_394_001.37,
            areoid_radius_m: 3_395_500.0,
            range_m: 380_000.0 + 0.1,
            spacecraft_longitude_rad: std::f64::consts::PI,
            spacecraft_latitude_rad: -0.1 + 0.005 * along,
            spacecraft_radius_m: 3_774_000.0,
            off_nadir_rad: 0.003,
            channel: 1,
            class: 1,
            attitude_flag: 0,
            orbit_quality: 3,
            windows: 1,
        });
    }
    footprints
}

/// Residuals of a few centimetres with one outlier of 50 m.
fn ranges(profiles: &[Profile]) -> RangeCheck {
    let mut shots = ShotResiduals::default();
    for profile in profiles {
        for (k, row) in (0_u32..).zip(&profile.rows) {
            let residual_m = if k == 17 {
                50.0
            } else {
                -2.0 + 0.02 * f64::from(k).sin()
            };
            shots.profile.push(0);
            shots.row.push(*row);
            shots.range_minus_distance_m.push(residual_m);
            shots
                .range_minus_distance_crossover_m
                .push(residual_m - 1.25);
            shots.decoding_m.push(0.001);
            shots.spacecraft_radial_m.push(1.0);
            shots.spacecraft_along_m.push(2.0);
            shots.spacecraft_cross_m.push(3.0);
            shots.outlier.push(k == 17);
        }
    }
    let summary = Summary::over(|| shots.range_minus_distance_m.iter());
    RangeCheck {
        profiles: profiles
            .iter()
            .map(|profile| ProfileRanges {
                off_nadir_rad: 0.0,
                shots: u32::try_from(profile.rows.len()).unwrap(),
                profile: profile.id.clone(),
                range_minus_distance_m: Summary {
                    n: u32::try_from(profile.rows.len()).unwrap(),
                    ..summary
                },
                range_minus_distance_crossover_m: summary,
                decoding_m: Summary::over(|| shots.decoding_m.iter()),
                spacecraft_m: [summary; 3],
                mean_without_outliers_m: -2.0,
                decoding_without_outliers_m: 0.001,
                trend_m_s: Some(Trend {
                    slope: 0.01,
                    uncertainty: 0.002,
                }),
                outliers: 1,
                scan: Some(BiasScan {
                    radius: ScannedRadius::Raw,
                    correction_s: vec![-0.2, -0.1, 0.0, 0.1, 0.2],
                    spread_m: vec![0.2, 0.1, 0.3, 0.5, 0.7],
                    best_s: Some(-0.12),
                    uncertainty_s: None,
                }),
                invalid_because: vec!["mean of range − distance 11.000 m; limit ±10 m".to_owned()],
            })
            .collect(),
        shots,
        trajectory_error_m: 2e-4,
    }
}
