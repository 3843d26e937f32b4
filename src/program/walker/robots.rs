//! The robots of a script: which one lines are run for.

use std::sync::Arc;

use super::super::Program;
use super::super::robots::RobotSet;
use super::super::time::Time;
use super::{Frame, Robot, Walker};
use crate::syntax::Name;

impl<'s, 'd> Walker<'s, 'd> {
    /// The number of robots.
    pub(super) fn count(&self) -> usize {
        self.eval.robots.len().max(1)
    }

    /// Names the robots of a script. Until now there was one.
    pub(super) fn set_robots(&mut self, names: Vec<Name<'s>>) {
        let robot = |name: &Name<'_>| Some(Robot { name: Some(Arc::from(name.text)), ..self.robot.clone() });
        self.others = names.iter().map(robot).collect();
        if let Some(first) = self.others.first_mut().and_then(Option::take) {
            self.robot = first;
        }
        self.eval.diagnostics.of_robots(names.len());
        self.eval.boards = vec![self.robot.board; names.len()];
        self.bounds.robots = names.len() as u64;
        self.eval.robots = names;
    }

    /// From here on, lines are run for the robot with this number.
    pub(super) fn switch(&mut self, robot: usize) {
        // A script without `robots` has nothing to switch.
        if let Some(next) = self.others.get_mut(robot).and_then(Option::take) {
            self.eval.board = next.board;
            let last = std::mem::replace(&mut self.robot, next);
            if let Some(place) = self.others.get_mut(self.eval.robot) {
                *place = Some(last);
            }
            self.eval.robot = robot;
        }
    }

    /// Runs something for each of some robots, with the same random numbers; returns the latest end, or `None` if one has a mistake.
    pub(super) fn for_each(
        &mut self,
        robots: RobotSet,
        mut run: impl FnMut(&mut Self) -> Option<Time>,
    ) -> Option<Time> {
        if self.eval.robots.is_empty() {
            return run(self);
        }
        let random = self.eval.random;
        let mut end = Some(Time::ZERO);
        for robot in robots.among(self.count()) {
            self.switch(robot);
            self.eval.diagnostics.about(self.robot.name.as_ref());
            self.eval.random = random;
            let ended = run(self);
            end = end.zip(ended).map(|(end, ended)| end.max(ended));
        }
        self.eval.diagnostics.about(None);
        end
    }

    /// Binds what follows to the robots with these names, if there are any; returns the robots from before.
    pub(super) fn name_robots(&mut self, names: &[Name<'s>], frame: &mut Frame) -> Option<RobotSet> {
        let outer = frame.robots;
        if !names.is_empty() {
            frame.robots = self.eval.robots_of(names, outer)?;
        }
        Some(outer)
    }

    /// What each robot does, up to the end of the script.
    pub(super) fn programs(mut self, end: Time) -> Vec<Program> {
        self.switch(0);
        let mut marks = self.marks;
        let traces = Arc::new(self.eval.traces);
        let robots = std::iter::once(self.robot).chain(self.others.into_iter().flatten());
        let program = |robot: Robot<'d>| Program {
            robot: robot.name,
            board: Arc::clone(robot.board),
            settings: robot.settings,
            steps: robot.steps,
            end,
            abort: robot.abort.map(|(abort, _)| abort),
            marks: std::mem::take(&mut marks),
            has_gates: self.has_gates,
            traces: Arc::clone(&traces),
            times_known: self.times_known,
        };
        robots.map(program).collect()
    }
}
