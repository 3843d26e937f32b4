//! What the Maestro answers: two bytes of a position or of errors, one byte that says whether a servo moves.

use super::{MOVING_ROW, verb};
use crate::board::{Answer, Answers, Command, Hundredths, Report, ReportItem};
use crate::units::Nanos;

pub(super) const ANSWERS: Answers =
    Answers { has_answer, read, length: 8, patience: Nanos::from_millis(50), errors, hint: HINT };

const HINT: &str = "a new Maestro ignores its Command Port until its serial mode is \"USB Dual Port\" or \"USB Chained\" \
    (Maestro Control Center, Serial Settings); a board with only its RX wired cannot answer";

/// The meanings of the error bits, the lowest first.
const ERRORS: [&str; 9] = [
    "a serial signal error",
    "a serial overrun",
    "a full serial buffer",
    "a wrong CRC",
    "a serial protocol error",
    "a serial timeout",
    "an error of the stack of its script",
    "an error of the calls of its script",
    "an error of the program counter of its script",
];

fn has_answer(request: &Command) -> bool {
    length(request) > 0
}

/// Answers have no header, so that only the request says what they are.
fn read(request: &Command, bytes: &[u8]) -> Answer {
    let length = length(request);
    if length == 0 {
        return Answer::Skip(bytes.len());
    }
    bytes.get(..length).map_or(Answer::Incomplete, |answer| Answer::Complete(item(request, answer), 0))
}

fn length(request: &Command) -> usize {
    match request.verb() {
        verb::POSITION | verb::ERRORS | verb::HELLO => 2,
        verb::MOVING => 1,
        _ => 0,
    }
}

fn item(request: &Command, answer: &[u8]) -> ReportItem {
    match (request.verb(), answer) {
        (verb::POSITION, &[low, high]) => {
            let channel = request.value(0).and_then(|channel| u16::try_from(channel).ok());
            let quarters = i32::from(u16::from_le_bytes([low, high]));
            let row = channel.map(|channel| channel + MOVING_ROW + 1);
            row.map_or(ReportItem::Malformed, |row| ReportItem::Report(Report::of(row, Hundredths(quarters * 25))))
        }
        (verb::MOVING, &[moving @ (0 | 1)]) => {
            ReportItem::Report(Report::of(MOVING_ROW, Hundredths(i32::from(moving) * 100)))
        }
        (verb::ERRORS | verb::HELLO, &[low, high]) => ReportItem::Errors(u16::from_le_bytes([low, high])),
        _ => ReportItem::Malformed,
    }
}

fn errors(bits: u16) -> String {
    let known = ERRORS.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1);
    let mut words: Vec<String> = known.map(|(_, error)| (*error).to_owned()).collect();
    if bits >> ERRORS.len() != 0 {
        words.push(format!("unknown errors (0x{bits:04X})"));
    }
    words.join(", ")
}
