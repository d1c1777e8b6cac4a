//! Reads tie points and finds their images among the site's.

mod error;
mod repeats;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
    sync::atomic::AtomicBool,
};

use serde::{Deserialize, Serialize};

use areograph_base::{
    error::Result,
    ties::{MatchedPair, TiePoint},
};
use areograph_config::{ImageConfig, TiesConfig};
use areograph_pds::{self as pds};
use areograph_store::{
    files::{HashedFile, file_name, hash_file},
    stage::{InOrder, Input, Inputs, Output, Stage},
    stage_inputs,
};

use super::tag_times::ImageTimes;
use error::{Outside, TiesError, nothing_found};

/// Complaints kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;

/// Tie points of a site.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Ties {
    /// Points with a measurement in one of the site's images, in the order of the files.
    pub points: Vec<TiePoint>,
    /// Measurements in images that the site does not have, by the name in the file.
    pub elsewhere: BTreeMap<String, u64>,
    /// Measurements and points that the network marks as ignored.
    pub ignored: u64,
    /// Complaints about malformed records; at most 1000 are kept.
    pub complaints: Vec<String>,
    /// Number of all complaints.
    pub complaint_count: u64,
    /// Files that are copies of another one, one sentence each.
    pub copies: Vec<String>,
    /// Disagreements that must be weighed, one sentence each.
    pub remarks: Vec<String>,
    /// Number of points that come from files.
    pub read: usize,
    /// Pairs of images in which areograph measured tie points itself; these follow the tie points of files.
    pub matched: Vec<MatchedPair>,
}

stage_inputs! {
    /// Tie point files, and the names that they have for the images.
    pub struct ReadTies<'a> {
        /// Paths of the files.
        pub ties: &'a TiesConfig,
        /// These files with their hashes.
        pub files: TieFiles<'a>,
        /// The images.
        pub images: ImageNames<'a>,
        /// Line times of the images, whose size bounds their measurements; an image without any is not checked.
        pub times: InOrder<'a, Output<ImageTimes>>,
    }
}

/// The tie point files of a site, in order.
#[derive(Debug)]
pub struct TieFiles<'a>(pub &'a [HashedFile]);

impl Input for TieFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        InOrder(self.0).add_to("ties", inputs);
    }
}

/// The images of a site, by their names in tie points.
#[derive(Debug)]
pub struct ImageNames<'a>(pub &'a [ImageConfig]);

impl Input for ImageNames<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        let images = self.0.iter();
        let names: Vec<[&str; 2]> = images
            .map(|image| [image.name_in_ties(), image.id.as_str()])
            .collect();
        inputs.setting("images (names in tie points)", &names);
    }
}

impl Stage for ReadTies<'_> {
    const NAME: &'static str = "read_ties";
    const METHOD: u32 = 7;
    const CHECKED: bool = true;
    type Output = Ties;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Ties> {
        let times = self.times.0.iter().map(Output::value);
        let times: Vec<&ImageTimes> = times.collect::<Result<_>>()?;
        read_ties(self.ties, self.images.0, &times)
    }

    fn findings(&self, ties: &Ties) -> Vec<String> {
        let (points, multi_image) = (ties.points.len(), ties.multi_image());
        let bad = match ties.complaint_count {
            0 => String::new(),
            count => format!("; {count} unreadable records"),
        };
        let found =
            format!("{points} tie points, {multi_image} of them in two or more images{bad}");
        let remarks = ties.remarks.iter();
        let remarks = remarks.map(|remark| format!("tie points: {remark}"));
        [found].into_iter().chain(remarks).collect()
    }
}

/// Reads all files of `ties`. Points with the same identifier in two files are one if they were measured in different
/// images; otherwise they stay two, of which an intersection uses the first. A copy of a file is not read again, and a
/// point that repeats the measurements of another one is left out, whatever its name.
///
/// # Errors
/// A file that is neither a table nor a network, or has no readable record; no measurement at all; none in an image of
/// the site; none that joins two of them; most points measured at places of other points; a measurement outside the
/// delivered lines or the samples of an image with `times`.
pub fn read_ties(ties: &TiesConfig, images: &[ImageConfig], times: &[&ImageTimes]) -> Result<Ties> {
    let names = names(images, times);
    let mut read = Ties::default();
    let mut first = BTreeMap::new();
    let mut contents: BTreeMap<String, &PathBuf> = BTreeMap::new();
    for path in &ties.files {
        pds::SizedFile::Ties.require(path)?;
        let (blake3, _) = hash_file(path)?;
        if let Some(original) = contents.get(&blake3) {
            let (copy, original) = (file_name(path), file_name(original));
            read.copies
                .push(format!("{copy}: a copy of {original}, read once"));
            continue;
        }
        contents.insert(blake3, path);
        let file = pds::ties::read_ties(path)?;
        read.ignored += file.ignored as u64;
        for complaint in file.complaints {
            read.complaint_count += 1;
            if read.complaints.len() < COMPLAINTS_MAX {
                let name = file_name(path);
                let (record, text) = (complaint.record, complaint.text);
                read.complaints
                    .push(format!("{name}: record {record}: {text}"));
            }
        }
        for tie in file.ties {
            read.take(tie, &names, &mut first);
        }
    }
    if read.points.is_empty() {
        return Err(nothing_found(&read, images).into());
    }
    if read.multi_image() == 0 {
        let points = read.points.len();
        return Err(TiesError::NoneJoins { points }.into());
    }
    for (index, image) in images.iter().enumerate() {
        if let Some(times) = times.iter().find(|times| times.id == image.id) {
            let outside = Outside::of(&read.points, index, times);
            outside.map_or(Ok(()), |outside| Err(TiesError::Outside(outside)))?;
        }
    }
    read.remarks.extend(repeats::leave_out(&mut read.points));
    let name = |image: usize| images.get(image).map_or("", |image| &*image.id);
    if let Some(shared) = repeats::shared_places(&read.points, name) {
        if 2 * shared.points > read.points.len() {
            return Err(TiesError::SharedPlaces(shared).into());
        }
        read.remarks.push(shared.to_string());
    }
    read.read = read.points.len();
    Ok(read)
}

