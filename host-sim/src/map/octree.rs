//! An octree with OctoMap's structure: depth 16, every leaf free or occupied; space without a leaf
//! is unknown.
//!
//! OctoMap (Hornung et al. 2013) addresses its smallest cells by 16-bit keys; the cell with key
//! 32768 begins at coordinate 0. Only inner nodes are stored, in eight bytes each: two bits for
//! each child as in the `.bt` file, and the index at which the node's inner children begin. A
//! lookup reads at most 16 nodes; a traversal of all leaves reads each inner node once.

/// Number of levels below the root; the smallest cells are at this depth.
pub const TREE_DEPTH: u32 = 16;
/// Number of smallest cells along one edge of the octree.
pub const KEYS_PER_AXIS: u32 = 1 << TREE_DEPTH;
/// Key of the cell whose lower faces pass through coordinate 0.
pub const KEY_ORIGIN: u32 = KEYS_PER_AXIS / 2;

/// State of a cell or point of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occupancy {
    /// Never observed.
    Unknown,
    /// Observed to be empty.
    Free,
    /// Observed to be an obstacle.
    Occupied,
}

/// Code in a `.bt` file of a child that does not exist: unknown space.
pub(super) const UNKNOWN: u16 = 0;
/// Code of a child that is a free leaf.
pub(super) const FREE: u16 = 1;
/// Code of a child that is an occupied leaf.
pub(super) const OCCUPIED: u16 = 2;
/// Code of a child that is an inner node.
pub(super) const INNER: u16 = 3;

/// An inner node: two bits for each child, and the index of its first inner child; the others
/// follow it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InnerNode {
    /// Codes of the children: those of octant i in bits 2 i and 2 i + 1.
    pub(super) child_codes: u16,
    /// Index in the node list of the first child that is an inner node.
    pub(super) first_inner_child: u32,
}

impl InnerNode {
    /// Code of the child in octant `index`.
    pub(super) fn child_code(self, index: u32) -> u16 {
        self.child_codes >> (2 * index) & 3
    }

    /// Index in the node list of the inner child in octant `index`.
    pub(super) fn inner_index(self, index: u32) -> usize {
        let before = self.child_codes & ((1 << (2 * index)) - 1);
        let inner = before & before >> 1 & 0x5555;
        self.first_inner_child as usize + inner.count_ones() as usize
    }
}

/// A leaf: a cube of `edge_cells` smallest cells along each edge; its lowest cell has the key
/// `min_key`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Keys of the cube's lowest cell along x, y, z.
    pub min_key: [u32; 3],
    /// Edge of the cube in smallest cells, a power of two.
    pub edge_cells: u32,
    /// Whether the cube is an obstacle; otherwise it is free.
    pub occupied: bool,
}

/// Numbers of nodes and leaves of an octree, and their volumes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OctreeCounts {
    /// Number of all nodes, root and leaves included (OctoMap's `size()`).
    pub nodes: usize,
    /// Number of occupied leaves of any size.
    pub occupied_leaves: usize,
    /// Number of free leaves of any size.
    pub free_leaves: usize,
    /// Volume of the occupied leaves, cubic metres.
    pub occupied_m3: f64,
    /// Volume of the free leaves, cubic metres.
    pub free_m3: f64,
}

/// An occupancy octree whose inner nodes are stored in one list.
#[derive(Clone, Debug)]
pub struct Octree {
    /// Edge of the smallest cells, metres.
    resolution_m: f64,
    /// Inner nodes; the root is the last. An empty octree has none.
    pub(super) inner: Vec<InnerNode>,
}

impl Octree {
    /// The octree with these inner nodes, the root last.
    pub(super) fn from_parts(resolution_m: f64, inner: Vec<InnerNode>) -> Self {
        Self { resolution_m, inner }
    }

