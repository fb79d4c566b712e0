use super::*;

/// An artifact as cargo reports it.
fn artifact(kind: &str, executable: &Value) -> Value {
    serde_json::json!({
        "manifest_path": "/checkout/tests/Cargo.toml",
        "target": { "name": "edge", "kind": [kind] },
        "profile": { "test": false },
        "executable": executable,
    })
}

/// An artifact that was built with its tests.
fn test_artifact(kind: &str, executable: &Value) -> Value {
    let mut artifact = artifact(kind, executable);
    artifact["profile"]["test"] = true.into();
    artifact
}

#[test]
fn only_tests_and_examples_are_run() {
    let edge = test_program_of(&test_artifact("test", &"/target/edge-1".into()))
        .expect("a program of tests");
    assert_eq!((edge.name.as_str(), start_order(&edge)), ("edge", STARTED_FIRST.len()));
    assert_eq!(
        (edge.path, edge.package_folder),
        ("/target/edge-1".into(), "/checkout/tests".into())
    );
    let example = test_program_of(&artifact("example", &"/target/examples/edge".into()));
    assert_eq!(example.expect("an example").path, PathBuf::from("/target/examples/edge"));
    assert_eq!(test_program_of(&artifact("bin", &"/target/edge".into())), None, "a binary");
    assert_eq!(test_program_of(&test_artifact("lib", &Value::Null)), None, "a library");
}

#[test]
fn each_program_that_fails_is_named_and_all_run() {
    let program = |name: &str| TestProgram {
        name: name.to_owned(),
        path: crate::shell::find_on_path(name).expect("every Linux has it"),
        package_folder: "/".into(),
    };
    let programs = ["true", "false", "true", "false"].map(program).to_vec();
    let failed = run_all_and_name_failed(programs, 2, &Vec::new()).expect("both start");
    assert_eq!(failed, ["false", "false"]);
}
