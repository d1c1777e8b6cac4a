//! A server of this computer with the layout of the archives, listings as their servers write them, and every fault of a
//! transfer.

use std::{
    collections::{BTreeMap, VecDeque},
    fmt::Write as _,
    fs,
    io::{Read as _, Write as _},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use md5::{Digest as _, Md5};

/// What goes wrong with one answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fault {
    /// This status without a file.
    Status(u16),
    /// This status, and a wait of so many seconds.
    RetryAfter(u16, u64),
    /// The connection is reset after so many bytes of the body.
    ResetAfter(usize),
    /// The connection is closed after so many bytes of the body.
    ShortBy(usize),
    /// More bytes than the file has, announced or not.
    Longer {
        /// Whether the length announces them.
        is_announced: bool,
    },
    /// Other bytes of the right length.
    WrongBytes,
    /// The whole file, although its rest was asked for.
    IgnoresRange,
    /// The rest from another byte than was asked for.
    WrongRange,
    /// Leads elsewhere.
    Redirect(String),
    /// No answer at all.
    Hangs,
    /// A web page in place of the file.
    Page,
    /// This text in place of the file or the listing.
    Text(String),
    /// As `NoLength`, and the connection is closed after so many bytes.
    NoEnd(usize),
    /// Neither length nor chunks: the end of the connection ends the file.
    NoLength,
    /// The file in small pieces with pauses.
    Slow,
}

/// A request.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    pub(crate) path: String,
    pub(crate) headers: BTreeMap<String, String>,
}

impl Request {
    /// First byte that it asks for.
    pub(crate) fn from(&self) -> u64 {
        self.range().map_or(0, |(first, _)| first)
    }

    /// First and last byte that it asks for; without a last byte, up to the end.
    pub(crate) fn range(&self) -> Option<(u64, Option<u64>)> {
        let range = self.headers.get("range")?;
        let (first, last) = range
            .strip_prefix("bytes=")
            .unwrap()
            .split_once('-')
            .unwrap();
        Some((first.parse().unwrap(), last.parse().ok()))
    }
}

/// How folders are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Listing {
    Plain,
    Table,
}

#[derive(Debug)]
struct Served {
    root: PathBuf,
    listing: Listing,
    faults: Mutex<BTreeMap<String, VecDeque<Fault>>>,
    /// Faults of every answer of a path.
    lasting: Mutex<BTreeMap<String, Fault>>,
    requests: Mutex<Vec<Request>>,
    body_bytes: Mutex<BTreeMap<String, u64>>,
    open: AtomicUsize,
    open_max: AtomicUsize,
}

/// The server; it ends with the process.
#[derive(Debug, Clone)]
pub(crate) struct ArchiveServer {
    served: Arc<Served>,
    pub(crate) port: u16,
}

impl ArchiveServer {
    pub(crate) fn of(root: &Path, listing: Listing) -> Self {
        let served = Arc::new(Served {
            root: root.to_owned(),
            listing,
            faults: Mutex::default(),
            lasting: Mutex::default(),
            requests: Mutex::default(),
            body_bytes: Mutex::default(),
            open: AtomicUsize::new(0),
            open_max: AtomicUsize::new(0),
        });
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let serving = Arc::clone(&served);
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let served = Arc::clone(&serving);
                thread::spawn(move || {
                    let open = served.open.fetch_add(1, Ordering::SeqCst) + 1;
                    served.open_max.fetch_max(open, Ordering::SeqCst);
                    // A client that was killed is no failure of the server.
                    let _ = serve(&served, stream);
                    served.open.fetch_sub(1, Ordering::SeqCst);
                });
            }
        });
        Self { served, port }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// The next answers of a path.
    pub(crate) fn next(&self, path: &str, faults: impl IntoIterator<Item = Fault>) {
        let faults = faults.into_iter().collect();
        self.served
            .faults
            .lock()
            .unwrap()
            .insert(path.to_owned(), faults);
    }

    /// Every answer of a path.
    pub(crate) fn always(&self, path: &str, fault: Fault) {
        self.served
            .lasting
            .lock()
            .unwrap()
            .insert(path.to_owned(), fault);
    }

    /// Requests for a path, in order.
    pub(crate) fn requests(&self, path: &str) -> Vec<Request> {
        let requests = self.served.requests.lock().unwrap();
        requests
            .iter()
            .filter(|request| request.path == path)
            .cloned()
            .collect()
    }

    /// Number of all requests.
    pub(crate) fn request_count(&self) -> usize {
        self.served.requests.lock().unwrap().len()
    }

    /// Bytes of a path that were sent.
    pub(crate) fn sent(&self, path: &str) -> u64 {
        self.served
            .body_bytes
            .lock()
            .unwrap()
            .get(path)
            .copied()
            .unwrap_or_default()
    }

    /// Most connections at a time.
    pub(crate) fn open_max(&self) -> usize {
        self.served.open_max.load(Ordering::SeqCst)
    }
}

