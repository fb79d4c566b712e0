use super::*;

#[test]
fn a_file_is_read_up_to_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f");
    fs::write(&path, [7; 100]).unwrap();
    assert_eq!(read(&path, 100).unwrap(), [7; 100]);
    assert!(read(&path, 99).unwrap_err().to_string().contains("longer than 99 bytes"));
    assert!(read(folder.path(), 99).unwrap_err().to_string().contains("directory"));
    assert!(
        read(Path::new("/dev/zero"), 99).unwrap_err().to_string().contains("not a regular file")
    );
    fs::write(&path, b"\xff\xfe").unwrap();
    assert!(read_text(&path).unwrap_err().to_string().contains("UTF-8"));
}

#[test]
fn results_are_written_all_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a/b");
    let mut results = ResultFiles::open(&out, &["one", "two"]).unwrap();
    results.add("one", b"1").unwrap();
    drop(results);
    assert!(!folder.path().join("a").exists(), "nothing is left of what was not kept");

    let mut results = ResultFiles::open(&out, &["one", "two"]).unwrap();
    results.add("one", b"1").unwrap();
    assert!(!out.join("one").exists());
    results.add("two", b"2").unwrap();
    results.commit().unwrap();
    let names: Vec<_> = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!((names.len(), fs::read(out.join("two")).unwrap()), (2, b"2".to_vec()));

    // If one file cannot be renamed to its target (here a folder has taken the name), all
    // earlier files stay as they were.
    let mut results = ResultFiles::open(&out, &["one", "three", "last"]).unwrap();
    for name in ["one", "three", "last"] {
        results.add(name, b"new").unwrap();
    }
    fs::create_dir_all(out.join("last/full")).unwrap();
    assert!(results.commit().is_err());
    assert_eq!(fs::read(out.join("one")).unwrap(), b"1");
    assert!(!out.join("three").exists() && out.join("last/full").is_dir());
    assert_eq!(fs::read_dir(&out).unwrap().count(), 3, "one, two, and the folder");
    fs::remove_dir_all(out.join("last")).unwrap();

    // Another run that fails leaves the results of the first.
    let mut results = ResultFiles::open(&out, &["one", "two"]).unwrap();
    results.add("one", b"other").unwrap();
    drop(results);
    assert_eq!(fs::read(out.join("one")).unwrap(), b"1");
}

#[test]
fn what_cannot_be_written_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), b"").unwrap();
    fs::create_dir_all(folder.path().join("out/result.json")).unwrap();
    for (dir, name) in [("file", "result.json"), ("file/x", "result.json"), ("out", "result.json")]
    {
        assert!(ResultFiles::open(&folder.path().join(dir), &[name]).is_err(), "{dir}");
    }
    for path in
        ["/dev/full", "/dev/null", "/", "/proc/x/y", "/proc/self/oom_score_adj/y", "/tmp/x/"]
    {
        assert!(ResultFiles::single_file(Path::new(path)).is_err(), "{path}");
    }
    assert!(!folder.path().join("file/x").exists());
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let (real, link) = (folder.path().join("real"), folder.path().join("link"));
    fs::write(&real, b"old").unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    let mut results = ResultFiles::single_file(&link).unwrap();
    results.add_file(&link, b"new").unwrap();
    results.commit().unwrap();
    assert_eq!(fs::read(&real).unwrap(), b"new");
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
}
