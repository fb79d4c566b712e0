//! Board support for the Raspberry Pi Pico 2: RP2350, Cortex-M33 at 150 MHz, 520 kB of RAM, 4 MB of
//! external flash.
//!
//! | pin | is |
//! |---|---|
//! | GP0 / GP1 | UART0 TX / RX, the autopilot's TELEM2, 921 600 baud |
//! | GP4 / GP5 | UART1 TX / RX, the swarm's radio, 460 800 baud |
//! | GP25 | the LED, which toggles each time the watchdog is fed |
//!
//! Code runs from the flash that also holds the files, so it stops while that flash erases or
//! programs: no setpoint is sent, and received bytes may be lost. So the flash is changed only
//! while disarmed (`FlashLayout::stalls_processor`): uploads are refused in flight, and changed
//! parameters are stored after landing.
//!
//! `SYSRESETREQ` resets the processor but not watchdog, UARTs and other peripherals. So this board
//! restarts by its watchdog, which resets everything but the oscillators.
#![expect(unsafe_code, reason = "executors in interrupts, roadmaps as they lie in flash")]

use companion::storage::store::{FlashFault, FlashLayout, ReadFlash};
use defmt_rtt as _;
use embassy_rp::flash::{Blocking, Flash as Device};
use embassy_rp::gpio::{Level, Output};
use embassy_rp::interrupt;
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::uart::{
    self, BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx,
};
use embassy_rp::{Peri, bind_interrupts, install_core0_stack_guard, pac, peripherals, watchdog};
use heapless::Vec;
use static_cell::ConstStaticCell;

use super::limits::WATCHDOG_TIMEOUT_US;
use super::{executors, resources};
use crate::chips::{ResetCause, rp2350};
use crate::flash_lender::{FlashLender, LentFlash};

bind_interrupts!(struct Irqs {
    UART0_IRQ => BufferedInterruptHandler<peripherals::UART0>;
    UART1_IRQ => BufferedInterruptHandler<peripherals::UART1>;
});

/// Baud rate of the autopilot's UART.
const AUTOPILOT_BAUD: u32 = 921_600;
/// Baud rate of the radio's UART.
const RADIO_BAUD: u32 = 460_800;
/// Bytes of a UART's ring buffer: 22 ms at the autopilot's baud rate.
const UART_RING_LEN: usize = 2048;
/// Ring buffers of a UART: of bytes to send, of received bytes.
type Rings = [[u8; UART_RING_LEN]; 2];
static AUTOPILOT_RINGS: ConstStaticCell<Rings> = ConstStaticCell::new([[0; UART_RING_LEN]; 2]);
static RADIO_RINGS: ConstStaticCell<Rings> = ConstStaticCell::new([[0; UART_RING_LEN]; 2]);

/// Bytes of the whole flash.
const FLASH_LEN: usize = 4 << 20;
/// Offset of the file store from the start of the flash; the program lies below it.
const STORE_OFFSET: u32 = 1 << 20;
/// Address of the file store in the memory map.
const STORE_ADDRESS: usize = 0x1010_0000;
/// Layout of the file store.
pub const LAYOUT: FlashLayout = FlashLayout::PICO2;

/// Receives by interrupt into a ring buffer.
pub type Receiver = BufferedUartRx;
/// Transmits by interrupt from a ring buffer.
pub type Transmitter = BufferedUartTx;

/// Interrupt priority of the executor of links and setpoints: below all devices.
pub const LINKS_PRIORITY: u8 = LINKS_INTERRUPT_PRIORITY as u8;
const LINKS_INTERRUPT_PRIORITY: Priority = Priority::P1;

/// Interrupt handler that runs the executor of links and setpoints; no device uses this interrupt.
#[interrupt]
unsafe fn SWI_IRQ_0() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_links_executor() }
}

/// Interrupt handler that runs the executor of plans and flash; no device uses this interrupt.
#[interrupt]
unsafe fn SWI_IRQ_1() {
    // SAFETY: this is the interrupt's handler.
    unsafe { executors::poll_plans_executor() }
}

/// Why the chip was reset.
pub fn reset_cause() -> ResetCause {
    let chip = pac::POWMAN.chip_reset().read().0;
    rp2350::reset_cause(chip, pac::WATCHDOG.reason().read().0)
}

/// Does nothing: this board's `memory.x` places no static outside `.bss` but the crash record.
///
/// # Safety
/// None; `unsafe` as the function of this name on boards where it zeroes statics.
pub unsafe fn zero_sections() {}

/// Restarts the board at once, by triggering the watchdog.
pub fn reset() -> ! {
    set_watchdog_resets();
    pac::WATCHDOG.ctrl().modify(|w| w.set_trigger(true));
    loop {
        cortex_m::asm::nop();
    }
}

/// Sets the parts that the watchdog resets. To be called after embassy-rp's `Watchdog::start`,
/// which sets those of the RP2040.
fn set_watchdog_resets() {
    pac::PSM.wdsel().write_value(pac::psm::regs::Wdsel(rp2350::WATCHDOG_RESETS));
}

