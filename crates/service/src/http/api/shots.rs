//! Shots of the current runs inside a box or polygon.

use std::{path::PathBuf, sync::Arc};

use axum::{
    body::Body,
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde::Deserialize;
use tokio_util::io::ReaderStream;
use utoipa::{IntoParams, ToSchema};

use super::runs::find;
use crate::{
    database::shown::current_runs,
    http::{
        app::App,
        caller::Reader,
        extract::{Parameters, body_of, json},
        files::require_whole,
        problem::{Problem, ProblemDocument},
        work::{ask, place},
    },
    worker::protocol::{Answer, Failure, What},
};
use areograph_base::error::Kind;

/// The product that is searched.
const FOOTPRINTS: &str = "footprints.parquet";
/// Most rows of an answer.
const ROWS: u64 = 1_000_000;
/// Most corners of a polygon.
const CORNERS: usize = 10_000;
/// Longest polygon as text, bytes.
const BODY: usize = 1 << 20;
/// Longest time for a search, seconds: shorter than the time for a request.
const DEADLINE_S: f64 = 25.0;
const COMPLETE: HeaderName = HeaderName::from_static("areograph-complete");
const ROW_COUNT: HeaderName = HeaderName::from_static("areograph-rows");

/// Formats of an answer: media type, and the worker's name of it; the first is the default.
const FORMS: [(&str, &str); 3] = [
    ("application/geo+json", "geojson"),
    ("text/csv", "csv"),
    ("application/vnd.apache.parquet", "parquet"),
];

/// The box to search.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct BoxWanted {
    /// West, south, east, north: degrees of east longitude, from -180 to 360, and areocentric latitude.
    #[param(
        example = "340.0,-10.0,345.0,-5.0",
        pattern = r"^-?[0-9]{1,3}(\.[0-9]{1,9})?(,-?[0-9]{1,3}(\.[0-9]{1,9})?){3}$"
    )]
    bbox: String,
}

/// A GeoJSON polygon of one ring.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Polygon {
    /// Always `Polygon`.
    #[serde(rename = "type")]
    #[schema(pattern = "^Polygon$")]
    kind: String,
    /// One ring of east longitude and areocentric latitude, degrees; at most 10,000 corners.
    #[schema(min_items = 1, max_items = 1, example = json!([[[340.0, -10.0], [345.0, -10.0], [345.0, -5.0], [340.0, -10.0]]]))]
    coordinates: Vec<Vec<[f64; 2]>>,
}

/// Shots of the current runs in a box. The request is refused (409) while footprints of one of these runs are damaged. The
/// header Areograph-Complete states whether the answer contains all shots, or is limited to 1,000,000 rows.
#[utoipa::path(get, path = "/api/v1/shots", tag = "shots", params(BoxWanted), responses(
    (status = 200, content(
        (serde_json::Value = "application/geo+json"), (String = "text/csv"), (Vec<u8> = "application/vnd.apache.parquet"),
    )),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn in_box(
    _: Reader,
    State(app): State<Arc<App>>,
    headers: HeaderMap,
    Parameters(wanted): Parameters<BoxWanted>,
) -> Result<Response, Problem> {
    search(&app, &headers, corners_of_box(&wanted.bbox)?).await
}

/// Shots of the current runs in a polygon.
#[utoipa::path(post, path = "/api/v1/shots", tag = "shots", request_body = Polygon, responses(
    (status = 200, content(
        (serde_json::Value = "application/geo+json"), (String = "text/csv"), (Vec<u8> = "application/vnd.apache.parquet"),
    )),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn in_polygon(
    _: Reader,
    State(app): State<Arc<App>>,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    let polygon: Polygon = json(&body_of(request, "application/json", BODY).await?)?;
    search(&app, &headers, corners_of_polygon(polygon)?).await
}

fn corners_of_box(text: &str) -> Result<Vec<[f64; 2]>, Problem> {
    let wrong = || {
        Problem::bad_request(
            "bbox is invalid; expected west,south,east,north in degrees: west and east from -180 to 360 with west before east \
             by at most 360; south before north, from -90 to 90.",
        )
    };
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    let [west, south, mut east, north] = numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(wrong)?;
    if west > east && west >= 0.0 && east >= 0.0 {
        // Across the prime meridian.
        east += 360.0;
    }
    let longitudes = (-180.0..=360.0).contains(&west) && west < east && east - west <= 360.0;
    let latitudes = -90.0 <= south && south < north && north <= 90.0;
    if !longitudes || !latitudes {
        return Err(wrong());
    }
    let turn = if east > 360.0 { 360.0 } else { 0.0 };
    let (west, east) = (west - turn, east - turn);
    if west < -180.0 {
        return Err(wrong());
    }
    Ok(vec![
        [west, south],
        [east, south],
        [east, north],
        [west, north],
    ])
}

