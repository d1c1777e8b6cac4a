//! Assignments of NAIF text kernels.
//!
//! Source: NAIF, Kernel Required Reading: data blocks between `\begindata` and `\begintext`,
//! `NAME = value`, `NAME = ( value, value … )`, `+=` appends, `''` is a quote inside a string.

use super::error::SpiceError;

/// One assignment.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Assignment {
    /// Variable.
    pub(super) name: String,
    /// Whether `+=` was written.
    pub(super) append: bool,
    /// Values in order.
    pub(super) values: Vec<Value>,
}

/// A value of an assignment.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// A quoted string.
    Text(String),
    /// A number or a date, as written.
    Plain(String),
}

impl Value {
    /// The number, Fortran's `D` exponent included.
    pub(super) fn number(&self) -> Option<f64> {
        match self {
            Self::Plain(text) => text.replace(['d', 'D'], "e").parse().ok(),
            Self::Text(_) => None,
        }
    }
}

/// All values of `name`, appended ones included.
pub(super) fn values_of<'a>(assignments: &'a [Assignment], name: &str) -> Vec<&'a Value> {
    let mut values = Vec::new();
    for assignment in assignments.iter().filter(|found| found.name == name) {
        if !assignment.append {
            values.clear();
        }
        values.extend(&assignment.values);
    }
    values
}

/// All assignments of a text kernel.
///
/// # Errors
/// [`SpiceError::TextKernel`] with the malformed line.
pub(super) fn assignments(text: &str) -> Result<Vec<Assignment>, SpiceError> {
    let mut tokens = tokens(text)?.into_iter().peekable();
    let mut found = Vec::new();
    while let Some((line, token)) = tokens.next() {
        let Token::Word(name) = token else {
            return Err(fault(line, format!("found {token:?}; expected a name")));
        };
        let append = match tokens.next() {
            Some((_, Token::Equals)) => false,
            Some((_, Token::PlusEquals)) => true,
            _ => return Err(fault(line, format!("no '=' or '+=' after {name}"))),
        };
        let mut values = Vec::new();
        match tokens.next() {
            Some((_, Token::Word(word))) => values.push(Value::Plain(word)),
            Some((_, Token::Text(text))) => values.push(Value::Text(text)),
            Some((_, Token::Open)) => loop {
                match tokens.next() {
                    Some((_, Token::Word(word))) => values.push(Value::Plain(word)),
                    Some((_, Token::Text(text))) => values.push(Value::Text(text)),
                    Some((_, Token::Close)) => break,
                    _ => {
                        return Err(fault(
                            line,
                            format!("the list of {name} is not closed by ')'"),
                        ));
                    }
                }
            },
            _ => return Err(fault(line, format!("no value for {name}"))),
        }
        found.push(Assignment {
            name,
            append,
            values,
        });
    }
    Ok(found)
}

#[derive(Debug, PartialEq)]
enum Token {
    Word(String),
    Text(String),
    Open,
    Close,
    Equals,
    PlusEquals,
}

fn tokens(text: &str) -> Result<Vec<(usize, Token)>, SpiceError> {
    let mut found = Vec::new();
    let mut inside_data = false;
    for (index, line) in text.lines().enumerate() {
        match line.trim() {
            "\\begindata" => inside_data = true,
            "\\begintext" => inside_data = false,
            content if inside_data => line_tokens(index + 1, content, &mut found)?,
            _ => {}
        }
    }
    Ok(found)
}

fn line_tokens(
    line: usize,
    content: &str,
    found: &mut Vec<(usize, Token)>,
) -> Result<(), SpiceError> {
    let mut rest = content.trim_start();
    while let Some(first) = rest.chars().next() {
        let (token, used) = match first {
            '(' => (Token::Open, 1),
            ')' => (Token::Close, 1),
            '=' => (Token::Equals, 1),
            '\'' => quoted(line, rest)?,
            _ if rest.starts_with("+=") => (Token::PlusEquals, 2),
            _ => word(rest),
        };
        found.push((line, token));
        rest = rest[used..].trim_start_matches(|next: char| next.is_whitespace() || next == ',');
    }
    Ok(())
}

/// A quoted string at the start of `rest`, and its length in bytes.
fn quoted(line: usize, rest: &str) -> Result<(Token, usize), SpiceError> {
    let mut text = String::new();
    let mut position = 1;
    while let Some(length) = rest[position..].find('\'') {
        text.push_str(&rest[position..position + length]);
        position += length + 1;
        if !rest[position..].starts_with('\'') {
            return Ok((Token::Text(text), position));
        }
        text.push('\'');
        position += 1;
    }
    Err(fault(
        line,
        "string without a closing quote on the same line".to_owned(),
    ))
}

/// A name or number at the start of `rest`, and its length in bytes.
fn word(rest: &str) -> (Token, usize) {
    let end = rest
        .find(|next: char| next.is_whitespace() || "(),='".contains(next))
        .unwrap_or(rest.len());
    // `NAME+=` without a space between.
    let name_only = rest[..end]
        .strip_suffix('+')
        .filter(|_| rest[end..].starts_with('='));
    // A lone comma is not a name; one byte is consumed so that reading continues.
    let end = name_only.map_or(end, str::len).max(1);
    (Token::Word(rest[..end].to_owned()), end)
}

fn fault(line: usize, problem: String) -> SpiceError {
    SpiceError::TextKernel { line, problem }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lists_strings_and_appended_values_are_read() {
        let text = "KPL/MK\nA = 1 is no data\n\\begindata\n  A = ( 'it''s', -1.5D+01\n 'two' )\n\
                    A+= 'three' B += @2001-JAN-01\n\\begintext\nB = 7\n";
        let found = assignments(text).unwrap();
        let a: Vec<Value> = values_of(&found, "A").into_iter().cloned().collect();
        assert_eq!(
            a,
            [
                Value::Text("it's".into()),
                Value::Plain("-1.5D+01".into()),
                Value::Text("two".into()),
                Value::Text("three".into())
            ]
        );
        assert!((a[1].number().unwrap() + 15.0).abs() < 1e-12);
        assert_eq!(values_of(&found, "B").len(), 1);
    }

    #[test]
    fn broken_lines_are_named() {
        for (text, expected) in [
            (
                "\\begindata\nA = 'x",
                "line 2: string without a closing quote on the same line",
            ),
            (
                "\\begindata\n\nA = ( 1",
                "line 3: the list of A is not closed by ')'",
            ),
            ("\\begindata\nA 1", "line 2: no '=' or '+=' after A"),
            ("\\begindata\nA =", "line 2: no value for A"),
        ] {
            assert_eq!(assignments(text).unwrap_err().to_string(), expected);
        }
    }

    proptest! {
        #[test]
        fn any_text_ends_in_a_result(text in "(\\\\begindata\n)?([A-Z'(),=+ \n\u{e9}]{0,80})") {
            let _ = assignments(&text);
        }
    }
}
