//! `motionseq decode`: a stream of bytes as a listing.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use motionseq::capture::{DecodeError, Decoded, decode};

use super::exit::Exit;
use super::output;
use super::screen::{Screen, plural};

/// Show the frames in a stream of bytes, or of hex digits
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq decode run.bin\n  echo FF FE 02 03 01 05 DC E7 | motionseq decode -\n\nA line holds the position of the first byte, the bytes, and the command. Bytes that belong to no frame are shown and skipped.\nHex digits may stand bare, with 0x before them, in a listing of `render`, or as xxd and hexdump -C write them.\n\nExit code 0 whatever the bytes are, 1 where they cannot be read, 2 where the listing cannot be written."
)]
pub(super) struct Decode {
    /// The stream, or `-` for standard input
    file: PathBuf,
    /// Write to this file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Decode {
    /// Writes the listing, and says what was in the stream.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let input: Box<dyn Read> = if self.file.as_os_str() == "-" {
            Box::new(io::stdin().lock())
        } else {
            match File::open(&self.file) {
                Ok(file) => Box::new(file),
                Err(error) => return self.unreadable(&error, screen),
            }
        };
        let out: Box<dyn Write> = match &self.output {
            None => Box::new(io::stdout().lock()),
            Some(path) => match output::open(path, &self.file).and_then(|file| output::begin(&file).map(|()| file)) {
                Ok(file) => Box::new(file),
                Err(error) => return output::exit(Err(error), Some(path), screen),
            },
        };
        let mut out = BufWriter::with_capacity(64 * 1024, out);
        let decoded = decode(input, &mut out);
        let flushed = out.flush();
        match decoded {
            Ok(decoded) => {
                summary(decoded, screen);
                output::exit(flushed, self.output.as_deref(), screen)
            }
            Err(DecodeError::Write(error)) => output::exit(Err(error), self.output.as_deref(), screen),
            Err(DecodeError::Read(error)) => self.unreadable(&error, screen),
        }
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
        (u64::from(decoded.half_byte), "one hex digit left alone at the end".to_owned()),
    ];
    let found = format!("{} in {}", count(decoded.frames, "frame"), count(decoded.bytes, "byte"));
    let parts = parts.into_iter().filter(|(count, _)| *count > 0).map(|(_, words)| words);
    screen.note(&std::iter::once(found).chain(parts).collect::<Vec<_>>().join(", "));
}
