//! Words, values and lines of a label.

/// Characters of a line that are kept.
const UNREAD_CHARACTERS: usize = 80;

/// Scans the bytes of a label; every step advances.
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
    /// Start of the latest word.
    pub(super) word_at: usize,
}

impl<'a> Scanner<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            word_at: 0,
        }
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    pub(super) fn take(&mut self, required: u8) -> bool {
        self.skip_space();
        let found = self.peek() == Some(required);
        self.at += usize::from(found);
        found
    }

    pub(super) fn skip_line(&mut self) {
        let rest = &self.bytes[self.at.min(self.bytes.len())..];
        self.at += rest
            .iter()
            .position(|byte| matches!(byte, b'\n' | b'\r'))
            .unwrap_or(rest.len());
    }

    /// The number of the line with the byte `at`, from 1, and its text from there on, shortened.
    pub(super) fn line_at(&self, at: usize) -> (usize, String) {
        let (before, rest) = self.bytes.split_at(at.min(self.bytes.len()));
        let ends = |byte: &u8| matches!(byte, b'\n' | b'\r');
        let length = rest.iter().position(ends).unwrap_or(rest.len());
        let text = String::from_utf8_lossy(&rest[..length]);
        let line = before.split(|byte| *byte == b'\n').count();
        (line, text.chars().take(UNREAD_CHARACTERS).collect())
    }

    /// Skips white space, `/* … */` and `# …` comments.
    fn skip_space(&mut self) {
        while let Some(byte) = self.peek() {
            if byte.is_ascii_whitespace() || byte == 0 {
                self.at += 1;
            } else if byte == b'#' {
                self.skip_line();
            } else if self.bytes[self.at..].starts_with(b"/*") {
                // Comments end with their line, closed or not.
                let rest = &self.bytes[self.at..];
                let line = rest.split(|byte| *byte == b'\n').next().unwrap_or(rest);
                let end = line.windows(2).position(|pair| pair == b"*/");
                self.at += end.map_or(line.len(), |end| end + 2);
            } else {
                break;
            }
        }
    }

    /// The next run of bytes up to white space or `=`; `None` at the end.
    pub(super) fn word(&mut self) -> Option<String> {
        self.skip_space();
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let stops = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'=';
        // A lone "=" is a word, so that invalid text cannot stop the scan.
        let length = rest.iter().position(stops).unwrap_or(rest.len()).max(1);
        let word = String::from_utf8_lossy(&rest[..length]).into_owned();
        self.word_at = self.at;
        self.at += length;
        Some(word)
    }

    /// A value and its unit.
    pub(super) fn value(&mut self) -> (String, Option<String>) {
        self.skip_space();
        let value = match self.peek() {
            Some(quote @ (b'"' | b'\'')) => self.enclosed(quote),
            Some(b'(') => self.enclosed(b')'),
            Some(b'{') => self.enclosed(b'}'),
            Some(_) => self.bare(),
            None => String::new(),
        };
        while matches!(self.peek(), Some(b' ' | b'\t')) {
            self.at += 1;
        }
        let unit = (self.peek() == Some(b'<')).then(|| self.enclosed(b'>').to_ascii_lowercase());
        (value, unit)
    }

    /// The text between the byte here and the next `close`, which may be on a later line.
    fn enclosed(&mut self, close: u8) -> String {
        let rest = &self.bytes[self.at + 1..];
        let length = rest.iter().position(|byte| *byte == close);
        let inside = &rest[..length.unwrap_or(rest.len())];
        self.at += 1 + inside.len() + usize::from(length.is_some());
        let text = String::from_utf8_lossy(inside);
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// A value without quotes: up to white space or a unit, on this line.
    fn bare(&mut self) -> String {
        let rest = &self.bytes[self.at..];
        let stops = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'<';
        let length = rest.iter().position(stops).unwrap_or(rest.len());
        self.at += length;
        String::from_utf8_lossy(&rest[..length]).into_owned()
    }
}
