//! The selected part of a script, its speed and its number of passes: `--from`, `--to`, `--speed`, `--loop`, `--lead-in`.

use std::path::Path;
use std::sync::Arc;

use clap::Args;
use motionseq::board::State;
use motionseq::diagnostic::{Diagnostic, Diagnostics};
use motionseq::program::{SOFT_START, Speed, Time};
use motionseq::report::Asked;
use motionseq::source::{Disk, Sources};
use motionseq::timeline::{Clip, Position, Timeline, check_passes, clips, passes, state_after};
use motionseq::units::{Micros, NotATime};

use super::exit::Exit;
use super::project::Config;
use super::screen::{Screen, Warnings};
use super::{Options, read};

/// The selection. `play` may loop forever ([`Loop`]); other commands have a number of passes ([`Passes`]).
#[derive(Debug, Args)]
pub(super) struct Selection<L: Args = Loop> {
    /// Start at this time or mark of the script; servos move to their positions there first
    #[arg(long, value_name = "TIME|MARK", help_heading = "Part and speed")]
    from: Option<String>,
    /// End at this time or mark of the script; an `expect` that ends later is skipped
    #[arg(long, value_name = "TIME|MARK", help_heading = "Part and speed")]
    to: Option<String>,
    /// Scale the playback speed, from 0.1 to 10; the drive keeps its speed, so at 0.5 the robot drives twice as far
    #[arg(long, value_name = "FACTOR", value_parser = speed, default_value = "1", help_heading = "Part and speed")]
    speed: Speed,
    #[command(flatten)]
    passes: L,
    /// Time for the servos to move to their positions at `--from`
    #[arg(long, value_name = "TIME", value_parser = lead_in, default_value = "1s", help_heading = "Part and speed")]
    lead_in: Micros,
    /// Time for the servos to move from where they are to their first positions, on boards that report positions [default: `soft` of the script, else that of the board]
    #[arg(long, value_name = "TIME", value_parser = soft, conflicts_with = "no_soft", help_heading = "Part and speed")]
    soft: Option<Micros>,
    /// Send the first positions at once
    #[arg(long, help_heading = "Part and speed")]
    no_soft: bool,
}

/// The number of passes, or forever.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Loop {
    /// Play the script N times, or `forever`; with `--from`, servos return to their start positions before each pass
    #[arg(long = "loop", value_name = "N|forever", value_parser = count, default_value = "1", help_heading = "Part and speed")]
    count: Count,
}

/// The number of passes.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Passes {
    /// Play the script N times; with `--from`, servos return to their start positions before each pass
    #[arg(long = "loop", value_name = "N", value_parser = times, default_value = "1", help_heading = "Part and speed")]
    times: u64,
}

/// The number of passes, or forever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    Times(u64),
    Forever,
}

impl From<Loop> for Count {
    fn from(passes: Loop) -> Self {
        passes.count
    }
}

impl From<Passes> for Count {
    fn from(passes: Passes) -> Self {
        Count::Times(passes.times)
    }
}

fn speed(text: &str) -> Result<Speed, String> {
    Speed::of(text).ok_or_else(|| "write a number from 0.1 to 10 with at most three decimals, such as 0.5".into())
}

fn count(text: &str) -> Result<Count, String> {
    match text {
        "forever" => Ok(Count::Forever),
        text => times(text).map(Count::Times).map_err(|help| help + ", or `forever`"),
    }
}

fn times(text: &str) -> Result<u64, String> {
    text.parse().ok().filter(|times| *times > 0).ok_or_else(|| "write a number of passes, 1 or more".into())
}

fn lead_in(text: &str) -> Result<Micros, NotATime> {
    let time: Micros = text.parse()?;
    if time <= Micros::DAY { Ok(time) } else { Err(NotATime::TooLong) }
}

fn soft(text: &str) -> Result<Micros, String> {
    let time: Micros = text.parse().map_err(|error: NotATime| error.to_string())?;
    Some(time).filter(|time| SOFT_START.contains(time)).ok_or_else(|| "write a time from 100ms to 60s".to_owned())
}

/// How many frames of an endless run are checked together.
const MANY: usize = 200_000;

