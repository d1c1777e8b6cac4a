//! Answers of the interface, and lists in pieces.

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::service::http::{app::App, problem::Problem};

/// Most items of a list at once.
const MOST: u32 = 200;
const USUAL: u32 = 50;

/// A document, without what clients must not read.
pub(super) fn answer<T: Serialize>(app: &App, document: &T) -> Result<Response, Problem> {
    let text = serde_json::to_string(document).map_err(Problem::internal)?;
    let mut response = app.hidden().strip(text).into_response();
    let form = HeaderValue::from_static("application/json");
    response.headers_mut().insert(header::CONTENT_TYPE, form);
    Ok(response)
}

/// The same with another status.
pub(super) fn answer_with<T: Serialize>(
    app: &App,
    status: StatusCode,
    document: &T,
) -> Result<Response, Problem> {
    let mut response = answer(app, document)?;
    *response.status_mut() = status;
    Ok(response)
}

/// Which piece of a list is wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct Piece {
    /// `next` of the piece before.
    #[param(max_length = 64)]
    pub(super) after: Option<String>,
    /// Most items, 50 unless told.
    #[param(minimum = 1, maximum = 200)]
    pub(super) limit: Option<u32>,
}

impl Piece {
    pub(super) fn limit(&self) -> Result<u32, Problem> {
        limit(self.limit)
    }

    /// The cursor of a list that is ordered by numbers.
    pub(super) fn number(&self) -> Result<Option<i64>, Problem> {
        number(self.after.as_deref())
    }
}

pub(super) fn limit(given: Option<u32>) -> Result<u32, Problem> {
    match given.unwrap_or(USUAL) {
        limit @ 1..=MOST => Ok(limit),
        limit => Err(Problem::bad_request(format!(
            "limit is {limit}; expected 1 to {MOST}."
        ))),
    }
}

pub(super) fn number(after: Option<&str>) -> Result<Option<i64>, Problem> {
    let parse = |text: &str| text.parse().ok().filter(|number| *number >= 0);
    match after.map(|text| (text, parse(text))) {
        None => Ok(None),
        Some((_, Some(number))) => Ok(Some(number)),
        Some((text, None)) => Err(Problem::bad_request(format!(
            "after is {text:?}; expected next of the piece before."
        ))),
    }
}

/// A piece of a list.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct List<T> {
    /// The items.
    pub(super) items: Vec<T>,
    /// What `after` must be to go on; null at the end.
    pub(super) next: Option<String>,
}

impl<T> List<T> {
    /// At most `limit` of `items`, of which one more was asked for to know whether there are more.
    pub(super) fn of(mut items: Vec<T>, limit: u32, cursor: impl Fn(&T) -> String) -> Self {
        let limit = limit as usize;
        let more = items.len() > limit;
        items.truncate(limit);
        let next = items.last().filter(|_| more).map(cursor);
        Self { items, next }
    }
}
