//! Which file of the crate names what of which other file, read from its tokens.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use areograph_testing::checkout;
use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Crates that are rooms of the pipeline, above the crates that it is built on.
pub(crate) const ROOMS: [&str; 3] = ["stages", "products", "report"];

/// The folder with the sources of a crate.
pub(crate) fn sources_of(room: &str) -> PathBuf {
    checkout().join("crates").join(room).join("src")
}

/// The texts of a crate in their folder, by modules.
fn texts_below(root: &Path) -> Vec<(Module, String)> {
    let mut files = Vec::new();
    files_below(root, &mut files);
    files.retain(|file| !file.ends_with("main.rs"));
    // The smallest crate, `derive`, has one.
    assert!(!files.is_empty(), "the sources were not found");
    let text = |file: &PathBuf| {
        let module = module_of(file.strip_prefix(root).unwrap());
        (module, fs::read_to_string(file).unwrap())
    };
    files.iter().map(text).collect()
}

/// A file as its module path: `["spice", "session"]`; `mod.rs` stands for its folder, `lib.rs` is empty.
pub(crate) type Module = Vec<String>;

/// All files of a crate with the paths that they name.
pub(crate) struct Sources {
    files: BTreeMap<Module, Named>,
}

/// Paths that a file names, from the root of the crate.
#[derive(Default)]
struct Named {
    paths: Vec<Module>,
    /// What it passes on under a name (`pub use`).
    passed_on: BTreeMap<String, Module>,
    /// Files of which it passes on everything.
    passed_on_whole: Vec<Module>,
    /// Names behind `struct`, `fn` and the like.
    defined: BTreeSet<String>,
}

/// Something that a file uses of another one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Use {
    /// The file that defines it.
    pub(crate) file: Module,
    /// Its name there; none when the whole file is meant.
    pub(crate) item: Option<String>,
}

impl Sources {
    /// The sources of the pipeline as one crate: the root package, and the crates of [`ROOMS`] as its rooms. `main.rs` is
    /// a crate of its own.
    pub(crate) fn of_the_program() -> Self {
        let mut texts = texts_below(&checkout().join("src"));
        for room in ROOMS {
            let own = format!("crate::{room}::");
            let of_room = texts_below(&sources_of(room)).into_iter();
            texts.extend(of_room.map(|(module, text)| {
                let module = [&[room.to_owned()], &*module].concat();
                (module, text.replace("crate::", &own))
            }));
        }
        let in_one = |(module, mut text): (Module, String)| {
            for room in ROOMS.iter().chain(&["spice"]) {
                text = text.replace(&format!("areograph_{room}::"), &format!("crate::{room}::"));
            }
            (module, text)
        };
        Self::of_texts(texts.into_iter().map(in_one))
    }

    /// The sources of a crate in their folder.
    pub(crate) fn below(root: &Path) -> Self {
        Self::of_texts(texts_below(root).into_iter())
    }

    /// Sources by their modules.
    pub(crate) fn of_texts(texts: impl Iterator<Item = (Module, String)>) -> Self {
        let texts: BTreeMap<Module, String> = texts.collect();
        let read = |module: &Module, text: &String| Named::read(module, text, &texts);
        let files = texts
            .iter()
            .map(|(module, text)| (module.clone(), read(module, text)));
        Self {
            files: files.collect(),
        }
    }

    /// All files but the root.
    pub(crate) fn modules(&self) -> impl Iterator<Item = &Module> {
        self.files.keys().filter(|module| !module.is_empty())
    }

    /// Every path that a file names, from the root of its crate.
    pub(crate) fn paths(&self, module: &Module) -> impl Iterator<Item = &Module> {
        let paths = self.files[module].paths.iter();
        paths.filter(|path| !path.is_empty())
    }

    /// What a file uses of others. Its folder's `mod.rs` and those above are left out: they hold the words that the
    /// files of a folder share, beside what calls these files.
    pub(crate) fn uses(&self, module: &Module) -> BTreeSet<Use> {
        let paths = self.files[module].paths.iter();
        paths
            .map(|path| self.resolved(path))
            .filter(|found| !module.starts_with(&found.file))
            .collect()
    }

    /// The file that defines what a path means, through all that pass it on.
    fn resolved(&self, path: &Module) -> Use {
        let file = (0..=path.len())
            .rev()
            .map(|length| path[..length].to_vec())
            .find(|module| self.files.contains_key(module))
            .unwrap_or_default();
        let item = path.get(file.len()).cloned();
        let passed_on = item.as_ref().and_then(|item| self.passed_on(&file, item));
        match passed_on {
            Some(target) => {
                let rest = &path[file.len() + 1..];
                self.resolved(&[&*target, rest].concat())
            }
            None => Use { file, item },
        }
    }

    /// What a file passes on under this name.
    fn passed_on(&self, file: &Module, item: &str) -> Option<Module> {
        let named = self.files.get(file)?;
        let of_a_whole = || {
            let mut wholes = named.passed_on_whole.iter();
            let defines = |whole: &&Module| self.files[*whole].defined.contains(item);
            let whole = wholes.find(defines)?;
            Some([whole.as_slice(), &[item.to_owned()]].concat())
        };
        named.passed_on.get(item).cloned().or_else(of_a_whole)
    }
}

