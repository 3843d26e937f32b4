//! Lines on standard input, each of which opens a gate: `--go stdin`.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Read, stdin};
use std::os::fd::{AsFd, BorrowedFd};

use super::messages::Input;

/// The lines that open gates. Lines that come before a gate count, so standard input is read only at a gate.
#[derive(Debug)]
pub struct GoLines {
    /// Not buffered, because it is polled.
    input: File,
    /// How many lines were read and not used.
    lines: usize,
    /// Whether a line has begun that has no end.
    has_begun: bool,
    has_ended: bool,
}

impl GoLines {
    /// The lines on standard input; `None` if that is a terminal, where keys open gates.
    ///
    /// # Errors
    /// If standard input is closed.
    pub fn open() -> io::Result<Option<Self>> {
        let input = stdin();
        if input.is_terminal() {
            return Ok(None);
        }
        let input = File::from(input.as_fd().try_clone_to_owned()?);
        Ok(Some(GoLines { input, lines: 0, has_begun: false, has_ended: false }))
    }

    /// The descriptor to poll, until the end of the input.
    pub(super) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        (!self.has_ended).then(|| self.input.as_fd())
    }

    /// A line that has come, or the end of the input.
    pub(super) fn take(&mut self) -> Option<Input> {
        if let Some(fewer) = self.lines.checked_sub(1) {
            self.lines = fewer;
            return Some(Input::Go);
        }
        self.has_ended.then_some(Input::GoEnded)
    }

    /// Reads what has come, without waiting.
    pub(super) fn read(&mut self) {
        let mut buffer = [0; 256];
        match self.input.read(&mut buffer) {
            Ok(0) => {
                // The last line may lack its line feed.
                self.lines += usize::from(std::mem::take(&mut self.has_begun));
                self.has_ended = true;
            }
            Ok(count) => {
                let bytes = buffer.get(..count).unwrap_or_default();
                self.lines += bytes.iter().filter(|byte| **byte == b'\n').count();
                self.has_begun = bytes.last().is_some_and(|byte| *byte != b'\n');
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => self.has_ended = true,
        }
    }
}
