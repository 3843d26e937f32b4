//! Reports are found in any stream, however it is cut, and one that is found is written as it was read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use motionseq::board::{Report, ReportDecoder, ReportItem, raspblock};

fn items(bytes: &[u8], cut: usize) -> Vec<ReportItem> {
    let mut found = Vec::new();
    let mut decoder = ReportDecoder::new(raspblock::board().codec.replies);
    let (first, second) = bytes.split_at(cut);
    decoder.feed(first, |item| found.push(item));
    decoder.feed(second, |item| found.push(item));
    found
}

fuzz_target!(|input: (u16, Vec<u8>)| {
    let (cut, bytes) = input;
    let whole = items(&bytes, 0);
    assert_eq!(items(&bytes, usize::from(cut).min(bytes.len())), whole);
    let reports = whole.iter().filter_map(|item| match item {
        ReportItem::Report(report) => Some(*report),
        _ => None,
    });
    for report in reports.collect::<Vec<Report>>() {
        assert_eq!(items(raspblock::board().report_line(&report).as_bytes(), 0), [ReportItem::Report(report)]);
    }
});
