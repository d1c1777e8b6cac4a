//! Arrows point down: a room uses the floors below it, never one above; files use each other one way;
//! no stage calls another.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

pub(crate) mod uses;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::PathBuf,
};

use areograph_testing::checkout;

use uses::{Module, Sources, files_below};

/// Rooms of the program by floor, the lowest first; see ARCHITECTURE.md. What lies below them are crates, whose arrows
/// the compiler checks.
const FLOORS: [&[&str]; 6] = [
    &["stages"],
    &["report", "products"],
    &["capabilities"],
    &["flow"],
    &["worker"],
    &["cli"],
];

/// Arrows inside a floor that are meant: the report shows what was published.
const SAME_FLOOR: [(&str, &str); 1] = [("report", "products")];

/// The folders of sources of the member crates, but of what tests share.
fn member_sources() -> Vec<PathBuf> {
    let members = fs::read_dir(checkout().join("crates")).unwrap();
    let members = members.map(|member| member.unwrap().path().join("src"));
    members
        .filter(|member| !member.starts_with(checkout().join("crates/testing")))
        .collect()
}

/// All sources that are built into the program.
fn all_sources() -> Vec<PathBuf> {
    let mut files = Vec::new();
    files_below(&checkout().join("src"), &mut files);
    for member in member_sources() {
        files_below(&member, &mut files);
    }
    files.sort();
    files
}

fn floor(room: &str) -> usize {
    FLOORS
        .iter()
        .position(|rooms| rooms.contains(&room))
        .unwrap_or_else(|| {
            panic!("`{room}` is in no floor: add it to ARCHITECTURE.md and to this test")
        })
}

