//! Adjusted orientations as kernels: what went in comes back through the same pipeline.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common::adjusted as fixture;

use std::{fs, path::Path};

use areograph::{
    config::PointingConfig,
    error::{Kind, Locate, Result},
    frames::Rotation,
    geom::{attitude::matrix_of_rotation_vector, light_time::LightTime},
    line_times::LineTimes,
    products::{AdjustedImage, AdjustedKernels, KernelReaders, Product, write_adjusted_kernels},
    spice::{KernelRole, KernelSet, Session},
    stages::{
        reorient::{LineCorrection, reorient},
        sample_orientation::Orientation,
        tabulate_kernels::{AdjustedTables, require_same, tabulate_kernels},
        tag_times::ImageTimes,
    },
    time::{Et, PointingBias},
};
use fixture::{Image, angle_rad, apart, kernel_camera_by};
use nalgebra::{Matrix3, Vector3};

/// A pixel of the narrow angle, radians.
const PIXEL_RAD: f64 = 0.013_124_057_852_294_9 / 3_500.0;

/// Tens of metres and of arcseconds, with slopes and bends.
fn curved(x: f64) -> LineCorrection {
    let t = x / 5_000.0;
    LineCorrection {
        position_m: Vector3::new(-60.0 + 25.0 * t, 90.0 - 40.0 * t * t, 15.0 + 5.0 * t),
        rotation_rad: 1e-4 * Vector3::new(2.0 - 0.7 * t, 1.0 + 0.6 * t * t, -2.5 + t),
    }
}

fn adjusted(image: &Image, shift_lines: f64) -> Orientation {
    reorient(&image.orientation, &image.times, shift_lines, curved).unwrap()
}

fn kernels_of<'a>(image: &'a Image, folder: &'a Path) -> AdjustedKernels<'a> {
    AdjustedKernels {
        directory: folder,
        site_folder: folder,
        originals: &image.set,
        pointing: &image.pointing,
    }
}

/// An image with its adjusted orientation.
#[derive(Clone, Copy)]
struct Adjusted<'a> {
    times: &'a ImageTimes,
    orientation: &'a Orientation,
}

/// Tabulates, writes and reads back the kernels of `images`, which were sampled as `of` was.
fn written(of: &Image, to: &AdjustedKernels, images: &[Adjusted]) -> Result<Vec<Product>> {
    let times: Vec<&ImageTimes> = images.iter().map(|image| image.times).collect();
    let session = Session::open(to.originals)?;
    let tabulate = |(index, image): (usize, &Adjusted)| {
        let (kernels, pointing) = (&of.kernels, to.pointing);
        let tabulate = |readers: KernelReaders| {
            let reading = readers.reading(of.light_time, &image.times.instrument, pointing);
            let orientation = image.orientation;
            tabulate_kernels(
                &session,
                &times,
                index,
                orientation,
                reading,
                kernels,
                pointing,
            )
        };
        Ok(AdjustedTables {
            own: tabulate(KernelReaders::Run)?,
            centre: tabulate(KernelReaders::Centre)?,
        })
    };
    let tables = images.iter().enumerate().map(tabulate);
    let tables = tables.collect::<Result<Vec<_>>>()?;
    drop(session);
    let adjusted = times.iter().zip(&tables);
    let adjusted: Vec<_> = adjusted
        .map(|(times, tables)| AdjustedImage {
            times,
            tables,
            light_time: of.light_time,
            is_valid: true,
        })
        .collect();
    let products = write_adjusted_kernels(to, &adjusted)?;
    for image in images {
        let id = &image.times.id;
        for readers in KernelReaders::ALL {
            let [position, attitude] = readers.paths(id);
            let own = [&position, &attitude].map(|name| to.directory.join(name));
            let session = Session::open(&to.originals.followed_by(&own)?)?;
            let (kernels, pointing) = (&of.kernels, to.pointing);
            let (times, orientation) = (image.times, image.orientation);
            let reading = readers.reading(of.light_time, &times.instrument, pointing);
            require_same(&session, times, orientation, reading, kernels).in_file(position)?;
        }
    }
    Ok(products)
}

