//! Requests: over HTTP with limits and rules, or to a mirror on a disk.

use std::{
    fs::{self, File},
    io::{self, Cursor, Read},
    net::IpAddr,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use rustls::crypto::ring;
use ureq::{
    Agent,
    http::{Response, Uri},
    tls::{RootCerts, TlsConfig},
};

use crate::{
    archives::Archives,
    error::FetchError,
    hashed::hexadecimal,
    headers::{rest_of, wait_of},
    part::Meta,
};
use areograph_base::error::{Error, IoError, Locate as _};

/// Redirections that are followed one after another.
const REDIRECTIONS_MAX: u32 = 5;

/// Asks archives.
#[derive(Debug, Clone)]
pub(crate) struct Client {
    agent: Agent,
}

/// The request.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Ask<'a> {
    /// First byte; only with the validator.
    pub(crate) from: u64,
    /// The rest is wanted only of the file with this validator.
    pub(crate) validator: Option<&'a str>,
    /// The file is wanted only if it is not this one.
    pub(crate) known: Option<&'a Meta>,
    /// Only these bytes are wanted, the first and the last one.
    pub(crate) range: Option<[u64; 2]>,
    /// Longest time without a byte, where it differs from the limit for files.
    pub(crate) limit: Option<Duration>,
}

/// An answer with a body.
pub(crate) struct Answer {
    /// Whether the body is the rest from the wanted byte on.
    pub(crate) is_rest: bool,
    /// Its statements on the complete file; the length is absent if unknown.
    pub(crate) meta: Meta,
    /// Whether the end of the body marks itself.
    pub(crate) is_delimited: bool,
    pub(crate) body: Box<dyn Read>,
}

/// An answer.
pub(crate) enum Reply {
    Body(Answer),
    /// The known file is still the one.
    Unchanged,
    /// The part that was to be continued is not one of this file.
    OtherFile,
}

/// Reasons why there is no answer.
#[derive(Debug)]
pub(crate) enum Fault {
    /// Another attempt would end the same way.
    Lasting(Error),
    /// The problem, and the waiting time that the host requests.
    Passing(String, Option<Duration>),
}

impl<E: Into<Error>> From<E> for Fault {
    fn from(error: E) -> Self {
        Self::Lasting(error.into())
    }
}

impl Client {
    pub(crate) fn of(archives: &Archives) -> Self {
        let [connect, read] = archives.network.limits();
        let mut name = format!("areograph/{}", env!("CARGO_PKG_VERSION"));
        if !archives.contact.is_empty() {
            name = format!("{name} ({})", archives.contact);
        }
        let tls = TlsConfig::builder()
            .root_certs(RootCerts::PlatformVerifier)
            .unversioned_rustls_crypto_provider(Arc::new(ring::default_provider()))
            .build();
        let config = Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_resolve(Some(connect))
            .timeout_connect(Some(connect))
            .timeout_per_read(Some(read))
            .timeout_per_write(Some(read))
            .user_agent(name)
            .tls_config(tls)
            .build();
        Self {
            agent: config.into(),
        }
    }

    /// Asks for a file, or the rest of one.
    pub(crate) fn get(&self, url: &str, ask: Ask<'_>) -> Result<Reply, Fault> {
        if let Some(path) = mirror(url) {
            return of_disk(url, &path);
        }
        of_response(url, self.respond(url, ask)?, ask)
    }

    /// The response to a request over HTTP, redirections followed.
    pub(crate) fn respond(&self, url: &str, ask: Ask<'_>) -> Result<Response<ureq::Body>, Fault> {
        let mut at = url.to_owned();
        for _ in 0..=REDIRECTIONS_MAX {
            let uri = permitted(&at)?;
            let response = self.ask(&uri, ask)?;
            let status = response.status().as_u16();
            if !matches!(status, 301 | 302 | 303 | 307 | 308) {
                return Ok(response);
            }
            at = redirected(&at, &uri, header(&response, "location").unwrap_or_default())?;
        }
        let (url, why) = (url.to_owned(), "there are too many redirections");
        Err(FetchError::Redirect { url, to: at, why }.into())
    }

    /// Whether a file that the answer to a query names is fetched from its address: as redirections are.
    pub(crate) fn check_result(query: &str, result: &str) -> Result<(), FetchError> {
        redirected(query, &permitted(query)?, result).map(drop)
    }

    fn ask(&self, uri: &Uri, ask: Ask<'_>) -> Result<Response<ureq::Body>, Fault> {
        let mut request = self.agent.get(uri).header("accept-encoding", "identity");
        if let (1.., Some(validator)) = (ask.from, ask.validator) {
            request = request
                .header("range", format!("bytes={}-", ask.from))
                .header("if-range", validator);
        }
        if let Some([first, last]) = ask.range {
            request = request.header("range", format!("bytes={first}-{last}"));
        }
        if let Some(known) = ask.known {
            if let Some(etag) = &known.etag {
                request = request.header("if-none-match", etag);
            }
            if let Some(time) = &known.last_modified {
                request = request.header("if-modified-since", time);
            }
        }
        if let Some(limit) = ask.limit {
            request = request.config().timeout_per_read(Some(limit)).build();
        }
        request.call().map_err(|error| {
            let problem = error.to_string();
            match error {
                ureq::Error::BadUri(_) | ureq::Error::Http(_) => FetchError::Address {
                    url: uri.to_string(),
                }
                .into(),
                // Certificates do not become valid by another attempt.
                ureq::Error::Tls(_) | ureq::Error::Rustls(_) => {
                    let url = uri.to_string();
                    FetchError::Network {
                        url,
                        problem,
                        attempts: 1,
                    }
                    .into()
                }
                _ => Fault::Passing(problem, None),
            }
        })
    }
}

