//! Output files: which paths may be written, and how failures are reported.

use std::fs::{File, Metadata};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use motionseq::source::Sources;

use super::atomic_file::AtomicFile;
use super::exit::Exit;
use super::screen::Screen;

/// For whom a command prints its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Text
    Human,
    /// One JSON object
    Json,
}

/// Whether an output may replace a file that motionseq did not write.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct Force {
    /// Overwrite a .motion or .frames file that motionseq did not write
    #[arg(long)]
    force: bool,
}

impl Force {
    /// Overwrite any file.
    #[cfg(target_os = "linux")]
    pub(super) const ALWAYS: Force = Force { force: true };
}

/// The files that a run reads, by identity rather than by name. No output overwrites one of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Inputs(Vec<Identity>);

/// What identifies a file: device and inode.
#[cfg(unix)]
type Identity = (u64, u64);
/// What identifies a file: its path, with links followed.
#[cfg(not(unix))]
type Identity = PathBuf;

#[cfg(unix)]
fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt as _;
    path.metadata().ok().map(|meta| (meta.dev(), meta.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<Identity> {
    path.canonicalize().ok()
}

impl Inputs {
    /// These files and their snapshots.
    pub(super) fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Self {
        let with_snapshot = |path: P| {
            let mut snapshot = path.as_ref().as_os_str().to_owned();
            snapshot.push(".frames");
            [path.as_ref().to_owned(), PathBuf::from(snapshot)]
        };
        Inputs(paths.into_iter().flat_map(with_snapshot).filter_map(|path| identity(&path)).collect())
    }

    /// A script and every file that it uses.
    pub(super) fn of_sources(sources: &Sources) -> Self {
        Inputs::of(sources.iter().filter_map(|source| source.path()))
    }
}

/// Starts an output that replaces an existing file when it is complete.
pub(super) fn whole(path: &Path, inputs: &Inputs, force: Force) -> io::Result<AtomicFile> {
    check(path, inputs, force)?;
    AtomicFile::begin(path)
}

/// Whether an output may be written to a path. Changes nothing.
pub(super) fn check(path: &Path, inputs: &Inputs, force: Force) -> io::Result<()> {
    let refused = |why: &str| Err(io::Error::other(why));
    if path.as_os_str() == "-" {
        return refused("`-` is no file here; name one");
    }
    let Ok(meta) = path.metadata() else { return Ok(()) };
    // Before it is opened: that alone would do something to a serial port.
    if is_terminal(&meta) {
        return refused("it is a terminal or a serial port; choose a file");
    }
    if meta.is_file() && identity(path).is_some_and(|file| inputs.0.contains(&file)) {
        return refused("this run reads it; choose another file");
    }
    let is_precious = path.extension().is_some_and(|ending| ending == "motion" || ending == "frames");
    if meta.is_file() && meta.len() > 0 && is_precious && !force.force && !is_ours(path) {
        return refused("it exists and was not written by motionseq; `--force` overwrites it");
    }
    Ok(())
}

/// Whether the first line of a file shows that motionseq wrote it.
pub(super) fn is_ours(path: &Path) -> bool {
    let mut first = Vec::new();
    let read = File::open(path).and_then(|file| file.take(64).read_to_end(&mut first));
    read.is_ok() && (first.starts_with(b"# motionseq frames") || first.starts_with(b"# Recorded by motionseq"))
}

/// Whether something is a terminal of any kind, serial ports included.
#[cfg(target_os = "linux")]
fn is_terminal(meta: &Metadata) -> bool {
    use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
    let (major, minor) = (rustix::fs::major(meta.rdev()), rustix::fs::minor(meta.rdev()));
    let class = || std::fs::read_link(format!("/sys/dev/char/{major}:{minor}/subsystem"));
    meta.file_type().is_char_device() && (PTYS.contains(&major) || class().is_ok_and(|class| class.ends_with("tty")))
}

/// The numbers of the drivers of pseudo-terminals, which the system does not list (Linux, devices.txt).
#[cfg(target_os = "linux")]
const PTYS: std::ops::RangeInclusive<u32> = 136..=143;

/// On other systems, terminals are not recognized.
#[cfg(not(target_os = "linux"))]
fn is_terminal(_: &Metadata) -> bool {
    false
}

/// Reports a failed write of a command's output, and returns the exit code.
pub(super) fn exit(written: io::Result<()>, path: Option<&Path>, screen: &Screen) -> Exit {
    match written {
        Ok(()) => Exit::Ok,
        // The reader closed the pipe early, as `head` does.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Exit::Ok,
        Err(error) => {
            let target = path.unwrap_or(Path::new("standard output"));
            screen.error(&format!("cannot write {}: {error}", target.display()));
            Exit::Usage
        }
    }
}
