//! Sets of links over which messages may arrive.

use crate::model::MOST;

/// For each vehicle a bit mask of the ranks from which messages may reach it.
pub type Links = [u8; MOST];

/// All vehicles hear each other.
pub fn whole(count: usize) -> Links {
    std::array::from_fn(|rank| if rank < count { ((1 << count) - 1) & !(1 << rank) } else { 0 })
}

/// Every set of one-way links.
pub fn one_way(count: usize) -> Vec<Links> {
    let all: Vec<(usize, usize)> =
        (0..count).flat_map(|a| (0..count).map(move |b| (a, b))).filter(|(a, b)| a != b).collect();
    let links = |set: usize| {
        let mut links = [0; MOST];
        let chosen = all.iter().enumerate().filter(|(k, _)| set >> k & 1 != 0);
        chosen.for_each(|(_, &(a, b))| links[a] |= 1 << b);
        links
    };
    (0..1 << all.len()).map(links).collect()
}

/// Every partition: within a part all vehicles hear each other, between parts none does.
pub fn partitions(count: usize) -> Vec<Links> {
    let closed = |links: &Links| {
        let part = |rank: usize| links[rank] | 1 << rank;
        (0..count).all(|a| (0..count).all(|b| part(a) >> b & 1 == 0 || part(a) == part(b)))
    };
    one_way(count).into_iter().filter(closed).collect()
}
