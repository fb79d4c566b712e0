use super::*;

#[test]
fn of_a_long_line_the_part_is_shown_that_is_meant() {
    let text = format!("{}KEY = 1{}", "x".repeat(5000), "y".repeat(5000));
    let (shown, before, marked) = marked_line(&text, 5000, 3);
    assert_eq!(shown.chars().skip(before).take(marked).collect::<String>(), "KEY");
    assert!(
        shown.chars().count() <= MAX_QUOTE_CHARS && shown.starts_with('…') && shown.ends_with('…')
    );
    assert_eq!(marked_line("a\tb\u{1b}c", 2, 1), ("a b c".to_owned(), 2, 1));
    let (shown, before, marked) = marked_line(&text, 0, 9000);
    assert_eq!(
        (before + marked, shown.chars().count()),
        (MAX_QUOTE_CHARS - 2, MAX_QUOTE_CHARS - 1)
    );
}
