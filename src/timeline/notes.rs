//! What a script contains besides its frames: marks, `say` and `expect`.

use super::Timeline;
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
}

impl NoteKind {
    /// All kinds.
    pub const ALL: &[NoteKind] = &[NoteKind::Mark, NoteKind::Say, NoteKind::Expect];

    /// The word in a script.
    pub fn word(self) -> &'static str {
        match self {
            NoteKind::Mark => "mark",
            NoteKind::Say => "say",
            NoteKind::Expect => "expect",
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
        let mut notes: Vec<Note> = marks.chain(says).chain(expects).collect();
        notes.sort_by_key(|note| note.at);
        notes
    }
}
