//! Shots inside the box of the model: found, in one frame and in the order of time, each once; then tracks and segments.

use std::sync::atomic::AtomicBool;

use super::{
    error::MatchError,
    result::{HeldBackGround, MatchOptions},
};
use crate::convert_datum::DatumTurn;
use areograph_base::{
    altimetry::{GroundRadius, ShotFilter},
    error::{Error, Locate as _, Result},
    footprints::{AsRead, Footprints},
    units::wrap_two_pi,
};
use areograph_geom::{
    height_grid::{HeightGrid, Probe},
    window::{Region, WindowShape},
};
use areograph_pds::archive::{Found, Judged, Opened, Query, Seen, Sink, search};
use areograph_store::files::file_name;

/// A track ends where latitude jumps by this angle between shots, radians (0.1°, as in the program of Li et al. 2023),
/// or after this time without a shot, seconds: 100 km of flight.
const JUMP_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
const PAUSE_S: f64 = 30.0;
/// A segment ends at a gap of three spacings of shots, which come every 0.1 s.
const GAP_S: f64 = 0.3;
/// Share of a segment's points that must have a height in the model: so many of so many.
const COVERED: [usize; 2] = [13, 15];
/// Points of the shortest segment by drift, those of the paper's program: [`COVERED`] requires 13 of them.
const DRIFT_POINTS_MIN: usize = 15;
/// Edges to the east and the north of a rectangle of ground that is withheld or not, metres: a few units of shots, and
/// two segments of a profile, which runs north or south; and the radius at which they have this length, metres.
const HELD_BACK_M: [f64; 2] = [5_000.0, 10_000.0];
const RADIUS_M: f64 = 3_396_190.0;
/// Maximum number of complaints that are kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;

/// A shot over the model.
#[derive(Debug, Clone)]
pub(super) struct Shot {
    /// File, record and shot: its name.
    pub(super) name: String,
    pub(super) tag_s: f64,
    pub(super) longitude_rad: f64,
    pub(super) latitude_rad: f64,
    pub(super) radius_m: f64,
    /// Above the sphere of the model.
    pub(super) height_m: f64,
    /// Row and column of the model.
    pub(super) cell: [f64; 2],
    pub(super) probe: Probe,
    /// Towards the east and the north from the middle of the model, metres.
    pub(super) plan_m: [f64; 2],
    /// Number of the pass over the box.
    pub(super) track: usize,
}

impl Shot {
    /// Whether it lies on withheld ground.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a planet has a few thousand rectangles"
    )]
    pub(super) fn is_held_back(&self, held_back: Option<HeldBackGround>) -> bool {
        let Some(HeldBackGround { every, seed }) = held_back else {
            return false;
        };
        let [width_rad, height_rad] = HELD_BACK_M.map(|edge_m| edge_m / RADIUS_M);
        let row = (self.latitude_rad / height_rad).floor();
        // Width at the southern edge of the row, independent of other rows.
        let east_rad = width_rad / (row * height_rad).cos().max(0.01);
        let column = (self.longitude_rad / east_rad).floor();
        // Rows are shifted by half the distance, so that withheld rectangles are evenly spaced.
        let half = i64::from((every / 2).max(1));
        let place = column as i64 + half * row as i64;
        let shift = (seed % u64::from(every)).cast_signed();
        (place + shift).rem_euclid(i64::from(every)) == 0
    }
}

/// Result of a search.
#[derive(Default)]
pub(super) struct Shots {
    pub(super) shots: Vec<Shot>,
    pub(super) tracks: usize,
    pub(super) complaints: Vec<String>,
    pub(super) complaint_count: u64,
}

