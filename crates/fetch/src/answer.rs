//! Answers of the service that makes tables of shots: the address of a table, or the reason why there is none.
//!
//! # Source
//! Programs that read these answers: `ode_get_laser_alt.py` of USGS Astrogeology's `APPL-Tools` (`GDSResults` with `Status`,
//! `Error`, `JobId`, `Count`, `StateSummary` and `ResultFiles`), `asp_plot` (names of the files; `JobId` in three spellings).

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{
    error::FetchError,
    page::{excerpt, is_page},
};
use areograph_base::error::Result;
use areograph_store::atomic;

/// A table that a service made for a query.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Made {
    /// The query.
    pub(crate) query: String,
    /// Address of the table, valid for a few weeks.
    pub(crate) url: String,
    /// Number of its rows, where the answer states it.
    pub(crate) rows: Option<u64>,
}

impl Made {
    /// The table that an answer names.
    ///
    /// # Errors
    /// [`FetchError::Service`], [`FetchError::Deferred`], [`FetchError::NoShots`].
    pub(crate) fn of(query: &str, answer: &str) -> std::result::Result<Self, FetchError> {
        let refused = |reason: String| FetchError::Service {
            url: query.to_owned(),
            reason,
        };
        if is_page(answer.as_bytes()) {
            return Err(refused(format!("a web page came: {}", excerpt(answer))));
        }
        let answer: Value = serde_json::from_str(answer)
            .map_err(|_| refused(format!("its answer is not JSON: {}", excerpt(answer))))?;
        let results = field(&answer, "GDSResults").unwrap_or(&answer);
        let summary = field(results, "StateSummary");
        let note = summary.and_then(|summary| text_of(summary, "StatusNote"));
        let status = text_of(results, "Status").unwrap_or_else(|| "without a status".to_owned());
        let state = summary.and_then(|summary| text_of(summary, "State"));
        let failed = |state: &String| state.eq_ignore_ascii_case("error");
        if !status.to_ascii_lowercase().contains("success") || state.as_ref().is_some_and(failed) {
            let reason = [text_of(results, "Error"), note].into_iter().flatten();
            let reason: Vec<String> = reason.map(|text| excerpt(&text)).collect();
            return Err(refused(match &reason[..] {
                [] => format!("its answer is {}", excerpt(&answer.to_string())),
                reason => format!("{}: {}", excerpt(&status), reason.join("; ")),
            }));
        }
        let rows = text_of(results, "Count").and_then(|count| count.replace(',', "").parse().ok());
        let files = files_of(results);
        let Some(url) = table_of(&files) else {
            let url = query.to_owned();
            return Err(match (text_of(results, "JobId"), rows, &files[..]) {
                (Some(job), _, []) => FetchError::Deferred { url, job },
                (None, Some(0), []) => FetchError::NoShots { url },
                (_, _, []) => refused(format!(
                    "its answer names no file: {}",
                    excerpt(&note.unwrap_or(status))
                )),
                (_, _, files) => refused(format!(
                    "its answer names {}; expected a table with radii (*_pts_csv.csv)",
                    excerpt(&files.join(", "))
                )),
            });
        };
        Ok(Self {
            query: query.to_owned(),
            url: encrypted(url, query),
            rows,
        })
    }

    /// The answer that an earlier attempt kept for the same query.
    pub(crate) fn kept(path: &Path, query: &str) -> Option<Self> {
        let kept: Self = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
        (kept.query == query).then_some(kept)
    }

    /// Keeps it, so that an interrupted transfer continues with the same file.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn keep(&self, path: &Path) -> Result<()> {
        // A description of texts and numbers always becomes JSON.
        atomic::write(path, &serde_json::to_vec(self).unwrap_or_default())
    }
}

/// A field of an object, its name in any case.
fn field<'a>(of: &'a Value, name: &str) -> Option<&'a Value> {
    let mut fields = of.as_object()?.iter();
    fields
        .find(|(found, _)| found.eq_ignore_ascii_case(name))
        .map(|(_, value)| value)
}

/// A text or number; `None` where it is empty.
fn text_of(of: &Value, name: &str) -> Option<String> {
    let text = match field(of, name)? {
        Value::String(text) => text.trim().to_owned(),
        Value::Number(number) => number.to_string(),
        _ => return None,
    };
    (!text.is_empty()).then_some(text)
}

/// Addresses of the files of an answer; one file comes without a list.
fn files_of(results: &Value) -> Vec<String> {
    let files = field(results, "ResultFiles").and_then(|files| field(files, "ResultFile"));
    let files = match files {
        Some(Value::Array(files)) => &files[..],
        Some(one) => std::slice::from_ref(one),
        None => &[],
    };
    let addresses = files.iter().filter_map(|file| text_of(file, "URL"));
    addresses.collect()
}

