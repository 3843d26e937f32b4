//! A pseudo-terminal with a link at a chosen path, for programs that open a serial port by its path.

use std::fs::Metadata;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io;
use std::os::fd::OwnedFd;
use std::os::linux::fs::MetadataExt as _;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::QueueSelector;

use super::{LineSettings, Pty};
use crate::units::{Micros, Nanos};

/// The folder of pseudo-terminals. A link to anything else is not ours.
const TERMINALS: &str = "/dev/pts/";

/// An event at a [`PtyLink`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum PortEvent<'a> {
    /// A program opened the port.
    Opened,
    /// The program closed the port, or ended.
    Closed,
    /// Bytes from the program, the first of them at this time from the start.
    Came(Nanos, &'a [u8]),
    /// Bytes from the board to the program.
    Answered(&'a [u8]),
    /// The program sends more than the line carries: the number of waiting bytes, and their delay.
    Behind(u64, Micros),
    /// The line settings of the program differ from those of the board.
    SetUp(LineSettings),
    /// At the end: the number of bytes from the program that could not be read.
    Unread(u64),
    /// Time has passed, at most 20 ms.
    Passed,
}

/// A pseudo-terminal and optionally a link to it, which is removed with it. A link left by a killed process is replaced.
#[derive(Debug)]
pub struct PtyLink {
    pty: Pty,
    link: Option<PathBuf>,
    /// Reserves the name until this process ends, however it ends.
    _name: Option<UnixListener>,
    /// The speed of the board's line.
    baud: u32,
}

/// Why a pseudo-terminal cannot be opened at a path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PtyLinkError {
    /// Another motionseq uses the path.
    #[error("another motionseq uses {}", .0.display())]
    Taken(PathBuf),
    /// The link of another running program is there.
    #[error("{} is the port of another program, which is running", .0.display())]
    Living(PathBuf),
    /// Something else exists there.
    #[error("{} exists and is not a link to a board", .0.display())]
    InTheWay(PathBuf),
    /// The system refused.
    #[error("{}: {cause}", path.display())]
    Refused {
        /// The path of the link.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl PtyLink {
    /// Creates a pseudo-terminal with a link to it at `path`, for a board with a line speed of `baud`.
    pub fn open(path: &Path, baud: u32) -> Result<Self, PtyLinkError> {
        let refused = |cause: io::Error| PtyLinkError::Refused { path: path.to_owned(), cause };
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize(),
            _ => std::env::current_dir(),
        };
        let name = path
            .file_name()
            .ok_or_else(|| refused(io::Error::other("it is not a file name; write one such as /tmp/board")))?;
        let link = folder.map_err(refused)?.join(name);
        let own =
            lock_name(&link).and_then(|own| UnixListener::bind_addr(&own)).map_err(|error| match error.kind() {
                io::ErrorKind::AddrInUse => PtyLinkError::Taken(path.to_owned()),
                _ => refused(error),
            })?;
        match link.symlink_metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(refused(error)),
            Ok(of_link) if link.read_link().is_ok_and(|target| target.starts_with(TERMINALS)) => {
                if leads_to_living(&link, &of_link) {
                    return Err(PtyLinkError::Living(path.to_owned()));
                }
            }
            Ok(_) => return Err(PtyLinkError::InTheWay(path.to_owned())),
        }
        let pty_link = PtyLink { pty: make_pty(baud).map_err(refused)?, link: Some(link), _name: Some(own), baud };
        pty_link.point_link().map_err(refused)?;
        Ok(pty_link)
    }

    /// A pseudo-terminal without a link.
    pub(crate) fn unnamed(pty: Pty) -> io::Result<Self> {
        pty.never_wait()?;
        let baud = pty.settings()?.baud;
        Ok(PtyLink { pty, link: None, _name: None, baud })
    }

    /// The line settings of the program, if they differ from those of the board.
    pub(crate) fn wrong_settings(&self) -> io::Result<Option<LineSettings>> {
        let settings = self.pty.settings()?;
        Ok((settings != LineSettings { baud: self.baud, stops: 1 }).then_some(settings))
    }

    /// The board's end.
    pub fn pty(&self) -> &Pty {
        &self.pty
    }

    /// Discards what a program has not read, and resets the terminal, so that the next program finds a fresh port. Keeps what the
    /// next program has already written.
    pub fn sweep(&mut self) -> io::Result<()> {
        let near = match rustix::fs::open(self.pty.path(), NEAR, Mode::empty()) {
            // A killed program left the terminal in exclusive mode. No program has it open any more.
            Err(Errno::BUSY) => {
                self.pty = make_pty(self.baud)?;
                return self.point_link();
            }
            near => near?,
        };
        let _ = rustix::termios::ioctl_tiocnxcl(&near);
        // Unless the next program has already opened and configured it.
        if self.pty.waiting()? == 0 {
            self.pty.set_up(self.baud)?;
        }
        rustix::termios::tcflush(&near, QueueSelector::IFlush)?;
        Ok(())
    }

    /// Points the link at the terminal, replacing an old link.
    fn point_link(&self) -> io::Result<()> {
        let Some(link) = &self.link else { return Ok(()) };
        let mut new = link.clone().into_os_string();
        new.push(format!(".{}", std::process::id()));
        let _ = std::fs::remove_file(&new);
        std::os::unix::fs::symlink(self.pty.path(), &new)?;
        std::fs::rename(&new, link).inspect_err(|_| {
            let _ = std::fs::remove_file(&new);
        })
    }
}

/// How the program's end is opened.
const NEAR: OFlags = OFlags::RDWR.union(OFlags::NOCTTY).union(OFlags::CLOEXEC).union(OFlags::NONBLOCK);

/// Creates a terminal and opens and closes the program's end once: before that, the system does not report its closing.
fn make_pty(baud: u32) -> io::Result<Pty> {
    let pty = Pty::open()?;
    pty.set_up(baud)?;
    pty.never_wait()?;
    let _near: OwnedFd = rustix::fs::open(pty.path(), NEAR, Mode::empty())?;
    Ok(pty)
}

/// The abstract name of a socket, which only one process can bind. A path that is too long is replaced by its hash.
fn lock_name(link: &Path) -> io::Result<SocketAddr> {
    let path = link.as_os_str().as_bytes();
    SocketAddr::from_abstract_name([b"motionseq ", path].concat()).or_else(|_| {
        let mut hash = DefaultHasher::new();
        path.hash(&mut hash);
        SocketAddr::from_abstract_name(format!("motionseq {:016x}", hash.finish()))
    })
}

/// Whether a link points to the terminal of a running program: one that is older than the link. A newer terminal only reuses the
/// number.
fn leads_to_living(link: &Path, of_link: &Metadata) -> bool {
    let made = |of: &Metadata| (of.st_ctime(), of.st_ctime_nsec());
    link.metadata().is_ok_and(|of_terminal| made(&of_terminal) <= made(of_link))
}

impl Drop for PtyLink {
    fn drop(&mut self) {
        // Only our own link: another program may have replaced it.
        if let Some(link) = &self.link
            && link.read_link().is_ok_and(|target| target == self.pty.path())
        {
            let _ = std::fs::remove_file(link);
        }
    }
}
