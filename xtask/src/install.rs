//! Installs what the tests need beyond Rust: Debian packages (if root), and a venv for the Python
//! clients.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Result, bail};

use crate::shell::{command, find_on_path, run, target_dir};

/// A Debian package, and a file whose presence shows that it is installed.
pub struct Package {
    /// Name of the package.
    pub name: &'static str,
    /// Path of a file that the package installs; the package counts as installed if it exists.
    pub file: &'static str,
}

/// Debian's Rust with the sources of `core`: builds the firmware where rustup has no target for the
/// boards.
pub const BARE_METAL: &[Package] = &[
    Package { name: "rustc-web", file: "/usr/bin/rustc" },
    Package { name: "cargo-web", file: "/usr/bin/cargo" },
    Package { name: "rust-web-src", file: "/usr/share/doc/rust-web-src/copyright" },
    Package { name: "lld", file: "/usr/bin/ld.lld" },
];
/// The emulator of the board `qemu`.
pub const EMULATOR: &[Package] =
    &[Package { name: "qemu-system-arm", file: "/usr/bin/qemu-system-arm" }];
/// The browser in which tests open reports.
pub const BROWSER: &[Package] = &[Package { name: "chromium", file: "/usr/bin/chromium" }];
/// What the C++ baseline of the roadmap bench needs.
pub const CPP_BASELINE: &[Package] = &[
    Package { name: "liboctomap-dev", file: "/usr/include/octomap/octomap.h" },
    Package { name: "g++", file: "/usr/bin/g++" },
];
/// The program that counts instructions on the host.
pub const INSTRUCTION_COUNTER: &[Package] =
    &[Package { name: "valgrind", file: "/usr/bin/valgrind" }];
/// Python packages with the MAVLink clients that tests fly with.
const PYTHON_CLIENTS: &[&str] = &["mavsdk<4", "pymavlink", "MAVProxy"];

/// Installs those of `packages` that are missing, if root on Debian; otherwise the error names
/// them.
pub fn install_missing(packages: &[Package]) -> Result<()> {
    let missing: Vec<_> =
        packages.iter().filter(|p| !Path::new(p.file).exists()).map(|p| p.name).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let list = missing.join(" ");
    if find_on_path("apt-get").is_none() || !is_root() {
        bail!("missing Debian packages: apt-get install {list}");
    }
    println!("installing {list}");
    let apt = |args: &[&str]| {
        run(command("apt-get")
            .args(args)
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdout(Stdio::null()))
    };
    apt(&["update", "-qq"])?;
    apt(&[&["install", "-y", "-qq", "--no-install-recommends"], missing.as_slice()].concat())
}

/// Whether this program runs as root.
fn is_root() -> bool {
    let id = command("id").arg("-u").output();
    id.is_ok_and(|out| out.stdout.trim_ascii() == b"0")
}

/// Path of the Python of a venv with MAVSDK, pymavlink and MAVProxy. The first call creates the
/// venv in the target directory.
pub fn install_python_clients() -> Result<PathBuf> {
    let venv = target_dir().join("venv");
    let python = venv.join("bin/python");
    let ready = venv.join("flockmate-ready");
    let clients = PYTHON_CLIENTS.join(", ");
    if std::fs::read_to_string(&ready).ok().as_ref() != Some(&clients) {
        println!("making a venv for {clients}");
        if run(command("python3").args(["-m", "venv"]).arg(&venv)).is_err() {
            install_missing(&[Package {
                name: "python3-venv",
                file: "/usr/share/doc/python3-venv",
            }])?;
            run(command("python3").args(["-m", "venv", "--clear"]).arg(&venv))?;
        }
        run(command(&python).args(["-m", "pip", "install", "--quiet"]).args(PYTHON_CLIENTS))?;
        std::fs::write(ready, clients)?;
    }
    Ok(python)
}
