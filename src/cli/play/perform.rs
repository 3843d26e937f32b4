//! Plays: one robot on this thread, or several with a thread each.

use std::io;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::thread::{self, ScopedJoinHandle};

use motionseq::faults::Stalling;
use motionseq::link::{Link, Serial};
use motionseq::playback::{
    Cause, Company, GoLines, Guard, GuardConfig, Keys, Notice, Outcome, Player, Realtime, Session, Signals, now,
};
use motionseq::serve::BoardThread;
use motionseq::source::{Lines, Sources};
use motionseq::timeline::Timeline;
use motionseq::units::Nanos;

use super::super::exit::Exit;
use super::super::screen::Screen;
use super::observers::Notifier;
use super::port::system;
use super::{Play, become_realtime};

/// What one robot plays.
pub(super) struct Robot {
    pub(super) timeline: Arc<Timeline>,
    /// The repeated pass of an endless run.
    pub(super) again: Option<Arc<Timeline>>,
    /// How late a frame may be.
    pub(super) limit: Nanos,
    /// Whether it is a virtual board.
    pub(super) is_virtual: bool,
}

/// What the operator has, once for all robots.
pub(super) struct Operator {
    pub(super) signals: Signals,
    pub(super) keys: Option<Keys>,
    pub(super) go: Option<GoLines>,
}

/// What else there is once for all robots.
pub(super) struct Shared<'r> {
    /// The ring of what is about all robots.
    pub(super) common: Option<Notifier>,
    /// The virtual boards, which learn when the run begins.
    pub(super) boards: Vec<&'r BoardThread>,
    pub(super) sources: &'r Sources,
}

impl Shared<'_> {
    /// Time 0 of the run, which is now.
    fn begin(&self) -> Nanos {
        let start = now();
        for board in &self.boards {
            board.begin(start);
        }
        start
    }
}

/// How the run of one robot ended, and what is still open.
pub(super) struct Played {
    pub(super) outcome: Outcome,
    pub(super) link: Stalling<Serial>,
    pub(super) guard: Option<Guard>,
    pub(super) notifier: Notifier,
}

/// How all runs ended.
pub(super) struct Performance {
    pub(super) played: Vec<Played>,
    /// The robot whose run ended early before all others.
    pub(super) first: usize,
    /// Time 0 of the run, on the clock of [`now`].
    pub(super) start: Nanos,
    /// The ring of what is about all robots.
    pub(super) common: Option<Notifier>,
}

/// A robot and its way to the port.
type Actor<'r> = (&'r Robot, Stalling<Serial>, Notifier);

impl Play {
    /// Plays to the end.
    pub(super) fn perform(
        &self,
        mut actors: Vec<Actor<'_>>,
        operator: Operator,
        shared: Shared<'_>,
        screen: &Screen,
    ) -> Result<Performance, Exit> {
        if self.no_guard {
            screen.note("no guard: nothing stops the robot if motionseq is killed or hangs");
        }
        if actors.len() > 1 {
            return self.perform_together(actors, operator, shared, screen);
        }
        let sources = shared.sources;
        let Some((robot, link, mut notifier)) = actors.pop() else { return Err(Exit::Script) };
        let Operator { signals, keys, go } = operator;
        let mut session = Session::new(self.player(robot), link, signals, Lines::of(sources));
        (session.keys, session.go) = (keys, go);
        session.realtime = self.realtime && become_realtime(screen);
        // The guard is started last, because from then on the player must send heartbeats.
        session.guard = self.guard(&session.link, robot, screen).map_err(|error| {
            // Ctrl-C also reaches a guard that is starting.
            session.signal().map_or_else(|| system(screen, &error), Exit::Signal)
        })?;
        if let Some(keys) = &mut session.keys {
            keys.enter_steps = self.step;
            // The guard has saved the state of the terminal.
            keys.begin();
        }
        let start = shared.begin();
        // The clock of the progress line starts here too.
        notifier.notify_at(start, Notice::Pass { pass: 1 });
        let outcome = session.play(start, |notice| notifier.notify(notice));
        let Session { link, guard, .. } = session;
        Ok(Performance {
            played: vec![Played { outcome, link, guard, notifier }],
            first: 0,
            start,
            common: shared.common,
        })
    }

