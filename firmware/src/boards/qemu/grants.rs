//! Lock step: this board's time passes only as the desk grants it ([`lock_step`]).
//!
//! A message of the desk says until when the board may run, and which bytes its ports receive when.
//! The dual timer, above every other interrupt, comes when the next of it is due. Where the grant
//! ends the board gives what it sent to the desk and reads the next message by semihosting. QEMU
//! runs no instruction meanwhile, and with `-icount` its timers count instructions: so waiting
//! takes no time of the board, its timers and its watchdog need not be stopped, and computing takes
//! what it takes.
//!
//! Bytes enter where the UART's driver keeps what it received, and leave where it would take what
//! is to be sent: the desk's serial line knows baud rates.
#![expect(
    unsafe_code,
    reason = "memory that the linker knows nothing of, and the desk's debug probe"
)]

use core::cell::RefCell;
use core::mem::MaybeUninit;
use core::slice;

use critical_section::{CriticalSection, Mutex};
use lock_step::{COMMAND_LINE, FromBoard, HEAD, LONGEST, ToBoard};
use semihosting::fs::File;
use semihosting::io::{Read, Write};
use semihosting::sys::arm_compat::sys_get_cmdline_uninit;

use super::clock::{CLOCK_NOW, COUNTS_PER_US};
use super::interrupts::{self, Irq};
use super::registers::Register;

/// Addresses of a received message and of sent bytes: beyond all that the program uses.
const MESSAGE_ADDRESS: usize = 0x6060_0000;
const SENT_ADDRESS: usize = 0x6068_0000;

const TIMER: usize = 0x4000_2000;
const LOAD: usize = 0;
const CONTROL: usize = 8;
const INTCLR: usize = 12;
/// Timer control: enabled, periodic, interrupt, 32 bits, one shot.
const ONE_SHOT: u32 = 0b1110_0011;

/// Connection of the board to the desk.
struct SimulationLink {
    input: File,
    output: File,
    /// Bytes of the message, and how many of them were done.
    length: usize,
    done: usize,
    /// Bytes that wait for the grant's end.
    sent: usize,
    /// When the next of it is due, counts.
    due: u64,
    /// Takes the bytes that come to a port.
    take: fn(u8, &[u8]),
}

static DESK: Mutex<RefCell<Option<SimulationLink>>> = Mutex::new(RefCell::new(None));

/// Waits for the first message, if the board was switched on in lock step. Bytes that come to a
/// port are given to `take`.
pub fn start(take: fn(u8, &[u8])) {
    let mut line = [MaybeUninit::uninit(); 2 * COMMAND_LINE.len()];
    if sys_get_cmdline_uninit(&mut line).is_ok_and(|line| line == COMMAND_LINE.as_bytes()) {
        let input = File::open(c"/dev/stdin").expect("QEMU has an input");
        // The log goes to the standard output.
        let output = File::create(c"/dev/fd/3").expect("QEMU has an output for answers");
        let mut desk = SimulationLink { input, output, length: 0, done: 0, sent: 0, due: 0, take };
        desk.queue_record(FromBoard::Started, &[]);
        desk.flush();
        desk.read_message();
        Register::new(TIMER, CONTROL).write(ONE_SHOT);
        interrupts::enable(Irq::DualTimer, interrupts::GRANTS);
        critical_section::with(|cs| DESK.borrow_ref_mut(cs).insert(desk).run_due_work(cs));
    }
}

/// Whether the board is in lock step.
pub fn is_lock_step() -> bool {
    critical_section::with(|cs| DESK.borrow_ref(cs).is_some())
}

/// When something is due, counts of the clock.
pub fn next_due(cs: CriticalSection<'_>) -> u64 {
    DESK.borrow_ref(cs).as_ref().map_or(u64::MAX, |desk| desk.due)
}

/// An alarm is due.
pub fn on_alarm() {
    Register::new(TIMER, INTCLR).write(1);
    critical_section::with(|cs| {
        if let Some(desk) = &mut *DESK.borrow_ref_mut(cs) {
            desk.run_due_work(cs);
        }
    });
}

/// A port sends bytes by the desk; false where the board is in no lock step.
pub fn send(port: u8, bytes: &[u8]) -> bool {
    critical_section::with(|cs| {
        let mut desk = DESK.borrow_ref_mut(cs);
        let Some(desk) = &mut *desk else { return false };
        let at_us = CLOCK_NOW(cs) / COUNTS_PER_US;
        desk.queue_record(FromBoard::Sent { port, len: bytes.len() as u16, at_us }, bytes);
        true
    })
}

