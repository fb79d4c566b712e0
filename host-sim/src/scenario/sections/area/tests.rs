use crate::scenario::parse;

#[test]
fn a_thin_polygon_is_not_said_to_be_full_of_holes() {
    let sliver = "[[0, 0], [5000, 0.01], [5000, 0.02]]";
    let speck = "[[0, 0], [0.6, 0], [0.6, 0.01]]";
    let square = "[[0, 0], [100, 0], [100, 80], [0, 80]]";
    let zone = "no_fly = [[[20, -20], [40, -20], [40, -40]]]";
    let whole = "holes = [[[0, 0], [100, 0], [100, 80], [0, 80]]]";
    let thin = "area.polygon: polygon 0 is too thin or too small";
    let full = "area.polygon: holes leave nothing of polygon 0";
    for (polygon, line, why, hint) in [
        (sliver, "", thin, "wider than a few centimetres"),
        (sliver, zone, thin, "wider than a few centimetres"),
        (speck, "", thin, "wider than a few centimetres"),
        (square, whole, full, "leave a hole out"),
    ] {
        let text = format!(
            "[area]\npolygon = {polygon}\n{line}\nheight_m = 35.0\n\
             camera = {{ fov_deg = 73.7, aspect = 1.5 }}\n[[vehicles]]\nid = 1\n\
             start = [0, -20, 0]\n"
        );
        let error = parse(&text, "a.toml").unwrap_err();
        assert!(error.why.starts_with(why), "{error}");
        assert!(error.hint.as_ref().is_some_and(|said| said.contains(hint)), "{error}");
        assert_eq!(error.place.as_ref().map(|place| place.line), Some(2), "{error}");
    }
}
