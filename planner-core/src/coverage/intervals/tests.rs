use super::*;

#[test]
fn adding_and_removing_agree_with_cells() {
    // A generator of our own is enough: what matters is that many small cases are seen.
    let mut state = 7u32;
    let mut next = |most: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) % most
    };
    for _ in 0..3000 {
        let mut set = Intervals::<16>::new();
        let mut cells = [false; 20];
        for _ in 0..6 {
            let (from, adds) = (next(19), next(3) > 0);
            let to = from + 1 + next(20 - from - 1);
            let span = [from as f32, to as f32];
            if adds { set.add(span) } else { set.remove(span) }.expect("room");
            cells[from as usize..to as usize].fill(adds);
            for (i, cell) in cells.iter().enumerate() {
                let place = i as f32 + 0.5;
                let held = set.spans().iter().any(|s| s[0] <= place && place <= s[1]);
                assert_eq!(held, *cell, "{i} of {:?}", set.spans());
            }
            assert!(set.spans().is_sorted_by(|a, b| a[1] <= b[0]));
        }
    }
}