    /// Builds the pruned octree of a box of `dims` smallest cells whose lowest cell has the key
    /// `min`; `cell` returns the state of each cell by its index in the box, and is called once for
    /// each. `None` if the box reaches beyond the key space, or fills it with one known state.
    pub fn from_cells(
        resolution_m: f64,
        min: [u32; 3],
        dims: [u32; 3],
        mut cell: impl FnMut([u32; 3]) -> Occupancy,
    ) -> Option<Self> {
        let end = [0, 1, 2].map(|a| u64::from(min[a]) + u64::from(dims[a]));
        if end.iter().any(|&e| e > u64::from(KEYS_PER_AXIS)) {
            return None;
        }
        let mut builder =
            Builder { inner: Vec::new(), min, end: end.map(|e| e as u32), cell: &mut cell };
        match builder.build([0; 3], KEYS_PER_AXIS) {
            Child::Leaf(UNKNOWN) => {}
            // A root without children has no code in the file; only a box of all 65536³ cells in
            // one state gets here.
            Child::Leaf(_) => return None,
            Child::Inner(root) => builder.inner.push(root),
        }
        Some(Self { resolution_m, inner: builder.inner })
    }

    /// Edge of the smallest cell, metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// The root; `None` for an empty octree.
    pub(super) fn root(&self) -> Option<InnerNode> {
        self.inner.last().copied()
    }

    /// Calls `visit` for every leaf, in the order of the file.
    pub fn for_each_leaf(&self, mut visit: impl FnMut(Leaf)) {
        if let Some(root) = self.root() {
            self.walk(root, [0; 3], KEYS_PER_AXIS / 2, &mut visit);
        }
    }

    /// Calls `visit` for every leaf below `node`, whose lowest key is `min`; `size` is the edge of
    /// its octants, smallest cells.
    fn walk(&self, node: InnerNode, min: [u32; 3], size: u32, visit: &mut impl FnMut(Leaf)) {
        for index in 0..8 {
            let child_min = octant_corner(min, size, index);
            match node.child_code(index) {
                UNKNOWN => {}
                INNER => self.walk(self.inner[node.inner_index(index)], child_min, size / 2, visit),
                kind => {
                    visit(Leaf {
                        min_key: child_min,
                        edge_cells: size,
                        occupied: kind == OCCUPIED,
                    });
                }
            }
        }
    }

    /// State of the smallest cell with these keys; unknown beyond the key space.
    pub fn occupancy_at_key(&self, key: [u32; 3]) -> Occupancy {
        let Some(mut node) = self.root() else { return Occupancy::Unknown };
        if key.iter().any(|&k| k >= KEYS_PER_AXIS) {
            return Occupancy::Unknown;
        }
        for bit in (0..TREE_DEPTH).rev() {
            let index = (key[0] >> bit & 1) | (key[1] >> bit & 1) << 1 | (key[2] >> bit & 1) << 2;
            match node.child_code(index) {
                FREE => return Occupancy::Free,
                OCCUPIED => return Occupancy::Occupied,
                INNER => node = self.inner[node.inner_index(index)],
                _ => return Occupancy::Unknown,
            }
        }
        Occupancy::Unknown
    }

    /// State at a point, metres in the map's frame.
    pub fn occupancy_at(&self, point: [f64; 3]) -> Occupancy {
        let key = point.map(|c| (c / self.resolution_m).floor() + f64::from(KEY_ORIGIN));
        if key.iter().all(|k| (0.0..f64::from(KEYS_PER_AXIS)).contains(k)) {
            self.occupancy_at_key(key.map(|k| k as u32))
        } else {
            Occupancy::Unknown
        }
    }

    /// Counts nodes and leaves, and sums up volumes.
    pub fn counts(&self) -> OctreeCounts {
        let mut counts =
            OctreeCounts { nodes: usize::from(!self.inner.is_empty()), ..OctreeCounts::default() };
        for node in &self.inner {
            counts.nodes += (0..8).filter(|&i| node.child_code(i) != UNKNOWN).count();
        }
        self.for_each_leaf(|leaf| {
            let volume = (f64::from(leaf.edge_cells) * self.resolution_m).powi(3);
            if leaf.occupied {
                counts.occupied_leaves += 1;
                counts.occupied_m3 += volume;
            } else {
                counts.free_leaves += 1;
                counts.free_m3 += volume;
            }
        });
        counts
    }