/// A selected part of a script, ready to play: the first pass and, for an endless run, the pass that is repeated.
pub(super) struct Selected {
    /// One for each robot, all with the same clock.
    pub(super) timelines: Vec<Timeline>,
    /// The repeated pass of an endless run.
    pub(super) again: Option<Vec<Timeline>>,
    /// How long the first pass takes.
    pub(super) first_pass: Micros,
    /// Converts times of the run to times of the script.
    pub(super) script: ScriptTime,
    /// The warnings of the script.
    pub(super) diagnostics: Diagnostics,
    /// The configuration that applies to the script.
    pub(super) config: Arc<Config>,
}

/// What is selected of each robot.
struct Cut {
    timelines: Vec<Timeline>,
    again: Option<Vec<Timeline>>,
    first_pass: Micros,
}

/// The end of the script, which is the same for all robots.
fn end(timelines: &[Timeline]) -> Micros {
    timelines.iter().map(|timeline| timeline.end).max().unwrap_or_default()
}

/// Converts times of a run to times of its script.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScriptTime {
    /// Where the part begins in the script, and how long the lead-in is, both in the time of the run.
    pub(super) from: Micros,
    pub(super) lead: Micros,
    pub(super) speed: Speed,
}

impl ScriptTime {
    /// ` (1.200 s in the script)`, unless that is the time of the run.
    pub(super) fn words(self, at: Micros) -> String {
        if (self.from, self.lead) == (Micros::ZERO, Micros::ZERO) && self.speed.factor() == 1.0 {
            return String::new();
        }
        let in_part = at - self.lead + self.from;
        format!(" ({:.3} s in the script)", self.speed.of_script(in_part))
    }
}

impl<L: Args + Copy + Into<Count>> Selection<L> {
    /// Compiles a script and selects the part.
    pub(super) fn compile(
        &self,
        file: &Path,
        options: &Options,
        warnings: Warnings,
        screen: &Screen,
    ) -> Result<(Sources, Selected), Exit> {
        let sources = Sources::new(read(file, screen)?, Disk);
        let config = options.config.of_script(sources.main().path(), screen)?;
        let compiled = options.compile_at(&sources, screen, (self.speed, warnings), &config);
        if compiled.timelines.is_empty() {
            return Err(Exit::Script);
        }
        let mut whole = compiled.timelines.clone();
        self.set_soft(&mut whole, screen)?;
        let mut diagnostics = compiled.diagnostics.clone();
        match self.select(&whole, options.max_events, &mut diagnostics) {
            Ok(Cut { timelines, again, first_pass }) => {
                // The diagnostics of one pass were shown already.
                let shown: Vec<&Diagnostic> = compiled.diagnostics.iter().collect();
                let mut found = Diagnostics::default();
                let new = diagnostics.iter().filter(|one| !shown.contains(one));
                new.for_each(|one| found.push(one.clone()));
                screen.diagnostics(&sources, &found, warnings, false);
                if found.has_errors() {
                    return Err(Exit::Script);
                }
                let moment = |text: &Option<String>| text.as_deref().and_then(|text| self.moment(text, &whole).ok());
                let from = moment(&self.from).unwrap_or_default().at;
                let end = end(&whole);
                let length = moment(&self.to).map_or(end, |to| to.at).min(end) - from;
                let script = ScriptTime { from, lead: first_pass - length, speed: self.speed };
                Ok((sources, Selected { timelines, again, first_pass, script, diagnostics, config }))
            }
            Err(why) => {
                screen.error(&why);
                Err(Exit::Usage)
            }
        }
    }

    /// Sets how softly the script starts, for the robots whose boards report the positions of their servos.
    fn set_soft(&self, whole: &mut [Timeline], screen: &Screen) -> Result<(), Exit> {
        if self.soft.is_none() && !self.no_soft {
            return Ok(());
        }
        if whole.iter().all(|timeline| timeline.board.feedback.is_none()) {
            let option = if self.no_soft { "--no-soft" } else { "--soft" };
            let mut boards: Vec<&str> = whole.iter().map(|timeline| &*timeline.board.name).collect();
            boards.dedup();
            screen.error(&format!(
                "`{option}` is only for boards that report the positions of their servos; this script is for {}",
                boards.join(" and ")
            ));
            return Err(Exit::Usage);
        }
        for timeline in whole.iter_mut().filter(|timeline| timeline.board.feedback.is_some()) {
            timeline.soft = self.soft;
        }
        Ok(())
    }

    /// The selection, for a report.
    pub(super) fn asked(&self) -> Asked {
        let passes = match self.passes.into() {
            Count::Times(times) => Some(times),
            Count::Forever => None,
        };
        Asked { from: self.from.clone(), to: self.to.clone(), speed: self.speed.factor(), passes }
    }

