//! Child processes, and paths of the checkout.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

/// Root directory of the checkout.
pub fn checkout_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask lies in the checkout")
}

/// Directory of build products: `CARGO_TARGET_DIR`, else `target` in the checkout.
pub fn target_dir() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| checkout_root().join("target"), |dir| checkout_root().join(dir))
}

/// A command that runs in the checkout's root, without standard input.
pub fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(checkout_root()).stdin(Stdio::null());
    command
}

/// A command of the cargo that runs xtask.
pub fn cargo() -> Command {
    command(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

/// Runs the command and waits until it ends. If it fails, the error names it.
pub fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    if !status.success() {
        bail!("{command:?} failed: {status}");
    }
    Ok(())
}

/// What a build by cargo reported.
pub struct Compiled {
    /// Number of the compiler's warnings, repeated ones of earlier builds included.
    pub warnings: usize,
    /// The artifacts that were built, as cargo's JSON messages.
    pub artifacts: Vec<Value>,
}

/// Runs a build by cargo and prints the compiler's messages.
pub fn compile(building: &mut Command) -> Result<Compiled> {
    let mut child = building
        .arg("--message-format=json")
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("cannot start {building:?}"))?;
    let mut compiled = Compiled { warnings: 0, artifacts: Vec::new() };
    for line in BufReader::new(child.stdout.take().context("its output is piped")?).lines() {
        // A line that is no JSON message of cargo is ignored.
        let line: Value = serde_json::from_str(&line?).unwrap_or_default();
        let message = &line["message"];
        eprint!("{}", message["rendered"].as_str().unwrap_or_default());
        compiled.warnings += usize::from(message["level"] == "warning");
        if line["reason"] == "compiler-artifact" {
            compiled.artifacts.push(line);
        }
    }
    let status = child.wait()?;
    ensure!(status.success(), "{building:?} failed: {status}");
    Ok(compiled)
}

/// Path of a program in the first directory of `PATH` that has it; `None` if none has.
pub fn find_on_path(program: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|dir| dir.join(program)).find(|file| file.is_file())
}
