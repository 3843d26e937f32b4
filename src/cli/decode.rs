//! `motionseq decode`: a stream of bytes as a listing, or as a script.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use motionseq::capture::{self, DecodeError, Decoded, Timing, decode, to_script};

use motionseq::board::Board;
use motionseq::source::{Disk, Files as _};

use super::Reading;
use super::exit::Exit;
use super::output::{self, Force, Inputs};
use super::replace::Replacement;
use super::screen::{Screen, plural};

/// Show the frames in a stream of bytes, or of hex digits, or make a script of them
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq decode run.bin\n  echo FF FE 02 03 01 05 DC E7 | motionseq decode -\n  motionseq decode run.bin --timing run.times -o run.motion\n\nA line holds the position of the first byte, the bytes, and the command. Bytes that belong to no frame are shown and skipped.\nHex digits may stand bare, with 0x before them, in a listing of `render`, or as xxd and hexdump -C write\nthem. Times are taken from a listing, from JSON lines, from a log such as `(0.500) ttyUSB0 FF FE …` or `(0.500) can0 123#FFFE…`, or with\n--timing from a file of `script --log-timing`; a line then holds the time, in seconds.\n\nWith -o NAME.motion the result is a script, as `record` writes it. What has no times counts as sent as fast as the line carries it.\n\nExit code 0 whatever the bytes are, 1 where they cannot be read, 2 where the listing cannot be written."
)]
pub(super) struct Decode {
    /// The stream, or `-` for standard input
    file: PathBuf,
    /// Write to this file instead of standard output: a listing, or a script where its name ends in .motion
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// When the bytes came: lines of a delay in seconds and a number of bytes, as `script --log-timing` writes them
    #[arg(long, value_name = "FILE")]
    timing: Option<PathBuf>,
    /// Speed of the line in bits a second, for a script; that of a snapshot is known [default: 115200]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: Option<u32>,
    /// Keep every frame in a script
    #[arg(long)]
    exact: bool,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    reading: Reading,
}

impl Decode {
    /// Writes the listing, and says what was in the stream.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let is_script = self.output.as_ref().is_some_and(|path| path.extension().is_some_and(|end| end == "motion"));
        if self.exact && !is_script {
            screen.error("--exact is about a script: write one with `-o NAME.motion`");
            return Exit::Usage;
        }
        if self.baud.is_some() && !is_script {
            screen.error("--baud is about a script: write one with `-o NAME.motion`");
            return Exit::Usage;
        }
        let timing = match self.timing.as_deref().map(|path| self.timing(path, screen)).transpose() {
            Ok(timing) => timing,
            Err(exit) => return exit,
        };
        let input: Box<dyn Read> = if self.file.as_os_str() == "-" {
            Box::new(io::stdin().lock())
        } else {
            match File::open(&self.file) {
                Ok(file) => Box::new(file),
                Err(error) => return self.unreadable(&error, screen),
            }
        };
        let inputs = Inputs::of([Some(&self.file), self.timing.as_ref()].into_iter().flatten());
        let file = self.output.as_deref().map(|path| output::whole(path, &inputs, self.force)).transpose();
        let mut file = match file {
            Ok(file) => file,
            Err(error) => return output::exit(Err(error), self.output.as_deref(), screen),
        };
        let out: Box<dyn Write> = match &mut file {
            None => Box::new(io::stdout().lock()),
            Some(file) => Box::new(file),
        };
        let board = self.reading.board();
        let reading =
            capture::Reading::default().with_timing(timing).with_baud(self.baud).with_board(Arc::clone(&board));
        let mut out = BufWriter::with_capacity(64 * 1024, out);
        let decoded =
            if is_script { to_script(input, reading, self.exact, &mut out) } else { decode(input, reading, &mut out) };
        let flushed = out.flush();
        drop(out);
        let flushed = flushed.and_then(|()| file.map_or(Ok(()), Replacement::finish));
        match decoded {
            Ok(decoded) => {
                summary(decoded, screen);
                if decoded.ambiguous > 0 {
                    screen.note(&doubt(&board));
                }
                if is_script && !decoded.is_timed {
                    screen.note("there are no times in it: the script sends it as fast as the line carries it");
                }
                output::exit(flushed, self.output.as_deref(), screen)
            }
            Err(DecodeError::Write(error)) => output::exit(Err(error), self.output.as_deref(), screen),
            Err(DecodeError::Read(error)) => self.unreadable(&error, screen),
            Err(error) => {
                screen.error(&error.to_string());
                Exit::Script
            }
        }
    }

    /// Reads when the bytes came.
    fn timing(&self, path: &Path, screen: &Screen) -> Result<Timing, Exit> {
        let text = Disk.read(path).map_err(|error| {
            screen.error(&error.to_string());
            Exit::Script
        })?;
        let length = self.file.metadata().ok().filter(std::fs::Metadata::is_file).map(|file| file.len());
        Timing::read(text.text(), length).map_err(|error| {
            screen.error(&format!("{}: {error}", path.display()));
            Exit::Script
        })
    }

    fn unreadable(&self, error: &io::Error, screen: &Screen) -> Exit {
        let name: &Path = &self.file;
        screen.error(&format!("cannot read {}: {error}", name.display()));
        Exit::Script
    }
}

fn summary(decoded: Decoded, screen: &Screen) {
    let count = |count: u64, word| plural(usize::try_from(count).unwrap_or(usize::MAX), word);
    let parts = [
        (decoded.unknown, count(decoded.unknown, "frame") + " no command"),
        (decoded.skipped, count(decoded.skipped, "byte") + " skipped"),
        (decoded.not_hex, count(decoded.not_hex, "character") + " passed over, being no hex digit"),
        (decoded.aborts, count(decoded.aborts, "frame") + " of `on abort` left out"),
        (u64::from(decoded.half_byte), "one hex digit left alone at the end".to_owned()),
    ];
    let found = format!("{} in {}", count(decoded.frames, "frame"), count(decoded.bytes, "byte"));
    let parts = parts.into_iter().filter(|(count, _)| *count > 0).map(|(_, words)| words);
    screen.note(&std::iter::once(found).chain(parts).collect::<Vec<_>>().join(", "));
}

/// What must be said of the first frame of a stream that can be read in two ways.
pub(super) fn doubt(board: &Board) -> String {
    let Some(doubt) = &board.ambiguity else { return String::new() };
    let word = board.verb(doubt.verb).map(|verb| &*verb.word).unwrap_or_default();
    format!(
        "a `{word}` came; {}. The two cannot always be told apart, and which one a board expects is unknown",
        doubt.note
    )
}
