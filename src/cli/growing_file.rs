//! Files that grow during a run: recordings and logs.

use std::fs::{File, Metadata};
use std::io::{self, Write as _};
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use rustix::fs::FlockOperation;
use rustix::io::Errno;

use super::atomic_file::open_in_place;
use super::output::{Force, Inputs, check};
use super::screen::Screen;

/// Opens a file that grows while it is written. Its old content is kept until [`begin`]. Never waits for the reader of a named
/// pipe.
pub(super) fn open(path: &Path, inputs: &Inputs, force: Force) -> io::Result<File> {
    check(path, inputs, force)?;
    open_in_place(path)
}

/// A file for a result that cannot be produced again. Dropping it removes the file if it is new and still empty.
pub(super) struct Created {
    pub(super) file: File,
    path: PathBuf,
    /// Whether it did not exist before, and whether its name was chosen for it.
    is_new: bool,
    pub(super) is_named: bool,
}

impl Created {
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Created {
    fn drop(&mut self) {
        let is_it =
            |meta: &Metadata| self.file.metadata().is_ok_and(|own| (own.dev(), own.ino()) == (meta.dev(), meta.ino()));
        let is_empty = |meta: Metadata| meta.is_file() && meta.len() == 0 && is_it(&meta);
        if self.is_new && self.path.symlink_metadata().is_ok_and(is_empty) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Creates a file for a result that cannot be produced again. Refuses an existing file that is not empty, and one that another run
/// has just created.
pub(super) fn create(path: &Path, inputs: &Inputs) -> io::Result<Created> {
    let is_new = path.symlink_metadata().is_err();
    let file = open(path, inputs, Force::ALWAYS)?;
    let created = Created { file, path: path.to_owned(), is_new, is_named: false };
    let of_file = created.file.metadata()?;
    if of_file.is_file() && of_file.len() > 0 {
        return Err(io::Error::other("it exists and is not overwritten; choose another name"));
    }
    created.lock()
}

/// Creates a file that does not exist, with a name that was chosen for it.
pub(super) fn create_new(path: &Path) -> io::Result<Created> {
    let file = File::options().write(true).create_new(true).open(path)?;
    Created { file, path: path.to_owned(), is_new: true, is_named: true }.lock()
}

impl Created {
    /// Locks a regular file against other runs that could create it at the same time. A file system without locks has none.
    fn lock(mut self) -> io::Result<Self> {
        let is_file = self.file.metadata()?.is_file();
        match rustix::fs::flock(&self.file, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK) if is_file => {
                self.is_new = false;
                Err(io::Error::other("another run writes it; choose another name"))
            }
            _ => Ok(self),
        }
    }
}

/// The canonical path, even if there is no file yet.
pub(super) fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let by_folder = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(by_folder).unwrap_or_else(|| path.to_owned())
}

/// Whether several outputs may share this path, such as `/dev/null`.
pub(super) fn takes_everything(path: &Path) -> bool {
    path.metadata().is_ok_and(|meta| !meta.is_file())
}

/// Whether a path leads to an open file.
pub(super) fn is_at(path: &Path, file: &File) -> bool {
    let identity = |meta: Metadata| (meta.is_file(), meta.dev(), meta.ino());
    matches!((path.metadata().map(identity), file.metadata().map(identity)), (Ok(one), Ok(other)) if one.0 && one == other)
}

/// Discards the old content of a file.
pub(super) fn begin(file: &File) -> io::Result<()> {
    if file.metadata()?.is_file() { file.set_len(0) } else { Ok(()) }
}

/// A file that grows, with a tail that may still change. The file is complete at every moment, so that nothing is lost if the
/// program is killed or the power is cut. A pipe or a device gets only the settled bytes.
pub(super) struct GrowingFile {
    file: File,
    pub(super) is_file: bool,
    /// Its name in messages.
    name: String,
    screen: Screen,
    /// How many settled bytes are written, and the settled bytes that are not.
    at: u64,
    pending: Vec<u8>,
    /// The tail that is written.
    end: Vec<u8>,
    /// Bytes that replace settled ones, and their position.
    amendment: Option<(u64, Vec<u8>)>,
    /// Whether it may be longer than its content, and whether it may not be on the disk yet.
    is_uncut: bool,
    is_unsynced: bool,
    /// The error of the last write.
    failing: Option<String>,
}

impl GrowingFile {
    pub(super) fn new(file: File, name: String, screen: Screen) -> Self {
        let is_file = file.metadata().is_ok_and(|meta| meta.is_file());
        let (pending, end) = (Vec::new(), Vec::new());
        GrowingFile {
            file,
            is_file,
            name,
            screen,
            at: 0,
            pending,
            end,
            amendment: None,
            is_uncut: false,
            is_unsynced: false,
            failing: None,
        }
    }

