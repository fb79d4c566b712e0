//! Errors that point at the line of a scenario.

use std::fmt;
use std::ops::Range;

/// What is wrong with a scenario, where, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScenarioError {
    /// The scenario's name, usually its path.
    pub file: String,
    /// Line and column, counted from 1, and the line's text; none where the file itself could not be read.
    pub place: Option<Place>,
    /// What is wrong.
    pub why: String,
    /// What to do about it, if that can be said.
    pub hint: Option<String>,
}

/// A place in a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// From 1.
    pub line: usize,
    /// From 1, in characters.
    pub column: usize,
    /// The whole line.
    pub text: String,
    /// Characters to mark from the column on, at least 1.
    pub marked: usize,
}

impl Place {
    /// The place of a span of bytes.
    pub(super) fn of(text: &str, span: &Range<usize>) -> Self {
        let start = (0..=span.start.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        let begin = text[..start].rfind('\n').map_or(0, |i| i + 1);
        let line = text[begin..].lines().next().unwrap_or("");
        let end = (start..=span.end.min(begin + line.len())).rev().find(|&i| text.is_char_boundary(i));
        Self {
            line: text[..begin].matches('\n').count() + 1,
            column: text[begin..start].chars().count() + 1,
            text: line.into(),
            marked: end.map_or(1, |end| text[start..end].chars().count().max(1)),
        }
    }
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, place, why, hint } = self;
        match place {
            None => write!(f, "bad scenario: {file}: {why}")?,
            Some(Place { line, column, text, marked }) => {
                let margin = " ".repeat(line.to_string().len());
                writeln!(f, "bad scenario: {file}:{line}:{column}: {why}")?;
                writeln!(f, "{margin} |")?;
                writeln!(f, "{line} | {}", text.replace('\t', " "))?;
                write!(f, "{margin} | {}{}", " ".repeat(column - 1), "^".repeat(*marked))?;
            }
        }
        match hint {
            Some(hint) => write!(f, "\nhint: {hint}"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for ScenarioError {}
