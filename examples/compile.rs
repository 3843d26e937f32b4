//! Compiles a script and the file that it uses, both in memory, as an editor or a web page does:
//! `cargo run --example compile`.

use std::error::Error;
use std::io;
use std::path::Path;

use motionseq::program::Options;
use motionseq::source::{Encoding, Lines, Memory, Sources};
use motionseq::timeline::write_listing;

fn main() -> Result<(), Box<dyn Error>> {
    let files = Memory::from([
        ("show.motion", "use \"lib/phrases.motion\"\nat 0.5s nod(200us)\nat 2s rocker x=20 for 1s\n"),
        (
            "lib/phrases.motion",
            "def nod(depth) {\n  servo 2 1500us -> (1500us + depth) over 300ms\n  servo 2 1500us\n}\n",
        ),
    ]);
    let sources = Sources::read(Path::new("show.motion"), files)?;
    let compiled = motionseq::compile(&sources, &Options::default());

    // Lines and columns as editors count them: from 0, in UTF-16 code units.
    let lines = Lines::of(&sources);
    for diagnostic in &compiled.diagnostics {
        let file = sources.file(diagnostic.span).name();
        let from = lines.position(diagnostic.span.start, Encoding::Utf16);
        let to = lines.position(diagnostic.span.end, Encoding::Utf16);
        eprintln!(
            "{file} {}:{} to {}:{}: {}: {}\n  {}",
            from.line, from.column, to.line, to.column, diagnostic.code, diagnostic.message, diagnostic.help
        );
    }

    let timeline = compiled.timeline().ok_or("the script has errors")?;
    write_listing(&timeline, timeline.items(), &mut io::stdout())?;
    Ok(())
}
