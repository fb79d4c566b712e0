//! Structs and functions beyond the limits.

use syn::visit::{self, Visit};
use syn::{FnArg, ImplItemFn, ItemFn, ItemStruct, Signature};

use super::sources::Tree;

/// Fields of a struct, but for settings and telemetry records.
const FIELDS: usize = 20;
/// Fields of `Companion`.
const COMPANION_FIELDS: usize = 12;
/// Lines of a function.
const LINES: usize = 60;
/// Arguments of a function, `self` not counted.
const ARGUMENTS: usize = 6;

const SETTINGS: &str = "settings: a field for each parameter that acts";
const DRAWS: &str = "what is drawn follows from the order of the draws, which one body shows";

const FIRMWARE: &str = "what the firmware remembers; each file of its folder changes what is its own";

/// Exceptions: file, name and reason.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    ("host-sim/src/autopilot/ardupilot/params.rs", "Tuning", SETTINGS),
    ("host-sim/src/autopilot/px4/params.rs", "Tuning", SETTINGS),
    ("host-sim/src/commands/companion.rs", "run", "the loop of a shell, in the order of the drain contract"),
    ("host-sim/src/autopilot/ardupilot/mod.rs", "Copter", FIRMWARE),
    (
        "host-sim/src/coverage/check.rs",
        "judge",
        "one pass over the pictures, each of which changes what the next adds",
    ),
    ("host-sim/src/coverage/export.rs", "items", "the items of a mission in their order"),
    ("tests/src/bin/deconfliction/cases.rs", "all", "a table of cases, a few lines each"),
    ("tests/src/meeting/autopilot.rs", "Autopilot", "the whole state of a vehicle and its autopilot, flat"),
    ("tests/src/meeting/scene/happenings.rs", "happenings", DRAWS),
    ("tests/src/meeting/scene/ways.rs", "way", DRAWS),
    ("tests/src/swarms.rs", "drawn", DRAWS),
];

/// What is beyond the limits, and why it may be.
pub fn beyond(tree: &Tree) -> Vec<(String, Option<&'static str>)> {
    let mut shape = Shape { file: String::new(), found: Vec::new() };
    for source in &tree.sources {
        shape.file = source.path.display().to_string();
        source.items.iter().for_each(|item| shape.visit_item(item));
    }
    shape.found
}

struct Shape {
    file: String,
    found: Vec<(String, Option<&'static str>)>,
}

impl Shape {
    fn judge(&mut self, name: &str, count: usize, most: usize, of: &str) {
        if count > most {
            let exception =
                EXCEPTIONS.iter().find(|(file, exception, _)| *file == self.file && *exception == name);
            let reason = exception.map(|(_, _, reason)| *reason);
            self.found.push((format!("{}: {name} has {count} {of}, more than {most}", self.file), reason));
        }
    }

    fn function(&mut self, signature: &Signature, lines: usize) {
        let name = signature.ident.to_string();
        let arguments = signature.inputs.iter().filter(|input| matches!(input, FnArg::Typed(_))).count();
        self.judge(&name, lines, LINES, "lines");
        self.judge(&name, arguments, ARGUMENTS, "arguments");
    }
}

impl Visit<'_> for Shape {
    fn visit_item_mod(&mut self, item: &syn::ItemMod) {
        if item.ident != "tests" {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_struct(&mut self, item: &ItemStruct) {
        let name = item.ident.to_string();
        let most = if name == "Companion" { COMPANION_FIELDS } else { FIELDS };
        self.judge(&name, item.fields.len(), most, "fields");
    }

    fn visit_item_fn(&mut self, item: &ItemFn) {
        self.function(&item.sig, lines(&item.block));
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &ImplItemFn) {
        self.function(&item.sig, lines(&item.block));
        visit::visit_impl_item_fn(self, item);
    }
}

/// Lines between the braces.
fn lines(block: &syn::Block) -> usize {
    let braces = block.brace_token.span;
    (braces.close().start().line - braces.open().start().line).saturating_sub(1)
}
