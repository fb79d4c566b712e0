use super::*;

const CONFIG: SimulatedSerialConfig = SimulatedSerialConfig {
    baud: 100_000,
    latency_s: 0.001,
    corruption_per_byte: 0.0,
    transmit_buffer_len: 100,
};

#[test]
fn bytes_arrive_after_their_bit_times_and_in_order() {
    let mut link = SerialLink::new(CONFIG, 1, 0);
    let mut got = Vec::new();
    link.write(0, &[1; 10]); // 10 bytes at 10 kB/s: 1 ms, then 1 ms latency
    link.write(0, &[2; 10]);
    link.read(1_999, &mut got);
    assert!(got.is_empty());
    link.read(2_000, &mut got);
    assert_eq!(got, [1; 10]);
    link.read(3_000, &mut got);
    assert_eq!(got, [2; 10]);
}

#[test]
fn a_full_buffer_loses_and_counts() {
    let mut link = SerialLink::new(CONFIG, 1, 0);
    link.write(0, &[0; 90]);
    link.write(0, &[0; 20]);
    assert_eq!(link.overrun_bytes, 20);
}

#[test]
fn corruption_changes_the_share_of_bytes_it_says() {
    let config =
        SimulatedSerialConfig { corruption_per_byte: 0.1, transmit_buffer_len: 1 << 20, ..CONFIG };
    let mut link = SerialLink::new(config, 1, 0);
    let mut got = Vec::new();
    link.write(0, &[0; 100_000]);
    link.read(u64::MAX, &mut got);
    let changed = got.iter().filter(|&&b| b != 0).count();
    assert!((9_000..11_000).contains(&changed), "{changed}");
}

#[test]
fn a_stall_holds_everything_back_and_loses_nothing() {
    let mut link = SerialLink::new(CONFIG, 1, 0);
    let mut got = Vec::new();
    link.write(0, &[7; 10]);
    link.stall(5_000);
    link.read(4_999, &mut got);
    assert!(got.is_empty());
    link.read(5_000, &mut got);
    assert_eq!(got, [7; 10]);
}
