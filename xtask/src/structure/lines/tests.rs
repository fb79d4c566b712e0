use super::*;

#[test]
fn a_line_is_long_unless_a_string_a_table_or_skipping_makes_it_so() {
    let (word, text) = ("a + ".repeat(30), "b".repeat(120));
    let beyond = |text: &str| faults_in_source(text).expect("it parses").len();
    assert_eq!(beyond(&format!("fn f() {{\n    {word}a\n}}\n")), 1);
    assert_eq!(beyond(&format!("fn f() {{\n    g!(x in {word}a, \"b\");\n}}\n")), 1);
    assert_eq!(beyond(&format!("// {word}\n/// | {word}|\nfn f() {{}}\n")), 1);
    assert_eq!(beyond(&format!("const T: &str = \"{text}\";\n")), 0);
    assert_eq!(beyond(&format!("const T: &str = \"{text}\n{text}\";\n")), 0);
    let skipped = format!("#[rustfmt::skip]\nconst T: u8 = {word}a;\n");
    assert_eq!(beyond(&skipped), 0);
    assert_eq!(beyond(&format!("{skipped}const U: u8 = {word}a;\n")), 1);
    assert_eq!(beyond(&"// a\n".repeat(MAX_FILE_LINES)), 0);
    assert_eq!(beyond(&"// a\n".repeat(MAX_FILE_LINES + 1)), 1);
}

#[test]
fn a_module_stands_in_the_file_of_its_name_and_its_tests_in_a_file_of_their_own() {
    let misplaced = |file: &str, text: &str| misplaced_module(Path::new(file), text).is_some();
    assert!(misplaced("a/src/b/mod.rs", "") && misplaced("a/src/b_tests.rs", ""));
    assert!(misplaced("a/src/b.rs", "#[cfg(test)]\npub(crate) mod tests {\n}\n"));
    assert!(!misplaced("a/src/b.rs", "#[cfg(test)]\nmod tests;\n"));
    assert!(!misplaced("tests/tests/b/mod.rs", "mod tests {\n}\n"));
}

#[test]
fn prose_is_long_unless_it_cannot_be_broken() {
    let prose = "word ".repeat(30);
    let count = |text: &str| long_prose_lines(text).count();
    assert_eq!(count(&format!("{prose}\n\n- {prose}\n")), 2);
    assert_eq!(count(&format!("| {prose} |\n```\n{prose}\n```\n{prose}\n")), 1);
    assert_eq!(count(&format!("Run `{prose}`.\n")), 0);
}
