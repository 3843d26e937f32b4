//! The decisions of a guard, as a pure function of time and of the messages it receives.

use crate::units::Nanos;

/// How a player failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlayerFailure {
    /// It hung, and was killed.
    Hung,
    /// It died while it was playing.
    Died,
    /// It died after the end of the run, before it reported the end.
    DiedAfterEnd,
}

/// A message from the player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlayerMessage {
    /// No message; time has passed.
    Silence,
    /// It is alive.
    Beat,
    /// The robot is stopped, and no heartbeats will come until the next one.
    AtRest,
    /// The run has ended, and the robot needs no stop.
    Ended,
    /// Everything is reported.
    Goodbye,
    /// Its end of the pipe is closed.
    Closed,
}

/// What the guard does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decision {
    /// Listen until this time, or without a limit.
    Listen(Option<Nanos>),
    /// The run has ended: close the port.
    Release,
    /// The player has failed.
    Over(PlayerFailure),
    /// Nothing is left to do.
    Done,
}

/// If the guard wakes later than this, the machine may have stalled rather than the player.
const TARDY: Nanos = Nanos::from_millis(5);

/// Decides whether the player is alive.
#[derive(Debug)]
pub(super) struct Watchdog {
    /// The longest permitted silence.
    limit: Nanos,
    /// When the silence is too long; `None` while the player rests.
    deadline: Option<Nanos>,
    /// Whether the deadline was extended since the last heartbeat.
    extended: bool,
    /// Whether the run has ended.
    ended: bool,
}

impl Watchdog {
    pub(super) fn new(now: Nanos, limit: Nanos) -> Self {
        Watchdog { limit, deadline: Some(now.saturating_add(limit)), extended: false, ended: false }
    }

    pub(super) fn poll(&mut self, now: Nanos, heard: PlayerMessage) -> Decision {
        match heard {
            PlayerMessage::Goodbye => return Decision::Done,
            PlayerMessage::Closed if self.ended => return Decision::Over(PlayerFailure::DiedAfterEnd),
            PlayerMessage::Closed => return Decision::Over(PlayerFailure::Died),
            PlayerMessage::Ended => {
                (self.deadline, self.ended) = (None, true);
                return Decision::Release;
            }
            PlayerMessage::AtRest => self.deadline = None,
            PlayerMessage::Beat => {
                self.deadline = Some(now.saturating_add(self.limit));
                self.extended = false;
            }
            PlayerMessage::Silence => match self.deadline {
                Some(deadline) if now >= deadline => {
                    // What delayed the guard may also have delayed the player.
                    if self.extended || now - deadline < TARDY {
                        return Decision::Over(PlayerFailure::Hung);
                    }
                    self.extended = true;
                    self.deadline = Some(now.saturating_add(self.limit));
                }
                _ => {}
            },
        }
        Decision::Listen(self.deadline)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const MS: Nanos = Nanos::from_millis(1);

    #[test]
    fn a_player_that_beats_is_left_alone() {
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        for beat in 1..1_000 {
            let now = MS * (beat * 99);
            assert_eq!(watch.poll(now, PlayerMessage::Beat), Decision::Listen(Some(now + MS * 100)));
        }
        assert_eq!(watch.poll(MS * 100_000, PlayerMessage::Goodbye), Decision::Done);
    }

    #[test]
    fn silence_is_a_hang_and_a_closed_pipe_a_death() {
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        assert_eq!(watch.poll(MS * 99, PlayerMessage::Silence), Decision::Listen(Some(MS * 100)));
        assert_eq!(watch.poll(MS * 100, PlayerMessage::Silence), Decision::Over(PlayerFailure::Hung));
        assert_eq!(watch.poll(MS * 100, PlayerMessage::Closed), Decision::Over(PlayerFailure::Died));
    }

    #[test]
    fn a_guard_that_woke_late_waits_one_more_interval_only() {
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        assert_eq!(watch.poll(MS * 105, PlayerMessage::Silence), Decision::Listen(Some(MS * 205)));
        assert_eq!(watch.poll(MS * 300, PlayerMessage::Silence), Decision::Over(PlayerFailure::Hung));
        // A heartbeat in between resets that.
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        watch.poll(MS * 105, PlayerMessage::Silence);
        watch.poll(MS * 110, PlayerMessage::Beat);
        assert_eq!(watch.poll(MS * 300, PlayerMessage::Silence), Decision::Listen(Some(MS * 400)));
    }

    #[test]
    fn a_player_at_rest_may_be_silent_for_ever_but_not_die() {
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        assert_eq!(watch.poll(MS, PlayerMessage::AtRest), Decision::Listen(None));
        assert_eq!(watch.poll(Nanos::MAX, PlayerMessage::Silence), Decision::Listen(None));
        assert_eq!(watch.poll(Nanos::MAX, PlayerMessage::Closed), Decision::Over(PlayerFailure::Died));
        // The next beat ends the rest.
        assert_eq!(watch.poll(MS, PlayerMessage::Beat), Decision::Listen(Some(MS * 101)));
    }

    #[test]
    fn a_player_that_dies_after_its_end_differs_from_one_that_drives() {
        let mut watch = Watchdog::new(Nanos::ZERO, MS * 100);
        assert_eq!(watch.poll(MS, PlayerMessage::Ended), Decision::Release);
        assert_eq!(watch.poll(Nanos::MAX, PlayerMessage::Silence), Decision::Listen(None));
        assert_eq!(watch.poll(Nanos::MAX, PlayerMessage::Closed), Decision::Over(PlayerFailure::DiedAfterEnd));
        assert_eq!(watch.poll(Nanos::MAX, PlayerMessage::Goodbye), Decision::Done);
    }
}
