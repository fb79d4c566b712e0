//! The reader against OctoMap's own counts and queries of real maps, where the shared data is
//! present.

use std::path::Path;

use crate::map::bt;
use crate::map::octree::Occupancy;

#[test]
fn real_maps_read_as_octomap_reads_them() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/maps3d"));
    let Ok(text) = std::fs::read_to_string(folder.join("octomap_reference.json")) else {
        println!("skipped: no {}/octomap_reference.json", folder.display());
        return;
    };
    let reference: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(&text).unwrap();
    assert_eq!(reference.len(), 5);
    for (name, want) in &reference {
        let bytes = std::fs::read(folder.join(format!("{name}.bt"))).unwrap();
        let tree = bt::parse(&bytes, Path::new(name)).unwrap();
        let counts = tree.counts();
        let number = |key: &str| want[key].as_f64().unwrap();
        assert_eq!(counts.nodes as f64, number("nodes"), "{name}");
        assert_eq!(counts.occupied_leaves as f64, number("occ_leaves"), "{name}");
        assert_eq!(counts.free_leaves as f64, number("free_leaves"), "{name}");
        assert_eq!(tree.resolution_m(), number("res"), "{name}");
        // Printed to four decimals.
        assert!(
            (counts.occupied_m3 - number("occ_m3")).abs() <= 5.1e-5,
            "{name}: {}",
            counts.occupied_m3
        );
        assert!((counts.free_m3 - number("free_m3")).abs() <= 5.1e-5, "{name}: {}", counts.free_m3);
        let (min, max) = tree.metric_bounds().unwrap();
        for axis in 0..3 {
            assert!(
                (min[axis] - want["metric_min"][axis].as_f64().unwrap()).abs() <= 5.1e-5,
                "{name}: {min:?}"
            );
            assert!(
                (max[axis] - want["metric_max"][axis].as_f64().unwrap()).abs() <= 5.1e-5,
                "{name}: {max:?}"
            );
        }
        let queries = want["queries"].as_array().unwrap();
        assert_eq!(queries.len(), 60);
        for query in queries {
            let state = match tree.occupancy_at([0, 1, 2].map(|a| query[a].as_f64().unwrap())) {
                Occupancy::Unknown => -1,
                Occupancy::Free => 0,
                Occupancy::Occupied => 1,
            };
            assert_eq!(state, query[3].as_i64().unwrap(), "{name} at {query}");
        }
        // Bytes after the header are written as they were read: pruned the same way.
        let data = |bytes: &[u8]| bytes.windows(6).position(|w| w == b"\ndata\n").unwrap() + 6;
        let again = bt::to_bytes(&tree);
        assert_eq!(again[data(&again)..], bytes[data(&bytes)..], "{name}");
    }
}
