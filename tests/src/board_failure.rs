//! Makes a board fail from inside: a debug probe changes memory and calls code while the board is
//! halted.

use std::path::Path;
use std::time::Duration;

use host_sim::boards::EmulatedBoard;
use object::{Object, ObjectSymbol, Symbol};

/// An address without memory: to run there is a fault.
const NO_MEMORY_ADDRESS: u32 = 0xF000_0000;
/// Lowest address of the stack, which no stack use reaches; code is put a little above it.
const STACK_END: u32 = 0x2008_A000;
/// Address of memory that nothing else uses.
const SPARE_ADDRESS: u32 = STACK_END + 0x100;
/// Bytes left on the stack: less than an interrupt pushes.
const STACK_BYTES_LEFT: u32 = 8;
/// End of the name of a function of `core` that only panics, at the location that it gets.
const PANIC_FUNCTION_END: &str = "panic_const_div_by_zero";
/// File name in that location, which the panic message shows.
const PANIC_FILE: &[u8] = b"board_failure.rs";
/// Line that the panic names.
const PANIC_LINE: u32 = 7;
/// End of the name of the firmware's function that computes a plan.
const PLAN_FUNCTION_END: &str = "Planner4plan";
/// An opcode that is an undefined instruction: it raises a fault.
const UNDEFINED_INSTRUCTION: u16 = 0xDE00;
/// Longest wait for an answer: a hung board computes on until its watchdog resets it.
const PATIENCE: Duration = Duration::from_secs(120);

/// Machine code of an endless loop without interrupts: `cpsid i`, then a branch to itself.
const SPIN_CODE: &[u16] = &[0xB672, 0xE7FE];
/// Machine code of a stack overflow: `mov sp, r0`, then `push {r0-r7, lr}`.
const PUSH_CODE: &[u16] = &[0x4685, 0xB5FF];
/// Machine code of a reset: writes 0x05FA_0004 (SYSRESETREQ) to AIRCR at 0xE000_ED0C, then a branch
/// to itself: `movw`, `movt` of `r1` and `r0`, `str r0, [r1]`.
const RESET_CODE: &[u16] =
    &[0xF64E, 0x510C, 0xF2CE, 0x0100, 0xF240, 0x0004, 0xF2C0, 0x50FA, 0x6008, 0xE7FE];
/// Machine code of a delay loop of `r0` rounds: `subs r0, #1`, `bne` back, then return.
const DELAY_CODE: &[u16] = &[0x3801, 0xD1FD, 0x4770];
/// Duration of one round of [`DELAY_CODE`], nanoseconds: two instructions of 2 ns.
const DELAY_ROUND_NS: u64 = 4;

/// How a board is made to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardFailure {
    /// A reset by software, as by the reset key.
    Reset,
    /// A fault: a jump to an address without memory.
    Fault,
    /// A Rust panic.
    Panic,
    /// An endless loop with interrupts disabled; the watchdog ends it.
    Hang,
    /// A push onto a full stack, which reaches into the guard region below it.
    Overflow,
}

impl BoardFailure {
    /// Every kind of failure.
    pub const ALL: [Self; 5] = [Self::Reset, Self::Fault, Self::Panic, Self::Hang, Self::Overflow];

    /// How the board's message about this failure begins after its restart.
    pub fn restart_message(self) -> &'static str {
        match self {
            Self::Reset | Self::Hang => "Restarted: watchdog, reset key or brown-out",
            Self::Fault => "Restarted: fault at 0xf0000000",
            Self::Panic => "Restarted: panic at board_failure.rs:7",
            Self::Overflow => "Restarted: stack overflow",
        }
    }

    /// How long the board hangs in this failure before it restarts.
    pub fn hang_time(self) -> Duration {
        Duration::from_secs(u64::from(self == Self::Hang))
    }

    /// Makes a board that runs this program fail. When this returns the board has restarted; its
    /// flash keeps its content, torn words too.
    ///
    /// # Panics
    /// The board does not restart by itself, or the program has no function that only panics.
    pub fn inflict(self, board: &mut EmulatedBoard, program: &Path) {
        let (address, argument) = match self {
            Self::Reset => (put_code(board, RESET_CODE), 0),
            Self::Fault => (NO_MEMORY_ADDRESS, 0),
            Self::Panic => {
                (function_address(program, PANIC_FUNCTION_END), put_panic_location(board))
            }
            Self::Hang => (put_code(board, SPIN_CODE), 0),
            Self::Overflow => (put_code(board, PUSH_CODE), STACK_END + STACK_BYTES_LEFT),
        };
        let answer = board.call_function(address, argument, PATIENCE).expect("a board");
        assert!(answer.restarted, "{self:?}: the board goes on");
    }
}

