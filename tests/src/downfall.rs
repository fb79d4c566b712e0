//! What goes wrong inside a board, done to it by its debug probe while it stands still.

use std::path::Path;
use std::time::Duration;

use host_sim::boards::EmulatedBoard;
use object::{Object, ObjectSymbol, Symbol};

/// An address of no memory.
const NOWHERE: u32 = 0xF000_0000;
/// The far end of the stack, which nothing reaches; code is put a little above it.
const STACK_END: u32 = 0x2008_A000;
const SPARE: u32 = STACK_END + 0x100;
/// Less than an interrupt takes of a stack.
const STACK_LEFT: u32 = 8;
/// End of the name of a function of `core` that does nothing but panic, at the place that it is
/// given.
const PANICS: &str = "panic_const_div_by_zero";
/// That place.
const PLACE: &[u8] = b"downfall.rs";
const LINE: u32 = 7;
/// End of the name of the function that makes a plan on a board.
const PLANS: &str = "Planner4plan";
/// An instruction that there is not.
const UNDEFINED: u16 = 0xDE00;
/// A board that goes nowhere computes for a second of its time until its watchdog resets it.
const PATIENCE: Duration = Duration::from_secs(120);

/// `cpsid i`, then a branch to itself.
const SPIN: &[u16] = &[0xB672, 0xE7FE];
/// `mov sp, r0`, then `push {r0-r7, lr}`.
const PUSH: &[u16] = &[0x4685, 0xB5FF];
/// 0x05FA_0004 (SYSRESETREQ) into AIRCR at 0xE000_ED0C, then a branch to itself: `movw`, `movt` of
/// `r1` and `r0`, `str r0, [r1]`.
const RESET: &[u16] =
    &[0xF64E, 0x510C, 0xF2CE, 0x0100, 0xF240, 0x0004, 0xF2C0, 0x50FA, 0x6008, 0xE7FE];
/// `subs r0, #1`, back while it is not zero, and return: two instructions each time.
const COUNT: &[u16] = &[0x3801, 0xD1FD, 0x4770];
/// How long each time takes, at 2 ns an instruction.
const COUNT_NS: u64 = 4;

/// What brings a board down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Downfall {
    /// Somebody presses reset.
    Reset,
    /// The processor runs where nothing is.
    Fault,
    /// The program finds itself wrong.
    Panic,
    /// The program goes nowhere, and hears no interrupt.
    Hang,
    /// The stack is as full as can be: what comes next reaches into the guard below it.
    Overflow,
}

impl Downfall {
    /// All there are.
    pub const ALL: [Self; 5] = [Self::Reset, Self::Fault, Self::Panic, Self::Hang, Self::Overflow];

    /// How what the next start says of it begins.
    pub fn said(self) -> &'static str {
        match self {
            Self::Reset | Self::Hang => "Restarted: watchdog, reset key or brown-out",
            Self::Fault => "Restarted: fault at 0xf0000000",
            Self::Panic => "Restarted: panic at downfall.rs:7",
            Self::Overflow => "Restarted: stack overflow",
        }
    }

    /// How long the board is busy with it before it starts again.
    pub fn lasts(self) -> Duration {
        Duration::from_secs(u64::from(self == Self::Hang))
    }

    /// Brings a board with this program down: it has started again when this returns, and its flash
    /// keeps what it holds, torn words too.
    ///
    /// # Panics
    /// It does not start again by itself. The program has no function that panics by itself.
    pub fn befall(self, board: &mut EmulatedBoard, program: &Path) {
        let (address, argument) = match self {
            Self::Reset => (put(board, RESET), 0),
            Self::Fault => (NOWHERE, 0),
            Self::Panic => (function(program, PANICS), location(board)),
            Self::Hang => (put(board, SPIN), 0),
            Self::Overflow => (put(board, PUSH), STACK_END + STACK_LEFT),
        };
        let answer = board.call_function(address, argument, PATIENCE).expect("a board");
        assert!(answer.restarted, "{self:?}: the board goes on");
    }
}

