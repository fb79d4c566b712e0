//! The square root of an `f32` by the FPU of a Cortex-M4F or M7.
//!
//! `core` has no square root. `libm` uses the CPU's instruction on x86, Arm64 and wasm, but takes
//! some fifty instructions on 32-bit Arm, where `vsqrt.f32` does the same. On other targets, and on
//! Armv8-M, this crate calls `libm`. Both round to the nearest `f32` (IEEE 754-2019, 5.4.1), so a
//! board and a desktop compute the same bits.
#![no_std]

/// Square root, rounded to the nearest `f32`; NaN for a negative number. The same bits on every
/// target, except for the sign of a NaN.
///
/// ```
/// assert_eq!(fpu::sqrtf(2.25), 1.5);
/// assert!(fpu::sqrtf(-1.0).is_nan());
/// ```
#[inline(always)]
pub fn sqrtf(square: f32) -> f32 {
    #[cfg(has_vfp2)]
    #[expect(unsafe_code)]
    {
        let root;
        // SAFETY: one instruction from one register to another; it accesses neither memory nor
        // stack.
        unsafe {
            core::arch::asm!(
                "vsqrt.f32 {root}, {square}",
                root = lateout(sreg) root,
                square = in(sreg) square,
                options(pure, nomem, nostack),
            );
        }
        root
    }
    #[cfg(not(has_vfp2))]
    libm::sqrtf(square)
}
