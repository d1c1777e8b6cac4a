//! Callers, and their permissions.

use std::{net::IpAddr, sync::Arc};

use axum::{
    extract::FromRequestParts,
    http::{HeaderMap, StatusCode, header, request::Parts},
};

use super::{
    app::App,
    problem::Problem,
    rate::{FAILURES, Key},
};
use crate::{
    sessions::{Session, find_session, note_session},
    tokens::{Role, find_token, note_use, token_name},
};
use areograph_config::HttpConfig;

/// Longest accepted token.
const TOKEN_MAX: usize = 128;
/// Shortest time between two records of a token's use.
const NOTE_MS: i64 = 60_000;

/// The caller.
#[derive(Debug, Clone)]
pub(super) struct Caller {
    /// Source of the request, through trusted proxies.
    pub(super) remote: IpAddr,
    /// Identifier of the token, including that of a session.
    pub(super) token: Option<String>,
    /// Role; without a token, reading from this machine.
    pub(super) role: Option<Role>,
    /// The session of a browser.
    pub(super) session: Option<Session>,
}

impl Caller {
    /// Name in the log of changes.
    pub(super) fn name(&self) -> String {
        self.token.clone().unwrap_or_else(|| "anybody".to_owned())
    }

    /// Whether the caller may make changes through pages.
    pub(super) fn operates(&self) -> bool {
        self.role == Some(Role::Operate)
    }
}

/// The name of the cookie; behind TLS one that only this host can set.
pub(super) const fn cookie_name(http: &HttpConfig) -> &'static str {
    if http.behind_tls_proxy {
        "__Host-areograph"
    } else {
        "areograph"
    }
}

/// Identifies the caller; rejects unknown, expired and revoked tokens.
pub(super) async fn identify(
    app: &App,
    headers: &HeaderMap,
    remote: IpAddr,
    direct: bool,
) -> Result<Caller, Problem> {
    let config = app.config();
    let http = &config.http;
    let open =
        direct && http.open_reading && !http.behind_tls_proxy && app.local.ip().is_loopback();
    let nobody = Caller {
        remote,
        token: None,
        role: open.then_some(Role::Read),
        session: None,
    };
    if let Some(value) = headers.get(header::AUTHORIZATION) {
        let text = value.to_str().unwrap_or_default();
        let token = text
            .get(..7)
            .filter(|scheme| scheme.eq_ignore_ascii_case("Bearer "));
        let token = token
            .map(|_| text[7..].trim().to_owned())
            .unwrap_or_default();
        return by_token(app, &token, remote).await;
    }
    match cookie(headers, cookie_name(http)) {
        Some(reference) => Ok(by_session(app, reference, &nobody).await?.unwrap_or(nobody)),
        None => Ok(nobody),
    }
}

/// The bearer of a token. A right token is accepted whatever else its address sends; wrong ones are limited.
pub(super) async fn by_token(app: &App, text: &str, remote: IpAddr) -> Result<Caller, Problem> {
    let now_ms = app.now_ms();
    let shown: String = text.chars().take(TOKEN_MAX).collect();
    let found = app
        .read(move |connection| find_token(connection, now_ms, &shown))
        .await?;
    let Some(token) = found else {
        return Err(refused(app, text, remote));
    };
    if token
        .used_ms
        .is_none_or(|used_ms| now_ms - used_ms > NOTE_MS)
    {
        let id = token.id.clone();
        app.write(move |transaction| note_use(transaction, now_ms, &id))
            .await?;
    }
    Ok(Caller {
        remote,
        role: Some(token.role),
        token: Some(token.id),
        session: None,
    })
}

/// The answer to a wrong token: limited for each address, and for each token whose identifier it shows.
fn refused(app: &App, text: &str, remote: IpAddr) -> Problem {
    let now = std::time::Instant::now();
    let address = app.rates.take(Key::Failure(remote), FAILURES, now);
    let token = token_name(text).map(|id| Key::Token(id.to_owned()));
    // A limited address adds no buckets of tokens.
    let limited = match (address, token) {
        (Ok(()), Some(key)) => app.rates.take(key, FAILURES, now),
        (address, _) => address,
    };
    if let Err(wait_s) = limited {
        return Problem {
            retry_after_s: Some(wait_s),
            ..Problem::new(
                StatusCode::TOO_MANY_REQUESTS,
                "Too many invalid attempts came from this address, or with this token. Try again later.",
            )
        };
    }
    tracing::warn!(remote = %remote, "token refused");
    Problem::new(
        StatusCode::UNAUTHORIZED,
        "This token is unknown, expired or revoked.",
    )
}

async fn by_session(
    app: &App,
    reference: String,
    nobody: &Caller,
) -> Result<Option<Caller>, Problem> {
    let now_ms = app.now_ms();
    let found = app
        .read(move |connection| find_session(connection, now_ms, &reference))
        .await?;
    let Some(session) = found else {
        return Ok(None);
    };
    if session.note_is_due(now_ms) {
        let used = session.clone();
        app.write(move |transaction| note_session(transaction, now_ms, &used))
            .await?;
    }
    Ok(Some(Caller {
        remote: nobody.remote,
        role: Some(session.role),
        token: Some(session.token.clone()),
        session: Some(session),
    }))
}

fn cookie(headers: &HeaderMap, name: &str) -> Option<String> {
    let lines = headers.get_all(header::COOKIE).iter();
    lines
        .filter_map(|line| line.to_str().ok())
        .flat_map(|line| line.split(';'))
        .filter_map(|pair| pair.trim().split_once('='))
        .find(|(given, _)| *given == name)
        .map(|(_, value)| value.to_owned())
}

/// Any caller.
pub(super) struct Known(pub(super) Caller);

/// A caller who may read.
pub(super) struct Reader(pub(super) Caller);

/// A caller who may make changes through the interface for programs: the bearer of a token, not a browser's session.
pub(super) struct Operator(pub(super) Caller);

fn caller(parts: &Parts) -> Result<Caller, Problem> {
    let caller = parts.extensions.get::<Caller>().cloned();
    caller.ok_or_else(|| Problem::internal("the request has no caller"))
}

fn unknown() -> Problem {
    Problem::new(
        StatusCode::UNAUTHORIZED,
        "This request requires a token: send the header Authorization: Bearer areo_…",
    )
}

impl FromRequestParts<Arc<App>> for Known {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &Arc<App>) -> Result<Self, Problem> {
        caller(parts).map(Self)
    }
}

impl FromRequestParts<Arc<App>> for Reader {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &Arc<App>) -> Result<Self, Problem> {
        let caller = caller(parts)?;
        if caller.role.is_none() {
            return Err(unknown());
        }
        Ok(Self(caller))
    }
}

impl FromRequestParts<Arc<App>> for Operator {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &Arc<App>) -> Result<Self, Problem> {
        let caller = caller(parts)?;
        if caller.token.is_none() || caller.session.is_some() {
            return Err(unknown());
        }
        if !caller.operates() {
            return Err(Problem::new(
                StatusCode::FORBIDDEN,
                "This token may only read. Changes require a token with the role operate.",
            ));
        }
        Ok(Self(caller))
    }
}
