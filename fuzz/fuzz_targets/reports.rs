//! Reports and answers are found in any stream, however it is cut, and a report that is found is written as it was read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::board::{Board, Family, Report, ReportDecoder, ReportItem, raspblock};

/// What a board says, cut at one place. A board that answers is asked for each of its quantities in turn.
fn items(board: &Board, bytes: &[u8], cut: usize) -> Vec<ReportItem> {
    let mut found = Vec::new();
    let mut decoder = ReportDecoder::new(board);
    let requests: Vec<_> = board.quantities.iter().filter_map(|quantity| quantity.request.clone()).collect();
    let mut turn = 0;
    let (first, second) = bytes.split_at(cut);
    for mut part in [first, second] {
        loop {
            if !decoder.is_waiting() && let Some(request) = requests.get(turn % requests.len().max(1)) {
                decoder.ask(request);
                turn += 1;
            }
            match decoder.next(&mut part) {
                Some(item) => found.push(item),
                None => break,
            }
        }
    }
    found
}

fuzz_target!(|input: (u16, Vec<u8>)| {
    let (cut, bytes) = input;
    for board in [raspblock::board(), Family::board("maestro 24").unwrap(), Family::board("sts").unwrap()] {
        let whole = items(&board, &bytes, 0);
        assert_eq!(items(&board, &bytes, usize::from(cut).min(bytes.len())), whole);
        let reports = whole.iter().filter_map(|item| match item {
            ReportItem::Report(report) => Some(*report),
            _ => None,
        });
        for report in reports.collect::<Vec<Report>>() {
            let line = board.report_line(&report);
            assert!(line.is_empty() || items(&board, line.as_bytes(), 0) == [ReportItem::Report(report)]);
            assert!(report.values().all(|(row, _)| row < board.quantities.len()));
        }
    }
});
