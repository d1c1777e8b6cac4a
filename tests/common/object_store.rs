//! An object store of this computer with the interface of S3: objects and listings of one bucket, a few objects in each
//! answer of a listing.

use std::{
    fmt::Write as _,
    fs,
    io::{Read as _, Write as _},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::Command,
    sync::{Arc, Mutex},
    thread,
};

use super::archive_server::request_of;

/// Objects or folders in an answer of a listing.
const PER_ANSWER: usize = 1;

/// The store; it ends with the process. A request without the key `KEY` is refused, and the first request is too many.
#[derive(Debug, Clone)]
pub(crate) struct ObjectStore {
    requests: Arc<Mutex<Vec<String>>>,
    port: u16,
}

impl ObjectStore {
    /// The files below `root` as objects of the bucket `mola`.
    pub(crate) fn of(root: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let requests = Arc::new(Mutex::new(Vec::new()));
        let (root, made) = (root.to_owned(), Arc::clone(&requests));
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (root, made) = (root.clone(), Arc::clone(&made));
                // A client that was killed is no failure of the store.
                thread::spawn(move || serve(&root, &made, stream));
            }
        });
        Self { requests, port }
    }

    fn url(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// A command whose environment names the store.
    pub(crate) fn named_by(&self, mut command: Command, key: &str) -> Command {
        for name in ["AWS_REGION", "AWS_DEFAULT_REGION", "AWS_SESSION_TOKEN"] {
            command.env_remove(name);
        }
        command
            .env("AWS_ENDPOINT_URL_S3", self.url())
            .env("AWS_ACCESS_KEY_ID", key)
            .env("AWS_SECRET_ACCESS_KEY", "HIDDEN");
        command
    }

    /// Targets of all requests, in order.
    pub(crate) fn requests(&self) -> Vec<String> {
        self.requests.lock().unwrap().clone()
    }
}

fn serve(root: &Path, made: &Mutex<Vec<String>>, mut stream: TcpStream) -> std::io::Result<()> {
    while let Some(request) = request_of(&mut stream)? {
        stream.read_exact(&mut [0])?;
        let is_first = {
            let mut made = made.lock().unwrap();
            made.push(request.path.clone());
            made.len() == 1
        };
        let range = request.range();
        let (path, query) = request.path.split_once('?').unwrap_or((&request.path, ""));
        let value = |name: &str| {
            let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
            let (_, found) = pairs.find(|(key, _)| *key == name)?;
            Some(found.replace("%2F", "/"))
        };
        let is_signed = value("X-Amz-Credential").is_some_and(|key| {
            key.starts_with("KEY/") && key.ends_with("/us-east-1/s3/aws4_request")
        }) && value("X-Amz-SignedHeaders").is_some_and(|names| names == "host")
            && value("X-Amz-Signature").is_some_and(|signature| signature.len() == 64);
        let key = path.trim_start_matches('/').strip_prefix("mola");
        let body = match key {
            _ if is_first => Err(503),
            _ if !is_signed => Err(403),
            None if path == "/elsewhere/" || path == "/elsewhere" => Err(301),
            None => Err(404),
            Some("" | "/") => {
                let after = value("continuation-token");
                Ok(listing(
                    root,
                    &value("prefix").unwrap_or_default(),
                    after.as_deref(),
                ))
            }
            Some(key) => fs::read(root.join(key.trim_start_matches('/'))).map_err(|_| 404),
        };
        let (head, body) = match (body, range) {
            (Err(status), _) => {
                let text = format!("<Error><Code>{status}</Code></Error>").into_bytes();
                (format!("HTTP/1.1 {status} Status\r\n"), text)
            }
            (Ok(body), Some((first, last))) => {
                let end = last.map_or(body.len(), |last| usize::try_from(last).unwrap() + 1);
                let [first, end] =
                    [usize::try_from(first).unwrap(), end].map(|at| at.min(body.len()));
                let (length, part) = (body.len(), body[first..end].to_vec());
                let range = format!("content-range: bytes {first}-{}/{length}\r\n", end - 1);
                let etag = blake3::hash(&body).to_hex();
                (
                    format!("HTTP/1.1 206 Partial\r\n{range}etag: \"{etag}\"\r\n"),
                    part,
                )
            }
            (Ok(body), None) => {
                let etag = format!("\"{}\"", blake3::hash(&body).to_hex());
                if request.headers.get("if-none-match") == Some(&etag) {
                    write!(stream, "HTTP/1.1 304 Not Modified\r\netag: {etag}\r\n\r\n")?;
                    continue;
                }
                (format!("HTTP/1.1 200 OK\r\netag: {etag}\r\n"), body)
            }
        };
        write!(stream, "{head}content-length: {}\r\n\r\n", body.len())?;
        stream.write_all(&body)?;
    }
    Ok(())
}

/// An answer of a listing with the delimiter `/`, from the row after `after` on.
fn listing(root: &Path, prefix: &str, after: Option<&str>) -> Vec<u8> {
    let folder: PathBuf = root.join(prefix);
    let mut rows: Vec<String> = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let key = format!("{prefix}{}", entry.file_name().to_str().unwrap());
        let found = entry.metadata().unwrap();
        rows.push(if found.is_dir() {
            format!("<CommonPrefixes><Prefix>{key}/</Prefix></CommonPrefixes>")
        } else {
            format!(
                "<Contents><Key>{key}</Key><Size>{}</Size></Contents>",
                found.len()
            )
        });
    }
    rows.sort();
    let first: usize = after.map_or(0, |after| after.parse().unwrap());
    let end = (first + PER_ANSWER).min(rows.len());
    let mut text =
        String::from("<ListBucketResult xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\">");
    if end < rows.len() {
        let next = format!("<NextContinuationToken>{end}</NextContinuationToken>");
        write!(text, "<IsTruncated>true</IsTruncated>{next}").unwrap();
    }
    text.extend(rows[first.min(end)..end].iter().cloned());
    text.push_str("</ListBucketResult>");
    text.into_bytes()
}
