//! Makes and checks docs/margins.md, the page of all distances, times, speeds and accelerations
//! that the code on board, or the planning on the host, decides by.
//!
//! It lists the constants of planner-core, companion and host-sim that are a number, an array, a
//! tuple, a range or a `Point` with a unit at the end of the name (`UNITS`),
//! and every constant that is a `Duration`: top-level ones, those of an `impl`, and those within a
//! function. Each has its value, its doc comment, and the files that use it. A constant without a
//! reason and two constants of one name are errors. A `usize` is an index or a count, and is not
//! listed.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;
use std::{env, fs};

use anyhow::Result;
use proc_macro2::Span;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, ExprLit, GenericArgument, Ident, Item, Lit, Meta, PathArguments, Type};

use super::sources::{Source, Tree};

/// The page.
const PAGE: &str = "docs/margins.md";
/// Crates whose constants the page lists.
const CRATES: [&str; 3] = ["planner-core", "companion", "host-sim"];
/// Published figures that the plans are compared with: nothing is decided by them.
const PUBLISHED_FIGURES: &str = "host-sim/src/paper/";
/// Ends of constants' names, and the unit that each means; of two that fit, the first holds.
const UNITS: [(&str, &str); 12] = [
    ("_BYTES_PER_S", "byte/s"),
    ("_PER_S", "1/s"),
    ("_PER_S2", "1/s²"),
    ("_M", "m"),
    ("_CM", "cm"),
    ("_MM", "mm"),
    ("_MPS", "m/s"),
    ("_MPS2", "m/s²"),
    ("_MPS3", "m/s³"),
    ("_S", "s"),
    ("_MS", "ms"),
    ("_US", "µs"),
];
/// Types of one number with a unit.
const NUMBER_TYPES: [&str; 11] =
    ["f32", "f64", "u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "Point"];
/// Functions that make a `Duration` of a whole number, and how many of it are a second.
const DURATION_CONSTRUCTORS: [(&str, u64); 4] =
    [("secs", 1), ("from_secs", 1), ("from_millis", 1_000), ("from_micros", 1_000_000)];
const PAGE_HEAD: &str = "# Distances, times, speeds and accelerations

Every one that the code on board (planner-core, companion) or the host (host-sim) decides by, with
its reason: margins, reserves, leads, windows, limits. A duration is in seconds. Made from the
sources: `FLOCKMATE_WRITE=1 cargo xtask structure`. How margins add up to an argument is in
[safety.md](safety.md#margins). What a mission states itself (radius, margin, separation, speeds) is
not here.
";

/// What the page shows of a constant.
struct PageRow {
    /// The value as the source has it.
    value: String,
    unit: &'static str,
    /// Its doc comment.
    reason: String,
    /// Files whose code names it.
    users: Vec<String>,
}

/// The listed constants, by file and name.
type RowsByFileAndName = BTreeMap<(String, String), PageRow>;

/// Compares docs/margins.md with the sources, or writes it where `FLOCKMATE_WRITE` is set. Returns
/// a line for each fault.
pub fn check_margins_page() -> Result<Vec<String>> {
    let mut sources = Vec::new();
    for name in CRATES {
        for tree in Tree::trees_of_crate(Path::new(name))? {
            sources.extend(tree.sources);
        }
    }
    let mut listing = Listing::default();
    for source in &sources {
        let file = source.path.display().to_string();
        if !file.starts_with(PUBLISHED_FIGURES) {
            listing.add(&file, &source.items, &fs::read_to_string(&source.path)?);
        }
    }
    let Listing { rows: mut found, faults: mut wrong, .. } = listing;
    for source in &sources {
        let mut used = UsedNames(BTreeSet::new());
        source.items.iter().for_each(|item| used.visit_item(item));
        for ((_, name), distance) in &mut found {
            if used.0.contains(name) {
                distance.users.push(path_in_crate(source));
            }
        }
    }
    let page = page_text(&found);
    if env::var_os("FLOCKMATE_WRITE").is_some() {
        fs::write(PAGE, &page)?;
    } else if fs::read_to_string(PAGE).ok().as_deref() != Some(&page) {
        wrong.push(format!(
            "{PAGE} is not that of the sources: FLOCKMATE_WRITE=1 cargo xtask structure"
        ));
    }
    Ok(wrong)
}

/// The constants for docs/margins.md found in the files so far, and what is wrong with them.
#[derive(Default)]
struct Listing {
    /// The rows of the page.
    rows: RowsByFileAndName,
    /// The file of each name.
    files: BTreeMap<String, String>,
    /// A line for each constant without a doc comment, or with the name of another one.
    faults: Vec<String>,
}

impl Listing {
    /// Adds the constants of a file's items; `text` is the whole file.
    fn add(&mut self, file: &str, items: &[Item], text: &str) {
        let mut constants = Constants(Vec::new());
        items.iter().for_each(|item| constants.visit_item(item));
        for Constant { name, unit, reason, seconds, bytes } in constants.0 {
            if let Some(other) = self.files.insert(name.clone(), file.to_owned()) {
                self.faults.push(format!("{file}: {name} is the name of another one in {other}"));
            }
            if reason.is_empty() {
                self.faults.push(format!("{file}: {name} has no reason"));
            }
            let value = seconds.unwrap_or_else(|| in_one_line(&text[bytes]));
            let distance = PageRow { value, unit, reason, users: Vec::new() };
            self.rows.insert((file.to_owned(), name), distance);
        }
    }
}

/// A constant that the page lists, as it was parsed.
struct Constant {
    name: String,
    unit: &'static str,
    /// The doc comment.
    reason: String,
    /// The value of a `Duration` in seconds, if a whole number makes it.
    seconds: Option<String>,
    /// Bytes of the file that hold the value.
    bytes: Range<usize>,
}

/// Collects the constants that the page lists.
struct Constants(Vec<Constant>);

impl Constants {
    fn add(
        &mut self,
        name: &Ident,
        kind: &Type,
        attributes: &[Attribute],
        value: &ValueTokens<'_>,
    ) {
        let name = name.to_string();
        let Some(unit) = listed_unit(&name, kind) else { return };
        let seconds =
            is_type_named(kind, "Duration").then(|| duration_seconds(value.expression)).flatten();
        let bytes = value.equals_sign.byte_range().end..value.semicolon.byte_range().start;
        self.0.push(Constant { name, unit, reason: doc_comment_line(attributes), seconds, bytes });
    }
}

/// The value of a constant, between `=` and `;`.
struct ValueTokens<'a> {
    expression: &'a Expr,
    equals_sign: Span,
    semicolon: Span,
}

impl<'a> Visit<'a> for Constants {
    fn visit_item_const(&mut self, item: &'a syn::ItemConst) {
        let (after, before) = (item.eq_token.spans[0], item.semi_token.spans[0]);
        self.add(
            &item.ident,
            &item.ty,
            &item.attrs,
            &ValueTokens { expression: &item.expr, equals_sign: after, semicolon: before },
        );
        visit::visit_item_const(self, item);
    }

    fn visit_impl_item_const(&mut self, item: &'a syn::ImplItemConst) {
        let (after, before) = (item.eq_token.spans[0], item.semi_token.spans[0]);
        self.add(
            &item.ident,
            &item.ty,
            &item.attrs,
            &ValueTokens { expression: &item.expr, equals_sign: after, semicolon: before },
        );
        visit::visit_impl_item_const(self, item);
    }
}

/// The unit of a constant, if the page lists constants of its name and type.
fn listed_unit(name: &str, kind: &Type) -> Option<&'static str> {
    if is_type_named(kind, "Duration") {
        return Some("s");
    }
    let (_, unit) = UNITS.into_iter().find(|(end, _)| name.ends_with(end))?;
    is_numeric(kind).then_some(unit)
}

