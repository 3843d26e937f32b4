//! Queries that the table of a board answers.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use super::Text;
use super::command::{Command, VerbId};
use super::quantity::{Hundredths, Quantity, Replies, Report};
use super::table::{Board, DefaultLimit, Limited, NotACommand, OutOfRange, Resource};
use super::verb::{Activity, Axis, Needs, Part, ResourceId, Sets, ValueForm, Verb};

impl Board {
    /// A verb by its row.
    pub fn verb(&self, id: VerbId) -> Option<&Verb> {
        self.verbs.get(id.row())
    }

    /// All verbs with their rows.
    pub fn verbs(&self) -> impl Iterator<Item = (VerbId, &Verb)> {
        (0..=u8::MAX).map(VerbId).zip(&self.verbs)
    }

    /// The verb with this word.
    pub fn find(&self, word: &str) -> Option<(VerbId, &Verb)> {
        let row = self.verbs.iter().position(|verb| verb.word == word)?;
        Some((VerbId(u8::try_from(row).ok()?), self.verbs.get(row)?))
    }

    /// Makes a command from a verb and its values, an index first.
    ///
    /// # Errors
    /// [`NotACommand::OutOfRange`] for the first value that is out of range,
    /// [`NotACommand::Unknown`] if the number of values is wrong or the verb does not exist.
    pub fn command(&self, verb: VerbId, values: &[i32]) -> Result<Command, NotACommand> {
        let row = self.verb(verb).ok_or(NotACommand::Unknown)?;
        if let Some(is) = row.is.as_ref().filter(|_| values.is_empty()) {
            return Ok(is.clone());
        }
        let mut rest = values.iter();
        for axis in &row.axes {
            if let ValueForm::Bytes(most) = axis.takes {
                for value in rest.by_ref().take(most) {
                    OutOfRange::check(*value, axis)?;
                }
            }
            for _ in 0..axis.count() {
                OutOfRange::check(*rest.next().ok_or(NotACommand::Unknown)?, axis)?;
            }
        }
        if rest.next().is_some() || row.is.is_some() {
            return Err(NotACommand::Unknown);
        }
        Ok(Command::new(verb, values))
    }

    /// The commands of a script that together do the same as a command; itself, if there are no others.
    pub fn in_script(&self, command: Command) -> Vec<Command> {
        let is_in_scripts = self.verb(command.verb()).is_some_and(Verb::is_in_scripts);
        let others = if is_in_scripts { Vec::new() } else { self.codec.in_script(self, &command) };
        if others.is_empty() { vec![command] } else { others }
    }

    /// Makes a command from a word and its values, an index first: `command_named("servo", &[1,
    /// 1500])`.
    ///
    /// # Errors
    /// Those of [`command`](Self::command).
    pub fn command_named(&self, word: &str, values: &[i32]) -> Result<Command, NotACommand> {
        let (verb, _) = self.find(word).ok_or(NotACommand::Unknown)?;
        self.command(verb, values)
    }

    /// The resources that a command occupies during `for` and `over`. A command that is not
    /// interpreted occupies none.
    pub fn occupies(&self, command: &Command) -> &[ResourceId] {
        self.occupied(command.verb(), command.value(0))
    }

    /// The same for a verb and its index.
    pub fn occupied(&self, verb: VerbId, index: Option<i32>) -> &[ResourceId] {
        let Some(verb) = self.verb(verb) else { return &[] };
        match &verb.sets {
            Sets::Nothing | Sets::Opaque(_) => &[],
            Sets::One(resource) => std::slice::from_ref(resource),
            Sets::Indexed(resources) => {
                let place = verb.axes.first().and_then(|axis| usize::try_from(index? - axis.range.0).ok());
                place.and_then(|place| resources.get(place)).map_or(&[], std::slice::from_ref)
            }
            Sets::Parts(_, resources) | Sets::All(resources) => resources,
        }
    }

    /// The resources that a command can change: those that it occupies, and the one that it makes
    /// unknown.
    pub fn touches(&self, command: &Command) -> &[ResourceId] {
        match self.verb(command.verb()).map(|verb| &verb.sets) {
            Some(Sets::Opaque(known)) => {
                let found = known.iter().find(|(first, _)| command.value(0) == Some(*first));
                found.map_or(&[], |(_, resource)| std::slice::from_ref(resource))
            }
            _ => self.occupies(command),
        }
    }

    /// Whether a command is not interpreted, so that its effect is unknown.
    pub fn is_opaque(&self, command: &Command) -> bool {
        matches!(self.verb(command.verb()), Some(Verb { sets: Sets::Opaque(_), .. }))
    }

