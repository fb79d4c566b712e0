use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn sorts_as_the_standard_library_does(
        numbers in proptest::collection::vec(0u8..40, 0..120),
    ) {
        let (mut sorted, mut expected) = (numbers.clone(), numbers);
        heapsort_by(&mut sorted, Ord::cmp);
        expected.sort_unstable();
        prop_assert_eq!(sorted, expected);
    }
}
