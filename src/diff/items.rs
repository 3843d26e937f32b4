//! Groups frames into items: a command with its refreshes, or a move with its steps.

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::board::Board;
use crate::program::Ease;
use crate::timeline::tween::{MoveTracker, StepRole};
use crate::timeline::{Kind, Moment, Note, NoteKind, Tween};
use crate::units::Micros;

/// One command, one move, or one note.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) lane: usize,
    /// Its position in its lane.
    pub(super) place: usize,
    /// When it starts; for an old item, also scaled as other items are.
    pub(super) at: Micros,
    /// When it starts in its own timeline.
    pub(super) shown: Micros,
    /// The index of its first frame.
    pub(super) first: usize,
    /// The command; for a move, its target.
    pub(super) notation: String,
    pub(super) moves: Option<Moves>,
    /// When its last frame before any refresh was sent.
    sent: Micros,
    /// The interval between two refreshes, if there are any.
    pub(super) refresh: Option<Micros>,
    /// Whether it is a note, which is compared as a whole.
    pub(super) is_note: bool,
    /// Whether it is a gate.
    pub(super) is_gate: bool,
    /// Whether it keeps its resource active until the next item of its lane.
    pub(super) is_active: bool,
    /// How long the resulting state lasts, until the next item of its lane.
    pub(super) holds: Micros,
    /// The pause before it, in which nothing is sent but refreshes, and no move runs.
    pub(super) pause: Micros,
}

/// What a move has in addition to a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Moves {
    /// The duration and the easing; `None` if unknown.
    pub(super) meant: Option<(Micros, Ease)>,
    /// The frame at the start, if one is sent.
    start: Option<String>,
    /// The number of steps.
    pub(super) steps: usize,
    /// A hash of the steps.
    pub(super) hash: u64,
}

impl Item {
    /// `servo 2 1700`, `servo 2 1700 over 500 ms`, in parts that are compared one by one.
    pub(super) fn parts(&self) -> Vec<String> {
        if self.is_note {
            return vec![self.notation.clone()];
        }
        let mut parts: Vec<String> = self.notation.split(' ').map(str::to_owned).collect();
        match &self.moves {
            None => {}
            Some(Moves { meant: Some((lasts, ease)), .. }) => {
                parts.extend([format!("over {}", super::words::span(*lasts)), format!("ease {}", ease.name())]);
                parts.push(format!("from {}", self.start().unwrap_or_else(|| "its last value".to_owned())));
            }
            Some(Moves { meant: None, steps, .. }) => parts.push(format!("in {steps} steps")),
        }
        parts
    }

    /// The item in the notation of scripts.
    pub(super) fn words(&self) -> String {
        let mut parts = self.parts();
        parts.retain(|role| super::words::is_always_shown(role));
        parts.join(" ")
    }

    /// The starting values, without the words that the target repeats.
    fn start(&self) -> Option<String> {
        let start = self.moves.as_ref()?.start.as_ref()?;
        let same = start.split(' ').zip(self.notation.split(' ')).take_while(|(word, other)| word == other).count();
        Some(start.split(' ').skip(same).collect::<Vec<_>>().join(" "))
    }

    /// The duration; 0 for a command.
    pub(super) fn lasts(&self) -> Micros {
        self.moves.as_ref().and_then(|moves| moves.meant).map_or(Micros::ZERO, |(lasts, _)| lasts)
    }
}

/// The name of a lane. Each kind of note has its own, after those of the board.
pub(super) fn lane_name(board: &Board, lane: usize) -> String {
    let kind = lane.checked_sub(board.lanes()).and_then(|kind| NoteKind::ALL.get(kind));
    kind.map_or_else(|| board.lane_name(lane).into_owned(), |kind| format!("`{}`", kind.word()))
}

