use super::*;

#[test]
fn a_line_is_long_unless_a_string_a_table_or_skipping_makes_it_so() {
    let (word, text) = ("a + ".repeat(30), "b".repeat(120));
    let beyond = |text: &str| beyond_in(text).expect("it parses").len();
    assert_eq!(beyond(&format!("fn f() {{\n    {word}a\n}}\n")), 1);
    assert_eq!(beyond(&format!("fn f() {{\n    g!(x in {word}a, \"b\");\n}}\n")), 1);
    assert_eq!(beyond(&format!("// {word}\n/// | {word}|\nfn f() {{}}\n")), 1);
    assert_eq!(beyond(&format!("const T: &str = \"{text}\";\n")), 0);
    assert_eq!(beyond(&format!("const T: &str = \"{text}\n{text}\";\n")), 0);
    let skipped = format!("#[rustfmt::skip]\nconst T: u8 = {word}a;\n");
    assert_eq!(beyond(&skipped), 0);
    assert_eq!(beyond(&format!("{skipped}const U: u8 = {word}a;\n")), 1);
    assert_eq!(beyond(&"// a\n".repeat(LINES)), 0);
    assert_eq!(beyond(&"// a\n".repeat(LINES + 1)), 1);
}
