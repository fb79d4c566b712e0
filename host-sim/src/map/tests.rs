mod reference;

use super::*;

#[test]
fn names_tell_the_source() {
    assert_eq!(
        MapSource::parse("builtin:building").unwrap(),
        MapSource::Building(building::DEFAULT_SEED)
    );
    assert_eq!(MapSource::parse("builtin:building?seed=7").unwrap(), MapSource::Building(7));
    assert_eq!(MapSource::parse("a/b.BT").unwrap(), MapSource::Bt(Path::new("a/b.BT")));
    for wrong in ["builtin:castle", "builtin:building?seed=x", "hall.obj", "hall", ""] {
        assert!(matches!(MapSource::parse(wrong), Err(MapError::UnknownKind { .. })), "{wrong}");
    }
}