    /// A resource by its row.
    pub fn resource(&self, id: ResourceId) -> Option<&Resource> {
        self.resources.get(id)
    }

    /// The command that brings a resource to rest.
    pub fn rest(&self, resource: ResourceId) -> Option<&Command> {
        self.resource(resource)?.rest.as_ref()
    }

    /// Whether a command brings its resource to rest.
    pub fn is_rest(&self, command: &Command) -> bool {
        self.occupies(command).iter().any(|resource| self.rest(*resource) == Some(command))
    }

    /// Whether a command can change a resource that moves the robot while it is active.
    pub fn is_drive(&self, command: &Command) -> bool {
        self.touches(command).iter().any(|resource| self.drives(*resource))
    }

    /// Whether a resource moves the robot while it is active.
    pub fn drives(&self, resource: ResourceId) -> bool {
        self.resource(resource).is_some_and(|resource| resource.drives)
    }

    /// Whether a resource must be refreshed while it is active.
    pub fn needs_refresh(&self, resource: ResourceId) -> bool {
        self.resource(resource).is_some_and(|resource| resource.refresh.is_some())
    }

    /// Whether the resource of a command stays active until another command ends it.
    pub fn is_active(&self, command: &Command) -> bool {
        match self.verb(command.verb()).map(|verb| verb.activity) {
            Some(Activity::Always) => true,
            Some(Activity::Unless0) => !command.is_zero(),
            Some(Activity::UnlessRest) => !self.is_rest(command),
            _ => false,
        }
    }

    /// Whether a command activates a resource that must be refreshed.
    pub fn keeps_driving(&self, command: &Command) -> bool {
        self.is_active(command) && self.touches(command).iter().any(|resource| self.needs_refresh(*resource))
    }

    /// Whether the resource of a command is active for an unknown time and then comes to rest.
    pub fn is_passing(&self, command: &Command) -> bool {
        matches!(self.verb(command.verb()), Some(Verb { activity: Activity::Passing, .. }))
    }

    /// Whether the frame of a command can be read in two ways.
    pub fn is_ambiguous(&self, command: &Command) -> bool {
        self.ambiguity.as_ref().is_some_and(|ambiguity| ambiguity.verb == command.verb())
    }

    /// The precondition of a command.
    pub fn needs(&self, command: &Command) -> Option<&Needs> {
        self.verb(command.verb())?.needs.as_ref()
    }

    /// Whether a verb sets a resource that another verb depends on.
    pub fn is_needed(&self, verb: VerbId) -> bool {
        let sets = self.occupied(verb, None);
        self.verbs.iter().filter_map(|verb| verb.needs.as_ref()).any(|needs| sets.contains(&needs.resource))
    }

    /// A reported position of a servo as a target, and whether it is one; otherwise, it is the nearest
    /// one.
    pub fn target(&self, position: Hundredths) -> Option<(i32, bool)> {
        let feedback = self.feedback.as_ref()?;
        let value = (feedback.value)(position)?;
        let (least, most) = self.verb(feedback.verb)?.moving().first()?.range;
        Some((value.clamp(least, most), (least..=most).contains(&value)))
    }

    /// Whether the position of a servo must be read before a command is sent: it switches the torque on.
    pub fn reads_first(&self, command: &Command) -> bool {
        let preparation = self.feedback.as_ref().and_then(|feedback| feedback.preparation.as_ref());
        let verb = self.verb(command.verb()).and_then(|verb| verb.each).unwrap_or(command.verb());
        preparation.is_some_and(|preparation| preparation.enable == verb) && command.value(1) == Some(1)
    }

    /// Whether `newer` replaces `older` completely: it can change every resource that `older` can.
    pub fn supersedes(&self, newer: &Command, older: &Command) -> bool {
        let (newer, older) = (self.touches(newer), self.touches(older));
        !older.is_empty() && older.iter().all(|resource| newer.contains(resource))
    }

    /// Splits a command: calls `take` for each resource that it sets, with the command that sets
    /// only this resource.
    pub fn each_part(&self, command: &Command, mut take: impl FnMut(ResourceId, &Command)) {
        match self.verb(command.verb()).map(|verb| &verb.sets) {
            Some(Sets::Parts(parts, resources)) => {
                for ((part, resource), value) in parts.iter().zip(resources).zip(command.values()) {
                    take(*resource, &Command::new(part.verb, &[part.index, value]));
                }
            }
            _ => self.occupies(command).iter().for_each(|resource| take(*resource, command)),
        }
    }

    /// The lane of a command: one for each resource, and one for each verb that sets several
    /// resources or none.
    pub fn lane(&self, command: &Command) -> usize {
        match self.occupies(command) {
            [resource] => *resource,
            _ => self.resources.len() + command.verb().row(),
        }
    }

