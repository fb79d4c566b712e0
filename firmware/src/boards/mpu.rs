//! Sets up the memory protection unit: the guard below the stack, and memory that is not cached.
#![expect(unsafe_code, reason = "registers")]

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::MPU;

use super::limits::GUARD_LEN;
use super::stack;
use crate::chips::mpu::{Region, RegionAccess};

/// Value of MPU_CTRL: unit enabled; PRIVDEFENA: addresses outside all regions have the default
/// memory map; HFNMIENA clear: the unit is off in hard fault handlers, whose stack may reach into
/// the guard.
const MPU_CTRL_ENABLE: u32 = 1 << 2 | 1;

/// The guard below the stack: an access to it is a fault.
pub(super) fn stack_guard_region() -> Region {
    Region::new(stack::guard_range().start, GUARD_LEN, RegionAccess::None)
}

/// Sets regions 0, 1, …; where two overlap the higher number applies. Then enables the unit. To be
/// called once, at the start.
pub(super) fn enable_regions(regions: &[Option<Region>]) {
    // SAFETY: after this only `set_region` uses the unit. No code or data in use lies where a
    // region forbids access.
    unsafe {
        for (number, region) in regions.iter().enumerate() {
            set_region(number as u32, region.as_ref());
        }
        (*MPU::PTR).ctrl.write(MPU_CTRL_ENABLE);
    }
    dsb();
    isb();
}

/// Sets region `number`, or disables it for `None`.
///
/// # Safety
/// No code or data in use lies where the region forbids access.
pub(super) unsafe fn set_region(number: u32, region: Option<&Region>) {
    // SAFETY: registers of the unit, which no task uses; the caller guarantees the rest.
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