/// Answers the requests of a connection.
fn serve(served: &Served, mut stream: TcpStream) -> std::io::Result<()> {
    loop {
        let Some(request) = request_of(&mut stream)? else {
            return Ok(());
        };
        served.requests.lock().unwrap().push(request.clone());
        let fault = {
            let mut faults = served.faults.lock().unwrap();
            let next = faults.get_mut(&request.path).and_then(VecDeque::pop_front);
            next.or_else(|| served.lasting.lock().unwrap().get(&request.path).cloned())
        };
        if !matches!(fault, Some(Fault::ResetAfter(_))) {
            stream.read_exact(&mut [0])?;
        }
        if !answer(served, &mut stream, &request, fault.as_ref())? {
            return Ok(());
        }
    }
}

pub(crate) fn request_of(stream: &mut TcpStream) -> std::io::Result<Option<Request>> {
    let mut text = Vec::new();
    let mut byte = [0];
    // The last byte is left: a connection that ends with unread bytes is reset.
    while !text.ends_with(b"\r\n\r") {
        if stream.read(&mut byte)? == 0 {
            return Ok(None);
        }
        text.push(byte[0]);
    }
    let text = String::from_utf8(text).unwrap();
    let mut lines = text.lines();
    let path = lines.next().unwrap().split(' ').nth(1).unwrap().to_owned();
    let headers = lines.filter_map(|line| line.split_once(": "));
    let headers = headers.map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned()));
    Ok(Some(Request {
        path,
        headers: headers.collect(),
    }))
}

/// An answer without a body.
fn plain(status: u16, more: &str) -> String {
    format!("HTTP/1.1 {status} Status\r\ncontent-length: 0\r\n{more}connection: close\r\n\r\n")
}

/// Sends the answer of a fault without a file; whether it is one.
fn refusal(stream: &mut TcpStream, fault: Option<&Fault>) -> std::io::Result<bool> {
    let answer = match fault {
        Some(Fault::Status(status)) => plain(*status, ""),
        Some(Fault::RetryAfter(status, seconds)) => {
            plain(*status, &format!("retry-after: {seconds}\r\n"))
        }
        Some(Fault::Redirect(to)) => plain(302, &format!("location: {to}\r\n")),
        Some(Fault::Hangs) => {
            thread::sleep(Duration::from_secs(30));
            return Ok(true);
        }
        _ => return Ok(false),
    };
    stream.write_all(answer.as_bytes())?;
    Ok(true)
}

/// Sends an answer; whether the connection goes on.
fn answer(
    served: &Served,
    stream: &mut TcpStream,
    request: &Request,
    fault: Option<&Fault>,
) -> std::io::Result<bool> {
    if refusal(stream, fault)? {
        return Ok(false);
    }
    let path = served.root.join(request.path.trim_start_matches('/'));
    let content = if fault == Some(&Fault::Page) {
        b"<!DOCTYPE html><html><title>Please sign in</title></html>".to_vec()
    } else if let Some(Fault::Text(text)) = fault {
        text.clone().into_bytes()
    } else if path.is_dir() {
        listing(&path, served.listing).into_bytes()
    } else if let Ok(content) = fs::read(&path) {
        content
    } else {
        stream.write_all(plain(404, "").as_bytes())?;
        return Ok(false);
    };
    let etag = format!("\"{}\"", &blake3::hash(&content).to_hex()[..16]);
    if request.headers.get("if-none-match") == Some(&etag) {
        stream
            .write_all(format!("HTTP/1.1 304 Not Modified\r\netag: {etag}\r\n\r\n").as_bytes())?;
        return Ok(true);
    }
    let is_same = request
        .headers
        .get("if-range")
        .is_none_or(|known| *known == etag);
    let range = request.range();
    let range = range.filter(|_| is_same && fault != Some(&Fault::IgnoresRange));
    let from = range.map_or(0, |(first, _)| usize::try_from(first).unwrap());
    if from > 0 && from >= content.len() {
        stream.write_all(plain(416, "").as_bytes())?;
        return Ok(false);
    }
    let last = range.and_then(|(_, last)| usize::try_from(last?).ok());
    let end = last.map_or(content.len(), |last| content.len().min(last + 1));
    let mut body = content[from..end].to_vec();
    let mut announced = body.len();
    match fault {
        Some(Fault::WrongBytes) => body.iter_mut().for_each(|byte| *byte ^= 0x55),
        Some(Fault::Longer { is_announced }) => {
            body.extend([0; 100]);
            if *is_announced {
                announced = body.len();
            }
        }
        _ => {}
    }
    let stated = if fault == Some(&Fault::WrongRange) {
        from + 1
    } else {
        from
    };
    let mut head = if range.is_some() {
        format!(
            "HTTP/1.1 206 Partial\r\ncontent-range: bytes {stated}-{}/{}\r\n",
            end - 1,
            content.len()
        )
    } else {
        "HTTP/1.1 200 OK\r\n".to_owned()
    };
    head += "last-modified: Thu, 26 Feb 2009 17:19:00 GMT\r\n";
    if matches!(fault, Some(Fault::NoLength | Fault::NoEnd(_))) {
        write!(stream, "{head}etag: {etag}\r\nconnection: close\r\n\r\n")?;
    } else {
        write!(
            stream,
            "{head}etag: {etag}\r\ncontent-length: {announced}\r\n\r\n"
        )?;
    }
    send_body(served, stream, request, &body, fault)
}

