//! Selection of kernels from a folder, with a reason for each.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    coverage::{RequiredCoverage, interval_of},
    daf::{self, Segment},
    error::{SUN_LIGHT_S, SpiceError},
    kernels::{KernelSet, not_a_kernel, read_text, role_of},
    needs::{MARS, Need, defines, needs},
    role::KernelRole,
    session::Session,
    text_kernel::{self, Assignment, values_of},
};
use areograph_base::{
    body::MARS_IAU2000,
    constants::{FETCH_FOLDER, NAIF_SUN, SPACECRAFT},
    error::{Error, IoError, Kind, Locate, Result},
    instruments::Instrument,
    kernel_names::{family_of, natural_order, quality_of, version_of},
    kernel_source::{CkQuality, KernelSelection},
    time::{Interval, Intervals},
};
use areograph_store::files::{InputFiles, file_name};

/// Deepest folder below the root that is searched.
const DEPTH_MAX: usize = 16;
/// Maximum number of files that are inspected.
const FILES_MAX: usize = 100_000;

/// Files of a folder by their content.
#[derive(Default)]
struct Found {
    texts: Vec<(PathBuf, Vec<Assignment>)>,
    ephemerides: Vec<(PathBuf, Vec<Segment>)>,
    attitudes: Vec<PathBuf>,
    notes: Vec<String>,
}

impl KernelSet {
    /// Selects from a folder: the latest text kernels (pinned ones win), planetary ephemerides, the chosen orbit
    /// solution, and attitudes from the worst quality to the best, so that the best wins.
    ///
    /// * `cameras` – cameras whose frames the text kernels may define, one of them at least
    /// * `required` – instants that ephemerides and attitudes must cover; without any, only text kernels are selected,
    ///   which is enough to tag times
    ///
    /// # Errors
    /// [`SpiceError::NothingToSelect`] when a required text kernel or the orbit solution is missing; [`IoError`] when
    /// the folder cannot be read.
    pub fn select(
        selection: &KernelSelection,
        cameras: &[Instrument],
        required: &RequiredCoverage,
    ) -> Result<Self> {
        Self::select_of(&InputFiles::default(), selection, cameras, required)
    }

    /// All kernels of a folder, text kernels first, then ephemerides and attitudes, each by name. Sites select from them.
    ///
    /// # Errors
    /// [`SpiceError::NotAKernel`] for a folder without a kernel; [`IoError`] when the folder cannot be read.
    pub(super) fn in_folder(folder: &Path) -> Result<Self> {
        let run = InputFiles::default();
        let found = Found::in_folder(folder, &run)?;
        let texts = found.texts.iter().map(|(path, _)| path);
        let ephemerides = found.ephemerides.iter().map(|(path, _)| path);
        let mut set = Self::default();
        for path in texts.chain(ephemerides).chain(&found.attitudes) {
            set.add(path, "in the folder", &run)?;
        }
        if set.kernels.is_empty() {
            return not_a_kernel(folder, "a folder without kernels");
        }
        set.explanation.extend(found.notes);
        Ok(set)
    }

    /// Like [`Self::select`], with the hashes that a run has of its input files.
    ///
    /// # Errors
    /// Those of [`Self::select`]; a file that has changed since the run read it.
    pub fn select_of(
        run: &InputFiles,
        selection: &KernelSelection,
        cameras: &[Instrument],
        required: &RequiredCoverage,
    ) -> Result<Self> {
        let found = Found::in_folder(&selection.root, run)?;
        let mut set = Selected {
            set: Self::default(),
            run,
        };
        select_texts(selection, cameras, &found.texts, &mut set).in_file(&selection.root)?;
        if *required != RequiredCoverage::default() {
            select_ephemerides(selection, &found.ephemerides, &required.positions, &mut set)
                .in_file(&selection.root)?;
            select_attitudes(selection, &found.attitudes, &required.attitudes, &mut set)?;
        }
        set.set.explanation.extend(found.notes);
        Ok(set.set)
    }
}

