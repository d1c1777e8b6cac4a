//! Shipped configurations are accepted, documented defaults are the defaults, and schema and example are
//! those of the declared keys.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    config::{
        self, CalibrationConfig, CampaignConfig, Document, Loaded, NetConfig, ServiceConfig,
        SiteConfig, ValueKind,
    },
    geom::window::WindowShape,
};
use serde_json::Value;
use snapbox::{Assert, Data, IntoData, assert::DEFAULT_ACTION_ENV};

const OUTLINE: &str =
    r#"{"type": "Polygon", "coordinates": [[[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]]}"#;

fn below_package(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn example_text() -> String {
    fs::read_to_string(below_package("config/sites/example.toml")).unwrap()
}

/// A temporary `sites` folder beside the files that shipped configurations point to.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (path, content) in [
        ("kernels/scene.tm", "KPL/MK\n"),
        ("pedr/ap19019k.b", ""),
        ("labels/e0202855.lbl", "END\n"),
        ("ties/site.csv", ""),
        ("sites/outline.geojson", OUTLINE),
    ] {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    folder
}

fn parse_in(folder: &tempfile::TempDir, text: &str) -> Loaded<SiteConfig> {
    SiteConfig::parse(text, &folder.path().join("sites/site.toml")).unwrap()
}

fn as_json(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Table>(text).unwrap()).unwrap()
}