/// Indices of the images by their names in tie points: as configured, and as ISIS composes them.
fn names(images: &[ImageConfig], times: &[&ImageTimes]) -> BTreeMap<String, usize> {
    let configured = images.iter().map(|image| image.name_in_ties().to_owned());
    let mut names: BTreeMap<String, usize> = configured.zip(0..).collect();
    for (index, image) in images.iter().enumerate() {
        let times = times.iter().find(|times| times.id == image.id);
        if let Some(serial_number) = times.and_then(|times| times.isis_serial_number()) {
            names.entry(serial_number).or_insert(index);
        }
    }
    names
}

impl Ties {
    /// Adds a point; `first` holds the index of the first point of each identifier.
    fn take(
        &mut self,
        tie: TiePoint<String>,
        names: &BTreeMap<String, usize>,
        first: &mut BTreeMap<String, usize>,
    ) {
        let tie = tie.in_images(
            |name| names.get(name).copied(),
            |name| *self.elsewhere.entry(name).or_insert(0) += 1,
        );
        if tie.measures.is_empty() {
            return;
        }
        let known = first.get(&tie.id).map(|at| &mut self.points[*at]);
        let joins = |known: &&mut TiePoint| {
            let images = || known.measures.iter().map(|measure| &measure.image);
            tie.measures
                .iter()
                .all(|new| !images().any(|image| *image == new.image))
        };
        if let Some(known) = known.filter(joins) {
            known.known = known.known.or(tie.known);
            known.measures.extend(tie.measures);
        } else {
            first.entry(tie.id.clone()).or_insert(self.points.len());
            self.points.push(tie);
        }
    }

    /// Skipped input, one sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let elsewhere: u64 = self.elsewhere.values().sum();
        let copies = self.copies.iter();
        let mut notes: Vec<String> = copies.map(|copy| format!("tie points: {copy}")).collect();
        if elsewhere > 0 {
            notes.push(format!(
                "tie points: {elsewhere} measurements in {} images that do not belong to the site",
                self.elsewhere.len()
            ));
        }
        let known: Vec<bool> = self
            .points
            .iter()
            .filter_map(|tie| Some(tie.known?.covariance_m2.is_none()))
            .collect();
        if !known.is_empty() {
            notes.push(format!(
                "tie points: {} have known ground coordinates, {} of which are fixed",
                known.len(),
                known.iter().filter(|fixed| **fixed).count()
            ));
        }
        if self.ignored > 0 {
            notes.push(format!(
                "tie points: {} points and measurements that the network marks as ignored",
                self.ignored
            ));
        }
        notes
    }

    /// Number of points, the last ones, that areograph measured itself.
    #[must_use]
    pub const fn matched_points(&self) -> usize {
        self.points.len() - self.read
    }

    /// Tie points measured in at least two images.
    #[must_use]
    pub fn multi_image(&self) -> usize {
        let images = |tie: &&TiePoint| {
            let images: BTreeSet<usize> = tie.measures.iter().map(|m| m.image).collect();
            images.len() > 1
        };
        self.points.iter().filter(images).count()
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    reason = "files in a temporary folder need no atomic writer"
)]
mod tests {
    use std::path::Path;

    use super::*;
    use areograph_base::error::Kind;

    fn image(id: &str, serial_number: Option<&str>) -> ImageConfig {
        ImageConfig {
            id: id.to_owned(),
            serial_number: serial_number.map(str::to_owned),
            ..ImageConfig::default()
        }
    }

    fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn read_files(files: Vec<PathBuf>, images: &[ImageConfig]) -> Result<Ties> {
        read_ties(
            &TiesConfig {
                files,
                matched: false,
            },
            images,
            &[],
        )
    }

