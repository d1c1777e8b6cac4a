//! Tables of shots that a service makes: asked for, received and verified by their rows.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use crate::{
    answer::Made,
    client::Client,
    error::FetchError,
    hashed::Hashed,
    part::Part,
    plan::PlannedFile,
    transfer::{Receiver, Wanted},
};
use areograph_base::{
    body::Body,
    error::{Error, IoError, Kind, Locate as _, Result},
};
use areograph_pds::shot_table::{TableColumns, read_shot_table};

/// Largest distance of shots beyond the box of a query, degrees: a hundred times the last digit of the tables.
const BESIDE_DEG: f64 = 1e-3;

/// A table that has arrived; it does not have its name yet.
pub(crate) struct Received {
    pub(crate) hashed: Hashed,
    pub(crate) part: Part,
    /// Bytes that had arrived earlier.
    pub(crate) resumed: u64,
    /// Its address at the service.
    pub(crate) url: String,
}

/// A table to receive.
pub(crate) struct Wish<'a> {
    pub(crate) file: &'a PlannedFile,
    /// West, east, south and north edge, degrees.
    pub(crate) box_deg: [f64; 4],
    /// Path of its partial download.
    pub(crate) part: PathBuf,
    /// Longest time for the answer of the service.
    pub(crate) limit: Duration,
    pub(crate) replace: bool,
}

/// Path of the answer for a part.
pub(crate) fn answer_of(part: &Path) -> PathBuf {
    part.with_extension("answer")
}

/// Forgets an answer.
///
/// # Errors
/// The folder cannot be written.
pub(crate) fn forget(part: &Path) -> Result<()> {
    let path = answer_of(part);
    match fs::remove_file(&path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(IoError::on("remove")(error)).in_file(&path)
        }
        _ => Ok(()),
    }
}

/// Asks the service for a table, unless an earlier answer is kept, and receives and verifies the table.
///
/// # Errors
/// [`FetchError`]; `Stopped`; the folder cannot be written. The part is kept where its bytes may be continued.
pub(crate) fn receive(receiver: &Receiver<'_>, wish: &Wish<'_>) -> Result<Received> {
    let kept = answer_of(&wish.part);
    if let Some(made) = Made::kept(&kept, &wish.file.url) {
        match receive_made(receiver, wish, made) {
            // The service removes its files after some weeks.
            Err(failure) if is_lasting(&failure) => {
                let path = wish.file.path.display();
                tracing::info!("{path}: {}; the service is queried again", failure.cause);
            }
            other => return other,
        }
    }
    let answer = receiver.text(&wish.file.url, wish.limit)?;
    let made = Made::of(&wish.file.url, &answer)?;
    made.keep(&kept)?;
    receive_made(receiver, wish, made)
}

fn receive_made(receiver: &Receiver<'_>, wish: &Wish<'_>, made: Made) -> Result<Received> {
    let mut part = Part::at(wish.part.clone(), &made.url);
    let resumed = part.bytes();
    match verified(receiver, wish, &made, &mut part) {
        Ok(hashed) => Ok(Received {
            hashed,
            part,
            resumed,
            url: made.url,
        }),
        Err(failure) => {
            // The next attempt asks for a new table.
            if is_lasting(&failure) {
                part.discard()?;
                forget(&wish.part)?;
            }
            Err(failure)
        }
    }
}

fn verified(
    receiver: &Receiver<'_>,
    wish: &Wish<'_>,
    made: &Made,
    part: &mut Part,
) -> Result<Hashed> {
    Client::check_result(&wish.file.url, &made.url)?;
    let wanted = Wanted {
        url: &made.url,
        path: &wish.file.path,
        md5: None,
        bytes: None,
        is_page: false,
        replace: wish.replace,
    };
    let hashed = receiver.receive(&wanted, part)?;
    match problem_of(part.path(), wish.box_deg, made.rows)? {
        None => Ok(hashed),
        Some(problem) => {
            let url = made.url.clone();
            Err(FetchError::Table { url, problem }.into())
        }
    }
}

