//! Builds programs for boards: by rustup's compiler if it has the target, else by Debian's, which
//! also builds `core`.

use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::install;
use crate::shell::{cargo, command, compile, target_dir};

/// A board that the firmware is built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Board {
    /// QEMU's mps2-an500, a Cortex-M7 with the memory of the STM32H743.
    Qemu,
    /// ST's NUCLEO-H743ZI.
    NucleoH743,
    /// Raspberry Pi Pico 2: RP2350, Cortex-M33.
    Pico2,
}

/// A RAM of a board.
pub struct Region {
    /// Name of its row in `cargo xtask size`.
    pub name: &'static str,
    /// Address of its first byte.
    pub address: u64,
    /// Its size, bytes.
    pub len: usize,
    /// Budget of statics in it, bytes.
    pub statics_budget: usize,
    /// Whether it holds the stack too.
    pub has_stack: bool,
}

impl Region {
    /// The same region, which holds the stack too.
    const fn with_stack(mut self) -> Self {
        self.has_stack = true;
        self
    }
}

impl Board {
    /// All boards.
    pub const ALL: [Self; 3] = [Self::Qemu, Self::NucleoH743, Self::Pico2];

    /// Name on the command line, which is also the firmware's cargo feature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Qemu => "qemu",
            Self::NucleoH743 => "nucleo-h743",
            Self::Pico2 => "pico2",
        }
    }

    /// Budget of the program in flash, bytes.
    pub fn flash_budget(self) -> usize {
        match self {
            Self::Qemu | Self::NucleoH743 => 512 << 10,
            Self::Pico2 => 1 << 20,
        }
    }

    /// The board's RAMs, as in its `memory.x`, with the budget of statics in each.
    pub fn regions(self) -> &'static [Region] {
        const fn region(name: &'static str, at: u64, len: usize, most: usize) -> Region {
            Region {
                name,
                address: at,
                len: len << 10,
                statics_budget: most << 10,
                has_stack: false,
            }
        }
        // In DTCM companion, crash record and stack guard have 40 kB; the stack has the rest.
        const H743: &[Region] = &[
            region("axi_bytes", 0x2400_0000, 512, 400),
            region("dtcm_bytes", 0x2000_0000, 128, 36).with_stack(),
            region("sram12_bytes", 0x3000_0000, 256, 256),
            region("sram3_bytes", 0x3004_0000, 32, 32),
            region("sram4_bytes", 0x3800_0000, 64, 32),
            region("itcm_bytes", 0x400, 63, 63),
        ];
        // The same sizes at other addresses; the emulated UARTs' buffers (10 kB) lie in AXI SRAM.
        const QEMU: &[Region] = &[
            region("axi_bytes", 0x2000_0000, 512, 400),
            region("dtcm_bytes", 0x2008_0000, 128, 36).with_stack(),
            region("sram12_bytes", 0x2010_0000, 256, 256),
            region("sram3_bytes", 0x2014_0000, 32, 32),
            region("sram4_bytes", 0x2015_0000, 64, 32),
            region("itcm_bytes", 0x2016_0000, 63, 63),
        ];
        const PICO2: &[Region] = &[
            region("ram_bytes", 0x2000_0000, 512, 448).with_stack(),
            region("crash_bytes", 0x2008_0000, 4, 4),
        ];
        match self {
            Self::Qemu => QEMU,
            Self::NucleoH743 => H743,
            Self::Pico2 => PICO2,
        }
    }

    /// Rust's target for the board.
    fn target(self) -> &'static str {
        match self {
            Self::Qemu | Self::NucleoH743 => "thumbv7em-none-eabihf",
            Self::Pico2 => "thumbv8m.main-none-eabihf",
        }
    }

    /// The compiler's name for the board's processor.
    fn cpu(self) -> &'static str {
        match self {
            Self::Qemu | Self::NucleoH743 => "cortex-m7",
            Self::Pico2 => "cortex-m33",
        }
    }

    /// The packages that define the board's programs.
    fn packages(self) -> &'static [&'static str] {
        match self {
            Self::Qemu => &["firmware", "board-bench"],
            Self::NucleoH743 | Self::Pico2 => &["firmware"],
        }
    }

    /// The programs that are built for the board.
    pub fn programs(self) -> &'static [&'static str] {
        match self {
            Self::Qemu => &["flockmate", "measure", "calls", "limits"],
            Self::NucleoH743 | Self::Pico2 => &["flockmate"],
        }
    }
}

