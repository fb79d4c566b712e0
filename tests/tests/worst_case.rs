//! The page docs/worst-case.md: every public call of planner-core and companion is on it, and an emulated board needs no more
//! than its table says.

use std::fs;
use std::path::Path;

use flockmate_tests::bounds::{self, BOUNDS};
use flockmate_tests::{board, workspace};

/// Another compiler's code may need so much more, and what has grown a little needs no new table.
const SLACK: f64 = 1.25;
/// Instructions of a control step among 32 neighbours, whatever they do.
const STEP: u64 = 75_000;
/// The safety filter's, in the worst case seen. It should take 12 000: the page says what the rest goes to.
const FILTER: u64 = 27_000;
/// Of a coverage mission: its plan, and the division of what is left after a loss, among 32 vehicles on 512 lanes.
const COVERAGE: [(&str, u64); 3] =
    [("a coverage plan, 3", 20_000_000), ("a division, 3", 1_000_000), ("a division, 32", 10_000_000)];
/// Modules and folders of companion that are its own, where no call is public, and doubles of its tests.
const PRIVATE: [&str; 7] = ["guidance", "testing", "sweep", "journal", "packet", "memory", "stream"];

fn page() -> String {
    fs::read_to_string(workspace().join(bounds::PAGE)).expect("it is there")
}

/// Names of the public functions in a folder's sources.
fn public_calls(folder: &Path, names: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("a folder of sources").map(|entry| entry.expect("readable")) {
        let path = entry.path();
        let module = path.file_stem().and_then(|name| name.to_str()).expect("a name").to_owned();
        if module.ends_with("tests") || PRIVATE.contains(&module.as_str()) {
            continue;
        }
        if path.is_dir() {
            public_calls(&path, names);
        } else {
            let source = fs::read_to_string(&path).expect("readable");
            let source = source.split("#[cfg(test)]").next().unwrap_or_default();
            let public = |line: &str| {
                let line = line.trim_start().strip_prefix("pub ")?;
                let name = line.strip_prefix("const ").unwrap_or(line).strip_prefix("fn ")?;
                Some(name.split(['(', '<']).next()?.to_owned())
            };
            names.extend(source.lines().filter_map(public));
        }
    }
}

#[test]
fn every_public_call_is_on_the_page() {
    let page = page();
    let mut names = Vec::new();
    public_calls(&workspace().join("planner-core/src"), &mut names);
    public_calls(&workspace().join("companion/src"), &mut names);
    assert!(names.len() > 100, "{}", names.len());
    let code = page.split('`').skip(1).step_by(2);
    let words: Vec<&str> =
        code.flat_map(|name| name.split(|c: char| !(c.is_alphanumeric() || c == '_'))).collect();
    names.retain(|name| !words.contains(&name.as_str()));
    names.sort();
    names.dedup();
    assert!(names.is_empty(), "not in {}: {names:?}", bounds::PAGE);
}

#[test]
fn the_board_needs_no_more_than_the_table_says() {
    let Some(program) = board::program("calls") else { return };
    let calls = bounds::counted(&program).expect("`calls` runs");
    let page = page();
    let table = bounds::parts(&page).expect("the page has a table")[1];
    assert_eq!(table.lines().count(), BOUNDS.len() + 2, "a row for each call");
    for (name, bound) in BOUNDS {
        let start = format!("| `{name}` | {bound} | ");
        let line =
            table.lines().find_map(|line| line.strip_prefix(&start)).unwrap_or_else(|| panic!("{start}"));
        let (count, bytes) = line.trim_end_matches(" |").split_once(" | ").expect("four columns");
        let most = bounds::parsed(count).expect("a count");
        let seen = calls[*name];
        println!("{name}: {} instructions of {count}, {} bytes", seen.instructions, seen.bytes);
        assert!(
            seen.instructions as f64 <= most * SLACK + 100.0,
            "{name}: {} of {most} instructions",
            seen.instructions
        );
        let most: f64 = bytes.parse().expect("bytes");
        assert!(seen.bytes as f64 <= most * SLACK, "{name}: {} of {most} bytes", seen.bytes);
    }
    assert_eq!(calls.len(), BOUNDS.len(), "every call that is counted has its bound");
    for (name, most) in COVERAGE {
        let seen = calls[name].instructions;
        assert!(seen <= most, "{name}: {seen} instructions of {most}");
    }
    let is_step = |name: &&str| name.contains("handle_timeout") || name.contains("control step");
    let steps = || BOUNDS.iter().map(|(name, _)| *name).filter(is_step);
    assert_eq!(steps().count(), 4);
    for name in steps() {
        let step = calls[name].instructions;
        println!("{name}: {step} instructions");
        assert!(step <= STEP, "{name}: {step}");
    }
    let filter = calls["Companion::ask_filter, 32 near"].instructions;
    assert!(filter <= FILTER, "{filter}");
}
