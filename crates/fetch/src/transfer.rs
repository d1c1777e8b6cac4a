//! One file: requested, resumed, verified, and given its name.

use std::{
    fs,
    io::{ErrorKind, Read as _},
    path::{Path, PathBuf},
    sync::{
        atomic::AtomicBool,
        mpsc::{RecvTimeoutError, sync_channel},
    },
    thread,
    time::{Duration, Instant},
};

use crate::{
    archives::Network,
    client::{Answer, Ask, Client, Fault, Reply},
    error::FetchError,
    hashed::Hashed,
    page::{excerpt, is_page},
    part::{Meta, Part},
};
use areograph_base::error::{Error, IoError, Locate as _, Result, Stopped};
use areograph_store::{
    atomic::{sync_file, sync_folder},
    files::StagedFile,
};

/// Bytes that are read at a time.
const CHUNK: usize = 1 << 16;
/// Time between checks for an interrupt by the user during a wait.
const LOOK: Duration = Duration::from_millis(50);
/// A file to receive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted<'a> {
    pub(crate) url: &'a str,
    pub(crate) path: &'a Path,
    /// MD5 by the archive, hexadecimal.
    pub(crate) md5: Option<&'a str>,
    /// Size by the archive, to the byte.
    pub(crate) bytes: Option<u64>,
    /// Whether the file is a web page.
    pub(crate) is_page: bool,
    /// Whether it may take the place of another file.
    pub(crate) replace: bool,
}

/// Receiver of files.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Receiver<'a> {
    pub(crate) client: &'a Client,
    pub(crate) network: &'a Network,
    pub(crate) stop: &'a AtomicBool,
}

