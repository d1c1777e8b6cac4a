//! Whatever changes, a second run gives what a first one would, and the plan says what it does.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    config::{self, DeclaredKey, Document as _, SiteConfig, ValueKind},
    flow::{Ending, PUBLISH, RunOptions, STAGES, StageReason, plan_site, run_site},
    stage::Reason,
    store::hashes::HashCache,
};
use common::case::Case;
use toml::{Table, Value};

static NEVER: AtomicBool = AtomicBool::new(false);

fn options<'a>(out: &Path, until: &'a str, hashes: &'a HashCache) -> RunOptions<'a> {
    RunOptions {
        out: out.to_owned(),
        until,
        force: false,
        stop: &NEVER,
        hashes,
        roots: &[],
        observer: &(),
    }
}

/// The stage before the products: a run up to it makes every stage's output.
fn last_stage() -> &'static str {
    let (publish, before) = STAGES.split_last().unwrap();
    assert_eq!(*publish, PUBLISH);
    before.last().unwrap()
}

/// The pair of images with its tie points, its site file, and a folder of products.
struct Walk {
    case: Case,
    site: Table,
    begun: u32,
    /// The site file of the last run that succeeded.
    ran: Table,
    /// Whether that run went as far as the products.
    published: bool,
    /// Stages that were kept since the last comparison with a clean run.
    kept: BTreeSet<String>,
}

/// What became of a step, or what both runs say of a failure.
type Step = Result<Vec<StageReason>, String>;

impl Walk {
    fn new() -> Self {
        let case = Case::pair();
        // What is compared is bookkeeping, which fifty tie points show as well as all; most of a run is their adjustment.
        let ties = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
        let fewer: Vec<&str> = ties.lines().take(101).collect();
        case.write("ties/isidis.csv", fewer.join("\n") + "\n");
        let text = String::from_utf8(case.read("site.toml")).unwrap();
        let site: Table = text.parse().unwrap();
        let walk = Self {
            case,
            ran: site.clone(),
            site,
            begun: 0,
            published: true,
            kept: BTreeSet::new(),
        };
        walk.run("out", PUBLISH).unwrap();
        walk
    }

    /// Writes the site file.
    fn write(&self, site: &Table) {
        let text = toml::to_string(site).unwrap();
        self.case.write("site.toml", text);
    }

    /// Runs into a folder; the stages with their reasons.
    fn run(&self, out: &str, until: &str) -> Result<(Vec<StageReason>, Ending), String> {
        let config = SiteConfig::load(&self.case.path("site.toml"))
            .map_err(|failure| failure.to_string())?
            .config;
        let out = self.case.path(out);
        let hashes = HashCache::in_folder(&out, false);
        let options = options(&out, until, &hashes);
        let outcome = run_site(&config, &options).map_err(|failure| failure.to_string())?;
        Ok((outcome.stages, outcome.ending))
    }

    /// What a run into `out` would do; nothing of a site that cannot be planned.
    fn plan(&self, until: &str) -> Option<Vec<StageReason>> {
        let config = SiteConfig::load(&self.case.path("site.toml")).ok()?.config;
        let out = self.case.path("out");
        let hashes = HashCache::in_folder(&out, false);
        let plan = plan_site(&config, &options(&out, until, &hashes)).ok()?;
        Some(plan.stages)
    }

    /// Runs into an empty folder, hands it to `compared` and removes it.
    fn clean_from_nothing<T>(
        &mut self,
        until: &str,
        compared: impl FnOnce(&Self, &str, Result<Vec<StageReason>, String>) -> T,
    ) -> T {
        self.begun += 1;
        let clean = format!("clean{}", self.begun);
        let first = self.run(&clean, until).map(|(ran, _)| ran);
        let compared = compared(self, &clean, first);
        fs::remove_dir_all(self.case.path(&clean)).unwrap();
        compared
    }

    /// Plans and runs over what is there, and runs into an empty folder: the plan tells what the run does, and both
    /// runs leave the same. Gives what they say of a failure.
    fn compare(&mut self, what: &str, until: &str) -> Option<String> {
        let failure = self.step(what, until).err();
        if failure.is_none() {
            self.compare_with_clean(what, until);
        }
        failure
    }

