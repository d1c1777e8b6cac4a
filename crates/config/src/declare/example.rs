//! The example file, which is the documentation of all keys.

use toml::Value;

use super::described::{Accept, DescribedKey, DescribedTable, Example, ValueKind};

/// The text of the example file for `file`, the table that is the file itself, below `header`.
pub(crate) fn example(header: &str, file: &DescribedTable) -> String {
    let mut text = header.to_owned();
    keys(file, 0, &mut text);
    for below in &file.tables {
        table(below, &mut text);
    }
    text
}

/// A table, and those below it after its keys.
fn table(described: &DescribedTable, text: &mut String) {
    let examples = described.keys.iter().flat_map(|key| &key.examples);
    let entries = examples.map(|example| example.entry).max().unwrap_or(0) + 1;
    for entry in 0..entries {
        text.push('\n');
        let further = described.many.map(|many| many.further).unwrap_or_default();
        match entry.checked_sub(1) {
            None => comment(described.about, text),
            Some(before) => comment(further.get(before).copied().unwrap_or_default(), text),
        }
        let header = match described.many {
            None => format!("[{}]", described.path),
            Some(_) => format!("[[{}]]", described.path),
        };
        let used = described.keys.iter().any(|key| {
            examples_in(key, entry).any(|example| example.used) || key.examples.is_empty()
        });
        line(&header, used, text);
        keys(described, entry, text);
    }
    for below in &described.tables {
        table(below, text);
    }
}

fn examples_in(key: &DescribedKey, entry: usize) -> impl Iterator<Item = &Example> {
    let examples = key.examples.iter();
    examples.filter(move |example| example.entry == entry)
}

fn keys(table: &DescribedTable, entry: usize, text: &mut String) {
    for key in &table.keys {
        let first = key.examples.iter().map(|example| example.entry).min();
        if first.unwrap_or(0) == entry {
            comment(key.about, text);
            for values in values(key) {
                comment(&[&values], text);
            }
        }
        if let (0, [], Some(default)) = (entry, &*key.examples, &key.default) {
            line(&format!("{} = {default}", key.name), true, text);
        }
        for example in examples_in(key, entry) {
            let pair = format!("{} = {}", key.name, example.toml);
            line(&pair, example.used, text);
        }
    }
}

/// Documentation as written in the source, where each line begins with a space.
fn comment(lines: &[&str], text: &mut String) {
    for line in lines {
        text.push('#');
        text.push_str(line);
        text.push('\n');
    }
}

fn line(toml: &str, used: bool, text: &mut String) {
    if !used {
        text.push_str("# ");
    }
    text.push_str(toml);
    text.push('\n');
}

/// Unit, range and default of a key: in a sentence, words with a meaning in a line each.
fn values(key: &DescribedKey) -> Vec<String> {
    if let ValueKind::Word(words) = &key.kind
        && words.iter().any(|word| !word.meaning.is_empty())
    {
        let width = words.iter().map(|word| word.word.len()).max().unwrap_or(0) + 2;
        let default = key.default.as_ref().and_then(Value::as_str);
        let lines = words.iter().map(|word| {
            let quoted = format!("\"{}\"", word.word);
            let default = if Some(word.word) == default {
                " (default)"
            } else {
                ""
            };
            let line = format!("   {quoted:width$}  {}{default}", word.meaning);
            line.trim_end().to_owned()
        });
        return lines.collect();
    }
    let mut sentence = [key.unit().map(str::to_owned), range(&key.kind)]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(", ");
    if !sentence.is_empty() {
        sentence = format!("{}. ", capitalised(&sentence));
    }
    if key.required {
        sentence.push_str("Required.");
    } else if let Some(default) = &key.default {
        sentence.push_str(&default_of(key, default));
    }
    let sentence = sentence.trim_end();
    if sentence.is_empty() {
        Vec::new()
    } else {
        vec![format!(" {sentence}")]
    }
}

/// The accepted values in words, unless all of their kind are accepted.
fn range(kind: &ValueKind) -> Option<String> {
    match kind {
        ValueKind::Text { .. }
        | ValueKind::File
        | ValueKind::Folder
        | ValueKind::Mirror
        | ValueKind::Glob => None,
        ValueKind::Form { expected, .. } => Some(expected.clone()),
        ValueKind::Number(Accept::FromTo(low, high)) => Some(format!("{low} to {high}")),
        ValueKind::Number(Accept::AboveTo(low, high)) => {
            Some(format!("above {low}, at most {high}"))
        }
        ValueKind::Number(Accept::ZeroOr(low, f64::INFINITY)) => {
            Some(format!("0 or at least {low}, inf included"))
        }
        ValueKind::Number(Accept::ZeroOr(low, high)) => Some(format!("0 or {low} to {high}")),
        ValueKind::Whole { low, high } => Some(format!("{low} to {high}")),
        ValueKind::Switch => Some("true or false".to_owned()),
        ValueKind::Word(words) => {
            let words: Vec<String> = words
                .iter()
                .map(|word| format!("\"{}\"", word.word))
                .collect();
            Some(words.join(", "))
        }
        ValueKind::List { of, .. } => match (&**of, range(of)?) {
            (ValueKind::Number(_) | ValueKind::Whole { .. }, range) => {
                Some(format!("each {range}"))
            }
            (_, range) => Some(range),
        },
    }
}

fn default_of(key: &DescribedKey, default: &Value) -> String {
    let shown = match default {
        Value::String(text) if text.is_empty() => "empty".to_owned(),
        Value::Array(entries) if entries.is_empty() => "none".to_owned(),
        // The value that follows is the default.
        Value::String(_)
            if key.examples.is_empty() && matches!(key.kind, ValueKind::Text { .. }) =>
        {
            return String::new();
        }
        other => plainly(other),
    };
    format!("Default: {shown}.")
}

/// Numbers without a decimal point where they need none.
fn plainly(value: &Value) -> String {
    match value {
        Value::Float(number) => number.to_string(),
        Value::Array(entries) => {
            let entries: Vec<String> = entries.iter().map(plainly).collect();
            format!("[{}]", entries.join(", "))
        }
        other => other.to_string(),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