/// The path of a mirror on a disk; a relative one has no meaning in an address.
pub(crate) fn mirror(url: &str) -> Option<PathBuf> {
    let path = url.strip_prefix("file://")?;
    path.starts_with('/').then(|| PathBuf::from(path))
}

fn of_disk(url: &str, path: &Path) -> Result<Reply, Fault> {
    let opened = File::open(path).and_then(|file| Ok((file.metadata()?, file)));
    match opened {
        Ok((found, file)) if found.is_file() => Ok(Reply::Body(Answer {
            is_rest: false,
            meta: Meta {
                url: url.to_owned(),
                length: Some(found.len()),
                ..Meta::default()
            },
            is_delimited: true,
            body: Box::new(file),
        })),
        Ok((found, _)) if found.is_dir() => {
            let page = page_of(path)
                .map_err(IoError::on("list folder"))
                .in_file(path)?;
            Ok(Reply::Body(Answer {
                is_rest: false,
                meta: Meta {
                    url: url.to_owned(),
                    length: Some(page.len() as u64),
                    ..Meta::default()
                },
                is_delimited: true,
                body: Box::new(Cursor::new(page.into_bytes())),
            }))
        }
        Ok(_) => Err(FetchError::Status {
            url: url.to_owned(),
            status: 404,
        }
        .into()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(FetchError::Status {
            url: url.to_owned(),
            status: 404,
        }
        .into()),
        Err(error) => Err(Fault::Lasting(
            Error::from(IoError::on("read")(error)).in_file(path),
        )),
    }
}

/// A listing of a folder, as a server writes it.
fn page_of(folder: &Path) -> io::Result<String> {
    let mut rows = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // Servers do not list hidden files either.
        if name.starts_with('.') {
            continue;
        }
        // The reader of the page judges names, and reports a broken link when it follows it.
        let found = fs::metadata(entry.path());
        if found.as_ref().is_ok_and(fs::Metadata::is_dir) {
            rows.push(format!("<a href=\"{name}/\">{name}/</a>\n"));
        } else {
            let bytes = found.map_or(0, |found| found.len());
            rows.push(format!("<a href=\"{name}\">{name}</a> 00:00 {bytes}\n"));
        }
    }
    rows.sort();
    Ok(rows.concat())
}

/// The address, if its scheme is one to fetch from.
fn permitted(url: &str) -> Result<Uri, FetchError> {
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
fn redirected(from: &str, uri: &Uri, location: &str) -> Result<String, FetchError> {
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

pub(crate) fn header<'a>(response: &'a Response<ureq::Body>, name: &str) -> Option<&'a str> {
    response.headers().get(name)?.to_str().ok()
}

/// The fault that a status without a file states.
pub(crate) fn refused(url: &str, status: u16, wait: Option<Duration>) -> Fault {
    match status {
        408 | 429 | 500 | 502 | 503 | 504 => Fault::Passing(format!("HTTP status {status}"), wait),
        _ => {
            let url = url.to_owned();
            FetchError::Status { url, status }.into()
        }
    }
}

fn of_response(url: &str, response: Response<ureq::Body>, ask: Ask<'_>) -> Result<Reply, Fault> {
    let status = response.status().as_u16();
    let wait = header(&response, "retry-after").and_then(|text| wait_of(text, SystemTime::now()));
    let (is_rest, length) = match status {
        200 => {
            let length = header(&response, "content-length").and_then(|text| text.parse().ok());
            (false, length)
        }
        206 if ask.from > 0 => match header(&response, "content-range").and_then(rest_of) {
            Some((first, length)) if first == ask.from => (true, length),
            _ => return Ok(Reply::OtherFile),
        },
        304 if ask.known.is_some() => return Ok(Reply::Unchanged),
        416 if ask.from > 0 => return Ok(Reply::OtherFile),
        _ => return Err(refused(url, status, wait)),
    };
    if header(&response, "content-encoding").is_some_and(|coding| coding != "identity") {
        let problem = "the answer is encoded, although the unencoded file was requested".to_owned();
        return Err(FetchError::Content {
            url: url.to_owned(),
            problem,
        }
        .into());
    }
    let text = |name| header(&response, name).map(str::to_owned);
    let is_chunked = header(&response, "transfer-encoding")
        .is_some_and(|coding| coding.to_ascii_lowercase().contains("chunked"));
    let meta = Meta {
        url: url.to_owned(),
        // A weak validator is shared by similar files.
        etag: text("etag").filter(|etag| etag.starts_with('"')),
        last_modified: text("last-modified"),
        length,
        md5: header(&response, "content-md5")
            .and_then(|text| STANDARD.decode(text).ok())
            .filter(|md5| md5.len() == 16 && !is_rest)
            .map(|md5| hexadecimal(&md5)),
        sha256: None,
    };
    Ok(Reply::Body(Answer {
        is_rest,
        is_delimited: is_chunked || meta.length.is_some(),
        meta,
        body: Box::new(response.into_body().into_reader()),
    }))
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