/// The adjusted kernels, as `readers` use them, against the original ones with the correction, at instants that are no
/// samples.
fn between_samples(image: &Image, set: &KernelSet, readers: LightTime, shift_lines: f64) {
    let instants: Vec<Et> = (0..97)
        .map(|k| {
            image
                .times
                .line_times
                .start()
                .plus(image.times.duration_s() * (f64::from(k) + 0.37) / 97.0)
        })
        .collect();
    let cameras = |set: &KernelSet, by: LightTime, shift_s: f64| -> Vec<_> {
        let session = Session::open(set).unwrap();
        let camera = |et: &Et| kernel_camera_by(&session, image, by, et.plus(shift_s));
        instants.iter().map(camera).collect()
    };
    let found = cameras(set, readers, 0.0);
    let original = cameras(
        &image.set,
        image.light_time,
        shift_lines * image.times.line_times.mean_period_s(),
    );
    for ((et, found), (position_m, camera_to_mars)) in instants.iter().zip(&found).zip(original) {
        let correction = curved(image.times.line_offset(*et));
        let distance_m = (found.0 - position_m - correction.position_m).norm();
        let mars_to_camera =
            matrix_of_rotation_vector(&correction.rotation_rad) * camera_to_mars.transpose();
        let turn_rad = angle_rad(&found.1, &mars_to_camera.transpose());
        // The tables are good to 0.01 px: bends of the original attitude between their nodes are cut off.
        let pixel_rad = f64::from(image.times.downtrack_summing) * PIXEL_RAD;
        assert!(
            distance_m < 1e-3 && turn_rad < 0.01 * pixel_rad,
            "{distance_m} m, {turn_rad} rad"
        );
    }
}

/// Largest difference between ranges that jigsaw computes, from its position of the spacecraft, and the geometric ones.
fn ranges_of_isis(image: &Image, set: &KernelSet, adjusted: &Orientation) -> f64 {
    let session = Session::open(set).unwrap();
    let mut most_m = 0.0_f64;
    for sample in &adjusted.samples {
        let ground_m = sample.position.xyz_m
            + sample.camera_to_mars.matrix().column(2) * sample.boresight.unwrap().range_m;
        let (isis_m, _) = kernel_camera_by(&session, image, LightTime::Centre, sample.et);
        let flown_m = sample.position.xyz_m + sample.to_spacecraft_m;
        let [isis_m, range_m] = [isis_m, flown_m].map(|from_m| (ground_m - from_m).norm());
        most_m = most_m.max((isis_m - range_m).abs());
    }
    match image.light_time {
        // Metres: MGS climbs by at most 60 m/s, which is 0.08 m in the 1.3 ms from the ground, and looks ahead or back by
        // less than 1°, a share of 0.02 of the 4.3 m along the track.
        LightTime::Surface | LightTime::None => assert!(most_m < 0.2, "{most_m} m"),
        // The displacement along the radius.
        LightTime::Centre | LightTime::Support => assert!((30.0..350.0).contains(&most_m)),
    }
    most_m
}

#[test]
fn sampling_with_the_adjusted_kernels_gives_the_adjusted_orientation() {
    let of = |(_, light_time)| {
        let scene = ["E02-02016", "E04-01275"].map(|id| Image::of_scene_with(id, light_time));
        let real = Image::real_with("adjusted kernels", light_time);
        scene.into_iter().chain(real)
    };
    for image in &LightTime::WORDS
        .into_iter()
        .flat_map(of)
        .collect::<Vec<_>>()
    {
        for shift_lines in [0.0, 22.6] {
            let adjusted = adjusted(image, shift_lines);
            let folder = tempfile::tempdir().unwrap();
            let of_image = Adjusted {
                times: &image.times,
                orientation: &adjusted,
            };
            let to = kernels_of(image, folder.path());
            let products = written(image, &to, &[of_image]).unwrap();
            let id = &image.times.id;
            let paths: Vec<String> = products
                .iter()
                .map(|product| product.path.display().to_string())
                .collect();
            let pairs = [
                format!("adjusted/{id}.bsp"),
                format!("adjusted/{id}.bc"),
                format!("exchange/centre/{id}_adjusted.bsp"),
                format!("exchange/centre/{id}_adjusted.bc"),
            ];
            assert_eq!(paths[..4], pairs);
            assert_eq!(paths[4..], ["adjusted.tm"]);
            let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
            let again = image.sampled_with(&set);
            let (distance_m, turn_rad) = apart(&again, &adjusted);
            let of = image.light_time;
            println!("{id} {of:?}, shift {shift_lines}: {distance_m:.1e} m, {turn_rad:.1e} rad");
            // ET is rounded to 7e-9 s, in which MGS flies 3e-5 m; ticks to 1.5e-8 s, 1.4e-11 rad.
            assert!(distance_m < 1e-3 && turn_rad < 1e-9);
            // The tables of camera models come back as well; beyond the samples the correction goes on straight,
            // 0.1 m from its bend in 200 lines.
            let (ours, theirs) = (&again.tables, &adjusted.tables);
            let mut compared = 0;
            for (row, et_s) in ours.et_s.iter().enumerate() {
                let Some(other) = theirs.et_s.iter().position(|t| (t - et_s).abs() < 1e-6) else {
                    continue;
                };
                let position = ours.position_m[row] - theirs.position_m[other];
                assert!(position.norm() < 0.15, "{} m at {row}", position.norm());
                compared += 1;
            }
            assert_eq!(compared, theirs.et_s.len());
            assert!(again.tables.interpolation.error_max_px < 0.02);
            between_samples(image, &set, of, shift_lines);
            let pair = KernelReaders::Centre.paths(id);
            let pair = pair.map(|name| folder.path().join(name));
            let isis = image.set.followed_by(&pair).unwrap();
            between_samples(image, &isis, LightTime::Centre, shift_lines);
            let range_m = ranges_of_isis(image, &isis, &adjusted);
            println!("{id} {of:?}: ranges {range_m:.3} m from jigsaw's");
            assert_eq!(
                again.outline.unwrap().len(),
                adjusted.outline.unwrap().len()
            );
            assert!(again.invalid_because.is_empty() && again.notes.is_empty());
        }
    }
}

