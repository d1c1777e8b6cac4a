//! Kernels of no mission: of each its latest version.

use std::path::Path;

use areograph_base::kernel_names::natural_order;

use super::{FileKind, Plan, PlannedFile};
use crate::{archives::GenericArchive, index::Listed};

/// The latest version of every kernel, by the files `listed` beside it.
pub(crate) fn plan_generic(into: &Path, listed: &[Vec<Listed>], archive: &GenericArchive) -> Plan {
    let mut plan = Plan::default();
    for ([folder, start, end], files) in archive.latest.iter().zip(listed) {
        let is_version = |file: &&Listed| {
            let number = file.name.strip_prefix(start.as_str());
            let number = number.and_then(|rest| rest.strip_suffix(end.as_str()));
            number.is_some_and(|number| number.starts_with(|letter: char| letter.is_ascii_digit()))
        };
        let versions: Vec<&Listed> = files.iter().filter(is_version).collect();
        let latest = versions
            .iter()
            .max_by_key(|file| natural_order(Path::new(&file.name)));
        match latest {
            Some(file) => plan.files.push(PlannedFile {
                kind: FileKind::Kernel,
                url: format!("{}{folder}/{}", archive.url, file.name),
                path: into.join(&file.name),
                bytes: file.bytes,
                is_exact: file.is_exact,
                md5: None,
                why: format!("generic kernel, latest of {}", versions.len()),
                shot_box: None,
            }),
            None => plan.lacks.push(format!(
                "generic kernels: the listing of {folder} contains no {start}*{end}"
            )),
        }
    }
    plan
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archives::Archives;

    #[test]
    fn the_latest_version_is_planned_and_a_missing_one_is_named() {
        let archive = Archives::built_in().unwrap().generic;
        let file = |name: &str| Listed {
            name: name.to_owned(),
            bytes: Some(5_257),
            is_exact: false,
        };
        let names = [
            "naif0009.tls",
            "naif0012.tls",
            "naif0012.tls.pc",
            "latest_leapseconds.tls",
            "naif.tls",
            "aareadme.txt",
        ];
        let listed = [names.map(file).to_vec()];
        let plan = plan_generic(Path::new("k"), &listed, &archive);
        let [only] = plan.files.as_slice() else {
            panic!("{plan:?}");
        };
        assert_eq!(only.path, Path::new("k/naif0012.tls"));
        assert!(only.url.ends_with("/generic_kernels/lsk/naif0012.tls"));
        assert_eq!(only.why, "generic kernel, latest of 2");
        let plan = plan_generic(Path::new("k"), &[vec![file("naif.tls")]], &archive);
        assert_eq!(
            plan.lacks,
            ["generic kernels: the listing of lsk contains no naif*.tls"]
        );
    }
}
