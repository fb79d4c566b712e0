//! Steps of the start before the peripherals: reset cause, watchdog, clocks, MPU and caches. The
//! register values are in [`chips::h743`](crate::chips::h743), which is tested on the host.
#![expect(unsafe_code, reason = "registers and caches")]

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::rcc::{self, HseMode, PllMul, PllPreDiv};
use embassy_stm32::time::Hertz;

use super::super::mpu;
use crate::chips::ResetCause;
use crate::chips::h743::{self, ClockSource, Revision};

/// Most polls of the external clock's ready flag, a few cycles of 64 MHz each: more than 10 ms in
/// all; the clock is ready within 2 ms (DS12110).
const MAX_HSE_POLLS: u32 = 200_000;

/// Reads why the chip was reset and clears the flags; to be called once. Also switches on the
/// clocks of domain D2's memories, and applies the AXI SRAM's workaround on old silicon.
pub fn reset_cause() -> ResetCause {
    pac::RCC.ahb2enr().modify(|w| w.0 |= h743::D2_SRAM_CLOCKS);
    // By the errata on peripheral clocks: after a read of the register the memory may be used.
    pac::RCC.ahb2enr().read();
    cortex_m::asm::dsb();
    if Revision::from_idcode(pac::DBGMCU.idc().read().0) == Revision::Old {
        // SAFETY: a register of the bus matrix, which ST's own start code sets in the same way.
        unsafe { (h743::AXI_TARG7_FN_MOD as *mut u32).write_volatile(h743::READ_ISS_OVERRIDE) };
    }
    let cause = h743::reset_cause(pac::RCC.rsr().read().0);
    pac::RCC.rsr().modify(|w| w.0 |= h743::RMVF);
    pac::RCC.rsr().modify(|w| w.0 &= !h743::RMVF);
    cause
}

/// Restarts the board.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Starts the watchdog with its registers' reset values, 512 ms: if a clock never becomes ready, it
/// resets the chip. It stops counting while a debugger has the processor halted.
pub(super) fn start_watchdog() {
    pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
    pac::IWDG1.kr().write(|w| w.set_key(Key::START));
}

/// Switches on the external clock (HSE), which the board's ST-LINK outputs. Returns it if it became
/// ready, else the internal oscillator: the ST-LINK has no power.
pub(super) fn start_clock_source() -> ClockSource {
    pac::RCC.cr().modify(|w| w.set_hsebyp(true));
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    let is_ready = (0..MAX_HSE_POLLS).any(|_| pac::RCC.cr().read().hserdy());
    if is_ready { ClockSource::External } else { ClockSource::Internal }
}

/// Clock settings: the fastest that the silicon allows, from this source.
pub(super) fn clock_config(revision: Revision, source: ClockSource) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hsi = Some(rcc::HSIPrescaler::DIV1);
    let hse = rcc::Hse { freq: Hertz::mhz(h743::HSE_MHZ), mode: HseMode::Bypass };
    config.rcc.hse = (source == ClockSource::External).then_some(hse);
    let (divider, factor) = revision.pll_divider_and_factor(source);
    config.rcc.pll1 = Some(rcc::Pll {
        source: match source {
            ClockSource::External => rcc::PllSource::HSE,
            ClockSource::Internal => rcc::PllSource::HSI,
        },
        prediv: PllPreDiv::from_bits(divider as u8),
        // The register field holds the factor minus one.
        mul: PllMul::from_bits(factor as u16 - 1),
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
    config.rcc.voltage_scale = match revision {
        Revision::Old => rcc::VoltageScale::Scale1,
        Revision::New => rcc::VoltageScale::Scale0,
    };
    config
}

/// Sets the MPU's regions, then enables both caches.
pub(super) fn configure_mpu_and_caches() {
    // MPU region `flash::ROADMAP_REGION` stays disabled until a roadmap is lent (`Flash::lend`).
    let regions = [
        Some(h743::EXTERNAL),
        Some(h743::DMA),
        Some(h743::BANK2),
        None,
        Some(h743::NULL),
        Some(mpu::stack_guard_region()),
    ];
    mpu::enable_regions(&regions);
    // SAFETY: only this function enables the caches, and it is called once. Code is never written,
    // and memory that DMA uses is not cached.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
}
