//! Files of runs, complete or in part, each under the hash of its content.

use std::{io::SeekFrom, sync::Arc};

use axum::{
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use tokio::io::{AsyncReadExt as _, AsyncSeekExt as _};
use tokio_stream::StreamExt as _;
use tokio_util::io::ReaderStream;

use super::runs::find;
use crate::http::{
    app::{App, blocking},
    caller::Reader,
    extract::At,
    files::{Product, difference as difference_page, is_unwritten, product},
    problem::{Problem, ProblemDocument},
};
use areograph_store::files::Identity;

/// Pages of products run no scripts and send nothing; their links to other products work.
const POLICY: &str = "sandbox allow-same-origin allow-downloads; default-src 'none'; style-src 'unsafe-inline'; img-src data:";
/// Browsers display these; everything else is a download.
const SHOWN: [&str; 4] = [
    "text/html; charset=utf-8",
    "image/png",
    "image/jpeg",
    "image/svg+xml",
];

/// A product of a run: `path` as in its manifest, or `manifest.json`. The tag is the BLAKE3 of the content; ranges are
/// supported. A product whose content does not match the hash in the manifest is withheld (409).
#[utoipa::path(get, path = "/api/v1/runs/{run}/files/{*path}", tag = "runs", params(
    ("run" = String, Path, description = "Identifier of the run", pattern = "^[A-Za-z0-9_-]{1,64}$"),
    ("path" = String, Path, description = "Path of a product as listed in the manifest; may contain /"),
    ("Range" = Option<String>, Header, description = "One byte range, such as bytes=0-1023"),
), responses(
    (status = 200, content_type = "application/octet-stream", body = Vec<u8>),
    (status = 206, content_type = "application/octet-stream", body = Vec<u8>),
    (status = 304, description = "The client already has this content"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn of_run(
    _: Reader,
    State(app): State<Arc<App>>,
    At((run, path)): At<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let run = find(&app, &run).await?;
    give(product(&app, run, path).await?, &headers).await
}

/// The page that compares a run with its predecessor.
#[utoipa::path(get, path = "/api/v1/runs/{run}/difference", tag = "runs", params(
    ("run" = String, Path, description = "Identifier of the run", pattern = "^[A-Za-z0-9_-]{1,64}$"),
), responses(
    (status = 200, content_type = "text/html", body = String),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn difference(
    _: Reader,
    State(app): State<Arc<App>>,
    At(run): At<String>,
) -> Result<Response, Problem> {
    let run = find(&app, &run).await?;
    let config = app.config();
    let page = blocking(move || difference_page(&config.outputs.products, &run)).await??;
    let mut answer = page.into_response();
    insert(&mut answer, header::CONTENT_TYPE, SHOWN[0])?;
    insert(&mut answer, header::CONTENT_SECURITY_POLICY, POLICY)?;
    Ok(answer)
}

async fn give(product: Product, headers: &HeaderMap) -> Result<Response, Problem> {
    let Product {
        file,
        entry,
        identity,
    } = product;
    let etag = format!("\"{}\"", entry.blake3);
    if fits(headers, &header::IF_MATCH, &etag) == Some(false) {
        return Err(Problem::new(
            StatusCode::PRECONDITION_FAILED,
            "The product has a different hash.",
        ));
    }
    let mut answer = if fits(headers, &header::IF_NONE_MATCH, &etag) == Some(true) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        match range(headers, &etag, entry.bytes) {
            Wanted::Whole => part(file, &identity, 0, entry.bytes).await?,
            Wanted::Part(first, last) => {
                let mut answer = part(file, &identity, first, last - first + 1).await?;
                *answer.status_mut() = StatusCode::PARTIAL_CONTENT;
                let range = format!("bytes {first}-{last}/{}", entry.bytes);
                insert(&mut answer, header::CONTENT_RANGE, &range)?;
                answer
            }
            Wanted::Nothing => {
                let text = format!(
                    "The product has {} bytes; the range is outside the product.",
                    entry.bytes
                );
                let mut refused =
                    Problem::new(StatusCode::RANGE_NOT_SATISFIABLE, text).into_response();
                insert(
                    &mut refused,
                    header::CONTENT_RANGE,
                    &format!("bytes */{}", entry.bytes),
                )?;
                return Ok(refused);
            }
        }
    };
    let media = media(&entry.path);
    insert(&mut answer, header::CONTENT_TYPE, media)?;
    insert(&mut answer, header::ETAG, &etag)?;
    insert(&mut answer, header::ACCEPT_RANGES, "bytes")?;
    insert(
        &mut answer,
        header::CACHE_CONTROL,
        "private, max-age=31536000, immutable",
    )?;
    insert(&mut answer, header::CONTENT_SECURITY_POLICY, POLICY)?;
    insert(&mut answer, header::REFERRER_POLICY, "no-referrer")?;
    if !SHOWN.contains(&media) {
        let name = entry
            .path
            .rsplit('/')
            .next()
            .unwrap_or_default()
            .replace(['"', '\\'], "_");
        let disposition = format!("attachment; filename=\"{name}\"");
        insert(&mut answer, header::CONTENT_DISPOSITION, &disposition)?;
    }
    Ok(answer)
}

/// A part of a file, which ends early, as an error, if the file is written meanwhile.
async fn part(
    file: std::fs::File,
    identity: &Identity,
    first: u64,
    bytes: u64,
) -> Result<Response, Problem> {
    let (watched, before) = (file.try_clone().map_err(Problem::internal)?, *identity);
    let mut file = tokio::fs::File::from_std(file);
    file.seek(SeekFrom::Start(first))
        .await
        .map_err(Problem::internal)?;
    let stream = ReaderStream::with_capacity(file.take(bytes), 64 << 10);
    let stream = stream.map(move |chunk| {
        if is_unwritten(&watched, &before) {
            return chunk;
        }
        Err(std::io::Error::other(
            "the product was overwritten during the transfer",
        ))
    });
    let mut answer = Body::from_stream(stream).into_response();
    answer
        .headers_mut()
        .insert(header::CONTENT_LENGTH, bytes.into());
    Ok(answer)
}

fn insert(answer: &mut Response, name: HeaderName, value: &str) -> Result<(), Problem> {
    let value = HeaderValue::from_str(value).map_err(Problem::internal)?;
    answer.headers_mut().insert(name, value);
    Ok(())
}

/// Whether one of the tags of a precondition matches; `None` without the header.
fn fits(headers: &HeaderMap, name: &HeaderName, etag: &str) -> Option<bool> {
    let lines = headers.get_all(name).iter();
    let mut given = lines.filter_map(|line| line.to_str().ok()).peekable();
    given.peek()?;
    let weak = |tag: &str| tag.strip_prefix("W/").unwrap_or(tag).to_owned();
    Some(given.any(|line| {
        line.split(',')
            .map(str::trim)
            .any(|tag| tag == "*" || weak(tag) == etag)
    }))
}

#[derive(Debug, PartialEq, Eq)]
enum Wanted {
    Whole,
    /// First and last byte.
    Part(u64, u64),
    Nothing,
}

/// The requested range; several ranges, and other units, mean the whole file.
fn range(headers: &HeaderMap, etag: &str, bytes: u64) -> Wanted {
    let current = headers
        .get(header::IF_RANGE)
        .is_none_or(|tag| tag.as_bytes() == etag.as_bytes());
    let text = headers.get(header::RANGE).filter(|_| current);
    let text = text.and_then(|text| text.to_str().ok()?.strip_prefix("bytes="));
    let Some((first, last)) = text.and_then(|text| text.split_once('-')) else {
        return Wanted::Whole;
    };
    let (first, last) = match (first.trim(), last.trim()) {
        ("", count) => match count.parse::<u64>() {
            Ok(0) => return Wanted::Nothing,
            Ok(count) => (bytes.saturating_sub(count), bytes.saturating_sub(1)),
            Err(_) => return Wanted::Whole,
        },
        (first, "") => match first.parse() {
            Ok(first) => (first, bytes.saturating_sub(1)),
            Err(_) => return Wanted::Whole,
        },
        (first, last) => match (first.parse(), last.parse::<u64>()) {
            (Ok(first), Ok(last)) if first <= last => (first, last.min(bytes.saturating_sub(1))),
            _ => return Wanted::Whole,
        },
    };
    if first >= bytes {
        return Wanted::Nothing;
    }
    Wanted::Part(first, last)
}

/// Media type by the end of the name.
fn media(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "json" => "application/json",
        "geojson" => "application/geo+json",
        "csv" => "text/csv; charset=utf-8",
        "txt" | "tm" | "lis" => "text/plain; charset=utf-8",
        "xml" => "application/xml",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "parquet" => "application/vnd.apache.parquet",
        "gpkg" => "application/geopackage+sqlite3",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_rfc_9110_says() {
        for (text, expected) in [
            ("bytes=0-9", Wanted::Part(0, 9)),
            ("bytes=90-200", Wanted::Part(90, 99)),
            ("bytes=90-", Wanted::Part(90, 99)),
            ("bytes=-10", Wanted::Part(90, 99)),
            ("bytes=-1000", Wanted::Part(0, 99)),
            ("bytes=100-", Wanted::Nothing),
            ("bytes=-0", Wanted::Nothing),
            ("bytes=9-0", Wanted::Whole),
            ("bytes=0-1,4-5", Wanted::Whole),
            ("lines=0-9", Wanted::Whole),
            ("bytes=a-b", Wanted::Whole),
            ("bytes=99999999999999999999-", Wanted::Whole),
        ] {
            let mut headers = HeaderMap::new();
            headers.insert(header::RANGE, HeaderValue::from_str(text).unwrap());
            assert_eq!(range(&headers, "\"a\"", 100), expected, "{text}");
            headers.insert(header::IF_RANGE, HeaderValue::from_static("\"b\""));
            assert_eq!(range(&headers, "\"a\"", 100), Wanted::Whole, "{text}");
        }
        let empty = HeaderMap::from_iter([(header::RANGE, HeaderValue::from_static("bytes=0-"))]);
        assert_eq!(range(&empty, "", 0), Wanted::Nothing);
    }
}
