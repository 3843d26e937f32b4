//! Reads the limits that a project sets for all of its scripts.

use std::sync::Arc;

use super::limits::{Limit, ProjectLimit};
use super::settings::limitable;
use super::{Options, program};
use crate::board::{Board, Limited, ValueForm};
use crate::diagnostic::{Code, Diagnostic, Diagnostics, Edit, diagnostic};
use crate::source::{Source, Sources, Span};
use crate::syntax;

impl ProjectLimit {
    /// Reads a range, as the setting `limit` of a script does: `900..1700`, `-10..10`. `place` is where it is set.
    ///
    /// # Errors
    /// What is wrong with the range, such as an end that the board does not accept. Spans are positions in `range`.
    pub fn read(
        board: &Arc<Board>,
        limited: Limited,
        range: &str,
        place: impl Into<String>,
    ) -> Result<Self, Box<Diagnostic>> {
        let setting = format!("limit {} ", board.limited_name(limited));
        let found = one_limit(board, limited, &setting, range).map_err(|error| {
            let inside = |offset: u32| (offset as usize).saturating_sub(setting.len()).min(range.len());
            let moved = |span: Span| Span::new(inside(span.start), inside(span.end));
            let fix = error.fix.clone().map(|edit| Edit { span: moved(edit.span), ..edit });
            Box::new(Diagnostic { span: moved(error.span), related: Vec::new(), fix, ..*error })
        })?;
        Ok(ProjectLimit { limited, low: found.low, high: found.high, place: place.into() })
    }
}

/// The limit that the line `setting` with this range sets.
fn one_limit(board: &Arc<Board>, limited: Limited, setting: &str, range: &str) -> Result<Limit, Box<Diagnostic>> {
    let none = || {
        let diagnostic = diagnostic!(InvalidArgument, Span::new(setting.len(), setting.len() + range.len()), "a range is needed here";
            help: "write the smallest and the largest value with `..` between them: `900..1700`");
        Box::new(diagnostic)
    };
    // Nothing but the range of one setting, without calculations: a random limit would limit nothing.
    if range.trim().is_empty() || range.contains(['\n', '\r', ';', '#', '{', '"', '(']) {
        return Err(none());
    }
    let sources = Sources::from(Source::new("", format!("{setting}{range}\n")));
    let mut diagnostics = Diagnostics::default();
    let options = Options::default().with_board(Arc::clone(board));
    let limits = match syntax::read(sources.main(), &mut diagnostics) {
        Some(script) => program(script, &sources, &options, &mut diagnostics).settings.limits,
        None => Vec::new(),
    };
    if let Some(error) = diagnostics.iter().find(|diagnostic| diagnostic.is_error()) {
        // Other errors are about texts that are not a range.
        let is_about_range = matches!(error.code, Code::OutOfRange | Code::Unit);
        return Err(if is_about_range { Box::new(error.clone()) } else { none() });
    }
    limits.into_iter().find(|limit| limit.limited == limited && limit.span.is_some()).ok_or_else(none)
}

/// Everything that can be limited, with its name in a configuration file: `servo-2`, `rocker-y`.
pub fn limit_items(board: &Board) -> Vec<(String, Limited)> {
    /// The most values of an index.
    const MANY: usize = 1_000;
    let mut found = Vec::new();
    for verb in limitable(board) {
        let Some((id, _)) = board.find(&verb.word) else { continue };
        let index = verb.axes.first().filter(|axis| axis.takes == ValueForm::Index);
        let indices: Vec<Option<i32>> = match index {
            Some(axis) => (axis.range.0..=axis.range.1).take(MANY).map(Some).collect(),
            None => vec![None],
        };
        let named = verb.moving().iter().enumerate().filter(|(_, axis)| !axis.name.is_empty());
        let mut axes: Vec<Option<usize>> = named.map(|(at, _)| Some(at)).collect();
        if axes.is_empty() {
            axes.push(None);
        }
        for index in indices {
            found.extend(axes.iter().map(|axis| Limited { verb: id, index, axis: *axis }));
        }
    }
    found.into_iter().map(|limited| (board.limited_name(limited).replace(' ', "-"), limited)).collect()
}
