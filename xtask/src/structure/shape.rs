//! Finds structs and functions beyond the limits of size, and functions that take a `bool`.

use syn::visit::{self, Visit};
use syn::{FnArg, ImplItemFn, ItemFn, ItemStruct, Signature, TraitItemFn, Type};

use super::sources::Tree;

/// Most fields of a struct.
const MAX_FIELDS: usize = 20;
/// Most fields of `Companion`.
const MAX_COMPANION_FIELDS: usize = 12;
/// Most lines of a function's body.
const MAX_BODY_LINES: usize = 60;
/// Most arguments of a function, without `self`.
const MAX_ARGUMENTS: usize = 6;

// Reasons that several exceptions share.
const SETTINGS: &str = "settings: a field for each parameter that acts";
const DRAWS: &str = "what is drawn follows from the order of the draws, which one body shows";

const FIRMWARE: &str =
    "what the firmware remembers; each file of its folder changes what is its own";

const AT_LIMITS: &str = "one call after the other, each at its limits";

/// Exceptions from the limits: file, name of the struct or function, and reason.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    (
        "companion/src/autopilot/telemetry.rs",
        "Telemetry",
        "a telemetry record: what the autopilot said last",
    ),
    (
        "companion/src/autopilot/telemetry.rs",
        "handle_frame",
        "one match: an arm for each message of the autopilot",
    ),
    (
        "companion/src/companion/inputs.rs",
        "guard_inputs",
        "a line for each fact that a guard of the table asks for",
    ),
    (
        "companion/src/companion/actions.rs",
        "run_action",
        "one match: an arm for each action of the table",
    ),
    ("companion/src/config.rs", "Config", SETTINGS),
    (
        "companion/src/guidance.rs",
        "Guidance",
        "phases of one reference that a step reads together; the smoother and the filter are parts of their own",
    ),
    (
        "companion/src/guidance.rs",
        "step",
        "the one function that all setpoints pass, in its order: advice, filter, reference, output check",
    ),
    (
        "companion/src/guidance/smoother.rs",
        "SetpointSmoother",
        "the history of one smoothed curve, flat for speed: no half of it stands alone",
    ),
    (
        "companion/src/guidance/filter/conflict.rs",
        "first_conflict",
        "one look at a neighbour, in the order of docs/safety.md",
    ),
    (
        "companion/src/guidance/filter/step.rs",
        "step_filter",
        "one decision, in the order of docs/safety.md",
    ),
    (
        "companion/src/guidance/raw.rs",
        "next_raw_point",
        "what one step has at hand; the scene lacks what it changes",
    ),
    (
        "companion/src/link/outbox.rs",
        "write_first",
        "one match: an arm for each kind of message, in the order in which they are due",
    ),
    (
        "companion/src/mission/inputs.rs",
        "GuardInputs",
        "a record: a field for each fact that a guard of the table asks for",
    ),
    ("companion/src/mission/guard.rs", "is_met", "one match: an arm for each guard"),
    ("companion/src/mission/pending.rs", "apply_command", "one match: an arm for each command"),
    (
        "companion/src/planner/coverage.rs",
        "plan_flights",
        "the steps of a coverage plan, in their order",
    ),
    ("companion/src/services/ftp.rs", "begin_request", "one match: an arm for each operation"),
    ("companion/src/storage/mission_file.rs", "parse", "the file, in the order of its parts"),
    (
        "companion/src/storage/store/jobs.rs",
        "poll_request",
        "one match: an arm for each state of a job",
    ),
    (
        "companion/src/storage/store/jobs.rs",
        "handle_flash_outcome",
        "one match: an arm for each job and how it went",
    ),
    (
        "companion/src/replanning/detour.rs",
        "Detours",
        "what is known of a blocked path, flat: reset as a whole where a path begins",
    ),
    (
        "companion/src/swarm/neighbours/entry.rs",
        "NeighbourEntry",
        "a telemetry record: what one neighbour said last",
    ),
    ("board-bench/src/calls/limits.rs", "call_sampling", AT_LIMITS),
    ("board-bench/src/calls/limits_graph.rs", "call_roadmap_files", AT_LIMITS),
    ("board-bench/src/calls/limits_routes.rs", "call_plans", AT_LIMITS),
    ("board-bench/src/calls/limits_routes.rs", "call_schedules", AT_LIMITS),
    ("board-bench/src/calls/limits_routes.rs", "call_detours", AT_LIMITS),
    ("sim-autopilot/src/ardupilot/params.rs", "CopterTuning", SETTINGS),
    ("sim-autopilot/src/px4/params.rs", "Px4Tuning", SETTINGS),
    (
        "host-sim/src/commands/companion.rs",
        "run",
        "the loop of a shell, in the order of the drain contract",
    ),
    ("sim-autopilot/src/inbox.rs", "handle_frame", "one match: an arm for each message"),
    ("sim-autopilot/src/px4/commands.rs", "handle_command", "one match: an arm for each command"),
    ("sim-autopilot/src/ardupilot.rs", "Copter", FIRMWARE),
    ("sim-autopilot/src/px4.rs", "Commander", FIRMWARE),
    (
        "host-sim/src/coverage/check.rs",
        "count_photographed_cells",
        "one pass over the pictures, each of which changes what the next adds",
    ),
    ("host-sim/src/coverage/export.rs", "flight_items", "the items of a mission in their order"),
    ("tests/src/bin/deconfliction/cases.rs", "all_meetings", "a table of cases, a few lines each"),
    (
        "tests/src/meeting/autopilot.rs",
        "Autopilot",
        "the whole state of a vehicle and its autopilot, flat",
    ),
    ("tests/src/meeting/scene/happenings.rs", "draw_events", DRAWS),
    ("tests/src/meeting/scene/ways.rs", "draw_path", DRAWS),
    ("tests/src/swarms.rs", "draw", DRAWS),
];