    /// Plans and runs over what is there: the plan tells what the run does. A failure is that of a run from nothing.
    fn step(&mut self, what: &str, until: &str) -> Step {
        if let Err(failure) = SiteConfig::load(&self.case.path("site.toml")) {
            return Err(failure.to_string());
        }
        let before = products(&self.case.path("out"));
        let planned = self.plan(until);
        match self.run("out", until) {
            Ok((ran, ending)) => {
                agree(what, until, &planned.unwrap(), &ran);
                if let Ending::StoppedAfter(_) = ending {
                    assert_same(what, &before, &products(&self.case.path("out")));
                }
                self.published = until == PUBLISH;
                let kept = ran.iter().filter(|of| !of.reason.runs());
                self.kept.extend(kept.map(|of| of.stage.clone()));
                Ok(ran)
            }
            Err(again) => {
                self.clean_from_nothing(until, |walk, clean, first| {
                    let first = first.map_err(|first| first.replace(clean, "out"));
                    assert_eq!(Some(&again), first.as_ref().err(), "{what}");
                    assert_same(what, &before, &products(&walk.case.path("out")));
                });
                Err(again)
            }
        }
    }

    /// A run from nothing gives the outputs of stages that are there, and where it goes so far the products.
    fn compare_with_clean(&mut self, what: &str, until: &str) {
        let is_whole = until == PUBLISH;
        self.clean_from_nothing(until, |walk, clean, first| {
            let first = first.unwrap_or_else(|failure| panic!("{what}: from nothing {failure}"));
            let stages = first.iter().map(|of| &*of.stage);
            for stage in stages.filter(|stage| *stage != PUBLISH) {
                let [again, first] = ["out", clean].map(|folder| walk.output(folder, stage));
                // An adjustment that failed has no output; an earlier one may be stored and is not used.
                let may_fail = ["match_ties", "intersect", "adjust", "reorient"];
                let failed = first.is_none() && may_fail.iter().any(|name| stage.starts_with(name));
                assert!(failed || again == first, "{what}: {stage}");
            }
            if is_whole {
                let [again, first] = ["out", clean].map(|folder| products(&walk.case.path(folder)));
                assert_same(what, &again, &first);
            }
        });
        self.kept.clear();
    }

    /// The output of a stage with its inputs and its hash, as it is stored; `None` of an adjustment that failed.
    fn output(&self, folder: &str, stage: &str) -> Option<Vec<u8>> {
        let site = self.ran["site"].as_str().unwrap();
        let stored = format!("{folder}/{site}/.cache/{}", stage.replace('/', "+"));
        fs::read(self.case.path(&stored)).ok()
    }

    /// Goes from the last site to this one with one clean run for many steps, and with the power of one for each: where
    /// a stage would run that was kept since the last comparison, what it has is compared first, since a run would
    /// replace what a forgotten key left behind. A failed run changes nothing.
    fn go(&mut self, what: &str, site: &Table) -> Step {
        let runs = |planned: &[StageReason]| -> BTreeSet<String> {
            let runs = planned.iter().filter(|of| of.reason.runs());
            runs.map(|of| of.stage.clone()).collect()
        };
        self.write(site);
        let mut until = last_stage();
        let mut planned = self.plan(until).map(|planned| runs(&planned));
        // Where all stages are kept, the products must not have forgotten the change.
        if planned.as_ref().is_some_and(BTreeSet::is_empty) {
            until = PUBLISH;
            if !self.published {
                self.write(&self.ran.clone());
                self.step(what, PUBLISH)?;
                self.write(site);
            }
            planned = self.plan(until).map(|planned| runs(&planned));
        }
        // A site that cannot be planned may run any stage.
        if planned.is_none_or(|planned| !planned.is_disjoint(&self.kept)) {
            self.settle(what);
            self.write(site);
        }
        let step = self.step(what, until);
        if step.is_ok() {
            self.ran = site.clone();
        } else {
            let earlier = self.ran.clone();
            self.write(&earlier);
            self.step(what, last_stage())?;
        }
        step
    }

    /// Compares what is there with a clean run of the last site.
    fn settle(&mut self, what: &str) {
        self.write(&self.ran.clone());
        let until = if self.published {
            PUBLISH
        } else {
            last_stage()
        };
        self.compare_with_clean(&format!("before {what}"), until);
    }
}