/// Finds the shots inside the box of a model.
pub(super) fn shots_over(
    grid: &HeightGrid,
    paths: &[std::path::PathBuf],
    ground: GroundRadius,
    filter: &ShotFilter,
    stop: &AtomicBool,
) -> Result<Shots> {
    let Opened {
        mut sources,
        failures,
    } = Opened::all(paths)?;
    if let Some(failure) = failures.into_iter().next() {
        return Err(failure);
    }
    // Order and numbers of files do not depend on how they were named.
    sources.sort_by_cached_key(|source| file_name(source.path()));
    let [west, south, east, north] = grid.edges_rad();
    let is_whole = east - west >= std::f64::consts::TAU;
    let region = Region::new(&WindowShape::Box {
        west_rad: if is_whole { 0.0 } else { wrap_two_pi(west) },
        east_rad: if is_whole {
            std::f64::consts::TAU
        } else {
            wrap_two_pi(east)
        },
        south_rad: south,
        north_rad: north,
    });
    let query = Query::new(vec![region], filter, Judged::Near);
    let mut gathered = Gathered {
        grid,
        ground,
        names: sources
            .iter()
            .map(|source| file_name(source.path()))
            .collect(),
        turns: (sources.iter())
            .map(|source| DatumTurn::at_tags(source.datum()))
            .collect(),
        seen: Seen::default(),
        found: Vec::new(),
        shots: Shots::default(),
    };
    search(&sources, &query, stop, &mut gathered)?;
    let Gathered {
        mut found,
        mut shots,
        ..
    } = gathered;
    found.sort_by(|a, b| a.tag_s.total_cmp(&b.tag_s));
    shots.shots = found;
    shots.number_tracks();
    Ok(shots)
}

/// Takes shots as they are found.
struct Gathered<'a> {
    grid: &'a HeightGrid,
    ground: GroundRadius,
    names: Vec<String>,
    turns: Vec<DatumTurn>,
    seen: Seen,
    found: Vec<Shot>,
    shots: Shots,
}

impl Gathered<'_> {
    /// Checks that no earlier file holds one of these shots.
    fn require_distinct(&mut self, file: usize, footprints: &Footprints<AsRead>) -> Result<()> {
        let Some((_, other)) = self.seen.take_all(file, &footprints.et_tag_s) else {
            return Ok(());
        };
        let other = self.names[other].clone();
        Err(MatchError::SharedShots { other }).in_file(&self.names[file])
    }

    fn take(&mut self, file: usize, footprints: &Footprints<AsRead>) {
        let [longitude_rad, latitude_rad] = self.grid.middle_rad();
        let middle = self.grid.cell_of(longitude_rad, latitude_rad);
        let [east_m, north_m] = self.grid.cell_m();
        for row in 0..footprints.len() {
            let shot = self.turns[file].applied(footprints.row(row));
            let cell = self.grid.cell_of(shot.longitude_rad, shot.latitude_rad);
            let found = Shot {
                name: format!("{}_{}_{}", self.names[file], shot.record, shot.shot),
                tag_s: shot.et_tag_s,
                longitude_rad: shot.longitude_rad,
                latitude_rad: shot.latitude_rad,
                radius_m: footprints.ground_radius_m(row),
                height_m: footprints.ground_radius_m(row) - self.grid.radius_m,
                cell,
                probe: Probe::at(cell),
                plan_m: [
                    (cell[1] - middle[1]) * east_m,
                    (middle[0] - cell[0]) * north_m,
                ],
                track: 0,
            };
            self.found.push(found);
        }
    }
}

