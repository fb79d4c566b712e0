//! Files read with a limit, and files written whole or not at all.
//!
//! Only regular files are read: a FIFO without a writer, a terminal or `/dev/zero` would never end.
//! What a command writes is tried before its work, written beside its target, and takes its name in
//! the end, when all of it is there.

use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tempfile::{NamedTempFile, TempPath};

use crate::quote::quoted_path;

/// Longest text file read: a scenario or its goals.
pub const TEXT_BYTES: u64 = 1 << 20;
/// Longest roadmap or mission file read; the largest of this build have some 20 MB.
pub const BINARY_BYTES: u64 = 1 << 26;

/// All bytes of a regular file of at most `most` bytes.
///
/// # Errors
/// It cannot be read, is not a regular file, or is longer.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    // Asked before it is opened: opening a FIFO waits for its other end.
    let length = regular_file_len(path)?;
    let too_long = || io::Error::other(format!("it is longer than {most} bytes"));
    if length > most {
        return Err(too_long());
    }
    let mut bytes = Vec::with_capacity(length as usize);
    // Files of /proc and files that grow are longer than they say.
    fs::File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long()) } else { Ok(bytes) }
}

/// The text of a regular file of at most [`TEXT_BYTES`] bytes.
///
/// # Errors
/// As [`read`], or it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path, TEXT_BYTES)?).map_err(|_| io::Error::other("it is not UTF-8 text"))
}

/// Length of a regular file.
///
/// # Errors
/// There is none, or it is something else.
pub fn regular_file_len(path: &Path) -> io::Result<u64> {
    let metadata = fs::metadata(path)?;
    let kind = if metadata.is_dir() { "it is a directory" } else { "it is not a regular file" };
    if metadata.is_file() { Ok(metadata.len()) } else { Err(io::Error::other(kind)) }
}

/// Files that a command writes into one directory: all of them, or none.
pub struct ResultFiles {
    dir: PathBuf,
    /// Directories made for them, the innermost first.
    made: Vec<PathBuf>,
    files: Vec<(NamedTempFile, PathBuf)>,
}

impl ResultFiles {
    /// Makes the directory and tries whether it takes files of these names. It is gone again if
    /// nothing is kept in it.
    ///
    /// # Errors
    /// It cannot be made or written to, or something else than a file has one of the names.
    pub fn open(dir: &Path, names: &[&str]) -> anyhow::Result<Self> {
        let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
        let missing = dir.ancestors().take_while(|d| !d.as_os_str().is_empty() && !d.exists());
        let results =
            Self { dir: dir.into(), made: missing.map(PathBuf::from).collect(), files: Vec::new() };
        fs::create_dir_all(dir)
            .with_context(|| format!("cannot make a directory: {}", quoted_path(dir)))?;
        for name in names {
            results.target_path(name)?;
        }
        results.temporary_file()?;
        Ok(results)
    }

    /// Results of one file.
    ///
    /// # Errors
    /// As [`Self::open`], or the path names no file.
    pub fn single_file(path: &Path) -> anyhow::Result<Self> {
        // `a/` means a directory, though its last part is `a`.
        let slash = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
        let name = path.file_name().and_then(|name| name.to_str()).filter(|_| !slash);
        let name =
            name.with_context(|| format!("cannot write: {}: it names no file", quoted_path(path)))?;
        Self::open(path.parent().unwrap_or(Path::new(".")), &[name])
    }

    /// Place of a file of this name: the target of a link.
    fn target_path(&self, name: &str) -> anyhow::Result<PathBuf> {
        let path = self.dir.join(name);
        let cannot = || format!("cannot write: {}", quoted_path(&path));
        match fs::canonicalize(&path) {
            Ok(real) => {
                regular_file_len(&real).with_context(cannot)?;
                let writable = fs::OpenOptions::new().append(true).open(&real);
                writable.map(|_| real).with_context(cannot)
            }
            Err(_) => Ok(path),
        }
    }

    fn temporary_file(&self) -> anyhow::Result<NamedTempFile> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".flockmate-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // Permissions as of any new file, less those that the user's mask forbids.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let made = builder.tempfile_in(&self.dir);
        made.with_context(|| format!("cannot write to: {}", quoted_path(&self.dir)))
    }

    /// Takes one more file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        let target = self.target_path(name)?;
        let mut file = self.temporary_file()?;
        let written = file.write_all(bytes).and_then(|()| file.flush());
        written.with_context(|| format!("cannot write: {}", quoted_path(&target)))?;
        self.files.push((file, target));
        Ok(())
    }

    /// Takes one file with the whole name it was opened with.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add_file(&mut self, path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
        self.add(&path.file_name().unwrap_or_default().to_string_lossy(), bytes)
    }

    /// Gives every file its name. Where one cannot have it, what was there before comes back.
    ///
    /// # Errors
    /// One of them cannot be renamed.
    pub fn commit(mut self) -> anyhow::Result<()> {
        let files = std::mem::take(&mut self.files);
        let mut replaced = Vec::new();
        for (file, target) in files {
            let before = self.set_aside(&target);
            let kept = before.and_then(|before| {
                replaced.push((target.clone(), before));
                file.persist(&target).map(drop).map_err(|error| error.error)
            });
            if let Err(error) = kept {
                replaced.into_iter().rev().for_each(|(target, before)| put_back(&target, before));
                return Err(error)
                    .with_context(|| format!("cannot write: {}", quoted_path(&target)));
            }
        }
        self.made.clear();
        Ok(())
    }

    /// Keeps an existing file under another name until all results are written; dropping the result
    /// removes it.
    fn set_aside(&self, target: &Path) -> io::Result<Option<TempPath>> {
        if !target.try_exists()? {
            return Ok(None);
        }
        let aside =
            tempfile::Builder::new().prefix(".flockmate-").tempfile_in(&self.dir)?.into_temp_path();
        fs::rename(target, &aside)?;
        Ok(Some(aside))
    }
}

/// Undoes the keeping of one file.
fn put_back(target: &Path, before: Option<TempPath>) {
    // A step that cannot be undone stays as it is: the error says that the results are not whole.
    let _ = match before {
        Some(before) => before.persist(target).map_err(|error| error.error),
        None => fs::remove_file(target),
    };
}

impl Drop for ResultFiles {
    fn drop(&mut self) {
        self.files.clear();
        for dir in &self.made {
            // A folder that another program filled stays.
            let _ = fs::remove_dir(dir);
        }
    }
}

#[cfg(test)]
mod tests {
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
            read(Path::new("/dev/zero"), 99)
                .unwrap_err()
                .to_string()
                .contains("not a regular file")
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

        // A file that cannot have its name, here since a folder has it by now, leaves all that was
        // there before.
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
        for (dir, name) in
            [("file", "result.json"), ("file/x", "result.json"), ("out", "result.json")]
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
}
