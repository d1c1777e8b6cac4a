//! Kernel files: their role, from their content, and their load order.

use std::{
    fs::{self, File},
    io::Read,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{daf, error::SpiceError, ffi, role::KernelRole, text_kernel};
use areograph_base::error::{IoError, Locate, Result};
use areograph_store::files::{InputFiles, file_name};

/// Largest text kernel that is read, bytes; the archive's largest is below 2 MB.
const TEXT_SIZE_MAX: u64 = 64 << 20;
/// Expected kinds of a file, for messages.
const EXPECTED: &str =
    "a binary SPK, CK or PCK (DAF/...) or a text kernel with a \\begindata block";

/// A kernel file as of its selection.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Kernel {
    /// Path as given or found.
    pub path: PathBuf,
    /// Its role.
    pub role: KernelRole,
    /// Size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub blake3: String,
}

impl Kernel {
    /// Identifies and hashes a file and checks the words of a binary one, unless the same content has passed the check
    /// before.
    ///
    /// # Errors
    /// [`IoError`]; [`SpiceError::NotAKernel`]; [`SpiceError::DamagedKernel`].
    pub fn inspect(path: &Path, files: &InputFiles) -> Result<Self> {
        ffi::c_path(path).in_file(path)?;
        files.admit(path)?;
        let role = role_of(path)?;
        let file = files.hash(path)?;
        let binary = first_bytes(path)?.starts_with(b"DAF/");
        if binary && !files.has_passed(&file.blake3, daf::CHECK) {
            daf::check_contents(path, role)?;
            // The checked content is the hashed content.
            files.verify(path)?;
            files.note_passed(&file.blake3, daf::CHECK);
        }
        Ok(Self {
            path: file.path,
            role,
            bytes: file.bytes,
            blake3: file.blake3,
        })
    }

    /// Name of the file without its folder.
    #[must_use]
    pub fn file_name(&self) -> String {
        file_name(&self.path)
    }
}

/// Kernels in load order (later ones win), with the reason for each.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct KernelSet {
    pub(super) kernels: Vec<Kernel>,
    pub(super) explanation: Vec<String>,
}

impl KernelSet {
    /// The kernels of a metakernel, if this is the only file and ends in `.tm`; all kernels of a folder, if it is the only
    /// path, in the order of [`Self::select`]; else these kernels in load order.
    ///
    /// # Errors
    /// As of [`Self::from_metakernel`] and [`Self::from_files`]; a folder without a kernel.
    pub fn named(files: &[PathBuf]) -> Result<Self> {
        let is_metakernel = |path: &PathBuf| {
            let ending = path.extension();
            ending.is_some_and(|ending| ending.eq_ignore_ascii_case("tm"))
        };
        match files {
            [one] if is_metakernel(one) => Self::from_metakernel(one),
            [folder] if folder.is_dir() => Self::in_folder(folder),
            files => Self::from_files(files),
        }
    }

    /// These files in this order; of files with the same content only the last one is loaded, since in SPICE the last
    /// one wins.
    ///
    /// # Errors
    /// [`IoError`] for a file that cannot be read, [`SpiceError::NotAKernel`] for a file that is not a kernel (its role
    /// is found by content, never by name), [`SpiceError::DamagedKernel`] for a truncated one.
    pub fn from_files(files: &[PathBuf]) -> Result<Self> {
        Self::from_files_of(&InputFiles::default(), files)
    }

    /// Like [`Self::from_files`], with the hashes that a run has of its input files.
    ///
    /// # Errors
    /// Those of [`Self::from_files`]; a file that has changed since the run read it.
    pub fn from_files_of(run: &InputFiles, files: &[PathBuf]) -> Result<Self> {
        let mut set = Self::default();
        for path in files {
            set.add(path, "listed", run)?;
        }
        Ok(set)
    }

    /// The kernels followed by an inspected one.
    #[must_use]
    pub fn with(mut self, kernel: Kernel) -> Self {
        self.kernels.push(kernel);
        self
    }

    /// The kernels followed by `files`, which therefore take precedence.
    ///
    /// # Errors
    /// As [`Self::from_files`].
    pub fn followed_by(&self, files: &[PathBuf]) -> Result<Self> {
        let mut set = self.clone();
        for path in files {
            set.add(path, "follows the listed ones", &InputFiles::default())?;
        }
        Ok(set)
    }

    /// Appends a file; an earlier one of the same content is removed, since later files win.
    pub(super) fn add(&mut self, path: &Path, reason: &str, files: &InputFiles) -> Result<()> {
        let kernel = Kernel::inspect(path, files)?;
        if kernel.role == KernelRole::Meta {
            let error = SpiceError::NotAKernel {
                found: "a metakernel".to_owned(),
                expected: "a kernel; a metakernel is given alone and lists no other metakernel",
            };
            return Err(error).in_file(path);
        }
        let name = kernel.file_name();
        self.explanation.push(format!("{name}: {reason}"));
        let same = |held: &Kernel| held.blake3 == kernel.blake3;
        if let Some(index) = self.kernels.iter().position(same) {
            let earlier = self.kernels.remove(index).file_name();
            self.explanation.push(format!(
                "{earlier}: not loaded at its earlier position because it has the same content as {name}"
            ));
        }
        self.kernels.push(kernel);
        Ok(())
    }

