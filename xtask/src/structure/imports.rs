//! Finds import cycles between the files of a crate.

use std::collections::BTreeSet;

use syn::visit::{self, Visit};
use syn::{Item, ItemMod, ItemUse, UseTree, Visibility};

use super::sources::{Source, Tree};

/// Most `pub use` items in a row that are followed to find the file that defines an item.
const MAX_REEXPORTS: usize = 6;

/// Every cycle: a set of files that import each other, directly or not. Each cycle is returned as
/// the list of its imports, `file → file`.
pub fn import_cycles(tree: &Tree) -> Vec<Vec<String>> {
    let imports: Vec<BTreeSet<usize>> =
        (0..tree.sources.len()).map(|at| files_imported_by(tree, at)).collect();
    let reach: Vec<BTreeSet<usize>> =
        (0..imports.len()).map(|at| reachable_files(&imports, at)).collect();
    let mut seen: BTreeSet<usize> = BTreeSet::new();
    let mut found = Vec::new();
    for (at, from_here) in reach.iter().enumerate() {
        if !from_here.contains(&at) || seen.contains(&at) {
            continue;
        }
        let cycle: Vec<usize> =
            from_here.iter().copied().filter(|other| reach[*other].contains(&at)).collect();
        seen.extend(&cycle);
        found.push(imports_within(tree, &imports, &cycle));
    }
    found
}

/// The imports between the files of a cycle, each as `file → file`.
fn imports_within(tree: &Tree, imports: &[BTreeSet<usize>], cycle: &[usize]) -> Vec<String> {
    let name = |file: usize| tree.sources[file].path.display().to_string();
    let of = |from: usize| {
        cycle.iter().filter(move |to| imports[from].contains(to)).map(move |to| (from, *to))
    };
    cycle
        .iter()
        .flat_map(|from| of(*from))
        .map(|(from, to)| format!("{} → {}", name(from), name(to)))
        .collect()
}

/// Files that the file `from` imports, directly or through others; itself only in a cycle.
fn reachable_files(imports: &[BTreeSet<usize>], from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<usize> = imports[from].iter().copied().collect();
    while let Some(file) = open.pop() {
        if reached.insert(file) {
            open.extend(&imports[file]);
        }
    }
    reached
}

/// Files, by index, that the file `at` imports.
fn files_imported_by(tree: &Tree, at: usize) -> BTreeSet<usize> {
    let file = |import| match import {
        Import::File(file) => Some(file),
        Import::Named(_) => None,
    };
    imports_of(tree, at).into_iter().filter_map(file).collect()
}

/// What a path of a file leads to.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub enum Import {
    /// The file with this index in the tree.
    File(usize),
    /// Another crate, or something in scope, by its name.
    Named(String),
}

/// What the file with index `at` imports.
pub fn imports_of(tree: &Tree, at: usize) -> BTreeSet<Import> {
    let source = &tree.sources[at];
    let mut paths = ItemPaths { module: source.module.clone(), found: Vec::new() };
    source.items.iter().for_each(|item| paths.visit_item(item));
    let imports = paths.found.iter().filter_map(|(module, path)| {
        let file = defining_file(tree, module, path, MAX_REEXPORTS).map(Import::File);
        file.or_else(|| path.first().cloned().map(Import::Named))
    });
    imports.filter(|import| *import != Import::File(at)).collect()
}

/// Collects the item paths in a file, each with the module in which it stands.
struct ItemPaths {
    /// The module at which the visit is.
    module: Vec<String>,
    /// Module and path of each path found.
    found: Vec<(Vec<String>, Vec<String>)>,
}

