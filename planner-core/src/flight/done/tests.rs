extern crate std;

use proptest::prelude::*;
use std::collections::BTreeSet;
use std::vec::Vec;

use super::{WaypointRange, WaypointSet};

proptest! {
    #[test]
    fn holds_what_was_added_whatever_the_order(
        added in proptest::collection::vec((0u32..80, 0u32..9), 0..40),
        at in any::<proptest::sample::Index>(),
    ) {
        let range = |&(first, count): &(u32, u32)| WaypointRange { first, end: first + count };
        let (mut done, mut model) = (WaypointSet::<40>::new(), BTreeSet::new());
        for range in added.iter().map(range) {
            let grew = done.insert(range).unwrap();
            let before = model.len();
            model.extend(range.first..range.end);
            prop_assert_eq!(grew, model.len() > before);
        }
        let held: Vec<u32> = done.ranges().iter().flat_map(|r| r.first..r.end).collect();
        prop_assert_eq!(done.count() as usize, model.len());
        prop_assert_eq!(held, model.into_iter().collect::<Vec<_>>());
        prop_assert!(done.ranges().windows(2).all(|pair| pair[0].end < pair[1].first));
        let mut turned = WaypointSet::<40>::new();
        let cut = at.index(added.len() + 1);
        for range in added[cut..].iter().chain(&added[..cut]).rev().map(range) {
            turned.insert(range).unwrap();
        }
        prop_assert_eq!(turned, done);
    }

    #[test]
    fn what_does_not_fit_changes_nothing(firsts in proptest::collection::vec(0u32..60, 1..30)) {
        let mut done = WaypointSet::<4>::new();
        for first in firsts {
            let (range, before) = (WaypointRange { first, end: first + 1 }, done.clone());
            if done.insert(range).is_err() {
                prop_assert_eq!(&before, &done);
                prop_assert_eq!(done.ranges().len(), 4);
            }
        }
    }
}
