//! Forged frames for a companion in flight, chosen by the fuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| flockmate_tests::hostile::attack_with_bytes(data));
