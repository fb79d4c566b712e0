use super::*;

const SQUARE: [[f64; 2]; 4] = [[1.0, 2.0], [5.0, 2.0], [5.0, 6.0], [1.0, 6.0]];
const HOLE: [[f64; 2]; 3] = [[2.0, 3.0], [3.0, 3.0], [3.0, 4.0]];

#[test]
fn all_formats_say_the_same() {
    let square = "[[1,2],[5,2],[5,6],[1,6],[1,2]],[[2,3],[3,3],[3,4],[2,3]]";
    let texts = [
        (AreaFormat::GeoJson, format!(r#"{{"type":"Polygon","coordinates":[{square}]}}"#)),
        (
            AreaFormat::GeoJson,
            format!(
                r#"{{"type":"FeatureCollection","features":[{{"type":"Feature","properties":{{}},"geometry":
                {{"type":"MultiPolygon","coordinates":[[{square}]]}}}},
                {{"type":"Feature","properties":null,"geometry":null}}]}}"#
            ),
        ),
        (AreaFormat::Wkt, "POLYGON ((1 2, 5 2, 5 6, 1 6, 1 2), (2 3, 3 3, 3 4, 2 3))".to_owned()),
        (
            AreaFormat::Wkt,
            "SRID=25830;MULTIPOLYGON(((1 2,5 2,5 6,1 6,1 2),(2 3,3 3,3 4,2 3)))".to_owned(),
        ),
        (
            AreaFormat::Kml,
            "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document><Folder><Placemark><Polygon><outerBoundaryIs>\
             <LinearRing><coordinates>1,2,0 5,2,0 5,6,0 1,6,0 1,2,0</coordinates></LinearRing></outerBoundaryIs>\
             <innerBoundaryIs><LinearRing><coordinates>2,3 3,3 3,4 2,3</coordinates></LinearRing></innerBoundaryIs>\
             </Polygon></Placemark></Folder></Document></kml>"
                .to_owned(),
        ),
    ];
    for (format, text) in texts {
        let polygons = parse(&text, format).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(polygons.outers, [SQUARE], "{text}");
        assert_eq!(polygons.holes, [HOLE], "{text}");
        assert_eq!(parse(&format!("\u{feff}{text}"), format).ok(), Some(polygons), "{text}");
    }
}

#[test]
fn a_plan_gives_its_survey_or_its_fence() {
    let plan = |items: &str, fence: &str| {
        format!(
            r#"{{"fileType":"Plan","version":1,"mission":{{"items":[{items}]}},"geoFence":{fence}}}"#
        )
    };
    let survey = r#"{"complexItemType":"survey","polygon":[[2,1],[2,5],[6,5],[6,1]]}"#;
    let fence = r#"{"polygons":[{"inclusion":true,"polygon":[[0,0],[0,9],[9,9]]},
        {"inclusion":false,"polygon":[[3,2],[3,3],[4,3]]}],
        "circles":[{"inclusion":false,"circle":{"center":[45.0,8.0],"radius":100.0}}]}"#;
    let polygons = parse(&plan(survey, fence), AreaFormat::Plan).unwrap();
    assert_eq!((&polygons.outers[..], polygons.no_fly.len()), (&[SQUARE.to_vec()][..], 2));
    let corner = polygons.no_fly[1][0];
    assert!(corner[0] > 8.00127 && corner[0] < 8.0013, "{corner:?}");
    let polygons = parse(&plan("", fence), AreaFormat::Plan).unwrap();
    assert_eq!(polygons.outers, [[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]]);
    assert!(matches!(parse(&plan("", "{}"), AreaFormat::Plan), Err(AreaFileError::NoPolygon(_))));
}

#[test]
fn what_is_none_is_refused() {
    for (format, text) in [
        (AreaFormat::GeoJson, ""),
        (AreaFormat::GeoJson, "{\"droneNo\": 3}"),
        (AreaFormat::GeoJson, "{\"type\":\"Polygon\",\"coordinates\":[[[1],[2],[3]]]}"),
        (AreaFormat::GeoJson, "{\"type\":\"Point\",\"coordinates\":[1,2]}"),
        (AreaFormat::GeoJson, "{\"type\":\"Polygon\",\"coordinates\":[]}"),
        (AreaFormat::Wkt, "POLYGON"),
        (AreaFormat::Wkt, "POLYGON EMPTY"),
        (AreaFormat::Wkt, "LINESTRING (1 2, 3 4)"),
        (AreaFormat::Kml, "<kml></kml>"),
        (AreaFormat::Kml, "<a><b>"),
        (AreaFormat::Plan, "{}"),
        (AreaFormat::Plan, "{\"fileType\":\"Plan\",\"version\":2,\"mission\":{}}"),
    ] {
        assert!(parse(text, format).is_err(), "{text}");
    }
    let deep = "<Folder>".repeat(100_000);
    assert!(parse(&format!("<kml>{deep}"), AreaFormat::Kml).is_err());
    let deep = "[".repeat(100_000);
    assert!(parse(&deep, AreaFormat::GeoJson).is_err());
    let deep = "GEOMETRYCOLLECTION(".repeat(50_000);
    assert!(parse(&deep, AreaFormat::Wkt).is_err());
    let many: Vec<String> = (0..=MAX_VERTICES).map(|i| format!("{i} {i}")).collect();
    let many = format!("POLYGON(({}))", many.join(","));
    assert!(matches!(parse(&many, AreaFormat::Wkt), Err(AreaFileError::TooManyVertices(_))));
}
