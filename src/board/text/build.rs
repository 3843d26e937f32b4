//! Makes the table of a text board from the rows of its file.

use std::sync::Arc;

use super::codec::{self, Templates};
use super::template::{Field, Template};
use crate::board::{
    Activity, AngleScale, Axis, Board, Command, MAX_BAUD, Measure, Replies, Resource, ResourceId, Sets, Simulation,
    Text, Unit, ValueForm, Verb, VerbId,
};
use crate::diagnostic::{Code, Diagnostic, Diagnostics};
use crate::source::Span;
use crate::units::Micros;

/// The contents of a file.
pub(super) struct FileRows {
    pub(super) name: String,
    pub(super) baud: u32,
    pub(super) verbs: Vec<VerbRow>,
    pub(super) hello: Vec<Line>,
    pub(super) goodbye: Vec<Line>,
    pub(super) stop: Vec<Line>,
    /// The start of the file.
    pub(super) span: Span,
}

/// A verb as the file describes it.
#[derive(Clone)]
pub(super) struct VerbRow {
    pub(super) word: String,
    pub(super) span: Span,
    pub(super) axes: Vec<AxisRow>,
    pub(super) send: Line,
    pub(super) moves: bool,
    pub(super) holds: bool,
    pub(super) rest: Option<Line>,
    pub(super) refresh: Option<Micros>,
    pub(super) resource: Option<String>,
    pub(super) meaning: String,
}

impl VerbRow {
    /// The name of what it sets.
    fn sets(&self) -> &str {
        self.resource.as_ref().unwrap_or(&self.word)
    }
}

/// An axis as the file describes it.
#[derive(Clone)]
pub(super) struct AxisRow {
    pub(super) field: Field,
    pub(super) span: Span,
    pub(super) is_index: bool,
    pub(super) words: Option<Vec<(String, i32)>>,
    pub(super) measure: Measure,
    pub(super) angle: Option<AngleScale>,
}

/// A template with its place.
#[derive(Clone)]
pub(super) struct Line {
    pub(super) template: Template,
    pub(super) span: Span,
}

/// The most resources of a board.
const MAX_RESOURCES: usize = 1_024;
/// The longest stop in bytes.
const MAX_STOP: usize = 8 * 1_024;
/// The usual speed of a servo, 60° in 0.12 s, in µs of pulse width per second.
const SERVO_SPEED: u32 = 5_500;

/// A board under construction.
struct Builder<'d> {
    board: Board,
    templates: Vec<Template>,
    /// Where each template is in the file.
    spans: Vec<Span>,
    groups: Vec<Group>,
    diagnostics: &'d mut Diagnostics,
}

/// The resources that verbs share: one, or one for each value of an index.
struct Group {
    name: String,
    index: Option<(i32, i32)>,
    first: ResourceId,
    rest: Option<Line>,
    refresh: Option<Micros>,
    /// Whether holding it means that the robot moves: a held number does, a held word such as `on` does not.
    drives: bool,
}

impl Group {
    /// The values of the index; one `None` without an index.
    fn indices(&self) -> Vec<Option<i32>> {
        self.index.map_or_else(|| vec![None], |(least, most)| (least..=most).map(Some).collect())
    }

    fn resources(&self) -> Vec<ResourceId> {
        (self.first..).take(self.indices().len()).collect()
    }
}

