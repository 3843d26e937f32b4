//! Text boards: the page that describes them, their stop, and streams that are cut anywhere. What their files and
//! their commands mean is pinned in `frames`.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read as _;
use std::process::Stdio;
use std::sync::Arc;

use motionseq::board::{Board, Decoder, Item};
use motionseq::diagnostic::Diagnostics;
use motionseq::program::{Options, text_board};
use motionseq::source::{Disk, Source, Sources};
use proptest::prelude::*;
use rustix::process::{Pid, Signal, kill_process};

use crate::support::far::FarEnd;
use crate::support::{Scratch, code, motionseq, stderr, stdout};

const ROBOT: &str = include_str!("frames/boards/robot.toml");

/// The board of a file, which must be right.
fn board(text: &str) -> Arc<Board> {
    let mut diagnostics = Diagnostics::default();
    let board = text_board(&Source::new("robot.toml", text), "robot.toml", &mut diagnostics);
    board.unwrap_or_else(|| panic!("{diagnostics:?}"))
}

#[test]
fn a_reader_of_the_page_has_a_board_that_plays() {
    let page = fs::read_to_string("docs/boards.md").unwrap();
    let block = |start: &str| page.split(start).nth(1).unwrap().split("```").next().unwrap().to_owned();
    let toml = block("```toml\n");
    let shipped = fs::read_to_string("scripts/boards/arduino.toml").unwrap();
    let lines = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).map(str::to_owned).collect()
    };
    assert_eq!(lines(&toml), lines(&shipped));
    let folder = Scratch::new("boards-page");
    folder.file("arduino.toml", toml.as_bytes());
    folder
        .file("first.motion", format!("board \"arduino.toml\"{}", block("```text\nboard \"arduino.toml\"")).as_bytes());
    let checked = folder.run(&["check", "first.motion"]);
    assert!(code(&checked) == 0 && !stderr(&checked).contains("warning"), "{}", stderr(&checked));
    // `S 1 1500` and a line feed, as the sketch reads it.
    assert!(stdout(&folder.run(&["render", "first.motion"])).contains("\t53 20 31 20 31 35 30 30 0A\tservo 1 1500\n"));
    let played = folder.run(&["test", "--bless", "--play", "first.motion"]);
    assert_eq!(code(&played), 0, "{}", stdout(&played));
}

/// The keys in the tables of the page, and those that the program names when it meets another.
#[test]
fn the_page_has_every_key() {
    let page = fs::read_to_string("docs/boards.md").unwrap();
    let file = "name = \"R\"\nbaud = 9600\nx = 1\n[verb.a]\nx = 1\naxes = [{ x = 1 }]\nsend = 'a\\n'\n";
    let mut diagnostics = Diagnostics::default();
    assert!(text_board(&Source::new("robot.toml", file), "robot.toml", &mut diagnostics).is_none());
    let helps = diagnostics.iter().filter(|diagnostic| diagnostic.message == "unknown key `x`");
    let named: BTreeSet<String> = helps
        .flat_map(|diagnostic| diagnostic.help.split_once(" are ").unwrap().1.split(", "))
        .map(|key| if key == "verb" { "[verb.WORD]".to_owned() } else { key.to_owned() })
        .collect();
    let from = page.find("## The file of a text board").unwrap();
    let tables = &page[from..page.find("### Templates").unwrap()];
    let rows = tables.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    assert_eq!(named, rows.map(str::to_owned).collect());
}

