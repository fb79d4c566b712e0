//! Before the peripherals: why the chip started, its clocks, what the memories may be used for. The
//! values are in [`chips::h743`](crate::chips::h743), which is tested on the desk.
#![expect(unsafe_code, reason = "registers and caches")]

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::Key;
use embassy_stm32::rcc::{self, HseMode, PllMul, PllPreDiv};
use embassy_stm32::time::Hertz;

use super::super::mpu;
use crate::chips::ResetCause;
use crate::chips::h743::{self, Revision};

/// Most polls of the oscillator's ready flag, a few clocks of 64 MHz each: more than 10 ms, of
/// which the oscillator takes 2 (DS12110).
const MAX_HSE_POLLS: u32 = 200_000;

/// Reason why the chip started, once: the flags are cleared. Switches the memories of domain D2 on
/// too, and mends reading from AXI SRAM where the silicon is old.
pub fn reset_cause() -> ResetCause {
    pac::RCC.ahb2enr().modify(|w| w.0 |= h743::D2_SRAM);
    // By the errata of all peripheral clocks: read the register, then the memory is there.
    pac::RCC.ahb2enr().read();
    cortex_m::asm::dsb();
    if Revision::from_idcode(pac::DBGMCU.idc().read().0) == Revision::Old {
        // SAFETY: a register of the bus matrix, as ST's own start code sets it.
        unsafe { (h743::AXI_TARG7_FN_MOD as *mut u32).write_volatile(h743::READ_ISS_OVERRIDE) };
    }
    let cause = h743::reset_cause(pac::RCC.rsr().read().0);
    pac::RCC.rsr().modify(|w| w.0 |= h743::RMVF);
    pac::RCC.rsr().modify(|w| w.0 &= !h743::RMVF);
    cause
}

/// Restarts.
pub fn reset() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// Starts the watchdog with its registers' first values, 512 ms: should a clock not come, it bites.
/// It stands still while a debugger has the processor halted.
pub(super) fn start_watchdog() {
    pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
    pac::IWDG1.kr().write(|w| w.set_key(Key::START));
}

/// Whether the board's oscillator runs: that of its ST-LINK, which may be without power.
pub(super) fn try_hse() -> bool {
    pac::RCC.cr().modify(|w| w.set_hsebyp(true));
    pac::RCC.cr().modify(|w| w.set_hseon(true));
    (0..MAX_HSE_POLLS).any(|_| pac::RCC.cr().read().hserdy())
}

/// Clocks as fast as the silicon may run, from the board's oscillator or the chip's own.
pub(super) fn clock_config(revision: Revision, has_hse: bool) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hsi = Some(rcc::HSIPrescaler::DIV1);
    let hse = rcc::Hse { freq: Hertz::mhz(h743::HSE_MHZ), mode: HseMode::Bypass };
    config.rcc.hse = has_hse.then_some(hse);
    let (divider, factor) = revision.pll_divider_and_factor(has_hse);
    config.rcc.pll1 = Some(rcc::Pll {
        source: if has_hse { rcc::PllSource::HSE } else { rcc::PllSource::HSI },
        prediv: PllPreDiv::from_bits(divider as u8),
        // The field holds one less.
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

/// Sets which memory may be cached and touched, then starts the caches.
pub(super) fn configure_mpu_and_caches() {
    // The place of the roadmap, `super::ROADMAP_REGION`, is free until there is one.
    let regions = [
        Some(h743::EXTERNAL),
        Some(h743::DMA),
        Some(h743::BANK2),
        None,
        Some(h743::NULL),
        Some(mpu::stack_guard_region()),
    ];
    mpu::enable_regions(&regions);
    // SAFETY: the caches are this function's alone, which is called once. Code is never written,
    // and what the DMA reaches is not cached.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
}
