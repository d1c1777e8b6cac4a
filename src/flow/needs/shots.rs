//! Tables of shots that are asked of a service, by the windows of a site or by a box.

use std::path::{Path, PathBuf};

use crate::{
    config::{ShotGlob, ShotLayout, SiteConfig},
    error::{Cause, Error, Result},
    fetch::{
        ShotService,
        plan::{ShotBox, ShotTable, ShotWish},
    },
    files::file_name,
    geom::window::{Region, WindowShape},
};

/// Ambiguities of the names of tables.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Unclear {
    #[error("shots.files is {0}; expected a path or glob with at most one `*`, in the file name")]
    #[cause("write the full folder and a glob for one table per window, such as \"shots/*.csv\"")]
    Glob(String),
    #[error("shots.files is {path}; the windows need {}", needed.join(", "))]
    #[cause("write a glob for one table per window, such as \"shots/*.csv\", or these names")]
    Names { path: String, needed: Vec<String> },
}

/// A box of which a table is made.
struct Piece {
    /// Name of its table.
    name: String,
    of: ShotBox,
}

/// Needs of a site, and notes for the reader of the plan.
pub(super) fn wishes(
    site: &SiteConfig,
    globs: &[Vec<ShotGlob>],
) -> Result<(Vec<ShotWish>, Vec<String>)> {
    let (mut wishes, mut notes) = (Vec::new(), Vec::new());
    let of_service = |layout| layout == Some(ShotLayout::OdePedr);
    for (_, globs) in site
        .shots
        .iter()
        .zip(globs)
        .filter(|(table, _)| of_service(table.layout))
    {
        let (pieces, without_box) = pieces(site);
        if globs.iter().any(|glob| glob.is_absent) {
            let note = |window: &String| {
                format!(
                    "window {window}: its box depends on an image; no table of shots is requested"
                )
            };
            notes.extend(without_box.iter().map(note));
        }
        for glob in globs {
            let tables = match tables(glob, &pieces) {
                Ok(tables) => tables,
                // The names of a user's own tables are free.
                Err(_) if !glob.is_absent => Vec::new(),
                Err(unclear) => return Err(Error::new(unclear)),
            };
            wishes.push(ShotWish {
                tables,
                is_absent: glob.is_absent,
            });
        }
    }
    Ok((wishes, notes))
}

/// The tables of a box: west, east, south and north edge, degrees.
#[must_use]
pub fn of_box(folder: &Path, edges_deg: [f64; 4]) -> ShotWish {
    let [west, east, south, north] = edges_deg;
    let name = format!("box_{west}_{east}_{south}_{north}");
    let pieces = cut(&name, "--box", &[edges_deg]);
    let table = |piece: Piece| ShotTable {
        path: folder.join(format!("{}.csv", piece.name)),
        of: piece.of,
    };
    ShotWish {
        tables: pieces.into_iter().map(table).collect(),
        is_absent: true,
    }
}

/// The boxes of the windows, and windows whose boxes are not known.
fn pieces(site: &SiteConfig) -> (Vec<Piece>, Vec<String>) {
    let (mut pieces, mut without_box) = (Vec::new(), Vec::new());
    for window in &site.windows {
        let boxes = boxes_deg(&window.shape);
        if boxes.is_empty() {
            without_box.push(window.id.clone());
        }
        let whole = format!("window {} of site {}", window.id, site.site);
        pieces.extend(cut(&window.id, &whole, &boxes));
    }
    (pieces, without_box)
}

/// The boxes of queries for these boxes; several have numbers behind the name.
fn cut(name: &str, whole: &str, boxes_deg: &[[f64; 4]]) -> Vec<Piece> {
    let boxes = boxes_deg
        .iter()
        .flat_map(|edges| ShotService::boxes(*edges));
    let boxes: Vec<[f64; 4]> = boxes.collect();
    let count = boxes.len();
    let piece = |(number, edges_deg): (usize, [f64; 4])| Piece {
        name: match count {
            1 => name.to_owned(),
            _ => format!("{name}_{number}"),
        },
        of: ShotBox {
            edges_deg,
            whole: whole.to_owned(),
        },
    };
    (1..).zip(boxes).map(piece).collect()
}

/// West, east, south and north edges of a box, or around each polygon, degrees; none for the outline of an image.
fn boxes_deg(shape: &WindowShape) -> Vec<[f64; 4]> {
    let boxes = Region::new(shape);
    let boxes = boxes.boxes_rad();
    boxes
        .map(|edges_rad| edges_rad.map(f64::to_degrees))
        .collect()
}

