use super::*;

const CONFIG: RadioConfig = RadioConfig { range_m: 10.0, loss_probability: 0.0, delay_s: 0.05 };

#[test]
fn reaches_those_in_range_after_the_delay_and_not_the_sender() {
    let places = [Point::zeros(), Point::new(9.0, 0.0, 0.0), Point::new(11.0, 0.0, 0.0)];
    let mut radio = Radio::new(CONFIG, 3, 1);
    radio.broadcast(0, Some(0), &places, b"hello");
    assert!(radio.receive(49_999, 1).is_none());
    assert_eq!(radio.receive(50_000, 1).as_deref(), Some(&b"hello"[..]));
    assert!(radio.receive(50_000, 0).is_none() && radio.receive(50_000, 2).is_none());
}

#[test]
fn a_cut_station_does_not_send_or_does_not_hear() {
    let places = [Point::zeros(); 3];
    let mut radio = Radio::new(CONFIG, 3, 1);
    radio.set_outage(0, RadioOutage { tx_failed: true, rx_failed: false });
    radio.set_outage(2, RadioOutage { tx_failed: false, rx_failed: true });
    radio.broadcast(0, Some(0), &places, b"unheard");
    assert!(radio.receive(50_000, 1).is_none());
    radio.broadcast(0, Some(1), &places, b"heard");
    assert!(radio.receive(50_000, 0).is_some() && radio.receive(50_000, 2).is_none());
}

#[test]
fn loses_the_share_it_says() {
    let places = [Point::zeros(); 2];
    let mut radio = Radio::new(RadioConfig { loss_probability: 0.3, ..CONFIG }, 2, 1);
    let heard = (0..10_000)
        .filter(|&i| {
            radio.broadcast(i, Some(0), &places, &[0]);
            radio.receive(i + 50_000, 1).is_some()
        })
        .count();
    assert!((6_700..7_300).contains(&heard), "{heard}");
}
