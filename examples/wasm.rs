//! The compiler as a WebAssembly module, for web pages and Node. Its input is JSON with scripts,
//! its output JSON with frames and messages:
//!
//! ```text
//! {"main": "show.motion", "files": {"show.motion": "use \"bow.motion\"\n…", "bow.motion": "…"}}
//! {"frames": "0.500000\tFF FE …\tservo 1 1500\n…", "findings": [{"file": "show.motion", "line": 1, …}]}
//! ```
//!
//! `frames` is `null` if the script has errors. Build it with `cargo build --release --example wasm
//! --target wasm32-unknown-unknown --no-default-features`; `tests/wasm/compile.mjs` shows how to
//! call it from JavaScript. `.cargo/config.toml` has it optimised for size: 0.8 MB.
#![expect(unsafe_code, reason = "memory is shared with the caller, who is not Rust")]

use std::collections::BTreeMap;
use std::path::Path;

use motionseq::diagnostic::{Diagnostic, Diagnostics};
use motionseq::program::Options;
use motionseq::report::{Finding, findings};
use motionseq::source::{Memory, Sources};
use motionseq::timeline::write_listings;
use serde::{Deserialize, Serialize};

#[derive(Deserialize)]
struct Input {
    main: String,
    files: BTreeMap<String, String>,
}

#[derive(Serialize)]
struct Output {
    frames: Option<String>,
    findings: Vec<Finding>,
}

/// Compiles a script and the files that it uses.
fn compile_json(input: &[u8]) -> String {
    let Input { main, files } = match serde_json::from_slice(input) {
        Ok(input) => input,
        Err(error) => return serde_json::json!({ "error": error.to_string() }).to_string(),
    };
    let output = match Sources::read(Path::new(&main), Memory::from_iter(files)) {
        Ok(sources) => {
            let compiled = motionseq::compile(&sources, &Options::default());
            let frames = (!compiled.timelines.is_empty()).then(|| {
                let mut text = Vec::new();
                // Writing to a vector cannot fail.
                let _ = write_listings(&compiled.timelines, &mut text);
                String::from_utf8_lossy(&text).into_owned()
            });
            Output { frames, findings: findings(&sources, &compiled.diagnostics) }
        }
        Err(error) => {
            let words = error.to_string();
            let findings = Diagnostic::of_source(error).map(|(source, diagnostic)| {
                let mut diagnostics = Diagnostics::default();
                diagnostics.push(diagnostic);
                findings(&source.into(), &diagnostics)
            });
            Output { frames: None, findings: findings.unwrap_or_else(|| vec![Finding::unreadable(&main, words)]) }
        }
    };
    serde_json::to_string(&output).unwrap_or_default()
}

/// Allocates `length` bytes, which the caller fills and passes to [`compile`] or [`release`].
#[unsafe(no_mangle)]
pub extern "C" fn allocate(length: usize) -> *mut u8 {
    Box::into_raw(vec![0_u8; length].into_boxed_slice()).cast()
}

/// Frees memory.
///
/// # Safety
/// `at` is from [`allocate`] or [`compile`], with its original length, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn release(at: *mut u8, length: usize) {
    // SAFETY: as above.
    drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(at, length)) });
}

/// Compiles the JSON in memory from [`allocate`], and frees that memory. Returns the address of the
/// result: its length as four bytes in little-endian order, then that many bytes of JSON. The
/// caller frees all of it with [`release`].
///
/// # Safety
/// As for [`release`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn compile(at: *mut u8, length: usize) -> *mut u8 {
    // SAFETY: as above.
    let input = unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(at, length)) };
    let json = compile_json(&input);
    let length = u32::try_from(json.len()).unwrap_or(0);
    let mut output = length.to_le_bytes().to_vec();
    output.extend(json.into_bytes());
    Box::into_raw(output.into_boxed_slice()).cast()
}
