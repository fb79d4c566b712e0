//! Checks the licences of all dependencies against `deny.toml`: the same rules as
//! `cargo deny check licenses`, which takes minutes to install.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use spdx::{Expression, LicenseReq, ParseMode};

use crate::shell::cargo;

/// What is read of `deny.toml`.
#[derive(Deserialize)]
struct Deny {
    /// Which targets are built.
    graph: Graph,
    /// Which licences are allowed.
    licenses: Licences,
}

/// Section `graph` of `deny.toml`.
#[derive(Deserialize)]
struct Graph {
    /// Rust's names of the targets.
    targets: Vec<String>,
}

/// Section `licenses` of `deny.toml`.
#[derive(Deserialize)]
struct Licences {
    /// SPDX ids of the licences that every crate may have.
    allow: Vec<String>,
    exceptions: Vec<Exception>,
}

/// A crate that may have further licences.
#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    /// SPDX ids of the further licences.
    allow: Vec<String>,
}

/// What is read of the answer of `cargo metadata`.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

/// A crate.
#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    /// Licence as an SPDX expression; `None` if the crate states none.
    license: Option<String>,
    /// `None` for a crate of this workspace.
    source: Option<String>,
}

/// The dependencies as they are resolved.
#[derive(Deserialize)]
struct Resolve {
    /// The packages that are built for the target.
    nodes: Vec<Node>,
}

/// A resolved package.
#[derive(Deserialize)]
struct Node {
    id: String,
}

/// Checks every crate that is built for one of the targets of `deny.toml`.
///
/// # Errors
/// Names each crate whose licence is not allowed, and each exception that no crate needs.
pub fn check_licences() -> Result<()> {
    let text = fs::read_to_string("deny.toml").context("deny.toml")?;
    let deny: Deny = toml::from_str(&text).context("deny.toml")?;
    let mut used = BTreeMap::new();
    for target in &deny.graph.targets {
        used.extend(licences_of_dependencies(target)?);
    }
    let mut wrong = Vec::new();
    let mut needed = BTreeSet::new();
    for (name, licence) in &used {
        let own = deny.licenses.exceptions.iter().find(|exception| exception.name == *name);
        if is_allowed(licence, &deny.licenses.allow)? {
            continue;
        }
        match own {
            Some(own) if is_allowed(licence, &[&deny.licenses.allow[..], &own.allow].concat())? => {
                needed.insert(name);
            }
            _ => wrong.push(format!("{name}: {licence} is not allowed")),
        }
    }
    let idle = deny.licenses.exceptions.iter().filter(|one| !needed.contains(&one.name));
    wrong.extend(idle.map(|one| format!("{}: needs no exception", one.name)));
    ensure!(wrong.is_empty(), "deny.toml:\n  {}", wrong.join("\n  "));
    println!("{} dependencies, all under licences that deny.toml allows", used.len());
    Ok(())
}

/// Name and licence of each dependency that is built for `target`.
fn licences_of_dependencies(target: &str) -> Result<BTreeMap<String, String>> {
    let mut metadata = cargo();
    metadata.args(["metadata", "--locked", "--format-version=1", "--filter-platform", target]);
    let answer = metadata.output().context("cargo metadata")?;
    ensure!(
        answer.status.success(),
        "cargo metadata:\n{}",
        String::from_utf8_lossy(&answer.stderr)
    );
    let metadata: Metadata = serde_json::from_slice(&answer.stdout).context("cargo metadata")?;
    let built: BTreeSet<&str> = metadata.resolve.nodes.iter().map(|node| &*node.id).collect();
    let others = metadata.packages.iter().filter(|package| package.source.is_some());
    let of = |package: &Package| {
        let licence = package.license.clone().unwrap_or_else(|| "no licence".to_owned());
        (package.name.clone(), licence)
    };
    Ok(others.filter(|package| built.contains(&*package.id)).map(of).collect())
}

/// Whether the SPDX expression `licence` can be fulfilled with the licences in `allowed`.
fn is_allowed(licence: &str, allowed: &[String]) -> Result<bool> {
    let Ok(expression) = Expression::parse_mode(licence, ParseMode::LAX) else { return Ok(false) };
    let allowed: Vec<LicenseReq> = allowed
        .iter()
        .map(|name| {
            let id = spdx::license_id(name).with_context(|| format!("{name}: no SPDX licence"))?;
            Ok(LicenseReq::from(id))
        })
        .collect::<Result<_>>()?;
    Ok(expression.evaluate(|needed| allowed.contains(needed)))
}
