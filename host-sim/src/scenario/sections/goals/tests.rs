use crate::scenario::parse;

#[test]
fn a_coverage_mission_without_an_area_is_refused_by_name() {
    let rest = "cruise_mps = 5.0\n[[vehicles]]\nid = 1\nstart = [0, -20, 0]\n";
    for map in ["", "[map]\nfile = \"builtin:building\"\n"] {
        let error =
            parse(&format!("{map}[mission]\nmode = \"coverage\"\n{rest}"), "a.toml").unwrap_err();
        assert_eq!(error.why, "[area] is missing: mission.mode is \"coverage\"");
        let hint = "add `[area]` with `file = \"field.geojson\"` or `polygon = [[x, y], …]`";
        assert_eq!(error.hint.as_deref(), Some(hint));
        let line = map.lines().count() + 2;
        assert_eq!(error.place.as_ref().map(|place| place.line), Some(line), "{error}");
    }
    // Any other mission without an area lacks a map.
    let error = parse(&format!("[mission]\nmode = \"labelled\"\n{rest}"), "a.toml").unwrap_err();
    assert_eq!(error.why, "map is missing");
}
