//! Lost files that a failure names.

use std::path::Path;

use super::folders::{Folder, as_listed, plain};
use crate::worker::protocol::Failure;

/// Whether a failure names the lost file `lost`: as its file, or as a word of its text.
pub(super) fn is_named(failure: &Failure, folders: &[Folder], lost: &Path) -> bool {
    let is_lost = |named: &Path| match as_listed(folders, named) {
        Some(listed) => Path::new(&listed) == lost,
        // By another way, such as a link, whose end is gone; or relative.
        None if named.is_absolute() => named.file_name() == lost.file_name(),
        None => lost.ends_with(plain(named)),
    };
    if failure.file.as_deref().is_some_and(is_lost) {
        return true;
    }
    let apart = |of: char| of.is_whitespace() || "`'\"()[],;:".contains(of);
    let words = failure.text.split(apart);
    words
        .map(|word| word.trim_end_matches('.'))
        .filter(|word| !word.is_empty())
        .any(|word| is_lost(Path::new(word)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::files::RootKind;

    #[test]
    fn a_failure_names_whole_files() {
        let folders = [Folder {
            path: "/none/kernels".to_owned(),
            kind: RootKind::Kernels,
        }];
        let lost = Path::new("/none/kernels/ck/a.bc");
        let failure = |file: Option<&str>, text: &str| Failure {
            code: 3,
            busy: false,
            site: None,
            stage: None,
            file: file.map(Into::into),
            text: text.to_owned(),
        };
        for (file, text, expected) in [
            (Some("/none/kernels/ck/a.bc"), "does not exist", true),
            (
                Some("/none/sites/../kernels/ck/a.bc"),
                "does not exist",
                true,
            ),
            (Some("/link/ck/a.bc"), "does not exist", true),
            (Some("/none/kernels/spk/a.bc"), "does not exist", false),
            (None, "`a.bc` is missing", true),
            (None, "/none/kernels/ck/a.bc: does not exist", true),
            (None, "restore ck/a.bc.", true),
            (None, "mgs_a.bc is missing", false),
            (None, "a.bc.old is missing", false),
            (None, "/none/kernels/spk/a.bc: does not exist", false),
            (None, "spk/a.bc is missing", false),
        ] {
            let found = is_named(&failure(file, text), &folders, lost);
            assert_eq!(found, expected, "{file:?} {text}");
        }
    }
}
