//! The methods that the sources declare: of every `impl Stage`, and of steps that are no stages.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use areograph_testing::checkout;

use crate::architecture::uses::{ROOMS, sources_of};

/// A method that enters fingerprints.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Declared {
    /// `Stage::NAME`; of other steps nothing.
    pub(crate) stage: Option<String>,
    /// The type of the stage; of other steps their file, by its room.
    pub(crate) declared: String,
    /// File, by its room: `stages/adjust/stage.rs` is in the crate `stages`.
    pub(crate) file: String,
    /// The number.
    pub(crate) method: u32,
    /// Types of the stages that it lists in `CALLS`.
    pub(crate) calls: Vec<String>,
}

impl Declared {
    /// Its module: the folder below `stages`, or the file below `flow`.
    pub(crate) fn room(&self) -> Vec<String> {
        let path = self.file.trim_end_matches(".rs");
        path.split('/').take(2).map(str::to_owned).collect()
    }
}

/// The file of a module, without `.rs` or `/mod.rs`.
pub(crate) fn path_of(module: &[String]) -> PathBuf {
    let (room, inner) = module.split_first().unwrap();
    let folder = if ROOMS.contains(&&**room) {
        sources_of(room)
    } else {
        checkout().join("src").join(room)
    };
    folder.join(inner.join("/"))
}

/// Every method of the pipeline, in the order of files.
pub(crate) fn declared() -> Vec<Declared> {
    let mut files = BTreeMap::new();
    let mut read = |room: &str, root: &Path| {
        let mut paths = Vec::new();
        files_below(root, &mut paths);
        for path in paths {
            let file = Path::new(room).join(path.strip_prefix(root).unwrap());
            files.insert(file.display().to_string(), path);
        }
    };
    read("", &checkout().join("src"));
    for room in ROOMS {
        read(room, &sources_of(room));
    }
    let found = files
        .iter()
        .flat_map(|(file, path)| of_text(file, &fs::read_to_string(path).unwrap()));
    found.collect()
}

fn files_below(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files_below(&path, files);
        } else if path.extension().is_some_and(|of| of == "rs") {
            files.push(path);
        }
    }
}

/// The methods of a file. Formatting puts every item of an `impl` on a line of its own.
pub(crate) fn of_text(file: &str, text: &str) -> Vec<Declared> {
    let mut found = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(declared) = stage_of(line) {
            let body: Vec<&str> = lines.by_ref().take_while(|line| *line != "}").collect();
            let value = |start: &str| {
                let found = body.iter().find_map(|line| line.trim().strip_prefix(start));
                found.map(|value| value.trim_end_matches(';').trim_matches('"').to_owned())
            };
            found.push(Declared {
                stage: value("const NAME: &'static str = "),
                declared,
                file: file.to_owned(),
                method: value("const METHOD: u32 = ").map_or(1, |number| number.parse().unwrap()),
                calls: calls_of(&body.concat()),
            });
            continue;
        }
        let number = ["METHOD", "LAYOUT"].iter().find_map(|name| {
            let line = line.strip_prefix("pub ").unwrap_or(line);
            let value = line.strip_prefix("const ")?.strip_prefix(name)?;
            value.strip_prefix(": u32 = ")?.strip_suffix(';')
        });
        if let Some(number) = number {
            found.push(Declared {
                stage: None,
                declared: file.to_owned(),
                file: file.to_owned(),
                method: number.parse().unwrap(),
                calls: calls_of(text),
            });
        }
    }
    found
}

/// The types in a text behind `CALLS`.
fn calls_of(text: &str) -> Vec<String> {
    let of_calls = text
        .split_once("const CALLS: ")
        .map_or("", |(_, behind)| behind);
    let of_calls = of_calls.split(';').next().unwrap_or_default();
    let calls = of_calls.split("called::<").skip(1);
    let calls = calls.filter_map(|call| call.split(['<', '>']).next());
    calls.map(str::to_owned).collect()
}

/// The type that becomes a stage in this line.
fn stage_of(line: &str) -> Option<String> {
    let (head, of) = line.split_once("Stage for ")?;
    head.starts_with("impl").then_some(())?;
    let name = of.split(['<', ' ', '{']).next()?;
    Some(name.to_owned())
}
