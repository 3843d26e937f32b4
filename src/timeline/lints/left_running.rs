//! A script ends while something still runs.

use crate::board::Resource;
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;

/// What is said of a resource that still runs at the end, where `rest` is the command that ends it, as a script writes it.
pub(in super::super) fn warning(resource: &Resource, rest: &str, span: Span) -> Diagnostic {
    let Resource { name, activity, .. } = resource;
    diagnostic!(LeftRunning, span, "{name} is still {activity} when the script ends";
        help: "end the script with `{rest}`; motionseq sends it in any case")
}
