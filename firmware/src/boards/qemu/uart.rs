//! CMSDK UARTs, one byte at a time by interrupt.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;

use super::grants;
use super::interrupts::{self, Irq};
use super::registers::Register;

const DATA: usize = 0;
const STATE: usize = 4;
const CTRL: usize = 8;
const INTCLEAR: usize = 12;
const BAUDDIV: usize = 16;
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const RX_OVERRUN: u32 = 8;
/// Both directions, both with interrupts.
const BOTH_ENABLED: u32 = 0b1111;
/// The emulated line has no baud rate; the device wants one of at least 16.
const DIVISOR: u32 = 27;
/// Bytes of the receive buffer: a quarter of a second at 18 kB/s, which is as fast as this device
/// takes bytes.
const RECEIVE_BUFFER: usize = 4096;
const SEND_BUFFER: usize = 1024;

/// Counters of a UART.
#[derive(Debug, Default)]
pub struct Counters {
    /// Bytes lost in the device: it had no room.
    pub overruns: AtomicU32,
    /// Bytes lost behind it: nobody took them.
    pub dropped: AtomicU32,
}

/// One UART.
pub struct Uart {
    base: usize,
    /// Number of the port, as the desk counts.
    port: u8,
    transmits: Irq,
    received: Pipe<CriticalSectionRawMutex, RECEIVE_BUFFER>,
    sent: Pipe<CriticalSectionRawMutex, SEND_BUFFER>,
    /// Errors so far.
    pub counters: Counters,
}

/// UART 0, to the autopilot.
pub static AUTOPILOT: Uart = Uart::new(0x4000_4000, 0, Irq::Uart0Tx);
/// UART 1, to the swarm's radio.
pub static SWARM: Uart = Uart::new(0x4000_5000, 1, Irq::Uart1Tx);

/// The UART that the desk counts as this.
pub(super) fn of_port(port: u8) -> &'static Uart {
    if port == AUTOPILOT.port { &AUTOPILOT } else { &SWARM }
}

impl Uart {
    const fn new(base: usize, port: u8, transmits: Irq) -> Self {
        let counters = Counters { overruns: AtomicU32::new(0), dropped: AtomicU32::new(0) };
        Self { base, port, transmits, received: Pipe::new(), sent: Pipe::new(), counters }
    }

    fn register(&self, offset: usize) -> Register {
        Register::new(self.base, offset)
    }

    /// Lets bytes flow.
    pub fn start(&'static self, receives: Irq) -> (Receiver, Transmitter) {
        self.register(BAUDDIV).write(DIVISOR);
        self.register(CTRL).write(BOTH_ENABLED);
        interrupts::enable(receives, interrupts::DEVICES);
        interrupts::enable(self.transmits, interrupts::DEVICES);
        (Receiver { uart: self, reported: 0 }, Transmitter(self))
    }

    /// Takes bytes that a line in lock step brings: all that there is room for.
    pub(super) fn receive_in_lock_step(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let Ok(taken) = self.received.try_write(bytes) else {
                self.counters.dropped.fetch_add(bytes.len() as u32, Ordering::Relaxed);
                return;
            };
            bytes = &bytes[taken..];
        }
    }

    /// Takes the byte that has come and gives the next one to send.
    pub fn on_interrupt(&self) {
        // Cleared before the byte is taken: the next may come at once, and its interrupt must stay.
        self.register(INTCLEAR).write(0b1111);
        let state = self.register(STATE).read();
        if state & RX_OVERRUN != 0 {
            self.register(STATE).write(RX_OVERRUN);
            self.counters.overruns.fetch_add(1, Ordering::Relaxed);
        }
        if state & RX_FULL != 0 {
            let byte = self.register(DATA).read() as u8;
            if self.received.try_write(&[byte]).is_err() {
                self.counters.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
        let mut byte = [0];
        if state & TX_FULL == 0 && self.sent.try_read(&mut byte).is_ok() {
            self.register(DATA).write(u32::from(byte[0]));
        }
    }
}

/// Error: bytes were lost in the device or in the receive buffer.
#[derive(Clone, Copy, Debug)]
pub struct BytesLost;

impl core::fmt::Display for BytesLost {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("bytes were lost")
    }
}

impl core::error::Error for BytesLost {}

impl embedded_io_async::Error for BytesLost {
    fn kind(&self) -> embedded_io_async::ErrorKind {
        embedded_io_async::ErrorKind::Other
    }
}

/// The end that bytes come out of.
pub struct Receiver {
    uart: &'static Uart,
    /// Losses that were reported.
    reported: u32,
}

/// The end that bytes go into.
pub struct Transmitter(&'static Uart);

impl embedded_io_async::ErrorType for Receiver {
    type Error = BytesLost;
}

impl embedded_io_async::Read for Receiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let lost = [&self.uart.counters.overruns, &self.uart.counters.dropped];
        let lost =
            lost.iter().fold(0, |sum: u32, count| sum.wrapping_add(count.load(Ordering::Relaxed)));
        if core::mem::replace(&mut self.reported, lost) != lost {
            return Err(BytesLost);
        }
        Ok(self.uart.received.read(buffer).await)
    }
}

impl embedded_io_async::ErrorType for Transmitter {
    type Error = core::convert::Infallible;
}

impl embedded_io_async::Write for Transmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        if grants::send(self.0.port, bytes) {
            return Ok(bytes.len());
        }
        let length = self.0.sent.write(bytes).await;
        interrupts::pend(self.0.transmits);
        Ok(length)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
