//! Plays scripts on the virtual board: checks their `expect`s and the faults that they declare with `# rehearse:`.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::answers::Answers;
use super::rehearse::{Rehearsal, rehearse, rehearse_together};
use super::{DIFFERENCE, Job, NEWER, Problem, SNAPSHOT, problem, read_all, shell_word};
use crate::board::Board;
use crate::diff::diff_all;
use crate::faults::Faults;
use crate::playback::Cause;
use crate::sim::Settings;
use crate::source::{Lines, Sources};
use crate::timeline::{Gate, Moment, NamedBoard, Snapshot, Timeline, write_aborted};

/// The start of a comment that declares faults to rehearse.
const REHEARSE: &str = "rehearse";
/// The code of an `expect` that failed.
pub(super) const EXPECT: &str = "expect";
/// The code of a gate that did not open.
pub(super) const GATE: &str = "gate";
/// The code of a run that failed.
const PLAY: &str = "play";

impl Job {
    /// Plays a script and returns the problems.
    pub(super) fn play(
        &self,
        script: &Path,
        timelines: &[Timeline],
        sources: &Sources,
        lines: &Lines<'_>,
    ) -> Vec<Problem> {
        let name = sources.main().name();
        let mut problems = Vec::new();
        let boards: Vec<&Board> = timelines.iter().map(|timeline| &*timeline.board).collect();
        let (mut answers, mut all_faults) = (Answers::default(), Vec::new());
        for (line, words) in rehearsals(sources.main().text()) {
            let listed = words.and_then(|words| {
                let (robot, words) = of_robot(timelines, words);
                let rest = answers.take(&boards, words)?;
                let listed = (!rest.is_empty()).then(|| rest.parse::<Faults>());
                let listed = listed.transpose();
                let listed =
                    listed.map_err(|error| format!("{error}; answers to gates are go=2s and turned=95deg@3s"))?;
                Ok(listed.map(|faults| Rehearsed { line, robot, faults }))
            });
            match listed {
                Ok(listed) => all_faults.extend(listed),
                Err(why) => problems.push(problem(name, line, PLAY, why)),
            }
        }
        let gates: Vec<&Gate> = timelines.iter().flat_map(|timeline| &timeline.gates).collect();
        problems.extend(answers.unused(&gates).map(|kind| {
            let message = format!("an answer of a `# rehearse:` line is for `{kind}`, but no gate waits for that");
            problem(name, 0, PLAY, message)
        }));
        let everywhere = Rehearsed { line: 0, robot: None, faults: self.faults.clone() };
        for (rehearsal, timeline) in everywhere.play(timelines, &answers).iter().zip(timelines) {
            problems.extend(failed(rehearsal, timeline, lines));
            problems.extend(self.went_wrong(rehearsal, timeline, name, lines));
        }
        let mut named = Vec::new();
        for rehearsed in all_faults {
            let rehearsals = rehearsed.play(timelines, &answers);
            problems.extend(self.aborts(script, &rehearsed, &rehearsals, timelines));
            named.push(rehearsed.path(script, timelines));
        }
        problems.extend(left_over(script, &named).into_iter().map(|path| {
            let path = path.display().to_string();
            let help = format!("no `# rehearse:` line of the script uses it: git rm {}", shell_word(&path));
            problem(&path, 0, "orphan", help)
        }));
        problems
    }

    /// The problem of a run that failed for another reason than an `expect`.
    fn went_wrong(&self, rehearsal: &Rehearsal, timeline: &Timeline, name: &str, lines: &Lines<'_>) -> Option<Problem> {
        let place = rehearsal.outcome.place.map(|span| lines.place(span));
        let (file, line) = place.map_or((name, 0), |place| (place.file, place.line));
        let at = rehearsal.outcome.at;
        let sent = |rehearsal| frames(&[(timeline, rehearsal)]);
        let why = match rehearsal.outcome.cause {
            // Said of the robot that ended first.
            Cause::Expect(_) | Cause::Gate(_) | Cause::Other { .. } => return None,
            Cause::Finished if !rehearsal.is_complete(timeline) => {
                format!("frame {} sent to the port differs from `render`", rehearsal.given + 1)
            }
            Cause::Finished => {
                let received = &rehearsal.received;
                match received.first_fault {
                    Some((byte, fault)) => format!("the board cannot decode the bytes from {byte}: {fault}"),
                    // If frames were lost on purpose, the state is unknown.
                    None if received.lost == 0 && !rehearsal.is_at_rest(timeline) => {
                        "the robot is moving at the end; add a `wait` as long as the last `move` takes".to_owned()
                    }
                    None => return None,
                }
            }
            Cause::Lost(_) => format!("the port was lost at {at:.6} s; {}", sent(rehearsal)),
            Cause::Stalled => format!("the port stopped accepting bytes at {at:.6} s; {}", sent(rehearsal)),
            Cause::Servo(fault) => fault.words(&timeline.board),
            Cause::Unanswered => {
                format!("the board did not answer, and the script needs its answers; {}", sent(rehearsal))
            }
            _ => format!("the run ended at {at:.6} s; {}", sent(rehearsal)),
        };
        let with = if self.faults.is_none() { String::new() } else { format!("with {}: ", self.faults) };
        Some(problem(file, line, PLAY, timeline.prefix() + &with + &why))
    }