fn schema() -> Value {
    let text = fs::read_to_string(below_package("config/schema/site.schema.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn shipped_configurations_are_accepted_without_warnings() {
    let folder = folder();
    let mut files = 0;
    for entry in fs::read_dir(below_package("config/sites")).unwrap() {
        let path = entry.unwrap().path();
        let copy = folder.path().join("sites").join(path.file_name().unwrap());
        fs::copy(&path, &copy).unwrap();
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let loaded = SiteConfig::load(&copy).unwrap();
            assert_eq!(loaded.warnings, Vec::<String>::new(), "{}", path.display());
            files += 1;
        }
    }
    assert!(files > 0);
}

#[test]
fn the_example_says_the_defaults_and_means_si_units() {
    let folder = folder();
    let example = parse_in(&folder, &example_text()).config;
    let least = r#"
        site = "eos_chasma"
        kernels.metakernel = "../kernels/scene.tm"
        pedr.files = ["../pedr/*.b", "../sites/../pedr/ap19019k.b"]
        windows = [{ id = "site", longitude_deg = [-42, -41.3], latitude_deg = [-14, -12.9] }]
    "#;
    let least = parse_in(&folder, least).config;
    let with_defaults = SiteConfig {
        description: example.description.clone(),
        blake3: example.blake3.clone(),
        keys: example.keys.clone(),
        windows: example.windows.clone(),
        images: example.images.clone(),
        ties: example.ties.clone(),
        ..least.clone()
    };
    assert_eq!(example, with_defaults);
    assert_eq!(
        example.pedr.files.len(),
        1,
        "a file reached twice counts once"
    );

    let WindowShape::Box {
        west_rad,
        east_rad,
        south_rad,
        north_rad,
    } = least.windows[0].shape
    else {
        panic!("a box was written");
    };
    // One ulp of 2π, nanometres on the ground.
    for (found, degrees) in [
        (west_rad, 318.0_f64),
        (east_rad, 318.7),
        (south_rad, -14.0),
        (north_rad, -12.9),
    ] {
        assert!((found - degrees.to_radians()).abs() < 1e-15, "{degrees}");
    }
    let WindowShape::Polygons { polygons } = &example.windows[1].shape else {
        panic!("a polygon was written");
    };
    assert!((polygons[0][0][2][1] - 10_f64.to_radians()).abs() < 1e-15);
    let image = &example.images[1].fields;
    // A picosecond.
    assert!((image.exposure_s.unwrap() - 0.000_482_1).abs() < 1e-12);
    assert!((example.orientation.pointing_rmse_max_rad - 4.848_136_8e-5).abs() < 1e-12);
    assert!((example.altimeter_clock.correction_s() + 0.117).abs() < 1e-12);
}

#[test]
fn the_hash_follows_values_and_nothing_else() {
    let folder = folder();
    let hash = |text: &str| parse_in(&folder, text).config.blake3;
    let text = "site = 's'\nkernels.metakernel = '../kernels/scene.tm'\nimages = [{ id = 'i', label = '../labels/e0202855.lbl' }]\n";
    let same = "# a comment\n[kernels]\nmetakernel = \"../kernels/scene.tm\"\n";
    let same = format!(
        "images = [{{ label = '../labels/e0202855.lbl', id = 'i' }}]\nsite = \"s\"\n{same}"
    );
    assert_eq!(hash(text), hash(&same));
    assert_ne!(
        hash(text),
        hash(&format!("{text}pointing.ck_bias_s = -1.15\n"))
    );
}

/// A site file without images, in the folder of the test.
fn parse_with(folder: &tempfile::TempDir, lines: &str, images: &str) -> SiteConfig {
    let text = format!(
        "site = 'laser'\n{lines}\nkernels.metakernel = '../kernels/scene.tm'\n[[images]]\nid = 'a'\n\
         sclk_start = '619971158:28'\nexposure_ms = 0.4821\ndowntrack_summing = 8\nlines_header = 1536\n\
         samples = 256\n{images}\n"
    );
    parse_in(folder, &text).config
}

#[test]
fn a_site_takes_the_clock_bias_of_its_own_altimeter() {
    let folder = folder();
    let own = fs::read_to_string(below_package("config/altimeters/mola.toml")).unwrap();
    let own = own
        .replace("bias_s = 0.117", "bias_s = 0.25")
        .replace("source = \"", "source = \"own: ");
    fs::write(folder.path().join("sites/laser.toml"), own).unwrap();
    let of_file = parse_with(&folder, "altimeter = 'laser.toml'", "").altimeter_clock;
    assert!((of_file.bias_s - 0.25).abs() < f64::EPSILON);
    assert!(
        of_file.source.starts_with("own: Shan et al. 2005"),
        "{}",
        of_file.source
    );
    let written = parse_with(
        &folder,
        "altimeter = 'laser.toml'\naltimeter_clock.bias_s = 0.1",
        "",
    );
    assert!((written.altimeter_clock.bias_s - 0.1).abs() < f64::EPSILON);
    let usual = parse_with(&folder, "", "").altimeter_clock;
    assert!((usual.bias_s - config::usual_altimeter().clock_bias_s).abs() < f64::EPSILON);
}

#[test]
fn every_camera_has_its_own_pointing_bias_unless_the_site_has_one() {
    let folder = folder();
    let own = fs::read_to_string(below_package("config/instruments/moc_na.toml")).unwrap();
    let own = own.replace("ck_bias_s = -1.15", "ck_bias_s = -0.4");
    fs::write(folder.path().join("sites/camera.toml"), own).unwrap();
    let bias_s = |site: &SiteConfig| {
        let camera = site.images[0].instrument.as_ref();
        let camera = camera.unwrap_or(config::usual_instrument());
        (
            site.pointing.bias_of(camera).seconds(),
            site.pointing.source_of(camera).to_owned(),
        )
    };
    let images = "instrument = 'camera.toml'";
    let (of_camera_s, source) = bias_s(&parse_with(&folder, "", images));
    assert!(
        (of_camera_s + 0.4).abs() < f64::EPSILON && source.starts_with("INS-94031"),
        "{source}"
    );
    let (of_site_s, source) = bias_s(&parse_with(&folder, "pointing.ck_bias_s = -0.5", images));
    assert!((of_site_s + 0.5).abs() < f64::EPSILON && source == "pointing.ck_bias_s of the site");
    let (usual_s, _) = bias_s(&parse_with(&folder, "", ""));
    assert!((usual_s + 1.15).abs() < f64::EPSILON);
}

#[test]
fn entries_that_are_never_used_are_told() {
    let folder = folder();
    let text = "site = 's'\n\
        kernels = { metakernel = '../kernels/scene.tm', pinned = ['pck00010.tpc'] }\n\
        altimeter_clock = { scope = 'none', bias_s = 0.117 }\n\
        windows = [{ id = 'w', longitude_deg = [0, 1], latitude_deg = [0, 1] }]\n\
        images = [{ id = 'i', label = '../labels/e0202855.lbl', sclk_start = '1:2', utc_start = '1999-236T14:12:13' }]\n";
    let prefix = format!("{}/sites/", folder.path().display());
    let warnings = parse_in(&folder, text)
        .warnings
        .join("\n")
        .replace(&prefix, "");
    assert_eq!(
        warnings,
        "site.toml:2:58: kernels.pinned is never used: it applies only with kernels.root\n\
         site.toml:3:46: altimeter_clock.bias_s is never used: altimeter_clock.scope is \"none\"\n\
         site.toml:4:11: windows are never used without a table [pedr] or tables [[shots]]\n\
         site.toml:5:10: images without a table [pedr] or tables [[shots]]: orientation only, no footprints and no range check\n\
         site.toml:5:89: images.utc_start is never used: sclk_start comes first"
    );
}

#[test]
fn a_window_that_goes_more_than_half_round_mars_is_named() {
    let folder = folder();
    let warned = |longitudes: &str| {
        let text = format!(
            "site = 's'\n\
             kernels = {{ metakernel = '../kernels/scene.tm' }}\n\
             windows = [{{ id = 'w', longitude_deg = {longitudes}, latitude_deg = [0, 1] }}]\n\
             images = [{{ id = 'i', label = '../labels/e0202855.lbl' }}]\n"
        );
        parse_in(&folder, &text).warnings.join("\n")
    };
    let said = "site.toml:3:40: longitude_deg spans 359° eastward, from 176.5° to 175.5°; for the other 1°, \
                write [175.5, 176.5]";
    let swapped = warned("[176.5, 175.5]");
    assert!(swapped.contains(said), "{swapped}");
    for usual in ["[175.5, 176.5]", "[350, 10]", "[170, -170]", "[0, 360]"] {
        assert!(!warned(usual).contains("eastward"), "{usual}");
    }
}

#[test]
fn two_files_of_one_site_are_both_named() {
    let folder = folder();
    let one = parse_in(&folder, &example_text()).config;
    let other = SiteConfig {
        site: "other".to_owned(),
        ..one.clone()
    };
    let again = SiteConfig {
        file: PathBuf::from("again.toml"),
        ..one.clone()
    };
    assert!(config::check_sites(&[one.clone(), other.clone()]).is_ok());
    let fault = config::check_sites(&[one.clone(), other, again]).unwrap_err();
    assert_eq!(
        fault.to_string(),
        format!(
            "site is \"eos_chasma\" in {} and in again.toml; expected one file per site",
            one.file.display()
        )
    );
}

#[test]
fn the_schema_takes_the_example_and_refuses_what_the_loader_refuses() {
    let schema = jsonschema::validator_for(&schema()).unwrap();
    let errors: Vec<String> = schema
        .iter_errors(&as_json(&example_text()))
        .map(|error| error.to_string())
        .collect();
    assert_eq!(errors, Vec::<String>::new());
    for bad in [
        "only_site",
        "unknown_key",
        "unknown_table",
        "wrong_type",
        "site_is_path",
        "kernels_none",
        "kernels_two_sources",
        "kernels_empty_list",
        "kernel_set_alone",
        "kernel_sets",
        "out_of_range",
        "mola_words",
        "pedr_words",
        "pedr_no_files",
        "no_windows",
        "windows_65",
        "window_half",
        "window_two_shapes",
        "window_three_numbers",
        "image_incomplete",
        "image_without_samples",
        "image_numbers",
    ] {
        let text =
            fs::read_to_string(below_package(&format!("tests/config/bad/{bad}.toml"))).unwrap();
        assert!(!schema.is_valid(&as_json(&text)), "{bad} passes the schema");
    }
}

/// What is made from the declarations of the keys; `SNAPSHOTS=overwrite cargo test --test products config_valid` writes
/// both files anew.
#[test]
fn example_and_schema_are_made_from_the_declarations() {
    made_from_declarations::<SiteConfig>("site");
    made_from_declarations::<NetConfig>("net");
    made_from_declarations::<CalibrationConfig>("calibration");
    made_from_declarations::<CampaignConfig>("campaign");
    made_from_declarations::<ServiceConfig>("service");
}

fn made_from_declarations<T: Document>(kind: &str) {
    let schema = serde_json::to_string_pretty(&T::schema()).unwrap() + "\n";
    for (path, made) in [
        (T::EXAMPLE, T::example()),
        (&format!("config/schema/{kind}.schema.json"), schema),
    ] {
        let committed = Data::read_from(&below_package(path), None).raw();
        Assert::new()
            .action_env(DEFAULT_ACTION_ENV)
            .eq(made.into_data(), committed);
    }
}

/// Whether a default is a value that its key takes.
fn takes(kind: &ValueKind, value: &toml::Value) -> bool {
    match (kind, value) {
        (ValueKind::Text { empty }, toml::Value::String(text)) => *empty || !text.is_empty(),
        (ValueKind::Form { .. }, toml::Value::String(_))
        | (ValueKind::Switch, toml::Value::Boolean(_)) => true,
        (ValueKind::Number(accept), toml::Value::Float(number)) => accept.takes(*number),
        (ValueKind::Whole { low, high }, toml::Value::Integer(number)) => {
            (low..=high).contains(&number)
        }
        (ValueKind::Word(words), toml::Value::String(text)) => {
            words.iter().any(|word| word.word == text)
        }
        (
            ValueKind::List {
                of, count, empty, ..
            },
            toml::Value::Array(entries),
        ) => {
            count.is_none_or(|count| count == entries.len())
                && (*empty || !entries.is_empty())
                && entries.iter().all(|entry| takes(of, entry))
        }
        _ => false,
    }
}

#[test]
fn declarations_are_complete() {
    let keys = config::keys();
    let paths: BTreeSet<&str> = keys.iter().map(|key| &*key.path).collect();
    assert_eq!(paths.len(), keys.len(), "a key is declared twice");
    assert!(keys.len() > 70, "{} keys", keys.len());
    // Shares, ratios and normalised residuals.
    let without_unit = [
        "range_check.outlier_sigma",
        "range_check.outlier_share_max",
        "adjustment.robust_limit",
        "adjustment.blunder_limit",
        "adjustment.height_blunder_limit",
        "limits.height_outliers_max",
        "limits.profiles_apart_max_sigma",
        "limits.correction_max_sigma",
        "limits.sigma0_max",
        "limits.missing_shots_max",
        "limits.ties_min",
        "limits.rejected_share_max",
        "limits.surface_filled_min",
        "limits.surface_spread_max_sigma",
    ];
    for key in &keys {
        let path = &*key.path;
        assert!(!key.about.is_empty(), "{path} has no documentation");
        assert!(
            key.default.is_some() || !key.examples.is_empty(),
            "{path} is not in the example"
        );
        if let Some(default) = &key.default {
            // A list may be left out and yet not be written empty.
            let is_left_out = default.as_array().is_some_and(Vec::is_empty);
            assert!(
                is_left_out || takes(&key.kind, default),
                "{path}: {default}"
            );
        }
        if matches!(key.kind, ValueKind::Number(_)) {
            let has_unit = key.unit.is_some();
            assert_ne!(has_unit, without_unit.contains(&path), "{path}");
        }
        if let Some(was) = key.was {
            let table = path.rsplit_once('.').map_or("", |(table, _)| table);
            assert!(!paths.contains(&*format!("{table}.{was}")), "{path}");
        }
    }
}

#[test]
fn former_names_are_understood() {
    let folder = folder();
    let text = |lines: &str| {
        format!(
            "site = 's'\nkernels.metakernel = '../kernels/scene.tm'\n\
             images = [{{ id = 'i', label = '../labels/e0202855.lbl' }}]\n\
             pedr.files = ['../pedr/*.b']\n\
             windows = [{{ id = 'w', longitude_deg = [0, 1], latitude_deg = [0, 1] }}]\n\
             [adjustment]\nmodel = 'published'\n{lines}"
        )
    };
    let now = parse_in(
        &folder,
        &text(
            "footprint_image_coordinates = 'off'\nfootprint_sigma_px = [70, 5]\nfootprint_margin_px = 100\n\
             position_sigma_nadir_m = 50\nposition_sigma_off_nadir_m = inf\n",
        ),
    );
    assert_eq!(now.warnings, Vec::<String>::new());
    let before = parse_in(
        &folder,
        &text(
            "mola_image = 'off'\nmola_sigma_px = [70, 5]\nmola_margin_px = 100\n\
             nadir_sigma_m = 50\noff_nadir_sigma_m = inf\n",
        ),
    );
    // Also what the manifest keeps: nothing is computed anew because of a name.
    assert_eq!(before.config, now.config);
    let prefix = format!("{}/sites/", folder.path().display());
    assert_eq!(
        before.warnings.join("\n").replace(&prefix, ""),
        "site.toml:8:1: adjustment.mola_image is now called adjustment.footprint_image_coordinates\n\
         site.toml:9:1: adjustment.mola_sigma_px is now called adjustment.footprint_sigma_px\n\
         site.toml:10:1: adjustment.mola_margin_px is now called adjustment.footprint_margin_px\n\
         site.toml:11:1: adjustment.nadir_sigma_m is now called adjustment.position_sigma_nadir_m\n\
         site.toml:12:1: adjustment.off_nadir_sigma_m is now called adjustment.position_sigma_off_nadir_m"
    );
}

#[test]
fn former_names_of_tables_are_understood() {
    let folder = folder();
    let text = |clock: &str, surface: &str| {
        format!(
            "site = 's'\nkernels.metakernel = '../kernels/scene.tm'\n\
             images = [{{ id = 'i', label = '../labels/e0202855.lbl' }}]\n\
             pedr.files = ['../pedr/*.b']\n\
             windows = [{{ id = 'w', longitude_deg = [0, 1], latitude_deg = [0, 1] }}]\n\
             [{clock}]\nbias_s = 0.25\nsource = 'own'\n\
             [{surface}]\nshot_sigma_m = 2\n"
        )
    };
    let now = parse_in(&folder, &text("altimeter_clock", "laser_surface"));
    assert_eq!(now.warnings, Vec::<String>::new());
    let before = parse_in(&folder, &text("mola_clock", "mola_surface"));
    // The written bias, not that of the altimeter file; and what the manifest keeps.
    assert!((before.config.altimeter_clock.bias_s - 0.25).abs() < f64::EPSILON);
    assert_eq!(before.config.altimeter_clock.source, "own");
    assert!((before.config.laser_surface.shot_sigma_m - 2.0).abs() < f64::EPSILON);
    assert_eq!(before.config, now.config);
    let prefix = format!("{}/sites/", folder.path().display());
    assert_eq!(
        before.warnings.join("\n").replace(&prefix, ""),
        "site.toml:6:2: mola_clock is now called altimeter_clock\n\
         site.toml:9:2: mola_surface is now called laser_surface"
    );
    let example = SiteConfig::example();
    let has_table = |table: &str| example.lines().any(|line| line == format!("[{table}]"));
    assert!(has_table("altimeter_clock") && has_table("laser_surface"));
    assert!(!has_table("mola_clock") && !has_table("mola_surface"));
}
