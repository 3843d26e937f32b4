//! A virtual board with faults, at the end of the line that carries its bytes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Faults;
use crate::board::{Decoder, Item};
use crate::random::SplitMix;
use crate::sim::{Device, Received};
use crate::units::Micros;

/// Wraps a device: finds the frames in the bytes of the line, and decides which of them arrive, which reports are sent, and when the port
/// stalls or hangs up. Time is an input. Without faults it is the device on a perfect line.
#[derive(Debug)]
pub struct Faulty {
    device: Device,
    faults: Faults,
    decoder: Decoder,
    /// One each for frames and for reports, so that neither changes the faults of the other.
    dice: [RandomEvents; 2],
    replies: Vec<u8>,
    stall: Stall,
    /// The time since the device was switched on.
    now: Micros,
    has_hung_up: bool,
}

impl Faulty {
    /// A device that is switched on now, at time 0 of its faults.
    pub fn new(mut device: Device, faults: Faults) -> Self {
        faults.servos.iter().for_each(|(servo, fault)| device.set_fault(*servo, *fault));
        let mut board = Faulty {
            decoder: Decoder::new(device.family()),
            dice: [0, 1].map(|stream| RandomEvents::new(faults.seed.wrapping_add(stream << 32))),
            device,
            faults,
            replies: Vec::new(),
            stall: Stall::default(),
            now: Micros::ZERO,
            has_hung_up: false,
        };
        board.poll(Micros::ZERO);
        board
    }

    /// Takes bytes of the line at a time since it was switched on.
    pub fn receive(&mut self, now: Micros, bytes: &[u8]) {
        self.poll(now);
        let Faulty { device, faults, decoder, dice: [dice, _], .. } = self;
        decoder.feed(bytes, |item| match item {
            // A frame with a wrong bit has a wrong checksum.
            Item::Frame(frame) if dice.happens(faults.drop) || dice.happens(faults.garble) => device.miss(frame),
            item => device.take(item),
        });
        self.reply();
    }

    /// Advances the time, which never decreases.
    pub fn poll(&mut self, now: Micros) {
        self.now = self.now.max(now);
        if let Some((at_rest, from)) = self.faults.battery.take_if(|(_, from)| *from <= now) {
            // Earlier reports show the old battery.
            self.device.poll(from - Micros(1));
            self.device.set_battery(at_rest);
        }
        if self.faults.stall.is_some_and(|at| at <= self.now) {
            self.stall.begins.store(true, Ordering::Relaxed);
        }
        self.device.poll(now);
        self.reply();
    }

    /// Sends the reports and the answers of the device that get through.
    fn reply(&mut self) {
        let Faults { drop, garble, silent, .. } = self.faults;
        let [_, dice] = &mut self.dice;
        for mut reply in self.device.replies() {
            if silent || dice.happens(drop) {
                continue;
            }
            if dice.happens(garble) {
                dice.garble(&mut reply);
            }
            self.replies.extend(reply);
        }
    }

    /// Takes the bytes to send. An unplugged board sends nothing.
    pub fn replies(&mut self) -> Vec<u8> {
        let replies = std::mem::take(&mut self.replies);
        if self.is_unplugged() { Vec::new() } else { replies }
    }

    /// When it next has something to do, since it was switched on.
    pub fn next_due(&self) -> Option<Micros> {
        let unplug = self.faults.unplug.filter(|_| !self.has_hung_up);
        let stall = self.faults.stall.filter(|at| *at > self.now);
        [unplug, stall, self.device.next_due()].into_iter().flatten().min()
    }

    /// Whether bytes that are written to the line now arrive.
    pub fn carries(&self) -> bool {
        !self.is_unplugged() && !self.stall.has_begun()
    }

    /// Whether the line hangs up now; true once.
    pub fn hangs_up(&mut self) -> bool {
        self.is_unplugged() && !std::mem::replace(&mut self.has_hung_up, true)
    }

    fn is_unplugged(&self) -> bool {
        self.faults.unplug.is_some_and(|at| at <= self.now)
    }

    /// The state of a stall, for the port that writes to the line, on any thread.
    pub fn stall(&self) -> Stall {
        self.stall.clone()
    }

    /// The device inside.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Closes the line. A truncated frame counts as skipped.
    pub fn finish(self) -> Received {
        let Faulty { mut device, mut decoder, .. } = self;
        decoder.finish(|item| device.take(item));
        device.finish()
    }
}

