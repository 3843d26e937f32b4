//! The warnings of this stage: one file each, named like its code in src/diagnostic/codes.rs, which explains it with an example. Those about
//! the whole timeline are in src/timeline/lints/.

pub(super) mod brief_condition;
pub(super) mod early_expect;
pub(super) mod impossible_condition;
pub(super) mod let_in_repeat;
pub(super) mod raw_frame;
pub(super) mod slow_refresh;
pub(super) mod unused;
pub(super) mod wait_in_together;