/// A stage that a plan keeps is kept, one that it runs for a reason of its own runs for that reason, and one
/// whose inputs may change does either.
fn agree(what: &str, until: &str, planned: &[StageReason], ran: &[StageReason]) {
    let names =
        |of: &[StageReason]| -> Vec<String> { of.iter().map(|one| one.stage.clone()).collect() };
    let (planned_names, mut ran_names) = (names(planned), names(ran));
    if planned_names != ran_names {
        // Behind an adjustment that fails the run goes on with the products, or ends where no products are wanted.
        if until == PUBLISH {
            assert_eq!(ran_names.pop().as_deref(), Some(PUBLISH), "{what}");
        }
        // Pictures and a terrain model are made all the same.
        let goes_on = |stage: &mut String| ["map_surface", "lay_overlays"].contains(&&**stage);
        while ran_names.pop_if(goes_on).is_some() {}
        let failed = ran_names.last().map_or("", |stage| stage.as_str());
        let mut of_adjustment = ["match_ties", "intersect", "adjust", "reorient"].iter();
        let failed_there = of_adjustment.any(|stage| failed.starts_with(stage));
        assert!(
            failed_there || failed.ends_with("adjusted"),
            "{what}: {failed}"
        );
        assert_eq!(planned_names[..ran_names.len()], ran_names, "{what}");
    }
    for ran in ran {
        let planned = planned.iter().find(|of| of.stage == ran.stage).unwrap();
        let may_change = |reason: &Reason| reason.to_string().contains("may change");
        let open = may_change(&planned.reason);
        assert!(!may_change(&ran.reason), "{what}: {ran:?}");
        assert!(
            open || planned.reason == ran.reason,
            "{what}: {planned:?}, {ran:?}"
        );
    }
}

fn products(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut products = common::mission::products(out);
    for (path, bytes) in &mut products {
        if path.ends_with("manifest.json") {
            let mut manifest: serde_json::Value = serde_json::from_slice(bytes).unwrap();
            manifest["finished_utc"] = serde_json::Value::Null;
            *bytes = serde_json::to_vec(&manifest).unwrap();
        }
    }
    products
}

fn assert_same(what: &str, one: &BTreeMap<PathBuf, Vec<u8>>, other: &BTreeMap<PathBuf, Vec<u8>>) {
    assert!(
        one.keys().eq(other.keys()),
        "{what}: {:?}, {:?}",
        one.keys(),
        other.keys()
    );
    let differing: Vec<_> = one
        .keys()
        .filter(|path| one[*path] != other[*path])
        .collect();
    assert!(differing.is_empty(), "{what}: {differing:?}");
}

/// The table that a key stands in: of a list its first entry.
fn table_of<'a>(site: &'a mut Table, path: &str) -> Option<(&'a mut Table, String)> {
    let mut names: Vec<&str> = path.split('.').collect();
    let key = names.pop()?.to_owned();
    let mut table = site;
    for name in names {
        let entry = table
            .entry(name)
            .or_insert_with(|| Value::Table(Table::new()));
        table = match entry {
            Value::Array(entries) => entries.first_mut()?.as_table_mut()?,
            entry => entry.as_table_mut()?,
        };
    }
    Some((table, key))
}

