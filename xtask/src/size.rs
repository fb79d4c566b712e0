//! `cargo xtask size`: what the firmware takes of a board's memory, by part.
//!
//! Flash and statics are read from the linked program. The stack is measured in emulation: it is painted at the start, and what
//! lost its paint in the emulated flight was used. The other boards run the same code, on nearly the same core: they get the
//! same figure.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHF_WRITE, SHT_NOBITS};
use object::{Object, ObjectSection, SectionFlags};
use serde_json::json;

use crate::bare_metal::{self, Board};
use crate::emulate;

/// What to size.
#[derive(clap::Args)]
pub struct Args {
    /// The board
    #[arg(long, value_name = "BOARD", default_value = "nucleo-h743")]
    board: Board,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Builds, flies for the stack, prints.
pub fn run(args: &Args) -> Result<()> {
    let stack = emulate::run_emulate(&emulate::Args::default())?;
    let rows = rows(args.board, stack)?;
    if let Some(out) = &args.out {
        let row = |(name, ours, theirs): &(&str, usize, usize)| {
            let ratio = *theirs as f64 / *ours as f64;
            json!({ "name": name, "ours": ours, "theirs": theirs, "ratio": ratio, "unit": "bytes", "n": 1 })
        };
        let rows: Vec<_> = rows.iter().map(row).collect();
        std::fs::write(out, serde_json::to_string_pretty(&rows)? + "\n")
            .with_context(|| format!("cannot write: {}", out.display()))?;
    }
    Ok(())
}

/// The rows of a board, printed: name, bytes, bytes there are. Too much is an error.
pub fn rows(board: Board, stack: usize) -> Result<Vec<(&'static str, usize, usize)>> {
    let program = bare_metal::build(board)?.folder.join("flockmate");
    let Parts { code, constants, initialised, zeroed } = parts(&program)?;
    let (most_flash, most_ram) = board.memory();
    let (flash, statics) = (code + constants + initialised, initialised + zeroed);
    let rows = vec![
        ("code_bytes", code, most_flash),
        ("constants_bytes", constants, most_flash),
        ("flash_bytes", flash, most_flash),
        ("statics_bytes", statics, most_ram),
        ("stack_bytes", stack, most_ram),
        ("ram_bytes", statics + stack, most_ram),
    ];
    println!("{}", board.name());
    for (name, ours, most) in &rows {
        println!("  {name:16} {ours:>8} of {most}");
    }
    ensure!(flash <= most_flash, "{}: more than {most_flash} bytes of flash", board.name());
    ensure!(statics + stack <= most_ram, "{}: more than {most_ram} bytes of memory", board.name());
    Ok(rows)
}

/// Bytes of a program.
#[derive(Default)]
struct Parts {
    code: usize,
    constants: usize,
    /// In flash and in memory.
    initialised: usize,
    zeroed: usize,
}

/// Adds up the sections of a program that take memory.
fn parts(program: &Path) -> Result<Parts> {
    let bytes = std::fs::read(program).with_context(|| format!("cannot read: {}", program.display()))?;
    let elf = object::File::parse(&*bytes)
        .with_context(|| format!("no program for a board: {}", program.display()))?;
    let mut parts = Parts::default();
    for section in elf.sections() {
        let SectionFlags::Elf { sh_type, sh_flags } = section.flags() else { continue };
        let has = |flag| sh_flags & flag == flag;
        if !has(SHF_ALLOC) {
            continue;
        }
        let part = match (sh_type == SHT_NOBITS, has(SHF_WRITE), has(SHF_EXECINSTR)) {
            (true, _, _) => &mut parts.zeroed,
            (false, true, _) => &mut parts.initialised,
            (false, false, true) => &mut parts.code,
            (false, false, false) => &mut parts.constants,
        };
        *part += section.size() as usize;
    }
    Ok(parts)
}