/// Whether the same address would fail again.
fn is_lasting(failure: &Error) -> bool {
    let cause: &dyn std::error::Error = &*failure.cause;
    cause.downcast_ref().is_some_and(|cause| {
        matches!(
            cause,
            FetchError::Status { .. }
                | FetchError::Content { .. }
                | FetchError::Redirect { .. }
                | FetchError::Address { .. }
                | FetchError::Table { .. }
        )
    })
}

/// Rows of a table, and the rows that count.
#[derive(Debug, Default)]
struct Rows {
    all: u64,
    in_box: u64,
    /// The first malformed row.
    first: Option<String>,
    malformed: u64,
    /// The last row, if it is malformed.
    last: Option<String>,
}

/// Reason why a file is not the requested table.
///
/// * `stated` – number of rows by the service
///
/// # Errors
/// The file cannot be read.
fn problem_of(path: &Path, box_deg: [f64; 4], stated: Option<u64>) -> Result<Option<String>> {
    let mut rows = Rows::default();
    let read = read_shot_table(path, &TableColumns::OdePedr, Body::Mars, None, |row| {
        rows.all += 1;
        match row {
            Ok(row) => {
                rows.last = None;
                let at_deg = [row.longitude_rad, row.latitude_rad].map(f64::to_degrees);
                rows.in_box += u64::from(is_in(box_deg, at_deg));
            }
            Err(complaint) => {
                let text = format!("line {}: {}", complaint.line, complaint.text);
                rows.malformed += 1;
                rows.first.get_or_insert_with(|| text.clone());
                rows.last = Some(text);
            }
        }
        Ok(())
    });
    match read {
        Ok(()) => {}
        Err(failure) if failure.kind() == Kind::Input => {
            return Ok(Some(failure.cause.to_string()));
        }
        Err(failure) => return Err(failure),
    }
    let all = rows.all;
    if all == 0 {
        return Ok(Some("it has no rows".to_owned()));
    }
    if let Some(stated) = stated.filter(|stated| all < *stated) {
        return Ok(Some(format!(
            "{all} rows; expected {stated}, as the service states"
        )));
    }
    if let Some(last) = rows.last {
        return Ok(Some(format!("the last row is malformed ({last})")));
    }
    if rows.in_box == 0 {
        let [west, east, south, north] = box_deg;
        return Ok(Some(format!(
            "none of its {all} shots is in the box of the query, {west} to {east} east, {south} to {north} north"
        )));
    }
    if let Some(stated) = stated.filter(|stated| all > *stated) {
        tracing::warn!(
            "{}: {all} rows; the service states {stated}",
            path.display()
        );
    }
    if let Some(first) = rows.first {
        let malformed = rows.malformed;
        tracing::warn!("{malformed} of {all} rows are malformed; {first}");
    }
    Ok(None)
}

/// Whether a longitude and a latitude are in a box, degrees.
fn is_in([west, east, south, north]: [f64; 4], [longitude, latitude]: [f64; 2]) -> bool {
    let from_west = (longitude - west + BESIDE_DEG).rem_euclid(360.0);
    from_west <= east - west + 2.0 * BESIDE_DEG
        && (south - BESIDE_DEG..=north + BESIDE_DEG).contains(&latitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_contain_shots_at_their_edges() {
        let of = [175.0, 178.2, -15.1, -14.1];
        for inside in [
            [175.0, -15.1],
            [178.2, -14.1],
            [176.0 - 360.0, -14.5],
            [174.9995, -14.5],
        ] {
            assert!(is_in(of, inside), "{inside:?}");
        }
        for outside in [
            [174.99, -14.5],
            [178.21, -14.5],
            [176.0, -14.0],
            [356.0, -14.5],
        ] {
            assert!(!is_in(of, outside), "{outside:?}");
        }
        assert!(is_in([0.0, 360.0, -90.0, -80.0], [359.9, -85.0]));
        assert!(is_in([359.0, 360.0, 0.0, 1.0], [0.0, 0.5]));
    }
}
