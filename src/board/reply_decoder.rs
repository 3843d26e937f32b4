//! Finds reports and answers in what a board sends back.
//!
//! Input is not trusted: the buffer is bounded, and a report with a missing or non-numeric field is
//! skipped as a whole.

use super::command::Command;
use super::quantity::{Answer, Answers, Replies, ReportItem, ReportLine};
use super::table::Board;

/// The longest report in bytes: four fields of ten digits with signs and separators, and some spare
/// room.
const MAX_REPORT: usize = 64;

/// Finds reports in the replies of a board, no matter how they are split into reads. It skips noise
/// between lines, and bytes that no request asked for. Does not allocate.
#[derive(Debug)]
pub struct ReportDecoder {
    form: Replies,
    /// The bytes of the current line or answer, and their number.
    line: [u8; MAX_REPORT],
    length: usize,
    /// Whether a line has begun.
    inside: bool,
    /// The request that the next bytes answer.
    asked: Option<Command>,
    /// What follows the error bits of an answer.
    held: Option<ReportItem>,
}

impl ReportDecoder {
    /// A decoder at the start of the replies of a board.
    pub fn new(board: &Board) -> Self {
        ReportDecoder { form: board.replies, line: [0; MAX_REPORT], length: 0, inside: false, asked: None, held: None }
    }

    /// The next bytes answer this command, if it has an answer. What is missing of the answer to
    /// the one before will not come.
    pub fn ask(&mut self, command: &Command) {
        if let Replies::Answers(answers) = self.form
            && (answers.has_answer)(command)
        {
            self.asked = Some(command.clone());
            self.length = 0;
        }
    }

    /// Whether a command has an answer.
    pub fn has_answer(&self, command: &Command) -> bool {
        matches!(self.form, Replies::Answers(answers) if (answers.has_answer)(command))
    }

    /// Whether an answer is missing.
    pub fn is_waiting(&self) -> bool {
        self.asked.is_some()
    }

    /// Waits no longer for an answer.
    pub fn give_up(&mut self) {
        self.asked = None;
    }

    /// Reads the next bytes and passes each complete item to `sink`.
    pub fn feed(&mut self, mut bytes: &[u8], mut sink: impl FnMut(ReportItem)) {
        while let Some(item) = self.next(&mut bytes) {
            sink(item);
        }
    }

    /// Reads up to the next complete item, and removes what it read from `bytes`; `None` once all is read.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<ReportItem> {
        if let Some(item) = self.held.take() {
            return Some(item);
        }
        let form = self.form;
        while let [byte, rest @ ..] = *bytes {
            *bytes = rest;
            let item = match form {
                Replies::None => None,
                Replies::Lines(form) => self.take_of_line(form, *byte),
                Replies::Answers(form) => self.take_of_answer(form, *byte),
            };
            if item.is_some() {
                return item;
            }
        }
        None
    }

    fn take_of_line(&mut self, form: ReportLine, byte: u8) -> Option<ReportItem> {
        let (begin, end) = form.bounds;
        if byte == begin {
            // A truncated report ends where the next one starts.
            self.length = 0;
            return std::mem::replace(&mut self.inside, true).then_some(ReportItem::Malformed);
        }
        if !self.inside {
            return None;
        }
        if byte == end {
            self.inside = false;
            let line = self.line.get(..self.length).unwrap_or_default();
            return Some((form.read)(line).map_or(ReportItem::Malformed, ReportItem::Report));
        }
        self.inside = self.keep(byte);
        (!self.inside).then_some(ReportItem::Malformed)
    }

    fn take_of_answer(&mut self, form: Answers, byte: u8) -> Option<ReportItem> {
        // Nothing asked for it.
        let Some(asked) = self.asked.take() else { return Some(ReportItem::Malformed) };
        self.keep(byte);
        loop {
            match (form.read)(&asked, self.line.get(..self.length).unwrap_or_default()) {
                Answer::Complete(item, 0) => return Some(item),
                Answer::Complete(item, errors) => {
                    self.held = Some(item);
                    return Some(ReportItem::Flags(asked.value(0).unwrap_or_default(), errors));
                }
                Answer::Skip(count) if self.length > 0 => {
                    let count = count.clamp(1, self.length);
                    self.line.copy_within(count..self.length, 0);
                    self.length -= count;
                }
                Answer::Skip(_) | Answer::Incomplete => break,
            }
        }
        self.asked = Some(asked);
        None
    }

    /// Keeps a byte; `false` if there is no room.
    fn keep(&mut self, byte: u8) -> bool {
        let place = self.line.get_mut(self.length);
        let has_room = place.is_some();
        if let Some(place) = place {
            *place = byte;
            self.length += 1;
        }
        has_room
    }
}
