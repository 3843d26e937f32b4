//! Files that grow while a run goes on: recordings and logs.

use std::fs::{File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use super::output::{Force, Inputs, check};
use super::replace::open_in_place;

/// Opens a file for a result that grows while it is written. What is in it stays until [`begin`]. Never waits for the reader of a
/// named pipe.
pub(super) fn open(path: &Path, inputs: &Inputs, force: Force) -> io::Result<File> {
    check(path, inputs, force)?;
    open_in_place(path)
}

/// A file that was made for what cannot be made again.
pub(super) struct Created {
    pub(super) file: File,
    /// Whether it was not there before.
    is_new: bool,
}

impl Created {
    /// Takes the file away again where this run has made it, and nothing was written.
    pub(super) fn undo(self, path: &Path) {
        let is_it =
            |meta: &Metadata| self.file.metadata().is_ok_and(|own| (own.dev(), own.ino()) == (meta.dev(), meta.ino()));
        if self.is_new && path.symlink_metadata().is_ok_and(|meta| meta.is_file() && meta.len() == 0 && is_it(&meta)) {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Makes a file for what cannot be made again. One that is there, with anything in it, stays as it is.
pub(super) fn create(path: &Path, inputs: &Inputs) -> io::Result<Created> {
    let is_new = path.symlink_metadata().is_err();
    let file = open(path, inputs, Force::ALWAYS)?;
    let of_file = file.metadata()?;
    if of_file.is_file() && of_file.len() > 0 {
        return Err(io::Error::other("it is there already, and stays as it is; choose another name"));
    }
    Ok(Created { file, is_new })
}

/// Where a path leads, also where nothing is there yet.
pub(super) fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let by_folder = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(by_folder).unwrap_or_else(|| path.to_owned())
}

/// Whether any number of results may go there, such as to `/dev/null`.
pub(super) fn takes_everything(path: &Path) -> bool {
    path.metadata().is_ok_and(|meta| !meta.is_file())
}

/// Whether two open files are one.
pub(super) fn is_same(left: &File, right: &File) -> bool {
    let identity = |file: &File| file.metadata().map(|meta| (meta.is_file(), meta.dev(), meta.ino()));
    matches!((identity(left), identity(right)), (Ok(left), Ok(right)) if left.0 && left == right)
}

/// Throws away what stood in the file before.
pub(super) fn begin(file: &File) -> io::Result<()> {
    if file.metadata()?.is_file() { file.set_len(0) } else { Ok(()) }
}