/// The kernels selected so far, and the hashes that the run has.
struct Selected<'a> {
    set: KernelSet,
    run: &'a InputFiles,
}

impl Selected<'_> {
    fn add(&mut self, path: &Path, reason: &str) -> Result<()> {
        self.set.add(path, reason, self.run)
    }
}

impl Found {
    fn in_folder(root: &Path, run: &InputFiles) -> Result<Self> {
        let mut found = Self::default();
        for path in files_below(root)? {
            run.admit(&path)?;
            let role = match role_of(&path) {
                Ok(role) => role,
                Err(failure) if failure.kind() == Kind::Io => return Err(failure),
                Err(failure) => {
                    found.leave_out(&path, &failure);
                    continue;
                }
            };
            match role {
                KernelRole::Spk => {
                    let segments = daf::segments(&path)?;
                    found.ephemerides.push((path, segments));
                }
                KernelRole::Ck => found.attitudes.push(path),
                KernelRole::Meta => {
                    let note = format!("{}: not used because it is a metakernel", file_name(&path));
                    found.notes.push(note);
                }
                _ => match read_text(&path).and_then(|text| Ok(text_kernel::assignments(&text)?)) {
                    Ok(assignments) => found.texts.push((path, assignments)),
                    Err(failure) => found.leave_out(&path, &failure),
                },
            }
        }
        Ok(found)
    }

    fn leave_out(&mut self, path: &Path, failure: &Error) {
        let note = format!("{}: not used, {}", file_name(path), failure.cause);
        self.notes.push(note);
    }
}

