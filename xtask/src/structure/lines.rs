//! Finds files of too many lines, and lines of too many characters. rustfmt breaks lines, but not
//! in macros that it cannot parse, attributes and comments. Checks lines of documents, the length
//! of ARCHITECTURE.md, and where modules stand: `<module>.rs`, with its unit tests in
//! `<module>/tests.rs`.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use proc_macro2::{Delimiter, LineColumn, TokenStream, TokenTree};

/// Most lines of a file.
const MAX_FILE_LINES: usize = 500;
/// Most characters of a line, as in `rustfmt.toml`.
const MAX_LINE_CHARS: usize = 100;
/// Least characters of a command in a document that may make its line too long.
const MIN_LONG_COMMAND_CHARS: usize = 60;
/// Most bytes of the map of the code, `ARCHITECTURE.md`.
const MAX_ARCHITECTURE_BYTES: usize = 18_000;
/// A part of this program, not a file of tests.
const HOST_TESTS_FILE: &str = "host_tests.rs";
/// Folders that are not searched: they hold no sources of ours.
const SKIPPED_FOLDERS: [&str; 2] = ["target", ".git"];

/// Exceptions from either limit: file and reason.
const EXCEPTIONS: &[(&str, &str)] = &[];

/// Every file and line beyond the limits in the Rust files of the repository, as a line to print;
/// with the reason if the file is listed as an exception.
pub fn faults_of_files() -> Result<Vec<(String, Option<&'static str>)>> {
    let mut files = Vec::new();
    find_sources(Path::new(""), &mut files)?;
    files.sort();
    let mut found = Vec::new();
    for file in files {
        let text = fs::read_to_string(&file).with_context(|| file.display().to_string())?;
        let name = file.display().to_string();
        let exception = EXCEPTIONS.iter().find(|(of, _)| *of == name);
        let misplaced = misplaced_module(&file, &text).map(str::to_owned);
        for what in
            faults_in_source(&text).with_context(|| name.clone())?.into_iter().chain(misplaced)
        {
            found.push((format!("{name}{what}"), exception.map(|(_, reason)| *reason)));
        }
    }
    for page in find_documents()? {
        let text = fs::read_to_string(&page).with_context(|| page.display().to_string())?;
        found.extend(
            long_prose_lines(&text).map(|what| (format!("{}{what}", page.display()), None)),
        );
    }
    let map_bytes = fs::read("ARCHITECTURE.md").context("ARCHITECTURE.md")?.len();
    if map_bytes > MAX_ARCHITECTURE_BYTES {
        found.push((
            format!("ARCHITECTURE.md has {map_bytes} bytes, more than {MAX_ARCHITECTURE_BYTES}"),
            None,
        ));
    }
    Ok(found)
}