fn corners_of_polygon(polygon: Polygon) -> Result<Vec<[f64; 2]>, Problem> {
    let wrong = |text: String| Err(Problem::bad_request(text));
    if polygon.kind != "Polygon" {
        return wrong("type is invalid; expected Polygon.".to_owned());
    }
    let Ok([mut ring]) = <[_; 1]>::try_from(polygon.coordinates) else {
        return wrong("coordinates is invalid; expected one ring, without holes.".to_owned());
    };
    // GeoJSON repeats the first corner at the end.
    if ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    if !(3..=CORNERS).contains(&ring.len()) {
        return wrong(format!(
            "The ring has {} corners; expected 3 to {CORNERS}.",
            ring.len()
        ));
    }
    let on_globe = |corner: &[f64; 2]| {
        (-180.0..=360.0).contains(&corner[0]) && (-90.0..=90.0).contains(&corner[1])
    };
    if let Some(corner) = ring.iter().find(|corner| !on_globe(corner)) {
        return wrong(format!(
            "{corner:?} is not a valid corner; expected longitude from -180 to 360 and latitude from -90 to 90 degrees."
        ));
    }
    Ok(ring)
}

async fn search(
    app: &Arc<App>,
    headers: &HeaderMap,
    polygon: Vec<[f64; 2]>,
) -> Result<Response, Problem> {
    let (media, form) = form(headers)?;
    let place = place(app)?;
    let runs = app.read(current_runs).await?;
    for (_, id) in &runs {
        match find(app, id).await {
            Ok(run) => require_whole(app, run, FOOTPRINTS).await?,
            // The worker refuses a current run that the database does not know.
            Err(problem) if problem.status == StatusCode::NOT_FOUND => {}
            Err(problem) => return Err(problem),
        }
    }
    let config = app.config();
    let products = &config.outputs.products;
    let runs: Vec<PathBuf> = runs
        .into_iter()
        .map(|(site, run)| products.join(site).join("runs").join(run))
        .collect();
    let folder = config.outputs.state.join("requests");
    std::fs::create_dir_all(&folder).map_err(Problem::internal)?;
    // Removed once opened, or on any failure.
    let folder = tempfile::tempdir_in(&folder).map_err(Problem::internal)?;
    let into = folder.path().join("shots");
    let what = What::Shots {
        runs,
        polygon,
        rows_max: ROWS,
        format: form.to_owned(),
        into: into.clone(),
    };
    let (rows, complete) = match ask(app, what, DEADLINE_S).await? {
        Ok(Answer::Shots { rows, complete }) => (rows, complete),
        Ok(_) => return Err(Problem::internal("the worker sent an unexpected answer")),
        Err(failure) => return Err(problem_of(app, failure)),
    };
    let file = tokio::fs::File::open(&into)
        .await
        .map_err(Problem::internal)?;
    drop((folder, place));
    let bytes = file.metadata().await.map_err(Problem::internal)?.len();
    let mut response =
        Body::from_stream(ReaderStream::with_capacity(file, 64 << 10)).into_response();
    let fields = response.headers_mut();
    fields.insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    fields.insert(header::CONTENT_LENGTH, bytes.into());
    fields.insert(header::VARY, HeaderValue::from_static("accept"));
    fields.insert(
        COMPLETE,
        HeaderValue::from_static(if complete { "true" } else { "false" }),
    );
    fields.insert(ROW_COUNT, rows.into());
    Ok(response)
}

/// The failure of a search: the request or the products are named as its cause, without paths of this machine.
fn problem_of(app: &App, failure: Failure) -> Problem {
    let is = |kind: Kind| failure.code == kind.exit_code();
    if is(Kind::Configuration) {
        return Problem::bad_request(app.redactor().redact(failure.text));
    }
    if is(Kind::Input) {
        return Problem::conflict(app.redactor().redact(failure.text));
    }
    Problem::internal(failure.text)
}

/// The first format in `Accept`; a wildcard means GeoJSON.
fn form(headers: &HeaderMap) -> Result<(&'static str, &'static str), Problem> {
    let Some(accepted) = headers.get(header::ACCEPT) else {
        return Ok(FORMS[0]);
    };
    let accepted = accepted.to_str().unwrap_or_default();
    let wanted = accepted
        .split(',')
        .map(|form| form.split(';').next().unwrap_or_default().trim());
    let known = wanted.filter_map(|wanted| match wanted {
        "*/*" | "application/*" | "application/json" => Some(FORMS[0]),
        "text/*" => Some(FORMS[1]),
        wanted => FORMS
            .into_iter()
            .find(|(media, _)| wanted.eq_ignore_ascii_case(media)),
    });
    known.into_iter().next().ok_or_else(|| {
        Problem::new(
            StatusCode::NOT_ACCEPTABLE,
            "Shots are available as application/geo+json, text/csv or application/vnd.apache.parquet.",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_read_and_nonsense_is_refused() {
        let corners = corners_of_box("10,-5,20,5").unwrap();
        assert_eq!(
            corners,
            [[10.0, -5.0], [20.0, -5.0], [20.0, 5.0], [10.0, 5.0]]
        );
        // Ten degrees west of Greenwich, as typed.
        let [west, south] = corners_of_box("350,-5,10,5").unwrap()[0];
        assert!((west + 10.0).abs() + (south + 5.0).abs() < 1e-12);
        for text in [
            "",
            "1,2,3",
            "1,2,3,4,5",
            "a,b,c,d",
            "10,5,20,-5",
            "NaN,0,1,1",
            "0,0,inf,1",
            "0,-91,1,0",
            "-181,0,0,1",
            "20,0,20,1",
            "1e309,0,2,1",
            "-170,0,200,1",
            "10,0,5,1",
        ] {
            assert!(corners_of_box(text).is_err(), "{text}");
        }
    }
}
