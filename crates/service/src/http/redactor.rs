//! Paths of this machine are hidden from clients: folders of the configuration are shown without their parents.

use std::path::Path;

use areograph_config::ServiceConfig;

/// Folders as they occur in texts, and their replacements; the longest first.
#[derive(Debug)]
pub(super) struct Redactor(Vec<(String, String)>);

impl Redactor {
    pub(super) fn of(config: &ServiceConfig, program: &Path) -> Self {
        let inputs = &config.inputs;
        let lists = [&inputs.sites, &inputs.kernels, &inputs.data];
        let outputs = [&config.outputs.products, &config.outputs.state];
        let folders = lists.into_iter().flatten().chain(outputs);
        let mut redacted: Vec<(String, String)> = folders
            .map(|folder| &**folder)
            .chain([config.file.as_path(), program])
            .flat_map(|path| {
                let canonical = path.canonicalize().ok();
                [Some(path.to_owned()), canonical]
            })
            .flatten()
            .filter_map(|path| {
                let parent = path.parent()?.to_string_lossy().into_owned();
                (parent.len() > 1).then(|| (parent + "/", String::new()))
            })
            .collect();
        redacted.sort_by(|a, b| b.0.len().cmp(&a.0.len()).then_with(|| a.0.cmp(&b.0)));
        redacted.dedup();
        Self(redacted)
    }

    /// `text` without the parents of the folders of the configuration.
    pub(super) fn redact(&self, text: String) -> String {
        let redact = |text: String, (folder, instead): &(String, String)| {
            if text.contains(&**folder) {
                text.replace(&**folder, instead)
            } else {
                text
            }
        };
        self.0.iter().fold(text, redact)
    }
}
