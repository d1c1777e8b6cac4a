//! The front pages: command blocks of README and guide are run as they stand, links lead to files and headings that exist, and the
//! pages keep their length.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "tests work in temporary folders and may fail loudly"
)]

use std::{
    collections::BTreeSet,
    fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    process::Command,
};

use areograph::config::{CalibrationConfig, CampaignConfig, Document as _, SiteConfig};
use areograph_testing::checkout;

use crate::common::mission::{areograph, mission};

/// Most words of a page, so that a newcomer reads it to its end.
const WORDS: [(&str, usize); 3] = [
    ("README.md", 1_200),
    ("ARCHITECTURE.md", 1_700),
    ("docs/house_style.md", 450),
];

/// Starts of commands that other tests run, with what runs them.
const ELSEWHERE: [(&str, &str); 22] = [
    ("gdalwarp -tps image.tif ", "tests/real/real_map.rs"),
    ("scripts/", "continuous integration"),
    (
        "areograph scene mission mission ",
        "every test that uses the mission",
    ),
    ("areograph serve --init service-demo ", "tests/service"),
    (
        "areograph serve service-demo/areograph.toml ",
        "tests/service",
    ),
    (
        "areograph service check mars/",
        "tests/service/service_check.rs, with a port of its own",
    ),
    ("areograph serve mars/", "tests/service/service_check.rs"),
    (
        "cp service-demo/updates/",
        "tests/service/service_run.rs, after the sites have run",
    ),
    (
        "areograph pedr qa archive/pedr --kernels archive/kernels/archive.tm --out qa --executor slurm",
        "tests/commands/pedr_qa_cluster.rs, with stand-ins for Slurm",
    ),
    ("areograph pedr sql", "tests/sql, with its feature"),
    ("areograph pedr cluster", "tests/cluster, with its feature"),
    ("areograph pedr index https:", "remote, with a server"),
    ("areograph pedr search mola ", "remote"),
    (
        "areograph scene calibration pixels",
        "tests/stages/calibration_loop.rs",
    ),
    (
        "areograph calibrate pixels",
        "tests/stages/calibration_loop.rs",
    ),
    (
        "areograph scene mission mission-images",
        "crates/scene: matching",
    ),
    ("areograph image", "tests/commands/image_commands.rs"),
    (
        "areograph init gale --place",
        "tests/commands/fetch.rs, with an index of its own",
    ),
    (
        "areograph init gusev_site --shots",
        "tests/commands/init.rs, with tables of its own",
    ),
    (
        "areograph fetch ",
        "tests/commands/fetch.rs, from a server of this computer",
    ),
    (
        "areograph pedr info gusev/",
        "tests/real/ode_tables.rs, with real tables",
    ),
    (
        "areograph pedr search gusev/",
        "tests/real/ode_tables.rs, with real tables",
    ),
];

/// What a pair has beside the shortest site file, for the examples of tie points and terrain.
const SECOND_IMAGE: &str =
    "[[images]]\nid = \"second\"\nlabel = \"../second.lbl\"\npixels = \"../second.imq\"\n";

/// Commands that end with another code than 0, as the guide states.
const ENDS: [(&str, i32); 1] = [("areograph pedr qa", 5)];

/// The pages for users: README, then the chapters in the order of the guide.
fn pages() -> Vec<PathBuf> {
    let guide = checkout().join("docs/guide/src");
    let summary = fs::read_to_string(guide.join("SUMMARY.md")).unwrap();
    let chapters = links(&summary).map(|(file, _)| guide.join(file));
    [checkout().join("README.md")]
        .into_iter()
        .chain(chapters)
        .collect()
}

/// Targets of the links of a page outside fenced blocks: file and anchor, either of which may be empty.
fn links(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let prose = text.split("```").step_by(2);
    let targets = prose.flat_map(|part| part.split("](").skip(1));
    targets
        .filter_map(|after| after.split_once(')'))
        .map(|(target, _)| target.split_once('#').unwrap_or((target, "")))
}

/// The anchor of a heading as forges and mdBook make it.
fn anchor(heading: &str) -> String {
    let kept = |of: char| of.is_alphanumeric() || matches!(of, '-' | '_' | ' ');
    let heading = heading.trim().to_lowercase();
    heading
        .chars()
        .filter(|of| kept(*of))
        .map(|of| if of == ' ' { '-' } else { of })
        .collect()
}

/// Commands of the blocks marked `sh`, without their comments; one may go over several lines.
fn commands(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let mut commands: Vec<String> = Vec::new();
    for block in text.split("```").skip(1).step_by(2) {
        let (language, block) = block.split_once('\n').unwrap();
        assert!(
            ["sh", "text", "toml", "json", "python"].contains(&language),
            "{}: a block of {language:?}",
            page.display()
        );
        if language != "sh" {
            continue;
        }
        let first = commands.len();
        for line in block.lines().filter(|line| !line.is_empty()) {
            let line = line.split(" # ").next().unwrap().trim_end();
            assert!(!line.ends_with('\\') && !line.starts_with('#'), "{line}");
            if line.starts_with(' ') && commands.len() > first {
                commands.last_mut().unwrap().push_str(line);
            } else {
                commands.push(line.to_owned());
            }
        }
    }
    commands
}

/// The entry of [`ELSEWHERE`] that a command belongs to.
fn elsewhere(command: &str) -> Option<&'static str> {
    let whole = format!("{command} ");
    let mut starts = ELSEWHERE.iter().map(|(start, _)| *start);
    starts.find(|start| whole.starts_with(start))
}

