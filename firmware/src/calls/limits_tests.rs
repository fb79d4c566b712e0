extern crate std;

use std::boxed::Box;
use std::collections::BTreeSet;
use std::format;
use std::fs;
use std::path::Path;
use std::string::{String, ToString};

use super::limits::{Answers, Listener, places};
use super::limits_routes::{Lent, routes};

#[derive(Default)]
struct Called(BTreeSet<&'static str>);

impl Listener for Called {
    fn next(&mut self, name: &'static str) {
        self.0.insert(name);
    }
}

/// The type that an `impl` is for, without its parameters; none where it is a trait's.
fn type_of(line: &str) -> Option<String> {
    let mut rest = line.strip_prefix("impl")?;
    if rest.starts_with('<') {
        let mut depth = 0;
        let end = rest.find(|c| {
            depth += i32::from(c == '<') - i32::from(c == '>');
            depth == 0
        })?;
        rest = &rest[end + 1..];
    }
    let name = rest.trim_start().split(['<', ' ']).next()?;
    (!rest.contains(" for ")).then(|| name.to_string())
}

/// The public functions in a folder's sources: file, type if there is one, name.
fn public(folder: &Path, names: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("readable").path();
        let file = path.file_stem().and_then(|name| name.to_str()).expect("a name").to_string();
        if path.is_dir() {
            public(&path, names);
        }
        if path.is_dir() || file.ends_with("tests") {
            continue;
        }
        let source = fs::read_to_string(&path).expect("readable");
        let mut owner = None;
        // A module of tests in the file itself comes last.
        let tests = source.match_indices("#[cfg(test)]\n").find(|(at, head)| {
            source[at + head.len()..].lines().next().is_some_and(|line| line.ends_with('{'))
        });
        for line in source[..tests.map_or(source.len(), |(at, _)| at)].lines() {
            if line.starts_with("impl") {
                owner = type_of(line);
            } else if line.starts_with('}') {
                owner = None;
            }
            let Some(item) = line.trim_start().strip_prefix("pub ") else { continue };
            let Some(item) = item.strip_prefix("const ").unwrap_or(item).strip_prefix("fn ") else {
                continue;
            };
            let name = item.split(['(', '<']).next().unwrap_or_default();
            names.insert(match &owner {
                Some(owner) => format!("{file}::{owner}::{name}"),
                None => format!("{file}::{name}"),
            });
        }
    }
}

#[test]
fn every_public_call_of_planner_core_holds_at_its_limits() {
    let mut called = Called::default();
    let mut answers = Answers::new(&mut called);
    places(&mut answers);
    routes(&mut answers, &mut Box::new(Lent::new()));
    let mut all = BTreeSet::new();
    public(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../planner-core/src"), &mut all);
    assert!(all.len() > 150, "{}", all.len());
    let called: BTreeSet<String> = called.0.iter().copied().map(String::from).collect();
    let missing: std::vec::Vec<_> = all.difference(&called).collect();
    assert!(missing.is_empty(), "not called at their limits: {missing:?}");
    let gone: std::vec::Vec<_> = called.difference(&all).collect();
    assert!(gone.is_empty(), "no such calls: {gone:?}");
}
