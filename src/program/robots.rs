//! The robots of a script, and those that a line is for.

use super::evaluator::Evaluator;
use super::suggest::{list, suggest};
use crate::diagnostic::{bail, diagnostic, report};
use crate::syntax::{Argument, Command, Item, Name, ValueKind};

/// The most robots of a script.
pub(super) const MOST: usize = 8;

/// The robots that a line is for, by their numbers in the order of `robots`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RobotSet(u8);

impl RobotSet {
    /// What a line is for that names no robot. It differs from a set that names every robot.
    pub(super) const ALL: RobotSet = RobotSet(u8::MAX);

    /// Whether the line, or what contains it, names robots.
    pub(super) fn is_named(self) -> bool {
        self != RobotSet::ALL
    }

    pub(super) fn contains(self, robot: usize) -> bool {
        robot < MOST && self.0 & (1 << robot) != 0
    }

    /// Whether any robot is in both.
    pub(super) fn meets(self, other: RobotSet) -> bool {
        self.and(other) != RobotSet(0)
    }

    /// The robots that are in both.
    pub(super) fn and(self, other: RobotSet) -> RobotSet {
        RobotSet(self.0 & other.0)
    }

    #[must_use]
    fn with(self, robot: usize) -> RobotSet {
        RobotSet(self.0 | 1 << robot)
    }

    /// The numbers of those among the first `count` robots; of a script without `robots`, that is one.
    pub(super) fn among(self, count: usize) -> impl Iterator<Item = usize> {
        (0..count.max(1)).filter(move |robot| self.contains(*robot))
    }
}

impl FromIterator<usize> for RobotSet {
    fn from_iter<T: IntoIterator<Item = usize>>(robots: T) -> Self {
        robots.into_iter().fold(RobotSet(0), RobotSet::with)
    }
}

impl Default for RobotSet {
    fn default() -> Self {
        RobotSet::ALL
    }
}

/// Reads the names after `robots`.
pub(super) fn names<'s>(argument: &Argument<'s>, eval: &mut Evaluator<'s, '_>) -> Option<Vec<Name<'s>>> {
    let values = match &argument.item {
        Item::One(value) => std::slice::from_ref(value),
        Item::List(list) => list.as_slice(),
        _ => &[],
    };
    let word = |value: &crate::syntax::Value<'s>| match value.kind {
        ValueKind::Word(text) if !value.negative => Some(Name { text, span: value.span }),
        _ => None,
    };
    let Some(names) = values.iter().map(word).collect::<Option<Vec<_>>>().filter(|names| !names.is_empty()) else {
        bail!(eval, InvalidArgument, argument.span, "the names of robots are needed here";
            help: "write them with commas: `robots left, right`");
    };
    if names.len() > MOST {
        bail!(eval, Robots, argument.span, "a script has at most {MOST} robots, and this one has {}", names.len();
            help: "write a second script for the others");
    }
    for (at, name) in names.iter().enumerate() {
        eval.is_free(*name)?;
        if let Some(first) = names.iter().take(at).find(|first| first.text == name.text) {
            return eval.given_twice(*name, first.span);
        }
    }
    Some(names)
}

/// Reports names without commas: `robots left right`, `robots left and right`.
pub(super) fn only_argument(first: &Argument<'_>, command: &Command<'_>, eval: &mut Evaluator<'_, '_>) -> Option<()> {
    let (Some(last), true) = (command.arguments.last(), command.arguments.len() > 1) else { return Some(()) };
    let span = first.span.to(last.span);
    let names = eval.written(span).split([',', ' ', '\t']).filter(|name| !["", "and"].contains(name));
    let names = names.collect::<Vec<_>>().join(", ");
    bail!(eval, InvalidArgument, span, "the names of robots are separated by commas"; write: span => "{names}")
}

impl<'s> Evaluator<'s, '_> {
    /// The robots that the names before a line mean, which is in a block or phrase that is run for the robots `within`.
    pub(super) fn robots_of(&mut self, names: &[Name<'s>], within: RobotSet) -> Option<RobotSet> {
        let mut set = RobotSet(0);
        for name in names {
            let Some(robot) = self.robot_number(name.text) else {
                self.unknown_robot(*name);
                return None;
            };
            if !within.contains(robot) {
                let outer = self.robot_names(within);
                bail!(self, Robots, name.span, "this line is inside `{outer}:`, so it cannot be for `{}`", name.text;
                    help: "move it out of the block of `{outer}:`, or add `{}` there", name.text);
            }
            if set.contains(robot) {
                bail!(self, DuplicateArgument, name.span, "`{}` is named twice", name.text; help: "keep one of the two");
            }
            set = set.with(robot);
        }
        Some(set)
    }

    /// The names of some robots as they are written before a line: `left, right`.
    pub(super) fn robot_names(&self, set: RobotSet) -> String {
        let names = set.among(self.robots.len()).filter_map(|robot| self.robots.get(robot));
        names.map(|name| name.text).collect::<Vec<_>>().join(", ")
    }

    /// The number of the robot with this name.
    pub(super) fn robot_number(&self, name: &str) -> Option<usize> {
        self.robots.iter().position(|robot| robot.text == name)
    }

    /// Reports names of robots in a line that may never run.
    pub(super) fn check_robots(&mut self, names: &[Name<'s>]) {
        for name in names {
            if self.robot_number(name.text).is_none() {
                self.unknown_robot(*name);
            }
        }
    }

    fn unknown_robot(&mut self, name: Name<'s>) {
        // Once, however often the line is run.
        if !self.unknown.insert(name.span) {
            return;
        }
        let known = self.robots.iter().map(|robot| robot.text);
        if self.robots.is_empty() {
            // Once for each name: the script may use it on every line.
            if self.lost.names.insert(name.text) {
                report!(self, UnknownName, name.span, "there is no robot `{}`, because the script names no robots", name.text;
                    help: "name all of them before the first command, such as `robots {}, other`, or remove `{}:`", name.text, name.text);
            }
            return;
        }
        let help = match suggest(name.text, known.clone()) {
            _ if ["all", "both", "each", "every", "everyone", "robots"].contains(&name.text) => {
                format!("a line without names is for all robots: remove `{}:`", name.text)
            }
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("the robots are {}", list(known)),
        };
        report!(self, UnknownName, name.span, "there is no robot `{}`", name.text; help: "{help}");
    }

    /// Reports the name of a robot that is not followed by `:`, as in `left stop`; returns whether it is one.
    pub(super) fn robot_without_colon(&mut self, command: &Command<'s>) -> bool {
        let name = command.head;
        let is_robot = self.robot_number(name.text).is_some();
        if is_robot {
            let rest = self.written(command.span).strip_prefix(name.text).unwrap_or_default().trim();
            let rest = if rest.is_empty() { "stop" } else { rest.lines().next().unwrap_or_default() };
            let missing = diagnostic!(UnknownWord, name.span, "a `:` is missing after the robot `{}`", name.text;
                help: "write `{}: {rest}`", name.text);
            let is_alone = command.arguments.is_empty();
            self.push(if is_alone { missing } else { missing.fix(name.span, format!("{}:", name.text)) });
        }
        is_robot
    }
}
