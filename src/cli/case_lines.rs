//! The lines that `test` shows for a script.

use motionseq::diagnostic::escaped;
use motionseq::verify::{Case, Problem, Status, shortened};

use super::color::{Style, painted};
use super::exit::Exit;
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
    is_colored: bool,
}

impl Shown {
    pub(super) fn new(screen: &Screen, all: bool, has_hint: bool) -> Self {
        let problems = if all || screen.is_verbose() { usize::MAX } else { SHOWN };
        Shown { problems, has_hint, is_colored: screen.colors_results() }
    }

    /// A case in lines for a terminal.
    pub(super) fn lines(self, case: &Case) -> Vec<String> {
        let (failed, words) = (Style::Red.paint("FAILED", self.is_colored) + " ", case.status.words());
        let (mark, words) = match (case.status, case.status.is_passed()) {
            (Status::Orphan | Status::Kept, _) => ("warning: ", words.to_owned()),
            (_, true) => ("", Style::Green.paint(words, self.is_colored)),
            (_, false) => (&*failed, words.to_owned()),
        };
        let problem = |problem: &Problem| match &problem.change {
            Some(words) => format!("  {}", painted(words, self.is_colored)),
            None => format!("  {}", escaped(&problem.located())),
        };
        let mut lines = vec![format!("{mark}{}: {words}", escaped(&case.name))];
        lines.extend(shortened(&case.problems, self.problems).map(problem));
        let more = case.problems.len() - (lines.len() - 1) + case.left_out;
        if more > 0 {
            let how = if case.left_out == 0 { "; -v shows them" } else { "" };
            lines.push(format!("  and {}{how}", more_of(more, case.status)));
        }
        lines.extend(case.hint().filter(|_| self.has_hint).map(|hint| format!("  {}", escaped(&hint))));
        lines
    }
}

/// Whether a case is worth a line.
pub(super) fn is_shown(case: &Case, screen: &Screen) -> bool {
    let is_note = matches!(case.status, Status::Orphan | Status::Pruned | Status::Kept);
    !case.status.is_passed() || screen.is_verbose() || is_note && !screen.is_quiet()
}

fn more_of(count: usize, status: Status) -> String {
    let word = if status == Status::Differs { "change" } else { "error" };
    plural(count, &format!("more {word}"))
}

/// How a test with these cases ends.
pub(super) fn exit_of<'c>(cases: impl IntoIterator<Item = &'c Case>) -> Exit {
    let failed: Vec<&Case> = cases.into_iter().filter(|case| !case.status.is_passed()).collect();
    match failed.iter().all(|case| case.status == Status::ExpectFailed) {
        _ if failed.is_empty() => Exit::Ok,
        true => Exit::Expect,
        false => Exit::Script,
    }
}
