//! The module tree of a crate: every file, and the modules that it defines.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::{Attribute, Item};

/// One parsed source file, without its test items.
pub struct Source {
    /// Path from the root of the repository.
    pub path: PathBuf,
    /// Module path of the file, from the crate's root.
    pub module: Vec<String>,
    /// Top-level items of the file.
    pub items: Vec<Item>,
}

/// The files of one crate root (library or program).
pub struct Tree {
    /// Every file that the root reaches by `mod`.
    pub sources: Vec<Source>,
    /// Index in `sources` of the file that holds each module; inline modules included.
    pub modules: BTreeMap<Vec<String>, usize>,
}

impl Tree {
    /// The trees of a crate: its library, its program, and the programs in `src/bin`.
    pub fn trees_of_crate(folder: &Path) -> Result<Vec<Self>> {
        let source = folder.join("src");
        let mut roots = vec![source.join("lib.rs"), source.join("main.rs")];
        if let Ok(programs) = fs::read_dir(source.join("bin")) {
            for program in programs {
                let path = program?.path();
                roots.push(if path.is_dir() { path.join("main.rs") } else { path });
            }
        }
        roots.sort();
        roots.iter().filter(|root| root.exists()).map(|root| Self::from_root(root)).collect()
    }

    /// All files of the crate with this root.
    fn from_root(root: &Path) -> Result<Self> {
        let mut tree = Self { sources: Vec::new(), modules: BTreeMap::new() };
        let folder = root.parent().context("a root lies in a folder")?;
        tree.read_file(root, folder, &[])?;
        Ok(tree)
    }

    /// Parses the file `path` and, recursively, the files of its modules, which lie in `folder`.
    fn read_file(&mut self, path: &Path, folder: &Path, module: &[String]) -> Result<()> {
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let file = syn::parse_file(&text).with_context(|| path.display().to_string())?;
        let items: Vec<Item> =
            file.items.into_iter().filter(|item| !is_test_only(attributes(item))).collect();
        let at = self.sources.len();
        self.modules.insert(module.to_vec(), at);
        self.sources.push(Source {
            path: path.to_owned(),
            module: module.to_vec(),
            items: items.clone(),
        });
        self.read_modules(&items, path, folder, module, at)
    }

    /// Reads the modules that `items` of the file `path` define; `at` is the file's index in
    /// `sources`.
    fn read_modules(
        &mut self,
        items: &[Item],
        path: &Path,
        folder: &Path,
        module: &[String],
        at: usize,
    ) -> Result<()> {
        for item in items {
            let Item::Mod(child) = item else { continue };
            let name = child.ident.to_string();
            let mut inner = module.to_vec();
            inner.push(name.clone());
            if let Some((_, items)) = &child.content {
                self.modules.insert(inner.clone(), at);
                self.read_modules(items, path, &folder.join(&name), &inner, at)?;
                continue;
            }
            let named = path_attribute(&child.attrs).map(|named| path.with_file_name(named));
            let places = [folder.join(format!("{name}.rs")), folder.join(&name).join("mod.rs")];
            let found = named.or_else(|| places.into_iter().find(|place| place.exists()));
            let found =
                found.with_context(|| format!("{}: no file of mod {name}", path.display()))?;
            self.read_file(&found, &folder.join(&name), &inner)?;
        }
        Ok(())
    }
}

/// Attributes of an item.
fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Mod(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        _ => &[],
    }
}

/// Whether an item with these attributes is compiled for tests only (`#[cfg(test)]`).
fn is_test_only(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Meta>().is_ok_and(|meta| meta.path().is_ident("test"))
    })
}

/// The file name in `#[path = "…"]`.
fn path_attribute(attributes: &[Attribute]) -> Option<String> {
    attributes.iter().find_map(|attribute| {
        let syn::Meta::NameValue(pair) = &attribute.meta else { return None };
        let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) = &pair.value else {
            return None;
        };
        pair.path.is_ident("path").then(|| text.value())
    })
}
