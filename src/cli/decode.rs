//! `motionseq decode`: shows a stream of bytes as a listing, or writes it as a script.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use motionseq::capture::{self, DecodeError, Decoded, Timing, decode, to_script};

use motionseq::board::Board;
use motionseq::source::{Disk, Files as _};
use motionseq::units::{Micros, NotATime};

use super::atomic_file::AtomicFile;
use super::exit::Exit;
use super::family::{Chosen, Reading};
use super::mcap_frames;
use super::output::{self, Force, Inputs};
use super::screen::{Screen, plural};

/// Decode a stream of bytes into a listing or a script
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq decode run.bin\n  echo FF FE 02 03 01 05 DC E7 | motionseq decode -\n  motionseq decode run.bin --timing run.times -o run.motion   # write a script\n  motionseq decode frames.txt --every 20ms -o run.motion      # one frame every 20 ms\n  motionseq decode run.mcap                                   # the frames of a log\n  motionseq decode run.bin --family my-robot.toml             # of a board that a file describes\n\nThe input is binary or hex: plain, with 0x, a listing of `render`, JSON lines, xxd, hexdump -C, or a log such as\n`(0.500) ttyUSB0 FF FE ...` or `(0.500) can0 123#FFFE...`; the output of `socat -x`, a log or hex output of tio, or an\nMCAP log of motionseq.\nEach output line has the time in seconds, or the position of the first byte if no times are known; then the bytes and the command.\nBytes that are not part of a frame are shown and skipped. If no byte is part of a frame, the exit code is 1.\nIf no times are known, the script sends the frames as fast as the serial line can carry them, or at the interval of --every."
)]
pub(super) struct Decode {
    /// Binary or hex file to read, or `-` for standard input
    #[arg(value_name = "FILE")]
    stream: PathBuf,
    /// Write to FILE instead of standard output: a script if its extension is .motion, otherwise a listing
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Read the times of the bytes from FILE, in the format of `script --log-timing` (util-linux)
    #[arg(long, value_name = "FILE")]
    timing: Option<PathBuf>,
    /// Bit rate of the serial line, used for a script [default: as the snapshot says, or that of the board]
    #[arg(long, value_name = "BAUD", value_parser = clap::value_parser!(u32).range(1_200..=4_000_000))]
    baud: Option<u32>,
    /// Time between two frames of a script, 1ms to 10s, if the input has no times [default: as fast as the line]
    #[arg(long, value_name = "TIME", value_parser = every, conflicts_with = "timing")]
    every: Option<Micros>,
    /// Keep every frame in the script; do not merge frames into moves and holds
    #[arg(long)]
    exact: bool,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    reading: Reading,
}

/// The first bytes of a snapshot: as many as show that a file is a log.
const SNAPSHOT: &[u8] = b"# motion";
/// The number of lines before its frames, and the longest of them in bytes.
const HEAD: usize = 3;
const LINE: u64 = 4 * 1024;

