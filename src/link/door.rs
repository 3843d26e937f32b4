//! A pseudo-terminal at a path of its own, for programs that open a serial port by its name.

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

/// Where Linux keeps pseudo-terminals. A link to anything else is not one of ours.
const TERMINALS: &str = "/dev/pts/";

/// What happens at a door.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum PortEvent<'a> {
    /// A program has opened the port.
    Opened,
    /// It has closed it, or has ended.
    Closed,
    /// Bytes of the program came, the first of them at this time from the start.
    Came(Nanos, &'a [u8]),
    /// The board has sent bytes to the program.
    Answered(&'a [u8]),
    /// The program sends more than the line carries: how many bytes wait, and for how long.
    Behind(u64, Micros),
    /// The program has set its line up otherwise than the board's.
    SetUp(LineSettings),
    /// At the end: how many bytes that the program had written could not be read.
    Unread(u64),
    /// Some time has passed, at most a fiftieth of a second.
    Passed,
}

/// A pseudo-terminal, and perhaps a link to it, which goes when it goes. The link of one that was killed is replaced by the next.
#[derive(Debug)]
pub struct Door {
    pty: Pty,
    link: Option<PathBuf>,
    /// Its name is taken as long as this process lives, and no longer, however it ends.
    _name: Option<UnixListener>,
    /// The speed of the board's line.
    baud: u32,
}

/// Why there is no door at a path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DoorError {
    /// Another process has its door there.
    #[error("another motionseq has its board at {}", .0.display())]
    Taken(PathBuf),
    /// The link of another program, which still runs, is there.
    #[error("{} leads to a port of a program that still runs", .0.display())]
    Living(PathBuf),
    /// Something else stands there, which is left alone.
    #[error("{} is there already, and is no link to a board", .0.display())]
    InTheWay(PathBuf),
    /// The system refuses it.
    #[error("{}: {cause}", path.display())]
    Refused {
        /// The path of the link.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

impl Door {
    /// Makes a pseudo-terminal with a link to it at `path`, for a board whose line has a speed of `baud`.
    pub fn open(path: &Path, baud: u32) -> Result<Self, DoorError> {
        let refused = |cause: io::Error| DoorError::Refused { path: path.to_owned(), cause };
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize(),
            _ => std::env::current_dir(),
        };
        let name = path.file_name().ok_or_else(|| refused(io::Error::other("a name is needed, such as /tmp/board")))?;
        let link = folder.map_err(refused)?.join(name);
        let own =
            lock_name(&link).and_then(|own| UnixListener::bind_addr(&own)).map_err(|error| match error.kind() {
                io::ErrorKind::AddrInUse => DoorError::Taken(path.to_owned()),
                _ => refused(error),
            })?;
        match link.symlink_metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(refused(error)),
            Ok(of_link) if link.read_link().is_ok_and(|target| target.starts_with(TERMINALS)) => {
                if leads_to_living(&link, &of_link) {
                    return Err(DoorError::Living(path.to_owned()));
                }
            }
            Ok(_) => return Err(DoorError::InTheWay(path.to_owned())),
        }
        let door = Door { pty: make_pty(baud).map_err(refused)?, link: Some(link), _name: Some(own), baud };
        door.point_link().map_err(refused)?;
        Ok(door)
    }

    /// A pseudo-terminal without a link, which whoever shall open it is told.
    pub(crate) fn unnamed(pty: Pty) -> io::Result<Self> {
        pty.never_wait()?;
        let baud = pty.settings()?.baud;
        Ok(Door { pty, link: None, _name: None, baud })
    }

    /// How the program has set the line up, where that is not as the board's.
    pub(crate) fn wrong_settings(&self) -> io::Result<Option<LineSettings>> {
        let settings = self.pty.settings()?;
        Ok((settings != LineSettings { baud: self.baud, stops: 1 }).then_some(settings))
    }

    /// The board's end.
    pub fn pty(&self) -> &Pty {
        &self.pty
    }

    /// Throws away what a program has not read, and sets the terminal as it was at first: the next one shall find a line in the state of
    /// a port that nobody had open. What that one has written already stays.
    pub fn sweep(&mut self) -> io::Result<()> {
        let near = match rustix::fs::open(self.pty.path(), NEAR, Mode::empty()) {
            // A program that was killed had it to itself, and the mark of that stays. Nobody has this terminal open any more.
            Err(Errno::BUSY) => {
                self.pty = make_pty(self.baud)?;
                return self.point_link();
            }
            near => near?,
        };
        let _ = rustix::termios::ioctl_tiocnxcl(&near);
        // Not where the next program may have opened it already, and set it up for itself.
        if self.pty.waiting()? == 0 {
            self.pty.set_up(self.baud)?;
        }
        rustix::termios::tcflush(&near, QueueSelector::IFlush)?;
        Ok(())
    }

    /// Lets the link lead to the terminal, in the place of one that is there.
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

/// How the end of a program is opened.
const NEAR: OFlags = OFlags::RDWR.union(OFlags::NOCTTY).union(OFlags::CLOEXEC).union(OFlags::NONBLOCK);

/// A terminal that a program has had open: before the first, the system tells nothing of its end.
fn make_pty(baud: u32) -> io::Result<Pty> {
    let pty = Pty::open()?;
    pty.set_up(baud)?;
    pty.never_wait()?;
    let _near: OwnedFd = rustix::fs::open(pty.path(), NEAR, Mode::empty())?;
    Ok(pty)
}

/// The abstract name of a socket that only one process can have. A path that is too long for one is named by its hash.
fn lock_name(link: &Path) -> io::Result<SocketAddr> {
    let path = link.as_os_str().as_bytes();
    SocketAddr::from_abstract_name([b"motionseq ", path].concat()).or_else(|_| {
        let mut hash = DefaultHasher::new();
        path.hash(&mut hash);
        SocketAddr::from_abstract_name(format!("motionseq {:016x}", hash.finish()))
    })
}

/// Whether a link leads to a terminal of a program that still runs: one that was made before the link. A terminal that was made later has
/// only got the number of the one that the link was made for.
fn leads_to_living(link: &Path, of_link: &Metadata) -> bool {
    let made = |of: &Metadata| (of.st_ctime(), of.st_ctime_nsec());
    link.metadata().is_ok_and(|of_terminal| made(&of_terminal) <= made(of_link))
}

impl Drop for Door {
    fn drop(&mut self) {
        // Only its own: somebody may have put something else there.
        if let Some(link) = &self.link
            && link.read_link().is_ok_and(|target| target == self.pty.path())
        {
            let _ = std::fs::remove_file(link);
        }
    }
}
