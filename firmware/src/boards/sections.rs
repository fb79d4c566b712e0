//! Zeroes the statics that `memory.x` places by name outside `.bss`: the start code of
//! `cortex-m-rt` zeroes `.bss` alone. The linker takes them from sections `.bss.NAME`, which hold
//! only statics whose initial value is all zeros; any other static would stay in `.data`.
#![expect(unsafe_code, reason = "memory that the start does not touch")]

use core::ptr::addr_of_mut;

unsafe extern "C" {
    // Start and end of each section, by the linker script.
    static mut __s_shell: u32;
    static mut __e_shell: u32;
    static mut __s_swarm_plan: u32;
    static mut __e_swarm_plan: u32;
    static mut __s_own_plan: u32;
    static mut __e_own_plan: u32;
    static mut __s_mission: u32;
    static mut __e_mission: u32;
    static mut __s_dma: u32;
    static mut __e_dma: u32;
}

/// Zeroes these statics.
///
/// # Safety
/// To be called once, before any of these statics is used, and after the memories' clocks are on.
pub unsafe fn zero_sections() {
    let sections = [
        (addr_of_mut!(__s_shell), addr_of_mut!(__e_shell)),
        (addr_of_mut!(__s_swarm_plan), addr_of_mut!(__e_swarm_plan)),
        (addr_of_mut!(__s_own_plan), addr_of_mut!(__e_own_plan)),
        (addr_of_mut!(__s_mission), addr_of_mut!(__e_mission)),
        (addr_of_mut!(__s_dma), addr_of_mut!(__e_dma)),
    ];
    for (mut word, end) in sections {
        while word < end {
            // SAFETY: between the linker's two symbols lie statics that no code uses yet; both
            // symbols are aligned to 8 bytes.
            unsafe {
                word.write_volatile(0);
                word = word.add(1);
            }
        }
    }
}