impl Sink for Gathered<'_> {
    fn found(&mut self, file: usize, mut found: Found) -> Result<()> {
        found.footprints.ground = self.ground;
        self.shots.complaint_count += found.complaints.len() as u64;
        for complaint in &found.complaints {
            if self.shots.complaints.len() < COMPLAINTS_MAX {
                self.shots.complaints.push(complaint.to_string());
            }
        }
        self.require_distinct(file, &found.footprints)?;
        self.take(file, &found.footprints);
        Ok(())
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

impl Shots {
    fn number_tracks(&mut self) {
        let mut track = 0;
        for index in 1..self.shots.len() {
            let [before, this] = [index - 1, index].map(|of| &self.shots[of]);
            let jump_rad = (this.latitude_rad - before.latitude_rad).abs();
            if jump_rad >= JUMP_RAD || this.tag_s - before.tag_s > PAUSE_S {
                track += 1;
            }
            self.shots[index].track = track;
        }
        self.tracks = self.shots.last().map_or(0, |last| last.track + 1);
    }

    /// The length of segments by the options.
    pub(super) fn segment_length(&self, options: &MatchOptions, cell_m: f64) -> SegmentLength {
        match options.segment_drift {
            None => SegmentLength::Points(options.segment_points),
            Some(drift) => SegmentLength::ByDrift(segment_points(cell_m, drift, self.spacing_m())),
        }
    }

    /// Median distance between successive shots, metres; 0 without any.
    fn spacing_m(&self) -> f64 {
        let near = self
            .shots
            .windows(2)
            .filter(|pair| is_near(&pair[0], &pair[1]));
        let mut spacings_m: Vec<f64> = near
            .map(|pair| {
                let [east_m, north_m] =
                    [0, 1].map(|axis| pair[1].plan_m[axis] - pair[0].plan_m[axis]);
                east_m.hypot(north_m)
            })
            .collect();
        spacings_m.sort_by(f64::total_cmp);
        spacings_m.get(spacings_m.len() / 2).copied().unwrap_or(0.0)
    }

    /// Segments of one track without a gap, either all or none of their shots on withheld ground.
    pub(super) fn segments(
        &self,
        length: SegmentLength,
        held_back: Option<HeldBackGround>,
    ) -> Vec<&[Shot]> {
        let runs = self.shots.chunk_by(|a, b| {
            is_near(a, b) && a.is_held_back(held_back) == b.is_held_back(held_back)
        });
        match length {
            SegmentLength::Points(points) => runs.flat_map(|run| run.chunks(points)).collect(),
            SegmentLength::ByDrift(points) => {
                runs.flat_map(|run| equal_parts(run, points)).collect()
            }
        }
    }
}

/// The length of segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SegmentLength {
    /// Of this number of shots; the last one of a run is shorter.
    Points(usize),
    /// Equal parts of a run, of at most this number of shots.
    ByDrift(usize),
}

impl SegmentLength {
    /// Shots of a segment that must have a height in the model.
    fn needed(self, segment: &[Shot]) -> usize {
        let points = match self {
            Self::Points(points) => points,
            Self::ByDrift(_) => segment.len().max(DRIFT_POINTS_MIN),
        };
        let [of, all] = COVERED;
        (of * points).div_ceil(all)
    }
}

/// Whether two shots follow each other in a track without a gap.
fn is_near(a: &Shot, b: &Shot) -> bool {
    a.track == b.track && b.tag_s - a.tag_s < GAP_S
}

/// Largest number of shots over which images drift by at most one cell of the model, at least 1.
///
/// * `cell_m` – cell of the model, metres
/// * `drift` – of the images against the laser, metres per metre of ground: the drift of one line over its ground size
/// * `spacing_m` – distance between shots, metres
///
/// # Source
/// Li et al. 2023, eq. 16.
fn segment_points(cell_m: f64, drift: f64, spacing_m: f64) -> usize {
    let points = cell_m / (drift * spacing_m);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; large numbers saturate"
    )]
    let points = points.max(1.0) as usize;
    points
}

/// A run in the smallest number of equal parts of at most `points` shots; lengths differ by at most one.
fn equal_parts(run: &[Shot], points: usize) -> impl Iterator<Item = &[Shot]> {
    let parts = run.len().div_ceil(points);
    let bound = move |part: usize| part * run.len() / parts;
    (0..parts).map(move |part| &run[bound(part)..bound(part + 1)])
}

