//! Wrong inputs to every command: exit code 2 and one short line, soon, in little memory, and
//! nothing left behind.
//!
//! Inputs are made systematically: every key of a scenario with values of every wrong type and
//! range, every argument left out, doubled and garbled, every file that is read as a directory,
//! FIFO, device, endless or binary file, every format cut and flipped. Each runs in a process of
//! its own with a limit of 1 GB.
#![cfg(target_os = "linux")]

mod areas;
mod commands;
mod files;
mod scenarios;

use std::collections::BTreeSet;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Longest time that a command may take to refuse an input.
const TIME: Duration = Duration::from_secs(10);
/// Address space that a command gets, kB.
const MEMORY_KB: u32 = 1_000_000;
/// At least so many inputs are tried.
const LEAST: usize = 375;
/// Longest line of an error message, characters: quotations of 200 and the words around them.
const LINE: usize = 600;

/// Where standard output goes.
#[derive(Clone, Copy)]
enum Output {
    Pipe,
    /// A disk without room.
    Full,
    /// A pipe whose reader has gone.
    Closed,
    /// A disk without room, for errors too.
    AllFull,
}

/// One wrong input.
struct Case {
    name: String,
    args: Vec<String>,
    output: Output,
}

/// The inputs, and the folder with their files.
struct Cases {
    folder: PathBuf,
    cases: Vec<Case>,
    files: usize,
}

impl Cases {
    fn push(&mut self, name: impl Into<String>, args: &[&str]) {
        self.push_to(name, args, Output::Pipe);
    }

    fn push_to(&mut self, name: impl Into<String>, args: &[&str], output: Output) {
        let args = args.iter().map(|&arg| arg.to_owned()).collect();
        self.cases.push(Case { name: name.into(), args, output });
    }

    /// A file of the folder.
    fn path(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    /// A new file with these contents.
    fn file(&mut self, end: &str, bytes: &[u8]) -> String {
        self.files += 1;
        let path = self.path(&format!("{}.{end}", self.files));
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// A directory for results that must not come to be.
    fn out(&self) -> String {
        self.path(&format!("out/{}", self.cases.len()))
    }

    /// A scenario that `plan` must refuse.
    fn scenario(&mut self, name: impl Into<String>, text: &str) {
        let (file, out) = (self.file("toml", text.as_bytes()), self.out());
        self.push(name, &["plan", &file, "--out", &out]);
    }
}

/// Runs the program with a wrong input; returns the time it took, or how it behaved wrongly.
fn judge(case: &Case, folder: &Path, number: usize) -> Result<Duration, String> {
    let err = folder.join(format!("{number}.err"));
    let began = Instant::now();
    let mut child = Command::new("sh");
    child.args([
        "-c",
        &format!("ulimit -v {MEMORY_KB}; exec \"$@\""),
        "sh",
        env!("CARGO_BIN_EXE_host-sim"),
    ]);
    child.args(&case.args).stdin(Stdio::null()).stderr(std::fs::File::create(&err).unwrap());
    // Every thread reserves address space for itself, and that is what `ulimit` limits.
    child.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
    child.stdout(match case.output {
        Output::Full | Output::AllFull => {
            std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap().into()
        }
        Output::Pipe => Stdio::piped(),
        // Closed before the program begins.
        Output::Closed => std::io::pipe().unwrap().1.into(),
    });
    if let Output::AllFull = case.output {
        child.stderr(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    }
    let mut child = child.spawn().unwrap();
    let reader = child.stdout.take();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > TIME {
            child.kill().unwrap();
            child.wait().unwrap();
            return Err(format!("still running after {TIME:?}"));
        }
        std::thread::sleep(Duration::from_millis(3));
    };
    let took = began.elapsed();
    let mut printed = String::new();
    if let Some(mut reader) = reader {
        reader.read_to_string(&mut printed).unwrap();
    }
    let text = String::from_utf8_lossy(&std::fs::read(&err).unwrap()).into_owned();
    let fail = |why: &str| Err(format!("{why}: {status}\n{text}"));
    if status.code() != Some(2) {
        return fail("exit code is not 2");
    }
    if !printed.is_empty() {
        return fail("something was printed");
    }
    if let Output::AllFull = case.output {
        return Ok(took);
    }
    let lines: Vec<&str> = text.lines().collect();
    let errors = lines.iter().filter(|line| line.starts_with("error: ")).count();
    if errors != 1 || !lines[0].starts_with("error: ") {
        return fail("not one error");
    }
    // Further lines may only show the scenario's faulty line, mark its place, and give hints.
    let about = |line: &&&str| line.starts_with("hint: ") || line.contains(" |");
    if lines.len() > 6 || lines[1..].iter().filter(about).count() != lines.len() - 1 {
        return fail("more than one line, what it is about and hints");
    }
    if lines.iter().any(|line| line.chars().count() > LINE) {
        return fail("a line is too long");
    }
    let quotes = text.split(['`', '\'', '"', ' ', '\n']);
    if quotes.into_iter().any(|quote| quote.chars().count() > 210) {
        return fail("a quotation is too long");
    }
    if text.chars().any(|c| c != '\n' && c.is_control()) {
        return fail("control codes");
    }
    if text.contains("panicked") || text.contains("RUST_BACKTRACE") {
        return fail("a panic");
    }
    Ok(took)
}

#[test]
fn wrong_inputs_end_soon_with_one_short_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut cases = Cases { folder: folder.path().into(), cases: Vec::new(), files: 0 };
    scenarios::add(&mut cases);
    files::add(&mut cases);
    areas::add(&mut cases);
    commands::add(&mut cases);
    let cases = cases.cases;
    let names: BTreeSet<&str> = cases.iter().map(|case| &*case.name).collect();
    assert_eq!(names.len(), cases.len(), "every input has a name of its own");
    assert!(cases.len() >= LEAST, "{} inputs", cases.len());
    let (next, failures, slowest) =
        (AtomicUsize::new(0), Mutex::new(Vec::new()), Mutex::new((Duration::ZERO, String::new())));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(number) else { break };
                    match judge(case, folder.path(), number) {
                        Ok(took) => {
                            let mut slowest = slowest.lock().unwrap();
                            if took > slowest.0 {
                                *slowest = (took, case.name.clone());
                            }
                        }
                        Err(why) => failures.lock().unwrap().push(format!("{}: {why}", case.name)),
                    }
                }
            });
        }
    });
    let failures = failures.into_inner().unwrap();
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), cases.len(), failures.join("\n"));
    let left: Vec<_> =
        std::fs::read_dir(folder.path().join("out")).into_iter().flatten().flatten().collect();
    assert!(left.is_empty(), "results of nothing: {left:?}");
    println!("{} wrong inputs, the slowest {:?}", cases.len(), slowest.into_inner().unwrap());
}
