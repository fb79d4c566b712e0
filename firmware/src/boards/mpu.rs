//! The memory protection unit: the guard below the stack, and what a board does not cache.
#![expect(unsafe_code, reason = "registers")]

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::MPU;

use super::limits::GUARD_LEN;
use super::stack;
use crate::chips::mpu::{Access, Region};

/// MPU_CTRL: what no region has is as without the unit (PRIVDEFENA); on; off in the handlers of
/// hard faults, which may have to use the guard's memory as a stack (HFNMIENA is not set).
const ON: u32 = 1 << 2 | 1;

/// The guard below the stack: a processor whose stack reaches it takes a fault.
pub(super) fn stack_guard_region() -> Region {
    Region::new(stack::guard().start, GUARD_LEN, Access::None)
}

/// Sets regions, each of which counts more than those before it, and switches the unit on. To be
/// called once, at the start.
pub(super) fn enable_regions(regions: &[Option<Region>]) {
    // SAFETY: nobody else uses the unit but `set`, later. What runs uses none of what the regions
    // take away.
    unsafe {
        for (number, region) in regions.iter().enumerate() {
            set(number as u32, region.as_ref());
        }
        (*MPU::PTR).ctrl.write(ON);
    }
    dsb();
    isb();
}

/// Sets one region, or takes it away.
///
/// # Safety
/// What runs uses none of what it takes away.
pub(super) unsafe fn set(number: u32, region: Option<&Region>) {
    // SAFETY: registers of the unit, which tasks do not use; what it means the caller knows.
    unsafe {
        let mpu = &*MPU::PTR;
        mpu.rnr.write(number);
        mpu.rasr.write(0);
        if let Some(region) = region {
            mpu.rbar.write(region.rbar(number));
            mpu.rasr.write(region.rasr());
        }
    }
    dsb();
    isb();
}
