//! All integration tests in one binary, because linking is what makes `cargo test` slow. Tests that
//! need their own process are in `in_process.rs`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::string_slice,
    clippy::format_push_string,
    clippy::format_collect,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::too_many_lines
)]

mod support;

mod arms;
mod board;
mod bounds;
mod capture;
mod cli;
mod codes;
mod colors;
mod desk;
mod diff;
mod dist;
mod docs;
mod examples;
mod families_cli;
mod family;
mod family_pictures;
mod faults;
mod fixes;
mod fmt;
mod frames;
mod gates;
mod gates_played;
mod host;
mod house;
mod inject;
mod log;
mod maestro;
mod messages;
mod outputs;
mod play;
mod player;
mod plot;
mod ports;
mod project;
mod properties;
mod record;
mod review;
mod robots;
mod robots_played;
mod robots_shown;
mod selection;
mod shell;
mod sim;
mod sts;
mod tap;
mod text_boards;
mod trees;
mod uses;
mod verify;
mod wasm;
mod wire;
mod words;
