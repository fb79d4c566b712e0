extern crate std;
use super::*;
use proptest::prelude::*;
use std::vec::Vec;

proptest! {
    #[test]
    fn pieces_in_any_order_with_repetitions_make_the_file(
        len in 1usize..20_000,
        piece in 1usize..239,
        order in proptest::collection::vec(any::<u16>(), 64),
    ) {
        let file: Vec<u8> = (0..len).map(|i| (i * 7 + i / 251) as u8).collect();
        let mut window = UploadReassembly::default();
        let mut flash = Vec::new();
        let mut missing: Vec<usize> = (0..len.div_ceil(piece)).collect();
        let mut turn = 0;
        while !missing.is_empty() {
            // One of the next few pieces, as a client with several requests under way sends
            // them.
            let pick = usize::from(order[turn % order.len()]) % missing.len().min(5);
            let start = missing[pick] * piece;
            let bytes = &file[start..(start + piece).min(len)];
            if window.insert(start as u32, bytes, 20_000) == PieceOutcome::Stored
                && turn % 7 != 0
            {
                missing.remove(pick);
            }
            turn += 1;
            while let Some(block) = window.next_block() {
                flash.extend_from_slice(block);
                window.drop_first_block();
            }
        }
        flash.extend_from_slice(window.last_part().expect("nothing is missing"));
        prop_assert_eq!(flash, file);
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut window = UploadReassembly::default();
    assert_eq!(window.insert(4000, &[0; 100], 9000), PieceOutcome::RetryLater);
    assert_eq!(window.insert(8990, &[0; 11], 9000), PieceOutcome::TooLarge);
    assert_eq!(window.insert(u32::MAX, &[0; 2], 9000), PieceOutcome::TooLarge);
    assert_eq!(window.insert(300, &[1; 10], 9000), PieceOutcome::Stored);
    assert!(window.next_block().is_none() && window.last_part().is_none(), "a hole is seen");
}
