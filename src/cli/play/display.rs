//! What a run shows while it plays: the progress line, `say` lines, pauses.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use motionseq::board::{Board, Hundredths, Report, State};
use motionseq::playback::{Notice, Passage, Verdict, now};
use motionseq::timeline::Timeline;
use motionseq::units::{Micros, Nanos};

use super::super::progress_bar::bar;
use super::super::run_summary::{is_for_all, kept_words, passage_words, servo_words};
use super::super::screen::Screen;
use super::super::selection::ScriptTime;
use super::super::state_line::{active_words, at_rest, drive_words};
use super::observer::Observer;

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(in super::super) enum Progress {
    /// One line that is redrawn, on a terminal
    Auto,
    /// One line per second, for pipes and screen readers
    Plain,
    /// No progress line
    None,
}

/// How often a plain line is written.
const SECOND: Duration = Duration::from_secs(1);

/// The keys.
const KEYS: &str = "space: pause or continue · Enter: continue, or one step with --step · s: one step while paused, drive stopped · Enter or g: go, at a gate · q: stop and exit · ?: help";

/// Shown in the progress line of a paused run.
const PAUSED: &str = "paused";

/// How the operator controls the run.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeysShown {
    /// Whether single keys work.
    pub(super) single: bool,
    /// Whether Enter plays a step.
    pub(super) steps: bool,
    /// Whether lines on standard input open gates.
    pub(super) go_lines: bool,
}

impl KeysShown {
    /// How a paused run continues.
    fn in_pause(self) -> &'static str {
        match (self.single, self.steps) {
            (false, _) => "; Enter continues (the robot may move at once), Ctrl-C exits",
            (true, false) => "; space or Enter continues (the robot may move at once), s plays one step, q exits",
            (true, true) => "; space continues (the robot may move at once), Enter or s plays one step, q exits",
        }
    }

    /// How a gate opens that waits for the operator.
    fn at_gate(self) -> &'static str {
        match (self.single, self.go_lines) {
            (true, false) => "Enter or g continues",
            (true, true) => "Enter, g or a line on standard input continues",
            (false, true) => "a line on standard input continues",
            (false, false) => "Enter continues",
        }
    }
}

/// A gate that is closed.
struct Waiting {
    gate: usize,
    /// How long it had waited before the last pause, and since when it waits; `None` in a pause.
    before: Nanos,
    since: Option<Nanos>,
    /// The newest value.
    value: Option<Hundredths>,
}

/// Shows what one robot does. That of the first robot also shows what is about all.
pub(super) struct Display {
    screen: Screen,
    /// `left: ` before its lines, if the script names its robots.
    name: String,
    /// Whether another robot comes first, and whether there are others at all.
    follows: bool,
    has_others: bool,
    progress: Progress,
    inputs: KeysShown,
    /// Converts times of the run to times of the script.
    script: ScriptTime,
    /// The board of the robot, once it has got a command.
    board: Option<Arc<Board>>,
    /// Whether the keys of a pause were shown.
    has_shown_keys: bool,
    /// The commands sent so far, the worst lateness, the number of dropped frames, and the pass.
    state: State,
    worst_late: Nanos,
    dropped: usize,
    pass: u64,
    clock: Clock,
    waiting: Option<Waiting>,
    /// What was said of servos.
    said: HashSet<String>,
    /// The servos that keep settings, by these settings, until they are shown.
    kept: BTreeMap<String, Vec<i32>>,
    /// The pass and the time in the last plain line, and when it was written.
    shown: (u64, Micros),
    shown_at: Instant,
}

/// The time of the script, for the progress line.
enum Clock {
    /// Time 0 on the clock of [`now`], moved by the pauses.
    Runs(Nanos),
    /// Paused at a time of the script.
    Paused(Micros),
    /// The servos move to their first positions, since a time on the clock, in this time; 0 until all robots are ready.
    Starts(Nanos, Nanos),
}