/// Groups frames, and adds the notes. Without `tweens`, successive samples without another command
/// in between form one move.
pub(super) fn items(board: &Board, moments: &[Moment], tweens: Option<&[Tween]>, notes: &[Note]) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    let mut newest: Vec<Option<usize>> = vec![None; board.lanes()];
    let mut tracker = MoveTracker::new(board, tweens.unwrap_or_default());
    for (first, moment) in moments.iter().enumerate() {
        // The requests for reports follow from the `expect`s.
        if moment.kind == Kind::Auto && !notes.is_empty() {
            continue;
        }
        let lane = board.lane(&moment.command);
        let said = || board.show(&moment.command).to_string();
        let role = tracker.take(&moment.command, moment.kind);
        let before = newest.get(lane).copied().flatten().and_then(|at| items.get_mut(at));
        let tween = match (moment.kind, role, before) {
            (Kind::Refresh, _, Some(item)) => {
                item.refresh.get_or_insert(moment.at - item.sent);
                item.holds = moment.at - item.sent;
                continue;
            }
            (Kind::Sample, StepRole::Further, Some(item)) => {
                item.extend(moment, said());
                continue;
            }
            (Kind::Sample, StepRole::Stray, Some(item)) if item.moves.is_some() && item.refresh.is_none() => {
                item.extend(moment, said());
                continue;
            }
            (_, StepRole::First(tween), _) => Some(tween),
            _ => None,
        };
        let mut place = 0;
        if let Some(newest) = newest.get_mut(lane) {
            if let Some(before) = newest.and_then(|at| items.get_mut(at)) {
                before.holds = moment.at - before.sent;
                place = before.place + 1;
            }
            *newest = Some(items.len());
        }
        let mut item = Item::new(board, (first, moment), tween, place);
        if moment.kind == Kind::Sample {
            item.extend(moment, said());
        }
        items.push(item);
    }
    for (lane, kind) in (board.lanes()..).zip(NoteKind::ALL) {
        let its = (moments.len()..).zip(notes).filter(|(_, note)| note.kind == *kind);
        items.extend(its.zip(0..).map(|((first, note), place)| Item::note(note, lane, place, first)));
    }
    measure_pauses(&mut items);
    items
}

fn measure_pauses(items: &mut [Item]) {
    let mut in_time: Vec<&mut Item> = items.iter_mut().collect();
    in_time.sort_by_key(|item| (item.at, item.first));
    let mut end = Micros::ZERO;
    for item in in_time {
        item.pause = item.at.saturating_sub(end);
        end = end.max(item.sent).max(item.at + item.lasts());
    }
}

impl Item {
    /// The item that starts with a frame.
    fn new(board: &Board, (first, moment): (usize, &Moment), tween: Option<&Tween>, place: usize) -> Self {
        let said = board.show(&moment.command).to_string();
        let at = tween.map_or(moment.at, |tween| tween.at);
        let is_step = moment.kind == Kind::Sample;
        let moves = is_step.then(|| {
            let meant = tween.map(|tween| (tween.end - tween.at, tween.ease));
            let start = tween.filter(|tween| tween.at == moment.at).map(|_| said.clone());
            Moves { meant, start, steps: 0, hash: 0 }
        });
        let closing = if moment.kind == Kind::Closing { " (closing)" } else { "" };
        Item {
            lane: board.lane(&moment.command),
            place,
            at,
            shown: at,
            first,
            notation: said + closing,
            moves,
            sent: moment.at,
            refresh: None,
            is_note: false,
            is_gate: false,
            is_active: !is_step && board.is_active(&moment.command),
            holds: Micros::ZERO,
            pause: Micros::ZERO,
        }
    }

    fn note(note: &Note, lane: usize, place: usize, first: usize) -> Self {
        Item {
            lane,
            place,
            at: note.at,
            shown: note.at,
            first,
            notation: note.words.clone(),
            moves: None,
            sent: note.at,
            refresh: None,
            is_note: true,
            is_gate: note.kind == NoteKind::Gate,
            is_active: false,
            holds: Micros::ZERO,
            pause: Micros::ZERO,
        }
    }

    /// Gives a move the duration and the steps of its new version, if the durations fit.
    pub(super) fn scale_like(&mut self, new: &Item, fits: impl Fn(Micros, Micros) -> bool) {
        if fits(self.lasts(), new.lasts())
            && let (Some(old), Some(new)) = (&mut self.moves, &new.moves)
            && let (Some((lasts, _)), Some((is, _))) = (&mut old.meant, new.meant)
        {
            *lasts = is;
            (old.steps, old.hash) = (new.steps, new.hash);
        }
    }

    /// Adds a step to a move.
    fn extend(&mut self, moment: &Moment, notation: String) {
        self.notation = notation;
        self.sent = moment.at;
        let since = moment.at.saturating_sub(self.at);
        if let Some(moves) = &mut self.moves {
            let mut hasher = DefaultHasher::new();
            (moves.hash, since, &self.notation).hash(&mut hasher);
            moves.hash = hasher.finish();
            moves.steps += 1;
        }
    }
}