/// All regular files below `root`, sorted; links to folders are not followed, and incomplete transfers are omitted.
fn files_below(root: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![(root.to_owned(), 0)];
    while let Some((folder, depth)) = folders.pop() {
        let entries = fs::read_dir(&folder)
            .map_err(IoError::on("list folder"))
            .in_file(&folder)?;
        for entry in entries {
            let entry = entry.map_err(IoError::on("list folder")).in_file(&folder)?;
            let kind = entry
                .file_type()
                .map_err(IoError::on("list folder"))
                .in_file(entry.path())?;
            if entry.file_name() == FETCH_FOLDER {
                continue;
            }
            if kind.is_dir() && depth < DEPTH_MAX {
                folders.push((entry.path(), depth + 1));
            } else if entry.path().is_file() {
                files.push(entry.path());
            }
            if files.len() > FILES_MAX {
                let what =
                    format!("can be selected: the folder contains more than {FILES_MAX} files");
                return Err(SpiceError::NothingToSelect { what }).in_file(root);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// For each requirement the pinned kernel that defines it, or the latest one.
fn select_texts(
    selection: &KernelSelection,
    cameras: &[Instrument],
    texts: &[(PathBuf, Vec<Assignment>)],
    set: &mut Selected<'_>,
) -> Result<()> {
    let pinned = |path: &Path| selection.pinned.iter().any(|name| *name == file_name(path));
    for name in &selection.pinned {
        if !texts.iter().any(|(path, _)| file_name(path) == *name) {
            let what = format!("is the text kernel {name}, which the configuration pins");
            return Err(SpiceError::NothingToSelect { what }.into());
        }
    }
    let mut chosen: Vec<&Path> = Vec::new();
    for Need { variable, what, .. } in needs(texts, cameras) {
        let mut candidates: Vec<&(PathBuf, Vec<Assignment>)> = texts
            .iter()
            .filter(|(path, assignments)| {
                defines(assignments, &variable)
                    && (pinned(path) || mars_fits(&variable, assignments))
            })
            .collect();
        candidates.sort_by_key(|(path, _)| version_of(path));
        let Some((best, _)) = candidates.last() else {
            let what = format!("defines {what} ({variable})");
            return Err(SpiceError::NothingToSelect { what }.into());
        };
        // One file may satisfy two requirements: the clock kernel of MGS also defines its bus frame.
        let served = candidates
            .iter()
            .any(|(path, _)| pinned(path) || chosen.contains(&path.as_path()));
        if !served {
            let reason = format!("latest of {} with {what}", candidates.len());
            set.add(best, &reason)?;
            chosen.push(best);
        }
    }
    // Last, so that a pinned file wins over other definitions of the same variables.
    for name in &selection.pinned {
        for (path, _) in texts.iter().filter(|(path, _)| file_name(path) == *name) {
            set.add(path, "pinned")?;
        }
    }
    Ok(())
}

/// Whether planetary constants have the Mars of IAU 2000, the frame of all products.
fn mars_fits(variable: &str, assignments: &[Assignment]) -> bool {
    variable != MARS.variable
        || values_of(assignments, variable)
            .first()
            .and_then(|value| value.number())
            .is_some_and(|meridian_deg| (meridian_deg - MARS_IAU2000.meridian_deg).abs() < 1e-6)
}

/// Ephemerides without MGS, then MGS ephemerides in the chosen orbit solution.
fn select_ephemerides(
    selection: &KernelSelection,
    ephemerides: &[(PathBuf, Vec<Segment>)],
    required: &Intervals,
    set: &mut Selected<'_>,
) -> Result<()> {
    let family = selection.spk_family.to_ascii_lowercase();
    let of_spacecraft = ephemerides
        .iter()
        .filter(|(_, segments)| holds_spacecraft(segments));
    if !of_spacecraft
        .clone()
        .any(|(path, _)| family_of(path, &family))
    {
        let names: Vec<String> = of_spacecraft.map(|(path, _)| file_name(path)).collect();
        let what = format!(
            "contains the orbit of {} in the solution {family} (found: {})",
            SPACECRAFT.name,
            names.join(", ")
        );
        return Err(SpiceError::NothingToSelect { what }.into());
    }
    // Planets first; of several versions the latest last, so that it wins.
    let mut ordered: Vec<&(PathBuf, Vec<Segment>)> = ephemerides.iter().collect();
    ordered.sort_by_key(|(path, segments)| (holds_spacecraft(segments), natural_order(path)));
    let sun = when_light_left_sun(required);
    let touches = |segments: &[Segment]| {
        let own = holds_spacecraft(segments);
        let held = held_by(segments, |target| !own || target == SPACECRAFT.naif);
        meets(&held, required)
            || (!own && meets(&held_by(segments, |target| target == NAIF_SUN), &sun))
    };
    let fits =
        |path: &Path, segments: &[Segment]| !holds_spacecraft(segments) || family_of(path, &family);
    let chosen = ordered
        .iter()
        .filter(|(path, segments)| fits(path, segments) && touches(segments));
    let sun_of_chosen = chosen.flat_map(|(_, segments)| {
        let held = held_by(segments, |target| target == NAIF_SUN);
        held.as_slice().to_vec()
    });
    // Slices of an orbit may hold the Sun themselves: the slice at the departure of its light may end before the first
    // image.
    let no_sun = sun.without(&Intervals::union_of(sun_of_chosen));
    for (path, segments) in ordered {
        let own = holds_spacecraft(segments);
        let name = file_name(path);
        if !fits(path, segments) {
            let line =
                format!("{name}: not used because it is not from the orbit solution {family}");
            set.set.explanation.push(line);
        } else if touches(segments) {
            let reason = if own {
                format!("orbit of {}, solution {family}", SPACECRAFT.name)
            } else {
                "planetary ephemeris".to_owned()
            };
            set.add(path, &reason)?;
        } else if meets(&held_by(segments, |target| target == NAIF_SUN), &no_sun) {
            set.add(
                path,
                "position of the Sun when the light that reaches Mars left it",
            )?;
        } else {
            let line = format!("{name}: not used because it covers none of the required times");
            set.set.explanation.push(line);
        }
    }
    Ok(())
}

fn holds_spacecraft(segments: &[Segment]) -> bool {
    segments
        .iter()
        .any(|segment| segment.integers[0] == SPACECRAFT.naif)
}

/// Times that the segments of some targets hold.
fn held_by(segments: &[Segment], target: impl Fn(i32) -> bool) -> Intervals {
    let of_target = segments
        .iter()
        .filter(|segment| target(segment.integers[0]));
    Intervals::union_of(of_target.map(|segment| interval_of([segment.start, segment.stop])))
}

fn meets(held: &Intervals, required: &Intervals) -> bool {
    !held.intersection(required).as_slice().is_empty()
}

/// Intervals at which the light of the Sun that is seen from Mars at `required` left the Sun.
fn when_light_left_sun(required: &Intervals) -> Intervals {
    let [late_s, early_s] = SUN_LIGHT_S;
    let left = required
        .as_slice()
        .iter()
        .map(|seen| Interval::new(seen.start.plus(-early_s), seen.stop.plus(-late_s)));
    Intervals::union_of(left)
}

/// Attitudes that overlap the required times, the worst quality first, and the intervals that commanded ones fill.
fn select_attitudes(
    selection: &KernelSelection,
    attitudes: &[PathBuf],
    required: &Intervals,
    set: &mut Selected<'_>,
) -> Result<()> {
    // Times of a C-kernel are clock ticks: the text kernels selected so far convert them to ET.
    let session = Session::open(&set.set)?;
    let (mut telemetry, mut commanded) = (Vec::new(), Vec::new());
    for quality in selection.ck_quality.iter().rev() {
        let mut of_quality: Vec<&PathBuf> = attitudes
            .iter()
            .filter(|path| quality_of(path) == *quality)
            .collect();
        of_quality.sort_by_key(|path| natural_order(path));
        for path in of_quality {
            let name = file_name(path);
            let held = session
                .cspice()
                .ck_coverage(path, SPACECRAFT.bus)
                .in_file(path)?;
            let hull = held.first().zip(held.last());
            let hull = hull.map(|(first, last)| interval_of([first[0], last[1]]));
            let hull = Intervals::union_of(hull);
            if hull.intersection(required).as_slice().is_empty() {
                let line = format!(
                    "{name}: not used because it contains no attitude near the required times"
                );
                set.set.explanation.push(line);
                continue;
            }
            let held = held.into_iter().map(interval_of);
            if *quality == CkQuality::Nominal {
                let name_of = &SPACECRAFT.name;
                set.add(
                    path,
                    &format!("NOMINAL attitude of {name_of}: commanded, not measured"),
                )?;
                commanded.push((name, Intervals::union_of(held)));
            } else {
                set.add(
                    path,
                    &format!("Reconstructed attitude of {}", SPACECRAFT.name),
                )?;
                telemetry.extend(held);
            }
        }
    }
    for path in attitudes {
        let quality = quality_of(path);
        if !selection.ck_quality.contains(&quality) {
            let line = format!("{}: not used, {quality:?} attitude", file_name(path));
            set.set.explanation.push(line);
        }
    }
    if selection.ck_quality.first() == Some(&CkQuality::Nominal) {
        telemetry.clear();
    }
    explain_commanded(required, &Intervals::union_of(telemetry), commanded, set);
    Ok(())
}

/// States which required attitudes come from commanded kernels, because no winning telemetry covers them.
fn explain_commanded(
    required: &Intervals,
    telemetry: &Intervals,
    commanded: Vec<(String, Intervals)>,
    set: &mut Selected<'_>,
) {
    let mut missing = required.without(telemetry);
    // The last one wins where several cover the same instant.
    for (name, held) in commanded.into_iter().rev() {
        for filled in missing.intersection(&held).as_slice() {
            if filled.duration_s() > 0.0 {
                let line = format!("attitude of {filled} comes from nominal {name}");
                set.set.explanation.push(line);
            }
        }
        missing = missing.without(&held);
    }
}