/// Whether a type holds numbers with a unit only.
fn is_numeric(kind: &Type) -> bool {
    match kind {
        Type::Array(array) => is_numeric(&array.elem),
        Type::Tuple(tuple) => tuple.elems.iter().all(is_numeric),
        Type::Path(path) => path.path.segments.last().is_some_and(|last| match &last.arguments {
            PathArguments::AngleBracketed(inner) if last.ident.to_string().starts_with("Range") => {
                inner.args.iter().all(|inner| match inner {
                    GenericArgument::Type(inner) => is_numeric(inner),
                    _ => false,
                })
            }
            PathArguments::None => NUMBER_TYPES.iter().any(|number| last.ident == number),
            _ => false,
        }),
        _ => false,
    }
}

/// Whether a type's last name is `name`.
fn is_type_named(kind: &Type, name: &str) -> bool {
    let Type::Path(path) = kind else { return false };
    path.path.segments.last().is_some_and(|last| last.ident == name)
}

/// The seconds of a `Duration` that a whole number makes.
fn duration_seconds(value: &Expr) -> Option<String> {
    let Expr::Call(call) = value else { return None };
    let Expr::Path(maker) = &*call.func else { return None };
    let maker = &maker.path.segments.last()?.ident;
    let (_, second) = DURATION_CONSTRUCTORS.into_iter().find(|(name, _)| maker == name)?;
    let Some(Expr::Lit(ExprLit { lit: Lit::Int(number), .. })) = call.args.first() else {
        return None;
    };
    let number: u64 = number.base10_parse().ok()?;
    let digits = second.ilog10() as usize;
    let rest = format!("{:0digits$}", number % second);
    let rest = if digits == 0 { "" } else { rest.trim_end_matches('0') };
    Some(format!("{}.{}", number / second, if rest.is_empty() { "0" } else { rest }))
}