#[test]
fn the_metakernel_lists_the_adjusted_kernels_last_and_the_comments_say_the_rule() {
    let image = Image::of_scene("E02-02016");
    let adjusted = adjusted(&image, 0.0);
    let folder = tempfile::tempdir().unwrap();
    let of_image = Adjusted {
        times: &image.times,
        orientation: &adjusted,
    };
    let to = kernels_of(&image, folder.path());
    written(&image, &to, &[of_image]).unwrap();
    let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
    let roles: Vec<KernelRole> = set.kernels().iter().map(|kernel| kernel.role).collect();
    assert_eq!(set.kernels().len(), image.set.kernels().len() + 2);
    assert_eq!(roles[roles.len() - 2..], [KernelRole::Spk, KernelRole::Ck]);
    let text = fs::read_to_string(folder.path().join("adjusted.tm")).unwrap();
    assert!(
        text.contains("'adjusted/E02-02016.bsp'\n") && text.contains("'adjusted/E02-02016.bc'\n")
    );
    let comment = |name: &str| {
        let bytes = fs::read(folder.path().join(name)).unwrap();
        String::from_utf8_lossy(&bytes).replace('\0', "\n")
    };
    for name in ["adjusted/E02-02016.bsp", "adjusted/E02-02016.bc"] {
        let comment = comment(name);
        assert!(comment.contains("is stored at t - 1.150 s"), "{name}");
        assert!(
            comment.contains("ISIS and ALE apply this offset, too"),
            "{name}"
        );
    }
    // Outside the image with its padding the original kernels rule, as before.
    let after = image
        .times
        .exposures()
        .stop
        .plus(image.kernels.padding_s + 1.0);
    let state = |set: &KernelSet| Session::open(set).unwrap().state(after).unwrap();
    assert_eq!(state(&set), state(&image.set));
    // The same input gives the same bytes.
    let again = tempfile::tempdir().unwrap();
    written(&image, &kernels_of(&image, again.path()), &[of_image]).unwrap();
    for name in ["adjusted/E02-02016.bsp", "adjusted/E02-02016.bc"] {
        let bytes = |folder: &Path| fs::read(folder.join(name)).unwrap();
        assert!(bytes(folder.path()) == bytes(again.path()), "{name}");
    }
}

#[test]
fn the_metakernel_counts_paths_from_where_the_files_go_in_the_end() {
    let image = Image::of_scene("E02-02016");
    let folder = tempfile::tempdir().unwrap();
    let staging = folder.path().join(".staging/deep");
    let to = AdjustedKernels {
        directory: &staging,
        ..kernels_of(&image, folder.path())
    };
    let of_image = Adjusted {
        times: &image.times,
        orientation: &image.orientation,
    };
    written(&image, &to, &[of_image]).unwrap();
    for name in ["adjusted", "adjusted.tm"] {
        fs::rename(staging.join(name), folder.path().join(name)).unwrap();
    }
    let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
    let own = set.kernels()[set.kernels().len() - 1].path.clone();
    assert_eq!(own, folder.path().join("adjusted/E02-02016.bc"));
    let (distance_m, turn_rad) = apart(&image.sampled_with(&set), &image.orientation);
    assert!(distance_m < 1e-3 && turn_rad < 1e-9); // as above
}

