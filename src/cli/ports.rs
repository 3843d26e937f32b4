//! `motionseq ports`: lists the serial ports of this computer.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use motionseq::link::{BoardLikelihood, Obstacle, PortInfo, ports};
use serde::Serialize;

use super::exit::Exit;
use super::output;
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Human,
    Json,
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
        BoardLikelihood::Board => Some("probably the board".to_owned()),
        BoardLikelihood::Maybe => Some("the board, if it is connected by USB".to_owned()),
        _ => None,
    };
    let known: Vec<String> = likely.into_iter().chain(port.obstacle.as_ref().map(Obstacle::to_string)).collect();
    let line = format!("{}\t{}\t{}\t{}", port.path.display(), port.description, names.join(" "), known.join("; "));
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
    obstacle: Option<Why>,
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
        Port {
            path: port.path.display().to_string(),
            names: port.names.iter().map(|name| name.display().to_string()).collect(),
            description: port.description.clone(),
            board: match port.likely {
                BoardLikelihood::Board => "probably",
                BoardLikelihood::Maybe => "possibly",
                _ => "no",
            },
            obstacle: port.obstacle.as_ref().map(|obstacle| Why { kind: kind(obstacle), why: obstacle.to_string() }),
        }
    }
}

/// What to do if no port looks like the board.
pub(super) fn help(ports: &[PortInfo]) -> Option<String> {
    if ports.iter().any(|port| port.likely != BoardLikelihood::No) {
        return None;
    }
    let what = if ports.is_empty() { "no serial ports" } else { "none of these ports looks like the board" };
    Some(format!("{what}; {ENABLE}; on another computer, connect the board with a USB adapter"))
}

/// How to enable the port that the board is plugged onto.
const ENABLE: &str = "on a Raspberry Pi, enable the serial port with `sudo raspi-config` (Interface Options, Serial Port: login shell no, hardware yes) and restart";
