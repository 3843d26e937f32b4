//! The lines that `test` shows for a script.

use motionseq::verify::{Case, Status, shortened};

use super::screen::{Screen, plural};

/// How many changes of one script are shown without `-v`.
const SHOWN: usize = 20;

/// How much is shown of each case.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    /// The most problems.
    problems: usize,
    /// Whether the command that accepts a difference is shown.
    has_hint: bool,
}

impl Shown {
    pub(super) fn new(screen: &Screen, all: bool, has_hint: bool) -> Self {
        Shown { problems: if all || screen.is_verbose() { usize::MAX } else { SHOWN }, has_hint }
    }

    /// A case in lines.
    pub(super) fn lines(self, case: &Case) -> Vec<String> {
        let mark = match (case.status, case.status.is_passed()) {
            (Status::Orphan, _) => "warning: ",
            (_, true) => "",
            (_, false) => "FAILED ",
        };
        let mut lines = vec![format!("{mark}{}: {}", case.name, case.status.words())];
        lines.extend(shortened(&case.problems, self.problems).map(|problem| format!("  {}", problem.located())));
        let more = case.problems.len() - (lines.len() - 1) + case.left_out;
        if more > 0 {
            let how = if case.left_out == 0 { "; -v shows them" } else { "" };
            lines.push(format!("  and {}{how}", more_of(more, case.status)));
        }
        lines.extend(case.hint().filter(|_| self.has_hint).map(|hint| format!("  {hint}")));
        lines
    }
}

/// Whether a case is worth a line.
pub(super) fn is_shown(case: &Case, screen: &Screen) -> bool {
    let is_note = matches!(case.status, Status::Orphan | Status::Pruned);
    !case.status.is_passed() || screen.is_verbose() || is_note && !screen.is_quiet()
}

fn more_of(count: usize, status: Status) -> String {
    let word = if status == Status::Differs { "change" } else { "error" };
    plural(count, &format!("more {word}"))
}