/// A run that is ended in the middle of a hold, by Ctrl-C, by `kill -9`, or by a hang. Worked out from the file: the rests
/// from the last resource to the first, and the `stop` line, three times. `on abort` follows, except from the guard.
#[test]
fn every_end_sends_every_rest_and_then_the_stop_lines_three_times() {
    let folder = Scratch::new("boards-stop");
    folder.file("robot.toml", ROBOT.as_bytes());
    let script = "board \"robot.toml\"\nservo 3 1500\ndrive 100 100 for 50s\non abort { servo 3 1000 }\n";
    let path = folder.file("a.motion", script.as_bytes());
    for (signal, on_abort) in [(Signal::INT, "#3P1000\r"), (Signal::KILL, ""), (Signal::STOP, "")] {
        let far = FarEnd::new();
        let mut child = motionseq(&["play", &path, "--port", &far.path]).stderr(Stdio::piped()).spawn().unwrap();
        let mut got = far.first();
        while !got.ends_with(b"M 100 100\n") {
            got.extend(far.first());
        }
        kill_process(Pid::from_child(&child), signal).unwrap();
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert!(!child.wait().unwrap().success());
        assert!(said.ends_with("; stop: sent\n"), "{said}");
        got.extend(far.rest().into_iter().flat_map(|(_, bytes)| bytes));
        let once = "G2 0\nG1 0\nM 0 0\nX\n";
        let sent = String::from_utf8(got).unwrap();
        assert!(sent.starts_with("V\nE1\n#3P1500\rM 100 100\n"), "{sent}");
        assert!(sent.ends_with(&format!("M 100 100\n{once}{once}{once}{on_abort}")), "{signal:?}: {sent}");
    }
}

#[test]
fn a_run_that_ends_by_itself_says_goodbye_and_one_that_is_ended_does_not() {
    let folder = Scratch::new("boards-goodbye");
    folder.file("robot.toml", ROBOT.as_bytes());
    folder.file("a.motion", b"board \"robot.toml\"\nservo 1 1500\nwait 100ms\n");
    folder.file("b.motion", b"board \"robot.toml\"\nservo 1 1500\ndrive 9 9 for 9s\n");
    assert_eq!(code(&folder.run(&["play", "a.motion", "--record", "a.bin", "--max-late", "5s"])), 0);
    let sent = |name: &str| String::from_utf8(fs::read(folder.0.join(name)).unwrap()).unwrap();
    assert_eq!(sent("a.bin"), "V\nE1\n#1P1500\rE0\n");
    let ended = folder.run(&["play", "b.motion", "--record", "b.bin", "--fault", "stall@300ms", "--max-late", "60ms"]);
    assert_ne!(code(&ended), 0);
    let sent = sent("b.bin");
    assert!(sent.starts_with("V\nE1\n#1P1500\rM 9 9\nM 9 9\n") && !sent.contains("E0\n"), "{sent}");
    // In passes, only the first begins with a hello, and only the last ends with a goodbye.
    assert_eq!(code(&folder.run(&["play", "a.motion", "--record", "c.bin", "--loop", "3", "--max-late", "5s"])), 0);
    assert_eq!(
        String::from_utf8(fs::read(folder.0.join("c.bin")).unwrap()).unwrap(),
        "V\nE1\n#1P1500\r#1P1500\r#1P1500\rE0\n"
    );
}

#[test]
fn a_file_outside_of_the_folder_of_the_script_is_refused() {
    let folder = Scratch::new("boards-outside");
    folder.file("robot.toml", ROBOT.as_bytes());
    fs::create_dir_all(folder.0.join("inner")).unwrap();
    folder.file("inner/a.motion", b"board \"../robot.toml\"\nservo 1 1500\n");
    let checked = folder.run(&["check", "inner/a.motion"]);
    let said = stderr(&checked).replace("\n  │ ", " ");
    assert!(code(&checked) == 1 && said.contains("board-file") && said.contains("outside of"), "{said}");
}

#[test]
fn a_file_of_more_than_a_mebibyte_is_refused() {
    let text = format!("{ROBOT}\n# {}\n", "x".repeat(1 << 20));
    let mut diagnostics = Diagnostics::default();
    assert!(text_board(&Source::new("robot.toml", text), "robot.toml", &mut diagnostics).is_none());
    assert_eq!(diagnostics.iter().next().unwrap().message, "the file of a board is at most 1 MiB");
}

