//! The words of `docs/house_style.md`: texts that users read contain none that the house style excludes.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may fail loudly"
)]

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph_testing::checkout;
use proc_macro2::{TokenStream, TokenTree};

/// Words that programs and documents do not use of themselves or of data, and what to write.
const EXCLUDED: [(&str, &str); 8] = [
    ("told", "reported, stated"),
    ("tell", "report, determine"),
    ("tells", "reports, determines"),
    ("telling", "reporting"),
    ("said", "stated"),
    ("says", "states, reports"),
    ("nobody", "a sentence with another subject"),
    ("manieth", "every *n*-th"),
];

/// Documents for users beside the guide. The style itself quotes the words.
const DOCUMENTS: [&str; 10] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/glossary.md",
    "docs/http.md",
    "docs/products.md",
    "docs/records.md",
    "docs/guide/src",
    "config",
];

/// Files below a folder whose names end in one of `ends`.
fn files(folder: &Path, ends: &[&str], found: &mut Vec<PathBuf>) {
    if folder.is_file() {
        found.push(folder.to_owned());
        return;
    }
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy();
        if path.is_dir() || ends.iter().any(|end| name.ends_with(end)) {
            files(&path, ends, found);
        }
    }
}

/// The excluded words of a text. Names in code, paths and placeholders are longer words.
fn excluded(text: &str) -> Vec<&'static str> {
    let words = text.split(|letter: char| letter.is_whitespace() || "—–|*".contains(letter));
    let words = words.map(|word| word.trim_matches(|letter| ".,;:()\"'?!".contains(letter)));
    let of = |word: &str| {
        let found = EXCLUDED.iter().find(|(excluded, _)| *excluded == word);
        found.map(|(excluded, _)| *excluded)
    };
    words.filter_map(|word| of(&word.to_lowercase())).collect()
}

/// String literals with more than one word, outside modules of tests; documentation where it becomes help.
fn literals(tokens: TokenStream, with_docs: bool, found: &mut Vec<String>) {
    let mut tokens = tokens.into_iter().peekable();
    while let Some(token) = tokens.next() {
        match token {
            TokenTree::Ident(name) if name == "tests" => {
                // The body of `mod tests`.
                tokens.next_if(|next| matches!(next, TokenTree::Group(_)));
            }
            TokenTree::Group(group) => {
                let text = group.stream().to_string();
                if with_docs || !text.starts_with("doc =") {
                    literals(group.stream(), with_docs, found);
                }
            }
            TokenTree::Literal(literal) => {
                let text = literal.to_string();
                if text.contains(' ') {
                    found.push(text);
                }
            }
            _ => {}
        }
    }
}

#[test]
fn texts_for_users_are_in_house_style() {
    let root = checkout();
    let mut found = Vec::new();
    let mut documents = Vec::new();
    for document in DOCUMENTS {
        let ends = [".md", ".toml", ".json", ".service", ".timer"];
        files(&root.join(document), &ends, &mut documents);
    }
    for path in &documents {
        let text = fs::read_to_string(path).unwrap();
        for (line, text) in (1..).zip(text.lines()) {
            let words = excluded(text).into_iter();
            found.extend(words.map(|word| format!("{}:{line}: {word}", path.display())));
        }
    }
    let mut sources = Vec::new();
    files(&root.join("src"), &[".rs"], &mut sources);
    files(&root.join("crates"), &[".rs"], &mut sources);
    sources.retain(|path| {
        let of_tests = [
            "tests", "testing", "tests.rs", "target", "examples", "benches",
        ];
        !path
            .iter()
            .any(|part| of_tests.iter().any(|name| part == *name))
    });
    let mut count = 0;
    for path in &sources {
        let text = fs::read_to_string(path).unwrap();
        let mut texts = Vec::new();
        let is_help = path.starts_with(root.join("src/cli"));
        literals(text.parse().unwrap(), is_help, &mut texts);
        count += texts.len();
        for text in texts {
            let words = excluded(&text).into_iter();
            found.extend(words.map(|word| format!("{}: {word}: {text}", path.display())));
        }
    }
    assert!(
        count > 3_000,
        "only {count} texts of {} sources",
        sources.len()
    );
    assert!(
        found.is_empty(),
        "{}\nwrite instead: {EXCLUDED:?}",
        found.join("\n")
    );
}

#[test]
fn excluded_words_are_found_and_names_are_not() {
    assert_eq!(excluded("It is told, as it Says."), ["told", "says"]);
    assert_eq!(excluded("`is_told` of {said}, /bin/tell-us"), [""; 0]);
}
