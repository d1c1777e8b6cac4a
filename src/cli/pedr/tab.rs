//! `areograph pedr tab`.

use std::{
    collections::BTreeMap,
    fs,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use clap::{Args, ValueEnum};

use crate::{
    cli::{
        files::{PEDR_FILES, expand},
        output,
        stop::Signals,
    },
    error::{Cause, IoError, Locate as _, Result, Stopped},
    files::{Mark, MarkAt, StagedFile, require_apart},
    pds::{
        pedr::{Complaint, File},
        pedr_table::{Preferences, Rules, Table, Variant},
    },
};

/// Prints shots in the text tables of pedr2tab, byte for byte, from the same PEDR2TAB.PRM and the same list of files.
///
/// Known errors of pedr2tab are reproduced, unless --per-shot is given. Its errors, and the rules of --per-shot:
///
///   window          tests the mid-point of a frame, between two longitudes  |  tests every shot, across 0° too
///   gate            a frame without parallax and crossover residual keeps those of the last one in the window, even of
///                   another file                                            |  has none
///   old files       after a file older than version 7.125 no residual is read, but the last one is still subtracted;
///                   after one of 7.0 or older all files need orbit model 3  |  each file by its own version
///   slope           of the residual counts from the last frame in the window, however far back
///                                                                           |  from the adjoining frame, else constant
///   first frames    a file with a single frame, if it has a residual, gives no line  |  gives its lines
///   bad records     are printed                                             |  are left out and reported
///   pulse width     counts above 127 are printed as negative                |  as they are
///   lists           end at the first file that cannot be opened             |  go on to the next; both end as an error
///
/// Not reproduced: names are not cut at 64 characters and may contain dots and folders, more than 99,999 frames are read,
/// and an invalid trigger channel does not cause a read beyond its table.
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Example: areograph pedr tab ap19019l.b --per-shot"
)]
pub(super) struct Arguments {
    /// A PEDR file (its name contains .b or .B), or a text file with one file name per line.
    #[arg(default_value = "FILELIST")]
    input: PathBuf,
    /// Preferences; by default PEDR2TAB.PRM. If that file is missing, the defaults of pedr2tab apply: ground returns, group 0,
    /// headings, one table per file.
    #[arg(long, value_name = "FILE")]
    preferences: Option<PathBuf>,
    /// Program whose column widths and order of sums the table follows.
    #[arg(long, default_value = "team")]
    variant: Program,
    /// Apply the rules above instead of the errors of pedr2tab.
    #[arg(long)]
    per_shot: bool,
    /// Folder of the tables.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
}

/// Program whose output is reproduced.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Program {
    /// Program of the MOLA team: off-nadir angle in 7 columns, packet and orbit in 6.
    Team,
    /// Port of the USGS: off-nadir angle in 8 columns, packet in 7 and orbit in 8.
    Usgs,
}

/// A file that pedr2tab does not accept.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the label does not begin with CCSD3ZF0")]
#[cause(Input: "name a PEDR file, or a list file without .b in its name; the marker is not required in a list or with \
    --per-shot")]
struct NoMarker;

/// Two files whose tables have the same name.
#[derive(Debug, thiserror::Error, Cause)]
#[error("would be the table of {} and of {}; expected one table per file", .0.display(), .1.display())]
#[cause(Configuration: "name each file once; write tables with the same name into different folders (--out), or all files \
    into one table (T before its name in the preferences)")]
struct OneName(PathBuf, PathBuf);

/// Default preferences file.
const PREFERENCES: &str = "PEDR2TAB.PRM";
/// Tables have the bytes of pedr2tab, with no place for a mark.
const TABLE: Mark = Mark {
    what: "a table that areograph wrote",
    at: MarkAt::List,
};
/// Complaints shown for a file; all are counted.
const COMPLAINTS_PRINTED: usize = 20;

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let preferences = read_preferences(arguments.preferences.as_deref())?;
    let rules = if arguments.per_shot {
        Rules::PerShot
    } else {
        Rules::Program
    };
    let variant = match arguments.variant {
        Program::Team => Variant::Team,
        Program::Usgs => Variant::Usgs,
    };
    let mut table = Table::new(preferences, variant, rules);
    let mut one_table: Option<Output> = None;
    let (files, is_list) = files(&arguments.input)?;
    let tables = tables(arguments, &files, table.preferences())?;
    let mut failure = None;
    let signals = Signals::heard()?;
    for (path, table_path) in files.into_iter().zip(tables) {
        Stopped::check(signals.stop())?;
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) => {
                if let Some(earlier) = failure.replace(error) {
                    output::error(earlier);
                }
                if rules == Rules::Program {
                    break;
                }
                continue;
            }
        };
        if rules == Rules::Program {
            if !is_list && !file.label().has_marker() {
                return Err(NoMarker).in_file(&path);
            }
            if is_list && file.label().software_version.is_none() {
                output::line(format_args!(
                    "{}: no SOFTWARE_NAME, skipped",
                    path.display()
                ));
                continue;
            }
        }
        let before = table.shots;
        let headed = one_table.is_some();
        let mut output = match one_table.take() {
            Some(output) => output,
            None => Output::create(&table_path)?,
        };
        if !headed {
            output.write(|out| table.write_headings(out))?;
        }
        let complaints = output.write(|out| table.write(&file, out))?;
        if table.preferences().one_table {
            one_table = Some(output);
        } else {
            output.finish()?;
        }
        tell(&path, table.shots - before, &complaints);
    }
    if let Some(output) = one_table {
        output.finish()?;
    }
    failure.map_or(Ok(()), Err)
}