/// A stall, for the port that writes.
#[derive(Clone, Debug, Default)]
pub struct Stall {
    begins: Arc<AtomicBool>,
    /// Whether the port has room again.
    is_discarded: bool,
}

impl Stall {
    fn has_begun(&self) -> bool {
        self.begins.load(Ordering::Relaxed)
    }

    /// Whether the port takes no bytes now.
    pub fn blocks(&self) -> bool {
        !self.is_discarded && self.has_begun()
    }

    /// Discards what the port held. It takes bytes again, but they do not arrive.
    pub fn discard(&mut self) {
        self.is_discarded = true;
    }
}

/// Random events, the same in each run.
#[derive(Clone, Debug)]
struct RandomEvents(SplitMix);

impl RandomEvents {
    fn new(seed: u64) -> Self {
        RandomEvents(SplitMix(seed))
    }

    /// Whether an event with this probability (0 to 1) happens.
    fn happens(&mut self, part: f64) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
        let x = (self.0.next() >> 11) as f64 / (1_u64 << 53) as f64;
        x < part
    }

    /// Flips one bit.
    fn garble(&mut self, bytes: &mut [u8]) {
        let length = u64::try_from(bytes.len()).unwrap_or(u64::MAX).max(1);
        let (at, bit) = (self.0.next() % length, self.0.next() % 8);
        if let Some(byte) = usize::try_from(at).ok().and_then(|at| bytes.get_mut(at)) {
            *byte ^= 1 << bit;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::raspblock;
    use crate::sim::Settings;

    fn board(faults: &str) -> Faulty {
        let device = Device::new(raspblock::board(), Settings::default());
        Faulty::new(device, if faults.is_empty() { Faults::default() } else { faults.parse().unwrap() })
    }

    /// Requests a report.
    fn ask(board: &mut Faulty, now: Micros) {
        let family = raspblock::board();
        board.receive(now, &family.to_frame(&family.command_named("request", &[5]).unwrap()));
    }

    #[test]
    fn a_port_that_stalls_takes_nothing_until_what_it_holds_is_thrown_away() {
        let mut board = board("stall@2s");
        let mut stall = board.stall();
        board.poll(Micros(1_999_999));
        assert_eq!((stall.blocks(), board.carries(), board.next_due()), (false, true, Some(Micros(2_000_000))));
        board.poll(Micros(2_000_000));
        assert_eq!((stall.blocks(), board.carries(), board.next_due()), (true, false, None));
        stall.discard();
        assert_eq!((stall.blocks(), board.carries(), board.hangs_up()), (false, false, false));
        // Bytes that were sent before still arrive, and the board still answers.
        ask(&mut board, Micros(2_000_001));
        assert!(!board.replies().is_empty());
    }

    #[test]
    fn a_cable_that_is_pulled_hangs_up_once_and_carries_nothing() {
        let mut board = board("unplug@1s");
        ask(&mut board, Micros(999_999));
        assert!(!board.replies().is_empty() && board.carries() && !board.hangs_up());
        board.poll(Micros(1_500_000));
        assert_eq!((board.carries(), board.next_due()), (false, Some(Micros(1_000_000))));
        assert_eq!([board.hangs_up(), board.hangs_up()], [true, false]);
        assert_eq!(board.next_due(), None);
        ask(&mut board, Micros(1_600_000));
        assert!(board.replies().is_empty() && !board.stall().blocks());
    }

    #[test]
    fn without_faults_everything_arrives_and_is_answered() {
        let mut board = board("");
        for at in 0..100 {
            ask(&mut board, Micros(at));
        }
        assert_eq!(board.replies().len(), 100 * b"{A0:0:0:1200}#".len());
        let received = board.finish();
        assert_eq!((received.frames, received.lost, received.first_fault), (100, 0, None));
    }

    #[test]
    fn a_frame_that_is_lost_counts_as_passed_on_the_line() {
        let mut board = board("drop=100%");
        ask(&mut board, Micros::ZERO);
        board.receive(Micros::ZERO, &[7]);
        let received = board.finish();
        assert_eq!((received.frames, received.lost, received.bytes), (0, 1, 7));
        // The start of the noise, counted from the start of the stream.
        assert_eq!(received.first_fault.map(|(at, _)| at), Some(6));
    }
}
