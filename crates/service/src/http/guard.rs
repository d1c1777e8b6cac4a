//! First checks of every request: the host, no token in the address, a known caller, the rate.

use std::{
    net::{IpAddr, SocketAddr},
    sync::Arc,
    time::Instant,
};

use axum::{
    extract::{Request, State},
    http::{HeaderMap, Method, StatusCode, Uri, header, request::Parts, uri::Authority},
    middleware::Next,
    response::{IntoResponse as _, Response},
};

use super::{
    app::App,
    caller::{Caller, identify},
    problem::Problem,
    rate::{Key, READS, Rate, WRITES},
};
use crate::tokens::PREFIX;

/// Parameter names that commonly contain tokens in addresses.
const TOKEN_PARAMETERS: [&str; 6] = [
    "token",
    "access_token",
    "api_key",
    "apikey",
    "auth",
    "authorization",
];
/// Address of the form with a token.
const LOGIN: &str = "/login";
const FORWARDED_FOR: &str = "x-forwarded-for";
const FORWARDED: &str = "forwarded";

/// Remote end of the connection.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peer(pub(super) SocketAddr);

pub(super) async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let (mut parts, body) = request.into_parts();
    match pass(&app, &parts).await {
        Ok(caller) => {
            parts.extensions.insert(caller);
            next.run(Request::from_parts(parts, body)).await
        }
        Err(problem) => problem.into_response(),
    }
}

async fn pass(app: &App, parts: &Parts) -> Result<Caller, Problem> {
    let (headers, uri) = (&parts.headers, &parts.uri);
    let local_name = check_host(app, headers, uri)?;
    refuse_token_in(uri)?;
    let peer = parts.extensions.get::<Peer>();
    let peer = peer
        .ok_or_else(|| Problem::internal("the request has no client address"))?
        .0;
    let forwarded = headers.contains_key(FORWARDED_FOR) || headers.contains_key(FORWARDED);
    let direct = local_name && !forwarded && peer.ip().is_loopback();
    let remote = remote(headers, peer.ip(), &app.config().http.trusted_proxies);
    let caller = identify(app, headers, remote, direct).await?;
    let reads = matches!(parts.method, Method::GET | Method::HEAD);
    // A login is limited by its token: others at the address must not use up its rate.
    if reads || uri.path() != LOGIN || caller.token.is_some() {
        limit(app, &caller, reads)?;
    }
    Ok(caller)
}

/// Rejects requests for another host: a page of a foreign site whose name resolves to this machine must not be
/// answered. Returns whether it is a name of this machine.
fn check_host(app: &App, headers: &HeaderMap, uri: &Uri) -> Result<bool, Problem> {
    let wrong = || {
        Problem::new(
            StatusCode::MISDIRECTED_REQUEST,
            "The service does not accept this host. Use the address of the service, or the public_url of its configuration.",
        )
    };
    let mut hosts = headers.get_all(header::HOST).iter();
    let (Some(host), None) = (hosts.next(), hosts.next()) else {
        return Err(wrong());
    };
    let host = host.to_str().map_err(|_| wrong())?;
    let asked = uri.authority().map(Authority::as_str);
    if asked.is_some_and(|asked| !asked.eq_ignore_ascii_case(host)) {
        return Err(wrong());
    }
    if is_local_name(host, app.local) {
        return Ok(true);
    }
    let config = app.config();
    let public = config.http.public_url.strip_prefix("https://");
    if public.is_some_and(|public| public.eq_ignore_ascii_case(host)) {
        return Ok(false);
    }
    Err(wrong())
}

fn is_local_name(host: &str, local: SocketAddr) -> bool {
    let port = local.port();
    let own = local.ip().is_loopback().then(|| local.to_string());
    let names = ["localhost", "127.0.0.1", "[::1]"];
    let with_port = names.iter().map(|name| format!("{name}:{port}"));
    let without = names.iter().filter(|_| port == 80);
    with_port
        .chain(without.map(|name| (*name).to_owned()))
        .chain(own)
        .any(|name| name.eq_ignore_ascii_case(host))
}