/// Makes the board; `None` if its rows do not fit together, which is reported.
pub(super) fn board(rows: &FileRows, name: &str, diagnostics: &mut Diagnostics) -> Option<Board> {
    let board = Board {
        name: Text::Owned(rows.name.clone()),
        line: Text::Owned(format!("\"{name}\"")),
        baud: rows.baud,
        max_baud: MAX_BAUD,
        resources: Vec::new(),
        verbs: Vec::new(),
        limits: Vec::new(),
        quantities: Vec::new(),
        changes: Vec::new(),
        reporting: None,
        hello: Vec::new(),
        goodbye: Vec::new(),
        stop: Vec::new(),
        without_stop: Text::Borrowed("this board has no stop, so its outputs stay as they are"),
        flushes: true,
        ambiguity: None,
        foreign: Vec::new(),
        picture: None,
        simulation: Simulation::State,
        codec: Arc::new(Templates { verbs: Vec::new(), longest: 1 }),
        replies: Replies::None,
        feedback: None,
    };
    let mut builder = Builder { board, templates: Vec::new(), spans: Vec::new(), groups: Vec::new(), diagnostics };
    let groups: Option<Vec<usize>> = rows.verbs.iter().map(|verb| builder.group(verb)).collect();
    let groups = groups?;
    for (verb, group) in rows.verbs.iter().zip(groups) {
        builder.verb(verb, group);
    }
    builder.compare()?;
    builder.rests(&rows.verbs)?;
    let hello = rows.hello.iter().map(|line| builder.fixed(line)).collect::<Option<_>>()?;
    let goodbye = rows.goodbye.iter().map(|line| builder.fixed(line)).collect::<Option<_>>()?;
    let lines = rows.stop.iter().map(|line| builder.fixed(line)).collect::<Option<Vec<Command>>>()?;
    let Builder { mut board, templates, .. } = builder;
    let rests = board.resources.iter().rev().filter_map(|resource| resource.rest.clone());
    let stop: Vec<Command> = rests.chain(lines).collect();
    (board.hello, board.goodbye) = (hello, goodbye);
    let longest = templates.iter().map(Template::longest).max().unwrap_or(1).max(1);
    board.codec = Arc::new(Templates { verbs: templates, longest });
    if stop.iter().map(|command| board.frame_length(command)).sum::<usize>() > MAX_STOP {
        let message = format!("all rests and the `stop` lines together are longer than {MAX_STOP} bytes");
        diagnostics.push(Diagnostic::new(Code::BoardValue, rows.span, message, "shorten them, or narrow the indices"));
        return None;
    }
    // A frame that was truncated may spoil the first, and the line the second.
    board.stop = [stop.clone(), stop.clone(), stop].concat();
    board.flushes = !board.stop.is_empty();
    Some(board)
}

