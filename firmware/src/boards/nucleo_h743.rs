//! Board support for ST's NUCLEO-H743ZI: STM32H743 at 480 MHz (revision Y of the silicon: 400), 1
//! MB of RAM, 2 MB of flash.
//!
//! | pin | is |
//! |---|---|
//! | PD5 / PD6 | USART2 TX / RX, the autopilot's TELEM2, 921 600 baud |
//! | PC6 / PC7 | USART6 TX / RX, the swarm's radio, 460 800 baud |
//! | PB0 | LD1, green |
#![expect(unsafe_code, reason = "handlers of interrupts")]

use defmt_rtt as _;
use embassy_stm32::flash::{Flash as Device, InterruptHandler};
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, dma, pac, peripherals};
use heapless::Vec;
use static_cell::ConstStaticCell;

use self::start::{clock_config, configure_mpu_and_caches};
use super::limits::WATCHDOG_TIMEOUT_US;
use super::{executors, resources};
use crate::chips::h743::{self, ClockSource, Revision};

bind_interrupts!(struct Irqs {
    USART2 => usart::InterruptHandler<peripherals::USART2>;
    USART6 => usart::InterruptHandler<peripherals::USART6>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_STREAM2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
    DMA1_STREAM3 => dma::InterruptHandler<peripherals::DMA1_CH3>;
    FLASH => InterruptHandler;
});

mod flash;
mod start;
mod transmitter;

pub use flash::{Flash, LAYOUT};
pub use start::{reset, reset_cause};
pub use transmitter::Transmitter;

pub use super::sections::zero_sections;

/// Baud rate of the autopilot's UART.
const AUTOPILOT_BAUD: u32 = 921_600;
/// Baud rate of the radio's UART.
const RADIO_BAUD: u32 = 460_800;
/// Bytes of the ring buffer that DMA fills: 22 ms at the autopilot's baud rate. `memory.x` places
/// the statics named `DMA_…` in SRAM3, which DMA reaches and which is not cached.
const UART_RING_LEN: usize = 2048;
static DMA_AUTOPILOT_IN: ConstStaticCell<[u8; UART_RING_LEN]> =
    ConstStaticCell::new([0; UART_RING_LEN]);
static DMA_RADIO_IN: ConstStaticCell<[u8; UART_RING_LEN]> =
    ConstStaticCell::new([0; UART_RING_LEN]);
static DMA_AUTOPILOT_OUT: ConstStaticCell<transmitter::Buffer> =
    ConstStaticCell::new(transmitter::ZEROED);
static DMA_RADIO_OUT: ConstStaticCell<transmitter::Buffer> =
    ConstStaticCell::new(transmitter::ZEROED);

/// Warning: BOR_LEV in the option bytes is below 3, as on a new chip.
const BROWN_OUT_OFF_WARNING: &str = "Brown-out reset is off: set BOR_LEV to 3";
/// Warning: the ST-LINK outputs no clock.
const NO_HSE_WARNING: &str = "No 8 MHz from the ST-LINK: own oscillator";

/// Receives by DMA into a ring buffer.
pub type Receiver = RingBufferedUartRx<'static>;
/// Interrupt priority of the executor of links and setpoints: below all devices.
pub const LINKS_PRIORITY: u8 = LINKS_INTERRUPT_PRIORITY as u8;
const LINKS_INTERRUPT_PRIORITY: Priority = Priority::P8;

/// Interrupt handler that runs the executor of links and setpoints; no device of this board uses
/// this interrupt.
#[interrupt]
unsafe fn UART7() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_links_executor() }
}

/// Interrupt handler that runs the executor of plans and flash; no device of this board uses this
/// interrupt.
#[interrupt]
unsafe fn UART8() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_plans_executor() }
}

/// What [`start`] returns on this board.
pub type Parts = resources::BoardResources<Receiver, Transmitter, Flash, Watchdog>;

/// Starts watchdog, clocks, MPU, caches, executors, UARTs and flash. To be called once, after
/// [`reset_cause`].
pub fn start() -> Parts {
    start::start_watchdog();
    let revision = Revision::from_idcode(pac::DBGMCU.idc().read().0);
    let source = start::start_clock_source();
    let p = embassy_stm32::init(clock_config(revision, source));
    let mut watchdog = Watchdog::new(p.IWDG1, Output::new(p.PB0, Level::Low, Speed::Low));
    watchdog.start();
    configure_mpu_and_caches();
    let mut warnings = Vec::new();
    let level = h743::brown_out_level(pac::FLASH.optsr_cur().read().0);
    let wrong =
        [(level < 3, BROWN_OUT_OFF_WARNING), (source == ClockSource::Internal, NO_HSE_WARNING)]
            .into_iter()
            .filter(|(is, _)| *is);
    // Cannot overflow: it has room for both warnings.
    wrong.for_each(|(_, text)| _ = warnings.push(text));
    interrupt::UART7.set_priority(LINKS_INTERRUPT_PRIORITY);
    interrupt::UART8.set_priority(Priority::P12);
    let serial = |baudrate| {
        let mut config = usart::Config::default();
        config.baudrate = baudrate;
        // Pull-up on the RX pin: a UART without a cable reads idle, not noise.
        config.rx_pull = Pull::Up;
        config
    };
    let fits = "the baud rate can be made from the clock";
    let (sends, receives) =
        Uart::new(p.USART2, p.PD6, p.PD5, p.DMA1_CH0, p.DMA1_CH1, Irqs, serial(AUTOPILOT_BAUD))
            .expect(fits)
            .split();
    let sends = Transmitter::new(sends, DMA_AUTOPILOT_OUT.take());
    let autopilot = (receives.into_ring_buffered(DMA_AUTOPILOT_IN.take()), sends);
    let (sends, receives) =
        Uart::new(p.USART6, p.PC7, p.PC6, p.DMA1_CH2, p.DMA1_CH3, Irqs, serial(RADIO_BAUD))
            .expect(fits)
            .split();
    let sends = Transmitter::new(sends, DMA_RADIO_OUT.take());
    let swarm = (receives.into_ring_buffered(DMA_RADIO_IN.take()), sends);
    Parts {
        links: executors::start_links_executor(interrupt::UART7),
        plans: executors::start_plans_executor(interrupt::UART8),
        autopilot,
        swarm,
        flash: Flash::new(Device::new(p.FLASH, Irqs)),
        watchdog,
        warnings,
    }
}

/// The independent watchdog, and the LED that toggles each time it is fed.
pub struct Watchdog {
    device: IndependentWatchdog<'static, peripherals::IWDG1>,
    /// Toggles each time the watchdog is fed.
    led: Output<'static>,
}

impl Watchdog {
    fn new(device: Peri<'static, peripherals::IWDG1>, led: Output<'static>) -> Self {
        Self { device: IndependentWatchdog::new(device, WATCHDOG_TIMEOUT_US), led }
    }

    fn start(&mut self) {
        self.device.unleash();
    }

    /// Feeds the watchdog and toggles the LED.
    pub fn feed(&mut self) {
        self.device.pet();
        self.led.toggle();
    }
}
