//! Addresses from which files are fetched.

use std::{net::IpAddr, path::PathBuf};

use ureq::http::Uri;

use crate::error::FetchError;

/// The path of a mirror on a disk; a relative one has no meaning in an address.
pub(crate) fn mirror(url: &str) -> Option<PathBuf> {
    let path = url.strip_prefix("file://")?;
    path.starts_with('/').then(|| PathBuf::from(path))
}

/// The address, if its scheme is one to fetch from.
pub(crate) fn permitted(url: &str) -> Result<Uri, FetchError> {
    let refused = || FetchError::Address {
        url: url.to_owned(),
    };
    let uri: Uri = url.parse().map_err(|_| refused())?;
    let host = uri.host().unwrap_or_default();
    let own = || {
        host == "localhost"
            || host
                .trim_matches(['[', ']'])
                .parse()
                .is_ok_and(|ip: IpAddr| ip.is_loopback())
    };
    match uri.scheme_str() {
        Some("https") if !host.is_empty() => Ok(uri),
        Some("http") if own() => Ok(uri),
        _ => Err(refused()),
    }
}

/// Target of a redirection: https, or the same scheme and host.
pub(crate) fn redirected(from: &str, uri: &Uri, location: &str) -> Result<String, FetchError> {
    let refused = |why| FetchError::Redirect {
        url: from.to_owned(),
        to: location.to_owned(),
        why,
    };
    let (scheme, host) = (uri.scheme_str().unwrap_or_default(), uri.authority());
    let base = format!("{scheme}://{}", host.map_or("", |host| host.as_str()));
    let to = if location.is_empty() {
        return Err(refused("it names no address"));
    } else if location.contains("://") {
        location.to_owned()
    } else if location.starts_with("//") {
        format!("{scheme}:{location}")
    } else if location.starts_with('/') {
        format!("{base}{location}")
    } else {
        let folder = uri.path().rsplit_once('/').map_or("", |(folder, _)| folder);
        format!("{base}{folder}/{location}")
    };
    let to_uri: Uri = to.parse().map_err(|_| refused("it is not an address"))?;
    match (scheme, to_uri.scheme_str()) {
        (_, Some("https")) => Ok(to),
        ("http", Some("http")) if to_uri.authority() == host => Ok(to),
        ("https", Some("http")) => Err(refused("it gives up encryption")),
        _ => Err(refused("expected https, or the same host")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_encrypted_and_own_addresses_are_asked() {
        for good in [
            "https://a.gov/x",
            "http://127.0.0.1:80/x",
            "http://localhost/x",
            "http://[::1]:8/x",
        ] {
            assert!(permitted(good).is_ok(), "{good}");
        }
        for bad in [
            "http://a.gov/x",
            "ftp://a.gov/x",
            "https:///x",
            "x",
            "http://127.0.0.1.a.gov/",
            "",
        ] {
            assert!(permitted(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn redirections_keep_to_encryption_or_to_the_host() {
        let to = |from: &str, location: &str| {
            redirected(from, &from.parse().unwrap(), location).map_err(|error| error.to_string())
        };
        assert_eq!(to("https://a.gov/x/y", "z").unwrap(), "https://a.gov/x/z");
        assert_eq!(
            to("https://a.gov/x", "//b.gov/z").unwrap(),
            "https://b.gov/z"
        );
        assert_eq!(
            to("http://127.0.0.1:8/x", "https://b.gov/z").unwrap(),
            "https://b.gov/z"
        );
        assert_eq!(
            to("http://127.0.0.1:8/x", "/z").unwrap(),
            "http://127.0.0.1:8/z"
        );
        assert!(
            to("https://a.gov/x", "http://a.gov/x")
                .unwrap_err()
                .contains("gives up encryption")
        );
        for other in ["http://b.gov/z", "ftp://b.gov/z", "file:///etc/passwd", ""] {
            assert!(to("http://127.0.0.1:8/x", other).is_err(), "{other}");
        }
    }
}
