//! Sorting in place, in little code: the standard library's sort takes some 9 kB of a board's flash
//! for each type and order.
//!
//! Heapsort (Williams 1964). Not stable: where two different elements may compare equal, the
//! caller's order has to break the tie, unless either order will do. At most 2 n log n comparisons,
//! and as many as 2 n more to build the heap.

use core::cmp::Ordering;

/// Sorts in place by `order`, the least element first.
// Not inlined: callers are large, and every caller would hold a copy.
#[inline(never)]
pub(crate) fn heapsort_by<T>(items: &mut [T], mut order: impl FnMut(&T, &T) -> Ordering) {
    let mut len = items.len();
    let mut root = len / 2;
    while len > 1 {
        if root > 0 {
            // The heap is built from its last parent to its root.
            root -= 1;
        } else {
            len -= 1;
            items.swap(0, len);
        }
        let mut at = root;
        loop {
            let left = 2 * at + 1;
            let Some(first) = items[..len].get(left) else { break };
            let right = items[..len].get(left + 1);
            let child = left + usize::from(right.is_some_and(|right| order(first, right).is_lt()));
            if order(&items[at], &items[child]).is_ge() {
                break;
            }
            items.swap(at, child);
            at = child;
        }
    }
}

#[cfg(test)]
mod tests;