/// Values of this kind, which differ from `now`; `names` are those that keys may take for files and identifiers.
fn others(kind: &ValueKind, now: Option<&Value>, names: &[&str]) -> Vec<Value> {
    let candidates: Vec<Value> = match kind {
        ValueKind::Number(accept) => {
            let number =
                |value: &Value| value.as_float().or(value.as_integer().map(|of| of as f64));
            let now = now.and_then(number).unwrap_or(1.0);
            [0.9 * now, 1.1 * now, now + 0.001, 0.5, 1.0]
                .into_iter()
                .filter(|value| accept.takes(*value))
                .map(Value::Float)
                .collect()
        }
        ValueKind::Whole { low, high, .. } => {
            let now = now.and_then(Value::as_integer).unwrap_or(*low);
            [now + 1, now - 1, *low, *high]
                .into_iter()
                .filter(|value| (low..=high).contains(&value))
                .map(Value::Integer)
                .collect()
        }
        ValueKind::Switch => vec![Value::from(false), Value::from(true)],
        ValueKind::Word(words) => words.iter().map(|word| Value::from(word.word)).collect(),
        ValueKind::Text { .. } => ["another text"]
            .iter()
            .chain(names)
            .map(|text| Value::from(*text))
            .collect(),
        ValueKind::List { of, .. } => {
            let now = now.and_then(Value::as_array).cloned().unwrap_or_default();
            let mut lists = Vec::new();
            for (index, entry) in now.iter().enumerate() {
                for other in others(of, Some(entry), names) {
                    let mut list = now.clone();
                    list[index] = other;
                    lists.push(Value::Array(list));
                }
            }
            // In another order.
            lists.push(Value::Array(now.iter().rev().cloned().collect()));
            if !names.is_empty() {
                let longer = others(of, None, names)
                    .into_iter()
                    .map(|other| [&now[..], &[other]].concat());
                lists.extend(longer.map(Value::Array));
                let shorter = now.split_last().map(|(_, rest)| rest.to_vec());
                lists.extend(shorter.map(Value::Array));
            }
            lists
        }
        ValueKind::Form { .. }
        | ValueKind::File
        | ValueKind::Folder
        | ValueKind::Mirror
        | ValueKind::Glob => names.iter().map(|name| Value::from(*name)).collect(),
    };
    candidates
        .into_iter()
        .filter(|value| Some(value) != now)
        .collect()
}

/// The site with another value of `key`, in every way that its declaration allows, and with the `names` that it may take.
fn changed(site: &Table, key: &DeclaredKey, names: &[&str]) -> Vec<Table> {
    let mut with_table = site.clone();
    let Some((table, name)) = table_of(&mut with_table, &key.path) else {
        return Vec::new();
    };
    let default = key
        .default
        .as_ref()
        .map(|value| Value::try_from(value).unwrap());
    let now = table.get(&name).cloned().or(default);
    let set = |value: Value| {
        let mut site = site.clone();
        let (table, name) = table_of(&mut site, &key.path).unwrap();
        table.insert(name, value);
        site
    };
    others(&key.kind, now.as_ref(), names)
        .into_iter()
        .map(set)
        .collect()
}

/// What keys that name something may be changed to: files beside those of the site, orbit solutions, images, a clock and
/// a time a little off those of the labels. A key takes what its form and its use accept.
const NAMES: [&str; 20] = [
    "kernels/gsfc.tm",
    "kernels/mgs_gsfc_scene.bsp",
    "kernels/mars_iau1991.tpc",
    "other_kernels",
    "labels/other.lbl",
    "ties/other.csv",
    "pedr/other/ap19019k.b",
    "pedr/*.b",
    "images/other.img",
    "other.geojson",
    "other_laser.toml",
    "other_camera.toml",
    "other_image.json",
    "gsfc",
    "mgs_nav_scene.bsp",
    "E02-02016",
    "E02-01301",
    "nominal",
    "669166528:120",
    "2001-03-15T23:34:57.71",
];

