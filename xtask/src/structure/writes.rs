//! Finds fields that are written outside the module of their struct.
//!
//! The compiler prevents such writes to private fields and those of `pub(super)`. This check is of
//! fields that the whole crate can reach: `pub(crate)`, or `pub` in a struct that no other crate
//! sees. A parsed source has no types, so a field is known by its name: a write to `x.name` is
//! foreign if a struct elsewhere in the crate has a field of this name and no struct that the place
//! may write has one. Two kinds of names are not checked: those of one letter (a vector's axes),
//! and those of fields that other crates may write (`pub` in a public struct, here or in
//! planner-core). A write is an assignment, a `&mut` borrow, or a call of a method that changes an
//! option or a container.

use std::collections::{BTreeMap, BTreeSet};

use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Item, ItemMod, ItemStruct, Member, Visibility};

use super::imports;
use super::sources::Tree;

/// Methods of options and containers that change them.
const CHANGING_METHODS: [&str; 18] = [
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
    let fields = reach_of_fields(tree);
    let public = |(name, owners): (String, Vec<FieldReach>)| {
        owners.contains(&FieldReach::All).then_some(name)
    };
    fields.into_iter().filter_map(public).collect()
}

/// A line for each foreign write. Fields named in `records` are not checked.
pub fn foreign_writes(tree: &Tree, records: &BTreeSet<String>) -> Vec<String> {
    let fields = reach_of_fields(tree);
    let mut found = Vec::new();
    for source in &tree.sources {
        let mut writes = WriteCollector(Vec::new());
        source.items.iter().for_each(|item| writes.visit_item(item));
        for (name, line) in writes.0.into_iter().filter(|(name, _)| name.len() > 1) {
            let Some(owners) = fields.get(&name).filter(|_| !records.contains(&name)) else {
                continue;
            };
            let may_write = |owner: &FieldReach| match owner {
                FieldReach::All => true,
                FieldReach::Module(module) | FieldReach::Crate(module) => {
                    source.module.starts_with(module)
                }
            };
            let owner = owners.iter().find_map(|owner| match owner {
                FieldReach::Crate(module) => Some(module.join("::")),
                FieldReach::All | FieldReach::Module(_) => None,
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

/// Which code may write a field.
#[derive(PartialEq)]
enum FieldReach {
    /// Other crates too.
    All,
    /// By the compiler the whole crate, by our rule this module and what it contains.
    Crate(Vec<String>),
    /// This module and what it contains.
    Module(Vec<String>),
}

/// For each name of a field: the reach of each field of the crate that has this name.
fn reach_of_fields(tree: &Tree) -> BTreeMap<String, Vec<FieldReach>> {
    let public = public_modules(tree);
    let exported = imports::exported_names(tree);
    let mut fields =
        FieldCollector { module: Vec::new(), is_public: false, exported, reach: BTreeMap::new() };
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
struct FieldCollector {
    /// The module at which the visit is.
    module: Vec<String>,
    /// Whether that module is public.
    is_public: bool,
    /// Names that `pub use` gives to other crates.
    exported: BTreeSet<String>,
    reach: BTreeMap<String, Vec<FieldReach>>,
}

impl Visit<'_> for FieldCollector {
    fn visit_item_struct(&mut self, item: &ItemStruct) {
        let is_public = self.is_public || self.exported.contains(&item.ident.to_string());
        for field in &item.fields {
            let Some(name) = &field.ident else { continue };
            let reach = match &field.vis {
                Visibility::Public(_) if is_public => FieldReach::All,
                Visibility::Public(_) => FieldReach::Crate(self.module.clone()),
                Visibility::Restricted(within) if within.path.is_ident("crate") => {
                    FieldReach::Crate(self.module.clone())
                }
                Visibility::Restricted(within) if within.path.is_ident("super") => {
                    FieldReach::Module(
                        self.module.split_last().map_or(Vec::new(), |(_, up)| up.to_vec()),
                    )
                }
                Visibility::Restricted(_) | Visibility::Inherited => {
                    FieldReach::Module(self.module.clone())
                }
            };
            self.reach.entry(name.to_string()).or_default().push(reach);
        }
    }
}

/// Collects the fields that a file writes, each with its line.
struct WriteCollector(Vec<(String, usize)>);

impl WriteCollector {
    /// Notes the field that `place` ends in, also behind an index.
    fn note_written_field(&mut self, place: &Expr) {
        match place {
            Expr::Field(field) => {
                if let Member::Named(name) = &field.member {
                    self.0.push((name.to_string(), name.span().start().line));
                }
            }
            Expr::Index(index) => self.note_written_field(&index.expr),
            Expr::Paren(inner) => self.note_written_field(&inner.expr),
            _ => {}
        }
    }
}

impl Visit<'_> for WriteCollector {
    fn visit_item_mod(&mut self, item: &ItemMod) {
        if item.ident != "tests" {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_expr_assign(&mut self, assignment: &syn::ExprAssign) {
        self.note_written_field(&assignment.left);
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
            self.note_written_field(&binary.left);
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_reference(&mut self, reference: &syn::ExprReference) {
        if reference.mutability.is_some() {
            self.note_written_field(&reference.expr);
        }
        visit::visit_expr_reference(self, reference);
    }

    fn visit_expr_method_call(&mut self, call: &syn::ExprMethodCall) {
        if CHANGING_METHODS.contains(&call.method.to_string().as_str()) {
            self.note_written_field(&call.receiver);
        }
        visit::visit_expr_method_call(self, call);
    }
}