/// A small file must not take long: the comparison of strings is bounded.
#[test]
fn files_that_are_hard_to_compare_are_read_or_refused_at_once() {
    let read = |verbs: &str| {
        let text = format!("name = \"Hard\"\nbaud = 9600\n{verbs}");
        let mut diagnostics = Diagnostics::default();
        let board = text_board(&Source::new("robot.toml", text), "robot.toml", &mut diagnostics);
        (board.is_some(), diagnostics.iter().next().map(|first| first.message.clone()).unwrap_or_default())
    };
    let words = "[verb.a]\naxes = [{ name = \"state\", words = { off = 0, on = 1000000000 } }]\nsend = 'A{state}\\n'\n";
    assert_eq!(read(words), (true, String::new()));
    let padded = "[verb.a]\naxes = [{ name = \"x\", range = \"0..3\" }]\nsend = 'A{x:012}\\n'\n";
    assert_eq!(read(padded), (true, String::new()));
    let axes: String = (0..16).map(|at| format!("{{ name = \"x{at}\", range = \"-999999..999999\" }}, ")).collect();
    let places: String = (0..16).map(|at| format!("{{x{at}}} ")).collect();
    let long: String =
        (0..100).map(|at| format!("[verb.v{at}]\naxes = [{axes}]\nsend = '{places}{at}\\n'\n")).collect();
    let _ = read(&long);
    let many: String = (0..5)
        .map(|at| format!("[verb.v{at}]\naxes = [{{ name = \"n\", range = \"0..255\", index = true }}]\nholds = true\nrest = 'R{at} {{n}}\\n'\nsend = 'V{at} {{n}}\\n'\n"))
        .collect();
    assert_eq!(read(&many).1, "all indices together have more than 1024 values");
    let stop = format!(
        "[verb.a]\naxes = [{{ name = \"n\", range = \"0..255\", index = true }}]\nholds = true\nrest = 'R{{n}}{}\\n'\nsend = 'V{{n}}\\n'\n",
        "x".repeat(200)
    );
    assert_eq!(read(&stop).1, "all rests and the `stop` lines together are longer than 8192 bytes");
}

/// If no command of the verb sends the rest, it is a command of its own, for each index.
#[test]
fn a_rest_that_is_no_command_of_its_verb_is_a_command_itself() {
    let text = "name = \"R\"\nbaud = 9600\n[verb.servo]\naxes = [{ name = \"n\", range = \"1..2\", index = true }, { name = \"us\", range = \"500..2500\" }]\nholds = true\nrest = '#{n}L\\n'\nsend = '#{n}P{us}\\n'\n";
    let options = Options::default().with_board(board(text));
    let compiled = motionseq::compile(
        &Source::new("test", "servo 2 900 for 1s\nservo 1 900\nwait 1s\nstop_servo 1\n").into(),
        &options,
    );
    let timeline = compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{:?}", compiled.diagnostics));
    let sent: Vec<u8> = timeline.events.iter().flat_map(|event| timeline.board.to_frame(&event.command)).collect();
    assert_eq!(String::from_utf8(sent).unwrap(), "#2P900\n#2L\n#1P900\n#1L\n");
}

/// What motionseq itself sends becomes a script again: the hello and the goodbye come from the file.
#[test]
fn a_recording_of_a_run_compiles_and_sends_the_same() {
    let folder = Scratch::new("boards-again");
    folder.file("robot.toml", ROBOT.as_bytes());
    folder.file(
        "a.motion",
        b"board \"robot.toml\"\nservo 1 1500\nled 2 blink\nwait 50ms\ndrive 9 9 for 250ms\ngripper 1 5 for 100ms\n",
    );
    let listing = stdout(&folder.run(&["render", "a.motion"]));
    folder.file("a.txt", listing.as_bytes());
    for exact in [&[][..], &["--exact"]] {
        let args = [&["decode", "a.txt", "--family", "robot.toml", "-o", "b.motion"][..], exact].concat();
        assert_eq!(code(&folder.run(&args)), 0);
        let checked = folder.run(&["check", "b.motion"]);
        assert_eq!(code(&checked), 0, "{}", stderr(&checked));
        let bytes = |name: &str| folder.run(&["render", name, "--format", "bin"]).stdout;
        assert_eq!(bytes("a.motion"), bytes("b.motion"), "{exact:?}");
        fs::remove_file(folder.0.join("b.motion")).unwrap();
    }
}

