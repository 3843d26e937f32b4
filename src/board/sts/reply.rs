//! What a servo answers: its error bits, and the registers that were read.

use super::codec::READS;
use super::{packet, quantity_row, verb};
use crate::board::{Answer, Answers, Command, Hundredths, Report, ReportItem};
use crate::units::Nanos;

pub(super) const ANSWERS: Answers =
    Answers { has_answer, read, errors, hint: HINT, length: 8 + 6 + 7, patience: Nanos::from_millis(20) };

const HINT: &str =
    "check the power of the servos, the jumper of the adapter, the number of the servo and the speed of the bus";

/// The meanings of the error bits, the lowest first.
const ERRORS: [(u16, &str); 5] = [
    (1 << 0, "its voltage is too low or too high"),
    (1 << 1, "its position sensor fails"),
    (1 << 2, "it is too hot"),
    (1 << 3, "its current is too high"),
    (1 << 5, "its load is too high"),
];

fn has_answer(request: &Command) -> bool {
    READS.iter().any(|(verb, ..)| *verb == request.verb())
}

/// Finds the answer of the servo that was asked. Everything else is skipped: answers of other servos, noise, and wrong sums.
fn read(request: &Command, bytes: &[u8]) -> Answer {
    let Some((_, _, count)) = READS.iter().find(|(verb, ..)| *verb == request.verb()) else {
        return Answer::Skip(bytes.len());
    };
    let id = request.value(0).and_then(|id| u8::try_from(id).ok()).unwrap_or_default();
    let head = [packet::HEADER, packet::HEADER, id, count + 2];
    if !bytes.iter().zip(head).all(|(byte, expected)| *byte == expected) {
        return Answer::Skip(packet::next_start(bytes));
    }
    let Some(whole) = bytes.get(..head.len() + usize::from(count + 2)) else { return Answer::Incomplete };
    match packet::parse(whole) {
        Ok(packet) => Answer::Complete(item(request, packet.parameters), packet.instruction.into()),
        Err(_) => Answer::Skip(packet::next_start(bytes)),
    }
}

fn item(request: &Command, registers: &[u8]) -> ReportItem {
    let report = |value: i32| match quantity_row(request) {
        Some(row) => ReportItem::Report(Report::of(row, Hundredths(value))),
        None => ReportItem::Malformed,
    };
    match (request.verb(), registers) {
        (verb::POSITION, &[low, high]) => {
            let bits = u16::from_le_bytes([low, high]);
            let size = i32::from(bits & 0x7FFF);
            report(if bits & 0x8000 == 0 { size } else { -size } * 100)
        }
        (verb::VOLTAGE, &[tenths]) => report(i32::from(tenths) * 10),
        (verb::MODE, &[mode]) => ReportItem::Values([mode.into(), 0]),
        (verb::SETTINGS, &[acceleration, _, _, _, _, low, high]) => {
            ReportItem::Values([u16::from_le_bytes([low, high]).into(), acceleration.into()])
        }
        _ => ReportItem::Malformed,
    }
}

fn errors(bits: u16) -> String {
    let mut words: Vec<String> =
        ERRORS.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, error)| (*error).to_owned()).collect();
    let known = ERRORS.iter().fold(0, |known, (bit, _)| known | bit);
    if bits & !known != 0 {
        words.push(format!("unknown error bits 0x{:02X}", bits & !known));
    }
    words.join(", ")
}
