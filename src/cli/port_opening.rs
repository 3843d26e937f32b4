//! Opens the port of a command: at a path, or the one port that looks like the board, now or when it is there.

use std::io;
use std::os::fd::AsFd as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use motionseq::board::Board;
use motionseq::link::{BoardLikelihood, Obstacle, OpenError, PortInfo, Serial, obstacle, permission, port_at, ports};
use motionseq::playback::Signals;
use motionseq::units::{Micros, NotATime};
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::process::Signal;

use super::exit::Exit;
use super::ports::{CONNECT, line};
use super::screen::Screen;

/// The word for the port that looks like the board.
pub(super) const AUTO: &str = "auto";
/// How often a port that is not there is tried again.
const RETRY: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };
/// The longest time to wait for a port.
const LONGEST: Micros = Micros::from_millis(24 * 3_600_000);

/// Reads how long to wait for a port.
pub(super) fn wait(text: &str) -> Result<Micros, String> {
    let time: Micros = text.parse().map_err(|error: NotATime| error.to_string())?;
    if time <= LONGEST { Ok(time) } else { Err("too long; write 24h or less".to_owned()) }
}

/// A port that a command needs.
pub(super) struct PortRequest<'r> {
    /// Its path, or [`AUTO`].
    pub(super) path: &'r Path,
    /// What lines about it begin with: the robot, if the script names its robots.
    pub(super) robot: &'r str,
    /// What must be there.
    pub(super) board: &'r Board,
    /// The speed of the line in bits per second.
    pub(super) baud: u32,
    /// How long to wait if it cannot be opened now.
    pub(super) wait: Option<Micros>,
}

/// Opens a port. If it cannot be opened now and there is time to wait, tries again until then or until a signal ends the command;
/// a Ctrl-Z suspends it.
/// Returns its path, too. An open port is never opened again.
pub(super) fn open(request: &PortRequest<'_>, signals: &Signals, screen: &Screen) -> Result<(Serial, PathBuf), Exit> {
    let PortRequest { wait, robot, .. } = *request;
    let mut until = wait.map(|wait| Instant::now() + Duration::from_micros(wait.0));
    let mut is_told = false;
    loop {
        let refused = match try_open(request) {
            Ok(opened) => return Ok(opened),
            Err(refused) => refused,
        };
        let Some(until) = until.as_mut().filter(|until| refused.may_pass() && Instant::now() < **until) else {
            return Err(refused.report(robot, screen));
        };
        if !is_told {
            screen.note(&format!("{robot}{refused}; waiting up to {}", wait.unwrap_or_default().short()));
            is_told = true;
        }
        let left = until.saturating_duration_since(Instant::now());
        let left = Timespec::try_from(left).ok().filter(|left| *left < RETRY).unwrap_or(RETRY);
        let mut polled = [PollFd::from_borrowed_fd(signals.as_fd(), PollFlags::IN)];
        let _ = rustix::event::poll(&mut polled, Some(&left));
        match signals.take() {
            None => {}
            // A suspended command does not wait.
            Some(signal) if signal == Signal::TSTP.as_raw() => {
                let since = Instant::now();
                signals.suspend();
                *until += since.elapsed();
            }
            Some(signal) => {
                screen.error("ended while waiting for the port; nothing was sent");
                return Err(Exit::Signal(signal));
            }
        }
    }
}

fn try_open(request: &PortRequest<'_>) -> Result<(Serial, PathBuf), Refused> {
    let path = if request.path.as_os_str() == AUTO {
        choose(ports().map_err(Refused::NotListed)?, request.board)?
    } else {
        request.path.to_owned()
    };
    match Serial::open(&path, request.baud) {
        Ok(port) => Ok((port, path)),
        Err(error) => Err(Refused::NotOpened(path, error)),
    }
}

/// The one port that looks like the board. A Maestro identifies itself by USB. Any other board is on the pins of a Raspberry Pi, or
/// else at the only USB adapter. If the system itself uses the pins, an adapter is not the board: it may be a printer or another robot.
fn choose(ports: Vec<PortInfo>, board: &Board) -> Result<PathBuf, Refused> {
    let words = |line: &str, count| line.split(' ').take(count).map(str::to_owned).collect::<Vec<_>>();
    if words(&board.line, 1) == [KNOWN_BY_USB] {
        // One with the same number of channels, or else any.
        for count in [2, 1] {
            let is_it = |port: &&PortInfo| {
                port.family.as_ref().is_some_and(|family| words(family, count) == words(&board.line, count))
            };
            match ports.iter().filter(is_it).collect::<Vec<_>>().as_slice() {
                [] => {}
                [one] => return Ok(one.path.clone()),
                _ => return Err(Refused::Several(ports)),
            }
        }
        return Err(Refused::None(ports, NO_MAESTRO));
    }
    for likely in [BoardLikelihood::Board, BoardLikelihood::Maybe] {
        let found = || ports.iter().filter(|port| port.likely == likely);
        let free: Vec<&PortInfo> = found().filter(|port| !is_of_system(port.obstacle.as_ref())).collect();
        match (free.as_slice(), found().next()) {
            ([one], _) => return Ok(one.path.clone()),
            ([], Some(pins)) if likely == BoardLikelihood::Board => {
                return Err(Refused::OfSystem(Box::new(pins.clone())));
            }
            ([], _) => {}
            _ => return Err(Refused::Several(ports)),
        }
    }
    Err(Refused::None(ports, CONNECT))
}