    fn read(text: &str, images: &[ImageConfig]) -> Result<Ties> {
        let folder = tempfile::tempdir().unwrap();
        read_files(vec![file(folder.path(), "ties.csv", text)], images)
    }

    const TABLE: &str = "point_id,serial_number,sample,line\n\
        1,A,1,1\n1,B,2,2\n1,C,3,3\n2,C,1,1\n3,B,4,4\n4,A,x,1\n";

    #[test]
    fn measurements_get_the_indices_of_the_sites_images() {
        let ties = read(TABLE, &[image("one", Some("A")), image("B", None)]).unwrap();
        let ids: Vec<&str> = ties.points.iter().map(|tie| &*tie.id).collect();
        assert_eq!(ids, ["1", "3"]);
        let images: Vec<usize> = ties.points[0].measures.iter().map(|m| m.image).collect();
        assert_eq!(images, [0, 1]);
        assert_eq!(ties.multi_image(), 1);
        assert_eq!(ties.elsewhere, BTreeMap::from([("C".to_owned(), 2)]));
        assert_eq!(ties.complaint_count, 1);
        assert!(ties.complaints[0].starts_with("ties.csv: record 7: "));
    }

    #[test]
    fn a_point_in_two_files_is_one_when_its_images_differ() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["1,A,1,1\n2,A,3,1\n", "1,B,2,2\n2,A,5,5\n"].map(|rows| {
            let text = format!("point_id,serial_number,sample,line\n{rows}");
            file(folder.path(), &format!("{}.csv", &rows[2..3]), &text)
        });
        let images = [image("A", None), image("B", None)];
        let ties = read_files(files.to_vec(), &images).unwrap();
        let measures: Vec<usize> = ties.points.iter().map(|tie| tie.measures.len()).collect();
        assert_eq!(measures, [2, 1, 1]);
    }

    #[test]
    fn a_copy_of_a_file_is_read_once_and_points_under_several_names_count_once() {
        const HEADER: &str = "point_id,serial_number,sample,line\n";
        let rows = "1,A,1,1\n1,B,2,2\n2,A,3,3\n2,B,4,4\n3,A,5,5\n3,B,6,6\n";
        let folder = tempfile::tempdir().unwrap();
        let (text, images) = (
            format!("{HEADER}{rows}"),
            [image("A", None), image("B", None)],
        );
        let original = file(folder.path(), "ties.csv", &text);
        let copy = file(folder.path(), "ties (1).csv", &text);
        let ties = read_files(vec![original.clone(), copy], &images).unwrap();
        assert_eq!(ties.points.len(), 3);
        assert_eq!(
            ties.notes(),
            ["tie points: ties (1).csv: a copy of ties.csv, read once"]
        );
        assert_eq!(ties.remarks, [""; 0]);
        // Saved anew: the same points in other bytes and under other names.
        let anew = file(
            folder.path(),
            "anew.csv",
            &text.replace("1,B,2,2", "1,B,2.0,2").replace("\n3", "\nx"),
        );
        let again = read_files(vec![original.clone(), anew], &images).unwrap();
        assert_eq!(again.points, ties.points);
        assert_eq!(
            again.remarks,
            [
                "3 duplicate the measurements of another point and are omitted, for example 1, a duplicate of 1"
            ]
        );
        // One place of A, two of B.
        let text = format!("{HEADER}{}", rows.replace("3,A,5,5", "3,A,1,1"));
        let shared = "2 are measured at the position of another point, for example 1 and 3 at line 1.00, sample 1.00 of image A";
        let failure = read(&text, &images).unwrap_err();
        assert!(
            failure.cause.to_string().contains(shared),
            "{}",
            failure.cause
        );
        let more = file(
            folder.path(),
            "more.csv",
            &format!("{HEADER}7,A,7,7\n7,B,8,8\n"),
        );
        let ties = read_files(
            vec![file(folder.path(), "shared.csv", &text), more],
            &images,
        )
        .unwrap();
        assert_eq!(ties.remarks, [shared]);
    }

    #[test]
    fn names_that_do_not_match_are_reported() {
        let failure = read(TABLE, &[image("x", None), image("y", None)]).unwrap_err();
        assert_eq!(failure.kind(), Kind::Input);
        assert_eq!(
            failure.cause.to_string(),
            "tie points are measured in A, B, C; expected images of the site: x, y"
        );
        let single = read(
            "point_id,serial_number,sample,line\n1,x,1,1\n2,y,1,1\n",
            &[image("x", None), image("y", None)],
        );
        assert_eq!(
            single.unwrap_err().cause.to_string(),
            "none of the 2 tie points is measured in two images of the site"
        );
        let empty = read("point_id,serial_number,sample,line\n", &[image("x", None)]);
        assert_eq!(
            empty.unwrap_err().cause.to_string(),
            "the tie point files contain no measurement"
        );
    }
}
