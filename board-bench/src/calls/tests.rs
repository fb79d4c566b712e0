use std::boxed::Box;
use std::collections::BTreeSet;
use std::format;
use std::fs;
use std::path::Path;
use std::string::{String, ToString};

use super::limits::{CallListener, Results, call_without_roadmap};
use super::limits_routes::{RouteWorkspaces, call_all};
use super::public_functions::public_functions;

#[derive(Default)]
struct Called(BTreeSet<&'static str>);

impl CallListener for Called {
    fn before_call(&mut self, name: &'static str) {
        self.0.insert(name);
    }
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
        for (owner, name) in public_functions(&source) {
            names.insert(match owner {
                Some(owner) => format!("{file}::{owner}::{name}"),
                None => format!("{file}::{name}"),
            });
        }
    }
}

#[test]
fn every_public_call_of_planner_core_holds_at_its_limits() {
    let mut called = Called::default();
    let mut answers = Results::new(&mut called);
    call_without_roadmap(&mut answers);
    call_all(&mut answers, &mut Box::new(RouteWorkspaces::new()));
    let mut all = BTreeSet::new();
    public(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../planner-core/src"), &mut all);
    assert!(all.len() > 150, "{}", all.len());
    let called: BTreeSet<String> = called.0.iter().copied().map(String::from).collect();
    let missing: std::vec::Vec<_> = all.difference(&called).collect();
    assert!(missing.is_empty(), "not called at their limits: {missing:?}");
    let gone: std::vec::Vec<_> = called.difference(&all).collect();
    assert!(gone.is_empty(), "no such calls: {gone:?}");
}
