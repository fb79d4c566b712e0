//! The page docs/worst-case.md: every public call of planner-core and companion is on it, and an
//! emulated board needs no more than its table says.

use std::fs;
use std::path::Path;

use board_bench::calls::flight;
use flockmate_tests::bounds::{self, BOUNDS};
use flockmate_tests::{board, workspace};

use self::public_functions::public_functions;

#[path = "../../board-bench/src/calls/public_functions.rs"]
mod public_functions;

/// Factor by which a count may exceed the table: another compiler's code may need more, and a
/// little growth needs no new table.
const SLACK: f64 = 1.25;
/// Most instructions of a control step among 32 neighbours, whatever they do, in a coverage mission
/// too.
const STEP: u64 = 75_000;
/// Most instructions of the safety filter.
const FILTER: u64 = 12_000;
/// Most instructions for a coverage mission: its whole plan, with and without zones, and a board's
/// whole call for a further division, among 3 vehicles, with and without zones, and among 32 on 512
/// lanes.
const COVERAGE: [(&str, u64); 8] = [
    ("a coverage plan, 3", 20_000_000),
    ("planner::coverage::plan_flights, 3", 20_000_000),
    ("planner::coverage::plan_flights, 3, zones", 20_000_000),
    ("a division, 3", 1_000_000),
    ("a division, 3, zones", 1_000_000),
    ("a division, 32", 10_000_000),
    ("losses::redivide_work, 3", 1_000_000),
    ("losses::redivide_work, 32", 10_000_000),
];
/// Modules and folders of companion without public calls, and those with test doubles.
const PRIVATE: [&str; 7] =
    ["guidance", "testing", "incremental_scan", "journal", "packet", "duplicates", "burst"];
/// Heading of the page's section about calls that are not counted by themselves.
const OTHERS: &str = "## Not counted by themselves";

/// A public function: its crate and modules, the type that has it, its name.
#[derive(Clone, Debug)]
struct Call {
    path: Vec<String>,
    name: String,
}

impl Call {
    /// Whether a path of the page, as `file::Type::name`, names this call: the last word is its
    /// name, and all others are in its path.
    fn is(&self, words: &[&str]) -> bool {
        let Some((name, path)) = words.split_last() else { return false };
        *name == self.name
            && !path.is_empty()
            && path.iter().all(|word| self.path.iter().any(|own| own == word))
    }
}

fn page() -> String {
    fs::read_to_string(workspace().join(bounds::PAGE)).expect("it is there")
}

/// The public functions in a folder's sources.
fn public_calls(folder: &Path, path: &[String], calls: &mut Vec<Call>) {
    for entry in
        fs::read_dir(folder).expect("a folder of sources").map(|entry| entry.expect("readable"))
    {
        let file = entry.path();
        let module = file.file_stem().and_then(|name| name.to_str()).expect("a name").to_owned();
        let is_private = path[0] == "companion" && PRIVATE.contains(&module.as_str());
        if module.ends_with("tests") || is_private {
            continue;
        }
        let inside: Vec<String> = path.iter().cloned().chain([module]).collect();
        if file.is_dir() {
            public_calls(&file, &inside, calls);
            continue;
        }
        let source = fs::read_to_string(&file).expect("readable");
        calls.extend(public_functions(&source).into_iter().map(|(owner, name)| Call {
            path: inside.iter().cloned().chain(owner).collect(),
            name: name.to_owned(),
        }));
    }
}

/// The paths that the page names: rows of the table of what was counted, and calls by module in the
/// table of the others.
fn named(page: &str) -> Vec<Vec<String>> {
    let (counted, others) = page.split_once(OTHERS).expect("it names the others");
    let path = |code: &str| -> Vec<String> {
        let code = code.split(',').next().unwrap_or_default();
        code.split("::").map(str::to_owned).collect()
    };
    let codes = |line: &str| -> Vec<String> {
        line.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    };
    let rows = |text: &str| -> Vec<Vec<String>> {
        text.lines().filter(|line| line.starts_with("| `")).map(codes).collect()
    };
    let counted = rows(counted).into_iter().map(|codes| path(&codes[0]));
    let others = rows(others).into_iter().flat_map(|codes| {
        let module = path(&codes[0]);
        codes[1..]
            .iter()
            .map(|name| module.iter().cloned().chain([name.clone()]).collect())
            .collect::<Vec<_>>()
    });
    counted.chain(others).collect()
}

#[test]
fn every_public_call_is_on_the_page() {
    let page = page();
    let mut calls = Vec::new();
    public_calls(&workspace().join("planner-core/src"), &["planner_core".to_owned()], &mut calls);
    public_calls(&workspace().join("companion/src"), &["companion".to_owned()], &mut calls);
    assert!(calls.len() > 400, "{}", calls.len());
    let named = named(&page);
    let is_named = |call: &Call| {
        named.iter().any(|path| call.is(&path.iter().map(String::as_str).collect::<Vec<_>>()))
    };
    let missing: Vec<&Call> = calls.iter().filter(|call| !is_named(call)).collect();
    assert!(missing.is_empty(), "not in {}: {missing:?}", bounds::PAGE);
    // All calls that the page names exist; rows of more than one call have no path.
    let is_there = |path: &&Vec<String>| {
        let words: Vec<&str> = path.iter().map(String::as_str).collect();
        words.len() == 1 || calls.iter().any(|call| call.is(&words))
    };
    let gone: Vec<_> = named.iter().filter(|path| !is_there(path)).collect();
    assert!(gone.is_empty(), "in {} and not in the code: {gone:?}", bounds::PAGE);
}

#[test]
fn the_board_needs_no_more_than_the_table_says() {
    let Some(program) = board::built_program("calls") else { return };
    let calls = bounds::count_calls(&program).expect("`calls` runs");
    let page = page();
    let table = bounds::split_page(&page).expect("the page has a table")[1];
    assert_eq!(table.lines().count(), BOUNDS.len() + 2, "a row for each call");
    for (name, bound) in BOUNDS {
        let start = format!("| `{name}` | {bound} | ");
        let line = table
            .lines()
            .find_map(|line| line.strip_prefix(&start))
            .unwrap_or_else(|| panic!("{start}"));
        let (count, bytes) = line.trim_end_matches(" |").split_once(" | ").expect("four columns");
        let most = bounds::parse_rounded(count).expect("a count");
        let seen = calls[*name];
        println!(
            "{name}: {} instructions of {count}, {} bytes",
            seen.instructions, seen.lent_bytes
        );
        assert!(
            seen.instructions as f64 <= most * SLACK + 100.0,
            "{name}: {} of {most} instructions",
            seen.instructions
        );
        let most: f64 = bytes.parse().expect("bytes");
        assert!(
            seen.lent_bytes as f64 <= most * SLACK,
            "{name}: {} of {most} bytes",
            seen.lent_bytes
        );
    }
    assert_eq!(calls.len(), BOUNDS.len(), "every call that is counted has its bound");
    for (name, most) in COVERAGE {
        let seen = calls[name].instructions;
        assert!(seen <= most, "{name}: {seen} instructions of {most}");
    }
    let is_step = |name: &&str| name.contains("handle_timeout") || name.contains("control step");
    let steps = || BOUNDS.iter().map(|(name, _)| *name).filter(is_step);
    assert_eq!(steps().count(), 5);
    for name in steps() {
        let step = calls[name].instructions;
        println!("{name}: {step} instructions");
        assert!(step <= STEP, "{name}: {step}");
    }
    let filter = calls[flight::FILTER_ROW].instructions;
    assert!(filter <= FILTER, "{filter}");
}
