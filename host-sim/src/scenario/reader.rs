//! A reader of TOML tables that keeps each value's place and which keys were asked for.
//!
//! Deserialising with serde's derive loses a value's place before its range is checked, and cannot
//! suggest the nearest key; here both are known where the value is read.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::{Range, RangeInclusive};

use planner_core::roadmap::MAX_COORDINATE_M;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use super::error::{ScenarioError, SourcePlace};
use crate::quote::printable;

/// Range of bytes in the scenario's text.
pub(super) type TomlSpan = Range<usize>;
/// Result of reading a part of a scenario.
pub(super) type Result<T> = std::result::Result<T, ScenarioError>;

/// The scenario's text, and its name for errors.
#[derive(Clone, Copy)]
pub(super) struct TomlText<'a> {
    /// The file's name.
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

impl TomlText<'_> {
    /// Where the span begins, as `FILE:LINE`.
    pub(super) fn file_and_line(&self, span: &TomlSpan) -> String {
        format!("{}:{}", self.file, SourcePlace::of(self.text, span).line)
    }

    /// The error about the text at `span`.
    pub(super) fn error(&self, span: &TomlSpan, why: impl Into<String>) -> ScenarioError {
        ScenarioError {
            file: self.file.into(),
            place: Some(SourcePlace::of(self.text, span)),
            why: why.into(),
            hint: None,
        }
    }

    /// As [`Self::error`], with a hint.
    pub(super) fn error_with_hint(
        &self,
        span: &TomlSpan,
        why: impl Into<String>,
        hint: impl Into<String>,
    ) -> ScenarioError {
        ScenarioError { hint: Some(hint.into()), ..self.error(span, why) }
    }
}

/// A TOML value, with its place and its name for errors, such as `mission.goals[2]`.
#[derive(Clone)]
pub(super) struct TomlValue<'a> {
    pub(super) text: TomlText<'a>,
    /// Name of the value for errors.
    pub(super) name: String,
    /// Where the value stands in the text.
    pub(super) span: TomlSpan,
    value: &'a DeValue<'a>,
}

impl<'a> TomlValue<'a> {
    fn new(text: TomlText<'a>, name: String, value: &'a Spanned<DeValue<'a>>) -> Self {
        Self { text, name, span: value.span(), value: value.get_ref() }
    }

    /// An error at the value: its name, then `why`.
    pub(super) fn error(&self, why: &str) -> ScenarioError {
        self.text.error(&self.span, format!("{} {why}", self.name))
    }

    /// An error about the value's type: it must be `what`.
    fn expected_error(&self, what: &str) -> ScenarioError {
        self.error(&format!("must be {what}, not a value of type {}", self.value.type_str()))
    }

    /// The value as a finite number inside a range.
    pub(super) fn f64(&self, range: &RangeInclusive<f64>) -> Result<f64> {
        let number = match self.value {
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            DeValue::Integer(_) => self.integer().map(|i| i as f64),
            _ => return Err(self.expected_error("a number")),
        };
        match number {
            Some(number) if number.is_finite() && range.contains(&number) => Ok(number),
            _ => Err(self.error(&format!(
                "must be a number from {} to {}",
                range.start(),
                range.end()
            ))),
        }
    }

    /// The value as an integer; `None` if it is none, or too large.
    fn integer(&self) -> Option<i64> {
        let DeValue::Integer(integer) = self.value else { return None };
        i64::from_str_radix(integer.as_str(), integer.radix()).ok()
    }

    /// The value as a whole number inside a range.
    pub(super) fn integer_in_range(&self, range: RangeInclusive<u64>) -> Result<u64> {
        if !self.value.is_integer() {
            return Err(self.expected_error("a whole number"));
        }
        match self.integer().and_then(|i| u64::try_from(i).ok()) {
            Some(number) if range.contains(&number) => Ok(number),
            _ => Err(self.error(&format!(
                "must be a whole number from {} to {}",
                range.start(),
                range.end()
            ))),
        }
    }

