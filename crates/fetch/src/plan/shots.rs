//! Tables of shots, which a service makes for boxes.

use super::{FileKind, Plan, PlannedFile, ShotWish};
use crate::archives::ShotService;

/// The queries of tables that are missing, and of those that a fetch brought or began.
///
/// A table of another origin is the user's own: it is not asked for.
///
/// * `is_own` – whether a fetch brought or began a planned table
pub(crate) fn plan_shots(
    wishes: &[ShotWish],
    service: &ShotService,
    is_own: &dyn Fn(&PlannedFile) -> bool,
) -> Plan {
    let mut plan = Plan::default();
    for wish in wishes {
        let files: Vec<PlannedFile> = wish
            .tables
            .iter()
            .map(|table| PlannedFile {
                kind: FileKind::Shots,
                url: service.query(table.of.edges_deg),
                path: table.path.clone(),
                bytes: None,
                is_exact: false,
                md5: None,
                why: table.of.why(),
                shot_box: Some(table.of.clone()),
            })
            .collect();
        let own: Vec<bool> = files.iter().map(is_own).collect();
        if !wish.is_absent && !own.contains(&true) {
            continue;
        }
        let files = files.into_iter().zip(own);
        let asked = files.filter(|(file, is_own)| *is_own || !file.path.exists());
        plan.files.extend(asked.map(|(file, _)| file));
    }
    plan
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::{
        archives::Archives,
        plan::{ShotBox, ShotTable},
    };

    #[test]
    fn only_missing_tables_and_own_ones_are_asked_for() {
        let service = Archives::built_in().unwrap().shots;
        let here = tempfile::tempdir().unwrap();
        let path = |name: &str| here.path().join(name);
        let touch = |name: &str| std::fs::File::create(path(name)).map(drop).unwrap();
        touch("b.csv");
        let table = |name: &str| ShotTable {
            path: path(name),
            of: ShotBox {
                edges_deg: [1.0, 2.0, -3.0, 4.5],
                whole: "window a".to_owned(),
            },
        };
        let wish = |is_absent| ShotWish {
            tables: vec![table("a.csv"), table("b.csv")],
            is_absent,
        };
        let planned = |is_absent, own: &[PathBuf]| -> Vec<PathBuf> {
            let is_own = |file: &PlannedFile| own.contains(&file.path);
            let files = plan_shots(&[wish(is_absent)], &service, &is_own).files;
            files.into_iter().map(|file| file.path).collect()
        };
        assert_eq!(planned(true, &[]), [path("a.csv")]);
        assert!(planned(false, &[]).is_empty());
        assert_eq!(
            planned(false, &[path("b.csv")]),
            [path("a.csv"), path("b.csv")]
        );
        let files = plan_shots(&[wish(true)], &service, &|_| false).files;
        assert_eq!(
            files[0].url,
            "https://oderest.rsl.wustl.edu/livegds?query=molapedr&results=v&output=J&minlat=-3&maxlat=4.5&westernlon=1&\
             easternlon=2"
        );
    }
}
