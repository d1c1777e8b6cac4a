//! Login: a token exchanged for a session; logout.

use std::sync::Arc;

use axum::{
    extract::State,
    http::{HeaderValue, header},
    response::{IntoResponse as _, Redirect, Response},
};
use maud::html;
use serde::Deserialize;

use super::layout::{Page, with_session};
use crate::{
    audit::{Change, note_change},
    http::{
        app::App,
        caller::{Known, by_token, cookie_name},
        extract::{Filled, Parameters},
        guard::limit_login,
        problem::Problem,
    },
    sessions::{LIFE_MS, close_session, open_session},
};
use areograph_config::HttpConfig;

/// Address after the login.
#[derive(Debug, Deserialize)]
pub(super) struct Next {
    next: Option<String>,
}

/// The form.
pub(super) async fn form(
    Known(caller): Known,
    State(app): State<Arc<App>>,
    Parameters(Next { next }): Parameters<Next>,
) -> Result<Response, Problem> {
    let next = own_path(next.as_deref());
    let body = html! {
        form method="post" action="/login" class="login" {
            input type="hidden" name="next" value=(next);
            label for="areograph-token" { "Token" }
            input id="areograph-token" name="token" type="password" required autocomplete="current-password" spellcheck="false" maxlength="128";
            button type="submit" { "Log in" }
        }
        p { "Create tokens on the command line: " code { "areograph service token add" } ". A session ends after one hour without use, and after twelve hours at the latest." }
    };
    Ok(Page {
        title: "Log in",
        place: "",
    }
    .answer(&app, &caller, &body))
}

/// Form data.
#[derive(Debug, Deserialize)]
pub(super) struct Entry {
    token: String,
    #[serde(default)]
    next: String,
}

/// Opens a session, with a new reference each time.
pub(super) async fn enter(
    Known(caller): Known,
    State(app): State<Arc<App>>,
    Filled(entry): Filled<Entry>,
) -> Result<Response, Problem> {
    let bearer = by_token(&app, entry.token.trim(), caller.remote).await?;
    limit_login(&app, &bearer.name())?;
    let (now_ms, earlier) = (app.now_ms(), caller.session);
    let reference = app
        .write(move |transaction| {
            if let Some(session) = &earlier {
                close_session(transaction, session)?;
            }
            let token = bearer.name();
            let change = Change {
                who: &token,
                action: "log in",
                target: "session",
                remote: &bearer.remote.to_string(),
            };
            note_change(transaction, now_ms, change)?;
            open_session(transaction, now_ms, &token)
        })
        .await?;
    let mut answer = Redirect::to(&own_path(Some(&entry.next))).into_response();
    set_cookie(&mut answer, &app.config().http, &reference, LIFE_MS / 1000)?;
    Ok(answer)
}

/// Form data of the button.
#[derive(Debug, Deserialize)]
pub(super) struct Exit {
    form_token: String,
}

/// Ends a session.
pub(super) async fn leave(
    Known(caller): Known,
    State(app): State<Arc<App>>,
    Filled(exit): Filled<Exit>,
) -> Result<Response, Problem> {
    let caller = with_session(caller, &exit.form_token)?;
    if let Some(session) = caller.session {
        app.write(move |transaction| close_session(transaction, &session))
            .await?;
    }
    let mut answer = Redirect::to("/login").into_response();
    set_cookie(&mut answer, &app.config().http, "", 0)?;
    Ok(answer)
}

fn set_cookie(
    answer: &mut Response,
    http: &HttpConfig,
    value: &str,
    life_s: i64,
) -> Result<(), Problem> {
    let secure = if http.behind_tls_proxy {
        "; Secure"
    } else {
        ""
    };
    let cookie = format!(
        "{}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={life_s}{secure}",
        cookie_name(http)
    );
    let cookie = HeaderValue::from_str(&cookie).map_err(Problem::internal)?;
    answer.headers_mut().insert(header::SET_COOKIE, cookie);
    Ok(())
}

/// A path of this service, never an address elsewhere.
fn own_path(next: Option<&str>) -> String {
    let own = |next: &&str| {
        let safe = next
            .bytes()
            .all(|byte| byte.is_ascii_graphic() && byte != b'\\');
        next.starts_with('/') && !next.starts_with("//") && safe
    };
    next.filter(own).unwrap_or("/").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logging_in_leads_nowhere_else() {
        for (next, expected) in [
            ("/jobs/7?a=b", "/jobs/7?a=b"),
            ("//evil.example", "/"),
            ("/\\evil.example", "/"),
            ("https://evil.example", "/"),
            ("/a\r\nSet-Cookie: x", "/"),
            ("", "/"),
        ] {
            assert_eq!(own_path(Some(next)), expected);
        }
    }
}
