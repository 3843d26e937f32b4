//! Reads the frames of an MCAP log that motionseq has written.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io;

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

/// The frames of a log, and the bytes that are not frames, as lines with a time and hex digits. A log that was cut is read up to there.
///
/// # Errors
/// If it is not a log of motionseq.
pub(super) fn listing(log: &[u8]) -> io::Result<String> {
    let mut frames = Frames::default();
    let records = LinearReader::new_with_options(log, Options::IgnoreEndMagic.into()).map_err(io::Error::other)?;
    for record in records.map_while(Result::ok) {
        match record {
            Record::Chunk { header, data } => {
                let records = ChunkReader::new(header, &data).into_iter().flatten();
                records.map_while(Result::ok).for_each(|record| frames.take(record));
            }
            record => frames.take(record),
        }
    }
    if frames.channels.is_empty() {
        return Err(io::Error::other("it is an MCAP file without the topic `/frames` of a log of motionseq"));
    }
    Ok(frames.lines)
}

#[derive(Default)]
struct Frames {
    /// The channels of the topic.
    channels: BTreeSet<u16>,
    lines: String,
}

impl Frames {
    fn take(&mut self, record: Record<'_>) {
        match record {
            Record::Channel(channel) if channel.topic == FRAMES && channel.message_encoding == "json" => {
                self.channels.insert(channel.id);
            }
            Record::Message { header, data } if self.channels.contains(&header.channel_id) => {
                if let Ok(FrameMessage { t_us, hex }) = serde_json::from_slice(&data) {
                    // Writing to a string does not fail.
                    let _ = writeln!(self.lines, "{:.6}\t{hex}", Micros(t_us));
                }
            }
            _ => {}
        }
    }
}