    /// The number of lanes.
    pub fn lanes(&self) -> usize {
        self.resources.len() + self.verbs.len()
    }

    /// The name of a lane.
    pub fn lane_name(&self, lane: usize) -> Text {
        let verb = |lane: usize| self.verbs.get(lane - self.resources.len()).map(|verb| verb.frames.clone());
        self.resource(lane).map(|resource| resource.name.clone()).or_else(|| verb(lane)).unwrap_or_default()
    }

    /// The range that the board accepts for a limited value.
    pub fn range(&self, limited: Limited) -> Option<(i32, i32)> {
        Some(self.axis(limited)?.range)
    }

    /// The axis of a limit; the first one if the limit applies to all.
    pub fn axis(&self, limited: Limited) -> Option<&Axis> {
        self.verb(limited.verb)?.moving().get(limited.axis.unwrap_or(0))
    }

    /// The first value of a command that violates a limit.
    pub fn outside(&self, limited: Limited, (low, high): (f64, f64), command: &Command) -> Option<i32> {
        let verb = self.verb(command.verb())?;
        let is_outside = |value: &i32| f64::from(*value) < low || f64::from(*value) > high;
        if let Sets::Parts(parts, _) = &verb.sets {
            let is_limited = |part: &Part| part.verb == limited.verb && Some(part.index) == limited.index;
            let values = parts.iter().enumerate().filter(|(_, part)| is_limited(part));
            return values.filter_map(|(at, _)| command.value(at)).find(is_outside);
        }
        let offset = usize::from(verb.is_indexed());
        if command.verb() != limited.verb || offset == 1 && command.value(0) != limited.index {
            return None;
        }
        if let Some(axis) = limited.axis {
            return command.value(axis + offset).filter(is_outside);
        }
        command.values().into_iter().skip(offset).find(is_outside)
    }

    /// The subject of a limit as a script writes it: `servo 2`, `rocker x`.
    pub fn limited_name(&self, limited: Limited) -> String {
        let mut name = self.verb(limited.verb).map(|verb| verb.word.to_string()).unwrap_or_default();
        if let Some(index) = limited.index {
            let _ = write!(name, " {index}");
        }
        if let (Some(verb), Some(axis)) = (self.verb(limited.verb), limited.axis.and_then(|_| self.axis(limited))) {
            let label = verb.label(axis);
            let space = if label.is_empty() { "" } else { " " };
            let _ = write!(name, "{space}{label}");
        }
        name
    }

    /// The default limit of this value, if it has one.
    pub fn default_limit(&self, limited: Limited) -> Option<&DefaultLimit> {
        self.limits.iter().find(|limit| limit.limited == limited)
    }

    /// The canonical notation of a command: the line of a script that sends exactly this frame.
    pub fn show<'b>(&'b self, command: &'b Command) -> Notation<'b> {
        Notation { board: self, command, is_brief: false }
    }

    /// The same as short as a script may write it: named values of 0 are omitted if others remain.
    pub fn brief<'b>(&'b self, command: &'b Command) -> Notation<'b> {
        let offset = usize::from(self.verb(command.verb()).is_some_and(Verb::is_indexed));
        let is_brief = command.values().iter().skip(offset).any(|value| *value != 0);
        Notation { board: self, command, is_brief }
    }

    /// Appends the frame of a command.
    pub fn encode(&self, command: &Command, out: &mut Vec<u8>) {
        self.codec.encode(self, command, out);
    }

    /// The length of a command's frame in bytes.
    pub fn frame_length(&self, command: &Command) -> usize {
        self.codec.length(self, command)
    }

