//! Quotes text of a user or a file for an error message: short, on one line, and with its control
//! characters escaped, which a terminal would obey.

use std::path::Path;

/// Longest text that [`printable`] returns, characters.
pub const MAX_QUOTE_CHARS: usize = 200;
/// Longest line of an error message, characters: two quotations and the words around them.
const MAX_ERROR_CHARS: usize = 600;

/// Whether a character changes how a terminal shows the text around it.
fn is_control_code(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}')
        || matches!(c, '\u{2060}'..='\u{206F}' | '\u{FEFF}')
}

/// The text with its control characters escaped; one longer than [`MAX_QUOTE_CHARS`] characters is
/// cut to its beginning, `…` and its end.
pub fn printable(text: &str) -> String {
    // The text is cut before escaping too, so that any length costs bounded work.
    shortened(&escaped(&shortened(text, 2 * MAX_QUOTE_CHARS)), MAX_QUOTE_CHARS)
}

/// As [`printable`], for a path; bytes that are not UTF-8 become `�`.
pub fn printable_path(path: &Path) -> String {
    printable(&path.to_string_lossy())
}

/// The text with control characters as escape sequences.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_control_code(c) {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    out
}

/// The text; if longer than `most` characters its beginning, `…` and its end, `most` in all.
fn shortened(text: &str, most: usize) -> String {
    if text.len() <= most || text.chars().count() <= most {
        return text.to_owned();
    }
    let begin: String = text.chars().take(most / 2 - 1).collect();
    let end: Vec<char> = text.chars().rev().take(most / 2).collect();
    begin + "…" + &end.iter().rev().collect::<String>()
}

/// A whole error message as it is printed: line ends stay, all other control characters are
/// escaped, and each line is cut to 600 characters.
pub fn printable_message(text: &str) -> String {
    let lines: Vec<String> =
        text.lines().map(|line| shortened(&escaped(line), MAX_ERROR_CHARS)).collect();
    lines.join("\n")
}

/// An error message about the command line, as [`printable_message`] gives it, in which each
/// argument, and the value after its `=`, was replaced by its [`printable`] form.
pub fn with_printable_arguments(text: &str, arguments: impl Iterator<Item = String>) -> String {
    let mut text = text.to_owned();
    for argument in arguments {
        let value = argument.split_once('=').map_or("", |(_, value)| value);
        for given in [argument.as_str(), value] {
            if printable(given) != given {
                text = text.replace(given, &printable(given));
            }
        }
    }
    printable_message(&text)
}

#[cfg(test)]
mod tests;