impl Observer for Display {
    fn observe(&mut self, timeline: &Arc<Timeline>, at: Nanos, notice: Notice) {
        self.keep_time(at, notice);
        if self.follows && is_for_all(timeline, notice) {
            return;
        }
        match notice {
            Notice::Say { cue, report } => self.say(timeline, cue, report.as_ref()),
            Notice::Waiting { gate } => self.waits(timeline, at, gate),
            Notice::Measured { value, .. } => self.waiting.iter_mut().for_each(|waiting| waiting.value = Some(value)),
            Notice::Passed(passage) => self.passed(timeline, at, passage),
            Notice::Judged(verdict) => self.judged(timeline, verdict),
            Notice::Sent { event, late } => {
                if let Some(event) = timeline.events.get(event) {
                    self.board.get_or_insert_with(|| Arc::clone(&timeline.board));
                    self.state.apply(&timeline.board, &event.command);
                    self.worst_late = self.worst_late.max(late);
                }
                // While paused, this is a step, which is always shown.
                if self.screen.is_verbose() || matches!(self.clock, Clock::Paused(_)) {
                    self.frame(timeline, "", event);
                }
            }
            Notice::Withheld { event } => {
                if let Some(event) = timeline.events.get(event) {
                    self.state.apply(&timeline.board, &event.command);
                }
                self.frame(timeline, "not sent while paused: ", event);
            }
            Notice::Errors(_) | Notice::Unanswered => self.first_answer(timeline, notice),
            Notice::Dropped { event } => {
                self.dropped += 1;
                self.frame(timeline, "dropped: ", event);
            }
            Notice::Sleeping { at: script } => {
                self.screen.ask(&format!("{script:.3} s: suspended, robot stopped; resume with `fg`"));
            }
            Notice::Help => self.screen.ask(KEYS),
            Notice::Paused { at: script } => {
                let how = if std::mem::replace(&mut self.has_shown_keys, true) { "" } else { self.inputs.in_pause() };
                self.screen.ask(&format!("{script:.3} s: paused{}{how}", self.script.words(script)));
            }
            // The progress line shows it too.
            Notice::Pass { pass: pass @ 2.. } if self.screen.is_verbose() => self.screen.note(&format!("pass {pass}")),
            Notice::Resumed { at: script } => self.screen.note(&format!("{script:.3} s: continued")),
            _ => self.servo(timeline, at, notice),
        }
    }
}

impl Display {
    /// Shows a run on a screen, and the keys if they work. The robot is what its lines begin with, its number and the number of robots.
    pub(super) fn new(
        screen: Screen,
        progress: Progress,
        script: ScriptTime,
        inputs: KeysShown,
        (name, number, count): (String, usize, usize),
    ) -> Self {
        let follows = number > 0;
        if inputs.single && !follows {
            screen.note("keys: space pauses, q stops and exits, ? shows all");
        }
        Display {
            screen,
            name,
            follows,
            has_others: count > 1,
            progress,
            inputs,
            script,
            board: None,
            has_shown_keys: false,
            said: HashSet::new(),
            kept: BTreeMap::new(),
            state: State::default(),
            worst_late: Nanos::ZERO,
            dropped: 0,
            pass: 1,
            clock: Clock::Runs(now()),
            waiting: None,
            shown: (0, Micros::ZERO),
            shown_at: Instant::now(),
        }
    }

    /// Updates the progress line, with what the other robots do.
    pub(super) fn update(&mut self, timeline: &Timeline, others: &[Display]) {
        let progress = self.progress;
        match progress {
            Progress::Auto => self.screen.live(&self.line(timeline, others)),
            // An unchanged line is not repeated.
            Progress::Plain if self.shown_at.elapsed() >= SECOND && self.is_further(timeline) => {
                self.shown_at = Instant::now();
                self.screen.note(&self.line(timeline, others));
            }
            Progress::Plain | Progress::None => {}
        }
    }

    fn say(&self, timeline: &Timeline, cue: usize, report: Option<&Report>) {
        let Some(cue) = timeline.cues.get(cue) else { return };
        // A line without reports is said once for all robots.
        let name = if cue.text.rows().next().is_some() { &self.name } else { "" };
        self.screen.note(&format!("{:.3} s: {name}{}", cue.at, cue.text.with(report)));
    }

    /// Keeps the time of the script, and that of a closed gate.
    fn keep_time(&mut self, at: Nanos, notice: Notice) {
        match notice {
            Notice::Sleeping { at: script } | Notice::Paused { at: script } => {
                self.pause_gate(at, true);
                self.clock = Clock::Paused(script);
            }
            Notice::Resumed { at: script } => {
                self.pause_gate(at, false);
                self.clock = Clock::Runs(at - script.nanos());
            }
            // Several robots begin together.
            Notice::Pass { pass: 1 } if self.has_others => self.clock = Clock::Starts(at, Nanos::ZERO),
            Notice::Pass { pass } => (self.pass, self.clock) = (pass, Clock::Runs(at)),
            _ => {}
        }
    }

    /// Clears the progress line.
    pub(super) fn end(&self) {
        if self.progress == Progress::Auto {
            self.screen.live("");
        }
    }

    /// Whether the run has advanced since the last plain line: after a suspension, the clock is ahead for a moment.
    fn is_further(&mut self, timeline: &Timeline) -> bool {
        let now = (self.pass, self.time(timeline));
        let is_further = matches!(self.clock, Clock::Runs(_)) && (now > self.shown || self.waiting.is_some());
        if is_further {
            self.shown = now;
        }
        is_further
    }

