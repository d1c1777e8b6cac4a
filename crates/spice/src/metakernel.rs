//! Metakernels: reading them, and writing the one that reproduces a run.
//!
//! Source: NAIF, Kernel Required Reading: `KERNELS_TO_LOAD`, `PATH_SYMBOLS`, `PATH_VALUES`, and `+` at the end of a
//! string that continues in the next one.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use super::{
    error::SpiceError,
    kernels::{Kernel, KernelSet, read_text, role_of},
    role::KernelRole,
    text_kernel::{self, Assignment, Value, values_of},
};
use areograph_base::error::{Locate, Result};
use areograph_store::files::InputFiles;

/// Longest string value of a text kernel.
const STRING_MAX: usize = 80;

impl KernelSet {
    /// The kernels that a metakernel lists; relative paths count from the metakernel's own folder.
    ///
    /// A missing file is searched for again without regard to case and to `.`, `_`, `-`, since archives and tools write
    /// the same name differently; the explanation then states this.
    ///
    /// # Errors
    /// [`SpiceError::NotAKernel`] for a file that is not a metakernel, [`SpiceError::TextKernel`] for a malformed line,
    /// [`SpiceError::MissingKernel`], and errors of [`KernelSet::from_files`].
    pub fn from_metakernel(metakernel: &Path) -> Result<Self> {
        Self::from_metakernel_of(&InputFiles::default(), metakernel)
    }

    /// Like [`Self::from_metakernel`], with the hashes that a run has of its input files.
    ///
    /// # Errors
    /// Those of [`Self::from_metakernel`]; a file that has changed since the run read it.
    pub fn from_metakernel_of(run: &InputFiles, metakernel: &Path) -> Result<Self> {
        run.admit(metakernel)?;
        let role = role_of(metakernel)?;
        if role != KernelRole::Meta {
            let error = SpiceError::NotAKernel {
                found: format!("a kernel of role {role}"),
                expected: "a metakernel (KERNELS_TO_LOAD)",
            };
            return Err(error).in_file(metakernel);
        }
        let assignments = text_kernel::assignments(&read_text(metakernel)?).in_file(metakernel)?;
        let folder = metakernel.parent().unwrap_or(Path::new(""));
        let list = metakernel.file_name().unwrap_or_default().to_string_lossy();
        let mut set = Self::default();
        for name in listed_names(&assignments).in_file(metakernel)? {
            let written = folder.join(&name);
            if written.exists() {
                set.add(&written, &format!("listed by {list}"), run)?;
            } else {
                let found = same_name(&written, &name).in_file(metakernel)?;
                let reason = format!("stands in for {name} of {list}");
                set.add(&found, &reason, run)?;
            }
        }
        for other in assignments.iter().filter(|found| !is_list_variable(found)) {
            let line = format!("{list}: variable {} is not loaded", other.name);
            set.explanation.push(line);
        }
        Ok(set)
    }

    /// A metakernel that loads the same kernels in the same order.
    ///
    /// * `relative_to` – the folder of the metakernel; paths are written relative to it where possible
    #[must_use]
    pub fn metakernel_text(&self, relative_to: Option<&Path>) -> String {
        self.metakernel_text_before(relative_to, &[])
    }

    /// A metakernel that loads the same kernels in the same order, and then the kernels of `later`.
    ///
    /// * `relative_to` – as for [`Self::metakernel_text`]
    /// * `later` – their paths are written unchanged, relative to the metakernel's folder
    #[must_use]
    pub fn metakernel_text_before(&self, relative_to: Option<&Path>, later: &[Kernel]) -> String {
        let described = self.kernels.iter().chain(later).map(|kernel| {
            format!(
                "   {} {}, {} bytes, BLAKE3 {}\n",
                kernel.file_name(),
                kernel.role,
                kernel.bytes,
                kernel.blake3
            )
        });
        let earlier = self.kernels.iter();
        let paths = earlier.map(|kernel| relative_path(&kernel.path, relative_to));
        let paths = paths.chain(later.iter().map(|kernel| kernel.path.clone()));
        let listed = paths.flat_map(|path| {
            let mut parts = split_string(&path.to_string_lossy());
            let last = parts.pop();
            let parts = parts.into_iter().map(|part| part + "+").chain(last);
            parts.map(|part| format!("      '{}'\n", part.replace('\'', "''")))
        });
        let before = "KPL/MK\n\nKernels of an areograph run, in load order. Relative paths are \
                      relative to the folder of this file.\n\n";
        [before.to_owned()]
            .into_iter()
            .chain(described)
            .chain(["\n\\begindata\n\n   KERNELS_TO_LOAD = (\n".to_owned()])
            .chain(listed)
            .chain(["   )\n\n\\begintext\n".to_owned()])
            .collect()
    }
}