#[test]
fn another_bias_is_kept_for_the_run_and_not_for_isis() {
    let mut image = Image::of_scene("E02-02016");
    image.pointing = PointingConfig {
        ck_bias: Some(PointingBias::from_seconds(-1.0)),
        source: None,
    };
    let original = image.sampled_with(&image.set);
    let adjusted = reorient(&original, &image.times, 0.0, curved).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let of_image = Adjusted {
        times: &image.times,
        orientation: &adjusted,
    };
    written(&image, &kernels_of(&image, folder.path()), &[of_image]).unwrap();
    let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
    let (distance_m, turn_rad) = apart(&image.sampled_with(&set), &adjusted);
    assert!(distance_m < 1e-3 && turn_rad < 1e-9); // as with the usual bias
    let bytes = fs::read(folder.path().join("adjusted/E02-02016.bc")).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("exchange/centre in these programs"));
    // The pair for ISIS, which `written` has read back with the usual bias, states that bias.
    let bytes = fs::read(folder.path().join("exchange/centre/E02-02016_adjusted.bc")).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("stored at t - 1.150 s"));
}

#[test]
fn two_images_share_a_metakernel() {
    let images = ["E02-02016", "E04-01275"].map(Image::of_scene);
    let adjusted = [0, 1].map(|index| adjusted(&images[index], -9.5));
    let folder = tempfile::tempdir().unwrap();
    let both = [0, 1].map(|index| Adjusted {
        times: &images[index].times,
        orientation: &adjusted[index],
    });
    let products = written(&images[0], &kernels_of(&images[0], folder.path()), &both).unwrap();
    assert_eq!(products.len(), 9); // two pairs each, and the metakernel
    let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
    for (image, adjusted) in images.iter().zip(&adjusted) {
        let (distance_m, turn_rad) = apart(&image.sampled_with(&set), adjusted);
        assert!(distance_m < 1e-3 && turn_rad < 1e-9); // as above
    }
}

#[test]
fn images_shortly_after_one_another_do_not_reach_into_each_other() {
    let first = Image::of_scene("E02-02016");
    let mut second = Image::of_scene("E02-02016");
    // Nearer than the padding of 1 s, and than what positions reach beyond it.
    let of_first = &first.times.line_times;
    second.times.line_times = LineTimes::even(
        of_first.interval().stop.plus(0.06),
        of_first.lines(),
        of_first.mean_period_s(),
    )
    .unwrap();
    second.times.id = "E02-02016b".to_owned();
    second.orientation = second.sampled_with(&second.set);
    let images = [first, second];
    let adjusted = [0, 1].map(|index| adjusted(&images[index], 5.0));
    let folder = tempfile::tempdir().unwrap();
    let both = [0, 1].map(|index| Adjusted {
        times: &images[index].times,
        orientation: &adjusted[index],
    });
    written(&images[0], &kernels_of(&images[0], folder.path()), &both).unwrap();
    let set = KernelSet::from_metakernel(&folder.path().join("adjusted.tm")).unwrap();
    for (image, adjusted) in images.iter().zip(&adjusted) {
        let (distance_m, turn_rad) = apart(&image.sampled_with(&set), adjusted);
        assert!(distance_m < 1e-3 && turn_rad < 1e-9); // as above
    }
}

#[test]
fn orientations_that_are_none_and_kernels_that_end_are_refused() {
    let image = Image::of_scene("E02-02016");
    let folder = tempfile::tempdir().unwrap();
    let to = kernels_of(&image, folder.path());
    assert!(written(&image, &to, &[]).unwrap().is_empty());
    let refused = |orientation: &Orientation| {
        let adjusted = Adjusted {
            times: &image.times,
            orientation,
        };
        let folder = tempfile::tempdir().unwrap();
        let to = AdjustedKernels {
            directory: folder.path(),
            ..to
        };
        written(&image, &to, &[adjusted]).unwrap_err()
    };
    let mut broken = image.orientation.clone();
    let sample = &mut broken.samples[7];
    sample.camera_to_mars = Rotation::new(Matrix3::repeat(f64::NAN), sample.et);
    let failure = refused(&broken).to_string();
    assert!(
        failure.contains("adjusted/E02-02016.bc: damaged binary kernel: segment 1"),
        "{failure}"
    );
    let mut few = image.orientation.clone();
    few.samples.truncate(2);
    assert_eq!(refused(&few).kind(), Kind::Bug);
    assert!(refused(&few).to_string().contains("2 orientation samples"));
    let mut empty = image.orientation.clone();
    empty.samples.clear();
    empty.tables.et_s.clear();
    assert!(
        refused(&empty)
            .to_string()
            .contains("0 orientation samples")
    );
    let tables = AdjustedTables::default();
    let nothing = AdjustedImage {
        times: &image.times,
        tables: &tables,
        light_time: image.light_time,
        is_valid: true,
    };
    let failure = write_adjusted_kernels(&to, &[nothing]).unwrap_err();
    assert!(failure.to_string().contains("it contains no instants"));
    let session = Session::open(&image.set).unwrap();
    assert!(
        refused(&image.orientation)
            .to_string()
            .contains("session is already open")
    );
    drop(session);
}