/// The family of boards that say by USB what they are.
const KNOWN_BY_USB: &str = "maestro";
/// How to get a port with such a board.
const NO_MAESTRO: &str = "connect the Maestro by USB, or write its port, such as `--port PATH`";

/// Whether the system itself uses a port, which does not end by itself.
fn is_of_system(obstacle: Option<&Obstacle>) -> bool {
    matches!(obstacle, Some(Obstacle::Bluetooth | Obstacle::Console | Obstacle::Login(_)))
}

/// Why no port was opened.
enum Refused {
    NotOpened(PathBuf, OpenError),
    NotListed(io::Error),
    /// The port on the pins is used by the system itself.
    OfSystem(Box<PortInfo>),
    /// Several ports look like the board; all ports.
    Several(Vec<PortInfo>),
    /// None does; all ports, and what to do.
    None(Vec<PortInfo>, &'static str),
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Refused::NotOpened(path, error) => write!(f, "cannot open port {}: {error}", path.display()),
            Refused::NotListed(error) => write!(f, "cannot list the ports: {error}"),
            Refused::OfSystem(port) => {
                let why = port.obstacle.as_ref().map(Obstacle::to_string).unwrap_or_default();
                write!(f, "`--port auto`: {}, the port on the pins: {why}", port.path.display())
            }
            Refused::Several(_) => f.write_str("`--port auto`: several ports look like the board"),
            Refused::None(..) => f.write_str("`--port auto`: no port looks like the board"),
        }
    }
}

impl Refused {
    /// Whether this may be different later: at boot, a port appears first and gets its group then.
    fn may_pass(&self) -> bool {
        match self {
            Refused::NotOpened(_, error) => {
                matches!(error, OpenError::Missing | OpenError::InUse | OpenError::Forbidden | OpenError::Other(_))
            }
            Refused::NotListed(_) | Refused::OfSystem(_) => false,
            Refused::Several(_) | Refused::None(..) => true,
        }
    }

    /// Reports it, and what to do.
    fn report(&self, name: &str, screen: &Screen) -> Exit {
        match self {
            Refused::NotOpened(path, error) => refused(name, screen, path, error),
            Refused::NotListed(_) | Refused::OfSystem(_) => {
                screen.error(&format!("{name}{self}; nothing was sent"));
                Exit::Port
            }
            Refused::Several(ports) | Refused::None(ports, _) => {
                let more = match self {
                    Refused::None(_, connect) => connect,
                    _ => "write the port of the board, such as `--port PATH`",
                };
                screen.error(&format!("{name}{self}; nothing was sent; {more}"));
                for port in ports {
                    screen.ask(&line(port));
                }
                Exit::Port
            }
        }
    }
}

/// Reports why a port cannot be opened, and what to do.
fn refused(name: &str, screen: &Screen, path: &Path, error: &OpenError) -> Exit {
    let found = obstacle(path);
    let help = match (error, &found) {
        (OpenError::Missing, _) => {
            "list the ports with `motionseq ports`; on a Raspberry Pi, try `--port /dev/serial0`".to_owned()
        }
        (OpenError::InUse, Some(Obstacle::InUse(Some(owner)))) => {
            format!("close {owner} (a suspended motionseq is listed by `jobs`)")
        }
        (OpenError::InUse, _) => "close that program (a suspended motionseq is listed by `jobs`)".to_owned(),
        (OpenError::Forbidden, _) => forbidden(permission(path).as_ref(), found.as_ref()),
        (OpenError::NotAPort | OpenError::OwnTerminal | OpenError::NoPeer, _) => {
            "write the port of the board, such as `--port /dev/serial0`".to_owned()
        }
        _ => "check the cable and the port".to_owned(),
    };
    screen.error(&format!("{name}cannot open port {}: {error}; nothing was sent; {help}", path.display()));
    match error {
        OpenError::InUse => Exit::InUse,
        _ => Exit::Port,
    }
}

/// How to get the permission for a port, and what else is in the way.
fn forbidden(permission: Option<&Obstacle>, obstacle: Option<&Obstacle>) -> String {
    let help = permission.map_or_else(|| "you may not read the folder of the port".to_owned(), Obstacle::to_string);
    let help = help.trim_start_matches("permission denied: ");
    match obstacle.filter(|obstacle| is_of_system(Some(obstacle))) {
        Some(also) => format!("{help}; the port is also not free: {also}"),
        None => help.to_owned(),
    }
}

/// Warns if a port that was opened is probably not the board.
pub(super) fn doubt(path: &Path, screen: &Screen) {
    let found = port_at(path).and_then(|port| port.obstacle);
    if let Some(why) = found.filter(|why| is_of_system(Some(why))) {
        screen.warning(&format!("{}: {why}", path.display()));
    }
}

#[cfg(test)]
mod tests;
