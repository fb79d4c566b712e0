//! What goes wrong inside a board, done to it through QEMU's stub for debuggers.
//!
//! The little of GDB's remote protocol that this takes (GDB manual, appendix "GDB Remote Serial Protocol"): packets `$TEXT#SUM`, each
//! answered by `+` and a packet. No client of it is to be had as a crate.

use std::io::{Read, Write};
use std::net::TcpStream;

/// Stack pointer, program counter and program status of a Cortex-M, by the stub's numbers.
const SP: u8 = 13;
const PC: u8 = 15;
const XPSR: u8 = 25;
/// No flags, and Thumb state, as always.
const THUMB: u32 = 1 << 24;

/// A debugger of a board, which stands still as long as it is there.
pub struct Debugger {
    stub: TcpStream,
}

impl Debugger {
    /// Halts the board behind a fresh connection to the stub.
    ///
    /// # Panics
    /// The stub is silent, or speaks of something else.
    pub fn new(stub: TcpStream) -> Self {
        let mut debugger = Self { stub };
        // The stub takes numbers of registers only from who knows them.
        let known = debugger.ask("qXfer:features:read:target.xml:0,ffb");
        assert!(known.starts_with('l') || known.starts_with('m'), "{known}");
        debugger
    }

    /// Has the processor go on at another place, and takes it so many instructions there: meanwhile no interrupt is taken.
    ///
    /// # Panics
    /// As [`new`](Self::new).
    pub fn jump(&mut self, address: u32, instructions: usize) {
        self.set(XPSR, THUMB);
        self.set(PC, address);
        for _ in 0..instructions {
            let stopped = self.ask("s");
            assert!(stopped.starts_with('T') || stopped.starts_with('S'), "{stopped}");
        }
    }

    /// Has the stack end elsewhere.
    ///
    /// # Panics
    /// As [`new`](Self::new).
    pub fn set_stack(&mut self, address: u32) {
        self.set(SP, address);
    }

    /// Puts bytes into its memory.
    ///
    /// # Panics
    /// As [`new`](Self::new).
    pub fn write(&mut self, address: u32, bytes: &[u8]) {
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.tell(&format!("M{address:x},{:x}:{hex}", bytes.len()));
    }

    /// Lets the board run on.
    ///
    /// # Panics
    /// As [`new`](Self::new).
    pub fn leave(mut self) {
        self.tell("D");
    }

    fn set(&mut self, register: u8, value: u32) {
        let bytes = value.to_le_bytes().map(|byte| format!("{byte:02x}")).concat();
        self.tell(&format!("P{register:x}={bytes}"));
    }

    fn tell(&mut self, request: &str) {
        let answer = self.ask(request);
        assert_eq!(answer, "OK", "{request}");
    }

    fn ask(&mut self, request: &str) -> String {
        let sum = request.bytes().fold(0, u8::wrapping_add);
        write!(self.stub, "${request}#{sum:02x}").expect("QEMU listens");
        let mut heard = Vec::new();
        let mut byte = [0];
        // The packet's sum is two digits.
        while heard.iter().rev().nth(2) != Some(&b'#') {
            self.stub.read_exact(&mut byte).expect("QEMU answers");
            heard.push(byte[0]);
        }
        self.stub.write_all(b"+").expect("QEMU listens");
        let text = String::from_utf8_lossy(&heard);
        text.trim_start_matches('+').trim_start_matches('$').split('#').next().unwrap_or_default().to_owned()
    }
}
