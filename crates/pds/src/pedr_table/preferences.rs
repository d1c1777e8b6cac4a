//! `PEDR2TAB.PRM`: columns and shots to write, read like Fortran lists.

/// Preferences of a table, with the program's defaults.
#[derive(Debug, Clone, PartialEq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "the switches of the program's file"
)]
pub struct Preferences {
    /// Two lines of headings.
    pub headings: bool,
    /// Groups of columns.
    pub groups: [bool; 8],
    /// Whether the areographic latitude is computed; read with the groups.
    pub areographic: bool,
    /// All shots, of any class.
    pub all_classes: bool,
    /// Ground returns, else clouds and noise.
    pub ground: bool,
    /// Whether crossover residuals are subtracted.
    pub crossover: bool,
    /// One table of all files.
    pub one_table: bool,
    /// Name of that table; else the extension of each file's own table.
    pub table_name: String,
    /// East longitudes of mid-points, degrees.
    pub longitude_deg: [f64; 2],
    /// Areocentric latitudes of mid-points, degrees.
    pub latitude_deg: [f64; 2],
    /// `(a/c)²` of areographic latitudes.
    pub axes_squared: f64,
    /// Location and reason of a premature end of reading.
    pub ended: Option<Ended>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            headings: true,
            groups: [true, false, false, false, false, false, false, false],
            areographic: false,
            all_classes: false,
            ground: true,
            crossover: true,
            one_table: false,
            table_name: "MOLA.TAB".to_owned(),
            longitude_deg: [-360.0, 360.0],
            latitude_deg: [-90.0, 90.0],
            // A figure of the Viking maps.
            axes_squared: (3393.4_f64 / 3375.73).powi(2),
            ended: None,
        }
    }
}

/// Longest name that the program stores.
const NAME_MAX: usize = 64;

impl Preferences {
    /// Parses preferences. As in the program, reading ends at a missing or invalid value: the following ones keep their
    /// defaults.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        let mut preferences = Self::default();
        preferences.ended = preferences.read(&mut Lines::of(text)).err();
        preferences
    }

    fn read(&mut self, lines: &mut Lines<'_>) -> Result<(), Ended> {
        lines.logical(&mut self.headings)?;
        for group in &mut self.groups {
            lines.logical(group)?;
        }
        self.areographic = self.groups[2];
        lines.logical(&mut self.all_classes)?;
        lines.logical(&mut self.ground)?;
        lines.logical(&mut self.crossover)?;
        lines.statement();
        self.one_table = lines.value(SWITCH, logical)?.unwrap_or(self.one_table);
        let name = |item: &Item| Some(item.text.chars().take(NAME_MAX).collect());
        if let Some(name) = lines.value("the name of a table", name)? {
            self.table_name = name;
        }
        for limit in self.longitude_deg.iter_mut().chain(&mut self.latitude_deg) {
            lines.statement();
            *limit = lines.value(DEGREES, real)?.unwrap_or(*limit);
        }
        lines.statement();
        let inverse_flattening = lines.value("the inverse flattening", real)?.unwrap_or(0.0);
        let axes = 1.0 - 1.0 / inverse_flattening;
        self.axes_squared = 1.0 / (axes * axes);
        Ok(())
    }
}

/// The end of the file, or a value of another type than the program reads.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Ended {
    /// No value is left.
    #[error("ends after line {0}; expected {1}")]
    Early(usize, &'static str),
    /// Another kind of value.
    #[error("line {line} contains {found:?}; expected {expected}")]
    Value {
        /// Line of the file, counted from 1.
        line: usize,
        /// Text found.
        found: String,
        /// Expected type.
        expected: &'static str,
    },
}

/// Types that the program reads.
const SWITCH: &str = "T or F";
const DEGREES: &str = "a number of degrees";

/// One value of a list.
struct Item {
    text: String,
}

/// `T`, `F`, `.TRUE.`, `false` and the like: the first letter, after an optional point, decides.
fn logical(item: &Item) -> Option<bool> {
    let word = item.text.strip_prefix('.').unwrap_or(&item.text);
    match word.chars().next()? {
        'T' | 't' => Some(true),
        'F' | 'f' => Some(false),
        _ => None,
    }
}