impl Builder<'_> {
    fn wrong<T>(&mut self, code: Code, span: Span, message: impl Into<String>, help: impl Into<String>) -> Option<T> {
        self.diagnostics.push(Diagnostic::new(code, span, message, help));
        None
    }

    /// The group of the resources that a verb sets.
    fn group(&mut self, verb: &VerbRow) -> Option<usize> {
        let name = verb.sets();
        let index = verb.axes.first().filter(|axis| axis.is_index).map(|axis| axis.field.range);
        let found = self.groups.iter().position(|group| group.name == *name);
        let at = found.unwrap_or_else(|| {
            let first = self.board.resources.len();
            let group = Group { name: name.to_owned(), index, first, rest: None, refresh: None, drives: false };
            self.board.resources.extend(group.indices().into_iter().map(|index| resource(name, index)));
            self.groups.push(group);
            self.groups.len() - 1
        });
        if self.board.resources.len() > MAX_RESOURCES {
            let message = format!("all indices together have more than {MAX_RESOURCES} values");
            return self.wrong(Code::BoardValue, verb.span, message, "narrow the ranges");
        }
        let group = self.groups.get_mut(at)?;
        if group.index != index {
            let message = format!("`{name}` is set by another verb with another index");
            return self.wrong(
                Code::BoardValue,
                verb.span,
                message,
                "give both verbs the same index, or this one another `resource`",
            );
        }
        // Verbs of one resource share its refresh, as they share its rest.
        group.refresh = group.refresh.into_iter().chain(verb.refresh).min();
        let mut values = verb.axes.iter().filter(|axis| !axis.is_index).peekable();
        group.drives |= verb.holds && (values.peek().is_none() || values.any(|axis| axis.words.is_none()));
        if let (Some(_), Some(_)) = (&group.rest, &verb.rest) {
            let message = format!("`{name}` has two rests");
            return self.wrong(
                Code::BoardValue,
                verb.span,
                message,
                "verbs of one resource share one `rest`: keep one of the two",
            );
        }
        group.rest = group.rest.take().or_else(|| verb.rest.clone());
        Some(at)
    }

    fn verb(&mut self, row: &VerbRow, group: usize) {
        let Some(group) = self.groups.get(group) else { return };
        let resources = group.resources();
        let sets = if group.index.is_some() { Sets::Indexed(resources) } else { Sets::One(group.first) };
        let has_rest = group.rest.is_some();
        let axes: Vec<Axis> = row.axes.iter().map(axis).collect();
        let moving = row.axes.iter().filter(|axis| !axis.is_index);
        let example = |axis: &AxisRow| match &axis.words {
            Some(words) => words.last().map(|(word, _)| word.clone()).unwrap_or_default(),
            None => {
                let (least, most) = axis.field.range;
                let middle = i32::midpoint(least, most);
                let value = if axis.is_index { least } else { middle };
                self::axis(axis).shown(value).to_string()
            }
        };
        let usage: Vec<String> = row
            .axes
            .iter()
            .map(|axis| match &axis.words {
                Some(words) => words.iter().map(|(word, _)| word.as_str()).collect::<Vec<_>>().join("|"),
                None => axis.field.name.to_uppercase(),
            })
            .collect();
        let line = |parts: Vec<String>| Text::Owned([vec![row.word.clone()], parts].concat().join(" "));
        let first = moving.clone().next();
        let is_servo = row.moves && moving.count() == 1 && first.is_some_and(|axis| axis.measure == Measure::Micros);
        if is_servo {
            let speed = Some(SERVO_SPEED);
            for resource in group.resources() {
                if let Some(resource) = self.board.resources.get_mut(resource) {
                    resource.speed = speed;
                }
            }
        }
        let scale = first.map_or(1, |axis| 10_i32.pow(axis.field.decimals));
        self.board.verbs.push(Verb {
            axes,
            sets,
            activity: if has_rest { Activity::UnlessRest } else { Activity::Still },
            holds: row.holds,
            moves: row.moves,
            takes_names: true,
            tolerance: if is_servo { 5 * scale } else { 1 },
            ..Verb::row(
                row.word.clone(),
                line(usage),
                line(row.axes.iter().map(example).collect()),
                row.meaning.clone(),
            )
        });
        self.templates.push(row.send.template.clone());
        self.spans.push(row.send.span);
    }

    /// Reports strings that cannot be distinguished.
    fn compare(&mut self) -> Option<()> {
        for (at, template) in self.templates.iter().enumerate() {
            let span = self.spans.get(at).copied().unwrap_or_default();
            if let Some(string) = template.ambiguous_string() {
                let message = format!(
                    "it is unclear where the last value of {} ends, or which axis has which digits",
                    shown(&string)
                );
                let help = "write something between two values and after the last one, such as a space and `\\n`";
                return self.wrong(Code::BoardText, span, message, help);
            }
            let others = self.templates.iter().take(at).enumerate();
            let found = others.into_iter().find_map(|(other, earlier)| Some((other, template.common_string(earlier)?)));
            if let Some((other, string)) = found {
                let word = |row: usize| self.board.verbs.get(row).map(|verb| verb.word.to_string()).unwrap_or_default();
                let message = format!(
                    "`{}` and `{}` cannot be distinguished: {} can be either",
                    word(other),
                    word(at),
                    shown(&string)
                );
                let first = self.spans.get(other).copied().unwrap_or_default();
                let diagnostic = Diagnostic::new(Code::BoardText, span, message, "let one of them begin differently")
                    .related(first, "the other string");
                self.diagnostics.push(diagnostic);
                return None;
            }
        }
        Some(())
    }

    /// Gives each resource the command that brings it to rest.
    fn rests(&mut self, verbs: &[VerbRow]) -> Option<()> {
        for group in std::mem::take(&mut self.groups) {
            let Some(line) = &group.rest else {
                let mut own = verbs.iter().filter(|verb| verb.sets() == group.name);
                let Some(verb) = own.find(|verb| verb.holds || verb.refresh.is_some()) else { continue };
                let (message, help) = if verb.holds {
                    ("holds, but has no `rest`", "add the string that ends it: `rest = 'M 0 0\\n'`")
                } else {
                    (
                        "has a `refresh`, but no `rest`",
                        "add `holds = true` and a `rest`: only a held command is refreshed",
                    )
                };
                return self.wrong(Code::BoardValue, verb.span, format!("`{}` {message}", verb.word), help);
            };
            if group.index.is_some() && line.template.axes().next().is_none() {
                let message = format!("the rest of `{}` is the same for all values of its index", group.name);
                return self.wrong(Code::BoardValue, line.span, message, "write the index into it, such as `{n}`");
            }
            let rests = self.rests_of(&group, line)?;
            for (resource, rest) in group.resources().into_iter().zip(rests) {
                if !self.board.occupies(&rest).contains(&resource) {
                    let message = format!("this is what another command sends, `{}`", self.board.show(&rest));
                    let help = format!("write a string that ends `{}`", group.name);
                    return self.wrong(Code::BoardValue, line.span, message, help);
                }
                if let Some(row) = self.board.resources.get_mut(resource) {
                    row.rest = Some(rest);
                    row.drives = group.drives;
                    row.refresh = group.refresh;
                }
            }
        }
        Some(())
    }

    /// The commands that bring the resources of a group to rest: commands of its verbs, or of a verb for the rest alone,
    /// so that a recording can contain it.
    fn rests_of(&mut self, group: &Group, line: &Line) -> Option<Vec<Command>> {
        let indices = group.indices();
        let values = |index: &Option<i32>| index.iter().copied().collect::<Vec<i32>>();
        let decoded = indices.iter().map(|index| {
            let mut string = Vec::new();
            line.template.write(&values(index), &mut string);
            self.decode(&string)
        });
        if let Some(rests) = decoded.collect::<Option<Vec<Command>>>() {
            return Some(rests);
        }
        let word = format!("stop_{}", group.name);
        if self.board.find(&word).is_some() {
            let message = format!("this rest needs the word `{word}`, which is the word of another verb");
            return self.wrong(Code::BoardValue, line.span, message, "give that verb another word");
        }
        let index = group.index.map(|range| Axis { takes: ValueForm::Index, ..Axis::row("the index", range) });
        let sets = match index {
            Some(_) => Sets::Indexed(group.resources()),
            None => Sets::One(group.first),
        };
        let example = [word.clone()]
            .into_iter()
            .chain(group.index.map(|(least, _)| least.to_string()))
            .collect::<Vec<_>>()
            .join(" ");
        let usage = if index.is_some() { format!("{word} N") } else { word.clone() };
        let verb = Verb {
            axes: index.into_iter().collect(),
            sets,
            activity: Activity::UnlessRest,
            ..Verb::row(word, usage, example, format!("the rest of {}", group.name))
        };
        let verb = self.add(verb, line.template.clone(), line.span)?;
        Some(indices.iter().map(|index| Command::new(verb, &values(index))).collect())
    }

    /// The command of a line that is always the same: that of a verb, or else of a row for this line alone.
    fn fixed(&mut self, line: &Line) -> Option<Command> {
        let mut string = Vec::new();
        line.template.write(&[], &mut string);
        if let Some(command) = self.decode(&string) {
            return Some(command);
        }
        let word = shown(&string);
        let verb = Verb { frames: word.clone().into(), ..Verb::row(word.clone(), word.clone(), word, "") };
        let verb = self.add(verb, line.template.clone(), line.span)?;
        Some(Command::new(verb, &[]))
    }

    /// The command of a verb that sends a string.
    fn decode(&self, string: &[u8]) -> Option<Command> {
        codec::decode(&self.templates, &self.board, string).ok()
    }

    /// Adds a verb, whose string must differ from all others.
    fn add(&mut self, verb: Verb, template: Template, span: Span) -> Option<VerbId> {
        let Ok(row) = u8::try_from(self.board.verbs.len()) else {
            return self.wrong(Code::BoardValue, span, "the board has too many lines", "remove some");
        };
        let other =
            self.templates.iter().enumerate().find_map(|(row, other)| Some((row, template.common_string(other)?)));
        if let Some((other, string)) = other {
            let word = self.board.verbs.get(other).map(|verb| verb.word.to_string()).unwrap_or_default();
            let message = format!("this cannot be distinguished from `{word}`: {} can be either", shown(&string));
            let help = "end both in the same way, such as with `\\n`, or let one begin differently";
            return self.wrong(Code::BoardText, span, message, help);
        }
        self.board.verbs.push(verb);
        self.templates.push(template);
        self.spans.push(span);
        Some(VerbId(row))
    }
}