/// Copies of the site's files, each with a change that products show.
fn write_others(case: &Case) {
    let text = |path: &str| String::from_utf8(case.read(path)).unwrap();
    for folder in ["other_kernels", "pedr/other"] {
        fs::create_dir(case.path(folder)).unwrap();
    }
    for entry in fs::read_dir(case.path("kernels")).unwrap() {
        let name = entry.unwrap().file_name();
        let from = case.path("kernels").join(&name);
        fs::copy(from, case.path("other_kernels").join(&name)).unwrap();
    }
    fs::copy(
        case.path("kernels/mgs_gsfc_scene.bsp"),
        case.path("other_kernels/mgs_nav_scene.bsp"),
    )
    .unwrap();
    fs::copy(
        case.path("pedr/ap19019k.b"),
        case.path("pedr/other/ap19019k.b"),
    )
    .unwrap();
    case.write(
        "labels/other.lbl",
        [
            b"/* another remark */\r\n",
            &*case.read("labels/E02-01301.lbl"),
        ]
        .concat(),
    );
    fs::create_dir(case.path("images")).unwrap();
    for (level, name) in [(80, "one"), (90, "two"), (100, "other")] {
        let mut raster = b"PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 1024\r\n^IMAGE = 2\r\nINSTRUMENT_ID = \"MOC-NA\"\r\n\
            OBJECT = IMAGE\r\nLINES = 1600\r\nLINE_SAMPLES = 1024\r\nSAMPLE_BITS = 8\r\nEND_OBJECT = IMAGE\r\nEND\r\n"
            .to_vec();
        raster.resize(1024, b' ');
        raster.extend(vec![level; 1600 * 1024]);
        case.write(&format!("images/{name}.img"), raster);
    }
    let ties = text("ties/isidis.csv");
    let fewer: Vec<&str> = ties.lines().take(81).collect();
    case.write("ties/other.csv", fewer.join("\n") + "\n");
    let outline = |west: f64| {
        format!(
            r#"{{"type": "Polygon", "coordinates": [[[{west}, 4], [88.25, 4], [88.25, 5], [{west}, 5], [{west}, 4]]]}}"#
        )
    };
    case.write("outline.geojson", outline(87.75));
    case.write("other.geojson", outline(87.8));
    let shots = text("out/isidis/footprints.csv");
    let times = text("out/isidis/exchange/lola_like.csv");
    case.write("shots.csv", with_more_columns(&shots, &times));
    let isd = text("out/isidis/images/E02-01301/isd.json");
    case.write("image.json", &isd);
    case.write(
        "other_image.json",
        isd.replace("\"focal_length\": 3500.0", "\"focal_length\": 3500.1"),
    );
    let laser = include_str!("../../config/altimeters/mola.toml");
    case.write(
        "laser.toml",
        laser.replace("name = \"MOLA\"", "name = \"laser\""),
    );
    case.write(
        "other_laser.toml",
        laser.replace("Laser Altimeter\"", "Laser\""),
    );
    let camera = include_str!("../../config/instruments/moc_na.toml");
    case.write(
        "camera.toml",
        camera.replace("name = \"MOC", "name = \"My MOC"),
    );
    case.write(
        "other_camera.toml",
        camera.replace("focal_length_mm = 3500.0", "focal_length_mm = 3500.1"),
    );
}

/// A table of shots with its lengths in kilometres as well, and times in UTC, the first column of `times`.
fn with_more_columns(shots: &str, times: &str) -> String {
    let mut lines = shots.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let lengths = ["radius", "range", "spacecraft_radius"];
    let columns = lengths.map(|name| {
        let metres = format!("{name}_m");
        header.iter().position(|column| *column == metres).unwrap()
    });
    let mut text = header.join(",") + ",radius_km,range_km,spacecraft_radius_km,utc\n";
    for (line, times) in lines.zip(times.lines().skip(1)) {
        let fields: Vec<&str> = line.split(',').collect();
        text += line;
        for column in columns {
            let metres: f64 = fields[column].parse().unwrap();
            text.extend([",", &(metres / 1_000.0).to_string()]);
        }
        let utc = times.split(',').next().unwrap();
        text.extend([",", utc, "\n"]);
    }
    text
}

