//! Files that results are written to.

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
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
    // Before it is opened: that alone would do something to a serial port.
    if path.metadata().is_ok_and(|meta| is_terminal(&meta)) {
        return Err(io::Error::other("it is a terminal or a serial port; name a file"));
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

/// Whether something is a terminal of any kind, serial ports included.
fn is_terminal(meta: &Metadata) -> bool {
    let (major, minor) = (rustix::fs::major(meta.rdev()), rustix::fs::minor(meta.rdev()));
    let class = || std::fs::read_link(format!("/sys/dev/char/{major}:{minor}/subsystem"));
    meta.file_type().is_char_device() && (PTYS.contains(&major) || class().is_ok_and(|class| class.ends_with("tty")))
}

/// The numbers of the drivers of pseudo-terminals, which the system does not list (Linux, devices.txt).
const PTYS: std::ops::RangeInclusive<u32> = 136..=143;

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
pub(super) fn create(path: &Path) -> io::Result<Created> {
    let is_new = path.symlink_metadata().is_err();
    let file = open(path, Path::new(""))?;
    let of_file = file.metadata()?;
    if of_file.is_file() && of_file.len() > 0 {
        return Err(io::Error::other("it is there already, and stays as it is; choose another name"));
    }
    Ok(Created { file, is_new })
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
