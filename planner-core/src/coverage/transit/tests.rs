extern crate std;
use std::vec::Vec;

use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::*;
use crate::coverage::area::{Ring, edges_of};

/// Whether a line meets an edge of a zone: every edge is tested, without a test of sides first.
fn meets_an_edge(area: &Area<'_>, from: &Flat, to: &Flat) -> bool {
    let zones = area.rings_with_kind().filter(|(kind, _)| *kind == RingKind::NoFly);
    zones.flat_map(|(_, ring)| edges_of(ring)).any(|(a, b)| {
        let (along, edge) = (to - from, b - a);
        let (p, q) = (along.perp(&(a - from)), along.perp(&(b - from)));
        let (r, s) = (edge.perp(&(from - a)), edge.perp(&(to - a)));
        p * q <= 0.0 && r * s <= 0.0
    })
}

/// The length of the shortest path over corners, by Bellman and Ford over all corners.
fn shortest_m<const N: usize>(
    transit: &TransitGraph<'_, N>,
    area: &Area<'_>,
    from: &Flat,
    to: &Flat,
) -> f32 {
    let places: Vec<Flat> =
        [*from, *to].into_iter().chain(transit.corners().iter().copied()).collect();
    let mut far_m = std::vec![f32::INFINITY; places.len()];
    far_m[0] = 0.0;
    for _ in 0..places.len() {
        for i in 0..places.len() {
            for j in 0..places.len() {
                if !meets_an_edge(area, &places[i], &places[j]) {
                    far_m[j] = far_m[j].min(far_m[i] + (places[j] - places[i]).norm());
                }
            }
        }
    }
    far_m[1]
}

#[test]
fn ways_around_zones_are_the_shortest_there_are() {
    let mut random = Pcg32::seed_from_u64(3);
    let mut unit = || random.next_u32() as f32 / u32::MAX as f32;
    let (mut led_around, mut straight) = (0, 0);
    for case in 0..60 {
        let mut vertices: Vec<Flat> = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]]
            .map(|[x, y]| Flat::new(x, y))
            .into();
        let mut rings = std::vec![Ring { end: 4, kind: RingKind::Outer }];
        for zone in 0..1 + case % 4 {
            // One zone in each quarter, so that no two meet; slanted, and some with an inward
            // corner.
            let middle =
                Flat::new(25.0 + 50.0 * (zone % 2) as f32, 25.0 + 50.0 * (zone / 2) as f32);
            let count = 3 + (unit() * 4.0) as usize;
            for k in 0..count {
                let angle = core::f32::consts::TAU * (k as f32 + 0.6 * unit()) / count as f32;
                vertices.push(middle + Flat::new(angle.cos(), angle.sin()) * (6.0 + 16.0 * unit()));
            }
            rings.push(Ring { end: vertices.len() as u16, kind: RingKind::NoFly });
        }
        let area = Area::new(&vertices, &rings).expect("an area");
        let mut transit = TransitGraph::<32>::empty();
        transit.set_area(area).expect("the corners fit");
        for _ in 0..60 {
            let [from, to] = [(); 2].map(|()| Flat::new(100.0 * unit(), 100.0 * unit()));
            if area.is_in_no_fly_zone(&from) || area.is_in_no_fly_zone(&to) {
                continue;
            }
            let clear = transit.is_line_clear(&from, &to);
            assert_eq!(clear, !meets_an_edge(&area, &from, &to), "{case}: {from:?} {to:?}");
            let (found, least) =
                (transit.distance_m(&from, &to), shortest_m(&transit, &area, &from, &to));
            assert!(
                found == least || (found - least).abs() < 1e-2,
                "{case}: {found} instead of {least}"
            );
            let mut corners = Vec::new();
            corners.push(from);
            let mut way: heapless::Vec<Flat, 32> = heapless::Vec::new();
            transit.shortest_path(&from, &to, &mut way).expect("a way");
            corners.extend(way.iter().copied().chain([to]));
            let length: f32 = corners.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
            assert!((length - least).abs() < 1e-2, "{case}: {length} instead of {least}");
            (led_around, straight) = (led_around + u32::from(!clear), straight + u32::from(clear));
        }
    }
    assert!(led_around > 500 && straight > 500, "{led_around} {straight}");
}
