//! Writes snapshots.

use std::io::{self, Write};

use super::super::listing::{Item, ROBOT, write_gate, write_line, write_moment};
use super::super::tween::{MoveTracker, StepRole};
use super::super::{Timeline, Tween};
use super::{ABORT, END, FAMILY, FRAMES, MAGIC, MOVE, Moment, STOP, VERSION, is_from_file, stop_of};
use crate::board::Board;
use crate::units::Micros;

/// Writes the snapshot of the script `name`: what all of its robots do.
pub fn write_snapshot(name: &str, timelines: &[Timeline], out: &mut impl Write) -> io::Result<()> {
    write_title(name, out)?;
    timelines.iter().try_for_each(|timeline| write_board(timeline.robot.as_deref(), &timeline.board, out))?;
    timelines.iter().try_for_each(|timeline| {
        timeline.robot.as_ref().map_or(Ok(()), |robot| writeln!(out, "{FRAMES}{robot}"))?;
        write_section(timeline, out)
    })
}

/// Writes what one robot does.
fn write_section(timeline: &Timeline, out: &mut impl Write) -> io::Result<()> {
    let mut tracker = MoveTracker::new(&timeline.board, &timeline.tweens);
    let mut bytes = Vec::new();
    for item in timeline.items() {
        let event = match item {
            Item::Event(event) => event,
            Item::Gate(gate) => {
                write_gate(gate, out)?;
                continue;
            }
        };
        if let StepRole::First(Tween { at, end, ease, steps }) = tracker.take(&event.command, event.kind) {
            writeln!(out, "{MOVE}{at:.6}\t{end:.6}\t{}\t{steps}", ease.name())?;
        }
        write_line(timeline, event, &mut bytes, out)?;
    }
    if !timeline.abort.is_empty() {
        writeln!(out, "{ABORT}")?;
    }
    for event in &timeline.abort {
        write_line(timeline, event, &mut bytes, out)?;
    }
    let count = timeline.events.len() + timeline.abort.len();
    writeln!(out, "{END}{:.6}\tframes\t{count}\tbaud\t{}", timeline.end, timeline.baud)
}

/// Writes a snapshot of the frames that are sent if something ends a run early.
pub(crate) fn write_aborted(name: &str, robots: &[(&Timeline, &[Moment])], out: &mut impl Write) -> io::Result<()> {
    write_title(name, out)?;
    robots.iter().try_for_each(|(timeline, _)| write_board(timeline.robot.as_deref(), &timeline.board, out))?;
    let mut bytes = Vec::new();
    robots.iter().try_for_each(|(Timeline { robot, board, baud, .. }, moments)| {
        let robot = robot.as_deref();
        robot.map_or(Ok(()), |robot| writeln!(out, "{FRAMES}{robot}"))?;
        for moment in *moments {
            write_moment(board, (moment.at, &moment.command, moment.kind), robot, &mut bytes, out)?;
        }
        let end = moments.last().map_or(Micros::ZERO, |moment| moment.at);
        writeln!(out, "{END}{end:.6}\tframes\t{}\tbaud\t{baud}", moments.len())
    })
}

/// Writes the version and the name of the script.
fn write_title(name: &str, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{MAGIC}{VERSION}\n# {}", name.replace(['\r', '\n'], " "))
}

/// Writes the board of a robot.
fn write_board(robot: Option<&str>, board: &Board, out: &mut impl Write) -> io::Result<()> {
    match robot {
        None => writeln!(out, "{FAMILY}{}", board.line)?,
        Some(robot) => writeln!(out, "{ROBOT}{robot}\t{}", board.line)?,
    }
    // The stop of a built-in family does not change with a file of the user.
    if is_from_file(board) { writeln!(out, "{STOP}{}", stop_of(board)) } else { Ok(()) }
}
