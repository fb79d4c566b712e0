use super::*;

#[test]
fn little_endian_in_order() {
    let track = [TrackPoint { t_s: 1.0, position: Point::new(2.0, 3.0, -4.0) }];
    let text = super::track(&track, serde_json::value::Serializer).expect("a string");
    let bytes = STANDARD.decode(text.as_str().expect("a string")).expect("base64");
    let back: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert_eq!(back, [1.0, 2.0, 3.0, -4.0]);
    assert_eq!(
        super::pairs(&[[1, 258]], serde_json::value::Serializer).expect("a string"),
        "AQACAQ=="
    );
}
