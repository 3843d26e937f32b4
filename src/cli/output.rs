//! Files that results are written to.

use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::source::{Replacement, Sources, open_in_place};

use super::exit::Exit;
use super::screen::Screen;

/// What a result may be written over.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct Force {
    /// Write over a .motion or .frames file that motionseq did not write
    #[arg(long)]
    force: bool,
}

/// The files that a run reads, by device and number, whatever their names. No result is written over one of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Inputs(Vec<(u64, u64)>);

impl Inputs {
    /// Files and, of scripts, their snapshots.
    pub(super) fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Self {
        let with_snapshot = |path: P| {
            let mut snapshot = path.as_ref().as_os_str().to_owned();
            snapshot.push(".frames");
            [path.as_ref().to_owned(), PathBuf::from(snapshot)]
        };
        let files = paths.into_iter().flat_map(with_snapshot).filter_map(|path| path.metadata().ok());
        Inputs(files.map(|meta| (meta.dev(), meta.ino())).collect())
    }

    /// A script and every file that it uses.
    pub(super) fn of_sources(sources: &Sources) -> Self {
        Inputs::of(sources.iter().filter_map(|source| source.path()))
    }
}

/// Opens a file for a result that grows while it is written. What is in it stays until [`begin`]. Never waits for the reader of a
/// named pipe.
pub(super) fn open(path: &Path, inputs: &Inputs, force: Force) -> io::Result<File> {
    check(path, inputs, force)?;
    open_in_place(path)
}

/// Begins a result that takes the place of what was there when it is whole.
pub(super) fn whole(path: &Path, inputs: &Inputs, force: Force) -> io::Result<Replacement> {
    check(path, inputs, force)?;
    Replacement::begin(path)
}

/// Whether a result may be written there, before anything of it is changed.
fn check(path: &Path, inputs: &Inputs, force: Force) -> io::Result<()> {
    let refused = |why: &str| Err(io::Error::other(why));
    if path.as_os_str() == "-" {
        return refused("`-` is no file here; name one");
    }
    let Ok(meta) = path.metadata() else { return Ok(()) };
    // Before it is opened: that alone would do something to a serial port.
    if is_terminal(&meta) {
        return refused("it is a terminal or a serial port; name a file");
    }
    if meta.is_file() && inputs.0.contains(&(meta.dev(), meta.ino())) {
        return refused("this run reads it; name another file");
    }
    let is_precious = path.extension().is_some_and(|ending| ending == "motion" || ending == "frames");
    if meta.is_file() && meta.len() > 0 && is_precious && !force.force && !is_ours(path) {
        return refused("it is there already, and motionseq did not write it; --force writes over it");
    }
    Ok(())
}

/// Whether the first line of a file says that motionseq has written it.
fn is_ours(path: &Path) -> bool {
    let mut first = Vec::new();
    let read = File::open(path).and_then(|file| file.take(64).read_to_end(&mut first));
    read.is_ok() && (first.starts_with(b"# motionseq frames") || first.starts_with(b"# Recorded by motionseq"))
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
pub(super) fn create(path: &Path, inputs: &Inputs) -> io::Result<Created> {
    let is_new = path.symlink_metadata().is_err();
    let file = open(path, inputs, Force { force: true })?;
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
