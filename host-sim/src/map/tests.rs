mod reference;

use super::*;

#[test]
fn names_tell_the_source() {
    assert_eq!(
        Source::parse("builtin:building").unwrap(),
        Source::Building(building::DEFAULT_SEED)
    );
    assert_eq!(Source::parse("builtin:building?seed=7").unwrap(), Source::Building(7));
    assert_eq!(Source::parse("a/b.BT").unwrap(), Source::Bt(Path::new("a/b.BT")));
    for wrong in ["builtin:castle", "builtin:building?seed=x", "hall.obj", "hall", ""] {
        assert!(matches!(Source::parse(wrong), Err(MapError::UnknownKind { .. })), "{wrong}");
    }
}
