//! `motionseq ports`: lists the serial ports of this computer.

use std::io::{self, Write};

use clap::Args;
use motionseq::diagnostic::escaped;
use motionseq::link::{BoardLikelihood, Obstacle, PortInfo, ports};
use serde::Serialize;

use super::exit::Exit;
use super::output::{self, Format};
use super::screen::Screen;

/// List the serial ports and show which one looks like the board
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq ports\n  motionseq ports --format json\n\nEach line has the path of a port, its description, its other names, and what is known about it, separated by tabs.\nThe names in /dev/serial/by-id stay the same when an adapter is plugged in again. No port is opened."
)]
pub(super) struct Ports {
    /// Choose the format of the list
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

impl Ports {
    /// Lists the ports on standard output, and on standard error what to do if none looks like the board.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let found = match ports() {
            Ok(found) => found,
            Err(error) => {
                screen.error(&format!("cannot list the ports: {error}"));
                return Exit::Port;
            }
        };
        if let Some(help) = help(&found) {
            screen.note(&help);
        }
        let mut out = io::stdout().lock();
        let written = match self.format {
            Format::Human => found.iter().try_for_each(|port| writeln!(out, "{}", line(port))),
            Format::Json => {
                let list = List { version: 1, ports: found.iter().map(Port::from).collect() };
                serde_json::to_writer_pretty(&mut out, &list).map_err(Into::into).and_then(|()| writeln!(out))
            }
        };
        output::exit(written, None, screen)
    }
}

/// A port on one line, separated by tabs.
pub(super) fn line(port: &PortInfo) -> String {
    let names: Vec<String> = port.names.iter().map(|name| name.display().to_string()).collect();
    let likely = match port.likely {
        _ if let Some(family) = &port.family => Some(format!("probably a Maestro: `board {family}`")),
        BoardLikelihood::Board => Some("probably the board".to_owned()),
        BoardLikelihood::Maybe => Some("the board, if it is connected by USB".to_owned()),
        _ => None,
    };
    // The permission may be the obstacle itself.
    let permission = port.permission.as_ref().filter(|permission| port.obstacle.as_ref() != Some(permission));
    let obstacles = port.obstacle.iter().chain(permission).map(Obstacle::to_string);
    let known: Vec<String> = likely.into_iter().chain(obstacles).collect();
    let columns = [port.path.display().to_string(), port.description.clone(), names.join(" "), known.join("; ")];
    // A device describes itself, and its words could move the cursor or make a column.
    let line = columns.map(|column| escaped(&column).replace('\t', "\\t")).join("\t");
    line.trim_end_matches('\t').to_owned()
}

/// The list as JSON. Fields may be added; existing ones never change their meaning.
#[derive(Serialize)]
struct List {
    version: u32,
    ports: Vec<Port>,
}

#[derive(Serialize)]
struct Port {
    path: String,
    names: Vec<String>,
    description: String,
    board: &'static str,
    family: Option<String>,
    obstacle: Option<Why>,
    permission: Option<Why>,
}

#[derive(Serialize)]
struct Why {
    kind: &'static str,
    why: String,
}

impl From<&PortInfo> for Port {
    fn from(port: &PortInfo) -> Self {
        let kind = |obstacle: &Obstacle| match obstacle {
            Obstacle::Bluetooth => "bluetooth",
            Obstacle::Console => "console",
            Obstacle::Login(_) => "login",
            Obstacle::InUse(_) => "in-use",
            Obstacle::Forbidden(_) => "forbidden",
            _ => "other",
        };
        let why = |obstacle: &Obstacle| Why { kind: kind(obstacle), why: obstacle.to_string() };
        Port {
            path: port.path.display().to_string(),
            names: port.names.iter().map(|name| name.display().to_string()).collect(),
            description: port.description.clone(),
            board: match port.likely {
                BoardLikelihood::Board => "probably",
                BoardLikelihood::Maybe => "possibly",
                _ => "no",
            },
            family: port.family.clone(),
            obstacle: port.obstacle.as_ref().map(why),
            permission: port.permission.as_ref().map(why),
        }
    }
}

/// What to do if no port looks like the board.
pub(super) fn help(ports: &[PortInfo]) -> Option<String> {
    if ports.iter().any(|port| port.likely != BoardLikelihood::No || port.family.is_some()) {
        return None;
    }
    let what = if ports.is_empty() { "no serial ports" } else { "none of these ports looks like the board" };
    Some(format!("{what}; {CONNECT}"))
}

/// How to get a port with the board.
pub(super) const CONNECT: &str = "on a Raspberry Pi, enable the serial port with `sudo raspi-config` (Interface Options, Serial Port: login shell no, hardware yes) and restart; on another computer, connect the board with a USB adapter";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_device_stay_in_their_column() {
        let mut port = PortInfo::new("/dev/ttyUSB0", BoardLikelihood::No, Some(Obstacle::InUse(None)));
        port.description = "USB \u{1b}[2J\tx\ny".to_owned();
        assert_eq!(line(&port), "/dev/ttyUSB0\tUSB \\u{1b}[2J\\tx\\ny\t\tin use");
    }

    #[test]
    fn a_maestro_shows_the_line_of_a_script() {
        let mut port = PortInfo::new("/dev/ttyACM0", BoardLikelihood::No, None);
        port.description = "Pololu Maestro 12, Command Port".to_owned();
        port.family = Some("maestro 12".to_owned());
        let shown = "/dev/ttyACM0\tPololu Maestro 12, Command Port\t\tprobably a Maestro: `board maestro 12`";
        assert_eq!(line(&port), shown);
        let json = serde_json::to_value(Port::from(&port)).unwrap();
        assert_eq!((&json["board"], &json["family"]), (&"no".into(), &"maestro 12".into()));
    }

    #[test]
    fn a_console_that_is_forbidden_shows_both() {
        let permission = Some(Obstacle::Forbidden(Some("dialout".to_owned())));
        let mut port = PortInfo::new("/dev/ttyS0", BoardLikelihood::Board, Some(Obstacle::Console));
        port.permission.clone_from(&permission);
        let both = line(&port);
        assert!(both.contains("the console of the system") && both.contains("usermod -aG dialout $USER"), "{both}");
        port.obstacle = permission;
        assert_eq!(line(&port).matches("usermod").count(), 1);
    }
}
