use super::*;

#[test]
fn numbers_stand_where_the_text_says() {
    assert_eq!(
        format_text("Setpoints: #, at most # ms apart", [1234, 55, 0]),
        "Setpoints: 1234, at most 55 ms apart"
    );
    assert_eq!(format_text("Nothing", [1, 2, 3]), "Nothing");
    assert_eq!(format_text("# # # #", [u32::MAX, 0, 7]), "4294967295 0 7 ");
}
