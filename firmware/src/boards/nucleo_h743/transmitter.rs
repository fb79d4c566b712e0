//! UART transmitter by DMA. It copies each frame into a buffer that is not cached: DMA would read
//! stale bytes from a task's cached memory.

use companion::link::frame::MAX_FRAME_LEN;
use embassy_stm32::mode::Async as ByDma;
use embassy_stm32::usart::{self, UartTx};
use embedded_io_async::{ErrorType, Write};

/// A DMA buffer for one MAVLink frame.
pub type Buffer = [u8; MAX_FRAME_LEN];
/// Initial value of the DMA buffers.
pub const ZEROED: Buffer = [0; MAX_FRAME_LEN];

/// Transmits through a DMA buffer.
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
