//! `motionseq ports`: lists the serial ports of this computer.

use std::io::{self, Write};

use clap::Args;
use motionseq::link::{BoardLikelihood, PortInfo, ports};

use super::exit::Exit;
use super::output;
use super::screen::Screen;

/// List the serial ports and show which one looks like the board
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  motionseq ports")]
pub(super) struct Ports {}

impl Ports {
    /// Lists the ports on standard output, and on standard error what to do if none looks like the board.
    #[expect(clippy::unused_self, reason = "like every command")]
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
        let written = found.iter().try_for_each(|port| {
            let likely = match port.likely {
                BoardLikelihood::Board => "\tprobably the board",
                BoardLikelihood::Maybe => "\tthe board, if it is connected by USB",
                _ => "",
            };
            writeln!(out, "{}\t{}{likely}", port.path, port.description)
        });
        output::exit(written, None, screen)
    }
}

/// What to do if no port looks like the board.
fn help(ports: &[PortInfo]) -> Option<String> {
    if ports.iter().any(|port| port.likely != BoardLikelihood::No) {
        return None;
    }
    let what = if ports.is_empty() { "no serial ports" } else { "none of these ports looks like the board" };
    Some(format!("{what}; {ENABLE}; on another computer, connect the board with a USB adapter"))
}

/// How to enable the port that the board is plugged onto.
const ENABLE: &str = "on a Raspberry Pi, enable the serial port with `sudo raspi-config` (Interface Options, Serial Port: login shell no, hardware yes) and restart";

#[cfg(test)]
mod tests {
    use super::*;

    fn port(path: &str, likely: BoardLikelihood) -> PortInfo {
        PortInfo { path: path.to_owned(), description: String::new(), likely }
    }

    #[test]
    fn help_is_shown_only_if_no_port_looks_like_the_board() {
        assert!(help(&[]).unwrap().starts_with("no serial ports; "));
        let other = [port("/dev/ttyS0", BoardLikelihood::No)];
        assert!(help(&other).unwrap().starts_with("none of these ports looks like the board; "));
        for likely in [BoardLikelihood::Board, BoardLikelihood::Maybe] {
            assert_eq!(help(&[port("/dev/ttyS0", BoardLikelihood::No), port("/dev/tty1", likely)]), None);
        }
    }
}