/// Sends a body as its fault wants it; whether the connection goes on.
fn send_body(
    served: &Served,
    stream: &mut TcpStream,
    request: &Request,
    body: &[u8],
    fault: Option<&Fault>,
) -> std::io::Result<bool> {
    let mut send = |bytes: &[u8]| -> std::io::Result<()> {
        stream.write_all(bytes)?;
        *served
            .body_bytes
            .lock()
            .unwrap()
            .entry(request.path.clone())
            .or_default() += bytes.len() as u64;
        Ok(())
    };
    match fault {
        Some(Fault::ResetAfter(count)) => {
            send(&body[..body.len().min(*count)])?;
            // The bytes must be out before the connection breaks.
            thread::sleep(Duration::from_millis(30));
            return Ok(false);
        }
        Some(Fault::NoEnd(count)) => {
            send(&body[..body.len().min(*count)])?;
            return Ok(false);
        }
        Some(Fault::ShortBy(count)) => {
            send(&body[..body.len().saturating_sub(*count)])?;
            return Ok(false);
        }
        Some(Fault::Slow) => {
            for piece in body.chunks(4096) {
                send(piece)?;
                thread::sleep(Duration::from_millis(2));
            }
        }
        Some(Fault::NoLength | Fault::Longer { .. }) => {
            send(body)?;
            return Ok(false);
        }
        _ => send(body)?,
    }
    Ok(true)
}

/// A kernel of an archive: type, name, coverage (empty for texts), content.
pub(crate) type Kernel<'a> = (&'a str, &'a str, [&'a str; 2], Vec<u8>);

/// Writes a volume of kernels with index, label and checksums, as NAIF's archives have them.
pub(crate) fn write_kernels(root: &Path, kernels: &[Kernel<'_>]) {
    let (mut sums, mut rows) = (String::new(), String::new());
    for (kind, name, span, content) in kernels {
        let below = format!("data/{}/{name}", kind.to_lowercase());
        writeln!(sums, "{}  {below:44}\r", md5_of(content)).unwrap();
        write(&root.join("mgsp_1000").join(&below), content);
        let [start, stop] = span.map(|utc| match utc {
            "" => "\"N/A\"".to_owned(),
            utc => utc.to_owned(),
        });
        let label = format!(
            "data/{}/{}.lbl",
            kind.to_lowercase(),
            name.rsplit_once('.').unwrap().0
        );
        writeln!(
            rows,
            "{start:23},{stop:23},\"{label:40}\",\"{kind:4}\",\"{name:30}\"\r"
        )
        .unwrap();
    }
    let columns = [
        ("START_TIME", 1, 23),
        ("STOP_TIME", 25, 23),
        ("FILE_SPECIFICATION_NAME", 50, 40),
        ("KERNEL_TYPE_ID", 93, 4),
        ("PRODUCT_ID", 100, 30),
    ];
    let columns = columns.map(|(name, start, bytes)| {
        format!("OBJECT = COLUMN\r\nNAME = {name}\r\nSTART_BYTE = {start}\r\nBYTES = {bytes}\r\nEND_OBJECT = COLUMN\r\n")
    });
    let label = format!(
        "ROW_BYTES = {}\r\nROWS = {}\r\n{}END\r\n",
        rows.lines().next().unwrap().len() + 2,
        kernels.len(),
        columns.concat()
    );
    write(&root.join("dsindex.tab"), rows.as_bytes());
    write(&root.join("dsindex.lbl"), label.as_bytes());
    write(&root.join("mgsp_1000/index/checksum.tab"), sums.as_bytes());
}

/// MD5, hexadecimal.
pub(crate) fn md5_of(bytes: &[u8]) -> String {
    let digest = Md5::digest(bytes);
    digest.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

/// Writes a file, and its folders.
pub(crate) fn write(path: &Path, content: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, content).unwrap();
}

fn listing(folder: &Path, form: Listing) -> String {
    let mut names: Vec<(String, u64)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let entry = entry.unwrap();
            let metadata = entry.metadata().unwrap();
            let slash = if metadata.is_dir() { "/" } else { "" };
            let name = entry.file_name().into_string().unwrap();
            (format!("{name}{slash}"), metadata.len())
        })
        .collect();
    names.sort();
    let rows = names.iter().map(|(name, bytes)| match form {
        Listing::Plain => format!("<a href=\"{name}\">{name}</a>   26-Feb-2009 17:19  {bytes}\n"),
        Listing::Table => format!(
            "<tr><td><a href=\"{name}\">{name}</a></td><td align=\"right\">2009-02-26 17:19  </td>\
             <td align=\"right\">{:.1}K</td></tr>\n",
            *bytes as f64 / 1024.0
        ),
    });
    let rows: String = rows.collect();
    format!("<html><body><a href=\"../\">Parent Directory</a>\n{rows}</body></html>")
}
