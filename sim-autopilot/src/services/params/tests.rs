use super::*;

const TABLE: &[(&str, ParamValue)] =
    &[("BYTE", Int8(1)), ("LONG", Int(5)), ("REAL", Real(2.5)), ("WORD", Int16(300))];

#[test]
fn integers_travel_bytewise_and_the_wrong_type_is_refused() {
    let mut params = Params::new(TABLE, Encoding::Bytewise, &[]);
    assert!(params.set("LONG", f32::from_bits(7), 6));
    assert_eq!(params.i32_value("LONG"), 7);
    assert_eq!(params.to_wire(Int(7)).to_bits(), 7);
    assert!(
        !params.set("LONG", 4.0, 9)
            && !params.set("REAL", f32::NAN, 9)
            && !params.set("NONE", 1.0, 9)
    );
    assert_eq!((params.i32_value("LONG"), params.f32_value("REAL")), (7, 2.5));
}

#[test]
fn integers_are_cast_whatever_type_is_named() {
    let mut params = Params::new(TABLE, Encoding::Cast, &[("WORD", Int16(9))]);
    for (name, wire, kind, holds) in [
        ("LONG", 42.0, 9, 42),
        ("BYTE", 3.0, 2, 3),
        ("WORD", 70_000.0, 6, 32_767),
        ("BYTE", -300.0, 9, -128),
    ] {
        assert!(params.set(name, wire, kind));
        assert_eq!(params.i32_value(name), holds, "{name}");
    }
    assert_eq!(params.to_wire(Int16(-12)), -12.0);
    assert!(!params.set("LONG", f32::NAN, 6) && !params.set("REAL", f32::INFINITY, 9));
    assert_eq!((params.get(0), params.index("WORD")), (Some(("BYTE", Int8(-128))), Some(3)));
}
