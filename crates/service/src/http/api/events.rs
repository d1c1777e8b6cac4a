//! The stream of events.

use std::{convert::Infallible, sync::Arc, time::Duration};

use axum::{
    extract::State,
    http::HeaderMap,
    response::{
        IntoResponse as _, Response, Sse,
        sse::{Event as Message, KeepAlive},
    },
};
use serde::Serialize;
use serde_json::{Value, json};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use utoipa::ToSchema;

use crate::{
    database::{Event, events_after},
    http::{
        app::App,
        caller::{Caller, Reader},
        problem::{Problem, ProblemDocument},
    },
    instant::Instant,
    sessions::still_open,
};

/// Events read at once.
const BATCH: u32 = 200;
/// Longest duration of a stream; clients reconnect by themselves.
const LONGEST: Duration = Duration::from_hours(1);
/// Interval at which the client's permission is checked.
const LOOK: Duration = Duration::from_secs(15);

/// An event: the data of a message, whose `event` is its kind and whose `id` is its number.
#[derive(Debug, Serialize, ToSchema)]
struct EventData {
    /// Its number; later events have larger numbers.
    seq: i64,
    /// Time of the event.
    at_utc: Instant,
    /// `job`, `stage`, `progress`, `run`, `root`, `night`, `alert`, `checked` or `config`.
    kind: String,
    /// The site that it concerns.
    site: Option<String>,
    /// The job that it concerns.
    job: Option<i64>,
    /// The run that it concerns.
    run: Option<String>,
    /// Further data, depending on the kind.
    data: Value,
}

/// Events from now on, or after the event `Last-Event-ID`, as server-sent events. A message `lost` means that older
/// events are no longer kept.
#[utoipa::path(get, path = "/api/v1/events", tag = "events", params(
    ("Last-Event-ID" = Option<i64>, Header, description = "Number of the last event received", minimum = 0),
), responses(
    (status = 200, body = EventData, content_type = "text/event-stream"),
    (status = 503, body = ProblemDocument, content_type = "application/problem+json"),
    (status = "4XX", body = ProblemDocument, content_type = "application/problem+json"),
))]
pub(super) async fn follow(
    Reader(caller): Reader,
    State(app): State<Arc<App>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut newest = app.shared.follow();
    let seen = *newest.borrow_and_update();
    let last = match headers.get("last-event-id") {
        None => seen,
        Some(given) => {
            let given = given.to_str().ok().and_then(|text| text.parse().ok());
            let given = given.filter(|number| *number >= 0);
            given.ok_or_else(|| {
                Problem::bad_request("Last-Event-ID is not the number of an event.")
            })?
        }
    };
    let permit = Arc::clone(&app.streams)
        .try_acquire_owned()
        .map_err(|_| Problem::busy("Too many event streams are open.", 10))?;
    let (messages, stream) = mpsc::channel(16);
    tokio::spawn(async move {
        let ending = app.shared.ending.clone();
        tokio::select! {
            () = ending.cancelled() => {}
            () = messages.closed() => {}
            () = tokio::time::sleep(LONGEST) => {}
            told = tell(&app, &caller, last, newest, &messages) => {
                if let Err(problem) = told {
                    tracing::warn!("an event stream ended: {:?}", problem.cause);
                }
            }
        }
        drop(permit);
    });
    let keep_alive = KeepAlive::new().interval(LOOK);
    Ok(Sse::new(ReceiverStream::new(stream))
        .keep_alive(keep_alive)
        .into_response())
}

async fn tell(
    app: &App,
    caller: &Caller,
    mut last: i64,
    mut newest: tokio::sync::watch::Receiver<i64>,
    messages: &mpsc::Sender<Result<Message, Infallible>>,
) -> Result<(), Problem> {
    let mut first = true;
    loop {
        let (token, session) = (caller.token.clone(), caller.session.clone());
        let now_ms = app.now_ms();
        let (open, events) = app
            .read(move |connection| {
                let open = match &token {
                    Some(token) => still_open(connection, now_ms, token, session.as_ref())?,
                    None => true,
                };
                Ok((open, events_after(connection, last, BATCH)?))
            })
            .await?;
        if !open {
            return Ok(());
        }
        if first
            && let Some(oldest) = events.first()
            && last > 0
            && oldest.seq > last + 1
        {
            let lost = json!({ "after": last, "before": oldest.seq });
            if messages
                .send(Ok(Message::default().event("lost").data(lost.to_string())))
                .await
                .is_err()
            {
                return Ok(());
            }
        }
        first = false;
        let more = events.len() == BATCH as usize;
        for event in events {
            last = event.seq;
            if messages.send(Ok(message(app, event)?)).await.is_err() {
                return Ok(());
            }
        }
        if !more {
            // No events for a while: check whether the client may still read.
            let _ = tokio::time::timeout(LOOK, newest.changed()).await;
        }
    }
}

fn message(app: &App, event: Event) -> Result<Message, Problem> {
    let (id, kind) = (event.seq.to_string(), event.kind.clone());
    let data = EventData {
        seq: event.seq,
        at_utc: Instant(event.at_ms),
        kind: event.kind,
        site: event.site,
        job: event.job,
        run: event.run,
        data: event.data,
    };
    let text = serde_json::to_string(&data).map_err(Problem::internal)?;
    Ok(Message::default()
        .id(id)
        .event(kind)
        .data(app.redactor().redact(text)))
}
