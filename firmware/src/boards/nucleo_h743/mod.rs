//! ST's NUCLEO-H743ZI: STM32H743 at 480 MHz, 1 MB of RAM, 2 MB of flash.
//!
//! | pin | is |
//! |---|---|
//! | PD5 / PD6 | USART2 TX / RX, the autopilot's TELEM2, 921 600 baud |
//! | PC6 / PC7 | USART6 TX / RX, the swarm's radio, 460 800 baud |
//! | PB0 | LD1, green |
#![expect(unsafe_code, reason = "handlers of interrupts")]

use defmt_rtt as _;
use embassy_stm32::flash::{Flash as Device, InterruptHandler};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::mode::Async as ByDma;
use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, dma, peripherals, rcc};
use static_cell::ConstStaticCell;

use super::parts::{self, Parts};

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

pub use flash::{Flash, LAYOUT};

const AUTOPILOT_BAUD: u32 = 921_600;
const RADIO_BAUD: u32 = 460_800;
/// The DMA turns in it: 22 ms of the autopilot's bytes. Statics lie in AXI SRAM, where the DMA reaches them.
const RING: usize = 2048;
static AUTOPILOT_RING: ConstStaticCell<[u8; RING]> = ConstStaticCell::new([0; RING]);
static RADIO_RING: ConstStaticCell<[u8; RING]> = ConstStaticCell::new([0; RING]);

/// Receives by DMA into a ring.
pub type Receiver = RingBufferedUartRx<'static>;
/// Transmits by DMA.
pub type Transmitter = UartTx<'static, ByDma>;

/// Priority of the executor of links and setpoints: below all devices.
pub const LINKS_PRIORITY: u8 = LINKS_AT as u8;
const LINKS_AT: Priority = Priority::P8;

/// No device of ours has it: it runs the executor of links and setpoints.
#[interrupt]
unsafe fn UART7() {
    // SAFETY: this is the handler.
    unsafe { parts::on_links() }
}

/// The same for plans and flash.
#[interrupt]
unsafe fn UART8() {
    // SAFETY: as above.
    unsafe { parts::on_plans() }
}

/// Starts the board. To be called once.
pub fn start() -> Parts {
    let p = embassy_stm32::init(clocks());
    // SAFETY: the instruction cache is this function's alone, which is called once. Code is never written.
    unsafe { cortex_m::Peripherals::steal() }.SCB.enable_icache();
    interrupt::UART7.set_priority(LINKS_AT);
    interrupt::UART8.set_priority(Priority::P12);
    let serial = |baudrate| {
        let mut config = usart::Config::default();
        config.baudrate = baudrate;
        config
    };
    let fits = "the baud rate can be made from the clock";
    let (sends, receives) =
        Uart::new(p.USART2, p.PD6, p.PD5, p.DMA1_CH0, p.DMA1_CH1, Irqs, serial(AUTOPILOT_BAUD))
            .expect(fits)
            .split();
    let autopilot = (receives.into_ring_buffered(AUTOPILOT_RING.take()), sends);
    let (sends, receives) =
        Uart::new(p.USART6, p.PC7, p.PC6, p.DMA1_CH2, p.DMA1_CH3, Irqs, serial(RADIO_BAUD))
            .expect(fits)
            .split();
    let swarm = (receives.into_ring_buffered(RADIO_RING.take()), sends);
    Parts {
        links: parts::start_links(interrupt::UART7),
        plans: parts::start_plans(interrupt::UART8),
        autopilot,
        swarm,
        flash: Flash::new(Device::new(p.FLASH, Irqs)),
        watchdog: Watchdog::new(p.IWDG1, Output::new(p.PB0, Level::Low, Speed::Low)),
    }
}

/// 480 MHz from the internal oscillator.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hsi = Some(rcc::HSIPrescaler::DIV1);
    config.rcc.pll1 = Some(rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL60,
        fracn: None,
        divp: Some(rcc::PllDiv::DIV2),
        divq: Some(rcc::PllDiv::DIV8),
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV2;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb3_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb4_pre = rcc::APBPrescaler::DIV2;
    config.rcc.voltage_scale = rcc::VoltageScale::Scale0;
    config
}

/// The independent watchdog, and the light that shows that it is fed.
pub struct Watchdog {
    device: IndependentWatchdog<'static, peripherals::IWDG1>,
    light: Output<'static>,
}

impl Watchdog {
    fn new(device: Peri<'static, peripherals::IWDG1>, light: Output<'static>) -> Self {
        Self { device: IndependentWatchdog::new(device, super::BITES_AFTER_US), light }
    }

    /// Wakes it.
    pub fn wake(&mut self) {
        self.device.unleash();
    }

    /// Puts the reset off.
    pub fn feed(&mut self) {
        self.device.pet();
        self.light.toggle();
    }
}
