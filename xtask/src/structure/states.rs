//! Finds sets of the mission's states that are written out: they are to be predicates of `State`,
//! in its file, so that a new state is placed in all of them at once.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result};
use syn::parse::{ParseStream, Parser};
use syn::visit::{self, Visit};
use syn::{Expr, Ident, Item, ItemEnum, Macro, Pat, PatOr, Token};

use super::sources::Tree;

/// The file of the enum `State`.
const STATE_FILE: &str = "companion/src/state.rs";
/// Files and folders that may name several states at once: those of `State`, the table, and tests.
const MAY_NAME_STATE_SETS: [&str; 4] =
    [STATE_FILE, "companion/src/state", "companion/src/mission/table.rs", "tests/src"];

/// Names of the mission's states.
pub fn state_names() -> Result<BTreeSet<String>> {
    let trees = Tree::trees_of_crate(Path::new("companion"))?;
    let items =
        trees.iter().flat_map(|tree| &tree.sources).filter(|s| s.path.ends_with("state.rs"));
    let states = items.flat_map(|source| &source.items).find_map(|item| match item {
        Item::Enum(item) if item.ident == "State" => Some(item),
        _ => None,
    });
    Ok(variant_names(states.context(STATE_FILE)?))
}

/// Names of an enum's variants.
fn variant_names(item: &ItemEnum) -> BTreeSet<String> {
    item.variants.iter().map(|variant| variant.ident.to_string()).collect()
}

/// A line for each pattern that names two or more states.
pub fn written_out_state_sets(tree: &Tree, names: &BTreeSet<String>) -> Vec<String> {
    let mut found = Vec::new();
    for source in &tree.sources {
        if MAY_NAME_STATE_SETS.iter().any(|place| source.path.starts_with(place)) {
            continue;
        }
        let file = source.path.display();
        let sets = lines_of_state_sets(&source.items, names).into_iter();
        found.extend(sets.map(|line| {
            format!("{file}:{line} names several states: a set of them is a predicate of `State`")
        }));
    }
    found
}

/// Line numbers of the patterns in `items` that name two or more states.
fn lines_of_state_sets(items: &[Item], names: &BTreeSet<String>) -> Vec<usize> {
    let mut sets = StateSetVisitor { names, lines: Vec::new() };
    items.iter().for_each(|item| sets.visit_item(item));
    sets.lines
}

/// Collects the lines of patterns that name two or more states.
struct StateSetVisitor<'a> {
    /// Names of all states.
    names: &'a BTreeSet<String>,
    /// Lines of the patterns found so far.
    lines: Vec<usize>,
}

impl StateSetVisitor<'_> {
    /// The state that a pattern is: `State::Name`, or the bare name after `use State::*`.
    fn state_name<'p>(&self, pattern: &'p Pat) -> Option<&'p Ident> {
        let (name, kind) = match pattern {
            Pat::Ident(bare) => (&bare.ident, None),
            Pat::Path(path) => {
                let mut parts = path.path.segments.iter().rev().map(|part| &part.ident);
                (parts.next()?, parts.next())
            }
            _ => return None,
        };
        let is_state =
            kind.is_none_or(|kind| kind == "State") && self.names.contains(&name.to_string());
        is_state.then_some(name)
    }
}

impl Visit<'_> for StateSetVisitor<'_> {
    fn visit_pat_or(&mut self, pattern: &PatOr) {
        let mut states = pattern.cases.iter().filter_map(|case| self.state_name(case));
        if let (Some(first), Some(_)) = (states.next(), states.next()) {
            self.lines.push(first.span().start().line);
        }
        visit::visit_pat_or(self, pattern);
    }

    fn visit_macro(&mut self, call: &Macro) {
        if call.path.is_ident("matches")
            && let Ok(pattern) = pattern_of_matches.parse2(call.tokens.clone())
        {
            self.visit_pat(&pattern);
        }
    }
}

/// The pattern of `matches!(value, pattern if guard)`.
fn pattern_of_matches(input: ParseStream<'_>) -> syn::Result<Pat> {
    input.parse::<Expr>()?;
    input.parse::<Token![,]>()?;
    let pattern = Pat::parse_multi_with_leading_vert(input)?;
    input.parse::<proc_macro2::TokenStream>()?;
    Ok(pattern)
}

#[cfg(test)]
mod tests;
