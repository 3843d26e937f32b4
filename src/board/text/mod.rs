//! Text boards: the firmware of a user, described in a TOML file, with a template for what each verb
//! sends.
//!
//! Source: the file itself. docs/boards.md describes its keys.

mod axes;
mod build;
mod codec;
mod file;
mod reader;
mod search;
mod template;

pub use file::{MAX_FILE, read};