/// The site, and others that have the tables and keys which it has not.
fn sites(site: &Table) -> Vec<Table> {
    let with = |table: &str| {
        let mut site = site.clone();
        for (key, value) in table.parse::<Table>().unwrap() {
            let now = site.entry(&key).or_insert(Value::Array(Vec::new()));
            match (now, value) {
                // Of a list of tables the first one gets the keys.
                (Value::Array(entries), Value::Array(with))
                    if !entries.is_empty() && key != "windows" =>
                {
                    let entry = entries[0].as_table_mut().unwrap();
                    entry.extend(with[0].as_table().unwrap().clone());
                }
                (Value::Table(now), Value::Table(with)) if key != "kernels" => now.extend(with),
                (now, value) => *now = value,
            }
        }
        site
    };
    vec![
        site.clone(),
        with("kernels = { root = 'kernels', spk_family = 'nav' }"),
        with(
            "kernels.files = ['kernels/leapseconds.tls', 'kernels/mgs_clock.tsc', 'kernels/mars_iau2000.tpc', \
             'kernels/moc.ti', 'kernels/mars_sun_scene.bsp', 'kernels/mgs_nav_scene.bsp', 'kernels/mgs_sc_scene.bc']",
        ),
        with(
            "kernels.sets = [{ id = 'nav', metakernel = 'kernels/nav.tm' }, { id = 'ipng', metakernel = 'kernels/ipng.tm' }]",
        ),
        with(
            "kernels.sets = [{ id = 'nav', files = ['kernels/leapseconds.tls', 'kernels/mgs_clock.tsc', \
             'kernels/mars_iau2000.tpc', 'kernels/moc.ti', 'kernels/mars_sun_scene.bsp', 'kernels/mgs_nav_scene.bsp', \
             'kernels/mgs_sc_scene.bc'] }, { id = 'ipng', metakernel = 'kernels/ipng.tm' }]",
        ),
        with("windows = [{ id = 'isidis', polygon = 'outline.geojson' }]"),
        with("windows = [{ id = 'isidis', image = 'E02-01301', margin_km = 5.0 }]"),
        with("images = [{ isd = 'image.json' }]"),
        // The image's own line times, in two pieces.
        with(
            "images = [{ exposures = [[0, 37971361.905, 0.9642], [4000, 37971365.7618, 0.9642]] }]",
        ),
        with("altimeter = 'laser.toml'\nimages = [{ instrument = 'camera.toml' }]"),
        with(
            "adjustment.images = [{ id = 'E02-01301', position_m = [30, 0.3, 0, 30, 0.3, 0, 30, 0.3, 0], \
             rotation_arcsec = [10, 1, 0, 10, 1, 0, 10, 1, 0] }]",
        ),
        mapped(site),
        with("adjustment.model = 'published'"),
        with("adjustment.robust = 'huber'"),
        of_any_body(site),
        by_table(site, "layout = 'areograph'"),
        by_table(
            site,
            "columns = { utc = 'utc', longitude_deg = 'longitude_deg', latitude_deg = 'latitude_deg', radius_m = 'radius_m', \
             range_m = 'range_m', spacecraft_longitude_deg = 'spacecraft_longitude_deg', spacecraft_latitude_deg = \
             'spacecraft_latitude_deg', spacecraft_radius_m = 'spacecraft_radius_m', orbit = 'orbit' }",
        ),
        by_table(
            site,
            "columns = { et_s = 'et_tag_s', longitude_deg = 'longitude_deg', latitude_deg = 'latitude_deg', \
             height_m = 'topography_m', range_m = 'range_m', spacecraft_longitude_deg = 'spacecraft_longitude_deg', \
             spacecraft_latitude_deg = 'spacecraft_latitude_deg', spacecraft_radius_m = 'spacecraft_radius_m' }",
        ),
        by_table(
            site,
            "columns = { et_s = 'et_s', longitude_deg = 'longitude_deg', latitude_deg = 'latitude_deg', \
             radius_km = 'radius_km', range_km = 'range_km', spacecraft_longitude_deg = 'spacecraft_longitude_deg', \
             spacecraft_latitude_deg = 'spacecraft_latitude_deg', spacecraft_radius_km = 'spacecraft_radius_km' }",
        ),
    ]
}

/// The site with nothing that belongs to Mars but the support data of an image, which say so.
fn of_any_body(site: &Table) -> Table {
    let mut site = site.clone();
    site.retain(|key, _| ["site", "kernels"].contains(&key));
    let image: Table = "id = 'E02-01301'\nisd = 'image.json'".parse().unwrap();
    site.insert("images".to_owned(), Value::Array(vec![Value::Table(image)]));
    site
}

/// The site with its shots from a table, in place of PEDR files.
fn by_table(site: &Table, columns: &str) -> Table {
    let mut site = site.clone();
    site.remove("pedr");
    let table: Table = format!("files = ['shots.csv']\n{columns}").parse().unwrap();
    site.insert("shots".to_owned(), Value::Array(vec![Value::Table(table)]));
    site
}

/// The site with the pixels of its images, in which tie points are matched beside those of its file.
fn matched(site: &Table) -> Table {
    let mut site = site.clone();
    let images = site["images"].as_array_mut().unwrap();
    for (image, name) in images.iter_mut().zip(["one", "two"]) {
        let pixels = Value::from(format!("images/{name}.img"));
        image
            .as_table_mut()
            .unwrap()
            .insert("pixels".to_owned(), pixels);
    }
    let ties = site["ties"].as_table_mut().unwrap();
    ties.insert("match".to_owned(), Value::from(true));
    site
}

