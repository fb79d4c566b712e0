use super::*;
use crate::map::building;
use crate::map::occupancy::OccupancyMap;
use crate::map::octree::Occupancy;
use proptest::prelude::*;

const HEADER: &str = "# Octomap OcTree binary file\nid OcTree\n";

fn file(header: &str, data: &[u8]) -> Vec<u8> {
    [header.as_bytes(), data].concat()
}

#[test]
fn the_building_written_and_read_is_the_same_grid() {
    let map = building::building_map(building::DEFAULT_SEED, 0.25).unwrap();
    let bytes = to_bytes(&map.to_octree("building").unwrap());
    let tree = parse(&bytes, Path::new("building.bt")).unwrap();
    assert_eq!(OccupancyMap::from_octree(&tree, 0.25, "building.bt").unwrap(), map);
    assert_eq!(to_bytes(&tree), bytes);
}

#[test]
fn an_empty_tree_is_read_and_written() {
    let bytes = file(HEADER, b"size 0\nres 0.1\ndata\n");
    let tree = parse(&bytes, Path::new("empty.bt")).unwrap();
    assert_eq!((tree.counts().nodes, tree.metric_bounds()), (0, None));
    assert_eq!(to_bytes(&tree), bytes);
}

#[test]
fn a_coloured_tree_is_read_as_one_without_colours() {
    let data = b"size 2\nres 0.1\ndata\n\x02\x00";
    let plain = file(HEADER, data);
    let coloured = file("# Octomap OcTree binary file\nid ColorOcTree\n", data);
    let tree = parse(&coloured, Path::new("coloured.bt")).unwrap();
    assert_eq!(to_bytes(&tree), plain);
}

/// A chain of `levels` inner nodes, each the first child of the one above, then the word
/// `last`.
fn chain(levels: usize, last: u16) -> Vec<u8> {
    let mut data = [3u8, 0].repeat(levels);
    data.extend(last.to_le_bytes());
    data
}

#[test]
fn the_deepest_leaf_is_read() {
    let bytes = file(HEADER, &[b"size 17\nres 0.1\ndata\n".as_slice(), &chain(15, 2)].concat());
    assert_eq!(
        parse(&bytes, Path::new("deep.bt")).unwrap().occupancy_at_key([0, 0, 0]),
        Occupancy::Occupied
    );
}

#[test]
fn malformed_files_are_named_with_offset_and_expectation() {
    let body = |data: &[u8]| file(HEADER, &[b"size 2\nres 0.1\ndata\n".as_slice(), data].concat());
    let cases: [(Vec<u8>, &str); 14] = [
        (
            b"".to_vec(),
            "byte 0: expected `# Octomap OcTree binary file`, found the end of the file",
        ),
        (
            b"PK\x03\x04\n".to_vec(),
            "byte 0: expected `# Octomap OcTree binary file`, found `PK\\u{3}\\u{4}`",
        ),
        (
            b"\xff\xfe\n".to_vec(),
            "byte 0: expected `# Octomap OcTree binary file`, found bytes that are no text",
        ),
        (vec![b'#'; 5000], "byte 0: expected `# Octomap OcTree binary file`, found no end of line"),
        (file(HEADER, b""), "byte 39: expected `size N`, found the end of the file"),
        (
            file("# Octomap OcTree binary file\nid ScalarField\n", b""),
            "byte 32: expected the id `OcTree` or `ColorOcTree`, found `ScalarField`",
        ),
        (file(HEADER, b"size -1\n"), "byte 44: expected a number of nodes, found `-1`"),
        (
            file(HEADER, b"size 1\nres nan\n"),
            "byte 50: expected a resolution from 0.000001 to 1000000 metres, found `nan`",
        ),
        (file(HEADER, b"size 1\ndata\n"), "byte 46: expected `res METRES`, found `data`"),
        (
            body(&[2]),
            "byte 59: expected the two bytes of an inner node at depth 0, found the end of the file (60 bytes)",
        ),
        (body(&[2, 0, 9]), "byte 61: expected the end of the file, found 1 more bytes"),
        (body(&[0, 0]), "byte 59: expected an inner node with children, found one without"),
        (body(&[0x0A, 0]), "byte 44: expected as many nodes as the data holds, 3, found 2"),
        (
            body(&chain(16, 2)),
            "byte 89: expected leaves at depth 16, found a child that is an inner node",
        ),
    ];
    for (bytes, want) in cases {
        let error = parse(&bytes, Path::new("bad.bt")).unwrap_err().to_string();
        assert_eq!(error, format!("malformed map: bad.bt: {want}"));
    }
}

#[test]
fn claims_beyond_the_data_cost_nothing() {
    let bytes = file(HEADER, b"size 18446744073709551615\nres 0.1\ndata\n\xff\xff");
    let error = parse(&bytes, Path::new("huge.bt")).unwrap_err().to_string();
    assert!(error.contains("depth 1"), "{error}");
}

proptest! {
    /// Any bytes give a tree or an error, and a tree that is written as it was read.
    #[test]
    fn any_bytes_are_read_or_refused(
        data in proptest::collection::vec(any::<u8>(), 0..400),
        size in 0u64..3000,
    ) {
        let header = format!("{HEADER}size {size}\nres 0.1\ndata\n");
        if let Ok(tree) = parse(&file(&header, &data), Path::new("any.bt")) {
            prop_assert_eq!(to_bytes(&tree), file(&header, &data));
        }
    }
}