    /// A gate has closed.
    fn waits(&mut self, timeline: &Timeline, at: Nanos, gate: usize) {
        // In a pause, its time does not count.
        let since = (!matches!(self.clock, Clock::Paused(_))).then_some(at);
        self.waiting = Some(Waiting { gate, before: Nanos::ZERO, since, value: None });
        let Some(gate) = timeline.gates.get(gate) else { return };
        if !gate.gate.is_go() {
            self.screen.note(&format!("{:.3} s: {}{}", gate.at, self.name, gate.gate));
            return;
        }
        let asked = gate.gate.text.as_deref().unwrap_or("waiting for a go");
        self.screen.ask(&format!("{:.3} s: {asked} ({})", gate.at, self.inputs.at_gate()));
    }

    /// A gate has ended; one that failed is shown at the end.
    fn passed(&mut self, timeline: &Timeline, at: Nanos, passage: Passage) {
        self.waiting = None;
        let Some(gate) = timeline.gates.get(passage.gate).filter(|_| passage.end.is_open()) else { return };
        if matches!(self.clock, Clock::Runs(_)) {
            self.clock = Clock::Runs(at - gate.at.nanos());
        }
        let name = if gate.gate.criterion().is_some() { &self.name } else { "" };
        self.screen.note(&format!("{:.3} s: {name}{}", gate.at, passage_words(gate, passage)));
    }

    /// Stops the time of a closed gate, or lets it continue.
    fn pause_gate(&mut self, at: Nanos, is_paused: bool) {
        let Some(waiting) = &mut self.waiting else { return };
        if is_paused {
            waiting.before += waiting.since.take().map_or(Nanos::ZERO, |since| at - since);
        } else {
            waiting.since = Some(at);
        }
    }

    /// What the progress line says about a closed gate: what it waits for, and the time.
    fn waiting_words(&self, timeline: &Timeline) -> Option<[String; 2]> {
        let Waiting { gate, before, since, value } = self.waiting.as_ref()?;
        let gate = timeline.gates.get(*gate)?;
        let passed = (*before + since.map_or(Nanos::ZERO, |since| now() - since)).micros();
        let time = match gate.within() {
            Some(within) => format!("{passed:.1} of {within:.1} s"),
            None => format!("{passed:.1} s"),
        };
        let Some(criterion) = gate.gate.criterion() else {
            let awaited = if gate.gate.is_go() { "a go" } else { "another robot" };
            return Some([format!("waiting for {awaited}"), time]);
        };
        let value = value.map_or_else(|| "?".to_owned(), |value| format!("{value}{}", criterion.measured.unit()));
        Some([format!("waiting for {criterion}: {value}"), time])
    }

    /// Shows an `expect` that passed; one that failed is shown at the end.
    fn judged(&self, timeline: &Timeline, verdict: Verdict) {
        if let (Some(due), true) = (timeline.expects.get(verdict.expect), verdict.found.is_passed()) {
            self.screen.note(&format!("{:.3} s: {}expect {}: {}", due.at, self.name, due.expect, verdict.found));
        }
    }

    /// Shows what is wrong with the first answer of the board.
    fn first_answer(&self, timeline: &Timeline, notice: Notice) {
        let board = &timeline.board;
        match notice {
            Notice::Errors(0) => {}
            Notice::Errors(bits) => {
                self.screen.warning(&format!("{}the board reports {}", self.name, board.errors(bits)));
            }
            _ => self.screen.warning(&format!("{}the board does not answer: {}", self.name, board.silence_hint())),
        }
    }

    /// Shows the settings that servos keep: equal ones together.
    fn show_kept(&mut self) {
        for (kept, servos) in std::mem::take(&mut self.kept) {
            let numbers: Vec<String> = servos.iter().map(ToString::to_string).collect();
            let (servo, keep) = if servos.len() == 1 { ("servo", "keeps") } else { ("servos", "keep") };
            self.screen.note(&format!("{}{servo} {} {keep} {kept}", self.name, numbers.join(", ")));
        }
    }

    /// Shows what happens to servos, each once.
    fn servo(&mut self, timeline: &Timeline, at: Nanos, notice: Notice) {
        match notice {
            Notice::Kept { servo, values } => {
                let kept = kept_words(&timeline.board, values);
                return kept.into_iter().for_each(|kept| self.kept.entry(kept).or_default().push(servo));
            }
            Notice::SoftStart { takes, .. } => {
                self.show_kept();
                self.clock = Clock::Starts(at, takes);
                self.said.clear();
            }
            Notice::Began => {
                self.show_kept();
                self.clock = Clock::Runs(at);
            }
            _ => {}
        }
        let Some(words) = servo_words(&timeline.board, notice).filter(|words| self.said.insert(words.clone())) else {
            return;
        };
        let words = format!("{}{words}", self.name);
        if matches!(notice, Notice::Flags { .. }) {
            self.screen.warning(&words);
        } else {
            self.screen.note(&words);
        }
    }

