//! Helpers of the tests across crates, and of the benches.

pub mod areas;
pub mod board;
pub mod board_failure;
pub mod bounds;
pub mod costs;
pub mod covered;
pub mod edge;
pub mod fidelity;
pub mod hills;
pub mod hostile;
pub mod logs;
pub mod meeting;
pub mod owners;
pub mod parts;
pub mod roadmaps;
pub mod setpoints;
pub mod swarms;
pub mod vehicle;

use std::io::{BufRead, BufReader};
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rayon::prelude::*;

/// Path of a file of the shared real data; `None`, with a printed line that says what is skipped,
/// if it is absent.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let path = workspace().join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no shared data {name} beside the checkout");
    None
}

/// Root directory of the checkout.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The Python with pymavlink and mavsdk that `FLOCKMATE_PYTHON` names; `None`, with a printed line
/// that says what is skipped, if the variable is not set.
pub fn python() -> Option<String> {
    let python = std::env::var("FLOCKMATE_PYTHON").ok();
    if python.is_none() {
        println!(
            "skipped: FLOCKMATE_PYTHON names no Python with pymavlink and mavsdk (`cargo xtask test` makes one)"
        );
    }
    python
}

/// Path of `host-sim`, in the profile of the test that calls this. `host-sim` is built first,
/// because cargo gives tests no path to another package's binaries, unless `FLOCKMATE_BUILT` says
/// that it was built with the tests.
pub fn host_sim_path() -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own path");
    // TARGET/PROFILE/deps/TEST-HASH
    let built = test.ancestors().nth(2).expect("tests lie two levels deep in their profile");
    if std::env::var_os("FLOCKMATE_BUILT").is_none() {
        let mut build = Command::new(env!("CARGO"));
        build.current_dir(workspace()).args(["build", "--quiet", "-p", "host-sim"]);
        if built.ends_with("release") {
            build.arg("--release");
        }
        assert!(build.status().expect("cargo runs").success(), "host-sim does not build");
    }
    built.join("host-sim")
}

/// A child process that is killed when this guard is dropped, also by a test that panics.
pub struct ChildGuard(pub Child);

impl ChildGuard {
    /// Waits for the child to end by itself; `None` if it has not ended within the limit.
    pub fn wait_for(&mut self, limit: Duration) -> Option<ExitStatus> {
        let began = Instant::now();
        while began.elapsed() < limit {
            if let Some(status) = self.0.try_wait().expect("a child can be waited for") {
                return Some(status);
            }
            sleep(Duration::from_millis(50));
        }
        None
    }
}

impl Drop for ChildGuard {
    fn drop(&mut self) {
        // The child may have ended by itself, so errors are ignored.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a `host-sim` that listens on `links` links; returns the address that it printed for each,
/// `127.0.0.1:PORT` or a path.
///
/// # Panics
/// The program does not start, or does not open all links.
pub fn start_listening(mut command: Command, links: usize) -> (ChildGuard, Vec<String>) {
    let mut child = command.stdout(Stdio::piped()).spawn().expect("host-sim starts");
    let lines = BufReader::new(child.stdout.take().expect("stdout is piped")).lines();
    let guard = ChildGuard(child);
    let address = |line: std::io::Result<String>| {
        let line = line.expect("it prints a line for each link");
        let url = line.strip_prefix("listening ").unwrap_or_else(|| panic!("no link in {line:?}"));
        url.split_once(':').map_or(url, |(_, address)| address).to_owned()
    };
    let addresses: Vec<_> = lines.take(links).map(address).collect();
    assert_eq!(addresses.len(), links, "not every link was opened");
    (guard, addresses)
}

/// Starts `host-sim autopilot` on these links; returns the address of each.
///
/// # Panics
/// The program does not start.
pub fn start_autopilot(listen: &[&str], options: &[&str]) -> (ChildGuard, Vec<String>) {
    let mut command = Command::new(host_sim_path());
    command.arg("autopilot").args(options);
    for url in listen {
        command.args(["--listen", url]);
    }
    start_listening(command, listen.len())
}

/// A port that is free now for TCP and UDP, and that no other test of this process gets. It is
/// outside the system's range of ephemeral ports, in which another process might get it before it
/// is used.
///
/// # Panics
/// No port is free.
pub fn free_port() -> u16 {
    static GIVEN: AtomicU16 = AtomicU16::new(0);
    // The process id chooses the first port, so tests of another checkout begin elsewhere.
    let first = (std::process::id() % 100) as u16 * 100;
    let next = |_| 20_000 + (first + GIVEN.fetch_add(1, Ordering::Relaxed)) % 10_000;
    let free = |port: &u16| {
        TcpListener::bind(("127.0.0.1", *port)).is_ok()
            && UdpSocket::bind(("127.0.0.1", *port)).is_ok()
    };
    (0..10_000).map(next).find(free).expect("one of so many is free")
}

/// The browser that opens reports: `FLOCKMATE_CHROMIUM`, else the first found in `PATH`; `None`,
/// with a printed line, if there is none.
pub fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("FLOCKMATE_CHROMIUM") {
        return Some(named.into());
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&path)
        .flat_map(|dir| names.map(|n| dir.join(n)))
        .find(|p| p.is_file());
    if found.is_none() {
        println!("skipped: no chromium here; FLOCKMATE_CHROMIUM can name one");
    }
    found
}

/// Calls `one` for the seeds 0 to `usual` - 1 in parallel; the environment variables `name` and
/// `name`_FROM set another number of seeds and another first seed. Fails if `one` returns
/// `Some(true)` (wrong) for any seed, or `None` (not planned) for half of them or more.
pub fn assert_no_seed_is_wrong(name: &str, usual: u64, one: impl Fn(u64) -> Option<bool> + Sync) {
    let (from, count) = (number_from_env(&format!("{name}_FROM"), 0), number_from_env(name, usual));
    let flown: Vec<(u64, bool)> =
        (from..from + count).into_par_iter().filter_map(|seed| Some((seed, one(seed)?))).collect();
    let wrong: Vec<u64> = flown.iter().filter(|(_, wrong)| *wrong).map(|(seed, _)| *seed).collect();
    println!("{} flown, wrong {wrong:?}", flown.len());
    assert!(wrong.is_empty() && 2 * flown.len() as u64 > count);
}

/// A number from the environment variable `name`, by which a test can draw more instances than
/// usual.
pub fn number_from_env(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual)
}
