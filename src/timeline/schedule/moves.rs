//! Moves: their starting values, and their frames.

use super::super::{Kind, Tween};
use super::{Origin, Scheduler};
use crate::diagnostic::diagnostic;
use crate::program::{MAX_STEPS, Motion, Move, Time, broken_limit};

impl Scheduler<'_> {
    /// Samples a move: its starting values if the script gives them, then every period, then
    /// exactly the target. A sample that equals the last frame of the resource is not sent.
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

    #[expect(clippy::too_many_arguments, reason = "a move with its times and values")]
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
        self.sample(end, going, &targets, self.before_gate(at, end, from));
    }

    /// Whether the budget allows the samples of this move. Moves that do not overlap stay within
    /// it; clashing ones may exceed it.
    fn may_sample(&mut self, over: Time, from: Origin) -> bool {
        let samples = over.micros().0 / self.settings.period.micros().0.max(1);
        if let Some(left) = self.samples_left.checked_sub(samples) {
            self.samples_left = left;
            return true;
        }
        if !self.full {
            self.full = true;
            let message = format!("the moves of the script have more than {MAX_STEPS} samples");
            let help = "shorten them, or choose a lower `rate`";
            self.report(diagnostic!(TooManySteps, from.span, "{message}"; help: "{help}"), from);
        }
        false
    }

    /// The starting values of a move. Reports an unknown one and returns `None`.
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
                        "send `{}` before it, so that it starts from 0, or write the starting values",
                        board.show(rest)
                    ),
                    None => "set it first, or write the starting value".to_owned(),
                };
                let help = format!("{help}: `{}`", motion.with_starts(board));
                let message = format!("the starting value of the {} is unknown", motion.name(board, at));
                self.report(diagnostic!(UnknownStart, from.span, "{message}"; help: "{help}"), from);
                // Treat the target as known from here on, so that one mistake gives one message.
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

    /// Sends one sample unless it changes nothing. Reports a value out of range and returns
    /// `false`.
    fn sample(&mut self, at: Time, going: &Move, values: &[f64], from: Origin) -> bool {
        let board = self.board;
        let command = match going.motion.command(board, values) {
            Ok(command) => command,
            Err(wrong) => {
                let name = going.motion.name(board, wrong);
                let value = going.motion.shown(board, wrong, values.get(wrong).copied().unwrap_or(0.0));
                let diagnostic = diagnostic!(OutOfRange, from.span,
                    "during the move, the {name} reaches {value:.0}, which is out of range";
                    help: "choose an easing that does not overshoot, or a target further inside the range");
                self.report(diagnostic, from);
                return false;
            }
        };
        if let Some(diagnostic) = broken_limit(board, self.settings, &command, from.span) {
            self.report(diagnostic, from);
            return false;
        }
        if board.is_drive(&command) {
            self.apply_raw_drives(at, from);
        }
        if !self.state.has(board, &command) {
            self.send(at, &command, Kind::Sample, from);
        }
        true
    }
}
