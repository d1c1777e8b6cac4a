//! Files of the laser by orbits and dates.

use std::path::Path;

use super::{FileKind, Plan, PlannedFile, Span, reasons};
use crate::{archives::PedrArchive, index::Listed};

/// The files whose orbits lie in a range or may be flown in a span.
pub(crate) fn plan_pedr(
    folder: &Path,
    orbits: &[[u32; 2]],
    spans: &[Span],
    listed: &[(String, Vec<Listed>)],
    archive: &PedrArchive,
) -> Plan {
    let mut plan = Plan::default();
    let mut files: Vec<(u32, &str, &Listed)> = listed
        .iter()
        .flat_map(|(folder, files)| files.iter().map(move |file| (&**folder, file)))
        .filter_map(|(folder, file)| Some((archive.first_orbit(&file.name)?, folder, file)))
        .collect();
    files.sort_by_key(|(orbit, ..)| *orbit);
    if files.is_empty() {
        let lack = "pedr: no listing of the archive contains a laser file".to_owned();
        plan.lacks.push(lack);
        return plan;
    }
    let named = orbits
        .iter()
        .map(|[first, last]| ([*first, *last], format!("orbits {first} to {last}")));
    let mut wanted: Vec<([u32; 2], String)> = named.collect();
    for span in spans {
        match archive.orbits_of(span.utc) {
            Some(orbits) => {
                let why = format!("orbits {} to {} of {}", orbits[0], orbits[1], span.what);
                wanted.push((orbits, why));
            }
            None => plan.notes.push(format!(
                "{}: {} is outside the time span of the laser data, {} to {}",
                span.what,
                span.utc[0],
                archive.orbits.first().map_or("?", |(_, utc)| utc),
                archive.orbits.last().map_or("?", |(_, utc)| utc),
            )),
        }
    }
    let mut is_met = vec![false; wanted.len()];
    for (place, (first, in_folder, file)) in files.iter().enumerate() {
        let next = files.get(place + 1).map_or(u32::MAX, |(orbit, ..)| *orbit);
        let meets = |[from, to]: [u32; 2]| *first <= to && next > from;
        let mut why: Vec<&str> = Vec::new();
        for ((orbits, reason), met) in wanted.iter().zip(&mut is_met) {
            if meets(*orbits) {
                *met = true;
                why.push(reason);
            }
        }
        if why.is_empty() {
            continue;
        }
        plan.files.push(PlannedFile {
            kind: FileKind::Pedr,
            url: format!("{}{in_folder}/{}", archive.url, file.name),
            path: folder.join(&file.name),
            bytes: file.bytes,
            is_exact: file.is_exact,
            md5: None,
            why: format!("from orbit {first} on: {}", reasons(&why)),
            shot_box: None,
        });
    }
    for ((_, reason), _) in wanted.iter().zip(is_met).filter(|(_, met)| !met) {
        plan.lacks
            .push(format!("pedr: no file of the archive contains {reason}"));
    }
    plan
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{archives::Archives, utc::Utc};

    fn names(plan: &Plan) -> Vec<String> {
        let names = plan
            .files
            .iter()
            .map(|file| file.path.to_string_lossy().into_owned());
        names.collect()
    }

    #[test]
    fn an_orbit_is_in_the_file_before_the_next_ones_first() {
        let archive = Archives::built_in().unwrap().pedr;
        let file = |name: &str| Listed {
            name: name.to_owned(),
            bytes: Some(776),
            is_exact: true,
        };
        let listed = [
            (
                "ap18xxx".to_owned(),
                vec![
                    file("ap18933l.b"),
                    file("ap18920l.b"),
                    file("index.html"),
                    file("ap18933k.b"),
                ],
            ),
            (
                "ap19xxx".to_owned(),
                vec![file("ap19040l.b"), file("ap19053l.b")],
            ),
        ];
        let of = |orbits: [u32; 2]| plan_pedr(Path::new("p"), &[orbits], &[], &listed, &archive);
        assert_eq!(names(&of([18_940, 18_940])), ["p/ap18933l.b"]);
        assert_eq!(
            names(&of([18_932, 18_933])),
            ["p/ap18920l.b", "p/ap18933l.b"]
        );
        assert_eq!(
            of([18_933, 18_933]).files[0].url,
            format!("{}ap18xxx/ap18933l.b", archive.url)
        );
        // The last file has no next one.
        assert_eq!(names(&of([20_000, 20_001])), ["p/ap19053l.b"]);
        let before = of([1, 18_000]);
        assert!(before.files.is_empty());
        assert_eq!(
            before.lacks,
            ["pedr: no file of the archive contains orbits 1 to 18000"]
        );
        // The first simultaneous pass at Gusev, orbit 18940.
        let start = Utc::parse("2001-03-08T12:56:31").unwrap();
        let span = Span {
            utc: [start, start.plus(10.0)],
            what: "image E02-00665".to_owned(),
        };
        let plan = plan_pedr(Path::new("p"), &[], &[span], &listed, &archive);
        assert_eq!(names(&plan), ["p/ap18933l.b"]);
        let late = Utc::parse("2003-03-08").unwrap();
        let span = Span {
            utc: [late, late],
            what: "image R02-00001".to_owned(),
        };
        let plan = plan_pedr(Path::new("p"), &[], &[span], &listed, &archive);
        assert!(
            plan.files.is_empty() && plan.notes[0].contains("outside the time span of the laser")
        );
    }
}