    /// The value as true or false.
    pub(super) fn boolean(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.expected_error("true or false"))
    }

    /// The value as a string.
    pub(super) fn str(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.expected_error("a string"))
    }

    /// The value's string looked up in `words`: the meaning of that keyword.
    pub(super) fn one_of<T: Copy>(&self, words: &[(&str, T)]) -> Result<T> {
        let given = self.value.as_str();
        if let Some((_, meaning)) = words.iter().find(|(word, _)| Some(*word) == given) {
            return Ok(*meaning);
        }
        let all: Vec<String> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
        let all = format!("one of {}", all.join(", "));
        let Some(given) = given else { return Err(self.expected_error(&all)) };
        let error = self.error(&format!("must be {all}"));
        Err(ScenarioError {
            hint: nearest_word_hint(given, words.iter().map(|(word, _)| *word)),
            ..error
        })
    }

    /// The items of a list; a value that is no list is an error.
    pub(super) fn items(&self) -> Result<Vec<TomlValue<'a>>> {
        let array = self.value.as_array().ok_or_else(|| {
            let error = self.expected_error("a list");
            let hint = self
                .is_table()
                .then(|| format!("in double brackets, [[{0}]], each is one of {0}", self.name));
            ScenarioError { hint, ..error }
        })?;
        let item = |(i, value)| TomlValue::new(self.text, format!("{}[{i}]", self.name), value);
        Ok(array.iter().enumerate().map(item).collect())
    }

    /// The value as three numbers, each within ±[`MAX_COORDINATE_M`].
    pub(super) fn triple(&self) -> Result<[f64; 3]> {
        let items = self.items().map_err(|_| self.expected_error("[east, north, up] in metres"))?;
        let [x, y, z] = items.as_slice() else {
            return Err(self.error(&format!(
                "must be three numbers, east, north, up in metres, not {}",
                items.len()
            )));
        };
        let range = -f64::from(MAX_COORDINATE_M)..=f64::from(MAX_COORDINATE_M);
        Ok([x.f64(&range)?, y.f64(&range)?, z.f64(&range)?])
    }

    /// Whether the value is a table.
    pub(super) fn is_table(&self) -> bool {
        self.value.is_table()
    }

    /// The value as a table.
    pub(super) fn table(&self) -> Result<Table<'a>> {
        match self.value {
            DeValue::Table(table) => {
                Ok(Table::new(self.text, &self.name, self.span.clone(), table))
            }
            _ => Err(self.expected_error("a table")),
        }
    }
}

/// A table whose keys are read one by one; [`Table::refuse_unknown_keys`] refuses keys that were
/// never asked for.
pub(super) struct Table<'a> {
    pub(super) text: TomlText<'a>,
    /// Where the table stands in the text.
    pub(super) span: TomlSpan,
    /// Name of the table for errors; empty for the whole file.
    name: String,
    table: &'a DeTable<'a>,
    /// Keys that were read or declared so far, given in the file or not.
    requested_keys: RefCell<BTreeSet<&'static str>>,
}

impl<'a> Table<'a> {
    pub(super) fn new(
        text: TomlText<'a>,
        name: &str,
        span: TomlSpan,
        table: &'a DeTable<'a>,
    ) -> Self {
        Self { text, span, name: name.into(), table, requested_keys: RefCell::default() }
    }

