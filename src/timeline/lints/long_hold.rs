//! A drive command without a `for` lasts long: often the line that ends it was forgotten.

use crate::diagnostic::{Diagnostic, diagnostic};
use crate::program::Time;
use crate::source::Span;

/// A longer hold without `for` is probably a forgotten `stop`.
const LONG_HOLD: Time = Time::from_millis(10_000);

/// What is said of a command, as a script writes it, that lasted until another line ended it.
pub(in super::super) fn check(command: &str, lasted: Time, span: Span) -> Option<Diagnostic> {
    let warning = || {
        diagnostic!(LongHold, span, "`{command}` keeps driving for {lasted} until another line ends it";
            help: "if that is intended, write `{command} for {lasted}`")
        .label("no `for`")
    };
    (lasted > LONG_HOLD).then(warning)
}