fn is_list_variable(assignment: &Assignment) -> bool {
    ["KERNELS_TO_LOAD", "PATH_SYMBOLS", "PATH_VALUES"].contains(&assignment.name.as_str())
}

/// Names to load, with symbols replaced.
fn listed_names(assignments: &[Assignment]) -> std::result::Result<Vec<String>, SpiceError> {
    let symbols = strings(assignments, "PATH_SYMBOLS")?;
    let values = strings(assignments, "PATH_VALUES")?;
    if symbols.len() != values.len() {
        return Err(SpiceError::NotAKernel {
            found: format!(
                "a metakernel with {} PATH_SYMBOLS and {} PATH_VALUES",
                symbols.len(),
                values.len()
            ),
            expected: "as many values as symbols",
        });
    }
    let mut pairs: Vec<(String, String)> = symbols.into_iter().zip(values).collect();
    // A symbol that begins with another one is replaced first.
    pairs.sort_by_key(|(symbol, _)| std::cmp::Reverse(symbol.len()));
    let names = strings(assignments, "KERNELS_TO_LOAD")?;
    if names.is_empty() {
        return Err(SpiceError::NotAKernel {
            found: "a metakernel that lists no kernels".to_owned(),
            expected: "names in KERNELS_TO_LOAD",
        });
    }
    let replace = |name: String| {
        pairs.iter().fold(name, |name, (symbol, value)| {
            name.replace(&format!("${symbol}"), value)
        })
    };
    let names: Vec<String> = names.into_iter().map(replace).collect();
    match names.iter().find(|name| name.starts_with('$')) {
        Some(name) => Err(SpiceError::NotAKernel {
            found: format!("a metakernel that names {name}"),
            expected: "this path symbol in PATH_SYMBOLS, with its value in PATH_VALUES",
        }),
        None => Ok(names),
    }
}

/// The strings of a variable, continued ones joined.
fn strings(
    assignments: &[Assignment],
    variable: &str,
) -> std::result::Result<Vec<String>, SpiceError> {
    let mut joined = Vec::new();
    let mut begun = String::new();
    for value in values_of(assignments, variable) {
        let Value::Text(text) = value else {
            return Err(SpiceError::NotAKernel {
                found: format!("a metakernel with the number {value:?} in {variable}"),
                expected: "quoted strings",
            });
        };
        let text = text.trim_end();
        if let Some(part) = text.strip_suffix('+') {
            begun.push_str(part);
        } else {
            begun.push_str(text);
            joined.push(std::mem::take(&mut begun));
        }
    }
    if !begun.is_empty() {
        return Err(SpiceError::NotAKernel {
            found: format!("a metakernel in which {variable} ends with '+'"),
            expected: "another string after it",
        });
    }
    Ok(joined)
}

/// The one file beside `written` whose name differs only in case and separators.
fn same_name(written: &Path, name: &str) -> std::result::Result<PathBuf, SpiceError> {
    let folded = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.to_ascii_lowercase().replace(['.', '-'], "_")
    };
    let required = folded(written);
    let folder = written.parent().unwrap_or(Path::new(""));
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut similar: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| folded(path) == required)
        .collect();
    similar.sort();
    if let [only] = similar.as_slice() {
        return Ok(only.clone());
    }
    let candidates = if similar.is_empty() {
        format!(" (looked in {})", folder.display())
    } else {
        let names: Vec<String> = similar.iter().map(|p| p.display().to_string()).collect();
        format!("; possible files: {}", names.join(", "))
    };
    Err(SpiceError::MissingKernel {
        name: name.to_owned(),
        candidates,
    })
}

/// `path` relative to `folder`; unchanged without a folder or a relative path.
fn relative_path(path: &Path, folder: Option<&Path>) -> PathBuf {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    let Ok(target) = whole(path) else {
        return path.to_owned();
    };
    let Some(Ok(folder)) = folder.map(whole) else {
        return target;
    };
    let shared = target
        .components()
        .zip(folder.components())
        .take_while(|(a, b)| a == b)
        .count();
    // Only the root is common: another disk or tree, where a relative path would mislead.
    if shared <= 1 {
        return target;
    }
    let up = folder
        .components()
        .skip(shared)
        .map(|_| Component::ParentDir);
    up.chain(target.components().skip(shared)).collect()
}

/// Pieces that fit into strings of a text kernel, with room for the `+`.
fn split_string(text: &str) -> Vec<String> {
    let mut parts = vec![String::new()];
    for character in text.chars() {
        let full = parts
            .last()
            .is_none_or(|part| part.len() + character.len_utf8() >= STRING_MAX);
        if full {
            parts.push(String::new());
        }
        if let Some(part) = parts.last_mut() {
            part.push(character);
        }
    }
    parts
}
