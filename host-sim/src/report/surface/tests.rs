use planner_core::map::voxel::{GridShape, Outside};

use super::*;

fn surface(dims: [u32; 3], filled: impl Fn([u32; 3]) -> bool) -> MapSurface {
    let shape = GridShape { dims, min: Point::new(1.0, 2.0, 3.0), resolution_m: 0.5 };
    let mut words = vec![0; shape.word_count()];
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in (0..dims[0]).filter(|&i| filled([i, j, k])) {
                let (word, mask) = shape.word_and_mask([i, j, k]);
                words[word] |= mask;
            }
        }
    }
    MapSurface::of(&VoxelGrid::new(shape, Outside::Blocked, &words).expect("a valid grid"))
}

/// Exposed area of the surface, in faces of cells.
fn area(surface: &MapSurface) -> usize {
    surface.faces.chunks(6).map(|f| usize::from(f[4]) * usize::from(f[5])).sum()
}

#[test]
fn a_block_has_six_faces_and_twelve_creases() {
    let block = surface([5, 6, 7], |[i, j, k]| {
        (1..4).contains(&i) && (1..5).contains(&j) && (1..6).contains(&k)
    });
    assert_eq!(block.faces.len() / 6, 6);
    assert_eq!(block.creases.len() / 5, 12);
    assert_eq!(area(&block), 2 * (3 * 4 + 4 * 5 + 5 * 3));
    let mut lowest: Vec<_> = block.faces.chunks(6).map(|f| (f[0], f[1])).collect();
    lowest.sort_unstable();
    assert_eq!(lowest, [(0, 1), (1, 4), (2, 1), (3, 5), (4, 1), (5, 6)]);
}

#[test]
fn a_full_map_is_its_hull_and_an_empty_one_nothing() {
    assert_eq!(surface([4, 4, 4], |_| true).faces.len() / 6, 6);
    assert_eq!(
        surface([4, 4, 4], |_| false),
        MapSurface { faces: vec![], creases: vec![], ..surface([4, 4, 4], |_| true) }
    );
}

#[test]
fn merged_area_is_the_exposed_area_of_noise() {
    let hash = |[i, j, k]: [u32; 3]| {
        (i.wrapping_mul(0x9e37) ^ j.wrapping_mul(0x85eb) ^ k.wrapping_mul(0xc2b3)) % 7 < 3
    };
    let dims = [9, 10, 11];
    let filled = |p: [i64; 3]| {
        (0..3).all(|a| p[a] >= 0 && p[a] < i64::from(dims[a])) && hash(p.map(|c| c as u32))
    };
    let mut exposed = 0;
    for (i, j, k) in
        (-1..12).flat_map(|i| (-1..12).flat_map(move |j| (-1..12).map(move |k| (i, j, k))))
    {
        let here = filled([i, j, k]);
        exposed += [[i + 1, j, k], [i, j + 1, k], [i, j, k + 1]]
            .iter()
            .filter(|&&n| filled(n) != here)
            .count();
    }
    let noise = surface(dims, hash);
    assert_eq!(area(&noise), exposed);
    assert!(noise.faces.len() / 6 < exposed);
}

#[test]
fn a_map_with_too_many_faces_is_drawn_coarser() {
    let checkered = surface([80, 80, 80], |[i, j, k]| (i + j + k).is_multiple_of(2));
    assert_eq!(checkered.drawn_cell_m, 1.0);
    assert_eq!(checkered.faces.len() / 6, 6);
}
