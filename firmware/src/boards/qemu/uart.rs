//! Driver of the CMSDK UARTs, one byte per interrupt.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;

use super::grants;
use super::interrupts::{self, Irq};
use super::registers::Register;

/// Offsets of a UART's registers.
const DATA: usize = 0;
const STATE: usize = 4;
const CTRL: usize = 8;
const INTCLEAR: usize = 12;
const BAUDDIV: usize = 16;
/// Bits of STATE.
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const RX_OVERRUN: u32 = 8;
/// Value of CTRL: transmitter and receiver enabled, with interrupts.
const BOTH_ENABLED: u32 = 0b1111;
/// Value of BAUDDIV: the device wants at least 16; QEMU simulates no baud rate.
const DIVISOR: u32 = 27;
/// Bytes of the receive buffer: a quarter of a second at 18 kB/s, the fastest that QEMU delivers.
const RECEIVE_BUFFER_LEN: usize = 4096;
/// Bytes of the send buffer.
const SEND_BUFFER_LEN: usize = 1024;

/// Counters of a UART's losses.
#[derive(Debug, Default)]
pub struct LossCounters {
    /// Times that a byte was lost in the device because the last one had not been read.
    pub overruns: AtomicU32,
    /// Bytes lost because the receive buffer was full.
    pub dropped: AtomicU32,
}

/// One UART and its buffers.
pub struct Uart {
    /// Address of the device.
    base: usize,
    /// Number of the UART in lock step's records.
    port: u8,
    /// Interrupt by which the device asks for the next byte to send.
    transmit_irq: Irq,
    /// Receive buffer.
    received: Pipe<CriticalSectionRawMutex, RECEIVE_BUFFER_LEN>,
    /// Send buffer: bytes that the device has not taken yet.
    sent: Pipe<CriticalSectionRawMutex, SEND_BUFFER_LEN>,
    /// Losses since the start.
    pub counters: LossCounters,
}

/// UART 0, to the autopilot.
pub static AUTOPILOT: Uart = Uart::new(0x4000_4000, 0, Irq::Uart0Tx);
/// UART 1, to the swarm's radio.
pub static SWARM: Uart = Uart::new(0x4000_5000, 1, Irq::Uart1Tx);

/// The UART with this number in lock step's records.
pub(super) fn of_port(port: u8) -> &'static Uart {
    if port == AUTOPILOT.port { &AUTOPILOT } else { &SWARM }
}

impl Uart {
    const fn new(base: usize, port: u8, transmit_irq: Irq) -> Self {
        let counters = LossCounters { overruns: AtomicU32::new(0), dropped: AtomicU32::new(0) };
        Self { base, port, transmit_irq, received: Pipe::new(), sent: Pipe::new(), counters }
    }

    /// The register at this offset.
    fn register(&self, offset: usize) -> Register {
        Register::new(self.base, offset)
    }

    /// Enables the UART and its interrupts, and returns both ends.
    pub fn start(&'static self, receives: Irq) -> (Receiver, Transmitter) {
        self.register(BAUDDIV).write(DIVISOR);
        self.register(CTRL).write(BOTH_ENABLED);
        interrupts::enable(receives, interrupts::DEVICES_PRIORITY);
        interrupts::enable(self.transmit_irq, interrupts::DEVICES_PRIORITY);
        (Receiver { uart: self, reported_losses: 0 }, Transmitter(self))
    }

    /// Puts bytes that arrive in lock step into the receive buffer; bytes without room are dropped
    /// and counted.
    pub(super) fn receive_in_lock_step(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let Ok(taken) = self.received.try_write(bytes) else {
                self.counters.dropped.fetch_add(bytes.len() as u32, Ordering::Relaxed);
                return;
            };
            bytes = &bytes[taken..];
        }
    }

    /// Interrupt handler: moves a received byte into the receive buffer, and the next byte of the
    /// send buffer into the device.
    pub fn on_interrupt(&self) {
        // Cleared before the byte is read: the next byte may arrive at once, and its interrupt must
        // stay pending.
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

/// Error: bytes were lost in the device or because the receive buffer was full.
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

/// Receiving end of a UART.
pub struct Receiver {
    uart: &'static Uart,
    /// Number of losses that `read` has returned as errors.
    reported_losses: u32,
}

/// Sending end of a UART.
pub struct Transmitter(&'static Uart);

impl embedded_io_async::ErrorType for Receiver {
    type Error = BytesLost;
}

impl embedded_io_async::Read for Receiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Self::Error> {
        let lost = [&self.uart.counters.overruns, &self.uart.counters.dropped];
        let lost =
            lost.iter().fold(0, |sum: u32, count| sum.wrapping_add(count.load(Ordering::Relaxed)));
        if core::mem::replace(&mut self.reported_losses, lost) != lost {
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
        interrupts::pend(self.0.transmit_irq);
        Ok(length)
    }

    async fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}