/// The tables behind a path or glob.
///
/// A glob has one for each box, `*` being its name. A path belongs to the only box, or to the box of its name.
fn tables(glob: &ShotGlob, pieces: &[Piece]) -> std::result::Result<Vec<ShotTable>, Unclear> {
    let is_wild = |text: &str| text.contains(['*', '?', '[']);
    let shown = || glob.path.display().to_string();
    let (folder, name) = (
        glob.path.parent().unwrap_or(Path::new("")),
        file_name(&glob.path),
    );
    let parts: Vec<&str> = name.split('*').collect();
    if is_wild(&folder.to_string_lossy()) || parts.iter().any(|part| is_wild(part)) {
        return Err(Unclear::Glob(shown()));
    }
    let table = |piece: &Piece, path: PathBuf| ShotTable {
        path,
        of: piece.of.clone(),
    };
    match (&parts[..], pieces) {
        (_, []) => Ok(Vec::new()),
        ([before, behind], pieces) => {
            let path = |piece: &Piece| folder.join(format!("{before}{}{behind}", piece.name));
            let tables = pieces.iter().map(|piece| table(piece, path(piece)));
            Ok(tables.collect())
        }
        ([_], [piece]) => Ok(vec![table(piece, glob.path.clone())]),
        ([name], pieces) => {
            let stem = name.rsplit_once('.').map_or(*name, |(stem, _)| stem);
            let named = pieces.iter().find(|piece| piece.name == stem);
            let needed = |piece: &Piece| folder.join(format!("{}.csv", piece.name));
            let needed = |piece: &Piece| needed(piece).display().to_string();
            let table = named.map(|piece| vec![table(piece, glob.path.clone())]);
            table.ok_or_else(|| Unclear::Names {
                path: shown(),
                needed: pieces.iter().map(needed).collect(),
            })
        }
        _ => Err(Unclear::Glob(shown())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(glob: &str, windows: &[(&str, [f64; 4])]) -> std::result::Result<Vec<String>, String> {
        let pieces: Vec<Piece> = windows
            .iter()
            .flat_map(|(id, edges)| cut(id, id, &[*edges]))
            .collect();
        let glob = ShotGlob {
            path: PathBuf::from(glob),
            is_absent: true,
        };
        let path = |table: ShotTable| table.path.display().to_string();
        match tables(&glob, &pieces) {
            Ok(tables) => Ok(tables.into_iter().map(path).collect()),
            Err(unclear) => Err(unclear.to_string()),
        }
    }

    #[test]
    fn tables_are_named_after_windows() {
        let gusev = ("gusev", [175.0, 178.0, -15.0, -14.0]);
        let zero = ("zero", [359.0, 1.0, 0.0, 1.0]);
        assert_eq!(paths("a/shots.csv", &[gusev]).unwrap(), ["a/shots.csv"]);
        assert_eq!(
            paths("a/ode_*.csv", &[gusev, zero]).unwrap(),
            ["a/ode_gusev.csv", "a/ode_zero_1.csv", "a/ode_zero_2.csv"]
        );
        assert_eq!(paths("a/zero_2.csv", &[zero]).unwrap(), ["a/zero_2.csv"]);
        let refused = paths("a/shots.csv", &[zero]).unwrap_err();
        assert!(
            refused.ends_with("need a/zero_1.csv, a/zero_2.csv"),
            "{refused}"
        );
        for glob in ["a/*_*.csv", "a?/x.csv", "a*/x.csv", "a/[xy].csv"] {
            let refused = paths(glob, &[gusev]).unwrap_err();
            assert!(refused.contains("at most one `*`"), "{refused}");
        }
    }

    #[test]
    fn a_polygon_is_asked_for_by_the_box_around_it() {
        let boxes = |ring: [[f64; 2]; 3]| -> Vec<[f64; 4]> {
            let ring = ring.map(|vertex| vertex.map(f64::to_radians));
            let shape = WindowShape::Polygons {
                polygons: vec![vec![ring.to_vec()]],
            };
            let pieces = cut("p", "p", &boxes_deg(&shape)).into_iter();
            pieces.map(|piece| piece.of.edges_deg).collect()
        };
        assert_eq!(
            boxes([[3.0, 10.0], [-2.0, 12.0], [1.0, 11.0]]),
            [[358.0, 360.0, 10.0, 12.0], [0.0, 3.0, 10.0, 12.0]]
        );
        // Edges go the shorter way round.
        assert_eq!(
            boxes([[179.0, 10.0], [-179.0, 12.0], [178.5, 11.0]]),
            [[178.5, 181.0, 10.0, 12.0]]
        );
    }
}
