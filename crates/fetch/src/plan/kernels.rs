//! Kernels by the coverage that the index states.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use areograph_base::{
    constants::{SPEED_OF_LIGHT_M_S, SUN_DISTANCE_M},
    kernel_names::{family_of, natural_order, quality_of},
};

use super::{FileKind, KernelWish, Plan, PlannedFile, Span, reasons};
use crate::{
    archives::KernelArchive,
    index::{Checksums, KernelRow},
    utc::{Utc, gaps},
};

/// Kernels must cover so many seconds more at both ends: padding of a site, light time to the ground, correction of the
/// attitude's time, rounding of index times.
const MARGIN_S: f64 = 60.0;
/// Types of text kernels that sites use.
const TEXTS: [&str; 5] = ["LSK", "SCLK", "PCK", "FK", "IK"];

/// The kernels of a wish: the latest text kernels, and what covers the spans.
pub(crate) fn plan_kernels(
    wish: &KernelWish,
    spans: &[Span],
    (rows, sums): &(Vec<KernelRow>, Checksums),
    archive: &KernelArchive,
) -> Plan {
    let planner = Planner {
        wish,
        sums,
        archive,
    };
    // The later row of a kernel that the index has twice.
    let by_path: BTreeMap<&str, &KernelRow> = rows.iter().map(|row| (&*row.path, row)).collect();
    let rows: Vec<&KernelRow> = by_path.into_values().collect();
    if !wish.listed.is_empty() {
        return planner.listed(&rows);
    }
    let mut plan = planner.texts(&rows);
    if !spans.is_empty() {
        plan.add(planner.ephemerides(&rows, spans));
        plan.add(planner.attitudes(&rows, spans));
    }
    plan
}

struct Planner<'a> {
    wish: &'a KernelWish,
    sums: &'a Checksums,
    archive: &'a KernelArchive,
}

/// A span with the margin.
fn padded(span: &Span) -> [Utc; 2] {
    [span.utc[0].plus(-MARGIN_S), span.utc[1].plus(MARGIN_S)]
}

/// The padded span, from the departure of the sunlight that reaches Mars at its start.
fn with_sun(span: &Span) -> [Utc; 2] {
    let [start, stop] = padded(span);
    [start.plus(-SUN_DISTANCE_M[1] / SPEED_OF_LIGHT_M_S), stop]
}

