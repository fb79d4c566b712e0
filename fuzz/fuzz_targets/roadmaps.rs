//! Roadmap files with the right CRC, changed as the fuzzer chooses.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| flockmate_tests::roadmaps::attack_with_bytes(data));