/// Resets a board as by its reset key.
///
/// # Panics
/// The board does not restart.
pub fn reset(board: &mut EmulatedBoard) {
    // No function of the program is needed for a reset.
    BoardFailure::Reset.inflict(board, Path::new(""));
}

/// Keeps the board busy for `time`, so that none of its tasks runs.
///
/// # Panics
/// The board does not answer any more.
pub fn block_tasks(board: &mut EmulatedBoard, time: Duration) {
    let count = put_code(board, DELAY_CODE);
    let times = time.as_nanos() as u64 / DELAY_ROUND_NS;
    board.call_function(count, times as u32, PATIENCE).expect("a board");
}

/// Makes a board's planner raise a fault whenever it plans, until the next restart.
///
/// # Panics
/// The program has no function that computes a plan.
pub fn break_planner(board: &mut EmulatedBoard, program: &Path) {
    board
        .write_memory(
            function_address(program, PLAN_FUNCTION_END),
            &UNDEFINED_INSTRUCTION.to_le_bytes(),
        )
        .expect("a board");
}

/// Makes a board's planner take `time` longer for each plan, until the next restart: its first
/// instructions are replaced by a branch to a delay loop.
///
/// # Panics
/// The program has no function that computes a plan.
pub fn slow_planner(board: &mut EmulatedBoard, program: &Path, time: Duration) {
    let plans = function_address(program, PLAN_FUNCTION_END);
    let begins = board.read_memory(plans, 16).expect("a board");
    let halves: Vec<u16> =
        begins.chunks(2).map(|half| u16::from_le_bytes([half[0], half[1]])).collect();
    // `ldr.w pc, [pc]` and the address after it: eight bytes, or ten with a `nop` to align them.
    let (fills, mut moved) = (usize::from(!plans.is_multiple_of(4)), 0);
    while moved < 4 + fills {
        moved += if halves[moved] >= 0xE800 { 2 } else { 1 };
    }
    let far = |address: u32| [0xF8DF, 0xF000, address as u16, (address >> 16) as u16];
    let times = (time.as_nanos() as u64 / DELAY_ROUND_NS) as u32;
    // `push {r0}`, `ldr r0` of the word that is jumped over, `subs`, `bne`, `pop {r0}`, the
    // instructions that the branch has replaced, and the branch back.
    let mut code = vec![0xB401, 0x4801, 0xE002, 0xBF00, times as u16, (times >> 16) as u16];
    code.extend([0x3801, 0xD1FD, 0xBC01]);
    code.extend(&halves[..moved]);
    if !code.len().is_multiple_of(2) {
        code.push(0xBF00);
    }
    code.extend(far((plans + 2 * moved as u32) | 1));
    let code = put_code(board, &code);
    let nop = [0xBF00].repeat(fills);
    let branch: Vec<u16> = nop.into_iter().chain(far(code | 1)).collect();
    board.write_memory(plans, &code_bytes(&branch)).expect("a board");
}

/// Writes code to memory that nothing uses; returns its address.
fn put_code(board: &mut EmulatedBoard, code: &[u16]) -> u32 {
    board.write_memory(SPARE_ADDRESS, &code_bytes(code)).expect("a board");
    SPARE_ADDRESS
}

/// Writes a `core::panic::Location` (file, its length, line, column) to memory that nothing uses;
/// returns its address.
fn put_panic_location(board: &mut EmulatedBoard) -> u32 {
    let words = [SPARE_ADDRESS + 16, PANIC_FILE.len() as u32, PANIC_LINE, 1];
    let bytes: Vec<u8> = words
        .iter()
        .flat_map(|word| word.to_le_bytes())
        .chain(PANIC_FILE.iter().copied())
        .collect();
    board.write_memory(SPARE_ADDRESS, &bytes).expect("a board");
    SPARE_ADDRESS
}

fn code_bytes(code: &[u16]) -> Vec<u8> {
    code.iter().flat_map(|half| half.to_le_bytes()).collect()
}

/// Address of the program's function whose name ends in `part`.
fn function_address(program: &Path, part: &str) -> u32 {
    let bytes = std::fs::read(program).expect("it was started");
    let elf = object::File::parse(&*bytes).expect("a program");
    // Symbols of closures and of generic instances contain their function's name, but do not end in
    // it.
    let ends = |name: &str| name.split(".llvm").next().is_some_and(|name| name.ends_with(part));
    let named = |symbol: &Symbol<'_, '_>| symbol.name().is_ok_and(ends);
    let symbol = elf
        .symbols()
        .find(named)
        .unwrap_or_else(|| panic!("no function has a name that ends in {part}"));
    symbol.address() as u32 & !1
}
