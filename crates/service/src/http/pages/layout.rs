//! Common layout of all pages.

use axum::{
    http::{StatusCode, Uri},
    response::{Html, IntoResponse as _, Response},
};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use areograph_base::style::STYLE;

use crate::http::{app::App, caller::Caller, problem::Problem};

/// Address of the style; each version has its own.
pub(super) const STYLE_PATH: &str = concat!("/style-", env!("CARGO_PKG_VERSION"), ".css");
/// Address of the script.
pub(super) const SCRIPT_PATH: &str = concat!("/script-", env!("CARGO_PKG_VERSION"), ".js");
/// Address of the ground of Mars for maps.
pub(super) const RELIEF_PATH: &str = concat!("/mars-", env!("CARGO_PKG_VERSION"), ".png");
/// Keeps pages up to date.
pub(super) const SCRIPT: &str = include_str!("live.js");

/// The style of reports, with additions for pages.
pub(super) fn style() -> String {
    STYLE.to_owned() + include_str!("pages.css")
}

/// Pages linked from every page.
const PLACES: [(&str, &str); 5] = [
    ("/", "Sites"),
    ("/jobs", "Jobs"),
    ("/kernels", "Kernels"),
    ("/nights", "Nights"),
    ("/events", "Events"),
];

/// A page: its title, and its address in the navigation.
pub(super) struct Page<'a> {
    pub(super) title: &'a str,
    pub(super) place: &'a str,
}

impl Page<'_> {
    pub(super) fn answer(&self, app: &App, caller: &Caller, body: &Markup) -> Response {
        let markup = self.markup(app, caller, body);
        Html(app.redactor().redact(markup.into_string())).into_response()
    }

    fn markup(&self, app: &App, caller: &Caller, body: &Markup) -> Markup {
        let (config, Self { title, place }) = (app.config(), self);
        let name = &config.name;
        html! {
        (head(&format!("{title} – {name}"), true))
        body {
            a class="skip" href="#content" { "Skip to the content" }
            header {
                nav aria-label="Places" {
                    ul {
                        @for (address, text) in PLACES {
                            li { a href=(address) aria-current=[(address == *place).then_some("page")] { (text) } }
                        }
                        li class="account" { (account(caller)) }
                    }
                }
                h1 { (title) }
            }
            main id="content" { (body) }
            footer {
                "areograph " (env!("CARGO_PKG_VERSION")) ", " (name) ". Times are UTC"
                @if config.schedule.zone != "UTC" { ", then " (config.schedule.zone) }
                ". " a href="/docs" { "Interface for programs" }
                span id="live" role="status" {}
            }
        }
        }
    }
}

fn account(caller: &Caller) -> Markup {
    html! {
        @match &caller.session {
            Some(session) => {
                form method="post" action="/logout" class="inline" {
                    (form_token(&session.form_token))
                    span { "Token " (session.token) " may " (session.role) " " }
                    button type="submit" { "Log out" }
                }
            }
            None => { a href="/login" { "Log in" } }
        }
    }
}

/// Hidden field of every form.
pub(super) fn form_token(token: &str) -> Markup {
    html! { input type="hidden" name="form_token" value=(token); }
}

/// A caller who may make changes, by a form from a page of the same session.
pub(super) fn operator(caller: Caller, form_token: &str) -> Result<Caller, Problem> {
    let caller = with_session(caller, form_token)?;
    if !caller.operates() {
        return Err(Problem::new(
            StatusCode::FORBIDDEN,
            "Your token may only read. Changes require a token with the role operate.",
        ));
    }
    Ok(caller)
}

/// A caller with a session, by a form from one of its pages.
pub(super) fn with_session(caller: Caller, form_token: &str) -> Result<Caller, Problem> {
    let Some(session) = &caller.session else {
        return Err(Problem::new(StatusCode::UNAUTHORIZED, "Log in first."));
    };
    if !session.made_form(form_token) {
        return Err(Problem::new(
            StatusCode::FORBIDDEN,
            "This form is not from a page of this session. Load the page again.",
        ));
    }
    Ok(caller)
}

/// A page that states an error.
pub(in crate::http) fn problem_page(
    name: &str,
    title: &str,
    detail: &str,
    request: &str,
) -> Html<String> {
    let markup = html! {
        (head(&format!("{title} – {name}"), false))
        body {
            header { h1 { (title) } }
            main {
                p { (detail) }
                p { a href="/" { "All sites" } }
            }
            footer { "Request " (request) }
        }
    };
    Html(markup.into_string())
}

fn head(title: &str, live: bool) -> Markup {
    html! {
        (DOCTYPE)
        (PreEscaped("<html lang=\"en\">"))
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            link rel="icon" href="data:,";
            link rel="stylesheet" href=(STYLE_PATH);
            @if live { script src=(SCRIPT_PATH) defer {} }
            title { (title) }
        }
    }
}

/// Login address that returns to `uri`.
pub(in crate::http) fn login_address(uri: &Uri) -> String {
    let back = uri.path_and_query().map_or("/", |back| back.as_str());
    let encoded: String = back
        .bytes()
        .map(|byte| match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' => {
                char::from(byte).to_string()
            }
            _ => format!("%{byte:02X}"),
        })
        .collect();
    format!("/login?next={encoded}")
}
