use super::*;
use proptest::prelude::*;

#[test]
fn short_plain_text_stays_as_it_is() {
    for text in ["", "a/b.toml", "größer ≤ 3 m", &"x".repeat(MAX_QUOTE_CHARS)] {
        assert_eq!(printable(text), text);
    }
    assert_eq!(printable("\x1b[31mred\n"), "\\u{1b}[31mred\\n");
    assert_eq!(printable("a\u{202e}b"), "a\\u{202e}b");
    assert!(printable(&format!("begin{}end", "x".repeat(5000))).starts_with("beginx"));
    assert!(printable(&format!("begin{}end", "x".repeat(5000))).ends_with("xend"));
}

#[test]
fn arguments_are_quoted_inside_a_message() {
    let arguments = ["--id=\x07".to_owned(), "y".repeat(1000)];
    let text = format!("error: invalid value '\x07' or '{}'", arguments[1]);
    let message = with_printable_arguments(&text, arguments.into_iter());
    assert!(message.starts_with("error: invalid value '\\u{7}' or 'yyy"), "{message}");
    assert!(message.chars().count() < 240, "{message}");
}

proptest! {
    #[test]
    fn whatever_is_quoted_is_short_and_without_codes(text in "(?s).{0,700}") {
        let short = printable(&text);
        prop_assert!(
            short.chars().count() <= MAX_QUOTE_CHARS && !short.chars().any(is_control_code),
            "{short:?}"
        );
        prop_assert!(
            printable_message(&text).lines().all(
                |l| l.chars().count() <= MAX_ERROR_CHARS && !l.chars().any(is_control_code)
            )
        );
    }
}
