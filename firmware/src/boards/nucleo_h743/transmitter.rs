//! Transmits by DMA from memory that is not cached: what a task has to send lies where the DMA may
//! see an older state.

use companion::link::frame::MAX_FRAME_LEN;
use embassy_stm32::mode::Async as ByDma;
use embassy_stm32::usart::{self, UartTx};
use embedded_io_async::{ErrorType, Write};

/// A whole frame.
pub type Buffer = [u8; MAX_FRAME_LEN];
/// A buffer with nothing to send.
pub const EMPTY: Buffer = [0; MAX_FRAME_LEN];

/// Transmits by DMA.
pub struct Transmitter {
    device: UartTx<'static, ByDma>,
    buffer: &'static mut Buffer,
}

impl Transmitter {
    pub(super) fn new(device: UartTx<'static, ByDma>, buffer: &'static mut Buffer) -> Self {
        Self { device, buffer }
    }
}

impl ErrorType for Transmitter {
    type Error = usart::Error;
}

impl Write for Transmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, usart::Error> {
        let length = bytes.len().min(self.buffer.len());
        let sent = &mut self.buffer[..length];
        sent.copy_from_slice(&bytes[..length]);
        self.device.write(sent).await?;
        Ok(length)
    }

    async fn flush(&mut self) -> Result<(), usart::Error> {
        self.device.flush().await
    }
}