/// The programs that were built for a board.
pub struct BuiltPrograms {
    /// Directory that holds them.
    pub folder: PathBuf,
    /// Number of the compiler's warnings, repeated ones of earlier builds included.
    pub warnings: usize,
}

/// Builds a board's programs and copies them to a directory of that board.
pub fn build(board: Board) -> Result<BuiltPrograms> {
    let target = board.target();
    let packages = board.packages().iter().flat_map(|name| ["-p", name]);
    let programs = board.programs().iter().flat_map(|name| ["--bin", name]);
    let products = target_dir().join("firmware");
    let mut flags = String::new();
    let mut building = if rustup_has_target(target) {
        println!("{}: rustup's {target}", board.name());
        cargo()
    } else {
        println!("{}: Debian's toolchain builds core for {target}", board.name());
        install::install_missing(install::BARE_METAL)
            .with_context(|| format!("neither that nor rustup's: rustup target add {target}"))?;
        flags += "-Clinker-flavor=ld.lld ";
        let mut cargo = command("/usr/bin/cargo");
        cargo
            .env("RUSTC_BOOTSTRAP", "1")
            .env("RUSTC", "/usr/bin/rustc")
            .env(cargo_target_variable(target, "LINKER"), "/usr/bin/ld.lld")
            .env_remove("RUSTUP_TOOLCHAIN")
            .env_remove("CARGO");
        cargo.args(["-Zbuild-std=core,alloc", "-Zbuild-std-features=compiler-builtins-mem"]);
        cargo
    };
    flags += &format!("-Ctarget-cpu={}", board.cpu());
    // Else LLVM aligns every loop of a Cortex-M7 to 8 bytes by `nop`s before it, which are executed
    // on the way in: 3.3 kB of flash. Without them a control step takes 0.1 % fewer instructions.
    flags += " -Cllvm-args=-max-bytes-for-alignment=1";
    // The linker keeps one of functions with the same code, such as those of a generic function for
    // types of the same layout: 3.1 kB of flash. No code relies on two functions' addresses to
    // differ; embassy-executor compares a static table of functions, but only with itself.
    flags += " -Clink-arg=--icf=all";
    building
        .args(["build", "--release", "--locked", "--target", target])
        .args(["--features", board.name()])
        .args(packages)
        .args(programs)
        .env(cargo_target_variable(target, "RUSTFLAGS"), flags);
    // Either variable would replace the flags set above.
    building.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
    building.env("CARGO_TARGET_DIR", &products).env("DEFMT_LOG", "info");
    // A tenth less code than opt-level 3, and a control step takes no more instructions. The
    // level's own threshold of inlining is kept: with 260 a step would take 0.3 % fewer
    // instructions, but the program 10.8 kB more flash.
    building.args(["--config", "profile.release.opt-level=2"]);
    building.args(["--config", "profile.release.package.planner-core.opt-level=3"]);
    // With several units the functions that share a unit, and so what is inlined, depend on the
    // path of the checkout: two clones differed by 6 kB of code and 1 % of the instructions.
    building.args(["--config", "profile.release.codegen-units=1"]);
    // The chip's drivers only set registers: optimized for size they are as fast.
    building.args(["--config", "profile.release.package.embassy-stm32.opt-level='s'"]);
    let warnings = compile(&mut building)?.warnings;
    // The programs of two boards have the same names, and cargo shares their directory: so they are
    // copied.
    let aside = products.join(board.name());
    std::fs::create_dir_all(&aside)?;
    for program in board.programs() {
        std::fs::copy(products.join(target).join("release").join(program), aside.join(program))?;
    }
    Ok(BuiltPrograms { folder: aside, warnings })
}

/// Name of cargo's environment variable for a setting of a target.
fn cargo_target_variable(target: &str, name: &str) -> String {
    format!("CARGO_TARGET_{}_{name}", target.to_uppercase().replace(['-', '.'], "_"))
}

/// Whether rustup has installed the target.
fn rustup_has_target(target: &str) -> bool {
    let installed = command("rustup").args(["target", "list", "--installed"]).output();
    installed
        .is_ok_and(|out| String::from_utf8_lossy(&out.stdout).lines().any(|line| line == target))
}
