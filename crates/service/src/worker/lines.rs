//! Lines of a worker, of bounded length, with pieces joined.

use tokio::io::{AsyncBufRead, AsyncBufReadExt as _};

use super::protocol::{ANSWER_MAX, LINE_MAX, Line};

/// Invalid output of a worker.
#[derive(Debug, thiserror::Error)]
pub(super) enum Garbled {
    /// A line that is too long.
    #[error("a line of more than {LINE_MAX} bytes")]
    LongLine,
    /// Pieces that are too long.
    #[error("an answer of more than {ANSWER_MAX} bytes")]
    LongAnswer,
    /// Not a line of the protocol.
    #[error("not a line of a worker: {0}")]
    NoLine(serde_json::Error),
    /// The pipe broke.
    #[error("the lines cannot be read: {0}")]
    Io(#[from] std::io::Error),
}

/// Reads lines from a worker's output.
pub(super) struct LineReader<R> {
    input: R,
    line: Vec<u8>,
    pieces: String,
}

impl<R: AsyncBufRead + Unpin> LineReader<R> {
    pub(super) fn new(input: R) -> Self {
        Self {
            input,
            line: Vec::new(),
            pieces: String::new(),
        }
    }

    /// The next line; `None` at the end, where an incomplete line is ignored. Bytes already read are kept if the future
    /// is dropped.
    pub(super) async fn next(&mut self) -> Result<Option<Line>, Garbled> {
        loop {
            if !self.read_line().await? {
                return Ok(None);
            }
            let line = serde_json::from_slice(&self.line).map_err(Garbled::NoLine);
            self.line.clear();
            let (text, more) = match line? {
                Line::Piece { text, more } => (text, more),
                line => return Ok(Some(line)),
            };
            self.pieces.push_str(&text);
            if self.pieces.len() > ANSWER_MAX {
                return Err(Garbled::LongAnswer);
            }
            if !more {
                let whole = serde_json::from_str(&self.pieces).map_err(Garbled::NoLine);
                self.pieces.clear();
                return whole.map(Some);
            }
        }
    }

    /// Fills `line` up to a line's end; false at the end of the input.
    async fn read_line(&mut self) -> Result<bool, Garbled> {
        loop {
            let buffer = self.input.fill_buf().await?;
            if buffer.is_empty() {
                return Ok(false);
            }
            let end = buffer.iter().position(|byte| *byte == b'\n');
            let taken = end.map_or(buffer.len(), |end| end + 1);
            self.line.extend_from_slice(&buffer[..taken]);
            self.input.consume(taken);
            if self.line.len() > LINE_MAX {
                return Err(Garbled::LongLine);
            }
            if end.is_some() {
                return Ok(true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn all(text: &str) -> (Vec<Line>, Option<String>) {
        let mut reader = LineReader::new(text.as_bytes());
        let mut lines = Vec::new();
        loop {
            match reader.next().await {
                Ok(Some(line)) => lines.push(line),
                Ok(None) => return (lines, None),
                Err(garbled) => return (lines, Some(garbled.to_string())),
            }
        }
    }

    #[tokio::test]
    async fn pieces_are_joined_and_nonsense_is_told() {
        let beat = r#"{"line":"beat","rss_kib":5,"unknown":1}"#;
        let expected = Line::Beat { rss_kib: 5 };
        let piece = |text: &str, more: bool| {
            let text = text.to_owned();
            serde_json::to_string(&Line::Piece { text, more }).unwrap()
        };
        let text = format!(
            "{beat}\n{}\n{}\n{beat}",
            piece(&beat[..9], true),
            piece(&beat[9..], false)
        );
        // The last line has no end.
        assert_eq!(all(&text).await, (vec![expected.clone(), expected], None));
        let refused = all("CSPICE says hello\n").await.1.unwrap();
        assert!(refused.starts_with("not a line of a worker"), "{refused}");
        let long = "x".repeat(LINE_MAX + 1);
        assert!(
            all(&long)
                .await
                .1
                .unwrap()
                .starts_with("a line of more than")
        );
        let endless =
            format!("{}\n", piece(&"y".repeat(60_000), true)).repeat(ANSWER_MAX / 60_000 + 2);
        assert!(
            all(&endless)
                .await
                .1
                .unwrap()
                .starts_with("an answer of more than")
        );
    }
}
