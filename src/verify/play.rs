//! Scripts that are played: on the virtual board, with what they expect, and with the faults that they name.

use std::fs;
use std::path::{Path, PathBuf};

use super::rehearse::{Rehearsal, rehearse};
use super::{Job, Problem, SNAPSHOT, problem, shell_word};
use crate::playback::Cause;
use crate::sim::{Faults, Settings};
use crate::source::{Lines, Sources, replace_file};
use crate::timeline::{Seconds, Snapshot, Timeline, diff, read_snapshot, write_aborted};

/// How a line begins that names faults to rehearse.
const REHEARSE: &str = "# rehearse:";
/// The code of an `expect` that failed.
pub(super) const EXPECT: &str = "expect";
/// The code of a run that went otherwise than the script says.
const PLAY: &str = "play";

impl Job {
    /// Plays a script; gives what is wrong.
    pub(super) fn play(
        &self,
        script: &Path,
        timeline: &Timeline,
        sources: &Sources,
        lines: &Lines<'_>,
    ) -> Vec<Problem> {
        let name = sources.main().name();
        let rehearsal = rehearse(timeline, Settings { faults: self.faults.clone(), ..Settings::default() });
        let mut problems = failed(&rehearsal, timeline, lines);
        problems.extend(self.went_wrong(&rehearsal, timeline, name, lines));
        for (line, words) in sources
            .main()
            .text()
            .lines()
            .zip(1..)
            .filter_map(|(text, line)| Some((line, text.strip_prefix(REHEARSE)?.trim())))
        {
            match words.parse::<Faults>() {
                Err(error) => problems.push(problem(name, line, PLAY, error.to_string())),
                Ok(faults) => {
                    let rehearsal = rehearse(timeline, Settings { faults: faults.clone(), ..Settings::default() });
                    problems.extend(self.aborts(script, &faults, &rehearsal, timeline, line));
                }
            }
        }
        problems
    }

    /// What else than an `expect` went wrong.
    fn went_wrong(&self, rehearsal: &Rehearsal, timeline: &Timeline, name: &str, lines: &Lines<'_>) -> Option<Problem> {
        let place = rehearsal.outcome.place.map(|span| lines.place(span));
        let (file, line) = place.map_or((name, 0), |place| (place.file, place.line));
        let at = Seconds(rehearsal.outcome.at_us);
        let why = match rehearsal.outcome.cause {
            Cause::Expect(_) => return None,
            Cause::Finished if !rehearsal.is_complete(timeline) => {
                format!("frame {} was given to the port otherwise than `render` says", rehearsal.given + 1)
            }
            Cause::Finished => {
                let received = &rehearsal.received;
                match received.first_fault {
                    Some((byte, fault)) => format!("the board cannot use byte {byte} and what follows: {fault}"),
                    // With frames lost on purpose nobody knows.
                    None if received.lost == 0 && !received.state.at_rest() => "it does not end at rest".to_owned(),
                    None => return None,
                }
            }
            Cause::Lost(_) => format!("the port was lost at {at} s; {}", frames(rehearsal)),
            Cause::Stalled => format!("the port stopped taking bytes at {at} s; {}", frames(rehearsal)),
            _ => format!("the run ended at {at} s; {}", frames(rehearsal)),
        };
        let with = if self.faults.is_none() { String::new() } else { format!("with {}: ", self.faults) };
        Some(problem(file, line, PLAY, with + &why))
    }

    /// Holds what goes out when a fault ends the run against its snapshot.
    fn aborts(
        &self,
        script: &Path,
        faults: &Faults,
        rehearsal: &Rehearsal,
        timeline: &Timeline,
        line: usize,
    ) -> Vec<Problem> {
        let path = aborted_of(script, faults);
        let (name, script_name) = (path.display().to_string(), script.display().to_string());
        let bless = format!("motionseq test --play --bless {}", shell_word(&script_name));
        let here = |code, message: String| vec![problem(&script_name, line, code, message)];
        let old = match fs::read(&path) {
            Ok(text) => {
                read_snapshot(&text).map_err(|error| (error.line, format!("{}; `{bless}` writes it anew", error.why)))
            }
            Err(_) if self.bless => Err((0, String::new())),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let message = format!("there is no {name}; `{bless}` writes it; {}", frames(rehearsal));
                return here("snapshot", message);
            }
            Err(error) => Err((0, error.to_string())),
        };
        let new = Snapshot { moments: rehearsal.aborted.clone(), more: None };
        match old {
            Ok(old) if old.moments == new.moments => Vec::new(),
            _ if self.bless => {
                let mut text = Vec::new();
                let title = format!("{} {faults}", script.file_name().unwrap_or_default().to_string_lossy());
                let written = write_aborted(&title, &new.moments, timeline.baud, &mut text)
                    .and_then(|()| replace_file(&path, &text));
                written.err().map(|error| problem(&name, 0, "snapshot", error.to_string())).into_iter().collect()
            }
            Err((at, why)) => vec![problem(&name, at, "snapshot", why)],
            Ok(old) => {
                let old = Snapshot { more: None, ..old };
                let changes = diff(&old, &new, |_| None::<usize>);
                let words = changes
                    .iter()
                    .filter(|change| !change.what.is_total())
                    .map(|change| format!("rehearsing {faults}, {}; if that is meant: {bless}", change.words(None)));
                words.flat_map(|message| here("difference", message)).collect()
            }
        }
    }
}

/// Every `expect` that failed, at its line.
fn failed(rehearsal: &Rehearsal, timeline: &Timeline, lines: &Lines<'_>) -> Vec<Problem> {
    let failed = rehearsal.verdicts.iter().filter(|verdict| !verdict.found.is_passed());
    let problems = failed.filter_map(|verdict| {
        let due = timeline.expects.get(verdict.expect)?;
        let place = lines.place(due.span);
        let at = if due.expect.within.is_some() { due.until_us } else { due.at_us };
        let words = timeline.verdict_words(verdict.expect, &verdict.found.to_string());
        Some(problem(place.file, place.line, EXPECT, format!("at {} s: {words}", Seconds(at))))
    });
    problems.collect()
}

/// What goes out when a run ends early, in words.
fn frames(rehearsal: &Rehearsal) -> String {
    let frames: Vec<String> = rehearsal.aborted.iter().map(|moment| format!("`{}`", moment.command)).collect();
    if frames.is_empty() { "nothing goes out".to_owned() } else { format!("what goes out is {}", frames.join(", ")) }
}

/// The path of the snapshot of what goes out when a fault ends the run.
fn aborted_of(script: &Path, faults: &Faults) -> PathBuf {
    let mut name = script.as_os_str().to_owned();
    // A name of a file has no blanks and slashes.
    name.push(format!(".{}{SNAPSHOT}", faults.to_string().replace([' ', '/'], "")));
    PathBuf::from(name)
}