    /// Lowest key and highest key (exclusive) of the known space along each axis; `None` for an
    /// empty octree.
    pub fn key_bounds(&self) -> Option<([u32; 3], [u32; 3])> {
        let (mut lo, mut hi) = ([KEYS_PER_AXIS; 3], [0; 3]);
        self.for_each_leaf(|leaf| {
            for axis in 0..3 {
                lo[axis] = lo[axis].min(leaf.min_key[axis]);
                hi[axis] = hi[axis].max(leaf.min_key[axis] + leaf.edge_cells);
            }
        });
        (hi[0] > 0).then_some((lo, hi))
    }

    /// Lowest and highest corner of the known space, metres; `None` for an empty octree.
    pub fn metric_bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        let metres =
            |key: [u32; 3]| key.map(|k| (f64::from(k) - f64::from(KEY_ORIGIN)) * self.resolution_m);
        self.key_bounds().map(|(lo, hi)| (metres(lo), metres(hi)))
    }
}

/// Lowest key of the octant `index` (x in bit 0, y in bit 1, z in bit 2) of a node at `min`; `size`
/// is the octant's edge.
fn octant_corner(min: [u32; 3], size: u32, index: u32) -> [u32; 3] {
    [0, 1, 2].map(|axis| min[axis] + (index >> axis & 1) * size)
}

/// An octant: a leaf or unknown space by its code, or an inner node.
enum Child {
    /// A leaf, or unknown space: its code.
    Leaf(u16),
    /// An inner node.
    Inner(InnerNode),
}

/// Builds an octree from the states of the cells in a box.
struct Builder<'a, F> {
    /// Inner nodes made so far.
    inner: Vec<InnerNode>,
    /// Lowest keys of the box.
    min: [u32; 3],
    /// Keys at which the box ends, exclusive.
    end: [u32; 3],
    /// Returns the state of a cell by its index in the box.
    cell: &'a mut F,
}

impl<F: FnMut([u32; 3]) -> Occupancy> Builder<'_, F> {
    /// Builds the octant with the lowest key `corner` and an edge of `size` smallest cells.
    fn build(&mut self, corner: [u32; 3], size: u32) -> Child {
        let misses = |a: usize| corner[a] >= self.end[a] || corner[a] + size <= self.min[a];
        if (0..3).any(misses) {
            return Child::Leaf(UNKNOWN);
        }
        if size == 1 {
            let index = [0, 1, 2].map(|a| corner[a] - self.min[a]);
            return Child::Leaf(match (self.cell)(index) {
                Occupancy::Unknown => UNKNOWN,
                Occupancy::Free => FREE,
                Occupancy::Occupied => OCCUPIED,
            });
        }
        let mut children = 0;
        let mut inner = heapless::Vec::<InnerNode, 8>::new();
        for index in 0..8 {
            let code = match self.build(octant_corner(corner, size / 2, index), size / 2) {
                Child::Leaf(kind) => kind,
                Child::Inner(node) => {
                    inner.push(node).expect("a node has eight children");
                    INNER
                }
            };
            children |= code << (2 * index);
        }
        // Eight equal leaves become one, as OctoMap prunes; eight unknown children become an
        // unknown leaf.
        match children {
            0x0000 => Child::Leaf(UNKNOWN),
            0x5555 => Child::Leaf(FREE),
            0xAAAA => Child::Leaf(OCCUPIED),
            _ => {
                let first = self.inner.len() as u32;
                self.inner.extend_from_slice(&inner);
                Child::Inner(InnerNode { child_codes: children, first_inner_child: first })
            }
        }
    }
}

#[cfg(test)]
mod tests;