/// Sets MSPLIM to the end of the stack, so that an overflow faults; only the hard fault handler may
/// use the stack below it.
fn guard_stack() {
    install_core0_stack_guard().expect("MSPLIM is always there");
    // SAFETY: this bit of the processor affects hard fault handlers alone.
    unsafe { (*cortex_m::peripheral::SCB::PTR).ccr.modify(|ccr| ccr | rp2350::STKOFHFNMIGN) };
}

/// What [`start`] returns on this board.
pub type Parts = resources::BoardResources<Receiver, Transmitter, Flash, Watchdog>;

/// Starts watchdog, executors, UARTs and flash. To be called once, after [`reset_cause`].
pub fn start() -> Parts {
    guard_stack();
    let p = embassy_rp::init(embassy_rp::config::Config::default());
    let mut watchdog = Watchdog::new(p.WATCHDOG, Output::new(p.PIN_25, Level::Low));
    watchdog.start();
    interrupt::SWI_IRQ_0.set_priority(LINKS_INTERRUPT_PRIORITY);
    interrupt::SWI_IRQ_1.set_priority(Priority::P2);
    let serial = |baudrate| {
        let mut config = uart::Config::default();
        config.baudrate = baudrate;
        config
    };
    let [sends, receives] = AUTOPILOT_RINGS.take();
    let autopilot =
        BufferedUart::new(p.UART0, p.PIN_0, p.PIN_1, Irqs, sends, receives, serial(AUTOPILOT_BAUD));
    let [sends, receives] = RADIO_RINGS.take();
    let swarm =
        BufferedUart::new(p.UART1, p.PIN_4, p.PIN_5, Irqs, sends, receives, serial(RADIO_BAUD));
    // A receive interrupt comes when 8 bytes of the FIFO's 32 are filled, so that further bytes
    // have room.
    for uart in [pac::UART0, pac::UART1] {
        uart.uartifls().modify(|w| w.set_rxiflsel(rp2350::RX_QUARTER));
    }
    // Pull-ups on the RX pins: a UART without a cable reads idle, not noise.
    for receives in [1, 5] {
        pac::PADS_BANK0.gpio(receives).modify(|w| w.set_pue(true));
    }
    let (sends, receives) = autopilot.split();
    let autopilot = (receives, sends);
    let (sends, receives) = swarm.split();
    Parts {
        links: executors::start_links_executor(interrupt::SWI_IRQ_0),
        plans: executors::start_plans_executor(interrupt::SWI_IRQ_1),
        autopilot,
        swarm: (receives, sends),
        flash: Flash { device: Device::new_blocking(p.FLASH), lender: FlashLender::new() },
        watchdog,
        warnings: Vec::new(),
    }
}

/// Driver of the file store, the flash after the program.
pub struct Flash {
    device: Device<'static, peripherals::FLASH, Blocking, FLASH_LEN>,
    lender: FlashLender,
}

impl Flash {
    /// Lends `len` bytes at offset `at` of the file store, in place; they are not erased or
    /// programmed until given back. `None` where they reach beyond the store, or other bytes are
    /// lent.
    pub fn lend(&mut self, at: u32, len: usize) -> Option<LentFlash> {
        (at as usize).checked_add(len).filter(|end| *end <= LAYOUT.len() as usize)?;
        let from = (STORE_ADDRESS + at as usize) as *const u8;
        // SAFETY: inside the flash, and this driver does not erase or program bytes that are lent.
        self.lender.lend(at, unsafe { core::slice::from_raw_parts(from, len) })
    }

    /// Ends the loan: the bytes may be erased and programmed again.
    pub fn take_back(&mut self, lent: LentFlash) {
        self.lender.take_back(lent);
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), FlashFault> {
        self.device.blocking_read(STORE_OFFSET + at, out).map_err(|_| FlashFault)
    }
}

impl crate::flash::Flash for Flash {
    async fn erase(&mut self, at: u32) -> Result<(), FlashFault> {
        if !self.lender.allows(at, LAYOUT.sector_len) {
            return Err(FlashFault);
        }
        self.device
            .blocking_erase(STORE_OFFSET + at, STORE_OFFSET + at + LAYOUT.sector_len)
            .map_err(|_| FlashFault)
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        if !self.lender.allows(at, bytes.len() as u32) {
            return Err(FlashFault);
        }
        self.device.blocking_write(STORE_OFFSET + at, bytes).map_err(|_| FlashFault)
    }
}

/// The watchdog, and the LED that toggles each time it is fed.
pub struct Watchdog {
    device: watchdog::Watchdog,
    /// Toggles each time the watchdog is fed.
    led: Output<'static>,
}

impl Watchdog {
    fn new(device: Peri<'static, peripherals::WATCHDOG>, led: Output<'static>) -> Self {
        Self { device: watchdog::Watchdog::new(device), led }
    }

    /// Starts the watchdog. It stops counting while a debugger has a processor halted.
    fn start(&mut self) {
        self.device.pause_on_debug(true);
        self.device.start(embassy_time::Duration::from_micros(WATCHDOG_TIMEOUT_US.into()));
        set_watchdog_resets();
    }

    /// Feeds the watchdog and toggles the LED.
    pub fn feed(&mut self) {
        self.device.feed(embassy_time::Duration::from_micros(WATCHDOG_TIMEOUT_US.into()));
        self.led.toggle();
    }
}