/// Preferences of the named file, else of the default one, which is optional.
fn read_preferences(named: Option<&Path>) -> Result<Preferences> {
    let path = named.unwrap_or(Path::new(PREFERENCES));
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if named.is_none() && error.kind() == std::io::ErrorKind::NotFound => {
            output::line(format_args!(
                "{}: not found; the default preferences of pedr2tab apply",
                path.display()
            ));
            return Ok(Preferences::default());
        }
        Err(error) => return Err(IoError::on("read")(error)).in_file(path),
    };
    let preferences = Preferences::parse(&String::from_utf8_lossy(&bytes));
    if let Some(ended) = &preferences.ended {
        output::line(format_args!(
            "{}: {ended}; from there on the default preferences of pedr2tab apply",
            path.display()
        ));
    }
    Ok(preferences)
}

/// The files to read, and whether they come from a list. Names in a list without `.b` or `.B` are skipped with a line.
fn files(input: &Path) -> Result<(Vec<PathBuf>, bool)> {
    if input.is_dir() {
        return Ok((expand(&[input.to_owned()], &PEDR_FILES)?, true));
    }
    let is_pedr = |name: &str| name.contains(".b") || name.contains(".B");
    if is_pedr(&input.to_string_lossy()) {
        return Ok((vec![input.to_owned()], false));
    }
    let list = fs::read(input)
        .map_err(IoError::on("read"))
        .in_file(input)?;
    let list = String::from_utf8_lossy(&list);
    let mut files = Vec::new();
    for name in list.lines().map(str::trim_end) {
        if is_pedr(name) {
            files.push(PathBuf::from(name));
        } else {
            output::line(format_args!(
                "skipping {name:?}: a PEDR file has .b or .B in its name"
            ));
        }
    }
    Ok((files, true))
}

/// The table of each file; no table is shared or is an input file.
fn tables(
    arguments: &Arguments,
    files: &[PathBuf],
    preferences: &Preferences,
) -> Result<Vec<PathBuf>> {
    let table = |path: &PathBuf| arguments.out.join(table_name(path, preferences));
    let tables: Vec<PathBuf> = files.iter().map(table).collect();
    let mut of_table: BTreeMap<&Path, &Path> = BTreeMap::new();
    for (table, path) in tables.iter().zip(files) {
        let earlier = of_table.insert(table, path);
        if let Some(earlier) = earlier.filter(|_| !preferences.one_table) {
            return Err(OneName(earlier.to_owned(), path.clone())).in_file(table);
        }
    }
    let usual = Path::new(PREFERENCES);
    let read = [
        &*arguments.input,
        arguments.preferences.as_deref().unwrap_or(usual),
    ];
    require_apart(
        of_table.keys().copied(),
        read.into_iter().chain(files.iter().map(PathBuf::as_path)),
    )?;
    Ok(tables)
}

/// Name of the common table, or of the table of a file: the last eight characters before its extension, and the
/// extension of the template.
fn table_name(path: &Path, preferences: &Preferences) -> String {
    let template = preferences.table_name.as_str();
    if preferences.one_table {
        return template.trim_end().to_owned();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let from = stem.char_indices().rev().nth(7).map_or(0, |(at, _)| at);
    let extension = template
        .find('.')
        .map_or(template, |dot| &template[dot + 1..]);
    let extension: String = extension.chars().take(3).collect();
    format!("{}.{}", &stem[from..], extension.trim_end())
}

fn tell(path: &Path, shots: u64, complaints: &[Complaint]) {
    output::line(format_args!(
        "{}: {shots} shots, {} complaints",
        path.display(),
        complaints.len()
    ));
    for complaint in complaints.iter().take(COMPLAINTS_PRINTED) {
        output::line(format_args!("  {complaint}"));
    }
}

/// An unfinished table; it gets its name once it is complete.
struct Output {
    file: StagedFile,
    writer: BufWriter<fs::File>,
}

impl Output {
    fn create(path: &Path) -> Result<Self> {
        let file = StagedFile::replacing(path, TABLE)?;
        let writer = BufWriter::new(file.writer()?);
        Ok(Self { file, writer })
    }

    fn write<T>(&mut self, write: impl FnOnce(&mut dyn Write) -> std::io::Result<T>) -> Result<T> {
        write(&mut self.writer)
            .map_err(IoError::on("write"))
            .in_file(self.file.path())
    }

    fn finish(mut self) -> Result<()> {
        self.write(|writer| writer.flush())?;
        self.file.finish()
    }
}
