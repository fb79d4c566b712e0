use serialport::TTYPort;

use super::super::tests::hear;
use super::*;

/// One end of a pair of pseudo terminals, and a link opened at the other.
fn pair() -> (OpenSerialPort, OpenSerialPort) {
    let (mut near, far) = TTYPort::pair().unwrap();
    let path = far.name().unwrap();
    // Closed, since a port that is open cannot be opened again.
    drop(far);
    let far = OpenSerialPort::open(&path, 921_600).unwrap();
    near.set_timeout(Duration::ZERO).unwrap();
    (OpenSerialPort { device: Box::new(near), queue: Vec::new() }, far)
}

#[test]
fn bytes_pass_a_pair_of_terminals_both_ways_unchanged() {
    let (mut near, mut far) = pair();
    assert_eq!(far.receive(&mut [0; 16]).unwrap(), 0, "nothing sent yet");
    // Every byte: a terminal not set raw would change some and act on others.
    let all: Vec<u8> = (0..=255).collect();
    near.send(&all).unwrap();
    assert_eq!(hear(&mut far), all);
    far.send(&all).unwrap();
    assert_eq!(hear(&mut near), all);
}

#[test]
fn a_device_that_goes_away_ends_the_link() {
    let (near, mut far) = pair();
    drop(near);
    assert!(far.receive(&mut [0; 16]).is_err());
}

#[test]
fn a_device_that_is_not_there_is_named() {
    let error = "serial:/dev/no-such-device:57600".parse::<super::super::LinkUrl>().unwrap().open();
    assert!(error.err().unwrap().to_string().contains("serial:/dev/no-such-device:57600"));
}