impl SimulationLink {
    /// Runs all work that is due, and sets the timer for the next.
    fn run_due_work(&mut self, cs: CriticalSection<'_>) {
        loop {
            let Some(record) = self.next_record() else {
                self.finish_message(cs);
                continue;
            };
            let due_us = match record {
                ToBoard::Bytes { due_us, .. } => due_us,
                ToBoard::Run { until_us } => until_us,
                ToBoard::Peek { .. } | ToBoard::Poke { .. } | ToBoard::Call { .. } => 0,
            };
            let (due, now) = (due_us * COUNTS_PER_US, CLOCK_NOW(cs));
            if due > now {
                self.due = due;
                // An alarm that is farther away is set again later.
                Register::new(TIMER, LOAD).write((due - now).min(u64::from(u32::MAX)) as u32);
                return;
            }
            self.execute_record(record);
        }
    }

    /// The next record of the message.
    fn next_record(&self) -> Option<ToBoard> {
        let head = self.message_bytes()[self.done..].first_chunk::<HEAD>()?;
        Some(ToBoard::from_bytes(head).expect("the desk sends records"))
    }

    fn message_bytes(&self) -> &'static [u8] {
        // SAFETY: memory of this board that nothing else uses; it changes in `read_message` alone,
        // which has no slice of it.
        unsafe { slice::from_raw_parts(MESSAGE_ADDRESS as *const u8, self.length) }
    }

    /// Executes a record.
    fn execute_record(&mut self, record: ToBoard) {
        let from = self.done + HEAD;
        self.done = from + record.payload_len();
        let bytes = &self.message_bytes()[from..self.done];
        match record {
            ToBoard::Bytes { port, .. } => (self.take)(port, bytes),
            ToBoard::Run { .. } => {}
            ToBoard::Peek { address, len } => {
                // SAFETY: the desk asks for memory that there is.
                let memory =
                    unsafe { slice::from_raw_parts(address as usize as *const u8, len.into()) };
                self.queue_record(FromBoard::Memory { len }, memory);
            }
            ToBoard::Poke { address, .. } => {
                // SAFETY: as a debug probe, the desk knows what it does.
                unsafe { (address as usize as *mut u8).copy_from(bytes.as_ptr(), bytes.len()) };
            }
            ToBoard::Call { address, argument } => {
                // SAFETY: as above; it may never come back.
                let call = unsafe {
                    core::mem::transmute::<usize, extern "C" fn(u32)>(address as usize | 1)
                };
                call(argument);
            }
        }
    }

    /// Ends a message: the next one takes its place.
    fn finish_message(&mut self, cs: CriticalSection<'_>) {
        self.queue_record(FromBoard::Waits { now_us: CLOCK_NOW(cs) / COUNTS_PER_US }, &[]);
        self.flush();
        self.read_message();
    }

    /// Keeps a record for the grant's end, or sends it now if there is no more room.
    fn queue_record(&mut self, record: FromBoard, bytes: &[u8]) {
        if self.sent + HEAD + bytes.len() > LONGEST {
            self.flush();
        }
        for part in [&record.to_bytes(), bytes] {
            // SAFETY: memory of this board that nothing else uses, and long enough.
            unsafe { ((SENT_ADDRESS + self.sent) as *mut u8).copy_from(part.as_ptr(), part.len()) };
            self.sent += part.len();
        }
    }

    fn flush(&mut self) {
        // SAFETY: as above; `queue_record` wrote it.
        let sent = unsafe { slice::from_raw_parts(SENT_ADDRESS as *const u8, self.sent) };
        self.output.write_all(sent).expect("the desk listens");
        self.sent = 0;
    }

    /// Waits for the next message.
    fn read_message(&mut self) {
        let mut length = [0; 4];
        // The desk is gone: there is nobody to run for.
        if self.input.read_exact(&mut length).is_err() {
            semihosting::process::exit(0);
        }
        (self.length, self.done) = (u32::from_le_bytes(length) as usize, 0);
        assert!(self.length <= LONGEST, "the desk sends no longer messages");
        // SAFETY: memory of this board that nothing else uses, and long enough.
        let message = unsafe { slice::from_raw_parts_mut(MESSAGE_ADDRESS as *mut u8, self.length) };
        self.input.read_exact(message).expect("a whole message");
    }
}
