//! Lock step: this board's time advances only as far as the host's simulation grants it
//! ([`lock_step`]).
//!
//! A message from the host holds the time until which the board may run (the grant), and bytes for
//! the board's UARTs with the times at which they arrive. The dual timer's interrupt, above all
//! others, comes at each of these times. At the end of the grant the board writes the bytes that it
//! sent to the host and reads the next message by semihosting. QEMU executes no instruction during
//! that read, and with `-icount` its timers count instructions: so waiting takes no board time,
//! timers and watchdog need not be stopped, and computing takes its own time.
//!
//! Received bytes enter the UART driver's receive buffer directly, and sent bytes do not pass its
//! send buffer: the host's serial line simulates the baud rate.
#![expect(
    unsafe_code,
    reason = "memory that the linker knows nothing of, and the host's debug probe"
)]

use core::cell::RefCell;
use core::mem::MaybeUninit;
use core::slice;

use critical_section::{CriticalSection, Mutex};
use lock_step::{COMMAND_LINE, FromBoard, HEADER_LEN, MAX_MESSAGE_LEN, ToBoard};
use semihosting::fs::File;
use semihosting::io::{Read, Write};
use semihosting::sys::arm_compat::sys_get_cmdline_uninit;

use super::clock::{CLOCK_NOW, COUNTS_PER_US};
use super::interrupts::{self, Irq};
use super::registers::Register;

/// Addresses of the buffers for a received message and for records to send; the program uses no
/// memory there.
const MESSAGE_ADDRESS: usize = 0x6060_0000;
const SENT_ADDRESS: usize = 0x6068_0000;

/// Address of the dual timer, of which the first timer is used, and offsets of its registers.
const TIMER: usize = 0x4000_2000;
const LOAD: usize = 0;
const CONTROL: usize = 8;
const INTCLR: usize = 12;
/// Timer control: enabled, periodic mode, interrupt, 32 bits, one shot.
const ONE_SHOT: u32 = 0b1110_0011;

/// Connection to the host's simulation, by semihosting files.
struct SimulationLink {
    /// File from which the simulation's messages are read.
    input: File,
    /// File to which records are written.
    output: File,
    /// Length of the current message, and how many of its bytes are executed (`executed_len`),
    /// bytes.
    message_len: usize,
    executed_len: usize,
    /// Bytes of queued records, which are written at the grant's end.
    queued_len: usize,
    /// Time of the message's next record, counts since the start.
    next_record_due: u64,
    /// Gives a UART, by its number, the bytes that arrive there.
    receive_on_port: fn(u8, &[u8]),
}

static SIMULATION_LINK: Mutex<RefCell<Option<SimulationLink>>> = Mutex::new(RefCell::new(None));

/// Enters lock step if the board's command line is [`COMMAND_LINE`]: announces the board to the
/// host and waits for the first message. `receive_on_port` is called with a UART's number and the
/// bytes that arrive there.
pub fn start(receive_on_port: fn(u8, &[u8])) {
    let mut line = [MaybeUninit::uninit(); 2 * COMMAND_LINE.len()];
    if sys_get_cmdline_uninit(&mut line).is_ok_and(|line| line == COMMAND_LINE.as_bytes()) {
        let input = File::open(c"/dev/stdin").expect("QEMU has an input");
        // The log already uses the standard output.
        let output = File::create(c"/dev/fd/3").expect("QEMU has an output for answers");
        let mut host = SimulationLink {
            input,
            output,
            message_len: 0,
            executed_len: 0,
            queued_len: 0,
            next_record_due: 0,
            receive_on_port,
        };
        host.queue_record(FromBoard::Started, &[]);
        host.flush();
        host.read_message();
        Register::new(TIMER, CONTROL).write(ONE_SHOT);
        interrupts::enable(Irq::DualTimer, interrupts::GRANTS_PRIORITY);
        critical_section::with(|cs| {
            SIMULATION_LINK.borrow_ref_mut(cs).insert(host).run_due_work(cs)
        });
    }
}

/// Whether the board runs in lock step.
pub fn is_lock_step() -> bool {
    critical_section::with(|cs| SIMULATION_LINK.borrow_ref(cs).is_some())
}

/// Time at which the message's next record is due, counts since the start; `u64::MAX` outside lock
/// step.
pub fn next_record_due(cs: CriticalSection<'_>) -> u64 {
    SIMULATION_LINK.borrow_ref(cs).as_ref().map_or(u64::MAX, |host| host.next_record_due)
}

/// Interrupt handler of the dual timer: executes the records that are due.
pub fn on_record_due() {
    Register::new(TIMER, INTCLR).write(1);
    critical_section::with(|cs| {
        if let Some(host) = &mut *SIMULATION_LINK.borrow_ref_mut(cs) {
            host.run_due_work(cs);
        }
    });
}

