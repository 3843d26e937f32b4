//! Files that results are written to.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use super::exit::Exit;
use super::screen::Screen;

/// Opens a file for a result that was made from `input`, and never `input` itself. What stands in it stays until
/// [`begin`]. Never waits for the reader of a named pipe.
pub(super) fn open(path: &Path, input: &Path) -> io::Result<File> {
    if path.as_os_str() == "-" {
        return Err(io::Error::other("`-` is no file here; name one"));
    }
    let file = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(false)
        .custom_flags(OFlags::NONBLOCK.bits().cast_signed())
        .open(path)?;
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    let (of_file, of_input) = (file.metadata()?, input.metadata());
    if of_input.is_ok_and(|of_input| (of_input.dev(), of_input.ino()) == (of_file.dev(), of_file.ino())) {
        return Err(io::Error::other("it is the script itself"));
    }
    Ok(file)
}

/// Makes a file for what cannot be made again. One that is there, with anything in it, stays as it is.
pub(super) fn create(path: &Path) -> io::Result<File> {
    let file = open(path, Path::new(""))?;
    let of_file = file.metadata()?;
    if of_file.is_file() && of_file.len() > 0 {
        return Err(io::Error::other("it is there already, and stays as it is; choose another name"));
    }
    Ok(file)
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

/// The exit code of a command whose result went to a file, or to standard output, and what is to be said about it.
pub(super) fn exit(written: io::Result<()>, path: Option<&Path>, screen: &Screen) -> Exit {
    match written {
        Ok(()) => Exit::Ok,
        // Whoever read it has seen enough.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Exit::Ok,
        Err(error) => {
            let target = path.unwrap_or(Path::new("standard output"));
            screen.error(&format!("cannot write {}: {error}", target.display()));
            Exit::Usage
        }
    }
}
