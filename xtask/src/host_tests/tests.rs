use super::*;

fn artifact(kind: &str, test: bool, executable: &Value) -> Value {
    serde_json::json!({
        "manifest_path": "/checkout/tests/Cargo.toml",
        "target": { "name": "edge", "kind": [kind] },
        "profile": { "test": test },
        "executable": executable,
    })
}

#[test]
fn only_tests_and_examples_are_run() {
    let edge =
        program(&artifact("test", true, &"/target/edge-1".into())).expect("a program of tests");
    assert_eq!((edge.name.as_str(), turn(&edge)), ("edge", FIRST.len()));
    assert_eq!((edge.path, edge.package), ("/target/edge-1".into(), "/checkout/tests".into()));
    let example = program(&artifact("example", false, &"/target/examples/edge".into()));
    assert_eq!(example.expect("an example").path, PathBuf::from("/target/examples/edge"));
    assert_eq!(program(&artifact("bin", false, &"/target/edge".into())), None, "a binary");
    assert_eq!(program(&artifact("lib", true, &Value::Null)), None, "a library");
}

#[test]
fn each_program_that_fails_is_named_and_all_run() {
    let program = |name: &str| Program {
        name: name.to_owned(),
        path: crate::shell::find(name).expect("every Linux has it"),
        package: "/".into(),
    };
    let programs = ["true", "false", "true", "false"].map(program).to_vec();
    let failed = failures(programs, 2, &Vec::new()).expect("both start");
    assert_eq!(failed, ["false", "false"]);
}