/// Every command of the scripts above, with every value at the ends of its range.
fn corners(board: &Board) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    for (id, verb) in board.verbs() {
        let ends = verb.axes.iter().map(|axis| [axis.range.0, axis.range.1]);
        let mut all: Vec<Vec<i32>> = vec![Vec::new()];
        for ends in ends {
            all = all.iter().flat_map(|before| ends.map(|end| [&before[..], &[end]].concat())).collect();
        }
        for values in all {
            let command = board.command(id, &values).unwrap();
            let frame = board.to_frame(&command);
            let read = board.decode(&frame).unwrap_or_else(|error| panic!("{}: {error}", board.show(&command)));
            assert_eq!(board.show(&read).to_string(), board.show(&command).to_string());
            frames.push(frame);
        }
    }
    frames
}

#[test]
fn every_shipped_board_reads_what_it_writes() {
    let mut seen = 0;
    for entry in fs::read_dir("scripts/boards").unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            seen += 1;
            assert!(corners(&board(&fs::read_to_string(&path).unwrap())).len() > 4, "{}", path.display());
        }
    }
    assert_eq!(seen, 3);
}

proptest! {
    #[test]
    fn frames_are_found_however_the_stream_is_cut(cuts in prop::collection::vec(1usize..9, 1..60), noise in "[ -~]{0,12}") {
        let board = board(ROBOT);
        let all = corners(&board);
        // A newline ends whatever the noise has begun.
        let stream = [noise.as_bytes(), b"\n", &all.concat()].concat();
        let mut decoder = Decoder::new(&board);
        let mut found = Vec::new();
        let mut rest = stream.as_slice();
        for cut in cuts.iter().cycle() {
            let (chunk, after) = rest.split_at((*cut).min(rest.len()));
            decoder.feed(chunk, |item| if let Item::Frame(frame) = item { found.push(frame.bytes().to_vec()) });
            rest = after;
            if rest.is_empty() { break }
        }
        prop_assert!(found.ends_with(&all), "{found:?}");
    }
}

#[test]
fn the_same_phrases_play_on_three_families() {
    let main = |name: &str| format!("scripts/boards/on-{name}.motion");
    let of = |name: &str| {
        let compiled = motionseq::compile(&Sources::read(main(name).as_ref(), Disk).unwrap(), &Options::default());
        let timeline =
            compiled.timelines.into_iter().next().unwrap_or_else(|| panic!("{name}: {:?}", compiled.diagnostics));
        let servo = |event: &motionseq::timeline::Event| {
            let shown = timeline.board.show(&event.command).to_string();
            let value = shown.strip_prefix("servo ")?.split(' ').nth(1)?.parse::<f64>().ok()?;
            Some(value)
        };
        timeline.events.iter().filter_map(servo).map(f64::round).collect::<Vec<f64>>()
    };
    let (raspblock, maestro, arduino) = (of("raspblock"), of("maestro"), of("arduino"));
    assert!(raspblock.len() > 100);
    // A Raspblock sets both servos with one frame first.
    assert_eq!(raspblock, arduino[2..]);
    // The Maestro takes quarters, so its moves have more steps that differ.
    assert_eq!(maestro.iter().copied().fold(0.0, f64::max), raspblock.iter().copied().fold(0.0, f64::max));
    for name in ["raspblock", "maestro", "arduino"] {
        let text = fs::read_to_string(main(name)).unwrap();
        assert!(text.contains("use \"phrases.motion\"") && text.lines().count() < 20, "{name}");
    }
}
