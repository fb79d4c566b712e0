use super::*;

#[test]
fn the_crc_is_that_of_the_clients_that_others_wrote() {
    // PX4's `crc32part` and MAVSDK's `Crc32` of the same digits.
    assert_eq!(ftp_crc32(b"123456789"), 0x2DFD_2D88);
}
