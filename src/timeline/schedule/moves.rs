//! Moves: where they start, and the frames on their way.

use super::super::{Kind, Tween};
use super::{Origin, Scheduler};
use crate::diagnostic::diagnostic;
use crate::program::{MAX_STEPS, Motion, Move, Time, broken_limit};

impl Scheduler<'_> {
    /// Samples a move: at the start where it says so, then every period, then exactly the target. What would say the same
    /// as the last frame to the same thing is left out.
    pub(super) fn go(&mut self, at: Time, going: &Move, from: Origin) {
        let Move { motion, over, ease, .. } = going;
        let Some(starts) = self.starts(motion, from) else {
            return;
        };
        if !self.may_sample(*over, from) {
            return;
        }
        let before = self.events.len();
        let end = at.plus(*over);
        self.samples(at, end, going, &starts, from);
        let steps = self.events.get(before..).unwrap_or_default();
        if let Some((first, _)) = steps.first() {
            let tween = Tween { at: at.micros(), end: end.micros(), ease: *ease, steps: steps.len() };
            self.tweens.push((tween, (first.at, from.order)));
        }
    }

    #[expect(clippy::too_many_arguments, reason = "a move and where it goes")]
    fn samples(&mut self, at: Time, end: Time, going: &Move, starts: &[f64], from: Origin) {
        let Move { motion, over, ease, .. } = going;
        if motion.has_start() {
            self.sample(at, going, starts, from);
        }
        for k in 1_u64.. {
            let passed = self.settings.period.times(k);
            if passed >= *over || self.full {
                break;
            }
            let part = ease.at(passed.over(*over).unwrap_or(1.0));
            let values: Vec<f64> =
                starts.iter().zip(motion.values()).map(|(start, glide)| start + (glide.to - start) * part).collect();
            if !self.sample(at.plus(passed), going, &values, from) {
                return;
            }
        }
        let targets: Vec<f64> = motion.values().iter().map(|glide| glide.to).collect();
        self.sample(end, going, &targets, from);
    }

    /// Whether a move so long may be sampled. Moves that do not overlap stay below the bound; those that clash may not.
    fn may_sample(&mut self, over: Time, from: Origin) -> bool {
        let samples = over.micros().0 / self.settings.period.micros().0.max(1);
        if let Some(left) = self.samples_left.checked_sub(samples) {
            self.samples_left = left;
            return true;
        }
        if !self.full {
            self.full = true;
            let message = format!("the moves of the script have more than {MAX_STEPS} samples");
            let help = "make them shorter, or choose a lower `rate`";
            self.report(diagnostic!(TooManySteps, from.span, "{message}"; help: "{help}"), from);
        }
        false
    }

    /// Where each value of a move starts; `None` where one is not known, which is reported.
    fn starts(&mut self, motion: &Motion, from: Origin) -> Option<Vec<f64>> {
        let board = self.board;
        let known = self.state.values(board, motion.verb, motion.index);
        let mut starts = Vec::new();
        for (at, glide) in motion.values().iter().enumerate() {
            let start = glide.from.or_else(|| known.get(at).copied().flatten().map(f64::from));
            let Some(start) = start else {
                let occupied = board.occupied(motion.verb, motion.index);
                let rest = occupied.first().and_then(|resource| board.rest(*resource));
                let help = match rest {
                    Some(rest) => format!(
                        "put a `{}` before it, so that it starts from 0, or write where each value starts",
                        board.show(rest)
                    ),
                    None => "send it somewhere first, or write where it starts".to_owned(),
                };
                let help = format!("{help}: `{}`", motion.with_starts(board));
                let message = format!("nobody knows where the {} starts", motion.name(board, at));
                self.report(diagnostic!(UnknownStart, from.span, "{message}"; help: "{help}"), from);
                // Origin here on it is known, so that one mistake is one message.
                if let Some(target) = motion.target(board) {
                    self.state.apply(board, &target);
                    for resource in occupied {
                        if let Some(last) = self.last.get_mut(*resource) {
                            *last = from;
                        }
                    }
                }
                return None;
            };
            starts.push(start);
        }
        Some(starts)
    }

    /// Sends one sample, if it says anything new. `false` where it is out of range, which is reported.
    fn sample(&mut self, at: Time, going: &Move, values: &[f64], from: Origin) -> bool {
        let board = self.board;
        let command = match going.motion.command(board, values) {
            Ok(command) => command,
            Err(wrong) => {
                let name = going.motion.name(board, wrong);
                let value = values.get(wrong).copied().unwrap_or(0.0);
                let diagnostic = diagnostic!(OutOfRange, from.span,
                    "on the way the {name} gets to {value:.0}, which is out of range";
                    help: "choose an easing that does not overshoot, or stay further inside the range");
                self.report(diagnostic, from);
                return false;
            }
        };
        if let Some(diagnostic) = broken_limit(board, &self.settings.limits, &command, from.span) {
            self.report(diagnostic, from);
            return false;
        }
        if board.is_drive(&command) {
            self.tell_raw_drives(at, from);
        }
        if !self.state.has(board, &command) {
            self.send(at, &command, Kind::Sample, from);
        }
        true
    }
}
