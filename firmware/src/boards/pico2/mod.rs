//! Raspberry Pi Pico 2: RP2350, Cortex-M33 at 150 MHz, 520 kB of RAM, 4 MB of flash outside.
//!
//! | pin | is |
//! |---|---|
//! | GP0 / GP1 | UART0 TX / RX, the autopilot's TELEM2, 921 600 baud |
//! | GP4 / GP5 | UART1 TX / RX, the swarm's radio, 460 800 baud |
//! | GP25 | the light |
//!
//! While the flash erases or programs nothing runs from it: no setpoint goes out, and bytes of a UART may be lost. Sectors are erased
//! only on the ground, disarmed; a page, as of an upload or a parameter in flight, is programmed within a millisecond or so.
#![expect(unsafe_code, reason = "executors in interrupts, roadmaps as they lie in flash")]

use companion::store::{Fault, Layout, ReadFlash};
use defmt_rtt as _;
use embassy_rp::flash::{Blocking, Flash as Device};
use embassy_rp::gpio::{Level, Output};
use embassy_rp::interrupt;
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::uart::{self, BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_rp::{Peri, bind_interrupts, peripherals, watchdog};
use static_cell::ConstStaticCell;

use super::parts::{self, Parts};

bind_interrupts!(struct Irqs {
    UART0_IRQ => BufferedInterruptHandler<peripherals::UART0>;
    UART1_IRQ => BufferedInterruptHandler<peripherals::UART1>;
});

const AUTOPILOT_BAUD: u32 = 921_600;
const RADIO_BAUD: u32 = 460_800;
/// 22 ms of the autopilot's bytes.
const RING: usize = 2048;
type Rings = [[u8; RING]; 2];
static AUTOPILOT_RINGS: ConstStaticCell<Rings> = ConstStaticCell::new([[0; RING]; 2]);
static RADIO_RINGS: ConstStaticCell<Rings> = ConstStaticCell::new([[0; RING]; 2]);

/// The whole flash.
const FLASH: usize = 4 << 20;
/// Where ours begins, from its start.
const STORE: u32 = 1 << 20;
/// The same as an address.
const STORE_ADDRESS: usize = 0x1010_0000;
/// After the program.
pub const LAYOUT: Layout = Layout::PICO2;

/// Receives by interrupt into a ring.
pub type Receiver = BufferedUartRx;
/// Transmits by interrupt from a ring.
pub type Transmitter = BufferedUartTx;

/// Priority of the executor of links and setpoints: below all devices.
pub const LINKS_PRIORITY: u8 = LINKS_AT as u8;
const LINKS_AT: Priority = Priority::P1;

/// Runs the executor of links and setpoints.
#[interrupt]
unsafe fn SWI_IRQ_0() {
    // SAFETY: this is the handler.
    unsafe { parts::on_links() }
}

/// Runs the executor of plans and flash.
#[interrupt]
unsafe fn SWI_IRQ_1() {
    // SAFETY: as above.
    unsafe { parts::on_plans() }
}

/// Starts the board. To be called once.
pub fn start() -> Parts {
    let p = embassy_rp::init(embassy_rp::config::Config::default());
    interrupt::SWI_IRQ_0.set_priority(LINKS_AT);
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
    let swarm = BufferedUart::new(p.UART1, p.PIN_4, p.PIN_5, Irqs, sends, receives, serial(RADIO_BAUD));
    let (sends, receives) = autopilot.split();
    let autopilot = (receives, sends);
    let (sends, receives) = swarm.split();
    Parts {
        links: parts::start_links(interrupt::SWI_IRQ_0),
        plans: parts::start_plans(interrupt::SWI_IRQ_1),
        autopilot,
        swarm: (receives, sends),
        flash: Flash(Device::new_blocking(p.FLASH)),
        watchdog: Watchdog::new(p.WATCHDOG, Output::new(p.PIN_25, Level::Low)),
    }
}

/// The part of the flash after the program.
pub struct Flash(Device<'static, peripherals::FLASH, Blocking, FLASH>);

impl Flash {
    /// A roadmap as it lies there; `None` where it would reach beyond.
    pub fn view(&self, at: u32, len: usize) -> Option<&'static [u8]> {
        let end = (at as usize).checked_add(len)?;
        // SAFETY: inside the flash. The store never erases or programs the slot that a start uses, until the next start.
        let view = || unsafe { core::slice::from_raw_parts((STORE_ADDRESS + at as usize) as *const u8, len) };
        (end <= LAYOUT.len() as usize).then(view)
    }
}

impl ReadFlash for Flash {
    fn read(&mut self, at: u32, out: &mut [u8]) -> Result<(), Fault> {
        self.0.blocking_read(STORE + at, out).map_err(|_| Fault)
    }
}

impl crate::shell::Flash for Flash {
    async fn erase(&mut self, at: u32) -> Result<(), Fault> {
        self.0.blocking_erase(STORE + at, STORE + at + LAYOUT.sector_len).map_err(|_| Fault)
    }

    async fn program(&mut self, at: u32, bytes: &[u8]) -> Result<(), Fault> {
        self.0.blocking_write(STORE + at, bytes).map_err(|_| Fault)
    }
}

/// The watchdog, and the light that shows that it is fed.
pub struct Watchdog {
    device: watchdog::Watchdog,
    light: Output<'static>,
}

impl Watchdog {
    fn new(device: Peri<'static, peripherals::WATCHDOG>, light: Output<'static>) -> Self {
        Self { device: watchdog::Watchdog::new(device), light }
    }

    /// Wakes it.
    pub fn wake(&mut self) {
        self.device.start(embassy_time::Duration::from_micros(super::BITES_AFTER_US.into()));
    }

    /// Puts the reset off.
    pub fn feed(&mut self) {
        self.device.feed(embassy_time::Duration::from_micros(super::BITES_AFTER_US.into()));
        self.light.toggle();
    }
}