impl Receiver<'_> {
    /// Receives the complete file into its part and verifies it; it does not have its name yet.
    ///
    /// # Errors
    /// [`FetchError`]; [`Stopped`]; the folder cannot be written. The part is kept where its bytes may be continued.
    pub(crate) fn receive(&self, wanted: &Wanted<'_>, part: &mut Part) -> Result<Hashed> {
        let (mut failed, mut was_wrong) = (0, false);
        loop {
            Stopped::check(self.stop)?;
            let before = part.bytes();
            match self.attempt(wanted, part) {
                Ok(()) => match verified(wanted, part) {
                    Ok(hashed) => return Ok(hashed),
                    // Once more from the first byte: what was resumed may be the bytes of two files.
                    Err(failure) => {
                        part.discard()?;
                        if was_wrong {
                            return Err(failure);
                        }
                        was_wrong = true;
                    }
                },
                Err(Fault::Lasting(failure)) => return Err(failure),
                Err(Fault::Passing(problem, asked)) => {
                    failed = if part.bytes() > before { 1 } else { failed + 1 };
                    self.pause(wanted.url, problem, asked, failed)?;
                }
            }
        }
    }

    /// Waits before another attempt.
    ///
    /// * `failed` – attempts without progress so far
    pub(crate) fn pause(
        &self,
        url: &str,
        problem: String,
        asked: Option<Duration>,
        failed: u32,
    ) -> Result<()> {
        if failed >= self.network.attempts {
            let url = url.to_owned();
            let attempts = failed;
            return Err(FetchError::Network {
                url,
                problem,
                attempts,
            }
            .into());
        }
        let spread = f64::from(url.bytes().fold(0_u8, u8::wrapping_add)) / 255.0;
        let pause = self.network.pause(failed, asked, spread);
        tracing::info!("{url}: {problem}; again in {:.1} s", pause.as_secs_f64());
        Ok(self.wait(pause)?)
    }

    /// The answer of a service, as a text.
    ///
    /// * `limit` – longest time without a byte: a service answers when its work is done
    ///
    /// # Errors
    /// [`FetchError`]; [`Stopped`].
    pub(crate) fn text(&self, url: &str, limit: Duration) -> Result<String> {
        self.text_as(url, limit, false)
    }

    /// The listing of a folder: as [`text`](Self::text), and one without a recognisable end is not taken for complete.
    pub(crate) fn page(&self, url: &str, limit: Duration) -> Result<String> {
        self.text_as(url, limit, true)
    }

    fn text_as(&self, url: &str, limit: Duration, is_page: bool) -> Result<String> {
        let mut failed = 0;
        loop {
            Stopped::check(self.stop)?;
            match self.answer(url, limit, is_page)? {
                Ok(text) => return Ok(text),
                Err(Fault::Lasting(failure)) => return Err(failure),
                Err(Fault::Passing(problem, asked)) => {
                    failed += 1;
                    self.pause(url, problem, asked, failed)?;
                }
            }
        }
    }

    /// One request for a text. An interrupt by the user does not wait for the service.
    fn answer(
        &self,
        url: &str,
        limit: Duration,
        is_page: bool,
    ) -> std::result::Result<std::result::Result<String, Fault>, Stopped> {
        let (send, answer) = sync_channel(1);
        let (client, url) = (self.client.clone(), url.to_owned());
        thread::spawn(move || {
            let ask = Ask {
                limit: Some(limit),
                ..Ask::default()
            };
            let text = client.get(&url, ask).and_then(|reply| reply.text(is_page));
            // Nothing waits for it after a stop.
            let _ = send.send(text);
        });
        loop {
            Stopped::check(self.stop)?;
            match answer.recv_timeout(LOOK) {
                Ok(text) => return Ok(text),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Err(Fault::Passing("no answer".to_owned(), None)));
                }
            }
        }
    }

    fn wait(&self, pause: Duration) -> std::result::Result<(), Stopped> {
        let until = Instant::now() + pause;
        while let Some(left) = until.checked_duration_since(Instant::now()) {
            Stopped::check(self.stop)?;
            thread::sleep(left.min(LOOK));
        }
        Ok(())
    }

    /// One request, and its body into the part.
    fn attempt(&self, wanted: &Wanted<'_>, part: &mut Part) -> std::result::Result<(), Fault> {
        let from = part.bytes();
        if from > 0 && part.meta.length == Some(from) {
            return Ok(());
        }
        let validator = part.meta.validator().map(str::to_owned);
        let ask = Ask {
            from: if validator.is_some() { from } else { 0 },
            validator: validator.as_deref(),
            ..Ask::default()
        };
        match self.client.get(wanted.url, ask)? {
            Reply::Body(answer) => self.take(wanted, part, answer),
            Reply::Unchanged | Reply::OtherFile => {
                part.discard()?;
                Err(Fault::Passing(
                    "the partial file belongs to a different file".to_owned(),
                    None,
                ))
            }
        }
    }

    fn take(
        &self,
        wanted: &Wanted<'_>,
        part: &mut Part,
        answer: Answer,
    ) -> std::result::Result<(), Fault> {
        let content = |problem: String| {
            let url = wanted.url.to_owned();
            Fault::from(FetchError::Content { url, problem })
        };
        let Answer {
            is_rest,
            meta,
            is_delimited,
            mut body,
        } = answer;
        let length = match (is_rest, meta.length, part.meta.length) {
            (true, Some(now), Some(then)) if now != then => {
                part.discard()?;
                let problem = format!("the file had {then} bytes, and now has {now}");
                return Err(Fault::Passing(problem, None));
            }
            (true, now, then) => now.or(then),
            (false, now, _) => now,
        };
        match (length, wanted.bytes) {
            (Some(length), Some(expected)) if length != expected => {
                return Err(content(format!(
                    "{length} bytes; expected {expected} according to the index"
                )));
            }
            (None, None) if !is_delimited && wanted.md5.is_none() => {
                let problem = "neither server nor archive states a size or checksum: the file cannot be verified as complete";
                return Err(content(problem.to_owned()));
            }
            _ => {}
        }
        let length = length.or(wanted.bytes);
        if !is_rest {
            part.restart(meta)?;
        }
        let mut writer = part.continued()?;
        let mut buffer = vec![0; CHUNK];
        loop {
            Stopped::check(self.stop)?;
            let count = match body.read(&mut buffer) {
                Ok(0) => break,
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => {
                    let problem = format!("{error} after {} bytes", writer.bytes);
                    return Err(Fault::Passing(problem, None));
                }
            };
            if writer.bytes == 0 && !wanted.is_page && is_page(&buffer[..count]) {
                drop(writer);
                part.discard()?;
                let page = excerpt(&String::from_utf8_lossy(&buffer[..count]));
                let problem = format!("a web page was received instead of the file: {page}");
                return Err(content(problem));
            }
            let written = writer.write(&buffer[..count]);
            written.map_err(IoError::on("write")).in_file(wanted.path)?;
            if length.is_some_and(|length| writer.bytes > length) {
                part.discard()?;
                return Err(Fault::Passing(
                    "more bytes were received than announced".to_owned(),
                    None,
                ));
            }
        }
        match length {
            Some(length) if writer.bytes < length => {
                let problem = format!(
                    "the transfer ended after {} of {length} bytes",
                    writer.bytes
                );
                Err(Fault::Passing(problem, None))
            }
            _ => Ok(()),
        }
    }
}

