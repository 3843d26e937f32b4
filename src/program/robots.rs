//! The robots of a script, and those that a line is for.

use super::evaluator::Evaluator;
use super::suggest::{list, suggest};
use crate::diagnostic::{bail, report};
use crate::syntax::{Argument, Item, Name, ValueKind};

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
        self.0 & other.0 != 0
    }

    /// The numbers of those among the first `count` robots; of a script without `robots`, that is one.
    pub(super) fn among(self, count: usize) -> impl Iterator<Item = usize> {
        (0..count.max(1)).filter(move |robot| self.contains(*robot))
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

impl<'s> Evaluator<'s, '_> {
    /// The robots that the names before a line stand for; `within` are those of what contains the line.
    pub(super) fn robots_of(&mut self, names: &[Name<'s>], within: RobotSet) -> Option<RobotSet> {
        let mut set = 0;
        for name in names {
            let Some(robot) = self.robots.iter().position(|robot| robot.text == name.text) else {
                self.unknown_robot(*name);
                return None;
            };
            if !within.contains(robot) {
                let outer = self.robot_names(within);
                bail!(self, Robots, name.span, "this line is inside of `{outer}:`, so it cannot be for `{}`", name.text;
                    help: "move it out of the block of `{outer}:`, or add `{}` there", name.text);
            }
            if set & (1 << robot) != 0 {
                bail!(self, DuplicateArgument, name.span, "`{}` is named twice", name.text; help: "keep one of the two");
            }
            set |= 1 << robot;
        }
        Some(RobotSet(set))
    }

    /// The names of some robots as they are written before a line: `left, right`.
    pub(super) fn robot_names(&self, set: RobotSet) -> String {
        let names = set.among(self.robots.len()).filter_map(|robot| self.robots.get(robot));
        names.map(|name| name.text).collect::<Vec<_>>().join(", ")
    }

    /// The name of the robot that a line is run for, if the script names its robots.
    pub(super) fn robot_name(&self) -> Option<&'s str> {
        self.robots.get(self.robot).map(|name| name.text)
    }

    fn unknown_robot(&mut self, name: Name<'s>) {
        let known = self.robots.iter().map(|robot| robot.text);
        if self.robots.is_empty() {
            report!(self, UnknownName, name.span, "there is no robot `{}`, because the script names no robots", name.text;
                help: "write `robots {}` before every other setting, or remove `{}:`", name.text, name.text);
            return;
        }
        let help = match suggest(name.text, known.clone()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("the robots are {}", list(known)),
        };
        report!(self, UnknownName, name.span, "there is no robot `{}`", name.text; help: "{help}");
    }
}