/// Addresses are kept in logs and histories: a token in one is rejected, so that this does not become a habit.
fn refuse_token_in(uri: &Uri) -> Result<(), Problem> {
    let refused = || {
        Problem::bad_request(
            "A token must not appear in an address, which logs and histories record: send the header Authorization: \
             Bearer … instead. If this was a real token, revoke it.",
        )
    };
    let decoded = percent_decoded(&uri.to_string());
    let looks_like_one = decoded.match_indices(PREFIX).any(|(place, _)| {
        let rest = &decoded[place + PREFIX.len()..];
        let shape = rest
            .bytes()
            .take_while(|byte| byte.is_ascii_hexdigit() || *byte == b'_');
        shape.count() > 40
    });
    let pairs = uri.query().unwrap_or_default().split('&');
    let named = pairs
        .filter_map(|pair| pair.split('=').next())
        .any(|name| TOKEN_PARAMETERS.contains(&&*percent_decoded(name).to_lowercase()));
    if looks_like_one || named {
        return Err(refused());
    }
    Ok(())
}

fn percent_decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        let digits = after
            .get(..2)
            .and_then(|digits| std::str::from_utf8(digits).ok());
        if let (b'%', Some(Ok(byte))) = (first, digits.map(|digits| u8::from_str_radix(digits, 16)))
        {
            bytes.push(byte);
            rest = &after[2..];
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// The last address that does not belong to a trusted proxy.
fn remote(headers: &HeaderMap, peer: IpAddr, trusted: &[IpAddr]) -> IpAddr {
    if !trusted.contains(&peer) {
        return peer;
    }
    let lines = headers.get_all(FORWARDED_FOR).iter();
    let given: Vec<&str> = lines
        .filter_map(|line| line.to_str().ok())
        .flat_map(|line| line.split(','))
        .collect();
    let mut remote = peer;
    for address in given.iter().rev() {
        let Ok(address) = address.trim().parse() else {
            break;
        };
        remote = address;
        if !trusted.contains(&address) {
            break;
        }
    }
    remote
}

/// Callers without a token on this machine are limited only by the number of connections.
fn limit(app: &App, caller: &Caller, reads: bool) -> Result<(), Problem> {
    let name = match &caller.token {
        Some(token) => token.clone(),
        None if caller.role.is_some() && reads => return Ok(()),
        None => caller.remote.to_string(),
    };
    let (key, rate) = if reads {
        (Key::Read(name), READS)
    } else {
        (Key::Write(name), WRITES)
    };
    take(app, key, rate)
}

/// Limits the logins with a token.
pub(super) fn limit_login(app: &App, token: &str) -> Result<(), Problem> {
    take(app, Key::Write(token.to_owned()), WRITES)
}

fn take(app: &App, key: Key, rate: Rate) -> Result<(), Problem> {
    app.rates
        .take(key, rate, Instant::now())
        .map_err(|wait_s| Problem {
            retry_after_s: Some(wait_s),
            ..Problem::new(
                StatusCode::TOO_MANY_REQUESTS,
                "Too many requests. Try again later.",
            )
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_in_addresses_are_seen_however_they_are_written() {
        let secret = "0123456789abcdef".repeat(4);
        for refused in [
            format!("/api/v1/sites?token={secret}"),
            "/sites?x=1&ACCESS_TOKEN=1".to_owned(),
            format!("/sites?q=areo_01234567_{secret}"),
            format!("/sites/areo_01234567_{secret}"),
            format!("/sites?q=%61reo%5f01234567_{secret}"),
            "/?%74oken=1".to_owned(),
        ] {
            let uri: Uri = refused.parse().unwrap();
            assert!(refuse_token_in(&uri).is_err(), "{refused}");
        }
        for taken in [
            "/sites/areo_alpha",
            "/sites?after=areo_b",
            "/?q=%",
            "/?%zz=%4",
        ] {
            let uri: Uri = taken.parse().unwrap();
            assert!(refuse_token_in(&uri).is_ok(), "{taken}");
        }
    }

    #[test]
    fn only_proxies_of_ours_are_believed() {
        let [proxy, inner, client, forged] = [
            [10, 0, 0, 1],
            [10, 0, 0, 2],
            [192, 0, 2, 7],
            [203, 0, 113, 9],
        ]
        .map(IpAddr::from);
        let mut headers = HeaderMap::new();
        let line = format!("{forged}, {client}, {inner}");
        headers.insert(FORWARDED_FOR, line.parse().unwrap());
        assert_eq!(remote(&headers, forged, &[proxy]), forged);
        assert_eq!(remote(&headers, proxy, &[proxy, inner]), client);
        assert_eq!(remote(&headers, proxy, &[proxy]), inner);
        headers.insert(FORWARDED_FOR, "unknown".parse().unwrap());
        assert_eq!(remote(&headers, proxy, &[proxy]), proxy);
    }
}
