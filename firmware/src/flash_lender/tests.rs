use super::*;

#[test]
fn what_is_lent_is_not_changed_until_it_is_given_back() {
    static BYTES: [u8; 100] = [0; 100];
    let mut lender = FlashLender::new();
    assert!(lender.allows(0, u32::MAX));
    let lent = lender.lend(1000, &BYTES).expect("nothing else is lent");
    assert_eq!(lent.len(), 100);
    for (at, len, allowed) in [
        (0, 1000, true),
        (0, 1001, false),
        (1050, 1, false),
        (1099, 1, false),
        (1100, 50, true),
        (0, u32::MAX, false),
    ] {
        assert_eq!(lender.allows(at, len), allowed, "{at} {len}");
    }
    assert!(lender.lend(0, &BYTES).is_none(), "one at a time");
    lender.take_back(lent);
    assert!(lender.allows(0, u32::MAX) && lender.lend(0, &BYTES).is_some());
}
