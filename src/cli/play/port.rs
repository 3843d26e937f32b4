//! The port that a run is played on: a real one, or that of the built-in virtual board.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Arc;

use motionseq::faults::{Faults, Faulty};
use motionseq::link::{OpenError, Pty, Serial};
use motionseq::serve::BoardThread;
use motionseq::sim::{Device, Settings};
use motionseq::timeline::Timeline;

use super::super::exit::Exit;
use super::super::project::{ChosenPort, ValueSource};
use super::super::screen::Screen;

/// An open port, and the virtual board at its other end if there is one.
pub(super) struct Port {
    pub(super) link: Serial,
    pub(super) board: Option<BoardThread>,
}

impl Port {
    pub(super) fn open(
        chosen: &ChosenPort,
        timeline: &Timeline,
        faults: Faults,
        screen: &Screen,
    ) -> Result<Self, Exit> {
        let Timeline { board, baud, .. } = timeline;
        let origin = chosen.origin();
        if let Some(path) = &chosen.path {
            let link = Serial::open(path, *baud).map_err(|error| refused(screen, path, &error))?;
            screen.note(&format!("playing on {}{origin}", path.display()));
            return Ok(Port { link, board: None });
        }
        let pty = Pty::open().map_err(|error| system(screen, &error))?;
        // Opened by its path, like a real port.
        let link = Serial::open(pty.path(), *baud).map_err(|error| refused(screen, pty.path(), &error))?;
        screen.note(&match chosen.source {
            ValueSource::Default => "no --port: playing on the built-in virtual board".to_owned(),
            _ => format!("playing on the built-in virtual board{origin}"),
        });
        let board = Faulty::new(Device::new(Arc::clone(board), Settings::default()), faults);
        let board = BoardThread::start(board, pty, *baud).map_err(|error| system(screen, &error))?;
        Ok(Port { link, board: Some(board) })
    }
}

/// Reports that the system refused something that a run needs.
pub(super) fn system(screen: &Screen, error: &io::Error) -> Exit {
    screen.error(&format!("cannot play: {error}; nothing was sent"));
    Exit::Port
}

/// Reports why a port cannot be opened, and what to do.
pub(in super::super) fn refused(screen: &Screen, path: &Path, error: &OpenError) -> Exit {
    let help = match error {
        OpenError::Missing => {
            "list the ports with `motionseq ports`; on a Raspberry Pi, try `--port /dev/serial0`".to_owned()
        }
        OpenError::InUse => "close that program (a suspended motionseq is listed by `jobs`)".to_owned(),
        OpenError::Forbidden => permission(path),
        OpenError::NotAPort | OpenError::OwnTerminal | OpenError::NoPeer => {
            "write the port of the board, such as `--port /dev/serial0`".to_owned()
        }
        _ => "check the cable and the port".to_owned(),
    };
    screen.error(&format!("cannot open port {}: {error}; nothing was sent; {help}", path.display()));
    match error {
        OpenError::InUse => Exit::InUse,
        _ => Exit::Port,
    }
}

/// How to get permission to open a port: by joining the group of its device, if the group may open it.
fn permission(path: &Path) -> String {
    let Ok(meta) = path.metadata() else {
        return "you may not read the folder of the port".to_owned();
    };
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(meta.gid())).then(|| name.to_owned())
    });
    match name {
        Some(name) if meta.mode() & 0o060 == 0o060 && meta.gid() != 0 => {
            format!("run `sudo usermod -aG {name} $USER`, then log out and log in again")
        }
        _ => "only its owner may open it; a udev rule with GROUP=\"dialout\", MODE=\"0660\" permits it for that group"
            .to_owned(),
    }
}