#[test]
fn arrows_point_down() {
    let sources = Sources::of_the_program();
    let mut wrong = Vec::new();
    for module in sources.modules() {
        let room = &module[0];
        for used in sources.uses(module) {
            let Some(used) = used.file.first() else {
                continue;
            };
            let down = floor(used) < floor(room);
            let meant = SAME_FLOOR.contains(&(&**room, &**used));
            if used != room && !down && !meant {
                wrong.push(format!("{}: {room} -> {used}", module.join("/")));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "arrows that do not point down:\n{}",
        wrong.join("\n")
    );
}

/// Arrows from file to file that lie on a circle.
fn circles(sources: &Sources) -> Vec<String> {
    let files_used = |module: &Module| -> BTreeSet<Module> {
        let uses = sources.uses(module).into_iter();
        uses.map(|used| used.file).collect()
    };
    let arrows: BTreeMap<&Module, BTreeSet<Module>> = sources
        .modules()
        .map(|module| (module, files_used(module)))
        .collect();
    let leads_back = |from: &Module, to: &Module| {
        let (mut seen, mut ahead) = (BTreeSet::new(), vec![from]);
        while let Some(module) = ahead.pop() {
            let next = arrows.get(module).into_iter().flatten();
            ahead.extend(next.filter(|next| seen.insert(*next)));
        }
        seen.contains(to)
    };
    let all = arrows
        .iter()
        .flat_map(|(from, to)| to.iter().map(move |to| (*from, to)));
    all.filter(|(from, to)| leads_back(to, from))
        .map(|(from, to)| format!("{} -> {}", from.join("/"), to.join("/")))
        .collect()
}

#[test]
fn files_use_each_other_one_way() {
    let mut circles = circles(&Sources::of_the_program());
    for crate_sources in member_sources() {
        circles.extend(self::circles(&Sources::below(&crate_sources)));
    }
    assert!(
        circles.is_empty(),
        "files that use each other in a circle:\n{}",
        circles.join("\n")
    );
}

/// Stages share types; what one of them does is for the flow alone to ask.
#[test]
fn no_stage_calls_another() {
    let sources = Sources::of_the_program();
    let mut calls = Vec::new();
    let in_stages = |module: &&Module| module.len() > 1 && module[0] == "stages";
    for module in sources.modules().filter(in_stages) {
        for used in sources.uses(module) {
            let other =
                used.file.len() > 1 && used.file[0] == "stages" && used.file[1] != module[1];
            let name = used.item.unwrap_or_default();
            let function = name.starts_with(|first: char| first.is_ascii_lowercase());
            if other && function {
                calls.push(format!("{}: {name}", module.join("/")));
            }
        }
    }
    assert!(
        calls.is_empty(),
        "functions of other stages:\n{}",
        calls.join("\n")
    );
}

/// What products hold is known before they are written: writers and pages see no kernels loaded.
#[test]
fn no_writer_opens_spice() {
    let sources = Sources::of_the_program();
    let mut opened = Vec::new();
    let writers = sources.modules().filter(|module| {
        let rooms = ["products", "report"];
        rooms.contains(&&*module[0])
    });
    for module in writers {
        let opens = |path: &&Module| {
            path[0] == "spice" && ["Session", "KernelView"].contains(&&**path.last().unwrap())
        };
        for path in sources.paths(module).filter(opens) {
            opened.push(format!("{}: {}", module.join("/"), path.join("::")));
        }
    }
    assert!(
        opened.is_empty(),
        "writers that open SPICE:\n{}",
        opened.join("\n")
    );
}

fn texts(files: &[(&str, &str)]) -> Sources {
    let module = |path: &str| path.split_terminator('/').map(str::to_owned).collect();
    Sources::of_texts(
        files
            .iter()
            .map(|(path, text)| (module(path), (*text).to_owned())),
    )
}

#[test]
fn uses_are_read_whatever_their_form() {
    let text = "use crate::{a::{self, b as bee, c}, d,\n  e::f};\n/// [`crate::y`]\nuse super::h::T;\n\
                fn x() { crate::g::h::<u8>(); println!(\"crate::z {}\", crate::p::Q::new()); inner::i(); }\n\
                #[cfg(test)]\nmod tests { use crate::z; }\nmod inner;";
    let mut files = vec![("room/one", text), ("room", "pub use two::T as h;\n")];
    files.push(("room/one/inner", ""));
    files.push(("room/h", ""));
    files.extend(["a", "d", "e", "g", "y", "z", "p"].map(|name| (name, "")));
    let uses = texts(&files).uses(&vec!["room".to_owned(), "one".to_owned()]);
    let told: Vec<String> = uses
        .into_iter()
        .map(|used| format!("{} {}", used.file.join("/"), used.item.unwrap_or_default()))
        .collect();
    assert_eq!(
        told,
        [
            "a ",
            "a b",
            "a c",
            "d ",
            "e f",
            "g h",
            "p Q",
            "room/h T",
            "room/one/inner i"
        ]
    );
}

#[test]
fn a_circle_is_found_through_what_a_folder_passes_on() {
    let sources = texts(&[
        (
            "room",
            "mod one; mod two; pub use one::Thing; fn all() { two::run(); one::run() }",
        ),
        ("room/one", "use super::two::run; pub struct Thing;"),
        ("room/two", "use super::Thing;"),
        ("other", "use crate::room::Thing;"),
    ]);
    assert_eq!(
        circles(&sources),
        ["room/one -> room/two", "room/two -> room/one"]
    );
}

#[test]
fn files_stay_short() {
    for file in all_sources() {
        let lines = fs::read_to_string(&file).unwrap().lines().count();
        assert!(
            lines <= 450,
            "{} has {lines} lines: split it",
            file.display()
        );
    }
}

/// Words that name a spacecraft or one of its cameras.
const INSTRUMENT_WORDS: [&str; 4] = ["mgs", "moc", "mex", "hrsc"];

/// Where they may stand in code, and why; comments may say where a rule comes from.
const NAME_INSTRUMENTS: [(&str, &str); 10] = [
    ("crates/pds", "reads the labels and files of the mission"),
    ("crates/scene", "imitates the mission, whose files it names"),
    (
        "crates/base/src/constants.rs",
        "the lines that take in the files of the spacecraft",
    ),
    (
        "crates/config/src/instruments.rs",
        "the list of instrument files that are built in",
    ),
    ("crates/config/src/calibration.rs", "examples of keys"),
    (
        "crates/fetch/src/archives.rs",
        "the table of archives that is built in",
    ),
    ("crates/config/src/images.rs", "examples of keys"),
    ("crates/config/src/kernels.rs", "examples of keys"),
    ("crates/config/src/pointing.rs", "examples of keys"),
    ("crates/products/src/kernel_report.rs", "keys of SpiceQL"),
];

#[test]
fn only_data_and_label_reading_name_an_instrument() {
    let mut named = Vec::new();
    let mut unused: BTreeSet<&str> = NAME_INSTRUMENTS.iter().map(|(path, _)| *path).collect();
    let root = checkout();
    for file in all_sources() {
        let text = fs::read_to_string(&file).unwrap();
        let path = file.strip_prefix(root).unwrap();
        // Tests of a file stand at its end, and may take their examples from the mission.
        let code = text.split("#[cfg(test)]").next().unwrap();
        let lines = code.lines().enumerate();
        let naming = lines.filter(|(_, line)| !line.trim_start().starts_with("//") && names(line));
        for (number, line) in naming {
            let excused = NAME_INSTRUMENTS
                .iter()
                .find(|(allowed, _)| path.starts_with(allowed));
            match excused {
                Some((allowed, _)) => {
                    unused.remove(allowed);
                }
                None => named.push(format!(
                    "{}:{}: {}",
                    path.display(),
                    number + 1,
                    line.trim()
                )),
            }
        }
    }
    assert!(
        named.is_empty(),
        "put what belongs to an instrument into a file under config/:\n{}",
        named.join("\n")
    );
    assert!(
        unused.is_empty(),
        "nothing to excuse any more in {unused:?}"
    );
}

/// Whether one of the words stands in a line of code, alone or as a part of a name.
fn names(line: &str) -> bool {
    // `MocLabel` and `NAIF_MGS` are words with parts, as `moc_na` is.
    let mut parts = String::new();
    let mut before = ' ';
    for c in line.chars() {
        if c.is_uppercase() && before.is_lowercase() {
            parts.push(' ');
        }
        parts.push(if c.is_alphanumeric() { c } else { ' ' });
        before = c;
    }
    let mut parts = parts.split_whitespace();
    parts.any(|part| INSTRUMENT_WORDS.contains(&&*part.to_lowercase()))
}