/// A number, its exponent after `E`, `D` or `Q`.
fn real(item: &Item) -> Option<f64> {
    let plain = item.text.to_ascii_lowercase().replace(['d', 'q'], "e");
    // Rust also parses words as numbers.
    let numeric = plain
        .chars()
        .all(|c| c.is_ascii_digit() || "+-.e".contains(c));
    numeric.then(|| plain.parse().ok()).flatten()
}

/// The records of the file. A read statement starts with the next record, and continues with further ones until it has
/// its values.
struct Lines<'a> {
    lines: std::str::Lines<'a>,
    /// Number of the record that was read last.
    line: usize,
    rest: &'a str,
    /// A slash ended the statement: the remaining variables keep their values.
    ended: bool,
    /// Remaining repetitions of the last value.
    repeated: usize,
    last: Option<String>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        Self {
            lines: text.lines(),
            line: 0,
            rest: "",
            ended: false,
            repeated: 0,
            last: None,
        }
    }

    /// Begins a read statement with the next record.
    fn statement(&mut self) {
        self.rest = "";
        self.ended = false;
        self.repeated = 0;
    }

    fn logical(&mut self, value: &mut bool) -> Result<(), Ended> {
        self.statement();
        *value = self.value(SWITCH, logical)?.unwrap_or(*value);
        Ok(())
    }

    /// The next value, `None` for an empty one; an error at the end of the file or for a value of a different kind.
    fn value<T>(
        &mut self,
        expected: &'static str,
        read: impl Fn(&Item) -> Option<T>,
    ) -> Result<Option<T>, Ended> {
        if self.ended {
            return Ok(None);
        }
        if self.repeated == 0 {
            self.last = None;
            self.next_item().ok_or_else(|| self.ended_at(expected))?;
        }
        if self.ended {
            return Ok(None);
        }
        self.repeated -= 1;
        match self.last.clone() {
            None => Ok(None),
            Some(text) => {
                let value = read(&Item { text });
                value.map(Some).ok_or_else(|| self.ended_at(expected))
            }
        }
    }

    /// Ends reading at the last value, or at the rest of the line.
    fn ended_at(&self, expected: &'static str) -> Ended {
        let line = self.line;
        let rest = self.last.as_deref().unwrap_or(self.rest.trim());
        if rest.is_empty() {
            return Ended::Early(line, expected);
        }
        Ended::Value {
            line,
            found: rest.to_owned(),
            expected,
        }
    }

    /// Reads `value`, `n*value`, an empty value or the slash; blanks and one comma separate.
    fn next_item(&mut self) -> Option<()> {
        loop {
            self.rest = self.rest.trim_start_matches([' ', '\t', '\r']);
            if !self.rest.is_empty() {
                break;
            }
            self.rest = self.lines.next()?;
            self.line += 1;
        }
        self.repeated = 1;
        if self.rest.starts_with('/') {
            self.ended = true;
            return Some(());
        }
        let digits = self.rest.len()
            - self
                .rest
                .trim_start_matches(|c: char| c.is_ascii_digit())
                .len();
        if digits > 0 && self.rest[digits..].starts_with('*') {
            self.repeated = self.rest[..digits].parse().ok().filter(|n| *n > 0)?;
            self.rest = &self.rest[digits + 1..];
        }
        let quote = self.rest.chars().next().filter(|c| matches!(c, '\'' | '"'));
        self.last = if let Some(quote) = quote {
            Some(self.quoted(quote)?)
        } else {
            let end = self.rest.find([' ', '\t', ',', '/', '\r']);
            let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
            self.rest = rest;
            (!word.is_empty()).then(|| word.to_owned())
        };
        self.rest = self.rest.trim_start_matches([' ', '\t', '\r']);
        self.rest = self.rest.strip_prefix(',').unwrap_or(self.rest);
        Some(())
    }

    /// A quoted text, in which a doubled quote stands for one.
    fn quoted(&mut self, quote: char) -> Option<String> {
        let mut text = String::new();
        let mut rest = &self.rest[1..];
        loop {
            let end = rest.find(quote)?;
            text.push_str(&rest[..end]);
            rest = &rest[end + 1..];
            match rest.strip_prefix(quote) {
                Some(more) => {
                    text.push(quote);
                    rest = more;
                }
                None => break,
            }
        }
        self.rest = rest;
        Some(text)
    }
}
