//! Makes and checks docs/margins.md, the page of all distances, times, speeds and accelerations
//! that the code on board, or the planning on the host, decides by.
//!
//! It lists every f32 or f64 `const` of planner-core, companion and host-sim whose name ends in
//! `_M`, `_S`, `_MPS`, `_MPS2` or `_MPS3`: value, doc comment, and the files that use it. Two constants of one name are an
//! error.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

use anyhow::{Context, Result};
use syn::visit::{self, Visit};
use syn::{Expr, ExprLit, Item, Lit, Meta, Type};

use super::sources::{Source, Tree};

const PAGE: &str = "docs/margins.md";
const CRATES: [&str; 3] = ["planner-core", "companion", "host-sim"];
/// Ends of constants' names, and the unit that each means.
const UNITS: [(&str, &str); 5] =
    [("_M", "m"), ("_MPS", "m/s"), ("_MPS2", "m/s²"), ("_MPS3", "m/s³"), ("_S", "s")];
const HEAD: &str = "# Distances, times, speeds and accelerations\n\nEvery one that the code on board (planner-core, companion) \
or the host (host-sim) decides by, with its\nreason: margins, reserves, leads, windows, limits.\nMade from the sources: `FLOCKMATE_WRITE=1 cargo xtask structure`. How margins \
add up to an argument is in\n[safety.md](safety.md#margins). What a mission states itself (radius, margin, separation, speeds) is not here.\n";

struct Distance {
    value: String,
    unit: &'static str,
    reason: String,
    users: Vec<String>,
}

/// Compares docs/margins.md with the sources, or writes it where `FLOCKMATE_WRITE` is set. Returns
/// a line for each fault.
pub fn check_margins_page() -> Result<Vec<String>> {
    let mut sources = Vec::new();
    for name in CRATES {
        for tree in Tree::of_crate(Path::new(name))? {
            sources.extend(tree.sources);
        }
    }
    let mut wrong = Vec::new();
    let mut found: BTreeMap<(String, String), Distance> = BTreeMap::new();
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    for source in &sources {
        let file = source.path.display().to_string();
        for item in &source.items {
            let Item::Const(item) = item else { continue };
            let number = |kind| matches!(&*item.ty, Type::Path(path) if path.path.is_ident(kind));
            if !number("f32") && !number("f64") {
                continue;
            }
            let name = item.ident.to_string();
            let Some((_, unit)) = UNITS.into_iter().find(|(end, _)| name.ends_with(end)) else {
                continue;
            };
            if let Some(other) = names.insert(name.clone(), file.clone()) {
                wrong.push(format!("{file}: {name} is the name of another one in {other}"));
            }
            let text = fs::read_to_string(&source.path)?;
            let value = written(&text, &name).with_context(|| format!("{file}: {name}"))?;
            let reason = reason(&item.attrs);
            if reason.is_empty() {
                wrong.push(format!("{file}: {name} has no reason"));
            }
            found.insert((file.clone(), name), Distance { value, unit, reason, users: Vec::new() });
        }
    }
    for source in &sources {
        let mut used = Used(BTreeMap::new());
        source.items.iter().for_each(|item| used.visit_item(item));
        for ((_, name), distance) in &mut found {
            if used.0.contains_key(name) {
                distance.users.push(short(source));
            }
        }
    }
    let page = page(&found);
    if env::var_os("FLOCKMATE_WRITE").is_some() {
        fs::write(PAGE, &page)?;
    } else if fs::read_to_string(PAGE).ok().as_deref() != Some(&page) {
        wrong.push(format!(
            "{PAGE} is not that of the sources: FLOCKMATE_WRITE=1 cargo xtask structure"
        ));
    }
    Ok(wrong)
}

/// Collects the identifiers that expressions use.
struct Used(BTreeMap<String, ()>);

impl<'a> Visit<'a> for Used {
    fn visit_expr_path(&mut self, path: &'a syn::ExprPath) {
        if let Some(last) = path.path.segments.last() {
            self.0.insert(last.ident.to_string(), ());
        }
        visit::visit_expr_path(self, path);
    }
}

/// The value of constant `name` as the source's text has it.
fn written(text: &str, name: &str) -> Option<String> {
    let (_, rest) = text.split_once(&format!("const {name}: "))?;
    let (_, rest) = rest.split_once('=')?;
    let (value, _) = rest.split_once(';')?;
    Some(value.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The doc comment of an item, joined to one line of a Markdown table.
fn reason(attributes: &[syn::Attribute]) -> String {
    let line = |attribute: &syn::Attribute| {
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

fn short(source: &Source) -> String {
    let path = source.path.display().to_string();
    path.split_once("/src/").map_or(path.clone(), |(_, file)| file.to_owned())
}

fn page(found: &BTreeMap<(String, String), Distance>) -> String {
    let mut page = HEAD.to_owned();
    let mut before = "";
    for ((file, name), distance) in found {
        if file != before {
            let _ = write!(
                page,
                "\n`{file}`\n\n| name | value | unit | is | used in |\n|---|---|---|---|---|\n"
            );
            before = file;
        }
        let Distance { value, unit, reason, users } = distance;
        let users = users.join(", ");
        let _ = writeln!(page, "| `{name}` | {value} | {unit} | {reason} | {users} |");
    }
    page
}