    /// Compares the frames that are sent when a fault ends the run with their snapshot.
    fn aborts(
        &self,
        script: &Path,
        rehearsed: &Rehearsed,
        rehearsals: &[Rehearsal],
        timelines: &[Timeline],
    ) -> Vec<Problem> {
        let path = rehearsed.path(script, timelines);
        let script_name = script.display().to_string();
        let here = |code, message: String| vec![problem(&script_name, rehearsed.line, code, message)];
        let faults = rehearsed.words(timelines);
        if rehearsals.iter().all(|rehearsal| rehearsal.aborted.is_empty()) {
            let message = format!("{faults} does not end this script early, so nothing is rehearsed");
            return here(PLAY, message);
        }
        let bless = format!("motionseq test --play --bless {}", shell_word(&script_name));
        let both: Vec<(&Timeline, &Rehearsal)> = timelines.iter().zip(rehearsals).collect();
        let snapshot = |(timeline, rehearsal): &(&Timeline, &Rehearsal)| {
            Snapshot::of_moments(timeline.named_board(), rehearsal.aborted.clone())
        };
        let new: Vec<Snapshot> = both.iter().map(snapshot).collect();
        let robots: Vec<NamedBoard> = timelines.iter().map(Timeline::named_board).collect();
        let is_same = |old: &[Snapshot]| {
            let frames =
                |all: &[Snapshot]| all.iter().map(|one| (one.robot.clone(), one.moments.clone())).collect::<Vec<_>>();
            frames(old) == frames(&new)
        };
        let is_newest = |old: &[Snapshot]| old.iter().zip(&new).all(|(old, new)| old.version == new.version);
        match (read_all(&robots, &path, &bless), self.bless) {
            (Ok(Some(old)), write) if is_same(&old) && (is_newest(&old) || write.is_none()) => Vec::new(),
            (Err(wrong), None) => vec![wrong],
            (Err(wrong), _) if wrong.code == NEWER => vec![wrong],
            (_, Some(write)) => {
                let mut text = Vec::new();
                let title = format!("{} {faults}", script.file_name().unwrap_or_default().to_string_lossy());
                let robots: Vec<(&Timeline, &[Moment])> =
                    both.iter().map(|(timeline, rehearsal)| (*timeline, rehearsal.aborted.as_slice())).collect();
                let written = write_aborted(&title, &robots, &mut text).and_then(|()| write(&path, &text));
                let failed =
                    |error: std::io::Error| problem(&path.display().to_string(), 0, "snapshot", error.to_string());
                written.err().map(failed).into_iter().collect()
            }
            (Ok(None), None) => {
                here("snapshot", format!("{} is missing; write it with `{bless}`; {}", path.display(), frames(&both)))
            }
            (Ok(Some(old)), None) => {
                let old: Vec<Snapshot> = old.into_iter().map(|old| Snapshot { more: None, ..old }).collect();
                let changes = diff_all(&old, &new, |_| None::<usize>);
                let words = changes.iter().filter(|change| !change.what.is_total());
                let words = words
                    .map(|change| format!("with {faults}: {}; if the change is intended: {bless}", change.words(None)));
                words.flat_map(|message| here(DIFFERENCE, message)).collect()
            }
        }
    }
}

/// What one `# rehearse:` line declares.
struct Rehearsed {
    line: usize,
    /// The robot whose board has the faults; `None` for all.
    robot: Option<usize>,
    faults: Faults,
}

impl Rehearsed {
    /// Plays all robots.
    fn play(&self, timelines: &[Timeline], answers: &Answers) -> Vec<Rehearsal> {
        if let ([timeline], None) = (timelines, self.robot) {
            return vec![rehearse(timeline, Settings::default(), self.faults.clone(), answers)];
        }
        let is_meant = |robot: usize| self.robot.is_none_or(|meant| meant == robot);
        let of = |robot: usize| if is_meant(robot) { self.faults.clone() } else { Faults::default() };
        let faults: Vec<Faults> = (0..timelines.len()).map(of).collect();
        rehearse_together(timelines, &Settings::default(), &faults, answers)
    }