impl Visit<'_> for ItemPaths {
    /// Visits nothing: a path in `pub(in path)` is no import.
    fn visit_visibility(&mut self, _: &Visibility) {}

    fn visit_item_mod(&mut self, item: &ItemMod) {
        let name = item.ident.to_string();
        if item.content.is_some() && name != "tests" {
            self.module.push(name);
            visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_item_use(&mut self, item: &ItemUse) {
        for_each_used_path(&item.tree, &mut Vec::new(), &mut |path, _| {
            self.found.push((self.module.clone(), path));
        });
    }

    fn visit_path(&mut self, path: &syn::Path) {
        let path_names: Vec<String> =
            path.segments.iter().map(|part| part.ident.to_string()).collect();
        if path_names.len() > 1 {
            self.found.push((self.module.clone(), path_names));
        }
        visit::visit_path(self, path);
    }
}

/// Names that a `pub use` of the crate brings into scope.
pub fn exported_names(tree: &Tree) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for item in tree.sources.iter().flat_map(|source| &source.items) {
        if let Item::Use(item) = item
            && matches!(item.vis, Visibility::Public(_))
        {
            for_each_used_path(&item.tree, &mut Vec::new(), &mut |_, name| {
                names.insert(name);
            });
        }
    }
    names
}

/// Calls `give` for every path of a `use`, with the name that it brings into scope.
fn for_each_used_path(
    tree: &UseTree,
    before: &mut Vec<String>,
    give: &mut impl FnMut(Vec<String>, String),
) {
    match tree {
        UseTree::Path(part) => {
            before.push(part.ident.to_string());
            for_each_used_path(&part.tree, before, give);
            before.pop();
        }
        UseTree::Name(name) => {
            let name = name.ident.to_string();
            let mut path = before.clone();
            if name != "self" {
                path.push(name);
            }
            let last = path.last().cloned().unwrap_or_default();
            give(path, last);
        }
        UseTree::Rename(pair) => {
            let mut path = before.clone();
            path.push(pair.ident.to_string());
            give(path, pair.rename.to_string());
        }
        UseTree::Glob(_) => give([before.clone(), vec!["*".to_owned()]].concat(), "*".to_owned()),
        UseTree::Group(group) => {
            group.items.iter().for_each(|tree| for_each_used_path(tree, before, give));
        }
    }
}

/// Index in `tree.sources` of the file that defines the item that `path`, used in `module`, names;
/// `None` if it is in another crate. `passed_on` is the number of `pub use` items that may still be
/// followed.
fn defining_file(
    tree: &Tree,
    module: &[String],
    path: &[String],
    passed_on: usize,
) -> Option<usize> {
    let (first, rest) = path.split_first()?;
    let whole = match first.as_str() {
        "crate" => rest.to_vec(),
        "self" => [module, rest].concat(),
        "super" => {
            let up = path.iter().take_while(|part| *part == "super").count();
            [&module[..module.len().checked_sub(up)?], &path[up..]].concat()
        }
        _ => {
            let whole = [module, path].concat();
            tree.modules.contains_key(&whole[..=module.len()]).then_some(whole)?
        }
    };
    let length =
        (0..=whole.len()).rev().find(|length| tree.modules.contains_key(&whole[..*length]))?;
    let file = tree.modules[&whole[..length]];
    match whole.get(length) {
        Some(name) if passed_on > 0 => Some(
            reexported_file(tree, &tree.sources[file], &whole[..length], name, passed_on)
                .unwrap_or(file),
        ),
        _ => Some(file),
    }
}

/// Index of the file that defines `name`, which `source` re-exports by `pub use`; `None` if
/// `source` does not.
fn reexported_file(
    tree: &Tree,
    source: &Source,
    module: &[String],
    name: &str,
    left: usize,
) -> Option<usize> {
    let mut behind = None;
    for item in &source.items {
        let Item::Use(item) = item else { continue };
        if matches!(item.vis, Visibility::Inherited) {
            continue;
        }
        for_each_used_path(&item.tree, &mut Vec::new(), &mut |path, given| {
            if given == name {
                behind = behind.or_else(|| defining_file(tree, module, &path, left - 1));
            }
        });
    }
    behind
}
