//! Reads files up to a size limit, and writes a command's result files all or none.
//!
//! Only regular files are read: a FIFO without a writer, a terminal or `/dev/zero` would never end.
//! Before a command computes anything it checks that its results can be written. Each result is
//! written to a temporary file in the results' directory; all are renamed to their targets at the
//! end, once every one is complete.

use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tempfile::{NamedTempFile, TempPath};

use crate::quote::printable_path;

/// Longest text file that is read, bytes: a scenario, a list of goals or an area.
pub const MAX_TEXT_BYTES: u64 = 1 << 20;
/// Longest roadmap, mission, plan or picture file that is read, bytes (64 MiB); the largest that
/// this program writes have some 20 MB.
pub const MAX_BINARY_BYTES: u64 = 1 << 26;

/// Reads all bytes of a regular file of at most `most` bytes.
///
/// # Errors
/// The file cannot be read, is not a regular file, or is longer than `most`.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    // Checked before opening: opening a FIFO blocks until its other end is opened.
    let length = regular_file_len(path)?;
    let too_long = || io::Error::other(format!("it is longer than {most} bytes"));
    if length > most {
        return Err(too_long());
    }
    let mut bytes = Vec::with_capacity(length as usize);
    // Files of /proc and files that grow are longer than their metadata says.
    fs::File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_long()) } else { Ok(bytes) }
}

/// Reads the text of a regular file of at most [`MAX_TEXT_BYTES`] bytes.
///
/// # Errors
/// As [`read`], or it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path, MAX_TEXT_BYTES)?)
        .map_err(|_| io::Error::other("it is not UTF-8 text"))
}

/// Length of a regular file, bytes.
///
/// # Errors
/// The file does not exist, or is no regular file.
pub fn regular_file_len(path: &Path) -> io::Result<u64> {
    let metadata = fs::metadata(path)?;
    let kind = if metadata.is_dir() { "it is a directory" } else { "it is not a regular file" };
    if metadata.is_file() { Ok(metadata.len()) } else { Err(io::Error::other(kind)) }
}

/// Result files that a command writes into one directory: all of them, or none.
pub struct ResultFiles {
    /// The directory of the results.
    dir: PathBuf,
    /// Directories that were created for the results, the innermost first; removed unless
    /// committed.
    created_dirs: Vec<PathBuf>,
    /// The results so far: temporary file and target of each.
    files: Vec<(NamedTempFile, PathBuf)>,
}

impl ResultFiles {
    /// Creates the directory where it is missing, and checks that files of these names can be
    /// written in it. Dropped without [`Self::commit`], it removes the directories that it created.
    ///
    /// # Errors
    /// The directory cannot be created or written to, or one of the names is taken by something
    /// that is no writable regular file.
    pub fn open(dir: &Path, names: &[&str]) -> anyhow::Result<Self> {
        let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
        let missing = dir.ancestors().take_while(|d| !d.as_os_str().is_empty() && !d.exists());
        let results = Self {
            dir: dir.into(),
            created_dirs: missing.map(PathBuf::from).collect(),
            files: Vec::new(),
        };
        fs::create_dir_all(dir)
            .with_context(|| format!("cannot make a directory: {}", printable_path(dir)))?;
        for name in names {
            results.writable_output_path(name)?;
        }
        results.temporary_file()?;
        Ok(results)
    }

    /// Results that consist of one file at `path`.
    ///
    /// # Errors
    /// As [`Self::open`]; also where the path names no file.
    pub fn single_file(path: &Path) -> anyhow::Result<Self> {
        // A path `a/` means a directory, although its `file_name` is `a`.
        let slash = path.as_os_str().to_string_lossy().ends_with(std::path::is_separator);
        let name = path.file_name().and_then(|name| name.to_str()).filter(|_| !slash);
        let name = name
            .with_context(|| format!("cannot write: {}: it names no file", printable_path(path)))?;
        Self::open(path.parent().unwrap_or(Path::new(".")), &[name])
    }

    /// Path that a result of this name is written to: the target of a symbolic link, else the name
    /// inside the directory. Fails if an existing file there cannot be written.
    fn writable_output_path(&self, name: &str) -> anyhow::Result<PathBuf> {
        let path = self.dir.join(name);
        let cannot = || format!("cannot write: {}", printable_path(&path));
        match fs::canonicalize(&path) {
            Ok(real) => {
                regular_file_len(&real).with_context(cannot)?;
                let writable = fs::OpenOptions::new().append(true).open(&real);
                writable.map(|_| real).with_context(cannot)
            }
            Err(_) => Ok(path),
        }
    }

    /// A new empty file in the directory, with a temporary name.
    fn temporary_file(&self) -> anyhow::Result<NamedTempFile> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".flockmate-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // Permissions of a newly created file, 0o666 less the process's umask; temporary files
            // would be 0o600.
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let made = builder.tempfile_in(&self.dir);
        made.with_context(|| format!("cannot write to: {}", printable_path(&self.dir)))
    }

    /// Writes one more result to a temporary file; [`Self::commit`] renames it to `name`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        let target = self.writable_output_path(name)?;
        let mut file = self.temporary_file()?;
        let written = file.write_all(bytes).and_then(|()| file.flush());
        written.with_context(|| format!("cannot write: {}", printable_path(&target)))?;
        self.files.push((file, target));
        Ok(())
    }

    /// As [`Self::add`], by the path that was given to [`Self::single_file`].
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add_file(&mut self, path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
        self.add(&path.file_name().unwrap_or_default().to_string_lossy(), bytes)
    }

    /// Renames all temporary files to their targets. If one cannot be renamed, the files that were
    /// there before are restored.
    ///
    /// # Errors
    /// A file cannot be renamed.
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
                replaced
                    .into_iter()
                    .rev()
                    .for_each(|(target, before)| undo_rename(&target, before));
                return Err(error)
                    .with_context(|| format!("cannot write: {}", printable_path(&target)));
            }
        }
        self.created_dirs.clear();
        Ok(())
    }

    /// Moves an existing target to a temporary name, from which it can be restored; `None` if there
    /// is no target. Dropping the returned path deletes the old file.
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

/// Undoes one rename: restores the old file, or deletes the new one where there was no old file.
fn undo_rename(target: &Path, before: Option<TempPath>) {
    // A failure here is ignored: the caller reports that the results could not be written.
    let _ = match before {
        Some(before) => before.persist(target).map_err(|error| error.error),
        None => fs::remove_file(target),
    };
}

impl Drop for ResultFiles {
    fn drop(&mut self) {
        self.files.clear();
        for dir in &self.created_dirs {
            // Fails, and leaves the directory, if another program has put files into it.
            let _ = fs::remove_dir(dir);
        }
    }
}

#[cfg(test)]
mod tests;