/// Collects the identifiers that expressions use.
struct UsedNames(BTreeSet<String>);

impl<'a> Visit<'a> for UsedNames {
    fn visit_expr_path(&mut self, path: &'a syn::ExprPath) {
        if let Some(last) = path.path.segments.last() {
            self.0.insert(last.ident.to_string());
        }
        visit::visit_expr_path(self, path);
    }
}

/// The text on one line, with single spaces.
fn in_one_line(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    line.replace("[ ", "[").replace(", ]", "]").replace(" ]", "]")
}

/// The doc comment of an item, joined to one line of a Markdown table.
fn doc_comment_line(attributes: &[Attribute]) -> String {
    let line = |attribute: &Attribute| {
        let Meta::NameValue(meta) = &attribute.meta else { return None };
        let Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) = &meta.value else { return None };
        attribute.path().is_ident("doc").then(|| text.value().trim().to_owned())
    };
    attributes
        .iter()
        .filter_map(line)
        .collect::<Vec<_>>()
        .join(" ")
        .replace('|', "\\|")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// Path of the file in its crate's `src`.
fn path_in_crate(source: &Source) -> String {
    let path = source.path.display().to_string();
    path.split_once("/src/").map_or(path.clone(), |(_, file)| file.to_owned())
}

/// The page with these rows.
fn page_text(found: &RowsByFileAndName) -> String {
    let mut page = PAGE_HEAD.to_owned();
    let mut before = "";
    for ((file, name), distance) in found {
        if file != before {
            let _ = write!(
                page,
                "\n`{file}`\n\n| name | value | unit | is | used in |\n|---|---|---|---|---|\n"
            );
            before = file;
        }
        let PageRow { value, unit, reason, users } = distance;
        let users = users.join(", ");
        let _ = writeln!(page, "| `{name}` | {value} | {unit} | {reason} | {users} |");
    }
    page
}

#[cfg(test)]
mod tests;