/// The Rust files below a folder of the repository.
fn find_sources(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    for entry in fs::read_dir(here)? {
        let entry = entry?;
        let path = folder.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            if !SKIPPED_FOLDERS.iter().any(|other| entry.file_name() == *other) {
                find_sources(&path, files)?;
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

/// What is wrong with where a module of a file stands. Integration tests share their modules in
/// `tests/tests/<name>/mod.rs`, since Cargo takes each file beside them for a program.
fn misplaced_module(file: &Path, text: &str) -> Option<&'static str> {
    let name = file.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    if file.starts_with("tests/tests") {
        None
    } else if name == "mod.rs" {
        Some(" is to be named after its folder, beside it")
    } else if name.ends_with("_test.rs") || (name.ends_with("_tests.rs") && name != HOST_TESTS_FILE)
    {
        Some(" is to be the tests.rs of a module")
    } else if text.lines().any(|line| !line.starts_with(' ') && line.ends_with("mod tests {")) {
        Some(" has its unit tests inline: they stand in tests.rs")
    } else {
        None
    }
}

/// The documents: the Markdown files of the repository, of its crates and of `docs`.
fn find_documents() -> Result<Vec<PathBuf>> {
    let mut pages = Vec::new();
    for folder in fs::read_dir(".")? {
        let folder = folder?.path();
        let names = if folder.is_dir() { fs::read_dir(&folder)?.collect() } else { Vec::new() };
        let within = names.into_iter().map(|entry| entry.map(|entry| entry.path()));
        for path in within.chain([Ok(folder.clone())]) {
            let path: PathBuf = path?;
            if path.extension().is_some_and(|extension| extension == "md") && path.is_file() {
                pages.push(path);
            }
        }
    }
    pages.sort();
    Ok(pages)
}

/// Lines of prose in a document that are too long, each as a line to print without the file's name.
/// Tables, blocks of code, addresses and commands of [`MIN_LONG_COMMAND_CHARS`] characters cannot
/// be broken.
fn long_prose_lines(text: &str) -> impl Iterator<Item = String> + '_ {
    let mut in_code = false;
    text.lines().enumerate().filter_map(move |(index, line)| {
        in_code ^= line.trim_start().starts_with("```");
        let is_whole = |line: &str| {
            line.starts_with('|')
                || line.contains("://")
                || line
                    .split('`')
                    .skip(1)
                    .step_by(2)
                    .any(|code| code.chars().count() >= MIN_LONG_COMMAND_CHARS)
        };
        let length = line.chars().count();
        let long = !in_code && length > MAX_LINE_CHARS && !is_whole(line);
        long.then(|| format!(":{} has {length} characters, more than {MAX_LINE_CHARS}", index + 1))
    })
}

/// The faults of one file, each as a line to print without the file's name.
fn faults_in_source(text: &str) -> Result<Vec<String>> {
    let mut found = Vec::new();
    let count = text.lines().count();
    if count > MAX_FILE_LINES {
        found.push(format!(" has {count} lines, more than {MAX_FILE_LINES}"));
    }
    let is_long = |line: &str| line.chars().count() > MAX_LINE_CHARS;
    if !text.lines().any(is_long) {
        return Ok(found);
    }
    let mut may_be_long = vec![false; count];
    let tokens = text.parse().map_err(|error| anyhow!("{error}"))?;
    mark_unbreakable(tokens, &mut may_be_long);
    for (index, line) in text.lines().enumerate() {
        let comment = line.trim_start().strip_prefix("//");
        // Rows of Markdown tables and commands in comments cannot be broken: they may be long.
        let is_whole =
            |comment: &str| comment.trim_start_matches(['/', '!', ' ']).starts_with(['|', '`']);
        if is_long(line) && !comment.map_or(may_be_long[index], is_whole) {
            let length = line.chars().count();
            found.push(format!(
                ":{} has {length} characters, more than {MAX_LINE_CHARS}",
                index + 1
            ));
        }
    }
    Ok(found)
}

/// Marks lines that may be long: those under `rustfmt::skip`, those of strings of several lines,
/// and those that a string makes long.
fn mark_unbreakable(tokens: TokenStream, lines: &mut [bool]) {
    let mut is_skipped = false;
    let mut may_skip = false;
    for token in tokens {
        let (start, end) = (token.span().start(), token.span().end());
        if is_skipped || is_unbreakable_string(&token, start, end) {
            lines[start.line - 1..end.line].fill(true);
        }
        match token {
            TokenTree::Punct(punct) => {
                may_skip = punct.as_char() == '#';
                is_skipped &= punct.as_char() != ';';
            }
            TokenTree::Group(group) => {
                let is_attribute = may_skip && group.delimiter() == Delimiter::Bracket;
                may_skip = false;
                if is_attribute && group.to_string().replace(' ', "").contains("rustfmt::skip") {
                    is_skipped = true;
                } else if group.delimiter() == Delimiter::Brace {
                    is_skipped = false;
                }
                mark_unbreakable(group.stream(), lines);
            }
            _ => may_skip = false,
        }
    }
}

/// Whether this is a string of several lines, or one that crosses column [`MAX_LINE_CHARS`].
fn is_unbreakable_string(token: &TokenTree, start: LineColumn, end: LineColumn) -> bool {
    let is_string = matches!(token, TokenTree::Literal(text) if text.to_string().contains('"'));
    is_string
        && (end.line > start.line
            || (start.column < MAX_LINE_CHARS && end.column >= MAX_LINE_CHARS))
}

#[cfg(test)]
mod tests;
