//! Lists the public functions of a source file, read line by line in rustfmt's layout. The tests in
//! `tests/` include this file too.

use std::borrow::ToOwned;
use std::string::String;
use std::vec::Vec;

/// The type that a line starting with `impl` implements, without generic parameters; `None` for any
/// other line.
fn impl_type_name(line: &str) -> Option<String> {
    let mut rest = line.strip_prefix("impl")?;
    if rest.starts_with('<') {
        let mut depth = 0;
        let end = rest.find(|c| {
            depth += i32::from(c == '<') - i32::from(c == '>');
            depth == 0
        })?;
        rest = &rest[end + 1..];
    }
    let of = rest.split_once(" for ").map_or(rest, |(_, of)| of).trim_start();
    Some(of.split(['<', ' ', '{']).next()?.to_owned())
}

/// Every public function of a source, without those of its test module, which comes last: the type
/// of its `impl`, `None` for a free function, and its name.
pub fn public_functions(source: &str) -> Vec<(Option<String>, &str)> {
    let tests = source.match_indices("#[cfg(test)]\n").find(|(at, head)| {
        source[at + head.len()..].lines().next().is_some_and(|line| line.ends_with('{'))
    });
    let mut functions = Vec::new();
    let mut owner = None;
    for line in source[..tests.map_or(source.len(), |(at, _)| at)].lines() {
        if line.starts_with("impl") {
            owner = impl_type_name(line);
        } else if line.starts_with('}') {
            owner = None;
        }
        let Some(item) = line.trim_start().strip_prefix("pub ") else { continue };
        let Some(item) = item.strip_prefix("const ").unwrap_or(item).strip_prefix("fn ") else {
            continue;
        };
        functions.push((owner.clone(), item.split(['(', '<']).next().unwrap_or_default()));
    }
    functions
}
