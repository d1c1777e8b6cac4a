//! Arrows point down: a room uses the floors below it, never one above.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Rooms by floor, the lowest first; see ARCHITECTURE.md.
const FLOORS: [&[&str]; 6] = [
    &[
        "units",
        "time",
        "frames",
        "constants",
        "error",
        "footprints",
        "ties",
        "files",
        "instruments",
        "config",
    ],
    &["geom"],
    &["spice", "pds", "scene"],
    &["stages"],
    &["flow", "report", "difference", "products", "store"],
    &["cli"],
];

/// Arrows inside a floor that are meant: the scene is written with the fence and the PEDR writer,
/// the flow publishes, the difference reads what was published, and the report tells of both.
const SAME_FLOOR: [(&str, &str); 9] = [
    ("scene", "spice"),
    ("scene", "pds"),
    ("flow", "products"),
    ("flow", "store"),
    ("flow", "report"),
    ("difference", "products"),
    ("difference", "store"),
    ("report", "products"),
    ("report", "difference"),
];

fn floor(room: &str) -> usize {
    FLOORS
        .iter()
        .position(|rooms| rooms.contains(&room))
        .unwrap_or_else(|| {
            panic!("`{room}` is in no floor: add it to ARCHITECTURE.md and to this test")
        })
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The room a source file belongs to, `None` for `lib.rs` and `main.rs`.
fn room_of(source: &Path, root: &Path) -> Option<String> {
    let relative = source.strip_prefix(root).unwrap();
    let first = relative.iter().next()?.to_str()?;
    let room = first.strip_suffix(".rs").unwrap_or(first);
    (!matches!(room, "lib" | "main")).then(|| room.to_owned())
}

/// Rooms named after `crate::`, also inside `use crate::{a::…, b::…}`; comments, and tests at the end of
/// a file, do not count.
fn used_rooms(text: &str) -> BTreeSet<String> {
    let code: String = text
        .split("#[cfg(test)]")
        .next()
        .unwrap_or_default()
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect::<Vec<_>>()
        .join("\n");
    let name = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
            .collect()
    };
    let mut rooms = BTreeSet::new();
    for after in code.split("crate::").skip(1) {
        let Some(group) = after.strip_prefix('{') else {
            rooms.insert(name(after));
            continue;
        };
        let mut depth = 0;
        let mut item_starts = true;
        for (position, character) in group.char_indices() {
            match character {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => item_starts = true,
                c if depth == 0 && item_starts && c.is_ascii_alphabetic() => {
                    rooms.insert(name(&group[position..]));
                    item_starts = false;
                }
                _ => {}
            }
        }
    }
    rooms
}

#[test]
fn arrows_point_down() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 30, "the sources were not found");
    let mut wrong = Vec::new();
    for file in files {
        let Some(room) = room_of(&file, &root) else {
            continue;
        };
        for used in used_rooms(&fs::read_to_string(&file).unwrap()) {
            let down = floor(&used) < floor(&room);
            let ground_floor = floor(&used) == 0 && floor(&room) == 0 && used != "config";
            let meant = SAME_FLOOR.contains(&(&*room, &*used));
            if used != room && !down && !ground_floor && !meant {
                wrong.push(format!("{}: {room} -> {used}", file.display()));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "arrows that do not point down:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn grouped_uses_are_read() {
    let text = "use crate::{a::{b, c}, d,\n  e::f};\n/// [`crate::y`]\nfn x() { crate::g::h() }\n#[cfg(test)]\nuse crate::z;";
    assert_eq!(
        used_rooms(text).into_iter().collect::<Vec<_>>(),
        ["a", "d", "e", "g"]
    );
}

#[test]
fn files_stay_short() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files {
        let lines = fs::read_to_string(&file).unwrap().lines().count();
        assert!(
            lines <= 450,
            "{} has {lines} lines: split it",
            file.display()
        );
    }
}