    /// The kernels in load order.
    #[must_use]
    pub fn kernels(&self) -> &[Kernel] {
        &self.kernels
    }

    /// The kernels of some roles, in the same order.
    #[must_use]
    pub fn of_roles(&self, required: impl Fn(KernelRole) -> bool) -> Self {
        let kernels = self.kernels.iter().filter(|kernel| required(kernel.role));
        Self {
            kernels: kernels.cloned().collect(),
            explanation: self.explanation.clone(),
        }
    }

    /// The reason for choosing or omitting each kernel, one line each.
    #[must_use]
    pub fn explanation(&self) -> &[String] {
        &self.explanation
    }

    /// The part of the explanation that the list of kernels does not contain: all except that a kernel was listed.
    pub fn notes(&self) -> impl Iterator<Item = &String> {
        let plain = |line: &str| {
            let mut kernels = self.kernels.iter();
            kernels.any(|kernel| {
                let reason = line.strip_prefix(&kernel.file_name());
                reason.is_some_and(|reason| reason.starts_with(": listed"))
            })
        };
        self.explanation.iter().filter(move |line| !plain(line))
    }
}

/// The role of a file, from its content.
pub(super) fn role_of(path: &Path) -> Result<KernelRole> {
    let start = first_bytes(path)?;
    let role = match start.as_slice() {
        [] => return not_a_kernel(path, "an empty file"),
        bytes if bytes.starts_with(b"DAF/SPK") => KernelRole::Spk,
        bytes if bytes.starts_with(b"DAF/CK") => KernelRole::Ck,
        bytes if bytes.starts_with(b"DAF/PCK") => KernelRole::Pck,
        bytes if bytes.starts_with(b"DAFETF") || bytes.starts_with(b"DASETF") => {
            return not_a_kernel(path, "a transfer file (convert it with NAIF's tobin)");
        }
        bytes if bytes.starts_with(b"NAIF/DA") || bytes.starts_with(b"DAS/") => {
            return not_a_kernel(path, "a binary NAIF file of a different kind");
        }
        _ => return text_role(path),
    };
    daf::segments(path).map(|_| role)
}

pub(super) fn not_a_kernel<T>(path: &Path, found: &str) -> Result<T> {
    Err(SpiceError::NotAKernel {
        found: found.to_owned(),
        expected: EXPECTED,
    })
    .in_file(path)
}

/// At most eight bytes from the start of a regular file.
fn first_bytes(path: &Path) -> Result<Vec<u8>> {
    let metadata = fs::metadata(path)
        .map_err(IoError::on("open kernel"))
        .in_file(path)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() {
            "a folder"
        } else {
            "not a regular file"
        };
        return not_a_kernel(path, found);
    }
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(8).read_to_end(&mut start))
        .map_err(IoError::on("open kernel"))
        .in_file(path)?;
    Ok(start)
}

/// The text of a text kernel.
///
/// # Errors
/// [`SpiceError::NotAKernel`] for other files.
pub(super) fn read_text(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(TEXT_SIZE_MAX + 1).read_to_end(&mut bytes))
        .map_err(IoError::on("read kernel"))
        .in_file(path)?;
    if bytes.contains(&0) {
        return not_a_kernel(path, "a binary file of a different kind");
    }
    if bytes.len() as u64 > TEXT_SIZE_MAX {
        return not_a_kernel(path, "too long for a text kernel");
    }
    let text = String::from_utf8_lossy(&bytes).into_owned();
    if text.lines().any(|line| line.trim() == "\\begindata") {
        return Ok(text);
    }
    let found = if text.trim_start().starts_with('<') {
        "a web page"
    } else {
        "a text without a \\begindata block"
    };
    not_a_kernel(path, found)
}

fn text_role(path: &Path) -> Result<KernelRole> {
    let text = read_text(path)?;
    let assignments = text_kernel::assignments(&text).in_file(path)?;
    let defines = |part: &str| assignments.iter().any(|found| found.name.starts_with(part));
    // Regardless of the header: CSPICE loads the files that such a variable lists, unchecked and unhashed.
    if defines("KERNELS_TO_LOAD") {
        return Ok(KernelRole::Meta);
    }
    let header = text.lines().next().unwrap_or_default().trim();
    let by_header = match header {
        "KPL/LSK" => Some(KernelRole::Lsk),
        "KPL/SCLK" => Some(KernelRole::Sclk),
        "KPL/PCK" => Some(KernelRole::Pck),
        "KPL/FK" => Some(KernelRole::Fk),
        "KPL/IK" => Some(KernelRole::Ik),
        "KPL/MK" => Some(KernelRole::Meta),
        _ => None,
    };
    if let Some(role) = by_header {
        return Ok(role);
    }
    let by_variable = [
        ("DELTET/", KernelRole::Lsk),
        ("SCLK", KernelRole::Sclk),
        ("INS-", KernelRole::Ik),
        ("FRAME_", KernelRole::Fk),
        ("TKFRAME_", KernelRole::Fk),
        ("BODY", KernelRole::Pck),
    ];
    let role = by_variable.into_iter().find(|(part, _)| defines(part));
    role.map_or_else(
        || not_a_kernel(path, "a text kernel of unknown kind"),
        |(_, role)| Ok(role),
    )
}