    fn perform_together(
        &self,
        actors: Vec<Actor<'_>>,
        operator: Operator,
        shared: Shared<'_>,
        screen: &Screen,
    ) -> Result<Performance, Exit> {
        let Operator { signals, keys, go } = operator;
        let (mut company, seats) = Company::new(actors.len(), signals).map_err(|error| system(screen, &error))?;
        (company.keys, company.go) = (keys, go);
        if let Some(keys) = &mut company.keys {
            keys.enter_steps = self.step;
        }
        // The threads that this one starts have its priority.
        let realtime = self.realtime && become_realtime(screen);
        let start = shared.begin();
        let Shared { mut common, sources, .. } = shared;
        let play = |robot, mut session: Session<'_, _>, mut notifier: Notifier| {
            session.realtime = realtime;
            if self.realtime {
                // The memory of this thread is newer than what was locked.
                let _ = Realtime::ask();
            }
            session.guard = self.guard(&session.link, robot, screen)?;
            notifier.notify_at(start, Notice::Pass { pass: 1 });
            let outcome = session.play(start, |notice| notifier.notify(notice));
            let Session { link, guard, .. } = session;
            Ok(Played { outcome, link, guard, notifier })
        };
        let (first, ended) = thread::scope(|scope| {
            let threads: Vec<_> = actors
                .into_iter()
                .zip(seats)
                .map(|((robot, link, notifier), seat)| {
                    let session = Session::together(self.player(robot), link, seat, Lines::of(sources));
                    let name = robot.timeline.robot.as_deref().unwrap_or("player").to_owned();
                    thread::Builder::new().name(name).spawn_scoped(scope, move || play(robot, session, notifier))
                })
                .collect();
            // A thread that did not start, or has no guard, ends the others by its seat, before anything is sent.
            let first = company.conduct(start, |notice| common.iter_mut().for_each(|common| common.notify(notice)));
            // After a panic, the guards stop the robots and say why.
            let end =
                |thread: io::Result<ScopedJoinHandle<'_, _>>| thread?.join().unwrap_or_else(|why| resume_unwind(why));
            (first, threads.into_iter().map(end).collect::<Vec<io::Result<Played>>>())
        });
        let (mut played, mut failed) = (Vec::new(), None);
        for robot in ended {
            match robot {
                Ok(robot) => played.push(robot),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        if let Some(error) = failed {
            played.into_iter().filter_map(|robot| robot.guard).for_each(Guard::goodbye);
            return Err(company.signal().map_or_else(|| system(screen, &error), Exit::Signal));
        }
        let is_own = |played: &Played| !matches!(played.outcome.cause, Cause::Finished | Cause::Other { .. });
        let first = first.or_else(|| played.iter().position(is_own)).unwrap_or(0);
        Ok(Performance { played, first, start, common })
    }

    fn player<'t>(&self, robot: &'t Robot) -> Player<'t> {
        let mut player = Player::new(&robot.timeline, robot.limit);
        if let Some(again) = &robot.again {
            player = player.again_and_again(again);
        }
        if self.paused || self.step { player.paused() } else { player }
    }

    fn guard(&self, link: &impl Link, robot: &Robot, screen: &Screen) -> io::Result<Option<Guard>> {
        if self.no_guard {
            return Ok(None);
        }
        let mut ward = GuardConfig::of(&robot.timeline);
        (ward.max_late, ward.realtime) = (robot.limit, self.realtime);
        super::super::guard::start(link.descriptor(), &ward, robot.is_virtual, screen).map(Some)
    }
}