    /// Shows one frame.
    fn frame(&self, timeline: &Timeline, what: &str, event: usize) {
        if let Some(event) = timeline.events.get(event) {
            let kind = event.kind.word().map(|word| format!(" ({word})")).unwrap_or_default();
            let command = timeline.board.show(&event.command);
            self.screen.note(&format!("{:.3} s: {}{what}{command}{kind}", event.at, self.name));
        }
    }

    /// `1.2 / 3.0 s ████░░░░░░  rocker x=10 y=0 z=0  next bow at 2.0 s  servo 1 1500`, as much of it as fits.
    fn line(&self, timeline: &Timeline, others: &[Display]) -> String {
        let (end, now) = (timeline.end, self.time(timeline));
        let mut line = format!("{now:.3} / {end:.3} s");
        // On a narrow terminal, the words take precedence over the bar.
        let room = if self.screen.is_live() { self.screen.live_width() } else { self.screen.width() };
        // Plain lines have no bar.
        let room_for_bar = room.saturating_sub(line.len() + if self.waiting.is_some() { 80 } else { 50 });
        let bar = bar(now.0, end.0, if self.progress == Progress::Plain { 0 } else { room_for_bar });
        for part in std::iter::once(bar).chain(self.parts(timeline, now, others)).filter(|part| !part.is_empty()) {
            if line.chars().count() + 2 + part.chars().count() > room {
                break;
            }
            line.push_str(if line.ends_with('s') && part.starts_with(['█', '░']) { " " } else { "  " });
            line.push_str(&part);
        }
        line
    }

    /// The time of the script.
    fn time(&self, timeline: &Timeline) -> Micros {
        let gate = self.waiting.as_ref().and_then(|waiting| timeline.gates.get(waiting.gate));
        match self.clock {
            Clock::Runs(begin) => gate.map_or_else(|| (now() - begin).micros().min(timeline.end), |gate| gate.at),
            Clock::Paused(at) => at,
            Clock::Starts(..) => Micros::ZERO,
        }
    }

    /// The parts of the line after the time, the most important first.
    fn parts(&self, timeline: &Timeline, now: Micros, others: &[Display]) -> Vec<String> {
        let mut parts = Vec::new();
        if matches!(self.clock, Clock::Paused(_)) {
            parts.push(PAUSED.to_owned());
        }
        if matches!(self.clock, Clock::Starts(..)) {
            let ends = |display: &Display| match display.clock {
                Clock::Starts(began, takes) if takes > Nanos::ZERO => Some(began + takes),
                _ => None,
            };
            let end = std::iter::once(self).chain(others).filter_map(ends).max();
            let left = end.map(|end| end.saturating_sub(motionseq::playback::now()).micros());
            parts.push(left.map_or_else(|| "getting ready".to_owned(), |left| format!("soft start, {left:.1} s left")));
            return parts;
        }
        parts.extend(self.waiting_words(timeline).into_iter().flatten());
        let dropped = others.iter().map(|other| other.dropped).sum::<usize>() + self.dropped;
        if dropped > 0 {
            parts.push(format!("{dropped} dropped"));
        }
        if self.pass > 1 {
            parts.push(format!("pass {}", self.pass));
        }
        let mut next = None;
        if let Some(mark) = timeline.marks.iter().find(|mark| mark.at > now) {
            next = Some(format!("next {} at {:.3} s", mark.name, mark.at));
        }
        let board = &timeline.board;
        let is_paused = matches!(self.clock, Clock::Paused(_));
        let drive = if is_paused { at_rest(board) } else { drive_words(board, &self.state) };
        let drives = others.iter().filter_map(|other| Some((&other.name, other.drive(is_paused)?)));
        let drives = std::iter::once((&self.name, drive)).chain(drives).filter(|(_, drive)| !drive.is_empty());
        parts.extend(drives.map(|(name, drive)| format!("{name}{drive}")));
        parts.extend(next);
        let worst = others.iter().map(|other| other.worst_late).fold(self.worst_late, Nanos::max);
        if worst >= Nanos::from_millis(1) {
            parts.push(format!("worst lateness {}", worst.short()));
        }
        parts.extend(active_words(board, &self.state).map(|words| format!("{}{words}", self.name)));
        for other in others {
            let board = other.board.as_ref();
            parts.extend(
                board
                    .into_iter()
                    .flat_map(|board| active_words(board, &other.state))
                    .map(|words| format!("{}{words}", other.name)),
            );
        }
        parts
    }

    /// What the drive of this robot does.
    fn drive(&self, is_paused: bool) -> Option<String> {
        let board = self.board.as_ref()?;
        Some(if is_paused { at_rest(board) } else { drive_words(board, &self.state) })
    }
}