/// Queues bytes that UART `port` sends, for the host. Returns false outside lock step.
pub fn send(port: u8, bytes: &[u8]) -> bool {
    critical_section::with(|cs| {
        let mut host = SIMULATION_LINK.borrow_ref_mut(cs);
        let Some(host) = &mut *host else { return false };
        let at_us = CLOCK_NOW(cs) / COUNTS_PER_US;
        host.queue_record(FromBoard::Sent { port, len: bytes.len() as u16, at_us }, bytes);
        true
    })
}

impl SimulationLink {
    /// Executes all records that are due, reads further messages as needed, and sets the timer for
    /// the next record.
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
                self.next_record_due = due;
                // If the record is due later than the timer can count, its interrupt comes early
                // and this function runs again.
                Register::new(TIMER, LOAD).write((due - now).min(u64::from(u32::MAX)) as u32);
                return;
            }
            self.execute_record(record);
        }
    }

    /// The next record of the message; `None` after the last.
    fn next_record(&self) -> Option<ToBoard> {
        let head = self.message_bytes()[self.executed_len..].first_chunk::<HEADER_LEN>()?;
        Some(ToBoard::from_bytes(head).expect("the host sends records"))
    }

    /// The current message.
    fn message_bytes(&self) -> &'static [u8] {
        // SAFETY: memory of this board that no other code uses; only `read_message` changes it, and
        // no slice of it is alive there.
        unsafe { slice::from_raw_parts(MESSAGE_ADDRESS as *const u8, self.message_len) }
    }

    /// Executes a record and moves to the next.
    fn execute_record(&mut self, record: ToBoard) {
        let from = self.executed_len + HEADER_LEN;
        self.executed_len = from + record.payload_len();
        let bytes = &self.message_bytes()[from..self.executed_len];
        match record {
            ToBoard::Bytes { port, .. } => (self.receive_on_port)(port, bytes),
            ToBoard::Run { .. } => {}
            ToBoard::Peek { address, len } => {
                // SAFETY: the host asks for existing memory.
                let memory =
                    unsafe { slice::from_raw_parts(address as usize as *const u8, len.into()) };
                self.queue_record(FromBoard::Memory { len }, memory);
            }
            ToBoard::Poke { address, .. } => {
                // SAFETY: the host acts as a debug probe and chooses where it writes.
                unsafe { (address as usize as *mut u8).copy_from(bytes.as_ptr(), bytes.len()) };
            }
            ToBoard::Call { address, argument } => {
                // SAFETY: the host passes a function's address, as a debug probe may; the function
                // may never return.
                let call = unsafe {
                    core::mem::transmute::<usize, extern "C" fn(u32)>(address as usize | 1)
                };
                call(argument);
            }
        }
    }

    /// Reports to the host that the message is executed, and waits for the next message.
    fn finish_message(&mut self, cs: CriticalSection<'_>) {
        self.queue_record(FromBoard::Waits { now_us: CLOCK_NOW(cs) / COUNTS_PER_US }, &[]);
        self.flush();
        self.read_message();
    }

    /// Queues a record with its bytes until the grant's end; if the buffer is full, writes the
    /// queued records first.
    fn queue_record(&mut self, record: FromBoard, bytes: &[u8]) {
        if self.queued_len + HEADER_LEN + bytes.len() > MAX_MESSAGE_LEN {
            self.flush();
        }
        for part in [&record.to_bytes(), bytes] {
            // SAFETY: memory of this board that no other code uses, and long enough.
            unsafe {
                ((SENT_ADDRESS + self.queued_len) as *mut u8).copy_from(part.as_ptr(), part.len())
            };
            self.queued_len += part.len();
        }
    }

    /// Writes the queued records to the host.
    fn flush(&mut self) {
        // SAFETY: as in `queue_record`, which wrote it.
        let sent = unsafe { slice::from_raw_parts(SENT_ADDRESS as *const u8, self.queued_len) };
        self.output.write_all(sent).expect("the host listens");
        self.queued_len = 0;
    }

    /// Waits for the next message of the host and reads it.
    fn read_message(&mut self) {
        let mut length = [0; 4];
        // The host has closed the connection: the board stops.
        if self.input.read_exact(&mut length).is_err() {
            semihosting::process::exit(0);
        }
        (self.message_len, self.executed_len) = (u32::from_le_bytes(length) as usize, 0);
        assert!(self.message_len <= MAX_MESSAGE_LEN, "the host sends no longer messages");
        // SAFETY: memory of this board that no other code uses, and long enough.
        let message =
            unsafe { slice::from_raw_parts_mut(MESSAGE_ADDRESS as *mut u8, self.message_len) };
        self.input.read_exact(message).expect("a whole message");
    }
}
