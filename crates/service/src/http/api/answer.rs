//! Answers of the interface, and paginated lists.

use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::http::{app::App, extract::name, problem::Problem};

/// Most items of a list at once.
const MOST: u32 = 200;
const USUAL: u32 = 50;

/// A document, without hidden paths.
pub(super) fn answer<T: Serialize>(app: &App, document: &T) -> Result<Response, Problem> {
    let text = serde_json::to_string(document).map_err(Problem::internal)?;
    let mut response = app.redactor().redact(text).into_response();
    let form = HeaderValue::from_static("application/json");
    response.headers_mut().insert(header::CONTENT_TYPE, form);
    Ok(response)
}

/// Answers with a different status.
pub(super) fn answer_with<T: Serialize>(
    app: &App,
    status: StatusCode,
    document: &T,
) -> Result<Response, Problem> {
    let mut response = answer(app, document)?;
    *response.status_mut() = status;
    Ok(response)
}

/// Pagination of a list by number.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct ByNumber {
    /// `next` of the preceding page.
    #[param(minimum = 0)]
    after: Option<i64>,
    /// Maximum number of items, by default 50.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
}

impl ByNumber {
    pub(super) fn limit(&self) -> Result<u32, Problem> {
        limit(self.limit)
    }

    pub(super) fn after(&self) -> Result<Option<i64>, Problem> {
        number(self.after)
    }
}

/// Pagination of a list by name.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct ByName {
    /// `next` of the preceding page.
    #[param(pattern = "^[A-Za-z0-9_-]{1,64}$")]
    after: Option<String>,
    /// Maximum number of items, by default 50.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
}

impl ByName {
    pub(super) fn limit(&self) -> Result<u32, Problem> {
        limit(self.limit)
    }

    pub(super) fn after(&self) -> Result<Option<String>, Problem> {
        let Some(after) = self.after.as_deref() else {
            return Ok(None);
        };
        let known = name(after).map_err(|_| not_next(after))?;
        Ok(Some(known.to_owned()))
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

pub(super) fn number(after: Option<i64>) -> Result<Option<i64>, Problem> {
    match after {
        Some(after @ ..0) => Err(not_next(after)),
        after => Ok(after),
    }
}

fn not_next(after: impl std::fmt::Display) -> Problem {
    Problem::bad_request(format!(
        "after is {after}; expected the value of next from the previous page."
    ))
}

/// A page of a list.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct List<T> {
    /// The items.
    pub(super) items: Vec<T>,
    /// `after` of the next page; null at the end.
    pub(super) next: Option<String>,
}

impl<T> List<T> {
    /// At most `limit` of `items`, of which one more was requested to detect further ones.
    pub(super) fn of(mut items: Vec<T>, limit: u32, cursor: impl Fn(&T) -> String) -> Self {
        let limit = limit as usize;
        let more = items.len() > limit;
        items.truncate(limit);
        let next = items.last().filter(|_| more).map(cursor);
        Self { items, next }
    }
}
