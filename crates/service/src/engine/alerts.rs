//! Alerts: one when a condition begins and one when it ends.

use rusqlite::Transaction;
use serde_json::{Value, json};

use crate::{
    clock::utc_text,
    database::{
        About, Stored,
        alerts::{Edge, put_alert_state, put_notification},
        append,
        waits::{SUBJECT, alerted_waits, waits},
    },
    words::counted,
};
use areograph_config::{AlertKind, ServiceConfig};
use areograph_store::files::file_name;

/// An alert.
#[derive(Debug, Clone, Copy)]
pub struct Alert<'a> {
    /// Its kind.
    pub kind: AlertKind,
    /// The site that it concerns.
    pub site: Option<&'a str>,
    /// The run that it concerns.
    pub run: Option<&'a str>,
    /// As text.
    pub text: &'a str,
}

impl<'a> Alert<'a> {
    /// An alert that concerns no single site.
    pub(super) const fn of_service(kind: AlertKind, text: &'a str) -> Self {
        Self {
            kind,
            site: None,
            run: None,
            text,
        }
    }
}

/// Reports an alert: as an event, and by a notification to each hook that subscribes to this kind.
///
/// # Errors
/// SQLite errors.
pub fn tell(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    alert: &Alert<'_>,
    more: &Value,
) -> Stored<()> {
    match alert.kind {
        AlertKind::Recovered | AlertKind::RootBack | AlertKind::NightComplete => {
            tracing::info!(site = alert.site, "{}", alert.text);
        }
        _ => tracing::warn!(site = alert.site, "{}", alert.text),
    }
    let about = About {
        site: alert.site,
        job: None,
        run: alert.run,
    };
    let data = json!({ "alert": alert.kind, "text": alert.text, "more": more });
    let event = append(transaction, now_ms, "alert", about, &data)?;
    let body = json!({
        "service": config.name,
        "event": event,
        "kind": alert.kind,
        "at": utc_text(now_ms),
        "site": alert.site,
        "run": alert.run,
        "text": alert.text,
        "more": more,
    });
    let kind = json!(alert.kind);
    for (place, hook) in config.hooks.iter().enumerate() {
        if hook.events.is_empty() || hook.events.contains(&alert.kind) {
            let kind = kind.as_str().unwrap_or_default();
            put_notification(transaction, now_ms, place, kind, &body.to_string())?;
        }
    }
    Ok(())
}

/// Reports once each file for which sites wait, and the end of this wait.
///
/// # Errors
/// SQLite errors.
pub fn tell_waits(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
) -> Stored<()> {
    let alert = |kind, text: &str, more: &Value| {
        tell(
            transaction,
            config,
            now_ms,
            &Alert::of_service(kind, text),
            more,
        )
    };
    let mut ended = alerted_waits(transaction)?;
    for wait in waits(transaction)? {
        let subject = format!("{SUBJECT}{}", wait.path);
        ended.retain(|known| *known != subject);
        let verb = if wait.sites.len() == 1 {
            "waits"
        } else {
            "wait"
        };
        let sites = counted(wait.sites.len(), "site");
        let text = format!("{sites} {verb}: {}", wait.text);
        if put_alert_state(transaction, now_ms, &subject, "wrong")? != Edge::None {
            let more = json!({ "sites": wait.sites });
            alert(AlertKind::InputLost, &text, &more)?;
        }
    }
    for subject in ended {
        put_alert_state(transaction, now_ms, &subject, "well")?;
        let name = file_name(subject.trim_start_matches(SUBJECT).as_ref());
        let text = format!("no site waits for `{name}` any longer");
        alert(AlertKind::Recovered, &text, &Value::Null)?;
    }
    Ok(())
}

/// State of a site, for alerts on changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Its last job produced valid products, or was not necessary.
    Well,
    /// Its last job failed, or waits for another input.
    Failed,
    /// Its last job produced invalid products.
    Invalid,
}

/// Reports a change of a site's state; returns whether it changed.
///
/// # Errors
/// SQLite errors.
pub fn tell_standing(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    site: &str,
    standing: Standing,
    text: &str,
) -> Stored<bool> {
    let state = match standing {
        Standing::Well => "well",
        Standing::Failed => "failed",
        Standing::Invalid => "invalid",
    };
    let edge = put_alert_state(transaction, now_ms, &format!("site {site}"), state)?;
    let kind = match (standing, edge) {
        (_, Edge::None) | (Standing::Well, Edge::First) => return Ok(false),
        (Standing::Well, Edge::From(_)) => AlertKind::Recovered,
        (Standing::Failed, _) => AlertKind::Failed,
        (Standing::Invalid, _) => AlertKind::Invalid,
    };
    let alert = Alert {
        kind,
        site: Some(site),
        run: None,
        text,
    };
    tell(transaction, config, now_ms, &alert, &Value::Null)?;
    Ok(true)
}

/// Reports the beginning of a fault, or with another kind its end, if the state changed.
///
/// # Errors
/// SQLite errors.
pub fn tell_edge(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    (subject, wrong): (&str, bool),
    (begins, ends): (&Alert<'_>, Option<&Alert<'_>>),
) -> Stored<()> {
    let state = if wrong { "wrong" } else { "well" };
    match put_alert_state(transaction, now_ms, subject, state)? {
        Edge::None => Ok(()),
        Edge::First if !wrong => Ok(()),
        _ if wrong => tell(transaction, config, now_ms, begins, &Value::Null),
        _ => ends.map_or(Ok(()), |ends| {
            tell(transaction, config, now_ms, ends, &Value::Null)
        }),
    }
}