/// Every struct and function beyond the limits, as a line to print; with the reason if it is listed
/// as an exception.
pub fn beyond_size_limits(tree: &Tree) -> Vec<(String, Option<&'static str>)> {
    let mut shape = ShapeVisitor { file: String::new(), found: Vec::new() };
    for source in &tree.sources {
        shape.file = source.path.display().to_string();
        source.items.iter().for_each(|item| shape.visit_item(item));
    }
    shape.found
}

/// A line for each exception that none of `found` needs.
pub fn unused_exceptions(found: &[String]) -> Vec<String> {
    let unused = EXCEPTIONS.iter().filter(|(file, name, _)| {
        let begins = format!("{file}: {name} has ");
        !found.iter().any(|what| what.starts_with(&begins))
    });
    unused.map(|(file, name, _)| format!("{file}: {name} needs no exception")).collect()
}

/// Collects what is beyond the limits in one file after the other.
struct ShapeVisitor {
    /// Path of the file that is visited.
    file: String,
    found: Vec<(String, Option<&'static str>)>,
}

impl ShapeVisitor {
    fn note_if_beyond(&mut self, name: &str, count: usize, most: usize, of: &str) {
        if count > most {
            let exception = EXCEPTIONS
                .iter()
                .find(|(file, exception, _)| *file == self.file && *exception == name);
            let reason = exception.map(|(_, _, reason)| *reason);
            self.found.push((
                format!("{}: {name} has {count} {of}, more than {most}", self.file),
                reason,
            ));
        }
    }

    /// Notes a function with too many lines or arguments.
    fn judge_function(&mut self, signature: &Signature, lines: usize) {
        let name = signature.ident.to_string();
        let arguments =
            signature.inputs.iter().filter(|input| matches!(input, FnArg::Typed(_))).count();
        self.note_if_beyond(&name, lines, MAX_BODY_LINES, "lines");
        self.note_if_beyond(&name, arguments, MAX_ARGUMENTS, "arguments");
        let bools = signature.inputs.iter().filter(|input| has_bool_type(input)).count();
        self.note_if_beyond(&name, bools, 0, "`bool` arguments");
    }
}

impl Visit<'_> for ShapeVisitor {
    fn visit_item_mod(&mut self, item: &syn::ItemMod) {
        if item.ident != "tests" {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_struct(&mut self, item: &ItemStruct) {
        let name = item.ident.to_string();
        let most = if name == "Companion" { MAX_COMPANION_FIELDS } else { MAX_FIELDS };
        self.note_if_beyond(&name, item.fields.len(), most, "fields");
    }

    fn visit_item_fn(&mut self, item: &ItemFn) {
        self.judge_function(&item.sig, body_lines(&item.block));
        visit::visit_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &TraitItemFn) {
        self.judge_function(&item.sig, item.default.as_ref().map_or(0, body_lines));
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &ImplItemFn) {
        self.judge_function(&item.sig, body_lines(&item.block));
        visit::visit_impl_item_fn(self, item);
    }
}

/// Whether an argument is a `bool`, or a tuple with one.
fn has_bool_type(input: &FnArg) -> bool {
    let plain = |ty: &Type| matches!(ty, Type::Path(path) if path.path.is_ident("bool"));
    let FnArg::Typed(input) = input else { return false };
    match &*input.ty {
        Type::Tuple(tuple) => tuple.elems.iter().any(plain),
        ty => plain(ty),
    }
}

/// Number of lines between a function's braces.
fn body_lines(block: &syn::Block) -> usize {
    let braces = block.brace_token.span;
    (braces.close().start().line - braces.open().start().line).saturating_sub(1)
}
