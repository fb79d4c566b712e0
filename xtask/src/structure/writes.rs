//! Finds fields that are written outside the module of their struct.
//!
//! The compiler sees to it for private fields and those of `pub(super)`. This looks at fields that
//! the whole crate can reach: `pub(crate)`, or `pub` in a struct that no other crate sees. The
//! sources have no types, so a field is known by its name: a write to `x.name` is foreign if a
//! struct elsewhere in the crate has such a field and no struct that the place may write has one.
//! Not looked at are names of one letter, a vector's, and names of records that other crates may
//! write: `pub` fields of public structs, here or in planner-core. A write is an assignment, a
//! `&mut` borrow, or a call of a method that changes an option or a container.

use std::collections::{BTreeMap, BTreeSet};

use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Item, ItemMod, ItemStruct, Member, Visibility};

use super::imports;
use super::sources::Tree;

/// Methods of options and containers that change them.
const CHANGING: [&str; 18] = [
    "take",
    "replace",
    "insert",
    "push",
    "push_back",
    "push_front",
    "pop",
    "pop_front",
    "clear",
    "retain",
    "extend",
    "extend_from_slice",
    "remove",
    "truncate",
    "fill",
    "iter_mut",
    "as_mut",
    "get_mut",
];

/// Names of the fields that other crates may write.
pub fn public_fields(tree: &Tree) -> BTreeSet<String> {
    let fields = fields(tree);
    let public =
        |(name, owners): (String, Vec<Reach>)| owners.contains(&Reach::All).then_some(name);
    fields.into_iter().filter_map(public).collect()
}

/// A line for each foreign write. Fields named in `records` are not looked at.
pub fn foreign(tree: &Tree, records: &BTreeSet<String>) -> Vec<String> {
    let fields = fields(tree);
    let mut found = Vec::new();
    for source in &tree.sources {
        let mut writes = Writes(Vec::new());
        source.items.iter().for_each(|item| writes.visit_item(item));
        for (name, line) in writes.0.into_iter().filter(|(name, _)| name.len() > 1) {
            let Some(owners) = fields.get(&name).filter(|_| !records.contains(&name)) else {
                continue;
            };
            let may_write = |owner: &Reach| match owner {
                Reach::All => true,
                Reach::Module(module) | Reach::Crate(module) => source.module.starts_with(module),
            };
            let owner = owners.iter().find_map(|owner| match owner {
                Reach::Crate(module) => Some(module.join("::")),
                Reach::All | Reach::Module(_) => None,
            });
            if let Some(owner) = owner.filter(|_| !owners.iter().any(may_write)) {
                found.push(format!(
                    "{}:{line}: writes `{name}` of a struct of {owner}",
                    source.path.display()
                ));
            }
        }
    }
    found
}

/// Who may write a field.
#[derive(PartialEq)]
enum Reach {
    /// Other crates too.
    All,
    /// By the compiler the whole crate, by our rule this module and what it contains.
    Crate(Vec<String>),
    /// This module and what it contains.
    Module(Vec<String>),
}

fn fields(tree: &Tree) -> BTreeMap<String, Vec<Reach>> {
    let public = public_modules(tree);
    let exported = imports::exported_names(tree);
    let mut fields =
        Fields { module: Vec::new(), is_public: false, exported, reach: BTreeMap::new() };
    for source in &tree.sources {
        fields.module.clone_from(&source.module);
        fields.is_public = public.contains(&source.module);
        source.items.iter().for_each(|item| fields.visit_item(item));
    }
    fields.reach
}

/// The modules that another crate reaches.
fn public_modules(tree: &Tree) -> BTreeSet<Vec<String>> {
    let mut public = BTreeSet::from([Vec::new()]);
    for source in &tree.sources {
        for item in &source.items {
            let Item::Mod(child) = item else { continue };
            if public.contains(&source.module) && matches!(child.vis, Visibility::Public(_)) {
                public.insert([source.module.clone(), vec![child.ident.to_string()]].concat());
            }
        }
    }
    public
}

/// Collects the structs' fields of a file.
struct Fields {
    module: Vec<String>,
    is_public: bool,
    /// Names that `pub use` gives to other crates.
    exported: BTreeSet<String>,
    reach: BTreeMap<String, Vec<Reach>>,
}

impl Visit<'_> for Fields {
    fn visit_item_struct(&mut self, item: &ItemStruct) {
        let is_public = self.is_public || self.exported.contains(&item.ident.to_string());
        for field in &item.fields {
            let Some(name) = &field.ident else { continue };
            let reach = match &field.vis {
                Visibility::Public(_) if is_public => Reach::All,
                Visibility::Public(_) => Reach::Crate(self.module.clone()),
                Visibility::Restricted(within) if within.path.is_ident("crate") => {
                    Reach::Crate(self.module.clone())
                }
                Visibility::Restricted(within) if within.path.is_ident("super") => Reach::Module(
                    self.module.split_last().map_or(Vec::new(), |(_, up)| up.to_vec()),
                ),
                Visibility::Restricted(_) | Visibility::Inherited => {
                    Reach::Module(self.module.clone())
                }
            };
            self.reach.entry(name.to_string()).or_default().push(reach);
        }
    }
}

/// Collects the fields that a file writes, each with its line.
struct Writes(Vec<(String, usize)>);

impl Writes {
    fn written(&mut self, place: &Expr) {
        match place {
            Expr::Field(field) => {
                if let Member::Named(name) = &field.member {
                    self.0.push((name.to_string(), name.span().start().line));
                }
            }
            Expr::Index(index) => self.written(&index.expr),
            Expr::Paren(inner) => self.written(&inner.expr),
            _ => {}
        }
    }
}

impl Visit<'_> for Writes {
    fn visit_item_mod(&mut self, item: &ItemMod) {
        if item.ident != "tests" {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_expr_assign(&mut self, assignment: &syn::ExprAssign) {
        self.written(&assignment.left);
        visit::visit_expr_assign(self, assignment);
    }

    fn visit_expr_binary(&mut self, binary: &syn::ExprBinary) {
        let assigns = matches!(
            binary.op,
            BinOp::AddAssign(_)
                | BinOp::SubAssign(_)
                | BinOp::MulAssign(_)
                | BinOp::DivAssign(_)
                | BinOp::BitAndAssign(_)
                | BinOp::BitOrAssign(_)
                | BinOp::BitXorAssign(_)
        );
        if assigns {
            self.written(&binary.left);
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_reference(&mut self, reference: &syn::ExprReference) {
        if reference.mutability.is_some() {
            self.written(&reference.expr);
        }
        visit::visit_expr_reference(self, reference);
    }

    fn visit_expr_method_call(&mut self, call: &syn::ExprMethodCall) {
        if CHANGING.contains(&call.method.to_string().as_str()) {
            self.written(&call.receiver);
        }
        visit::visit_expr_method_call(self, call);
    }
}