    /// The frame of a command, in a new vector.
    pub fn to_frame(&self, command: &Command) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.frame_length(command));
        self.encode(command, &mut out);
        out
    }

    /// Decodes one frame. Strict: [`encode`](Self::encode) returns the same bytes for the result.
    ///
    /// # Errors
    /// Why the frame is not a command.
    pub fn decode(&self, frame: &[u8]) -> Result<Command, NotACommand> {
        self.codec.decode(self, frame)
    }

    /// Any frame as the verb that sends raw frames; `None` if the family has none.
    pub fn raw(&self, frame: &[u8]) -> Option<Command> {
        self.codec.raw(self, frame)
    }

    /// Decodes a frame. A frame that is not a command becomes a raw one, if the family has such a
    /// verb.
    pub fn decode_or_raw(&self, frame: &[u8]) -> Option<Command> {
        self.decode(frame).ok().or_else(|| self.raw(frame))
    }

    /// The number of zeros to send between a flush and a stop, on a line that carries these
    /// commands. A flush can truncate a frame, and a receiver that waits for the rest of it would
    /// take the stop for that rest.
    pub fn zeros_after_flush<'c>(&self, commands: impl IntoIterator<Item = &'c Command>) -> usize {
        commands.into_iter().map(|command| self.codec.resync(Some(command))).max().unwrap_or(0).max(self.fewest_zeros())
    }

    fn fewest_zeros(&self) -> usize {
        self.stop.iter().map(|command| self.codec.resync(Some(command))).max().unwrap_or(0)
    }

    /// The number of zeros that is enough after any frame.
    pub fn most_zeros(&self) -> usize {
        self.codec.resync(None)
    }

    /// The first quantity of the board, formatted, if a report has it.
    pub fn main_quantity(&self, report: &Report) -> Option<String> {
        self.quantities.first().and_then(|quantity| Some(quantity.show(report.value(0)?)))
    }

    /// All quantities of a report, formatted.
    pub fn report(&self, report: &Report) -> String {
        let shown = |(row, quantity): (usize, &Arc<Quantity>)| Some(quantity.show(report.value(row)?));
        let all = self.quantities.iter().enumerate();
        all.clone().skip(1).chain(all.take(1)).filter_map(shown).collect::<Vec<_>>().join(", ")
    }

    /// What the error bits of the board mean.
    pub fn errors(&self, bits: u16) -> String {
        match &self.replies {
            Replies::Answers(answers) => (answers.errors)(bits),
            Replies::None | Replies::Lines(_) => String::new(),
        }
    }

    /// Why the board may not have answered; empty if that is not known.
    pub fn silence_hint(&self) -> &'static str {
        match &self.replies {
            Replies::Answers(answers) => answers.hint,
            Replies::None | Replies::Lines(_) => "",
        }
    }

    /// The line that carries a report; empty if the board sends no such lines.
    pub fn report_line(&self, report: &Report) -> String {
        match &self.replies {
            Replies::Lines(lines) => (lines.write)(report),
            Replies::None | Replies::Answers(_) => String::new(),
        }
    }

    /// The verb with the same word as this one that takes `given` as its last value, a word.
    pub fn variant(&self, verb: VerbId, given: &str) -> Option<(VerbId, &Verb)> {
        let word = &self.verb(verb)?.word;
        self.verbs().find(|(_, other)| {
            let takes = |axis: &Axis| matches!(&axis.takes, ValueForm::Word(words) if words.iter().any(|(word, _)| word == given));
            other.word == *word && other.axes.iter().any(takes)
        })
    }
}

/// Displays a command in the notation of scripts.
#[derive(Clone, Copy, Debug)]
pub struct Notation<'b> {
    board: &'b Board,
    command: &'b Command,
    is_brief: bool,
}

impl fmt::Display for Notation<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Notation { board, command, is_brief } = self;
        let Some(verb) = board.verb(command.verb()) else { return f.write_str("?") };
        let alias = verb.alias.and_then(|alias| board.verb(alias));
        if let Some(alias) = alias.filter(|alias| alias.is.as_ref() == Some(command)) {
            return f.write_str(&alias.word);
        }
        let in_script = if verb.is_in_scripts() { Vec::new() } else { board.codec.in_script(board, command) };
        if let Some((last, others)) = in_script.split_last() {
            others.iter().try_for_each(|command| write!(f, "{}; ", board.show(command)))?;
            return board.show(last).fmt(f);
        }
        f.write_str(&verb.word)?;
        let mut values = command.values().into_iter();
        for axis in &verb.axes {
            match &axis.takes {
                ValueForm::Bytes(_) => values.by_ref().try_for_each(|byte| write!(f, " 0x{byte:02X}"))?,
                ValueForm::Byte => write!(f, " 0x{:02X}", values.next().unwrap_or_default())?,
                ValueForm::Word(words) => {
                    let value = values.next();
                    let word = words.iter().find(|(_, of)| Some(*of) == value).map_or("?", |(word, _)| word);
                    write!(f, " {word}")?;
                }
                ValueForm::Number if *is_brief && !axis.name.is_empty() && values.as_slice().first() == Some(&0) => {
                    values.next();
                }
                ValueForm::Number | ValueForm::Index | ValueForm::List(..) => {
                    f.write_char(' ')?;
                    if !axis.name.is_empty() {
                        f.write_str(&axis.name)?;
                        f.write_char('=')?;
                    }
                    for (at, value) in values.by_ref().take(axis.count()).enumerate() {
                        if at > 0 {
                            f.write_char(',')?;
                        }
                        axis.shown(value).fmt(f)?;
                    }
                }
            }
        }
        Ok(())
    }
}
