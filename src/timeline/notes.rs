//! What a script contains besides its frames: marks, `say`, `expect` and gates.

use super::{Cut, Gate, Timeline};
use crate::diagnostic::escaped;
use crate::source::Span;
use crate::units::Micros;

/// A line of a script that the robot does not receive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The time from the start of the script.
    pub at: Micros,
    /// What it is.
    pub kind: NoteKind,
    /// The line in the notation of scripts, such as `mark bow`, with invisible characters escaped.
    pub words: String,
    /// Its place in the script.
    pub span: Span,
}

/// The command of a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoteKind {
    /// A named moment.
    Mark,
    /// A line to show.
    Say,
    /// What the board is expected to report.
    Expect,
    /// What stops the clock of the script.
    Gate,
}

impl NoteKind {
    /// All kinds.
    pub const ALL: &[NoteKind] = &[NoteKind::Mark, NoteKind::Say, NoteKind::Expect, NoteKind::Gate];

    /// The word in a script.
    pub fn word(self) -> &'static str {
        match self {
            NoteKind::Mark => "mark",
            NoteKind::Say => "say",
            NoteKind::Expect => "expect",
            NoteKind::Gate => "wait",
        }
    }
}

impl Timeline {
    /// The notes of the run, or those of `on abort`, sorted by time.
    pub fn notes(&self, aborts: bool) -> Vec<Note> {
        let note = |kind: NoteKind, at: Micros, words: &str, span: Span| {
            let words = escaped(&format!("{} {words}", kind.word()));
            Note { at, kind, words, span }
        };
        let cues = if aborts { &self.abort_cues } else { &self.cues };
        let says = cues.iter().map(|cue| note(NoteKind::Say, cue.at, &format!("\"{}\"", cue.text), cue.span));
        if aborts {
            return says.collect();
        }
        let marks = self.marks.iter().map(|mark| note(NoteKind::Mark, mark.at, &mark.name, mark.span));
        let expects = self.expects.iter().map(|due| {
            let why = due.expect.why.as_ref().map(|why| format!(" \"{why}\"")).unwrap_or_default();
            note(NoteKind::Expect, due.at, &format!("{}{why}", due.expect), due.span)
        });
        let before = |which: fn(&Cut) -> usize, at: usize| self.gates.partition_point(|gate| which(&gate.next) <= at);
        let marks = marks.enumerate().map(|(at, note)| (before(|next| next.marks, at), note));
        let says = says.enumerate().map(|(at, note)| (before(|next| next.cues, at), note));
        let expects = expects.enumerate().map(|(at, note)| (before(|next| next.expects, at), note));
        let gates = gate_notes(&self.gates).into_iter().enumerate();
        let mut notes: Vec<(usize, Note)> = marks.chain(says).chain(expects).chain(gates).collect();
        // A gate comes after what is before it at the same time.
        notes.sort_by_key(|(gates, note)| (note.at, *gates));
        notes.into_iter().map(|(_, note)| note).collect()
    }
}

/// The notes of some gates.
pub fn gate_notes(gates: &[Gate]) -> Vec<Note> {
    let note = |gate: &Gate| Note {
        at: gate.at,
        kind: NoteKind::Gate,
        words: escaped(&gate.gate.to_string()),
        span: gate.span,
    };
    gates.iter().map(note).collect()
}
