//! Nights: a due night begins with a round of comparisons, and ends with the jobs that result.

use serde_json::json;

use super::{
    alerts::{Alert, tell},
    core::Core,
    retry::milliseconds,
    schedule::Schedule,
    workers::Workers,
};
use crate::{
    clock::utc_text,
    database::{
        About, Stored, append, facts,
        nights::{Night, NightHow, end_night, night_at_work, open_night, put_night},
    },
};
use areograph_config::AlertKind;

/// Milliseconds of an hour.
const HOUR_MS: f64 = 3_600_000.0;

/// Begins the night that is due, if any; returns its number. Of missed instants only the newest is caught up.
///
/// # Errors
/// The database cannot be written.
pub fn begin_due<W: Workers>(core: &Core<W>) -> Stored<Option<i64>> {
    let config = core.shared.config();
    let now_ms = core.now_ms();
    let schedule = match Schedule::of(&config.schedule, now_ms) {
        Ok(schedule) => schedule,
        Err(bad) => {
            // It was valid when it was loaded, and has no further instants.
            core.shared.set_problem(Some(bad.to_string()));
            return Ok(None);
        }
    };
    let (known, last_ms, open) = core.shared.read(|connection| {
        Ok((
            facts::fact(connection, facts::SCHEDULE)?,
            facts::number(connection, facts::INTENDED_MS)?,
            open_night(connection)?,
        ))
    })?;
    let last_ms = last_ms.filter(|_| known.as_deref() == Some(schedule.text()));
    let Some(last_ms) = last_ms else {
        // New or edited: earlier instants are not caught up.
        core.shared.write(|transaction| {
            facts::note(transaction, facts::SCHEDULE, schedule.text())?;
            facts::note(transaction, facts::INTENDED_MS, &now_ms.to_string())
        })?;
        return Ok(None);
    };
    if open.is_some() {
        // The night continues; the next one begins after it.
        return Ok(None);
    }
    let due = schedule.due(
        last_ms,
        now_ms,
        milliseconds(config.schedule.catch_up_h * HOUR_MS / 1000.0),
    );
    let seen_to_ms = due.instant_ms.or_else(|| due.missed_ms.last().copied());
    let Some(seen_to_ms) = seen_to_ms else {
        return Ok(None);
    };
    let how = if due.late {
        NightHow::CaughtUp
    } else {
        NightHow::Due
    };
    core.shared.write(|transaction| {
        facts::note(transaction, facts::INTENDED_MS, &seen_to_ms.to_string())?;
        for missed_ms in &due.missed_ms {
            let zone = &config.schedule.zone;
            put_night(transaction, *missed_ms, zone, NightHow::Missed, None)?;
        }
        let Some(instant_ms) = due.instant_ms else {
            return Ok(None);
        };
        begin(transaction, now_ms, instant_ms, &config.schedule.zone, how)
    })
}

/// Begins a night at the request of a caller.
///
/// # Errors
/// The database cannot be written.
pub fn begin_requested<W: Workers>(core: &Core<W>) -> Stored<Option<i64>> {
    let zone = core.shared.config().schedule.zone.clone();
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        // It replaces earlier nights that were due.
        if facts::fact(transaction, facts::SCHEDULE)?.is_some() {
            facts::note(transaction, facts::INTENDED_MS, &now_ms.to_string())?;
        }
        begin(transaction, now_ms, now_ms, &zone, NightHow::Requested)
    })
}

fn begin(
    transaction: &rusqlite::Transaction<'_>,
    now_ms: i64,
    instant_ms: i64,
    zone: &str,
    how: NightHow,
) -> Stored<Option<i64>> {
    let night = put_night(transaction, instant_ms, zone, how, Some(now_ms))?;
    if let Some(night) = night {
        let due = utc_text(instant_ms);
        tracing::info!(night, "the night of {due} begins");
        let data = json!({ "night": night, "due": due, "how": how.name() });
        append(transaction, now_ms, "night", About::default(), &data)?;
    }
    Ok(night)
}

/// Ends the night after its comparisons and jobs; reports its summary.
///
/// # Errors
/// The database cannot be written.
pub fn end_done<W: Workers>(core: &Core<W>, night: i64) -> Stored<Option<Night>> {
    if core
        .shared
        .read(|connection| night_at_work(connection, night))?
    {
        return Ok(None);
    }
    let config = core.shared.config();
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        let Some(night) = end_night(transaction, night, now_ms)? else {
            return Ok(None);
        };
        let text = format!("the night has ended: {}", night.words());
        let summary = json!({
            "night": night.id,
            "due": utc_text(night.due_utc.0),
            "sites_checked": night.sites_checked,
            "runs": night.runs,
            "failures": night.failures,
        });
        append(transaction, now_ms, "night", About::default(), &summary)?;
        let alert = Alert::of_service(AlertKind::NightComplete, &text);
        tell(transaction, &config, now_ms, &alert, &summary)?;
        Ok(Some(night))
    })
}