/// Whether a segment has relief, and enough of it lies on the model.
pub(super) fn is_kept(
    grid: &HeightGrid,
    segment: &[Shot],
    length: SegmentLength,
    least_variance_m2: f64,
) -> bool {
    let covered = segment
        .iter()
        .filter(|shot| grid.probed_m(&shot.probe, [0, 0]).is_some());
    let count = segment.len() as f64;
    let mean_m = segment.iter().map(|shot| shot.height_m).sum::<f64>() / count;
    let squares = segment.iter().map(|shot| (shot.height_m - mean_m).powi(2));
    covered.count() >= length.needed(segment) && squares.sum::<f64>() / count > least_variance_m2
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_testing::shot_cases::{CASES, path, source};

    /// Shots 300 m apart to the north, in tracks of these lengths.
    fn tracks(lengths: &[usize]) -> Shots {
        let mut shots = Shots::default();
        for (track, length) in lengths.iter().enumerate() {
            for number in 0..*length {
                shots.shots.push(Shot {
                    name: String::new(),
                    tag_s: 0.1 * number as f64,
                    longitude_rad: 0.0,
                    latitude_rad: 0.0,
                    radius_m: RADIUS_M,
                    height_m: 0.0,
                    cell: [0.0; 2],
                    probe: Probe::at([0.0; 2]),
                    plan_m: [10.0 * track as f64, 300.0 * number as f64],
                    track,
                });
            }
        }
        shots
    }

    #[test]
    fn segments_by_drift_are_equal_parts_of_a_run() {
        // Table 1 of Li et al. 2023: cells of 35.8 m, pixels of 26.9 m, 0.01 m per line, shots 300 m apart.
        assert_eq!(segment_points(35.8, 0.01 / 26.9, 300.0), 321);
        assert_eq!(segment_points(35.8, 1.0, 300.0), 1);
        let shots = tracks(&[33, 16, 15, 4]);
        assert!((shots.spacing_m() - 300.0).abs() < 1e-9); // rounding of kilometres
        assert!(tracks(&[1]).spacing_m() == 0.0);
        let lengths = |length| {
            let segments = shots.segments(length, None);
            segments.iter().map(|of| of.len()).collect::<Vec<_>>()
        };
        assert_eq!(
            lengths(SegmentLength::ByDrift(15)),
            [11, 11, 11, 8, 8, 15, 4]
        );
        assert_eq!(
            lengths(SegmentLength::Points(15)),
            [15, 15, 3, 15, 1, 15, 4]
        );
        assert_eq!(lengths(SegmentLength::ByDrift(321)), [33, 16, 15, 4]);
        let needed = |length: SegmentLength, of: usize| length.needed(&tracks(&[of]).shots);
        assert_eq!(needed(SegmentLength::ByDrift(321), 33), 29);
        assert_eq!(needed(SegmentLength::ByDrift(321), 8), 13);
        assert_eq!(needed(SegmentLength::Points(15), 8), 13);
    }

    #[test]
    fn files_with_the_same_shots_are_refused() {
        let grid = HeightGrid {
            size: [1, 1],
            first_rad: [0.0, 0.0],
            cell_rad: [0.1, 0.1],
            radius_m: RADIUS_M,
            heights_m: vec![0.0],
        };
        for case in CASES {
            let files = 0..case.files.len();
            let names: Vec<String> = files.clone().map(|file| source(file).name).collect();
            let mut gathered = Gathered {
                grid: &grid,
                ground: GroundRadius::Corrected,
                names: names.clone(),
                turns: Vec::new(),
                seen: Seen::default(),
                found: Vec::new(),
                shots: Shots::default(),
            };
            let mut checked =
                files.map(|file| gathered.require_distinct(file, &case.footprints(file)));
            let refused = checked.find_map(Result::err);
            let named = refused.map(|error| (error.file.clone(), error.cause.to_string()));
            match (named, case.shared) {
                (None, None) => {}
                (Some((refused, why)), Some([other, file])) => {
                    assert_eq!(refused, Some(path(file)), "{}", case.name);
                    assert!(why.contains(&names[other]), "{}: {why}", case.name);
                }
                (found, _) => panic!("{}: {found:?}", case.name),
            }
        }
    }
}
