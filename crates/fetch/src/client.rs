//! Requests: over HTTP with limits and rules, or to a mirror on a disk.

use std::{
    fs::{self, File},
    io::{self, Cursor, Read},
    path::Path,
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
    address::{mirror, permitted, redirected},
    archives::Archives,
    error::FetchError,
    hashed::hexadecimal,
    headers::{rest_of, wait_of},
    object_store::{Stored, is_stored},
    part::Meta,
};
use areograph_base::error::{Error, IoError, Locate as _};

/// Redirections that are followed one after another.
const REDIRECTIONS_MAX: u32 = 5;

/// Longest answer of a service or listing of a folder, bytes.
const ANSWER_MAX: u64 = 64 << 20;

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

impl Reply {
    /// A page that is complete.
    fn of_page(url: &str, page: String) -> Self {
        Self::Body(Answer {
            is_rest: false,
            meta: Meta {
                url: url.to_owned(),
                length: Some(page.len() as u64),
                ..Meta::default()
            },
            is_delimited: true,
            body: Box::new(Cursor::new(page.into_bytes())),
        })
    }

    /// The complete body of an answer as a text.
    pub(crate) fn text(self, is_page: bool) -> Result<String, Fault> {
        let Self::Body(answer) = self else {
            return Err(Fault::Passing(
                "the answer contains no text".to_owned(),
                None,
            ));
        };
        let (mut bytes, is_delimited) = (Vec::new(), answer.is_delimited);
        let read = |bytes: &mut Vec<u8>| -> io::Result<usize> {
            answer.body.take(ANSWER_MAX + 1).read_to_end(bytes)
        };
        let problem = match read(&mut bytes) {
            Err(error) => error.to_string(),
            Ok(count) if count as u64 > ANSWER_MAX => {
                let (url, problem) = (
                    answer.meta.url,
                    format!("the answer is longer than {ANSWER_MAX} bytes"),
                );
                return Err(FetchError::Content { url, problem }.into());
            }
            Ok(count) => match answer.meta.length {
                Some(length) if count as u64 != length => {
                    format!("the answer has {count} bytes; expected {length}")
                }
                _ => {
                    let text = String::from_utf8_lossy(&bytes).into_owned();
                    if !is_page || is_delimited || text.to_ascii_lowercase().contains("</html") {
                        return Ok(text);
                    }
                    "the listing ends without </html>, and its length is not stated".to_owned()
                }
            },
        };
        Err(Fault::Passing(problem, None))
    }
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
        if is_stored(url) && url.ends_with('/') {
            let page = Stored::at(url)?.page(url, |address| {
                let response = self.ask(url, &signed(url, address)?, ask)?;
                of_response(url, response, ask)?.text(false)
            })?;
            return Ok(Reply::of_page(url, page));
        }
        of_response(url, self.respond(url, ask)?, ask)
    }

    /// The response to a request over HTTP, redirections followed.
    pub(crate) fn respond(&self, url: &str, ask: Ask<'_>) -> Result<Response<ureq::Body>, Fault> {
        if is_stored(url) {
            return self.ask(url, &signed(url, &Stored::at(url)?.address())?, ask);
        }
        let mut at = url.to_owned();
        for _ in 0..=REDIRECTIONS_MAX {
            let uri = permitted(&at)?;
            let response = self.ask(&at, &uri, ask)?;
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

    /// * `url` – the address in messages
    fn ask(&self, url: &str, uri: &Uri, ask: Ask<'_>) -> Result<Response<ureq::Body>, Fault> {
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
                ureq::Error::BadUri(_) | ureq::Error::Http(_) => {
                    let url = url.to_owned();
                    FetchError::Address { url }.into()
                }
                // Certificates do not become valid by another attempt.
                ureq::Error::Tls(_) | ureq::Error::Rustls(_) => {
                    let url = url.to_owned();
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
            Ok(Reply::of_page(url, page))
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

/// A signed address, which messages do not state.
fn signed(url: &str, address: &str) -> Result<Uri, FetchError> {
    permitted(address).map_err(|_| FetchError::Address {
        url: url.to_owned(),
    })
}

/// Whether a response states another version of the file than the validator of its first bytes.
fn is_other(response: &Response<ureq::Body>, validator: Option<&str>) -> bool {
    validator.is_some_and(|then| {
        let name = if then.starts_with('"') {
            "etag"
        } else {
            "last-modified"
        };
        header(response, name).is_some_and(|now| now != then)
    })
}

fn of_response(url: &str, response: Response<ureq::Body>, ask: Ask<'_>) -> Result<Reply, Fault> {
    let status = response.status().as_u16();
    let wait = header(&response, "retry-after").and_then(|text| wait_of(text, SystemTime::now()));
    let (is_rest, length) = match status {
        200 => {
            let length = header(&response, "content-length").and_then(|text| text.parse().ok());
            (false, length)
        }
        // Not every object store regards `If-Range`.
        206 if ask.from > 0 && is_other(&response, ask.validator) => return Ok(Reply::OtherFile),
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
    fn a_longer_answer_than_the_limit_is_no_complete_one() {
        let of = |bytes: u64| {
            let answer = Answer {
                is_rest: false,
                meta: Meta::default(),
                is_delimited: true,
                body: Box::new(io::repeat(b' ').take(bytes)),
            };
            Reply::Body(answer).text(true)
        };
        assert_eq!(of(1_000).unwrap().len(), 1_000);
        let Err(Fault::Lasting(failure)) = of(ANSWER_MAX + 1) else {
            panic!("a part of an answer is taken for the whole");
        };
        assert!(failure.to_string().contains("longer than"), "{failure}");
    }
}
