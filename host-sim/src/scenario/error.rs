//! Errors of a scenario file, which name line and column and show the line.

use std::fmt;
use std::ops::Range;

use crate::quote::{MAX_QUOTE_CHARS, printable};

/// Number of characters of a long line that are shown before the marked ones.
const CONTEXT_CHARS: usize = 40;

/// Error of a scenario: the fault, its place, and a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScenarioError {
    /// The scenario's name, usually its path.
    pub file: String,
    /// Line and column of the fault, and the line's text; `None` if the file itself could not be
    /// read.
    pub place: Option<SourcePlace>,
    /// Fault of the scenario.
    pub why: String,
    /// Remedy, if one can be stated.
    pub hint: Option<String>,
}

/// A place in a scenario's text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourcePlace {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The whole line.
    pub text: String,
    /// Number of characters to mark from the column on, at least 1.
    pub marked_chars: usize,
}

impl SourcePlace {
    /// The place of a range of bytes in the text.
    pub(super) fn of(text: &str, span: &Range<usize>) -> Self {
        let start =
            (0..=span.start.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        let begin = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line = text[begin..].lines().next().unwrap_or("");
        let end =
            (start..=span.end.min(begin + line.len())).rev().find(|&i| text.is_char_boundary(i));
        Self {
            line: text[..begin].matches('\n').count() + 1,
            column: text[begin..start].chars().count() + 1,
            text: line.into(),
            marked_chars: end.map_or(1, |end| text[start..end].chars().count().max(1)),
        }
    }
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, place, why, hint } = self;
        match place {
            None => write!(f, "bad scenario: {file}: {why}")?,
            Some(SourcePlace { line, column, text, marked_chars: marked }) => {
                let margin = " ".repeat(line.to_string().len());
                writeln!(f, "bad scenario: {file}:{line}:{column}: {why}")?;
                writeln!(f, "{margin} |")?;
                let (shown, before, marked) = marked_line(text, column - 1, *marked);
                writeln!(f, "{line} | {shown}")?;
                write!(f, "{margin} | {}{}", " ".repeat(before), "^".repeat(marked))?;
            }
        }
        match hint {
            Some(hint) => write!(f, "\nhint: {hint}"),
            None => Ok(()),
        }
    }
}

/// A line cut for display around the `marked` characters from `from` on: the text, how many of its
/// characters stand before the marked ones, and how many marked ones it shows.
fn marked_line(text: &str, from: usize, marked: usize) -> (String, usize, usize) {
    let begin =
        if from + marked > MAX_QUOTE_CHARS { from.saturating_sub(CONTEXT_CHARS) } else { 0 };
    let plain =
        |c: char| if printable(c.encode_utf8(&mut [0; 4])).chars().count() == 1 { c } else { ' ' };
    let mut shown: String = text.chars().skip(begin).take(MAX_QUOTE_CHARS - 2).map(plain).collect();
    let length = shown.chars().count();
    if text.chars().nth(begin + length).is_some() {
        shown.push('…');
    }
    let before = from - begin + usize::from(begin > 0);
    let marked = marked.min((length + usize::from(begin > 0)).saturating_sub(before)).max(1);
    (if begin > 0 { format!("…{shown}") } else { shown }, before, marked)
}

impl std::error::Error for ScenarioError {}

#[cfg(test)]
mod tests;