    /// Name of a key of this table for errors, such as `mission.goals`.
    fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.into() } else { format!("{}.{key}", self.name) }
    }

    /// The value of `key`, if it is given; from now on the key is known.
    pub(super) fn get(&self, key: &'static str) -> Option<TomlValue<'a>> {
        self.declare_keys(&[key]);
        self.table.get(key).map(|value| TomlValue::new(self.text, self.path(key), value))
    }

    /// The value of `key`; if the key is missing, an error at the table with `hint`.
    pub(super) fn required(&self, key: &'static str, hint: &str) -> Result<TomlValue<'a>> {
        self.get(key).ok_or_else(|| {
            // A misspelt key is what the user sees in the file, so that is reported, not the
            // missing key.
            let misspelt = |(given, _): &(&Spanned<_>, _)| {
                strsim::jaro_winkler(AsRef::<str>::as_ref(given.get_ref()), key) > 0.85
            };
            match self.table.iter().find(misspelt) {
                Some((given, _)) => {
                    self.unknown_key_error(given, Some(format!("did you mean `{key}`?")))
                }
                None => self.text.error_with_hint(
                    &self.span,
                    format!("{} is missing", self.path(key)),
                    hint,
                ),
            }
        })
    }

    /// The error that refuses a key.
    fn unknown_key_error(
        &self,
        key: &Spanned<DeString<'_>>,
        hint: Option<String>,
    ) -> ScenarioError {
        let place = if self.name.is_empty() { String::new() } else { format!(" in {}", self.name) };
        let error = self
            .text
            .error(&key.span(), format!("unknown key `{}`{place}", printable(key.get_ref())));
        ScenarioError { hint, ..error }
    }

    /// Marks keys as known that are read later, or not at all.
    pub(super) fn declare_keys(&self, keys: &[&'static str]) {
        self.requested_keys.borrow_mut().extend(keys);
    }

    /// The number of `key` inside a range; `default` if the key is missing.
    pub(super) fn f32(
        &self,
        key: &'static str,
        default: f32,
        range: RangeInclusive<f64>,
    ) -> Result<f32> {
        self.get(key).map_or(Ok(default), |v| v.f64(&range).map(|n| n as f32))
    }

    /// A number of this range; `None` if the key is missing.
    pub(super) fn optional_f32(
        &self,
        key: &'static str,
        range: RangeInclusive<f64>,
    ) -> Result<Option<f32>> {
        self.get(key).map(|v| v.f64(&range).map(|n| n as f32)).transpose()
    }

    /// An integer of this range; `default` if the key is missing.
    pub(super) fn integer_in_range(
        &self,
        key: &'static str,
        default: u64,
        range: RangeInclusive<u64>,
    ) -> Result<u64> {
        self.get(key).map_or(Ok(default), |v| v.integer_in_range(range))
    }

    /// The value of `key`; false if the key is missing.
    pub(super) fn boolean(&self, key: &'static str) -> Result<bool> {
        self.get(key).map_or(Ok(false), |v| v.boolean())
    }

    /// What a keyword of `words` stands for; `default` if the key is missing.
    pub(super) fn one_of<T: Copy>(
        &self,
        key: &'static str,
        default: T,
        words: &[(&str, T)],
    ) -> Result<T> {
        self.get(key).map_or(Ok(default), |v| v.one_of(words))
    }

    /// Refuses the first key in the file that was neither read nor declared.
    pub(super) fn refuse_unknown_keys(&self) -> Result<()> {
        let known = self.requested_keys.borrow();
        let unknown = self.table.iter().filter(|(key, _)| !known.contains(&key.get_ref().as_ref()));
        let Some((key, _)) = unknown.min_by_key(|(key, _)| key.span().start) else { return Ok(()) };
        Err(self.unknown_key_error(key, nearest_word_hint(key.get_ref(), known.iter().copied())))
    }
}

/// A hint with the word nearest to `given`, or with all words if none is near.
fn nearest_word_hint<'w>(
    given: &str,
    words: impl Iterator<Item = &'w str> + Clone,
) -> Option<String> {
    let given = given.to_lowercase();
    let score = |word: &&str| strsim::jaro_winkler(&given, word);
    let best = words.clone().max_by(|a, b| score(a).total_cmp(&score(b)))?;
    if score(&best) > 0.7 {
        return Some(format!("did you mean `{best}`?"));
    }
    let all: Vec<String> = words.map(|word| format!("`{word}`")).collect();
    Some(format!("known are {}", all.join(", ")))
}
