use super::*;

/// What a file of this text adds to docs/margins.md, and what is wrong with it.
fn listing(text: &str) -> Listing {
    let mut listing = Listing::default();
    listing.add("a.rs", &syn::parse_file(text).expect("it parses").items, text);
    listing
}

/// Name, value and unit of each constant in a file of this text.
fn rows(text: &str) -> Vec<String> {
    let row =
        |((_, name), is): ((String, String), PageRow)| format!("{name} = {} {}", is.value, is.unit);
    listing(text).rows.into_iter().map(row).collect()
}

#[test]
fn numbers_arrays_tuples_ranges_and_points_with_a_unit_are_listed() {
    assert_eq!(rows("/// ü\nconst A_M: f32 = B_M + 0.5;"), ["A_M = B_M + 0.5 m"]);
    assert_eq!(rows("const A_MS: u64 = 10_000; const B_PER_S: f32 = 1.5;").len(), 2);
    assert_eq!(rows("const A_M: [f32; 2] = [\n    1.0,\n    2.0\n];"), ["A_M = [1.0, 2.0] m"]);
    assert_eq!(rows("const A_M: [[f32; 2]; 3] = [[0.0; 2]; 3];"), ["A_M = [[0.0; 2]; 3] m"]);
    assert_eq!(rows("const A_S: (f32, f32) = (0.2, 0.5);"), ["A_S = (0.2, 0.5) s"]);
    assert_eq!(
        rows("const A_M: core::ops::RangeInclusive<f64> = 1.0..=2.0;"),
        ["A_M = 1.0..=2.0 m"]
    );
    assert_eq!(rows("const A_M: Point = Point::ZERO;"), ["A_M = Point::ZERO m"]);
    assert_eq!(rows("const A_BYTES_PER_S: u32 = 9;"), ["A_BYTES_PER_S = 9 byte/s"]);
    let others =
        "const A_M: usize = 3; const B: f32 = 1.0; const C_M: &str = \"\"; const D_M: E = E;";
    assert!(rows(others).is_empty());
}

#[test]
fn a_duration_is_listed_in_seconds_or_as_it_is_written() {
    let row = |value: &str| rows(&format!("const A: time::Duration = {value};"));
    assert_eq!(row("Duration::from_millis(9050)"), ["A = 9.05 s"]);
    assert_eq!(row("Duration::from_micros(4_000)"), ["A = 0.004 s"]);
    assert_eq!(row("Duration::from_millis(0)"), ["A = 0.0 s"]);
    assert_eq!(row("secs(180)"), ["A = 180.0 s"]);
    assert_eq!(row("Duration::from_millis(B_MS)"), ["A = Duration::from_millis(B_MS) s"]);
}

#[test]
fn constants_of_an_impl_and_of_a_function_are_listed() {
    assert_eq!(rows("impl A { const B_M: f32 = 1.0; }"), ["B_M = 1.0 m"]);
    assert_eq!(rows("fn a() { const B_M: f32 = 1.0; }"), ["B_M = 1.0 m"]);
    assert_eq!(rows("impl A { fn a() { const B_M: f32 = 1.0; } }"), ["B_M = 1.0 m"]);
}

#[test]
fn a_constant_needs_a_reason_and_a_name_of_its_own() {
    let wrong = |text: &str| listing(text).faults;
    assert!(wrong("/// Far, metres.\nconst A_M: f32 = 1.0;").is_empty());
    assert_eq!(wrong("const A_M: f32 = 1.0;"), ["a.rs: A_M has no reason"]);
    let twice = "/// One.\nconst A: Duration = B;\nimpl C {\n/// Two.\nconst A: Duration = B;\n}";
    assert_eq!(wrong(twice), ["a.rs: A is the name of another one in a.rs"]);
}