impl Planner<'_> {
    fn file(&self, row: &KernelRow, path: PathBuf, why: String) -> PlannedFile {
        PlannedFile {
            kind: FileKind::Kernel,
            url: format!("{}{}{}", self.archive.url, self.archive.volume, row.path),
            path,
            bytes: None,
            is_exact: false,
            md5: self.sums.get(&row.path).cloned(),
            why,
            shot_box: None,
        }
    }

    fn placed(&self, row: &KernelRow, why: String) -> PlannedFile {
        self.file(row, self.wish.folder.join(row.name()), why)
    }

    /// Kernels that the site lists, by their names, or the names that the archive has for them.
    fn listed(&self, rows: &[&KernelRow]) -> Plan {
        let mut plan = Plan::default();
        for path in &self.wish.listed {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let of_archive = self.archive.names.get(&*name).map_or(&*name, |name| name);
            match rows.iter().find(|row| row.name() == of_archive) {
                Some(row) => {
                    let why = format!("the site lists {name}");
                    plan.files.push(self.file(row, path.clone(), why));
                }
                None => plan.lacks.push(format!(
                    "kernel {name}: not in the index of the archive, under this name{}",
                    if of_archive == name {
                        ""
                    } else {
                        " or its name in the archive"
                    }
                )),
            }
        }
        plan
    }

    /// The latest version of every text kernel, and those that are pinned.
    fn texts(&self, rows: &[&KernelRow]) -> Plan {
        let mut plan = Plan::default();
        let mut versions: BTreeMap<String, Vec<&KernelRow>> = BTreeMap::new();
        for row in rows.iter().filter(|row| TEXTS.contains(&&*row.kind)) {
            let without_numbers: String = row
                .name()
                .chars()
                .filter(|letter| !letter.is_ascii_digit())
                .collect();
            versions
                .entry(format!(
                    "{} {}",
                    row.kind,
                    without_numbers.to_ascii_lowercase()
                ))
                .or_default()
                .push(row);
        }
        for versions in versions.values_mut() {
            versions.sort_by_key(|row| natural_order(Path::new(row.name())));
            if let Some(latest) = versions.last() {
                let why = format!("{}, latest of {}", latest.kind, versions.len());
                plan.files.push(self.placed(latest, why));
            }
        }
        for pinned in &self.wish.pinned {
            match rows.iter().find(|row| row.name() == pinned) {
                Some(row) => plan
                    .files
                    .push(self.placed(row, "pinned by the site".to_owned())),
                None => plan.lacks.push(format!(
                    "kernel {pinned}: pinned by the site, but not in the index of the archive"
                )),
            }
        }
        plan
    }

    fn ephemerides(&self, rows: &[&KernelRow], spans: &[Span]) -> Plan {
        let is_own = |row: &KernelRow| {
            row.name()
                .to_ascii_lowercase()
                .starts_with(&self.archive.own)
        };
        let family = self.wish.spk_family.to_ascii_lowercase();
        let spk = || rows.iter().copied().filter(|row| row.kind == "SPK");
        let own = spk().filter(|row| is_own(row) && family_of(Path::new(row.name()), &family));
        // Orbits may hold the Sun themselves: at the seam of two files, in the earlier one.
        let what = format!("orbit, solution {family}");
        let mut plan = self.covering(own, spans, [with_sun, padded], &what);
        let planets: Vec<&KernelRow> = spk().filter(|row| !is_own(row)).collect();
        if planets.is_empty() {
            plan.notes.push(
                "the index lists no planetary ephemeris: unless the orbit kernels contain Mars and the Sun, put one \
                 into the kernel folder (de*.bsp, and mar*.bsp where orbits are relative to the barycentre of Mars)"
                    .to_owned(),
            );
        } else {
            let what = "planets, including the light time from the Sun";
            plan.add(self.covering(planets.into_iter(), spans, [with_sun; 2], what));
        }
        plan
    }

    fn attitudes(&self, rows: &[&KernelRow], spans: &[Span]) -> Plan {
        let is_used = |row: &&KernelRow| {
            let name = row.name().to_ascii_lowercase();
            row.kind == "CK"
                && !self.archive.left_out.iter().any(|part| name.contains(part))
                && self
                    .wish
                    .ck_quality
                    .contains(&quality_of(Path::new(row.name())))
        };
        self.covering(
            rows.iter().copied().filter(is_used),
            spans,
            [padded; 2],
            "attitude",
        )
    }

    /// Every kernel that holds a part of the first range of a span, and the parts of the second one that none holds.
    fn covering<'r>(
        &self,
        rows: impl Iterator<Item = &'r KernelRow>,
        spans: &[Span],
        [taken, required]: [fn(&Span) -> [Utc; 2]; 2],
        what: &str,
    ) -> Plan {
        let mut plan = Plan::default();
        let rows: Vec<(&KernelRow, [Utc; 2])> =
            rows.filter_map(|row| Some((row, row.span?))).collect();
        for (row, [start, stop]) in &rows {
            let why: Vec<&str> = spans
                .iter()
                .filter(|span| {
                    let [from, to] = taken(span);
                    *start <= to && *stop >= from
                })
                .map(|span| &*span.what)
                .collect();
            if !why.is_empty() {
                let why = format!("{what}: {start} to {stop}, for {}", reasons(&why));
                plan.files.push(self.placed(row, why));
            }
        }
        for span in spans {
            for [start, stop] in gaps(required(span), rows.iter().map(|(_, held)| *held)) {
                plan.lacks.push(format!(
                    "{what}: no kernel of the archive covers {start} to {stop}, needed for {}",
                    span.what
                ));
            }
        }
        plan
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archives::Archives;
    use areograph_base::kernel_source::CkQuality;

    fn row(path: &str, kind: &str, span: Option<[&str; 2]>) -> KernelRow {
        let span = span.map(|span| span.map(|utc| Utc::parse(utc).unwrap()));
        KernelRow {
            span,
            path: path.to_owned(),
            kind: kind.to_owned(),
            created: String::new(),
            line: 1,
        }
    }

    fn rows() -> Vec<KernelRow> {
        let map2 = Some(["1999-08-01", "1999-09-01"]);
        vec![
            row("data/lsk/naif0007.tls", "LSK", None),
            row("data/lsk/naif0010.tls", "LSK", None),
            row("data/sclk/mgs_sclkscet_00061.tsc", "SCLK", None),
            row("data/sclk/mgs_sclkscet_00059.tsc", "SCLK", None),
            row("data/ek/x.bes", "EK", None),
            row("data/spk/mgs_map2.bsp", "SPK", map2),
            row("data/spk/mgs_map2_ipng_mgs75c.bsp", "SPK", map2),
            row(
                "data/spk/mgs_map3.bsp",
                "SPK",
                Some(["1999-09-01", "1999-10-01"]),
            ),
            // They meet 10 min before the image, when the light of the Sun was on its way.
            row(
                "data/spk/de403_a.bsp",
                "SPK",
                Some(["1997-01-01", "1999-08-24T14:02:13"]),
            ),
            row(
                "data/spk/de403_b.bsp",
                "SPK",
                Some(["1999-08-24T14:02:13", "2002-01-01"]),
            ),
            row("data/ck/mgs_sc_map2.bc", "CK", map2),
            row("data/ck/mgs_sa_map2.bc", "CK", map2),
            row(
                "data/ck/mgs_ext_roto_all_v9.bc",
                "CK",
                Some(["1999-01-01", "2006-01-01"]),
            ),
        ]
    }

    fn wish() -> KernelWish {
        KernelWish {
            folder: PathBuf::from("k"),
            spk_family: "nav".to_owned(),
            ck_quality: vec![CkQuality::Reconstructed, CkQuality::Nominal],
            pinned: Vec::new(),
            listed: Vec::new(),
        }
    }

    fn image(utc: &str) -> Span {
        let start = Utc::parse(utc).unwrap();
        Span {
            utc: [start, start.plus(5.9)],
            what: "image M04/02852".to_owned(),
        }
    }

    fn planned(wish: &KernelWish, spans: &[Span]) -> (Vec<String>, Plan) {
        let archive = Archives::built_in().unwrap().kernels;
        let sums = Checksums::from([("data/spk/mgs_map2.bsp".to_owned(), "0".repeat(32))]);
        let plan = plan_kernels(wish, spans, &(rows(), sums), &archive);
        let names = plan.files.iter().map(|file| {
            file.path
                .file_name()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        });
        (names.collect(), plan)
    }

    #[test]
    fn kernels_cover_the_image_and_the_light_of_the_sun() {
        let (names, plan) = planned(&wish(), &[image("1999-08-24T14:12:13.64")]);
        let expected = [
            "naif0010.tls",
            "mgs_sclkscet_00061.tsc",
            "mgs_map2.bsp",
            "de403_a.bsp",
            "de403_b.bsp",
            "mgs_ext_roto_all_v9.bc",
            "mgs_sc_map2.bc",
        ];
        assert_eq!(names, expected);
        assert!(plan.lacks.is_empty(), "{:?}", plan.lacks);
        assert_eq!(plan.files[2].md5, Some("0".repeat(32)));
        assert!(
            plan.files[2]
                .url
                .ends_with("/mgsp_1000/data/spk/mgs_map2.bsp")
        );
        assert!(
            plan.files[2].why.contains("for image M04/02852"),
            "{}",
            plan.files[2].why
        );
        // Without images, clocks and constants alone.
        assert_eq!(planned(&wish(), &[]).0, expected[..2]);
    }

    #[test]
    fn what_no_kernel_covers_is_named() {
        let telemetry = KernelWish {
            ck_quality: vec![CkQuality::Reconstructed],
            ..wish()
        };
        let (_, plan) = planned(&telemetry, &[image("1999-08-31T23:59:57")]);
        assert_eq!(plan.lacks.len(), 1, "{:?}", plan.lacks);
        assert!(
            plan.lacks[0].starts_with(
                "attitude: no kernel of the archive covers 1999-09-01T00:00:00.000 to "
            )
        );
        let (_, plan) = planned(
            &KernelWish {
                spk_family: "gsfc".to_owned(),
                ..wish()
            },
            &[image("1999-08-24")],
        );
        assert!(
            plan.lacks[0].contains("orbit, solution gsfc"),
            "{:?}",
            plan.lacks
        );
    }

    #[test]
    fn listed_kernels_are_found_by_their_exact_names() {
        let listed = [
            "a/mgs_map2.bsp",
            "a/MGS_SCLKSCET.00061.tsc",
            "a/mgs_map.bsp",
            "a/MGS_MAP2.bsp",
        ];
        let wish = KernelWish {
            listed: listed.map(PathBuf::from).to_vec(),
            ..wish()
        };
        let (names, plan) = planned(&wish, &[image("1999-08-24")]);
        // The archive's own spelling of the clock; a similar name is another file.
        assert_eq!(names, ["mgs_map2.bsp", "MGS_SCLKSCET.00061.tsc"]);
        assert!(plan.files[1].url.ends_with("mgs_sclkscet_00061.tsc"));
        assert_eq!(plan.lacks.len(), 2);
    }
}