/// The same with a terrain model of both.
fn mapped(site: &Table) -> Table {
    let mut site = matched(site);
    let surface = "cell_m = 200.0\nimages = ['E02-01301', 'E02-02016']";
    let surface: Table = surface.parse().unwrap();
    site.insert("surface".to_owned(), Value::Table(surface));
    site
}

/// Keys whose change is no change of a site, and why.
const NO_CHANGE: [(&str, &str); 2] = [
    (
        "site",
        "products of another identifier are those of another site, and stay beside the first ones",
    ),
    (
        "calibration.from",
        "no calibration of a camera of these sites; `tests/real/hrsc_calibration.rs` has one",
    ),
];

/// The sites with another value of `key` that a site file may have.
fn accepted(walk: &Walk, site: &Table, key: &DeclaredKey) -> Vec<Table> {
    let mut ways = changed(site, key, &NAMES);
    ways.retain(|changed| {
        walk.write(changed);
        SiteConfig::load(&walk.case.path("site.toml")).is_ok()
    });
    ways
}

/// Of so many keys one is tried in every run.
const SHORT_RUN: usize = 24;

#[test]
fn after_a_change_of_any_key_a_run_gives_what_a_clean_run_gives() {
    let mut walk = Walk::new();
    write_others(&walk.case);
    let mut open: Vec<DeclaredKey> = config::keys();
    open.retain(|key| NO_CHANGE.iter().all(|(path, _)| *path != key.path));
    // In the long run every key: each takes some seconds of a processor.
    let every = if common::long() { 1 } else { SHORT_RUN };
    open = open.into_iter().step_by(every).collect();
    let (mut tried, mut refused) = (0, Vec::new());
    for (number, site) in sites(&walk.site).into_iter().enumerate() {
        // Every site is run in the long run, and where a key is left for it.
        let has_key = |key: &DeclaredKey| !accepted(&walk, &site, key).is_empty();
        if !common::long() && !open.iter().any(has_key) {
            continue;
        }
        let step = walk.go(&format!("site {number}"), &site);
        let stages = step.unwrap_or_else(|failure| panic!("site {number}: {failure}"));
        // Keys that many stages see come first, those that the same stages see one after the other: then few stages run
        // that were kept before, and few comparisons serve all.
        let mut left = Vec::new();
        let mut ordered = Vec::new();
        for key in open {
            match accepted(&walk, &site, &key).first() {
                None => left.push(key),
                Some(changed) => {
                    walk.write(changed);
                    let planned = walk.plan(last_stage()).unwrap_or_default();
                    let kept = planned.iter().filter(|of| !of.reason.runs());
                    let kept: Vec<String> = kept.map(|of| of.stage.clone()).collect();
                    ordered.push((kept.len(), kept, key));
                }
            }
        }
        ordered.sort_by(|one, other| (one.0, &one.1).cmp(&(other.0, &other.1)));
        let mut now = site.clone();
        for (_, _, key) in ordered {
            let mut outcome = None;
            // What the keys before have left may exclude what the site itself allows.
            for from in [now.clone(), site.clone()] {
                for changed in accepted(&walk, &from, &key) {
                    let step = walk.go(&key.path, &changed);
                    outcome = Some(step.as_ref().err().cloned());
                    // A value that a run refuses says less than one that it takes.
                    if let Ok(ran) = step {
                        // One with which an adjustment fails would hide stages from the keys behind.
                        if ran.len() >= stages.len() {
                            now = changed;
                        }
                        break;
                    }
                }
                if outcome == Some(None) {
                    break;
                }
            }
            match outcome {
                None => left.push(key),
                Some(failure) => {
                    tried += 1;
                    refused.extend(failure.map(|failure| format!("{}: {failure}", key.path)));
                }
            }
        }
        walk.write(&walk.ran.clone());
        let failure = walk.compare(&format!("the end of site {number}"), PUBLISH);
        assert!(failure.is_none(), "site {number}: {failure:?}");
        open = left;
    }
    let open: Vec<String> = open.into_iter().map(|key| key.path).collect();
    println!("{tried} keys tried; refused by both runs: {refused:#?}");
    assert!(open.is_empty(), "not tried: {open:?}");
}