    /// The robot and the faults as the line names them.
    fn words(&self, timelines: &[Timeline]) -> String {
        let robot = self.robot.and_then(|robot| timelines.get(robot)).map(Timeline::prefix).unwrap_or_default();
        format!("{robot}{}", self.faults)
    }

    /// The path of its snapshot.
    fn path(&self, script: &Path, timelines: &[Timeline]) -> PathBuf {
        let mut name = script.as_os_str().to_owned();
        // File names have no spaces, no slashes and no colons.
        let words = self.words(timelines).replace(": ", ".").replace([' ', '/'], "");
        name.push(format!(".{words}{SNAPSHOT}"));
        PathBuf::from(name)
    }
}

/// The robot that a list of faults names, as in `left: unplug@4s`, and the rest of the list.
fn of_robot<'w>(timelines: &[Timeline], words: &'w str) -> (Option<usize>, &'w str) {
    let named = words.split_once(':').and_then(|(name, rest)| {
        let is_it = |timeline: &Timeline| timeline.robot.as_deref() == Some(name.trim());
        Some((timelines.iter().position(is_it)?, rest.trim()))
    });
    named.map_or((None, words), |(robot, rest)| (Some(robot), rest))
}

/// The `# rehearse:` comments of a script with their lines.
fn rehearsals(text: &str) -> impl Iterator<Item = (usize, Result<&str, String>)> {
    text.lines().zip(1..).filter_map(|(text, line)| {
        let (_, comment) = text.rsplit_once('#')?;
        let comment = comment.trim();
        let head = comment.get(..REHEARSE.len()).filter(|head| head.eq_ignore_ascii_case(REHEARSE))?;
        let faults = comment.strip_prefix(head).and_then(|rest| rest.strip_prefix(':')).filter(|_| head == REHEARSE);
        // A comment that is only similar is an error, so that it is not silently ignored.
        Some((line, faults.map(str::trim).ok_or_else(|| "write `# rehearse: unplug@4s`".to_owned())))
    })
}

/// Snapshots of rehearsals that a script does not declare.
fn left_over(script: &Path, named: &[PathBuf]) -> Vec<PathBuf> {
    let folder = script.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = script.file_name().unwrap_or_default().as_encoded_bytes();
    let is_left = |other: &OsStr| {
        let rest = other.as_encoded_bytes().strip_prefix(name).and_then(|rest| rest.strip_prefix(b"."));
        rest.is_some_and(|rest| rest.len() > SNAPSHOT.len() && rest.ends_with(SNAPSHOT.as_bytes()))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut found: Vec<PathBuf> = entries
        .filter(|other| is_left(other))
        .map(|other| script.with_file_name(other))
        .filter(|path| !named.contains(path))
        .collect();
    found.sort();
    found
}

/// The failed `expect`s and the gate that did not open, with their lines.
fn failed(rehearsal: &Rehearsal, timeline: &Timeline, lines: &Lines<'_>) -> Vec<Problem> {
    let failed = rehearsal.verdicts.iter().filter(|verdict| !verdict.found.is_passed());
    let problems = failed.filter_map(|verdict| {
        let due = timeline.expects.get(verdict.expect)?;
        let place = lines.place(due.span);
        let at = if due.expect.within.is_some() { due.until } else { due.at };
        let words = timeline.verdict_words(verdict.expect, &verdict.found.to_string());
        Some(problem(place.file, place.line, EXPECT, format!("{}at {at:.6} s: {words}", timeline.prefix())))
    });
    let mut problems: Vec<Problem> = problems.collect();
    if let Cause::Gate(passage) = rehearsal.outcome.cause
        && let Some(gate) = timeline.gates.get(passage.gate)
    {
        let place = lines.place(gate.span);
        let words = timeline.gate_words(passage.gate, |unit| passage.end.words(unit));
        let words = format!("{}at {:.6} s, after {:.3} s: {words}", timeline.prefix(), gate.at, passage.took.micros());
        problems.push(problem(place.file, place.line, GATE, words));
    }
    problems
}

/// The frames that are sent when a run ends early.
fn frames(robots: &[(&Timeline, &Rehearsal)]) -> String {
    let of_one = |(timeline, rehearsal): &(&Timeline, &Rehearsal)| {
        let said = |moment: &Moment| format!("`{}`", timeline.board.show(&moment.command));
        let frames: Vec<String> = rehearsal.aborted.iter().map(said).collect();
        let name = if robots.len() > 1 { timeline.prefix() } else { String::new() };
        if frames.is_empty() {
            format!("{name}no frames are sent then")
        } else {
            format!("{name}frames sent then: {}", frames.join(", "))
        }
    };
    robots.iter().map(of_one).collect::<Vec<_>>().join("; ")
}