impl Decode {
    /// Writes the listing or the script, and a summary of the stream.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        self.try_run(screen).unwrap_or_else(|exit| exit)
    }

    fn try_run(&self, screen: &Screen) -> Result<Exit, Exit> {
        let is_script = self.output.as_ref().is_some_and(|path| path.extension().is_some_and(|end| end == "motion"));
        let for_scripts = [(self.exact, "--exact"), (self.baud.is_some(), "--baud"), (self.every.is_some(), "--every")];
        if let Some((_, option)) = for_scripts.iter().find(|(is_set, _)| *is_set && !is_script) {
            screen.error(&format!("`{option}` needs a script as output: add `-o NAME.motion`"));
            return Err(Exit::Usage);
        }
        let timing = self.timing.as_deref().map(|path| self.timing(path, screen)).transpose()?;
        let (head, input) = self.input(screen).map_err(|error| self.unreadable(&error, screen))?;
        let mut chosen = self.reading.chosen_for(&self.stream, &head, screen)?;
        let inputs = [Some(&self.stream), self.timing.as_ref(), chosen.file.as_ref()];
        let inputs = Inputs::of(inputs.into_iter().flatten());
        let file = self.output.as_deref().map(|path| output::whole(path, &inputs, self.force)).transpose();
        let mut file = file.map_err(|error| output::exit(Err(error), self.output.as_deref(), screen))?;
        let out: Box<dyn Write> = match &mut file {
            None => Box::new(io::stdout().lock()),
            Some(file) => Box::new(file),
        };
        if is_script {
            chosen = chosen.for_script(self.output.as_deref(), screen);
        }
        let Chosen { board, .. } = chosen;
        let reading = capture::Reading::default().with_timing(timing).with_baud(self.baud);
        let reading = reading.with_every(self.every).with_board(Arc::clone(&board));
        let input = io::Cursor::new(head).chain(input);
        let mut out = BufWriter::with_capacity(64 * 1024, out);
        let decoded =
            if is_script { to_script(input, reading, self.exact, &mut out) } else { decode(input, reading, &mut out) };
        let flushed = out.flush();
        drop(out);
        let file = file.filter(|_| decoded.is_ok());
        let flushed = flushed.and_then(|()| file.map_or(Ok(()), AtomicFile::finish));
        match decoded {
            Ok(decoded) => Ok(self.report(decoded, flushed, (&board, is_script), screen)),
            Err(DecodeError::Write(error)) => Err(output::exit(Err(error), self.output.as_deref(), screen)),
            Err(DecodeError::Read(error)) => Err(self.unreadable(&error, screen)),
            Err(error) => {
                screen.error(&error.to_string());
                Err(Exit::Script)
            }
        }
    }

    /// Reports what was found, and whether it was written.
    fn report(
        &self,
        decoded: Decoded,
        flushed: io::Result<()>,
        (board, is_script): (&Board, bool),
        screen: &Screen,
    ) -> Exit {
        summary(decoded, screen);
        if decoded.ambiguous > 0 {
            screen.note(&doubt(board));
        }
        match (decoded.is_timed, self.every) {
            (false, None) if is_script && decoded.frames > 0 => screen.note(
                "no times in the input: the script sends the frames as fast as the line carries them; `--every 20ms` sets their interval",
            ),
            (true, Some(_)) => screen.note("the input has times, so `--every` has no effect"),
            _ => {}
        }
        let written = output::exit(flushed, self.output.as_deref(), screen);
        if decoded.frames == 0 && written == Exit::Ok {
            screen.error("the input contains no frame");
            return Exit::Script;
        }
        written
    }

    /// Opens the input, and reads its head: of a snapshot, with its board. A log of motionseq becomes the lines of a listing.
    fn input(&self, screen: &Screen) -> io::Result<(Vec<u8>, Box<dyn Read>)> {
        let mut input: Box<dyn Read> = if self.stream.as_os_str() == "-" {
            Box::new(io::stdin().lock())
        } else {
            Box::new(File::open(&self.stream)?)
        };
        let mut head = Vec::new();
        input.by_ref().take(mcap_frames::MAGIC.len() as u64).read_to_end(&mut head)?;
        if head == SNAPSHOT {
            let mut lines = BufReader::new(input);
            for _ in 0..HEAD {
                lines.by_ref().take(LINE).read_until(b'\n', &mut head)?;
            }
            return Ok((head, Box::new(lines)));
        }
        if head != mcap_frames::MAGIC {
            return Ok((head, input));
        }
        input.read_to_end(&mut head)?;
        let (listing, ends_early) = mcap_frames::listing(&head)?;
        if ends_early {
            screen.note("the log ends early");
        }
        Ok((Vec::new(), Box::new(io::Cursor::new(listing))))
    }

    /// Reads the times of the bytes.
    fn timing(&self, path: &Path, screen: &Screen) -> Result<Timing, Exit> {
        let text = Disk.read(path).map_err(|error| {
            screen.error(&error.to_string());
            Exit::Script
        })?;
        let length = self.stream.metadata().ok().filter(std::fs::Metadata::is_file).map(|file| file.len());
        Timing::read(text.text(), length).map_err(|error| {
            screen.error(&format!("{}: {error}", path.display()));
            Exit::Script
        })
    }

    fn unreadable(&self, error: &io::Error, screen: &Screen) -> Exit {
        let name: &Path = &self.stream;
        screen.error(&format!("cannot read {}: {error}", name.display()));
        Exit::Script
    }
}

/// Reads the time between two frames.
fn every(text: &str) -> Result<Micros, String> {
    let time: Micros = text.parse().map_err(|error: NotATime| error.to_string())?;
    let is_fine = (Micros::from_millis(1)..=Micros::from_millis(10_000)).contains(&time);
    is_fine.then_some(time).ok_or_else(|| "write a time from 1ms to 10s, such as 20ms".to_owned())
}

fn summary(decoded: Decoded, screen: &Screen) {
    let count = |count: u64, word| plural(usize::try_from(count).unwrap_or(usize::MAX), word);
    let parts = [
        (decoded.unknown, count(decoded.unknown, "unknown frame")),
        (decoded.skipped, count(decoded.skipped, "byte") + " skipped"),
        (decoded.not_hex, count(decoded.not_hex, "character") + " ignored (not hex)"),
        (decoded.aborts, count(decoded.aborts, "frame") + " of `on abort` left out"),
        (u64::from(decoded.half_byte), "half a byte at the end".to_owned()),
        (decoded.other_way, count(decoded.other_way, "byte") + " of the other direction left out"),
    ];
    let found = format!("{} in {}", count(decoded.frames, "frame"), count(decoded.bytes, "byte"));
    let parts = parts.into_iter().filter(|(count, _)| *count > 0).map(|(_, words)| words);
    screen.note(&std::iter::once(found).chain(parts).collect::<Vec<_>>().join(", "));
}

/// A note about the first frame of a stream that can be decoded in two ways.
pub(super) fn doubt(board: &Board) -> String {
    let Some(doubt) = &board.ambiguity else { return String::new() };
    let word = board.verb(doubt.verb).map(|verb| &*verb.word).unwrap_or_default();
    format!(
        "the input contains a `{word}`; {}; the two encodings cannot always be distinguished, and which one a board expects is unknown",
        doubt.note
    )
}
