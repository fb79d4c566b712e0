//! An indexed 4-ary min-heap of node indices. Each node is in the heap at most once, so `N` entries
//! always suffice.

/// Value in [`Heap::places`] of a node that the search has not reached.
const NOT_REACHED: u16 = 0;
/// Value in [`Heap::places`] of a node that was popped: its distance is final.
pub(crate) const SETTLED: u16 = u16::MAX;

/// Children of each heap entry.
const HEAP_ARITY: usize = 4;

/// The heap, and the state of each node: not reached, in the heap, or settled.
pub(crate) struct Heap<const N: usize> {
    /// Number of nodes in the heap.
    len: usize,
    /// Cost in the upper bits (a non-negative f32, whose bits order like its value), node in the
    /// lower sixteen: one comparison orders by cost, then by node.
    entries: [u64; N],
    /// For each node its index in `entries` plus one, or [`NOT_REACHED`] or [`SETTLED`].
    places: [u16; N],
}

/// The heap entry of a node with this cost.
fn entry_of(node: u16, cost: f32) -> u64 {
    u64::from(cost.to_bits()) << 16 | u64::from(node)
}

/// The node of a heap entry.
fn node_of(entry: u64) -> usize {
    (entry & 0xffff) as usize
}

/// Index of the least entry. Four entries are compared pairwise by selects: branches would be
/// mispredicted.
#[inline(always)]
fn least_index(entries: &[u64]) -> usize {
    if let Ok([a, b, c, d]) = <&[u64; HEAP_ARITY]>::try_from(entries) {
        let (left, left_at) = if b < a { (b, 1) } else { (a, 0) };
        let (right, right_at) = if d < c { (d, 3) } else { (c, 2) };
        return if right < left { right_at } else { left_at };
    }
    let mut least = 0;
    for k in 1..entries.len() {
        least = if entries[k] < entries[least] { k } else { least };
    }
    least
}

impl<const N: usize> Heap<N> {
    pub(crate) const fn new() -> Self {
        Self { len: 0, entries: [0; N], places: [NOT_REACHED; N] }
    }

    /// Empties the heap, and marks the nodes with indices below `nodes` as not reached.
    pub(crate) fn clear(&mut self, nodes: usize) {
        self.len = 0;
        self.places[..nodes].fill(NOT_REACHED);
    }

    /// [`NOT_REACHED`], [`SETTLED`], or the node's index in `entries` plus one.
    #[inline]
    pub(crate) fn node_mark(&self, node: u16) -> u16 {
        self.places[usize::from(node)]
    }

    /// Inserts a node that is not settled, or lowers its cost if it is in the heap. `cost` must be
    /// finite and not negative.
    #[inline]
    pub(crate) fn push(&mut self, node: u16, cost: f32) {
        let mut at = match self.places[usize::from(node)] {
            NOT_REACHED => {
                self.len += 1;
                self.len - 1
            }
            place => usize::from(place) - 1,
        };
        let entry = entry_of(node, cost);
        while at > 0 {
            let above = (at - 1) / HEAP_ARITY;
            if self.entries[above] <= entry {
                break;
            }
            self.set_entry(at, self.entries[above]);
            at = above;
        }
        self.set_entry(at, entry);
    }

    /// Removes and returns the node of least cost, and marks it as settled.
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<u16> {
        let top = *self.entries[..self.len].first()?;
        self.places[node_of(top)] = SETTLED;
        self.len -= 1;
        let entry = self.entries[self.len];
        if self.len > 0 {
            self.sift_down(0, entry);
        }
        Some(node_of(top) as u16)
    }

    /// Gives every node in the heap the cost that `cost` returns, and restores the order.
    /// O(length).
    pub(crate) fn recompute_costs(&mut self, cost: impl Fn(u16) -> f32) {
        for at in (0..self.len).rev() {
            let node = node_of(self.entries[at]) as u16;
            self.sift_down(at, entry_of(node, cost(node)));
        }
    }

    /// Places `entry` at index `at` or below, so that no parent is greater than its child.
    fn sift_down(&mut self, mut at: usize, entry: u64) {
        loop {
            let first = at * HEAP_ARITY + 1;
            if first >= self.len {
                break;
            }
            let least =
                first + least_index(&self.entries[first..(first + HEAP_ARITY).min(self.len)]);
            if self.entries[least] >= entry {
                break;
            }
            self.set_entry(at, self.entries[least]);
            at = least;
        }
        self.set_entry(at, entry);
    }

    /// Writes `entry` at index `at`, and this index into the node's place.
    #[inline]
    fn set_entry(&mut self, at: usize, entry: u64) {
        self.entries[at] = entry;
        self.places[node_of(entry)] = at as u16 + 1;
    }
}
