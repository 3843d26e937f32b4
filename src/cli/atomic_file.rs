//! Files that are replaced atomically.

use std::fs::{File, Metadata};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Replaces the content of a file, all of it or nothing.
pub(super) fn write_atomically(path: &Path, text: &[u8]) -> io::Result<()> {
    let mut file = AtomicFile::begin(path)?;
    file.write_all(text)?;
    file.finish()
}

/// Replaces the content of a file like [`write_atomically`], unless it is not `old` any more.
pub(super) fn replace(path: &Path, old: &[u8], new: &[u8]) -> io::Result<()> {
    let is_old = || {
        let is_old = std::fs::read(path)? == old;
        if is_old { Ok(()) } else { Err(io::Error::other("it has changed since it was read")) }
    };
    // A file that is written in place loses its content at once.
    is_old()?;
    is_writable(path)?;
    let mut file = AtomicFile::begin(path)?;
    file.write_all(new)?;
    file.file.sync_all()?;
    if !file.is_in_place() {
        is_old()?;
    }
    file.finish()
}

/// Whether a file may be written to. To rename another file over it needs no such permission, so a read-only file would be replaced.
fn is_writable(path: &Path) -> io::Result<()> {
    let old = path.metadata()?;
    if old.permissions().readonly() {
        return Err(io::ErrorKind::PermissionDenied.into());
    }
    if old.is_file() { File::options().append(true).open(path).map(drop) } else { Ok(()) }
}

/// A file that is written next to its destination and renamed when it is complete, or removed if it never is. A destination
/// that is not a regular file, such as a pipe or `/dev/null`, is written in place, and so is a file whose owner cannot be kept.
#[derive(Debug)]
pub(super) struct AtomicFile {
    file: File,
    /// The temporary file and the destination; `None` if it is written in place.
    part: Option<(PathBuf, PathBuf)>,
}

impl AtomicFile {
    /// Starts writing; links are followed. Owner, group and mode are kept.
    pub(super) fn begin(path: &Path) -> io::Result<Self> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let old = path.metadata().ok();
        if old.as_ref().is_some_and(|old| !old.is_file()) {
            return Ok(AtomicFile { file: open_in_place(&path)?, part: None });
        }
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.part", std::process::id()));
        let part = path.with_file_name(name);
        let file = File::create(&part)?;
        let new = AtomicFile { file, part: Some((part, path)) };
        match old.map(|old| new.becomes(&old)) {
            None | Some(Ok(true)) => Ok(new),
            Some(Err(error)) => Err(error),
            Some(Ok(false)) => {
                let Some((_, path)) = new.part.clone() else { return Ok(new) };
                let file = open_in_place(&path)?;
                file.set_len(0)?;
                Ok(AtomicFile { file, part: None })
            }
        }
    }

    /// Sets the mode, owner and group of another file; returns whether that was permitted.
    #[cfg(unix)]
    fn becomes(&self, old: &Metadata) -> io::Result<bool> {
        use std::os::unix::fs::{MetadataExt as _, fchown};
        let new = self.file.metadata()?;
        if (new.uid(), new.gid()) != (old.uid(), old.gid())
            && fchown(&self.file, Some(old.uid()), Some(old.gid())).is_err()
        {
            return Ok(false);
        }
        self.file.set_permissions(old.permissions())?;
        Ok(true)
    }

    /// A new file inherits the permissions of its folder.
    #[cfg(not(unix))]
    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "as on Unix")]
    fn becomes(&self, _: &Metadata) -> io::Result<bool> {
        Ok(true)
    }

    /// Whether it is written in place.
    pub(super) fn is_in_place(&self) -> bool {
        self.part.is_none()
    }

    /// Completes the file.
    pub(super) fn finish(mut self) -> io::Result<()> {
        let Some((part, path)) = &self.part else { return self.file.flush() };
        self.file.sync_all()?;
        std::fs::rename(part, path)?;
        self.part = None;
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if let Some((part, _)) = &self.part {
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Opens a file to write to it, without waiting for the reader of a named pipe.
#[cfg(target_os = "linux")]
pub(super) fn open_in_place(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt as _;

    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let file = File::options().write(true).create(true).truncate(false).custom_flags(flags).open(path)?;
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(file)
}

/// Opens a file to write to it.
#[cfg(not(target_os = "linux"))]
pub(super) fn open_in_place(path: &Path) -> io::Result<File> {
    File::options().write(true).create(true).truncate(false).open(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_has_changed_is_kept() {
        let path = std::env::temp_dir().join(format!("motionseq-replace-{}", std::process::id()));
        std::fs::write(&path, "saved by an editor").unwrap();
        let error = replace(&path, b"as read", b"corrected").unwrap_err();
        assert_eq!(error.to_string(), "it has changed since it was read");
        assert_eq!(std::fs::read(&path).unwrap(), b"saved by an editor");
        replace(&path, b"saved by an editor", b"corrected").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"corrected");
        std::fs::remove_file(&path).unwrap();
    }
}
