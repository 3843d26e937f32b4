//! Any bytes are a snapshot or are none for a reason; two that are compared say something exactly where they differ.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::diff::{diff, diff_all};
use motionseq::timeline::{NamedBoard, Snapshot, read_snapshot, read_snapshots};

fuzz_target!(|input: (Vec<u8>, Vec<u8>)| {
    let read = |text: &[u8]| {
        // The head that every snapshot has, so that the fuzzer need not find it.
        let text = match text.first() {
            Some(b'0') => [b"# motionseq frames 1\n", text].concat(),
            Some(b'#') if !text.starts_with(b"# motionseq") => [b"# motionseq frames 2\n# x\n", text].concat(),
            _ => text.to_vec(),
        };
        read_snapshot(&motionseq::board::raspblock::board(), &text).inspect_err(|error| assert!(!error.why.is_empty()))
    };
    let (old, new) = input;
    let board = motionseq::board::raspblock::board();
    let robots: [NamedBoard; 2] = ["left", "right"].map(|name| (Some(name.into()), board.clone()));
    if let (Ok(old), Ok(new)) = (read_snapshots(&robots, &old), read_snapshots(&robots, &new)) {
        assert!(diff_all(&old, &old, |change| change.new).is_empty());
        assert!(diff_all(&old, &new, |change| change.new).iter().all(|change| !change.words(None).is_empty()));
    }
    let (Ok(old), Ok(new)) = (read(&old), read(&new)) else { return };
    let changes = |old: &Snapshot, new: &Snapshot| diff(old, new, |change| change.new);
    assert!(changes(&old, &old).is_empty());
    let found = changes(&old, &new);
    assert_eq!(found.is_empty(), old.does_the_same(&new));
    for change in found {
        let frames = |snapshot: &Snapshot| {
            if change.aborts {
                snapshot.more.as_ref().map_or(0, |more| more.abort.len())
            } else {
                snapshot.moments.len()
            }
        };
        assert!(change.old.is_none_or(|at| at < frames(&old)) && change.new.is_none_or(|at| at < frames(&new)));
        assert!(!change.words(None).is_empty());
    }
});
