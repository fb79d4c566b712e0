//! Values from the manuals, written down by hand.

use super::h743::ClockSource;
use super::mpu::{Region, RegionAccess};
use super::{ResetCause, fault, h743, rp2350};

#[test]
fn regions_are_as_the_manual_has_them() {
    let guard = Region::new(0x2000_9000, 4096, RegionAccess::None);
    assert_eq!((guard.rbar(7), guard.rasr()), (0x2000_9017, 0x1000_0017));
    // XN, AP 011, TEX 001, S; 2^15 and 2^20 bytes.
    assert_eq!((h743::DMA.rbar(1), h743::DMA.rasr()), (0x3004_0011, 0x130C_001D));
    assert_eq!((h743::BANK2.rbar(2), h743::BANK2.rasr()), (0x0810_0012, 0x130C_0027));
    assert_eq!((h743::EXTERNAL.rbar(0), h743::EXTERNAL.rasr()), (0x10, 0x1000_873F));
    assert_eq!((h743::NULL.rbar(4), h743::NULL.rasr()), (0x14, 0x1000_000F));
}

#[test]
fn only_the_sectors_of_the_roadmap_are_cached_and_read_only() {
    let slot = companion::storage::store::FlashLayout::H743.slot_len;
    for (at, without) in [(0, 0b1111_1000), (slot, 0b1100_0111)] {
        let region = h743::roadmap_region(at, slot);
        // XN, AP 110, C.
        assert_eq!(region.rasr(), 0x1602_0027 | without << 8);
        assert_eq!(region.base, h743::BANK2.base);
        // A file does not begin with the slot, and may be short.
        assert_eq!(
            h743::roadmap_region(at + 256, 1000).rasr(),
            0x1602_0027 | (0xFF & !(1 << (at >> 17))) << 8
        );
    }
}

#[test]
fn every_revision_of_the_h743_has_a_clock_it_can_run_at() {
    for (idc, mhz) in
        [(0x1001_6450, 400), (0x1003_6450, 400), (0x2001_6450, 480), (0x2003_6450, 480)]
    {
        let revision = h743::Revision::from_idcode(idc);
        assert_eq!(revision.core_mhz(), mhz);
        for (source, source_mhz) in [(ClockSource::External, 8), (ClockSource::Internal, 64)] {
            let (divider, factor) = revision.pll_divider_and_factor(source);
            let input = source_mhz / divider;
            assert_eq!((input * factor, source_mhz % divider), (2 * mhz, 0));
            assert!((8..=16).contains(&input) && (192..=960).contains(&(input * factor)));
        }
    }
}

#[test]
fn the_h743_distinguishes_its_resets() {
    // RM0433, table of the reset sources: each row's flags.
    let (cpu, d1, d2) = (1 << 17, 1 << 19, 1 << 20);
    let (bor, pin, por, software) = (1 << 21, 1 << 22, 1 << 23, 1 << 24);
    let (iwdg, wwdg) = (1 << 26, 1 << 28);
    let rows = [
        (por | bor | pin | d1 | d2 | cpu, ResetCause::Power),
        (bor | pin | cpu, ResetCause::BrownOut),
        (pin | cpu, ResetCause::Key),
        (software | pin | cpu, ResetCause::Request),
        (iwdg | pin | cpu, ResetCause::Watchdog),
        (wwdg | pin | cpu, ResetCause::Watchdog),
        (d1, ResetCause::Unknown),
    ];
    for (rsr, cause) in rows {
        assert_eq!(h743::reset_cause(rsr), cause, "{rsr:#x}");
    }
}

#[test]
fn the_level_of_the_brown_out_reset_is_read() {
    for (optsr, level) in
        [(0x1BC6_AAF0, 0), (0x1BC6_AAF4, 1), (0x1BC6_AAF8, 2), (0x1BC6_AAFC, 3), (0xC, 3)]
    {
        assert_eq!(h743::brown_out_level(optsr), level);
    }
}

#[test]
fn the_rp2350_distinguishes_its_resets_and_resets_its_processors() {
    assert_eq!(rp2350::reset_cause(1 << 16, 0), ResetCause::Power);
    assert_eq!(rp2350::reset_cause(1 << 17, 0), ResetCause::BrownOut);
    assert_eq!(rp2350::reset_cause(1 << 18, 0), ResetCause::Key);
    assert_eq!(rp2350::reset_cause(1 << 19, 0), ResetCause::Request);
    // The watchdog's comes after the power's.
    assert_eq!(rp2350::reset_cause(1 << 16, 1), ResetCause::Watchdog);
    assert_eq!(rp2350::reset_cause(1 << 28, 2), ResetCause::Request);
    let has = |bit: u32| rp2350::WATCHDOG_RESETS >> bit & 1 == 1;
    let (oscillators, last) = ([2, 3], 24);
    assert!((0..=last).all(|bit| has(bit) != oscillators.contains(&bit)) && !has(last + 1));
}

#[test]
fn an_overflow_of_the_stack_is_distinguished_from_other_faults() {
    let guard = 0x2000_9000..0x2000_A000;
    let (daccviol, mstkerr, valid, stkof) = (1 << 1, 1 << 4, 1 << 7, 1 << 20);
    assert!(fault::is_stack_overflow(mstkerr, 0, &guard));
    assert!(fault::is_stack_overflow(stkof, 0, &guard));
    assert!(fault::is_stack_overflow(daccviol | valid, 0x2000_9FFC, &guard));
    for (cfsr, mmfar) in
        [(daccviol | valid, 0), (daccviol, 0x2000_9FFC), (1 << 15 | 1 << 9, 0x2000_9FFC), (1, 0)]
    {
        assert!(!fault::is_stack_overflow(cfsr, mmfar, &guard), "{cfsr:#x} {mmfar:#x}");
    }
}
