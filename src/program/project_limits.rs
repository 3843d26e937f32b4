//! Reads the limits that a project sets for all of its scripts.

use std::sync::Arc;

use super::limits::Limit;
use super::settings::limitable;
use super::{Options, programs};
use crate::board::{Board, Limited, Measure, ValueForm};
use crate::diagnostic::{Code, Diagnostic, Diagnostics, Edit, diagnostic};
use crate::source::{Source, Sources, Span};
use crate::syntax;

/// A range that a project sets for all of its scripts, on each board that has such a value. A script can only narrow
/// it. It comes as data, because the library reads no configuration file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ProjectLimit {
    /// What is limited: a name of [`limit_items`].
    pub name: String,
    /// The smallest value allowed, as a script writes it.
    pub low: f64,
    /// The largest value allowed.
    pub high: f64,
    /// Where the project sets it, for messages: `motionseq.toml:4`.
    pub place: String,
    /// What the numbers measure. The limit applies to no value that measures something else.
    measure: Measure,
}

impl ProjectLimit {
    /// The limit on a board, and its place; `None` if the board has no such value.
    pub(super) fn on(&self, board: &Board) -> Option<(Limit, String)> {
        let (_, limited) = limit_items(board).into_iter().find(|(name, _)| *name == self.name)?;
        let axis = board.axis(limited).filter(|axis| axis.unit.measure == self.measure)?;
        let limit = Limit { limited, low: axis.value(self.low), high: axis.value(self.high), span: None };
        Some((limit, self.place.clone()))
    }

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
        let scale = f64::from(board.axis(limited).map_or(1, |axis| axis.scale));
        let name = name_of(board, limited);
        let measure = board.axis(limited).map_or(Measure::Number, |axis| axis.unit.measure);
        Ok(ProjectLimit { name, low: found.low / scale, high: found.high / scale, place: place.into(), measure })
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
        Some(script) => {
            let programs = programs(script, &sources, &options, &mut diagnostics);
            programs.into_iter().next().map(|program| program.settings.limits).unwrap_or_default()
        }
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
        let named = verb.moving().iter().enumerate().filter(|(_, axis)| !verb.label(axis).is_empty());
        let mut axes: Vec<Option<usize>> = named.map(|(at, _)| Some(at)).collect();
        if axes.is_empty() {
            axes.push(None);
        }
        for index in indices {
            found.extend(axes.iter().map(|axis| Limited { verb: id, index, axis: *axis }));
        }
    }
    found.into_iter().map(|limited| (name_of(board, limited), limited)).collect()
}

fn name_of(board: &Board, limited: Limited) -> String {
    board.limited_name(limited).replace(' ', "-")
}
