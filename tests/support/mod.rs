//! Helpers for all tests.
#![allow(dead_code, unused_imports, reason = "neither test binary uses all of it")]

pub(crate) mod board;
pub(crate) mod far;
pub(crate) mod host;
mod scratch;

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use miette::{GraphicalReportHandler, GraphicalTheme};
use motionseq::diagnostic::{Attached, Diagnostic, Diagnostics, Printable};
use motionseq::program::Options;
use motionseq::source::{Disk, Files as _, Sources};
use motionseq::timeline::write_listings;
pub(crate) use scratch::{Scratch, code, with_motionseq};
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT};

/// A script's listing and its messages, in the format of snapshots.
pub(crate) fn listing_and_messages(path: &Path) -> String {
    let name = path.file_name().unwrap().to_str().unwrap();
    let source = match Disk.read(path) {
        Ok(source) => source.named(name),
        Err(error) => {
            let (source, diagnostic) = Diagnostic::of_source(error).unwrap();
            let mut diagnostics = Diagnostics::default();
            diagnostics.push(diagnostic);
            return messages(&source.named(name).into(), &diagnostics);
        }
    };
    let sources = Sources::new(source, Disk);
    let compiled = motionseq::compile(&sources, &Options::default());
    let mut text = Vec::new();
    write_listings(&compiled.timelines, &mut text).unwrap();
    let mut text = String::from_utf8(text).unwrap();
    // Other files are named by their whole path.
    let folder = format!("{}/", path.parent().unwrap().display());
    text.push_str(&messages(&sources, &compiled.diagnostics).replace(&folder, ""));
    text
}

/// Every message of a script, without color, 80 columns wide.
pub(crate) fn messages(sources: &Sources, diagnostics: &Diagnostics) -> String {
    let printable = Printable::all(sources);
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(80)
        .with_links(false)
        .with_word_separator(textwrap::WordSeparator::AsciiSpace)
        .with_word_splitter(textwrap::WordSplitter::NoHyphenation);
    let mut text = String::new();
    for diagnostic in diagnostics {
        assert!(!diagnostic.help.is_empty(), "{diagnostic:?} says nothing that helps");
        handler.render_report(&mut text, &Attached::new(diagnostic, &printable)).unwrap();
        text.push('\n');
    }
    text
}

/// The path of the program. A shell makes background processes ignore Ctrl-C, and the program would
/// inherit that. If this process ignores such a signal, it catches it instead, which children do
/// not inherit.
pub(crate) fn program() -> &'static str {
    static CAUGHT: OnceLock<()> = OnceLock::new();
    CAUGHT.get_or_init(|| {
        let status = fs::read_to_string("/proc/self/status").unwrap();
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
        let ignored = u64::from_str_radix(ignored.trim(), 16).unwrap();
        for signal in [SIGHUP, SIGINT, SIGQUIT].into_iter().filter(|signal| ignored & 1 << (signal - 1) != 0) {
            signal_hook::flag::register(signal, Arc::default()).unwrap();
        }
    });
    env!("CARGO_BIN_EXE_motionseq")
}

/// Variables that turn colors on and off.
pub(crate) const COLORS: [&str; 4] = ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "FORCE_COLOR"];

/// The built program, run from the root of the project, without settings of the user.
pub(crate) fn motionseq(args: &[&str]) -> Command {
    let mut command = Command::new(program());
    command.args(args);
    // A shared machine can stall for longer than a robot may wait. Tests about lateness set their
    // own limit.
    if args.first() == Some(&"play") && !args.contains(&"--max-late") {
        command.args(["--max-late", "5s"]);
    }
    for name in COLORS {
        command.env_remove(name);
    }
    command.current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("MOTIONSEQ_PORT").stdin(Stdio::null());
    command
}

/// Copies the program in another process. A file that this process has open for writing could be
/// inherited by a child of another test, and cannot be run then.
pub(crate) fn copy_program(to: &Path) {
    assert!(Command::new("cp").arg(env!("CARGO_BIN_EXE_motionseq")).arg(to).status().unwrap().success());
}

/// Runs the program to its end.
pub(crate) fn run(args: &[&str]) -> Output {
    motionseq(args).output().unwrap()
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Standard output as text.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Locked by a test that uses `insta::glob!`: insta counts the failures of all tests that run at
/// the same time.
pub(crate) fn one_glob_at_a_time() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A script of a test, in its own file.
pub(crate) fn script(name: &str, text: &str) -> String {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("motionseq-{name}-{}-{number}.motion", std::process::id()));
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The bytes of a script, as `render` prints them.
pub(crate) fn rendered(script: &str) -> Vec<u8> {
    run(&["render", script, "--format", "bin"]).stdout
}