/// The table with radii: `…_pts_csv.csv`, or another one than `…_topo_csv.csv`, which has topography alone.
fn table_of(files: &[String]) -> Option<&str> {
    let named = |part: &str| {
        let is_table = |file: &&String| {
            let lower = file.to_ascii_lowercase();
            let is_csv = Path::new(&lower)
                .extension()
                .is_some_and(|end| end == "csv");
            is_csv && lower.contains(part) && !lower.contains("_topo_")
        };
        files.iter().find(is_table).map(String::as_str)
    };
    named("_pts_").or_else(|| named(""))
}

/// The address of a result; on the host of an encrypted query it is encrypted as well.
fn encrypted(url: &str, query: &str) -> String {
    let host = |address: &str| address.split('/').next().unwrap_or_default().to_owned();
    match (url.strip_prefix("http://"), query.strip_prefix("https://")) {
        (Some(result), Some(query)) if host(result) == host(query) => format!("https://{result}"),
        _ => url.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: &str = "https://oderest.rsl.wustl.edu/livegds?query=molapedr";

    fn refusal(answer: &str) -> String {
        Made::of(QUERY, answer).unwrap_err().to_string()
    }

    #[test]
    fn the_table_with_radii_is_chosen() {
        let files = |files: &str| {
            format!(
                r#"{{"GDSResults": {{"Status": "Success", "Count": "1,247", "StateSummary": {{"State": "Finished",
                "StatusNote": "Finished"}}, "ResultFiles": {{"ResultFile": {files}}}}}}}"#
            )
        };
        let output = "oderest.rsl.wustl.edu/output/20260819t120258916/MolaPEDR_15S14S_174E175E";
        let several = files(&format!(
            r#"[{{"URL": "https://{output}_topo_csv.csv"}}, {{"URL": "https://{output}_pts_csv.lbl"}},
            {{"URL": "http://{output}_pts_csv.csv", "Type": "csv"}}]"#
        ));
        let made = Made::of(QUERY, &several).unwrap();
        assert_eq!(made.url, format!("https://{output}_pts_csv.csv"));
        assert_eq!(made.rows, Some(1_247));
        // One file comes without a list, and under a former name.
        let one = files(r#"{"url": "https://other.edu/PEDR_20190311_csv_table.csv"}"#);
        let made = Made::of(QUERY, &one).unwrap();
        assert_eq!(made.url, "https://other.edu/PEDR_20190311_csv_table.csv");
        // Only the host of the query is known to be encrypted.
        let other = files(r#"{"URL": "http://other.edu/a_pts_csv.csv"}"#);
        assert_eq!(
            Made::of(QUERY, &other).unwrap().url,
            "http://other.edu/a_pts_csv.csv"
        );
        let no_radii = files(&format!(r#"{{"URL": "https://{output}_topo_csv.csv"}}"#));
        assert!(refusal(&no_radii).contains("; expected a table with radii (*_pts_csv.csv)"));
    }

    #[test]
    fn the_reason_of_the_service_is_quoted() {
        for (answer, expected) in [
            (
                r#"{"GDSResults": {"Status": "ERROR", "Error": "Invalid minlat:\n value"}}"#,
                "ERROR: Invalid minlat: value",
            ),
            (
                r#"{"GDSResults": {"Status": "Success", "StateSummary": {"State": "ERROR", "StatusNote": "disk full"}}}"#,
                "Success: disk full",
            ),
            (
                "<html><head><title>\r\n Down for maintenance </title></head><body>x</body></html>",
                "a web page came: Down for maintenance",
            ),
            (
                "<GDSResults><Status>ERROR</Status><Error>too large</Error></GDSResults>",
                "not JSON: <GDSResults><Status>ERROR</Status><Error>too large",
            ),
            (
                r#"{"Message": "An error has occurred."}"#,
                "An error has occurred.",
            ),
            (
                r#"{"GDSResults": {"Status": "Success"}}"#,
                "names no file: Success",
            ),
        ] {
            let found = refusal(answer);
            assert!(
                found.contains("the service returned no table") && found.contains(expected),
                "{expected} in {found}"
            );
        }
        let job = |name: &str| {
            refusal(&format!(
                r#"{{"GDSResults": {{"Status": "Success", "{name}": 55117}}}}"#
            ))
        };
        for name in ["JobId", "Jobid", "jobid"] {
            assert!(job(name).contains("55117"), "{}", job(name));
        }
        let none =
            refusal(r#"{"GDSResults": {"Status": "Success", "Count": "0", "ResultFiles": ""}}"#);
        assert!(none.contains("no shot"), "{none}");
    }
}