    /// Selects the part and the passes. Adds what is wrong with several passes to `diagnostics`.
    fn select(&self, whole: &[Timeline], max_events: usize, diagnostics: &mut Diagnostics) -> Result<Cut, String> {
        let moment = |text: &Option<String>| text.as_deref().map(|text| self.moment(text, whole)).transpose();
        let from = moment(&self.from)?.unwrap_or_default();
        let to = moment(&self.to)?;
        if from.at > end(whole) {
            let end = self.speed.of_script(end(whole));
            return Err(format!("`--from` is after the end of the script, which takes {end:.3} s"));
        }
        if to.is_some_and(|to| to <= from) {
            return Err("`--to` must be later than `--from`".to_owned());
        }
        let asked = Clip::new(from, to, self.lead_in);
        let first = clips(whole, &asked, &vec![State::default(); whole.len()]);
        let first_pass = end(&first);
        // After a pass, the state of the board is known.
        let again = || {
            let states: Vec<State> = first.iter().map(state_after).collect();
            clips(whole, &asked, &states).into_iter().map(Timeline::without_hello).collect::<Vec<_>>()
        };
        match self.passes.into() {
            Count::Times(1) => Ok(Cut { timelines: first, again: None, first_pass }),
            Count::Times(times) => {
                let again = again();
                let all = first.iter().zip(&again).map(|(first, again)| passes(first, again, times, max_events));
                let timelines: Vec<Timeline> = all.collect::<Option<_>>().ok_or_else(|| {
                    format!("{times} passes take more than 24 hours or {max_events} frames; write a smaller `--loop`")
                })?;
                for ((first, again), all) in first.iter().zip(&again).zip(&timelines) {
                    check_passes(first, again, all, diagnostics);
                }
                Ok(Cut { timelines, again: None, first_pass })
            }
            Count::Forever => {
                let again = again();
                if again.iter().all(|again| again.end == Micros::ZERO && again.gates.is_empty()) {
                    return Err("a pass that takes no time cannot loop forever".to_owned());
                }
                for (first, again) in first.iter().zip(&again) {
                    // If the line cannot carry a pass, the delay grows with each pass.
                    let enough = MANY / again.events.len().max(1);
                    let enough = u64::try_from(enough).unwrap_or(2).clamp(2, 1_000);
                    let all = passes(first, again, enough, usize::MAX);
                    check_passes(first, again, all.as_ref().unwrap_or(first), diagnostics);
                }
                // An endless run has no last pass.
                let endless = |passes: Vec<Timeline>| passes.into_iter().map(Timeline::without_goodbye).collect();
                Ok(Cut { timelines: endless(first), again: Some(endless(again)), first_pass })
            }
        }
    }

    /// The position of a time or mark of the script, at this speed.
    fn moment(&self, text: &str, whole: &[Timeline]) -> Result<Position, String> {
        // All robots have the same marks and gates.
        let Some(whole) = whole.first() else { return Ok(Position::default()) };
        if let Some(time) = Time::parse(text).filter(|time| *time <= Time::LONGEST) {
            return Ok(Position::before(whole, self.speed.time(time).micros()));
        }
        let mut named = whole.marks.iter().filter(|mark| mark.name == text);
        match (named.next(), named.next()) {
            (Some(mark), None) => Ok(Position { at: mark.at, gates: mark.gates }),
            (Some(_), Some(_)) => {
                let all = whole.marks.iter().filter(|mark| mark.name == text).take(5);
                let all: Vec<String> = all.map(|mark| format!("{:.3}", self.speed.of_script(mark.at))).collect();
                Err(format!(
                    "the mark `{text}` occurs more than once, at {} s; write one of these times",
                    all.join(", ")
                ))
            }
            (None, _) => {
                let mut all: Vec<&str> = whole.marks.iter().map(|mark| mark.name.as_str()).collect();
                all.dedup();
                all.truncate(12);
                let known = match all.as_slice() {
                    [] => "the script has no marks".to_owned(),
                    all => format!("the marks are {}", all.join(", ")),
                };
                let is_number = Time::parse(&format!("{text}s")).is_some();
                let seconds = if is_number { format!("{text}s") } else { "1.5s".to_owned() };
                Err(format!("`{text}` is neither a time such as {seconds} nor a mark of the script; {known}"))
            }
        }
    }
}
