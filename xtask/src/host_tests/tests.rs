use super::*;

fn artifact(test: bool, executable: &Value) -> String {
    serde_json::json!({
        "reason": "compiler-artifact",
        "manifest_path": "/checkout/tests/Cargo.toml",
        "target": { "name": "edge", "kind": ["test"] },
        "profile": { "test": test },
        "executable": executable,
    })
    .to_string()
}

#[test]
fn only_programs_of_tests_are_run() {
    let edge = program(&artifact(true, &"/target/edge-1".into())).expect("a program of tests");
    assert_eq!((edge.name.as_str(), turn(&edge)), ("edge", FIRST.len()));
    assert_eq!((edge.path, edge.package), ("/target/edge-1".into(), "/checkout/tests".into()));
    assert_eq!(program(&artifact(false, &"/target/edge".into())), None, "a binary");
    assert_eq!(program(&artifact(true, &Value::Null)), None, "a library");
    assert_eq!(program(r#"{"reason":"build-finished","success":true}"#), None);
    assert_eq!(program("no message"), None);
}

#[test]
fn each_program_that_fails_is_named_and_all_run() {
    let program = |name: &str| Program {
        name: name.to_owned(),
        path: crate::shell::find(name).expect("every Linux has it"),
        package: "/".into(),
    };
    let programs = ["true", "false", "true", "false"].map(program).to_vec();
    let failed = failures(programs, 2, &[]).expect("both start");
    assert_eq!(failed, ["false", "false"]);
}
