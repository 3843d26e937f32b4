//! What opens the gates of a script when it is rehearsed: the answers on its `# rehearse:` lines.

use crate::board::{Board, Hundredths};
use crate::program::Measured;
use crate::timeline::Gate;
use crate::units::Micros;

/// The answers to gates, in order; the last one of each kind is for all further gates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// How long the operator takes to say go.
    go: Vec<Micros>,
    /// The name of a quantity, the value that the board reports, and when it does, from the start of the gate.
    values: Vec<(String, Hundredths, Micros)>,
}

/// The answer to one gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// The operator says go after this time.
    Go(Micros),
    /// The board reports this value after this time.
    Value(Hundredths, Micros),
}

impl Answers {
    /// Takes the answers out of a list such as `go=2s, turned=95deg@3s, unplug@4s`, and returns the rest of it.
    ///
    /// # Errors
    /// What is wrong with an answer.
    pub(super) fn take(&mut self, boards: &[&Board], list: &str) -> Result<String, String> {
        let all: Vec<Measured> = boards.iter().flat_map(|board| Measured::all(board)).collect();
        let mut rest = Vec::new();
        for item in list.split(',').map(str::trim) {
            let (name, value) = item.split_once('=').unwrap_or((item, ""));
            let (name, value) = (name.trim(), value.trim());
            let wrong = |example: &str| format!("`{item}` is not an answer to a gate; write `{example}`");
            if name == "go" {
                self.go.push(time(value).ok_or_else(|| wrong("go=2s"))?);
            } else if let Some(measured) = all.iter().find(|measured| measured.name() == name) {
                let (value, at) = value.split_once('@').unwrap_or((value, ""));
                let number = value.trim_end_matches(|c: char| c.is_ascii_alphabetic());
                let given = |text: &str, other: &str| if text.is_empty() { other.to_owned() } else { text.to_owned() };
                let example = format!("{name}={}{}@{}", given(number, "5"), measured.unit(), given(at, "2s"));
                let value = value.strip_suffix(measured.unit()).and_then(hundredths);
                let (value, at) = value.zip(time(at)).ok_or_else(|| wrong(&example))?;
                self.values.push((name.to_owned(), value, at));
            } else {
                rest.push(item);
            }
        }
        Ok(rest.join(","))
    }

    /// The kinds of answers that no gate of these waits for.
    pub(super) fn unused<'a>(&'a self, gates: &'a [&'a Gate]) -> impl Iterator<Item = &'a str> {
        let go = (!self.go.is_empty()).then_some("go");
        let kinds = self.values.iter().map(|(name, ..)| name.as_str()).chain(go);
        kinds.filter(|given| !gates.iter().any(|gate| kind(gate) == *given))
    }

    /// The answer to a gate, which is the `number`th of its kind, counted from 0. Without one, the operator says go at once.
    pub(super) fn to(&self, gate: &Gate, number: usize) -> Option<Answer> {
        if gate.gate.is_go() {
            return Some(Answer::Go(self.go.get(number).or(self.go.last()).copied().unwrap_or_default()));
        }
        let mut values = self.values.iter().filter(|(name, ..)| *name == kind(gate));
        let nth = values.clone().nth(number);
        nth.or_else(|| values.next_back()).map(|(_, value, at)| Answer::Value(*value, *at))
    }
}

/// The kind of answer that a gate needs: the name of a quantity, or `go`.
pub(super) fn kind(gate: &Gate) -> &str {
    let other = if gate.gate.is_go() { "go" } else { "" };
    gate.gate.criterion().map_or(other, |criterion| criterion.measured.name())
}

fn time(text: &str) -> Option<Micros> {
    text.parse().ok().filter(|time| *time <= Micros::DAY)
}

fn hundredths(number: &str) -> Option<Hundredths> {
    let hundredths = libm::round(number.parse::<f64>().ok()? * 100.0);
    #[expect(clippy::cast_possible_truncation, reason = "in range")]
    (-1e9..=1e9).contains(&hundredths).then_some(Hundredths(hundredths as i32))
}
