//! `motionseq ports`: the serial ports of this computer.

use std::io::{self, Write};

use clap::Args;
use motionseq::link::{Likely, ports};

use super::exit::Exit;
use super::output;
use super::screen::Screen;

/// List the serial ports, and say which one looks like the board
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  motionseq ports")]
pub(super) struct Ports {}

impl Ports {
    /// Lists them.
    #[expect(clippy::unused_self, reason = "like every command")]
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let found = match ports() {
            Ok(found) => found,
            Err(error) => {
                screen.error(&format!("cannot list the ports: {error}"));
                return Exit::Port;
            }
        };
        if found.is_empty() {
            screen.note(
                "there is no serial port; on a Raspberry Pi free it first: `sudo raspi-config`, Interface Options, Serial Port",
            );
        }
        let mut out = io::stdout().lock();
        let written = found.iter().try_for_each(|port| {
            let likely = match port.likely {
                Likely::Board => "\tprobably the board",
                Likely::Maybe => "\tthe board, if it hangs on USB",
                _ => "",
            };
            writeln!(out, "{}\t{}{likely}", port.path, port.description)
        });
        output::exit(written, None, screen)
    }
}
