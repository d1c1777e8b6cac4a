//! Inputs of requests: parameters, documents and forms of bounded size, with the service's own error messages.

use std::{sync::Arc, time::Duration};

use axum::{
    body::{Body, to_bytes},
    extract::{FromRequest, FromRequestParts, Path, Query, Request},
    http::{StatusCode, header, request::Parts},
};
use serde::de::DeserializeOwned;

use super::{app::App, problem::Problem};

/// Longest document or form, bytes.
const BODY_MAX: usize = 64 << 10;
/// Longest time for its arrival.
const BODY_TIME: Duration = Duration::from_secs(10);

/// Parameters of the path.
pub(super) struct At<T>(pub(super) T);

impl<T: DeserializeOwned + Send> FromRequestParts<Arc<App>> for At<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, Problem> {
        let found = Path::<T>::from_request_parts(parts, app).await;
        // An invalid number names nothing.
        found
            .map(|Path(found)| Self(found))
            .map_err(|_| Problem::not_found("This address does not exist."))
    }
}

/// Parameters of the query.
pub(super) struct Parameters<T>(pub(super) T);

impl<T: DeserializeOwned + Send> FromRequestParts<Arc<App>> for Parameters<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, Problem> {
        let found = Query::<T>::from_request_parts(parts, app).await;
        found
            .map(|Query(found)| Self(found))
            .map_err(|error| Problem::bad_request(error.body_text()))
    }
}

/// A JSON document.
pub(super) struct Document<T>(pub(super) T);

impl<T: DeserializeOwned> FromRequest<Arc<App>> for Document<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &Arc<App>) -> Result<Self, Problem> {
        let bytes = body_of(request, "application/json", BODY_MAX).await?;
        json(&bytes).map(Self)
    }
}

/// A form of a page.
pub(super) struct Filled<T>(pub(super) T);

impl<T: DeserializeOwned> FromRequest<Arc<App>> for Filled<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &Arc<App>) -> Result<Self, Problem> {
        let form = "application/x-www-form-urlencoded";
        let bytes = body_of(request, form, BODY_MAX).await?;
        let request = Request::builder()
            .method("POST")
            .header(header::CONTENT_TYPE, form)
            .body(Body::from(bytes))
            .map_err(Problem::internal)?;
        let filled = axum::Form::<T>::from_request(request, &()).await;
        filled
            .map(|axum::Form(filled)| Self(filled))
            .map_err(|error| Problem::bad_request(error.body_text()))
    }
}

/// The body of a request of this type, at most `max` bytes long.
pub(super) async fn body_of(request: Request, media: &str, max: usize) -> Result<Vec<u8>, Problem> {
    let given = request.headers().get(header::CONTENT_TYPE);
    let given = given
        .and_then(|given| given.to_str().ok())
        .unwrap_or_default();
    let essence = given.split(';').next().unwrap_or_default().trim();
    if !essence.eq_ignore_ascii_case(media) {
        return Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            format!("The body must be {media}."),
        ));
    }
    let arrived = tokio::time::timeout(BODY_TIME, to_bytes(request.into_body(), max)).await;
    match arrived {
        Ok(Ok(bytes)) => Ok(bytes.to_vec()),
        Ok(Err(_)) => Err(Problem::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            format!("The body is incomplete, or longer than {max} bytes."),
        )),
        Err(_) => Err(Problem::new(
            StatusCode::REQUEST_TIMEOUT,
            "The body did not arrive within 10 s.",
        )),
    }
}

/// Parses a JSON document.
pub(super) fn json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(bytes)
        .map_err(|error| Problem::bad_request(format!("The body: {error}.")))
}

/// Rejects names that no site or run can have, without access to the database.
pub(super) fn name(text: &str) -> Result<&str, Problem> {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
    if (1..=64).contains(&text.len()) && text.bytes().all(plain) {
        return Ok(text);
    }
    Err(Problem::not_found(
        "This name is invalid; expected 1 to 64 letters, digits, _ and -.",
    ))
}
