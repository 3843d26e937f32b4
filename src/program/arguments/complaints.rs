//! What is said of arguments that are too many, too few, or have unknown names.

use super::super::ease::Ease;
use super::super::suggest::suggest;
use super::super::words::{self, MODIFIERS, Word};
use super::{Arguments, number_text};
use crate::board::{Axis, ValueForm};
use crate::diagnostic::{Diagnostic, diagnostic};
use crate::source::Span;
use crate::syntax::{Argument, foreign};

impl Arguments<'_, '_, '_, '_> {
    /// What is said of the first argument that is one too many.
    pub(super) fn too_many(&self, argument: &Argument<'_>) -> Diagnostic {
        let name = self.row().name;
        let whole = self.command.span;
        if let Some(word) = argument.bare_word().filter(|word| words::find(self.eval.board, word.text).is_some()) {
            let (before, after) = (Span { end: word.span.start, ..whole }, Span { start: word.span.start, ..whole });
            let (this, next) = (self.eval.rewritten(before, &[]), self.eval.rewritten(after, &[]));
            let length = self.eval.written(before).trim_end().len();
            let space = Span { start: whole.start + u32::try_from(length).unwrap_or(0), end: word.span.start };
            let diagnostic = diagnostic!(UnexpectedArgument, argument.span, "`{}` needs a line of its own", word.text;
                help: "write two lines: `{this}`, then `{next}`");
            return match self.word {
                Word::Row(row) if row.alone => diagnostic.fix(space, "\n"),
                _ => Diagnostic {
                    help: format!("{}; or `{this}; {next}` to start both together", diagnostic.help),
                    ..diagnostic
                },
            };
        }
        let help = self.meant(argument).unwrap_or_else(|| self.row().how());
        let is_first = self.command.arguments.first().is_some_and(|first| first.span == argument.span);
        let more = if is_first { "" } else { "more " };
        diagnostic!(UnexpectedArgument, argument.span, "`{name}` takes no {more}arguments"; help: "{help}")
    }

    /// What is said of `NAME=VALUE` with an unknown name.
    pub(super) fn unknown_axis(&self, argument: &Argument<'_>) -> Diagnostic {
        let row = self.row();
        let name = argument.name.unwrap_or(self.command.head);
        let small = name.text.to_lowercase();
        let axes = if let Word::Verb(_, verb) = self.word { verb.axes.as_slice() } else { &[] };
        if axes.iter().any(|axis| axis.name == small) {
            let line = self.eval.rewritten(self.command.span, &[(name.span, small.clone())]);
            return diagnostic!(UnexpectedArgument, argument.span, "axes are written in lower case";
                help: "write `{line}`"; fix: name.span => "{small}");
        }
        diagnostic!(UnexpectedArgument, argument.span, "`{}` has no `{}=`", row.name, name.text; help: "{}", row.how())
    }

    /// What an argument that is one too many may have been meant for.
    fn meant(&self, argument: &Argument<'_>) -> Option<String> {
        let time = number_text(argument).filter(|text| text.ends_with(['s', 'm', 'h']));
        if let Some(time) = time.filter(|_| self.row().holds) {
            return Some(format!("write `for {time}` to hold it that long"));
        }
        if let Some(time) = time.filter(|_| self.row().moves) {
            return Some(format!("write `over {time}` to move in that time"));
        }
        let word = argument.bare_word()?.text;
        let easing = Ease::named(word).map_or_else(|| foreign::easing_named(word), |ease| Some(ease.name()));
        if let Some(easing) = easing.filter(|easing| self.row().moves && Ease::named(easing).is_some()) {
            let arguments = &self.command.arguments;
            let over =
                arguments.iter().position(|argument| argument.bare_word().is_some_and(|word| word.text == "over"));
            let time = over.and_then(|over| arguments.get(over + 1)).map_or("1s", |time| self.eval.written(time.span));
            return Some(format!("write `over {time} ease {easing}`"));
        }
        if self.row().moves && matches!(word, "to" | "from") {
            return Some("write an arrow from one value to the other: `1500 -> 900`".to_owned());
        }
        if self.row().moves && word == "in" {
            return Some("write `over 1s` for the time that the move takes".to_owned());
        }
        if self.row().block && word == "times" {
            return Some("remove `times`: `repeat 3 { … }`".to_owned());
        }
        if word == "at" {
            return Some(format!("a start time comes first in its line: `at 1s {} …`", self.row().name));
        }
        suggest(word, MODIFIERS.iter().map(|(modifier, _)| *modifier)).map(|near| format!("did you mean `{near}`?"))
    }

    /// What is said of missing arguments.
    pub(super) fn too_few(&self) -> Diagnostic {
        let (name, head) = (self.row().name, self.command.head.span);
        let arguments = &self.command.arguments;
        let whole = arguments.last().map_or(head, |last| head.to(last.span));
        let how = self.row().how();
        let Word::Verb(_, verb) = self.word else {
            return diagnostic!(MissingArgument, whole, "`{name}` needs more arguments"; help: "{how}");
        };
        if let [Axis { takes: ValueForm::Word(words), .. }] = verb.axes.as_slice()
            && verb.holds
            && let Some((word, _)) = words.iter().find(|(_, value)| *value != 0).filter(|_| !arguments.is_empty())
        {
            let line = self.eval.rewritten(whole, &[(head, format!("{name} {word}"))]);
            return diagnostic!(MissingArgument, whole, "`{word}` is missing after `{name}`";
                help: "write `{line}`"; fix: head => "{name} {word}");
        }
        let values: Vec<&str> = self.row().usage.split(' ').skip(1).collect();
        let is_plain = verb.axes.iter().all(|axis| axis.name.is_empty() && !matches!(axis.takes, ValueForm::Bytes(_)));
        let given = arguments.iter().filter(|argument| argument.name.is_some()).count();
        if is_plain && given > 0 && given == values.len() {
            let named = arguments.iter().filter(|argument| argument.name.is_some());
            let edits: Vec<_> = named.map(|argument| (argument.span, self.value_text(argument))).collect();
            let line = self.eval.rewritten(whole, &edits);
            return diagnostic!(InvalidArgument, whole, "the values of `{name}` have no names"; write: whole => "{line}");
        }
        if is_plain && values.len() > 1 {
            let given = arguments.len() - 2 * self.modifiers.len().min(arguments.len() / 2);
            return diagnostic!(MissingArgument, whole, "`{name}` takes {} values ({}), not {given}",
                in_words(values.len()), values.join(" "); help: "{how}");
        }
        diagnostic!(MissingArgument, whole, "`{name}` needs more arguments"; help: "{how}")
    }

    /// The values of an argument, without its name.
    fn value_text(&self, argument: &Argument<'_>) -> String {
        let written = self.eval.written(argument.span);
        written.split_once('=').map_or(written, |(_, value)| value).trim().to_owned()
    }
}

/// A small number in words.
fn in_words(number: usize) -> String {
    const WORDS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];
    WORDS.get(number).map_or_else(|| number.to_string(), |word| (*word).to_owned())
}
