//! The compiler as a WebAssembly module gives the same results as the native one.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use motionseq::program::Options;
use motionseq::report::findings;
use motionseq::source::{Disk, Sources};
use motionseq::timeline::write_listings;
use serde_json::{Value, json};

const TARGET: &str = "wasm32-unknown-unknown";
/// The maximum size of the module in bytes.
const LARGEST: u64 = 1_350_000;

/// Builds the module; `None` if the target or Node is not installed.
fn module() -> Option<PathBuf> {
    let prints = |program: &str, arguments: &[&str], wanted: &str| {
        let output = Command::new(program).args(arguments).output();
        output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(wanted))
    };
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let library = Command::new(rustc).args(["--print", "target-libdir", "--target", TARGET]).output().unwrap();
    let has_target = Path::new(String::from_utf8_lossy(&library.stdout).trim()).is_dir();
    let is_there = has_target && prints("node", &["--version"], "v");
    assert!(is_there || std::env::var_os("CI").is_none(), "CI lacks node, or `rustup target add {TARGET}`");
    if !is_there {
        eprintln!("skipped: needs node and `rustup target add {TARGET}`");
        return None;
    }
    // In a separate folder, because this build may run at the same time as another one.
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/wasm");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--release", "--no-default-features", "--example", "wasm", "--target", TARGET])
        .arg("--target-dir")
        .arg(&folder)
        .env_remove("RUSTFLAGS")
        .status()
        .unwrap();
    assert!(built.success());
    Some(folder.join(TARGET).join("release/examples/wasm.wasm"))
}

/// The native compiler's result for a file, in the format of the module.
fn native(path: &Path) -> Value {
    let sources = Sources::read(path, Disk).unwrap();
    let compiled = motionseq::compile(&sources, &Options::default());
    let frames = (!compiled.timelines.is_empty()).then(|| {
        let mut text = Vec::new();
        write_listings(&compiled.timelines, &mut text).unwrap();
        String::from_utf8(text).unwrap()
    });
    json!({ "frames": frames, "findings": findings(&sources, &compiled.diagnostics) })
}

#[test]
fn webassembly_gives_the_same_frames_and_messages() {
    let Some(module) = module() else { return };
    let size = fs::metadata(&module).unwrap().len();
    assert!(size <= LARGEST, "the module has {size} bytes");
    let entries = fs::read_dir("tests/frames").unwrap().map(|entry| entry.unwrap().path());
    let scripts: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "motion")).collect();
    let text = |path: &PathBuf| (path.to_str().unwrap().to_owned(), fs::read_to_string(path).unwrap());
    // Some of them name the file of a board.
    let boards: Vec<PathBuf> =
        fs::read_dir("tests/frames/boards").unwrap().map(|entry| entry.unwrap().path()).collect();
    let files: BTreeMap<String, String> = scripts.iter().chain(&boards).map(text).collect();
    let input = json!({ "files": files, "mains": scripts });
    let mut node = Command::new("node")
        .args(["tests/wasm/compile.mjs", module.to_str().unwrap()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = node.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(&serde_json::to_vec(&input).unwrap()));
    let output = node.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    let outputs: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(outputs.len(), scripts.len());
    assert!(scripts.len() > 250, "{}", scripts.len());
    for (path, output) in scripts.iter().zip(outputs) {
        assert_eq!(output, native(path), "{}", path.display());
    }
}
