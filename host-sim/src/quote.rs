//! What a user gave, as an error may show it: short, on one line, and without codes that a terminal
//! obeys.

use std::path::Path;

/// Longest quotation, characters.
pub const MAX_QUOTE_CHARS: usize = 200;
/// Longest line of an error, characters: the words around two quotations.
const MAX_ERROR_CHARS: usize = 600;

/// Whether a character changes how a terminal shows the text around it.
fn is_control_code(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200B}'..='\u{200F}' | '\u{2028}'..='\u{202E}')
        || matches!(c, '\u{2060}'..='\u{206F}' | '\u{FEFF}')
}

/// The text with its codes escaped; where it is longer than [`MAX_QUOTE_CHARS`] characters, its
/// beginning and its end.
pub fn quoted(text: &str) -> String {
    // No more than could be shown is checked, from either end.
    shortened(&escaped(&shortened(text, 2 * MAX_QUOTE_CHARS)), MAX_QUOTE_CHARS)
}

/// As `quoted`, for a path.
pub fn quoted_path(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}

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

/// Beginning and end of a text that is longer than `most` characters.
fn shortened(text: &str, most: usize) -> String {
    if text.len() <= most || text.chars().count() <= most {
        return text.to_owned();
    }
    let begin: String = text.chars().take(most / 2 - 1).collect();
    let end: Vec<char> = text.chars().rev().take(most / 2).collect();
    begin + "…" + &end.iter().rev().collect::<String>()
}

/// A whole message as it is printed: nothing in it is a code but its ends of line, and no line is
/// endless.
pub fn quote_message(text: &str) -> String {
    let lines: Vec<String> =
        text.lines().map(|line| shortened(&escaped(line), MAX_ERROR_CHARS)).collect();
    lines.join("\n")
}

/// A message about the command line, with what stands in it of these arguments quoted.
pub fn about_arguments(text: &str, arguments: impl Iterator<Item = String>) -> String {
    let mut text = text.to_owned();
    for argument in arguments {
        let value = argument.split_once('=').map_or("", |(_, value)| value);
        for given in [argument.as_str(), value] {
            if quoted(given) != given {
                text = text.replace(given, &quoted(given));
            }
        }
    }
    quote_message(&text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn short_plain_text_stays_as_it_is() {
        for text in ["", "a/b.toml", "größer ≤ 3 m", &"x".repeat(MAX_QUOTE_CHARS)] {
            assert_eq!(quoted(text), text);
        }
        assert_eq!(quoted("\x1b[31mred\n"), "\\u{1b}[31mred\\n");
        assert_eq!(quoted("a\u{202e}b"), "a\\u{202e}b");
        assert!(quoted(&format!("begin{}end", "x".repeat(5000))).starts_with("beginx"));
        assert!(quoted(&format!("begin{}end", "x".repeat(5000))).ends_with("xend"));
    }

    #[test]
    fn arguments_are_quoted_inside_a_message() {
        let arguments = ["--id=\x07".to_owned(), "y".repeat(1000)];
        let text = format!("error: invalid value '\x07' or '{}'", arguments[1]);
        let message = about_arguments(&text, arguments.into_iter());
        assert!(message.starts_with("error: invalid value '\\u{7}' or 'yyy"), "{message}");
        assert!(message.chars().count() < 240, "{message}");
    }

    proptest! {
        #[test]
        fn whatever_is_quoted_is_short_and_without_codes(text in "(?s).{0,700}") {
            let short = quoted(&text);
            prop_assert!(
                short.chars().count() <= MAX_QUOTE_CHARS && !short.chars().any(is_control_code),
                "{short:?}"
            );
            prop_assert!(
                quote_message(&text).lines().all(
                    |l| l.chars().count() <= MAX_ERROR_CHARS && !l.chars().any(is_control_code)
                )
            );
        }
    }
}
