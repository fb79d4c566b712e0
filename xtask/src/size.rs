//! `cargo xtask size`: how much of a board's memory the firmware takes, part by part.
//!
//! Flash and statics are read from the linked program. The deepest stack is measured in emulation:
//! at its start the firmware fills the stack with a pattern, and words that no longer have it were
//! used. The other boards run the same code on similar cores, so this depth is used for them too.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHF_WRITE, SHT_NOBITS};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags};
use serde_json::json;

use crate::bare_metal::{self, Board, Region};
use crate::emulate;
use crate::shell::checkout_root;

/// Arguments of `size`.
#[derive(clap::Args)]
pub struct Args {
    /// The board whose firmware is sized
    #[arg(long, value_name = "BOARD", default_value = "nucleo-h743")]
    board: Board,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Flies emulated boards for the stack, then builds the firmware for the board and prints its rows.
pub fn run(args: &Args) -> Result<()> {
    let stack = emulate::fly_for_stack_use(&emulate::Args::default())?;
    let rows = print_and_check_rows(args.board, stack)?;
    if let Some(out) = &args.out {
        let row = |(name, ours, theirs): &Row| {
            let ratio = *theirs as f64 / (*ours).max(1) as f64;
            json!({ "name": name, "ours": ours, "theirs": theirs, "ratio": ratio, "unit": "bytes", "n": 1 })
        };
        let rows: Vec<_> = rows.iter().map(row).collect();
        std::fs::write(out, serde_json::to_string_pretty(&rows)? + "\n")
            .with_context(|| format!("cannot write: {}", out.display()))?;
    }
    Ok(())
}

/// A row: name, bytes taken, budget in bytes.
pub type Row = (&'static str, usize, usize);

/// Prints and returns the rows of a board. An error if a part takes more than its budget.
pub fn print_and_check_rows(board: Board, stack: usize) -> Result<Vec<Row>> {
    let program = bare_metal::build(board)?.folder.join("flockmate");
    let SectionBytes { code, constants, initialised, regions } = section_bytes(&program, board)?;
    let flash_budget = board.flash_budget();
    let flash = code + constants + initialised;
    let mut rows = vec![
        ("code_bytes", code, flash_budget),
        ("constants_bytes", constants, flash_budget),
        ("flash_bytes", flash, flash_budget),
    ];
    rows.extend(
        board
            .regions()
            .iter()
            .zip(regions)
            .map(|(region, bytes)| (region.name, bytes, region.statics_budget)),
    );
    rows.push(("stack_bytes", stack, STACK_BUDGET_BYTES));
    println!("{}", board.name());
    for (name, ours, most) in &rows {
        println!("  {name:16} {ours:>8} of {most}");
    }
    for (name, ours, most) in &rows {
        ensure!(ours <= most, "{}: {name}: {ours} bytes are more than {most}", board.name());
    }
    // The stack shares one memory with statics: both together must fit.
    for region in board.regions().iter().filter(|region| region.has_stack) {
        let statics = rows.iter().find(|row| row.0 == region.name).map_or(0, |row| row.1);
        let all = statics + stack;
        ensure!(
            all <= region.len,
            "{}: {} and stack are {all} of {} bytes",
            board.name(),
            region.name,
            region.len
        );
    }
    Ok(rows)
}

/// Budget of the stack, bytes.
const STACK_BUDGET_BYTES: usize = 64 << 10;

/// Bytes that a program takes, by kind of section.
#[derive(Default)]
struct SectionBytes {
    code: usize,
    constants: usize,
    /// Statics with initial values, which take flash and RAM.
    initialised: usize,
    /// Statics in each of the board's memories, in the order of [`Board::regions`].
    regions: Vec<usize>,
}

/// Adds up the sizes of a program's sections by kind and memory.
fn section_bytes(program: &Path, board: Board) -> Result<SectionBytes> {
    let bytes =
        std::fs::read(program).with_context(|| format!("cannot read: {}", program.display()))?;
    let elf = object::File::parse(&*bytes)
        .with_context(|| format!("no program for a board: {}", program.display()))?;
    ensure_named_statics_exist(&elf, board)?;
    let mut parts =
        SectionBytes { regions: vec![0; board.regions().len()], ..SectionBytes::default() };
    for section in elf.sections() {
        let SectionFlags::Elf { sh_type, sh_flags } = section.flags() else { continue };
        let has = |flag| sh_flags & flag == flag;
        if !has(SHF_ALLOC) {
            continue;
        }
        let size = section.size() as usize;
        match (sh_type == SHT_NOBITS, has(SHF_WRITE), has(SHF_EXECINSTR)) {
            (true, _, _) => {}
            (false, true, _) => parts.initialised += size,
            (false, false, true) => parts.code += size,
            (false, false, false) => parts.constants += size,
        }
        if size > 0 && (sh_type == SHT_NOBITS || has(SHF_WRITE)) {
            let at = section.address();
            let lies = |region: &Region| {
                (region.address..region.address + region.len as u64).contains(&at)
            };
            let region = board.regions().iter().position(lies);
            let region =
                region.with_context(|| format!("{:?} lies nowhere: {at:#x}", section.name()))?;
            parts.regions[region] += size;
        }
    }
    Ok(parts)
}

/// Checks that each static that the board's `memory.x` places by name is in the program: one that
/// was renamed would silently lie in the default memory.
fn ensure_named_statics_exist(elf: &object::File<'_>, board: Board) -> Result<()> {
    let path = match board {
        // QEMU's `memory.x` also places statics that only the measuring programs have.
        Board::Qemu => return Ok(()),
        Board::NucleoH743 => checkout_root().join("memory.x"),
        Board::Pico2 => checkout_root().join("firmware/src/boards/pico2/memory.x"),
    };
    let map = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read: {}", path.display()))?;
    for pattern in map.split(".bss.*").skip(1) {
        let pattern = pattern.split([' ', ')']).next().unwrap_or_default();
        let is_held = |name: &str| {
            let mut parts = pattern.split('*').filter(|part| !part.is_empty());
            parts.try_fold(name, |rest, part| rest.split_once(part).map(|(_, rest)| rest)).is_some()
        };
        ensure!(
            elf.symbols().any(|symbol| symbol.name().is_ok_and(is_held)),
            "{}: no static is named {pattern}",
            path.display()
        );
    }
    Ok(())
}