/// Numbers that look random and are always the same (Knuth's multiplier for 64 bits).
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % end
    }
}

/// Changes an input file in a way that a run must notice, or must see through.
fn change_file(case: &Case, dice: &mut Dice) -> &'static str {
    match dice.below(8) {
        0 => {
            let mut label = case.read("labels/E02-01301.lbl");
            label.splice(0..0, *b"/* another remark */\r\n");
            case.write("labels/E02-01301.lbl", label);
            "a remark in a label"
        }
        1 => {
            let ties = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
            let ties = if ties.contains("\r\n") {
                ties.replace("\r\n", "\n")
            } else {
                ties.replace('\n', "\r\n")
            };
            case.write("ties/isidis.csv", ties);
            "line ends of the tie points"
        }
        2 => {
            let mut bytes = case.read("pedr/ap19117l.b");
            bytes[7_760 + 480] ^= 1; // an engineering byte, far from every footprint
            case.write("pedr/ap19117l.b", bytes);
            "a byte of a PEDR file"
        }
        3 => {
            let mut text = case.read("kernels/leapseconds.tls");
            text.extend(b"\nA remark after the last table.\n");
            case.write("kernels/leapseconds.tls", text);
            "a remark in a text kernel"
        }
        4 => {
            let [nav, gsfc] = ["kernels/mgs_nav_scene.bsp", "kernels/mgs_gsfc_scene.bsp"];
            let (one, other) = (case.read(nav), case.read(gsfc));
            case.write(nav, other);
            case.write(gsfc, one);
            "exchanged orbits"
        }
        5 => {
            let ties = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
            let mut lines: Vec<&str> = ties.lines().collect();
            if lines.len() > 61 {
                lines.truncate(lines.len() - 2);
            }
            case.write("ties/isidis.csv", lines.join("\n") + "\n");
            "two measurements less"
        }
        6 => {
            let text = String::from_utf8(case.read("labels/E02-02016.lbl")).unwrap();
            case.write("labels/E02-02016.lbl", text);
            "a label written anew as it was"
        }
        _ => {
            // After a step that stopped before the products it may be gone already.
            let _ = fs::remove_file(case.path("out/isidis/footprints.csv"));
            "a product removed"
        }
    }
}

/// Changes the order of tables, or goes back to the first site file.
fn change_order(site: &mut Table, first: &Table, dice: &mut Dice) -> &'static str {
    match dice.below(3) {
        0 => {
            site["images"].as_array_mut().unwrap().reverse();
            "images in another order"
        }
        1 => {
            site["windows"].as_array_mut().unwrap().reverse();
            "windows in another order"
        }
        _ => {
            *site = first.clone();
            "the first site file again"
        }
    }
}

#[test]
fn over_a_random_walk_of_changes_a_run_gives_what_a_clean_run_gives() {
    let steps = if common::long() { 300 } else { 16 };
    let mut walk = Walk::new();
    let (mut dice, keys, mut failures) = (Dice(20_261_121), config::keys(), 0);
    let mut site = walk.site.clone();
    for step in 0..steps {
        let earlier = site.clone();
        let what = match dice.below(10) {
            0..=3 => {
                let key = &keys[dice.below(keys.len())];
                let ways = changed(&site, key, &[]);
                if !ways.is_empty() {
                    site = ways[dice.below(ways.len())].clone();
                }
                key.path.clone()
            }
            4..=7 => change_file(&walk.case, &mut dice).to_owned(),
            _ => change_order(&mut site, &walk.site, &mut dice).to_owned(),
        };
        // Products follow from the outputs of stages: those of every tenth step are made and compared.
        let until = if dice.below(8) == 0 {
            STAGES[dice.below(STAGES.len())]
        } else if step % 10 == 9 {
            PUBLISH
        } else {
            last_stage()
        };
        walk.write(&site);
        if walk
            .compare(&format!("step {step}: {what}, until {until}"), until)
            .is_some()
        {
            failures += 1;
            site = earlier;
        }
    }
    // Refused values and failed runs change nothing, and must not be the rule.
    assert!(failures < steps / 4, "{failures} of {steps} steps failed");
}