#[test]
fn commands_that_are_tested_elsewhere_exist() {
    let mut left = BTreeSet::new();
    for command in pages().iter().flat_map(|page| commands(page)) {
        let Some(start) = elsewhere(&command) else {
            continue;
        };
        let script = start.starts_with("scripts/");
        let name = command.split(' ').next().unwrap();
        assert!(!script || checkout().join(name).exists(), "{command}");
        left.insert(start);
    }
    assert_eq!(left.len(), ELSEWHERE.len(), "of ELSEWHERE only {left:?}");
}

#[test]
fn commands_of_the_first_front_pages_work_as_they_stand() {
    commands_work(|page| page % 2 == 0);
}

#[test]
fn commands_of_the_other_front_pages_work_as_they_stand() {
    commands_work(|page| page % 2 == 1);
}

/// Every command of the pages with these numbers ends as expected.
fn commands_work(is_meant: impl Fn(usize) -> bool) {
    let folder = tempfile::tempdir().unwrap();
    let program = PathBuf::from(areograph().get_program());
    let path = format!(
        "{}:{}",
        program.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    // A window of many, which the chapter on the archive names.
    let windows =
        "[[windows]]\nid = \"gale\"\nlongitude_deg = [137.0, 138.0]\nlatitude_deg = [-5.5, -4.0]\n";
    let mut run = 0;
    let pages = pages().into_iter().enumerate();
    for (_, page) in pages.filter(|(number, _)| is_meant(*number)) {
        // No page needs what the commands of another one wrote.
        let folder = folder.path().join(page.file_stem().unwrap());
        fs::create_dir(&folder).unwrap();
        symlink(mission(), folder.join("mission")).unwrap();
        fs::write(folder.join("many.toml"), windows).unwrap();
        for command in commands(&page) {
            if elsewhere(&command).is_some() {
                continue;
            }
            let ends = ENDS.iter().find(|(start, _)| command.starts_with(start));
            let output = Command::new("sh")
                .args(["-c", &command])
                .current_dir(&folder)
                .env("PATH", &path)
                .output()
                .unwrap();
            assert_eq!(
                output.status.code(),
                Some(ends.map_or(0, |(_, code)| *code)),
                "{}: {command}\n{}",
                page.display(),
                String::from_utf8_lossy(&output.stderr)
            );
            run += 1;
        }
    }
    assert!(run >= 8, "only {run} commands were found");
}

#[test]
fn site_files_of_the_front_pages_are_valid() {
    let text: Vec<String> = pages()
        .iter()
        .map(|page| fs::read_to_string(page).unwrap())
        .collect();
    let blocks = text.iter().flat_map(|text| text.split("```toml").skip(1));
    let blocks: Vec<&str> = blocks
        .map(|block| block.split("```").next().unwrap())
        .collect();
    let is_whole = |block: &&&str| block.trim().starts_with("site = ");
    let whole = blocks.iter().find(is_whole).unwrap();
    for block in &blocks {
        let path = checkout().join("sites/site.toml");
        // The files that an example names do not exist.
        let is_of_campaign = |block: &&&str| block.trim().starts_with("campaign = ");
        let failure = if is_of_campaign(&block) {
            CampaignConfig::parse(block, &path).unwrap_err()
        } else if block.trim().starts_with("[executor]") {
            let campaign = blocks.iter().find(is_of_campaign).unwrap();
            CampaignConfig::parse(&format!("{campaign}\n{block}"), &path).unwrap_err()
        } else if block.trim().starts_with("calibration = ") {
            CalibrationConfig::parse(block, &path).unwrap_err()
        } else if is_whole(&block) {
            SiteConfig::parse(block, &path).unwrap_err()
        } else {
            let site = format!("{whole}\n{SECOND_IMAGE}\n{block}");
            SiteConfig::parse(&site, &path).unwrap_err()
        };
        let failure = failure.to_string();
        let of_files = |line: &&str| {
            let file = [
                "an existing file",
                "an existing folder",
                "a file, a folder or a matching glob",
            ];
            let mut file = file.iter().map(|kind| format!("; expected {kind}"));
            file.any(|kind| line.contains(&kind))
        };
        let other = failure.lines().filter(|line| line.contains("; expected"));
        let other: Vec<&str> = other.filter(|line| !of_files(line)).collect();
        assert!(other.is_empty(), "{block}{other:#?}");
    }
    assert!(blocks.len() >= 4, "only {} blocks", blocks.len());
}

#[test]
fn links_lead_somewhere() {
    let root = checkout();
    let others = [
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "docs/house_style.md",
        "docs/glossary.md",
    ];
    let others = others.map(|page| root.join(page));
    let mut dead = Vec::new();
    let mut count = 0;
    for page in pages().into_iter().chain(others) {
        let text = fs::read_to_string(&page).unwrap();
        for (file, heading) in links(&text) {
            if file.contains("://") {
                continue;
            }
            count += 1;
            let target = match file {
                "" => page.clone(),
                file => page.parent().unwrap().join(file),
            };
            let leads = heading.is_empty() && target.exists()
                || fs::read_to_string(&target).is_ok_and(|text| {
                    let prose: String = text.split("```").step_by(2).collect();
                    let headings = prose.lines().filter(|line| line.starts_with('#'));
                    let mut anchors = headings.map(|line| anchor(line.trim_start_matches('#')));
                    anchors.any(|of| of == heading)
                });
            if !leads {
                dead.push(format!("{}: {file}#{heading}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{}", dead.join("\n"));
    assert!(count >= 100, "only {count} links were found");
}

#[test]
fn front_pages_keep_their_length() {
    for (page, most) in WORDS {
        let text = fs::read_to_string(checkout().join(page)).unwrap();
        let words = text.split_whitespace().count();
        assert!(
            words <= most,
            "{page}: {words} words; expected at most {most}"
        );
    }
}