    /// Its length without the tail, in bytes, once everything is written.
    pub(super) fn length(&self) -> u64 {
        self.at + self.pending() as u64
    }

    /// How many settled bytes are not written.
    pub(super) fn pending(&self) -> usize {
        self.pending.len()
    }

    /// Discards the bytes that are not written.
    #[cfg(feature = "mcap")]
    pub(super) fn forget(&mut self) {
        self.pending = Vec::new();
    }

    /// The error of the last write, if it failed.
    pub(super) fn failing(&self) -> Option<&str> {
        self.failing.as_deref()
    }

    /// Replaces settled bytes at a position by the same number of other bytes, with the next write.
    pub(super) fn amend(&mut self, at: u64, bytes: &[u8]) {
        self.amendment = Some((at, bytes.to_vec()));
    }

    /// Writes settled bytes and a tail that may change. If that fails, writes the tail `whole` instead, which completes the file,
    /// and tries again with the next write.
    pub(super) fn write(&mut self, settled: &[u8], end: &[u8], whole: &[u8]) {
        self.pending.extend_from_slice(settled);
        let result = if self.is_file { self.write_over(end, whole) } else { self.write_on() };
        let was_failing = self.failing.is_some();
        self.failing = result.err().map(|error| error.to_string());
        let GrowingFile { name, screen, .. } = self;
        match &self.failing {
            Some(error) if !was_failing => {
                screen.warning(&format!("cannot write {name}: {error}; retrying"));
            }
            None if was_failing => screen.note(&format!("writing {name} works again")),
            _ => {}
        }
    }

    /// Overwrites the last tail. If the new one is shorter, line feeds fill the rest until the file is truncated.
    fn write_over(&mut self, end: &[u8], whole: &[u8]) -> io::Result<()> {
        if let Some((at, bytes)) = &self.amendment {
            let waiting = at.checked_sub(self.at).and_then(|from| usize::try_from(from).ok());
            match waiting.and_then(|from| self.pending.get_mut(from..from + bytes.len())) {
                Some(place) => place.copy_from_slice(bytes),
                None => self.file.write_all_at(bytes, *at)?,
            }
            self.amendment = None;
        }
        if self.pending.is_empty() && end == self.end && !self.is_uncut {
            return self.sync();
        }
        let length = self.length() + end.len() as u64;
        let spare = (self.at + self.end.len() as u64).saturating_sub(length);
        let padding = vec![b'\n'; usize::try_from(spare).unwrap_or_default()];
        let text = [&self.pending, end, &padding].concat();
        if let Err(error) = self.file.write_all_at(&text, self.at) {
            // A partial write would damage the file.
            self.end.clear();
            self.is_uncut = true;
            self.file.set_len(self.at)?;
            if self.file.write_all_at(whole, self.at).is_ok() {
                self.end.extend_from_slice(whole);
            }
            return Err(error);
        }
        self.at = self.length();
        self.pending.clear();
        self.end = end.to_vec();
        self.is_uncut |= spare > 0;
        if self.is_uncut {
            self.file.set_len(length)?;
            self.is_uncut = false;
        }
        self.is_unsynced = true;
        self.sync()
    }

    /// Writes the file to the disk, because the power of a robot may be cut at any time.
    fn sync(&mut self) -> io::Result<()> {
        if self.is_unsynced {
            self.file.sync_data()?;
            self.is_unsynced = false;
        }
        Ok(())
    }

    /// Appends to a pipe or a device. Bytes that were written are not written again.
    fn write_on(&mut self) -> io::Result<()> {
        while !self.pending.is_empty() {
            match self.file.write(&self.pending) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => {
                    self.pending.drain(..count);
                    self.at += count as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