fn resource(name: &str, index: Option<i32>) -> Resource {
    let (shown, key) = match index {
        Some(index) => (format!("{name} {index}"), format!("{name}_{index}")),
        None => (format!("the {name}"), name.to_owned()),
    };
    let (activity, idle) = (Text::Borrowed("active"), Text::Borrowed("is at rest"));
    Resource { activity, idle, ..Resource::row(shown, key) }
}

fn axis(row: &AxisRow) -> Axis {
    let Field { name, range, decimals, .. } = &row.field;
    Axis {
        key: Text::Owned(name.clone()),
        scale: 10_i32.pow(*decimals),
        takes: match &row.words {
            Some(words) => {
                ValueForm::Word(words.iter().map(|(word, value)| (Text::Owned(word.clone()), *value)).collect())
            }
            None if row.is_index => ValueForm::Index,
            None => ValueForm::Number,
        },
        unit: Unit { measure: row.measure, angle: row.angle },
        ..Axis::row(format!("the `{name}`"), *range)
    }
}

/// A string in quotation marks, with escapes.
fn shown(string: &[u8]) -> String {
    let inside: String =
        string.iter().map(|byte| if *byte == b'"' { "\\\"".to_owned() } else { escaped(*byte) }).collect();
    format!("\"{inside}\"")
}

/// A byte as a template writes it.
fn escaped(byte: u8) -> String {
    match byte {
        b'\r' => "\\r".to_owned(),
        b'\n' => "\\n".to_owned(),
        b'\t' => "\\t".to_owned(),
        b'\\' => "\\\\".to_owned(),
        b' '..=b'~' => char::from(byte).to_string(),
        _ => format!("\\x{byte:02X}"),
    }
}
