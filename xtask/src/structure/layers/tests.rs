use std::path::Path;

use super::*;

const LAYERS_OF_A_CRATE: Layers = ("part/src", &["low", "middle", "high"]);

#[test]
fn an_import_points_up_if_its_layer_comes_later_in_the_order() {
    let above = |from: &str, to: &str| is_above(&LAYERS_OF_A_CRATE, Path::new(from), Path::new(to));
    assert!(above("part/src/low.rs", "part/src/middle.rs"));
    assert!(above("part/src/low/inner.rs", "part/src/high/deep/inner.rs"));
    assert!(above("part/src/middle/high.rs", "part/src/high.rs"));
    for (from, to) in [
        ("part/src/high.rs", "part/src/low/inner.rs"),
        ("part/src/low.rs", "part/src/low/inner.rs"),
        ("part/src/low/inner.rs", "part/src/low/high.rs"),
        ("part/src/low.rs", "part/src/lib.rs"),
        ("part/src/lib.rs", "part/src/high.rs"),
        ("other/src/low.rs", "part/src/high.rs"),
        ("part/src/low.rs", "mavlink"),
    ] {
        assert!(!above(from, to), "{from} → {to}");
    }
}

#[test]
fn every_file_but_the_root_is_in_a_layer() {
    let unsorted = |file: &str| is_in_no_layer(&LAYERS_OF_A_CRATE, Path::new(file));
    assert!(unsorted("part/src/new.rs") && unsorted("part/src/new/low.rs"));
    for file in ["part/src/lib.rs", "part/src/low.rs", "part/src/low/new.rs", "other/src/new.rs"] {
        assert!(!unsorted(file), "{file}");
    }
}