impl Named {
    fn read(module: &Module, text: &str, files: &BTreeMap<Module, String>) -> Self {
        let mut tokens = Vec::new();
        flatten(text.parse().unwrap(), &mut tokens);
        let tokens = without_tests(&tokens);
        let mut named = Self::default();
        let definitions = tokens.windows(2).filter(|pair| {
            matches!(
                &*pair[0],
                "struct" | "enum" | "trait" | "type" | "fn" | "const" | "static"
            )
        });
        named.defined = definitions.map(|pair| pair[1].clone()).collect();
        let mut at = 0;
        while at < tokens.len() {
            let child = [module.as_slice(), &tokens[at..=at]].concat();
            let begins = matches!(&*tokens[at], "crate" | "super" | "self")
                || files.contains_key(&child) && !tokens[..at].ends_with(&separator());
            if !begins || !tokens[at + 1..].starts_with(&separator()) {
                at += 1;
                continue;
            }
            let passes_on = at > 1 && tokens[at - 1] == "use" && {
                let before = &*tokens[at - 2];
                before == "pub" || before == ")"
            };
            let mut paths = Vec::new();
            at = read_paths(&tokens, at, &Module::new(), &mut paths);
            for mut path in paths.iter().map(|path| from_the_root(module, path)) {
                let whole = path.pop_if(|name| name == "*").is_some();
                match path.last() {
                    Some(_) if passes_on && whole => named.passed_on_whole.push(path),
                    Some(name) if passes_on => drop(named.passed_on.insert(name.clone(), path)),
                    _ => named.paths.push(path),
                }
            }
        }
        named
    }
}

/// All Rust files below a folder.
pub(crate) fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn module_of(file: &Path) -> Module {
    let mut module: Module = file
        .with_extension("")
        .iter()
        .map(|part| part.to_string_lossy().into_owned())
        .collect();
    if module.last().is_some_and(|name| name == "mod") || module == ["lib"] {
        module.pop();
    }
    module
}

/// Names, marks and brackets in order; literals, and with them comments, become nothing.
fn flatten(stream: TokenStream, tokens: &mut Vec<String>) {
    for token in stream {
        match token {
            TokenTree::Ident(name) => tokens.push(name.to_string()),
            TokenTree::Punct(mark) => tokens.push(mark.to_string()),
            TokenTree::Literal(_) => tokens.push(String::new()),
            TokenTree::Group(group) => {
                let [open, close] = match group.delimiter() {
                    Delimiter::Brace => ["{", "}"],
                    Delimiter::Bracket => ["[", "]"],
                    Delimiter::Parenthesis | Delimiter::None => ["(", ")"],
                };
                tokens.push(open.to_owned());
                flatten(group.stream(), tokens);
                tokens.push(close.to_owned());
            }
        }
    }
}

/// Leaves out what is compiled for tests alone.
fn without_tests(tokens: &[String]) -> Vec<String> {
    let for_tests = ["#", "[", "cfg", "(", "test", ")", "]"].map(str::to_owned);
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if !tokens[at..].starts_with(&for_tests) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        at += for_tests.len();
        let mut depth = 0;
        while at < tokens.len() {
            depth += i32::from(matches!(&*tokens[at], "{" | "(" | "["));
            depth -= i32::from(matches!(&*tokens[at], "}" | ")" | "]"));
            at += 1;
            if depth == 0 && matches!(&*tokens[at - 1], ";" | "}") {
                break;
            }
        }
    }
    kept
}

fn separator() -> [String; 2] {
    [":", ":"].map(str::to_owned)
}

/// Reads one path, or a tree of them in braces, behind `before`; gives the place after it.
fn read_paths(tokens: &[String], at: usize, before: &Module, paths: &mut Vec<Module>) -> usize {
    let path = [before.as_slice(), &tokens[at..=at]].concat();
    let after = at + 1;
    let goes_on = tokens[after..].starts_with(&separator());
    match tokens.get(after + 2) {
        Some(next) if goes_on && next == "{" => {
            let mut inside = after + 3;
            while tokens[inside] != "}" {
                inside = match &*tokens[inside] {
                    "," => inside + 1,
                    "as" => inside + 2,
                    _ => read_paths(tokens, inside, &path, paths),
                };
            }
            inside + 1
        }
        // Not the type arguments of a function.
        Some(next) if goes_on && next != "<" => read_paths(tokens, after + 2, &path, paths),
        _ => {
            paths.push(path);
            after
        }
    }
}

/// A path as `module` writes it, from the root of the crate.
fn from_the_root(module: &Module, path: &Module) -> Module {
    let mut absolute = module.clone();
    for part in path {
        match &**part {
            "crate" => absolute.clear(),
            "super" => drop(absolute.pop()),
            "self" => {}
            _ => absolute.push(part.clone()),
        }
    }
    absolute
}
