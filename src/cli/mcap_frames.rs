//! Reads the frames of an MCAP log that motionseq has written.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io;

use mcap::McapError;
use mcap::read::{ChunkReader, LinearReader, Options};
use mcap::records::Record;
use motionseq::units::Micros;
use serde::Deserialize;

/// The first bytes of an MCAP file.
pub(super) const MAGIC: &[u8] = mcap::MAGIC;
/// The topic with the frames.
const FRAMES: &str = "/frames";

#[derive(Deserialize)]
struct FrameMessage {
    t_us: u64,
    hex: String,
}

/// The frames of a log, and the bytes that are not frames, as lines with a time and hex digits; and whether the log ends early: one
/// that was cut is read up to there.
///
/// # Errors
/// If it is not a log of motionseq, or is compressed.
pub(super) fn listing(log: &[u8]) -> io::Result<(String, bool)> {
    let mut frames = Frames::default();
    let broken = match frames.read(log) {
        Ok(()) => None,
        Err(McapError::UnsupportedCompression(format)) => {
            return Err(io::Error::other(format!("it is compressed ({format}); write it without compression first")));
        }
        Err(McapError::Io(error)) => return Err(error),
        Err(error) => Some(error),
    };
    match broken {
        Some(error) if frames.channels.is_empty() => Err(io::Error::other(error)),
        None if frames.channels.is_empty() => {
            Err(io::Error::other("it is an MCAP file without the topic `/frames` of a log of motionseq"))
        }
        broken => Ok((frames.lines, broken.is_some() || !frames.has_end)),
    }
}

#[derive(Default)]
struct Frames {
    /// The channels of the topic.
    channels: BTreeSet<u16>,
    lines: String,
    /// Whether the last record was read.
    has_end: bool,
}

impl Frames {
    /// Reads up to the end, or to the first error.
    fn read(&mut self, log: &[u8]) -> Result<(), McapError> {
        for record in LinearReader::new_with_options(log, Options::IgnoreEndMagic.into())? {
            match record? {
                Record::Chunk { header, data } => {
                    for record in ChunkReader::new(header, &data)? {
                        self.take(record?)?;
                    }
                }
                record => self.take(record)?,
            }
        }
        Ok(())
    }

    fn take(&mut self, record: Record<'_>) -> io::Result<()> {
        match record {
            Record::Channel(channel) if channel.topic == FRAMES && channel.message_encoding == "json" => {
                self.channels.insert(channel.id);
            }
            Record::Message { header, data } if self.channels.contains(&header.channel_id) => {
                let message = serde_json::from_slice(&data);
                let FrameMessage { t_us, hex } = message.map_err(|error| {
                    io::Error::other(format!("a message of the topic `/frames` is not one of motionseq: {error}"))
                })?;
                // Writing to a string does not fail.
                let _ = writeln!(self.lines, "{:.6}\t{hex}", Micros(t_us));
            }
            Record::Footer(_) => self.has_end = true,
            _ => {}
        }
        Ok(())
    }
}
