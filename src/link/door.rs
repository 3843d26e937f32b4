//! A pseudo-terminal at a path of its own, for programs that open a serial port by its name.

use std::io;
use std::os::fd::OwnedFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::termios::{OptionalActions, QueueSelector};

use super::Pty;

/// Where Linux keeps pseudo-terminals. A link to anything else is not one of ours.
const TERMINALS: &str = "/dev/pts/";

/// What happens at a door.
#[derive(Clone, Copy, Debug)]
pub enum Happened<'a> {
    /// A program has opened the port.
    Opened,
    /// It has closed it, or has ended.
    Closed,
    /// Bytes of the program came, the first of them at this time, in nanoseconds from the start.
    Came(u64, &'a [u8]),
    /// The board has sent bytes to the program.
    Answered(&'a [u8]),
    /// The program sends more than the line carries: so many bytes wait, for so many microseconds.
    Behind(u64, u64),
    /// Some time has passed, at most a fiftieth of a second.
    Passed,
}

/// A pseudo-terminal, and a link to it, which goes when it goes. The link of one that was killed is replaced by the next.
#[derive(Debug)]
pub struct Door {
    pty: Pty,
    /// Where the link stands, and whether it does.
    link: PathBuf,
    /// Its name is taken as long as this process lives, and no longer, however it ends.
    _name: UnixListener,
}

/// Why there is no door at a path.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// Another process has its door there.
    #[error("another motionseq has its board at {}", .0.display())]
    Taken(PathBuf),
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
    /// Makes a pseudo-terminal with a link to it at `path`.
    pub fn open(path: &Path) -> Result<Self, DoorError> {
        let refused = |cause: io::Error| DoorError::Refused { path: path.to_owned(), cause };
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize(),
            _ => std::env::current_dir(),
        };
        let name = path.file_name().ok_or_else(|| refused(io::Error::other("a name is needed, such as /tmp/board")))?;
        let link = folder.map_err(refused)?.join(name);
        let own = SocketAddr::from_abstract_name([b"motionseq ", link.as_os_str().as_bytes()].concat());
        let own = own.and_then(|own| UnixListener::bind_addr(&own)).map_err(|error| match error.kind() {
            io::ErrorKind::AddrInUse => DoorError::Taken(path.to_owned()),
            _ => refused(error),
        })?;
        match link.symlink_metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(refused(error)),
            // Whoever made it does not live any more, or the name above would be taken.
            Ok(_) if link.read_link().is_ok_and(|target| target.starts_with(TERMINALS)) => {
                std::fs::remove_file(&link).map_err(refused)?;
            }
            Ok(_) => return Err(DoorError::InTheWay(path.to_owned())),
        }
        let pty = Pty::open().map_err(refused)?;
        pty.never_wait().map_err(refused)?;
        let door = Door { pty, link, _name: own };
        door.sweep().map_err(refused)?;
        std::os::unix::fs::symlink(door.pty.path(), &door.link).map_err(refused)?;
        Ok(door)
    }

    /// The board's end.
    pub fn pty(&self) -> &Pty {
        &self.pty
    }

    /// Throws away what a program has left behind, and sets the terminal as it was at first: the next one shall find a line in
    /// the state of a port that nobody had open.
    pub fn sweep(&self) -> io::Result<()> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC | OFlags::NONBLOCK;
        let near: OwnedFd = rustix::fs::open(self.pty.path(), flags, Mode::empty())?;
        let mut line = rustix::termios::tcgetattr(&near)?;
        line.make_raw();
        rustix::termios::tcsetattr(&near, OptionalActions::Now, &line)?;
        rustix::termios::tcflush(&near, QueueSelector::IOFlush)?;
        Ok(())
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        // Only its own: somebody may have put something else there.
        if self.link.read_link().is_ok_and(|target| target == self.pty.path()) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}
