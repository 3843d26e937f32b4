//! A long script is read on a thread of its own, a little ahead of the thread that runs its lines.
//!
//! Lines, and what was found between them, come in the order of the script, with the thread and without, so that a
//! script gives the same bytes and the same messages on every machine.

use std::mem;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use super::ast::{Line, Lost};
use super::reading::Reading;
use crate::diagnostic::Diagnostics;

/// The least bytes of a script that are worth the start of a thread.
const LONG: usize = 256 * 1024;
/// How many lines are handed over at once.
const BATCH: usize = 512;
/// How many batches may wait.
const WAITING: usize = 8;

/// The lines of a script, one after another.
pub(crate) struct Lines<'s> {
    from: From<'s>,
    line: Option<Line<'s>>,
}

enum From<'s> {
    Here(Reading<'s>),
    Thread(Ahead<'s>),
}

/// The end of the thread that runs the lines.
struct Ahead<'s> {
    batches: Receiver<Batch<'s>>,
    batch: std::vec::IntoIter<Message<'s>>,
    /// Lines that were run are sent back: memory is freed faster on the thread that allocated it.
    spent: Vec<Line<'s>>,
    back: Sender<Vec<Line<'s>>>,
}

type Batch<'s> = Vec<Message<'s>>;

/// A line, or what was found before the next one.
enum Message<'s> {
    Line(Line<'s>),
    Findings(Box<Findings<'s>>),
}

#[derive(Default)]
struct Findings<'s> {
    diagnostics: Diagnostics,
    lost: Lost<'s>,
}

/// Runs something with the lines of a script, which are read ahead if there are many.
pub(crate) fn read_ahead<'s, T>(script: Reading<'s>, run: impl FnOnce(&mut Lines<'s>) -> T) -> T {
    let lines = |from| Lines { from, line: None };
    if script.length() < LONG {
        return run(&mut lines(From::Here(script)));
    }
    let script = Mutex::new(Some(script));
    let take = || script.lock().ok().and_then(|mut script| script.take());
    thread::scope(|scope| {
        let (hand_over, batches) = sync_channel(WAITING);
        let (back, spent) = channel();
        let reader = thread::Builder::new().name("reader".to_owned());
        let started = reader.spawn_scoped(scope, move || {
            if let Some(script) = take() {
                read(script, &hand_over, &spent);
            }
        });
        // If the system cannot start a thread, it is read here.
        if started.is_err()
            && let Some(script) = take()
        {
            return run(&mut lines(From::Here(script)));
        }
        let (batch, spent) = (Vec::new().into_iter(), Vec::with_capacity(BATCH));
        run(&mut lines(From::Thread(Ahead { batches, batch, spent, back })))
    })
}

/// Reads to the end, or until the lines are not needed any more.
fn read<'s>(mut script: Reading<'s>, hand_over: &SyncSender<Batch<'s>>, spent: &Receiver<Vec<Line<'s>>>) {
    let mut goes_on = true;
    while goes_on {
        let mut batch = Vec::with_capacity(BATCH);
        while goes_on && batch.len() < BATCH {
            let mut trouble = Findings::default();
            let line = script.next(&mut trouble.diagnostics, &mut trouble.lost);
            if !trouble.is_none() {
                batch.push(Message::Findings(Box::new(trouble)));
            }
            goes_on = line.is_some();
            batch.extend(line.map(Message::Line));
        }
        spent.try_iter().for_each(drop);
        goes_on &= hand_over.send(batch).is_ok();
    }
}

impl<'s> Lines<'s> {
    /// The next line, with its blocks. What cannot be read is reported and left out.
    pub(crate) fn next(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<&Line<'s>> {
        let spent = self.line.take();
        self.line = match &mut self.from {
            From::Here(reading) => {
                drop(spent);
                reading.next(diagnostics, lost)
            }
            From::Thread(ahead) => {
                ahead.give_back(spent);
                ahead.next(diagnostics, lost)
            }
        };
        self.line.as_ref()
    }
}

impl<'s> Ahead<'s> {
    fn next(&mut self, diagnostics: &mut Diagnostics, lost: &mut Lost<'s>) -> Option<Line<'s>> {
        loop {
            match self.batch.next() {
                Some(Message::Line(line)) => return Some(line),
                Some(Message::Findings(trouble)) => {
                    diagnostics.append(trouble.diagnostics);
                    lost.add(trouble.lost);
                }
                None => self.batch = self.batches.recv().ok()?.into_iter(),
            }
        }
    }

    fn give_back(&mut self, line: Option<Line<'s>>) {
        self.spent.extend(line);
        if self.spent.len() == BATCH {
            // Where the reader is done, they end here.
            let _ = self.back.send(mem::replace(&mut self.spent, Vec::with_capacity(BATCH)));
        }
    }
}

impl Findings<'_> {
    fn is_none(&self) -> bool {
        self.diagnostics.errors() + self.diagnostics.warnings() == 0 && self.lost.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::super::read as begin;
    use super::*;
    use crate::source::Source;

    /// All lines of a script and all that is said of it.
    fn all(source: &Source, ahead: bool) -> (Vec<String>, Diagnostics, Lost<'_>) {
        let (mut diagnostics, mut lost) = (Diagnostics::default(), Lost::default());
        let mut script = begin(source, &mut diagnostics).unwrap();
        let mut found = Vec::new();
        if ahead {
            read_ahead(script, |lines| {
                while let Some(line) = lines.next(&mut diagnostics, &mut lost) {
                    found.push(format!("{line:?}"));
                }
            });
        } else {
            while let Some(line) = script.next(&mut diagnostics, &mut lost) {
                found.push(format!("{line:?}"));
            }
        }
        (found, diagnostics, lost)
    }

    #[test]
    fn a_thread_changes_neither_lines_nor_messages() {
        for every in [17, 5_000, 1] {
            let mut text = String::new();
            for number in 0..20_000 {
                text += match number % every {
                    16 => "let gone = = 5\n",
                    15 => "servo 1 ; ; stop\n",
                    14 => "repeat 2 { stop }  # twice\n",
                    _ => "at 1s servo 1 1500\n",
                };
            }
            let source = Source::new("long.motion", text);
            assert!(source.text().len() > LONG);
            let (here, thread) = (all(&source, false), all(&source, true));
            assert_eq!(here.0.len(), thread.0.len());
            assert!(here == thread, "every {every} lines");
            assert_eq!(here.1.has_errors(), every > 1);
        }
    }

    #[test]
    fn who_stops_early_ends_the_thread() {
        let source = Source::new("long.motion", "stop\n".repeat(100_000));
        let mut diagnostics = Diagnostics::default();
        let script = begin(&source, &mut diagnostics).unwrap();
        read_ahead(script, |lines| assert!(lines.next(&mut diagnostics, &mut Lost::default()).is_some()));
    }
}
