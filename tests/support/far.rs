//! The far end of a port: what a board would see of a run.

use std::process::{Child, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use motionseq::board::{Command, Decoder, Item};
use motionseq::link::Pty;

use super::board::{OnBoard, board, decoded, state, stop};
use super::{motionseq, stderr};

/// The frames of `stop` and `buzzer off`, computed by hand from the protocol table.
pub(crate) const STOP: [u8; 13] = [0xFF, 0xFE, 0x03, 0x08, 1, 0, 0, 0, 0, 0, 0, 0x01, 0x0D];
pub(crate) const BUZZER_OFF: [u8; 6] = [0xFF, 0xFE, 0x04, 0x01, 0x00, 0x05];

/// A port whose far end records what arrives, and when.
pub(crate) struct FarEnd {
    pub(crate) path: String,
    pub(crate) reads: Receiver<(Instant, Vec<u8>)>,
}

impl FarEnd {
    pub(crate) fn new() -> Self {
        let pty = Pty::open().unwrap();
        let path = pty.path().to_str().unwrap().to_owned();
        let (sender, reads) = mpsc::channel();
        thread::spawn(move || {
            let mut buffer = [0; 4096];
            // The test hangs up the port by dropping its end of the channel.
            while let Ok(count @ 1..) = pty.read(&mut buffer) {
                if sender.send((Instant::now(), buffer.iter().take(count).copied().collect())).is_err() {
                    break;
                }
            }
        });
        FarEnd { path, reads }
    }

    /// Waits for the first bytes of a run.
    pub(crate) fn first(&self) -> Vec<u8> {
        self.reads.recv_timeout(Duration::from_secs(20)).expect("the player sends something").1
    }

    /// Everything until the player and its guard have closed the port.
    pub(crate) fn rest(&self) -> Vec<(Instant, Vec<u8>)> {
        self.reads.iter().collect()
    }
}

pub(crate) fn bytes(reads: &[(Instant, Vec<u8>)]) -> Vec<u8> {
    reads.iter().flat_map(|(_, bytes)| bytes.clone()).collect()
}

/// Starts the program and captures its output.
pub(crate) fn start(args: &[&str]) -> Child {
    motionseq(args).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap()
}

/// Waits for its end. Returns the exit code and the messages.
pub(crate) fn end(child: Child) -> (i32, String) {
    let output = child.wait_with_output().unwrap();
    (output.status.code().expect("it ended by itself"), stderr(&output))
}

/// The commands in a stream; truncated or damaged frames are skipped, as on a board.
pub(crate) fn commands(bytes: &[u8]) -> Vec<Command> {
    let mut found = Vec::new();
    let mut decoder = Decoder::new(board());
    let mut take = |item: Item<'_>| {
        if let Item::Frame(frame) = item {
            found.push(decoded(frame));
        }
    };
    decoder.feed(bytes, &mut take);
    decoder.finish(&mut take);
    found
}

/// Checks that the board is at rest and silent after these bytes.
pub(crate) fn assert_at_rest(received: &[u8]) {
    assert!(state(&commands(received)).at_rest(board()), "{received:02X?}");
}

/// Checks the end of a run that drives until something ends it: three stops, buzzer off, and no
/// motion after the first stop.
pub(crate) fn assert_stopped(received: &[u8]) {
    assert!(received.ends_with(&[&STOP[..], &STOP, &STOP, &BUZZER_OFF].concat()), "{received:02X?}");
    let commands = commands(received);
    let mut after = commands.iter().skip_while(|command| **command != stop());
    assert!(!after.any(OnBoard::keeps_driving), "{received:02X?}");
    assert_at_rest(received);
}