/// Presses reset.
///
/// # Panics
/// It does not start again.
pub fn reset(board: &mut EmulatedBoard) {
    // Nothing is called in the program.
    Downfall::Reset.befall(board, Path::new(""));
}

/// Nothing else runs on the board for so long.
///
/// # Panics
/// The board is gone.
pub fn block(board: &mut EmulatedBoard, time: Duration) {
    let count = put(board, COUNT);
    let times = time.as_nanos() as u64 / COUNT_NS;
    board.call_function(count, times as u32, PATIENCE).expect("a board");
}

/// Has a board's planner fault whenever it plans, until the next start.
///
/// # Panics
/// The program has no planner.
pub fn break_planner(board: &mut EmulatedBoard, program: &Path) {
    board.write_memory(function(program, PLANS), &UNDEFINED.to_le_bytes()).expect("a board");
}

/// Has a board's planner take so much longer, until the next start: where it begins, a branch leads
/// to code that counts.
///
/// # Panics
/// The program has no planner.
pub fn slow_planner(board: &mut EmulatedBoard, program: &Path, time: Duration) {
    let plans = function(program, PLANS);
    let begins = board.read_memory(plans, 16).expect("a board");
    let halves: Vec<u16> =
        begins.chunks(2).map(|half| u16::from_le_bytes([half[0], half[1]])).collect();
    // `ldr.w pc, [pc]` and the address after it: eight bytes, or ten where a half word fills up.
    let (fills, mut moved) = (usize::from(!plans.is_multiple_of(4)), 0);
    while moved < 4 + fills {
        moved += if halves[moved] >= 0xE800 { 2 } else { 1 };
    }
    let far = |address: u32| [0xF8DF, 0xF000, address as u16, (address >> 16) as u16];
    let times = (time.as_nanos() as u64 / COUNT_NS) as u32;
    // `push {r0}`, `ldr r0` of the word that is jumped over, `subs`, `bne`, `pop {r0}`, what the
    // branch took the place of, and back.
    let mut code = vec![0xB401, 0x4801, 0xE002, 0xBF00, times as u16, (times >> 16) as u16];
    code.extend([0x3801, 0xD1FD, 0xBC01]);
    code.extend(&halves[..moved]);
    if !code.len().is_multiple_of(2) {
        code.push(0xBF00);
    }
    code.extend(far((plans + 2 * moved as u32) | 1));
    let code = put(board, &code);
    let nop = [0xBF00].repeat(fills);
    let branch: Vec<u16> = nop.into_iter().chain(far(code | 1)).collect();
    board.write_memory(plans, &bytes(&branch)).expect("a board");
}

/// Puts code where nothing uses the memory, and returns where.
fn put(board: &mut EmulatedBoard, code: &[u16]) -> u32 {
    board.write_memory(SPARE, &bytes(code)).expect("a board");
    SPARE
}

/// Puts a `core::panic::Location` there, and returns where: file, its length, line, column.
fn location(board: &mut EmulatedBoard) -> u32 {
    let words = [SPARE + 16, PLACE.len() as u32, LINE, 1];
    let bytes: Vec<u8> =
        words.iter().flat_map(|word| word.to_le_bytes()).chain(PLACE.iter().copied()).collect();
    board.write_memory(SPARE, &bytes).expect("a board");
    SPARE
}

fn bytes(code: &[u16]) -> Vec<u8> {
    code.iter().flat_map(|half| half.to_le_bytes()).collect()
}

/// The address of the function whose name contains this.
fn function(program: &Path, part: &str) -> u32 {
    let bytes = std::fs::read(program).expect("it was started");
    let elf = object::File::parse(&*bytes).expect("a program");
    // Closures of a function, and what is made for them, have its name in theirs.
    let ends = |name: &str| name.split(".llvm").next().is_some_and(|name| name.ends_with(part));
    let named = |symbol: &Symbol<'_, '_>| symbol.name().is_ok_and(ends);
    let symbol = elf
        .symbols()
        .find(named)
        .unwrap_or_else(|| panic!("no function has a name that ends in {part}"));
    symbol.address() as u32 & !1
}