/// The identity of the part, if it matches the wanted file.
fn verified(wanted: &Wanted<'_>, part: &mut Part) -> Result<Hashed> {
    let hashed = Hashed::of(part.path())?;
    let wrong = |problem: String| {
        let url = wanted.url.to_owned();
        Error::from(FetchError::Content { url, problem })
    };
    let length = part.meta.length.or(wanted.bytes);
    if let Some(length) = length.filter(|length| *length != hashed.bytes) {
        return Err(wrong(format!("{} bytes; expected {length}", hashed.bytes)));
    }
    let stated = [wanted.md5, part.meta.md5.as_deref()];
    for md5 in stated.into_iter().flatten() {
        if !md5.eq_ignore_ascii_case(&hashed.md5) {
            return Err(wrong(format!(
                "MD5 of {} bytes is {}; expected {md5}",
                hashed.bytes, hashed.md5
            )));
        }
    }
    part.note_verified(&hashed.sha256)?;
    Ok(hashed)
}

/// Gives a verified part its name.
///
/// # Errors
/// [`FetchError::Conflict`] where another file has the name; the folder cannot be written.
pub(crate) fn publish(wanted: &Wanted<'_>, part: &mut Part, hashed: &Hashed) -> Result<()> {
    let path = wanted.path;
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .map_err(IoError::on("create the folder"))
        .in_file(folder)?;
    if !wanted.replace && path.symlink_metadata().is_ok() && Hashed::of(path)? != *hashed {
        let problem = format!("the received file has {} bytes", hashed.bytes);
        return Err(FetchError::Conflict { problem }).in_file(path);
    }
    sync_file(part.path())?;
    match fs::rename(part.path(), path) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::CrossesDevices => copied(part.path(), path)?,
        Err(error) => return Err(IoError::on("rename into place")(error)).in_file(path),
    }
    sync_folder(folder);
    Ok(())
}

/// A file system further: a copy beside the final name, and then renamed.
fn copied(from: &Path, path: &Path) -> Result<()> {
    let staged = StagedFile::create(path)?;
    let copy = || {
        let mut from = fs::File::open(from)?;
        std::io::copy(
            &mut from,
            &mut staged
                .writer()
                .map_err(|failure| std::io::Error::other(failure.to_string()))?,
        )
    };
    copy().map_err(IoError::on("write")).in_file(path)?;
    staged.finish()
}

/// Brings the copy of an index up to date.
///
/// # Errors
/// As [`Receiver::receive`].
pub(crate) fn refresh(
    receiver: &Receiver<'_>,
    url: &str,
    path: &Path,
    is_page: bool,
) -> Result<bool> {
    let known_path: PathBuf = path.with_file_name(format!(
        "{}.known",
        path.file_name().unwrap_or_default().to_string_lossy()
    ));
    let known: Option<Meta> = fs::read(&known_path)
        .ok()
        .filter(|_| path.is_file())
        .and_then(|text| serde_json::from_slice(&text).ok())
        .filter(|known: &Meta| known.url == url && known.validator().is_some());
    if let Some(known) = &known {
        let ask = Ask {
            known: Some(known),
            ..Ask::default()
        };
        if let Ok(Reply::Unchanged) = receiver.client.get(url, ask) {
            return Ok(false);
        }
    }
    let wanted = Wanted {
        url,
        path,
        md5: None,
        bytes: None,
        is_page,
        replace: true,
    };
    let mut part = Part::at(path.with_extension("part"), url);
    let hashed = receiver.receive(&wanted, &mut part)?;
    let meta = serde_json::to_vec(&part.meta).unwrap_or_default();
    publish(&wanted, &mut part, &hashed)?;
    part.discard()?;
    areograph_store::atomic::write(&known_path, &meta)?;
    Ok(true)
}
