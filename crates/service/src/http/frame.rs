//! Frame of every request: its identifier, the headers of its answer, the form of an error, a line in the log.

use std::{
    any::Any,
    sync::Arc,
    time::{Duration, Instant},
};

use axum::{
    Json,
    extract::{MatchedPath, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header},
    middleware::Next,
    response::{IntoResponse as _, Redirect, Response},
};

use super::{
    app::App,
    pages::layout,
    problem::{Problem, ProblemDocument},
};

const LONGEST: Duration = Duration::from_secs(30);
const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Pages load only the style and the script of this service.
const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self' data:; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Headers of every answer that does not set its own.
const HEADERS: [(HeaderName, &str); 7] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::X_FRAME_OPTIONS, "DENY"),
    // With no-referrer, browsers would send forms without their origin.
    (header::REFERRER_POLICY, "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    ),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    ),
];

pub(super) async fn frame(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let began = Instant::now();
    let id = request_id();
    let (method, uri) = (request.method().clone(), request.uri().clone());
    let route = request.extensions().get::<MatchedPath>().cloned();
    let theirs = request
        .headers()
        .get(&REQUEST_ID)
        .map(|id| id.to_str().unwrap_or_default().to_owned());
    let answered = tokio::time::timeout(LONGEST, next.run(request)).await;
    let mut response = answered.unwrap_or_else(|_| {
        Problem::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "The request took longer than 30 s.",
        )
        .into_response()
    });
    let status = response.status();
    let refused = status.is_client_error() || status.is_server_error();
    if refused && !says_itself(&response) {
        response = refusal(&app, &method, &uri, response, &id);
    }
    dress(response.headers_mut(), &id);
    let route = route.as_ref().map_or("none", MatchedPath::as_str);
    let took = began.elapsed();
    app.metrics
        .note(method_name(&method), route, status.as_u16(), took);
    tracing::debug!(
        request = %id, theirs = theirs.as_deref().unwrap_or("-"), method = method_name(&method), route,
        status = status.as_u16(), ms = took.as_secs_f64() * 1e3, "request"
    );
    response
}

/// Whether an answer has its own document, as the readiness answer does.
fn says_itself(response: &Response) -> bool {
    let form = response.headers().get(header::CONTENT_TYPE);
    form.is_some_and(|form| form == "application/json")
}

/// A panic is a bug in areograph; its text goes to the log.
#[allow(
    clippy::needless_pass_by_value,
    reason = "the layer requires this signature"
)]
pub(super) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied());
    Problem::internal(text.unwrap_or("a panic without a message")).into_response()
}

/// Formats an error; errors of libraries carry only a status.
fn refusal(app: &App, method: &Method, uri: &Uri, response: Response, id: &str) -> Response {
    let status = response.status();
    let (parts, _) = response.into_parts();
    let problem = parts.extensions.get::<Problem>().cloned();
    let problem = problem.unwrap_or_else(|| Problem::new(status, usual_detail(status)));
    if let Some(cause) = &problem.cause {
        tracing::error!(request = %id, "{}", one_line(cause));
    }
    let programs = is_for_programs(uri.path());
    let read = matches!(*method, Method::GET | Method::HEAD);
    if status == StatusCode::UNAUTHORIZED && !programs && read {
        return Redirect::to(&layout::login_address(uri)).into_response();
    }
    let title = status.canonical_reason().unwrap_or("Refused");
    let mut refusal = if programs {
        let document = ProblemDocument {
            kind: "about:blank",
            title,
            status: status.as_u16(),
            detail: problem.detail,
            request_id: id.to_owned(),
        };
        let mut response = Json(document).into_response();
        let form = HeaderValue::from_static("application/problem+json");
        response.headers_mut().insert(header::CONTENT_TYPE, form);
        response
    } else {
        layout::problem_page(&app.config().name, title, &problem.detail, id).into_response()
    };
    *refusal.status_mut() = status;
    for name in [
        header::RETRY_AFTER,
        header::ALLOW,
        header::CONTENT_RANGE,
        header::ETAG,
    ] {
        if let Some(value) = parts.headers.get(&name) {
            refusal.headers_mut().insert(name, value.clone());
        }
    }
    if status == StatusCode::UNAUTHORIZED {
        let scheme = HeaderValue::from_static("Bearer");
        refusal
            .headers_mut()
            .insert(header::WWW_AUTHENTICATE, scheme);
    }
    refusal
}

fn is_for_programs(path: &str) -> bool {
    let alone = ["/healthz", "/readyz", "/metrics", "/openapi.json"];
    path.starts_with("/api/") || alone.contains(&path)
}

fn usual_detail(status: StatusCode) -> &'static str {
    match status {
        StatusCode::NOT_FOUND => "This address does not exist.",
        StatusCode::METHOD_NOT_ALLOWED => {
            "This address does not accept this method; the Allow header lists the accepted methods."
        }
        StatusCode::FORBIDDEN => "This request came from a page of another site.",
        _ => "The request was refused.",
    }
}

fn dress(headers: &mut HeaderMap, id: &str) {
    for (name, value) in HEADERS {
        headers
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    }
    if let Ok(id) = HeaderValue::from_str(id) {
        headers.insert(REQUEST_ID, id);
    }
}

/// Other methods share a name, so that clients cannot create new ones in the metrics.
fn method_name(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PATCH => "PATCH",
        _ => "other",
    }
}

fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

fn request_id() -> String {
    let mut bytes = [0_u8; 8];
    // Without random numbers requests cannot be distinguished in the log, but they can be answered.
    let _ = getrandom::fill(&mut bytes);
    format!("{:016x}", u64::from_be_bytes(bytes))
}
