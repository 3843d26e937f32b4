//! `decode`: streams of bytes and hex digits as a listing, despite any errors in them; and smaller
//! commands.

use std::io::{self, Read, Write};
use std::process::Stdio;

use crate::support::{Scratch, motionseq, program, rendered, run, stderr, stdout, with_motionseq};
use motionseq::capture::{DecodeError, Decoded, Reading, Timing, TimingError, decode};

fn listing(bytes: &[u8]) -> (String, Decoded) {
    let mut out = Vec::new();
    let decoded = decode(bytes, Reading::default(), &mut out).unwrap();
    (String::from_utf8(out).unwrap(), decoded)
}

#[test]
fn the_bytes_of_a_script_are_its_commands_again() {
    let bytes = rendered("scripts/hello.motion");
    let (text, decoded) = listing(&bytes);
    let rendered = stdout(&run(&["render", "scripts/hello.motion"]));
    let columns = |text: &str| -> Vec<String> {
        text.lines().map(|line| line.split('\t').skip(1).take(2).collect::<Vec<_>>().join("\t")).collect()
    };
    assert_eq!(columns(&text), columns(&rendered));
    assert_eq!((decoded.frames, decoded.bytes, decoded.skipped), (22, 281, 0));
    assert!(text.starts_with("0\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n8\t"));
}

#[test]
fn bytes_outside_of_frames_are_shown_and_skipped() {
    // Noise; a wrong checksum; an unknown frame; one out of range; half a frame.
    let bytes = [
        &[0x00, 0x11][..],
        &[0xFF, 0xFE, 0x04, 0x01, 0x01, 0x07],
        &[0xFF, 0xFE, 0x40, 0x01, 0x01, 0x42],
        &[0xFF, 0xFE, 0x02, 0x03, 0x01, 0x00, 0x01, 0x07],
        &[0xFF, 0xFE, 0x02, 0x03],
    ]
    .concat();
    let (text, decoded) = listing(&bytes);
    let expected = "\
0\t00 11\t\tskipped 2: no frame starts here
2\tFF FE 04 01 01 07\t\tskipped 6: checksum 0x07 instead of 0x06
8\tFF FE 40 01 01 42\traw 0x40 0x01\tunknown: no command has this function and length
14\tFF FE 02 03 01 00 01 07\traw 0x02 0x01 0x00 0x01\tunknown: 1 is out of range (500 to 2500)
22\tFF FE 02 03\t\tskipped 4: the stream ends inside a frame
";
    assert_eq!(text, expected);
    assert_eq!(decoded, Decoded { bytes: 26, frames: 2, unknown: 2, skipped: 12, ..Decoded::default() });
}

#[test]
fn hex_digits_are_read_in_every_layout() {
    let frames = "0\tFF FE 04 01 01 06\tbuzzer on\n6\tFF FE 04 01 00 05\tbuzzer off\n";
    for text in [
        "FF FE 04 01 01 06 FF FE 04 01 00 05",
        "fffe04010106\nfffe04010005\n",
        "\r\n FFF E04 0101\t06 FFFE04010005\r\n",
        "0xFF, 0xFE,0x4,0x1,0x01,0x6 \n \\xff\\xfe\\x04\\x01\\x00\\x05",
        // The output of this command.
        frames,
        "FF FE 4 1 1 6\nFF FE 4 1 0 5\n",
        "00000000: fffe 0401 0106 fffe 0401 0005            ............\n",
        "00000000  ff fe 04 01 01 06 ff fe  04 01 00 05              |............|\n0000000c\n",
    ] {
        assert_eq!(listing(text.as_bytes()).0, frames, "{text:?}");
    }
    let frames = "0.500000\tFF FE 04 01 01 06\tbuzzer on\n0.900000\tFF FE 04 01 00 05\tbuzzer off\n";
    for text in [
        // The output of `render` and `board`, and a snapshot.
        "0.500000\tFF FE 04 01 01 06\n0.900000\tFF FE 04 01 00 05\n",
        "# motionseq frames 1\n0.500000\tFF FE 04 01 01 06\tbuzzer on\n0.900000\tFF FE 04 01 00 05\tbuzzer off\tclosing\n",
        "{\"t_us\":500000,\"frame\":\"FFFE04010106\"}\n{\"t_us\":900000,\"frame\":\"FFFE04010005\",\"line\":3}\n",
        // Logs of candump and similar programs.
        "(0.500000) ttyUSB0 FF FE 04 01 01 06\n(0.9) ttyUSB0 FF FE 04 01 00 05\n",
        " (0.500000)  can0  123   [6]  FF FE 04 01 01 06\n (0.900000)  can0  123   [6]  FF FE 04 01 00 05\n",
        "(0.500000) can0 123#FFFE0401\n(0.600000) can0 123#0106\n(0.9) can0 00000123##1FFFE04010005\n",
    ] {
        let (found, decoded) = listing(text.as_bytes());
        assert_eq!((found.as_str(), decoded.is_timed), (frames, true), "{text:?}");
    }
    // Times since 1970 count from the first one.
    let log = "(1436509052.249713) can0 123#FFFE04010106\n(1436509052.749713) can0 123#FFFE04010005\n";
    assert_eq!(listing(log.as_bytes()).0, frames.replace("0.5", "0.0").replace("0.9", "0.5"));
    // A run of noise that a listing shortens is read as a line of a listing.
    let noise = "0.500000\t00 11 …\t\tskipped 20: no frame starts here\n0.600000\tFF FE 04 01 01 06\tbuzzer on\n";
    assert_eq!(
        listing(noise.as_bytes()).1,
        Decoded { bytes: 8, frames: 1, skipped: 2, is_timed: true, ..Decoded::default() }
    );
    assert!(listing(b"FF FE 04 01 01 06F").1.half_byte);
    // Repeated rows are dumped once.
    let row = "ff fe 04 01 01 06 ff fe  04 01 01 06 00 00 00 00";
    let dump = format!("00000000  {row}  |................|\n*\n00000030\n");
    assert_eq!(listing(dump.as_bytes()).1, Decoded { bytes: 48, frames: 6, skipped: 12, ..Decoded::default() });
    assert_eq!(listing(b"FF FE 04 zz 01 01 06").1.not_hex, 2);
    assert_eq!(listing(b""), (String::new(), Decoded::default()));
}

/// A reader that returns the bytes in pieces of one size.
struct Pieces<'b>(&'b [u8], usize);

impl Read for Pieces<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.1.min(self.0.len()).min(buffer.len());
        buffer[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        Ok(count)
    }
}

#[test]
fn a_file_of_times_says_when_bytes_came() {
    let times = |text: &str, length| Timing::read(text, length);
    let bytes = [0xFF, 0xFE, 4, 1, 1, 6, 0xFF, 0xFE, 4, 1, 0, 5];
    let shown = |timing: Timing, bytes: &[u8]| {
        let mut out = Vec::new();
        decode(bytes, Reading::default().with_timing(Some(timing)), &mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        text.lines().map(|line| line.split('\t').next().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(shown(times("0.5 6\n0.25 6\n", None).unwrap(), &bytes), ["0.500000", "0.750000"]);
    // A frame of two reads starts with the first; bytes after the last line belong to it.
    assert_eq!(shown(times("0.5 2\n0.25 6\n", None).unwrap(), &bytes), ["0.500000", "0.750000"]);
    assert_eq!(shown(times("", None).unwrap(), &bytes), ["0.000000", "0.000000"]);
    // The header line of `script` does not count.
    let with_head = [b"Script started on 2026-11-24 12:00:00+00:00 [COMMAND=\"cat\"]\n", &bytes[..]].concat();
    assert_eq!(shown(times("0.5 6\n0.25 6\n", None).unwrap(), &with_head), ["0.500000", "0.750000"]);
    // A file with both directions: the one whose counts add up to the size of the capture.
    let both = "H 0.0 START_TIME 2026\nO 0.5 6\nI 0.1 3\nO 0.4 6\nS 0.5 SIGWINCH\n";
    assert_eq!(shown(times(both, Some(12)).unwrap(), &bytes), ["0.500000", "1.000000"]);
    assert_eq!(times("0.5 6\nsoon 6\n", None), Err(TimingError(2)));
    assert_eq!(times("0.5\n", None), Err(TimingError(1)));
}

#[test]
fn the_result_does_not_depend_on_reads() {
    let mut bytes = rendered("scripts/hello.motion");
    let noise = (0..3_000u32).map(|n| u8::try_from(n.wrapping_mul(2_654_435_761) >> 24).unwrap());
    bytes.extend(noise);
    bytes.extend(rendered("scripts/wheels.motion"));
    let whole = listing(&bytes);
    for size in [1, 2, 3, 7, 13, 4_096] {
        let mut out = Vec::new();
        let decoded = decode(Pieces(&bytes, size), Reading::default(), &mut out).unwrap();
        assert!((String::from_utf8(out).unwrap(), decoded) == whole, "in pieces of {size}");
    }
}

#[test]
fn text_is_recognized_after_a_short_first_read() {
    let texts = [
        "0.500000\tFF FE 04 01 01 06\n0.900000\tFF FE 04 01 00 05\n",
        "# motionseq frames 2\n# x\n0.500000\tFF FE 04 01 01 06\tbuzzer on\n# end\t0.500000\tframes\t1\tbaud\t9600\n",
        "{\"t_us\":500000,\"frame\":\"FFFE04010106\"}\n",
        " (0.500000) can0 123#FFFE04010106\n",
        "00000000: fffe 0401 0106 fffe 0401 0005            ............\n",
        "0xFF 0xFE 4 1 1 6",
        "\n\n",
    ];
    for text in texts {
        let whole = listing(text.as_bytes());
        for size in 1..text.len() {
            let mut out = Vec::new();
            let decoded = decode(Pieces(text.as_bytes(), size), Reading::default(), &mut out).unwrap();
            assert_eq!((String::from_utf8(out).unwrap(), decoded), whole, "{text:?} in pieces of {size}");
        }
    }
    let capture = b"Script started on 2026-11-24 12:00:00+00:00\n\xFF\xFE\x04\x01\x01\x06";
    for size in 1..capture.len() {
        let mut out = Vec::new();
        let reading = Reading::default().with_timing(Some(Timing::read("0.5 6\n", None).unwrap()));
        decode(Pieces(capture, size), reading, &mut out).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "0.500000\tFF FE 04 01 01 06\tbuzzer on\n", "in pieces of {size}");
    }
}

#[test]
fn a_listing_that_cannot_be_written_ends_at_once() {
    struct Full;
    impl Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    // A stream without end.
    struct Endless([u8; 6], usize);
    impl Read for Endless {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            for byte in buffer.iter_mut() {
                *byte = self.0[self.1 % 6];
                self.1 += 1;
            }
            Ok(buffer.len())
        }
    }
    let frames = [0xFF, 0xFE, 0x04, 0x01, 0x01, 0x06];
    assert!(matches!(decode(Endless(frames, 0), Reading::default(), &mut Full), Err(DecodeError::Write(_))));
}

#[test]
fn the_command_reads_files_and_standard_input() {
    let mut child = motionseq(&["decode", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(&rendered("scripts/hello.motion")[..10]).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(
        stdout(&output),
        "0\tFF FE 02 03 01 05 DC E7\tservo 1 1500\n8\tFF FE\t\tskipped 2: the stream ends inside a frame\n"
    );
    assert_eq!(stderr(&output), "1 frame in 10 bytes, 2 bytes skipped\n");
    let output = run(&["decode", "/no/such/file"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("cannot read /no/such/file"));
    assert_eq!(run(&["decode", "scripts"]).status.code(), Some(1));
}

/// As version 1.7.4 prints it between a program and a board, with `-x`, with `-x -v`, and with `-d -d -x`.
#[test]
fn socat_shows_both_directions_and_the_frames_are_in_one() {
    let plain = "> 2026/11/28 21:02:56.000932972  length=6 from=0 to=5\n ff fe 04 01 01 06\n\
        < 2026/11/28 21:02:57.000083131  length=14 from=0 to=13\n 7b 41 30 3a 30 3a 30 3a 31 32 30 30 7d 23\n\
        > 2026/11/28 21:02:57.000236859  length=6 from=6 to=11\n ff fe 04 01 00 05\n";
    let with_text = "> 2026/11/28 21:02:56.000932972  length=6 from=0 to=5\n ff fe 04 01 01 06                                ......\n--\n\
        < 2026/11/28 21:02:57.000083131  length=14 from=0 to=13\n 7b 41 30 3a 30 3a 30 3a 31 32 30 30 7d 23        {A0:0:0:1200}#\n--\n\
        > 2026/11/28 21:02:57.000236859  length=6 from=6 to=11\n ff fe 04 01 00                                   .....\n 05                                               .\n--\n";
    let with_messages = format!(
        "2026/11/28 21:02:59 socat[4642] N PTY is /dev/pts/7\n{plain}2026/11/28 21:03:01 socat[4642] N exit(143)\n"
    );
    // Between a board and a program, the directions are the other way round; other versions write six digits.
    let turned = plain
        .replace('>', "=")
        .replace('<', ">")
        .replace('=', "<")
        .replace("length<", "length=")
        .replace("from<", "from=")
        .replace("to<", "to=");
    let frames = "0.000000\tFF FE 04 01 01 06\tbuzzer on\n0.303887\tFF FE 04 01 00 05\tbuzzer off\n";
    for text in
        [plain, with_text, &with_messages, &turned, &plain.replace(":56.000", ":56.").replace(":57.000", ":57.")]
    {
        let (found, decoded) = listing(text.as_bytes());
        assert_eq!(found, frames, "{text}");
        assert_eq!(decoded, Decoded { bytes: 12, frames: 2, is_timed: true, other_way: 14, ..Decoded::default() });
    }
}

/// As version 2.5 logs and prints it; version 3 also writes a time before each block of bytes that it shows as hex.
#[test]
fn tio_writes_times_between_bytes_and_before_lines() {
    let bytes = [&[0xFF, 0xFE, 2, 3, 1, 0x0A][..], &[0, 0x10], &[0xFF, 0xFE, 4, 1, 0, 5]];
    let shown =
        "0.000000\tFF FE 02 03 01 0A 00 10\traw 0x02 0x01 0x0A 0x00\tunknown: 2560 is out of range (500 to 2500)\n";
    let log = |first: &str, second: &str| [first.as_bytes(), bytes[0], second.as_bytes(), bytes[1], bytes[2]].concat();
    for (first, second) in [
        ("[21:03:47.328] ", "[21:03:47.479] "),
        ("[2026-11-28T21:03:47.328] ", "[2026-11-28T21:03:47.479] "),
        ("[00:00:00.000] ", "[00:00:00.151] "),
        ("[1795899827.328] ", "[1795899827.479] "),
    ] {
        let text = log(first, second);
        let expected = format!("{shown}0.151000\tFF FE 04 01 00 05\tbuzzer off\n");
        for size in [1, 2, 5, 13, 100] {
            let mut out = Vec::new();
            decode(Pieces(&text, size), Reading::default(), &mut out).unwrap();
            assert_eq!(String::from_utf8(out).unwrap(), expected, "{first} in pieces of {size}");
        }
    }
    // With the output as hex, a line end before each time is not one of the bytes, but this one is.
    let text = [b"\r\n[21:03:47.328] ", bytes[0], b"\r\n[21:03:47.479] ", bytes[1], bytes[2]].concat();
    for size in [1, 2, 3, 100] {
        let mut out = Vec::new();
        decode(Pieces(&text, size), Reading::default(), &mut out).unwrap();
        assert!(String::from_utf8(out).unwrap().starts_with(shown), "in pieces of {size}");
    }
    let hex = "\r\u{1b}[1m[21:04:08.909] tio v2.5\u{1b}[0m\r\n\r\u{1b}[1m[21:04:08.920] Connected\u{1b}[0m\r\nff fe 04 01 01 06 ff fe 04 01 00 05 \n\r\u{1b}[1m[21:04:09.971] Disconnected\u{1b}[0m\r\n";
    assert_eq!(listing(hex.as_bytes()).0, "0\tFF FE 04 01 01 06\tbuzzer on\n6\tFF FE 04 01 00 05\tbuzzer off\n");
    let lines = "[23:59:59.900] ff fe 04 01 01 06 \r\n[00:00:00.100] ff fe 04 01 00 05 \r\n";
    assert_eq!(
        listing(lines.as_bytes()).0,
        "0.000000\tFF FE 04 01 01 06\tbuzzer on\n0.200000\tFF FE 04 01 00 05\tbuzzer off\n"
    );
}

#[test]
fn an_input_without_a_frame_is_an_error() {
    let folder = Scratch::new("no-frame");
    for (name, bytes) in [("empty", &b""[..]), ("noise", b"\x00\x01\xFF"), ("text.txt", b"hello\n")] {
        std::fs::write(folder.0.join(name), bytes).unwrap();
        let output = with_motionseq(program(), &folder.0).args(["decode", name]).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{name}: {}", stderr(&output));
        assert!(stderr(&output).ends_with("error: the input contains no frame\n"), "{name}: {}", stderr(&output));
    }
    // The script is still written: its comments show the bytes.
    let output = with_motionseq(program(), &folder.0).args(["decode", "noise", "-o", "noise.motion"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(std::fs::read_to_string(folder.0.join("noise.motion")).unwrap().contains("skipped 3"));
}

#[test]
fn a_gate_in_a_listing_is_no_noise() {
    let scratch = Scratch::new("decode-gates");
    let decoded = ["listing", "jsonl", "hex"].map(|format| {
        let rendered = run(&["render", "scripts/cues.motion", "--format", format]).stdout;
        let output = run(&["decode", &scratch.file(format, &rendered)]);
        (stdout(&output), stderr(&output))
    });
    assert!(decoded[0].1.starts_with("343 frames in 2955 bytes\n"), "{}", decoded[0].1);
    assert!(decoded.iter().all(|other| *other == decoded[0]), "{:?}", decoded.map(|(_, said)| said));
}

#[test]
fn jsonl_names_the_line_of_every_frame() {
    let text = stdout(&run(&["render", "scripts/greeting.motion", "--format", "jsonl"]));
    let listing = stdout(&run(&["render", "scripts/greeting.motion"]));
    assert_eq!(text.lines().count(), listing.lines().count());
    for (object, line) in text.lines().zip(listing.lines()) {
        let object: serde_json::Value = serde_json::from_str(object).unwrap();
        let columns: Vec<&str> = line.split('\t').collect();
        let micros: u64 = columns[0].replace('.', "").parse().unwrap();
        assert_eq!(object["t_us"], micros);
        assert_eq!(object["frame"], columns[1].replace(' ', ""));
        assert_eq!(object["command"], columns[2]);
        assert_eq!(object["kind"], columns.get(3).copied().unwrap_or("command"));
        assert_eq!(object["robot"], serde_json::Value::Null);
        let file = std::fs::read_to_string(object["file"].as_str().unwrap()).unwrap();
        let at = usize::try_from(object["line"].as_u64().unwrap()).unwrap();
        // The line contains a command, in the script or in the file that it uses.
        assert!(!file.lines().nth(at - 1).unwrap().trim_start().starts_with('#'), "{object}");
    }
    assert!(text.contains("scripts/lib/phrases.motion"));
}

#[test]
fn completions_and_man_pages_list_every_command_but_the_hidden_one() {
    for shell in ["bash", "zsh", "fish"] {
        let text = stdout(&run(&["completions", shell]));
        assert!(text.contains("render") && text.contains("max-late") && !text.contains("guard-a-player"), "{shell}");
    }
    assert_eq!(run(&["completions", "tcsh"]).status.code(), Some(2));
    let page = stdout(&run(&["man"]));
    assert!(page.contains(".TH motionseq 1 \"\" ") && !page.contains("guard-a-player"));
    assert!(stdout(&run(&["man", "play"])).contains("motionseq\\-play"));
    let output = run(&["man", "guard-a-player"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("unknown command `guard-a-player`; the commands are check, render, play"));
    // A closed pipe must not cause a panic.
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = motionseq(&["completions", "bash"]).stdout(full).stderr(Stdio::piped()).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn ports_lists_what_is_there() {
    let output = run(&["ports"]);
    assert_eq!(output.status.code(), Some(0));
    for line in stdout(&output).lines() {
        assert!(line.split('\t').count() >= 2 && std::fs::exists(line.split('\t').next().unwrap()).unwrap(), "{line}");
    }
    let json: serde_json::Value = serde_json::from_str(&stdout(&run(&["ports", "--format", "json"]))).unwrap();
    let ports = json["ports"].as_array().unwrap();
    assert_eq!((json["version"].as_u64(), ports.len()), (Some(1), stdout(&output).lines().count()));
    for (port, line) in ports.iter().zip(stdout(&output).lines()) {
        assert!(line.starts_with(port["path"].as_str().unwrap()), "{port}");
        assert!(port["obstacle"].is_null() || line.contains(port["obstacle"]["why"].as_str().unwrap()), "{port}");
    }
}

#[test]
fn a_move_of_an_older_driver_is_reported_and_read_on_request() {
    // Bits 0, 1 and 2 are set if x, y and z are not negative: 10 0 0; 300 1000 0; -5 5 -45; and 0 0
    // 0 with an extra bit.
    let frames = [
        "FF FE 03 08 04 00 0A 00 00 00 00 07 20",
        "FF FE 03 08 04 01 2C 03 E8 00 00 07 2E",
        "FF FE 03 08 04 00 05 00 05 00 2D 02 48",
        "FF FE 03 08 04 00 00 00 00 00 00 0F 1E",
    ];
    let path = std::env::temp_dir().join(format!("motionseq-older-{}.txt", std::process::id()));
    std::fs::write(&path, frames.join("\n")).unwrap();
    let path = path.to_str().unwrap();
    let output = run(&["decode", path]);
    let commands =
        |text: &str| text.lines().map(|line| line.split('\t').nth(2).unwrap().to_owned()).collect::<Vec<_>>();
    let listing = stdout(&output);
    assert!(
        listing.lines().next().unwrap().contains("a `move` with the direction bits of older driver versions"),
        "{listing}"
    );
    // These are valid in both versions, and are read as the newest writes them: mirrored.
    assert_eq!(commands(&listing)[1..3], ["move x=-300 y=-1000 z=0", "move x=5 y=-5 z=-45"]);
    assert_eq!(stderr(&output).matches("cannot always be distinguished").count(), 1, "{}", stderr(&output));
    let output = run(&["decode", path, "--older-move"]);
    let listing = stdout(&output);
    assert_eq!(commands(&listing)[..3], ["move x=10 y=0 z=0", "move x=300 y=1000 z=0", "move x=-5 y=5 z=-45"]);
    assert!(listing.lines().nth(3).unwrap().contains("unknown"), "{listing}");
    // A script sends what was intended, with the direction bits of the newest driver.
    let script = format!("{path}.motion");
    let output = run(&["decode", path, "--older-move", "-o", &script]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = std::fs::read_to_string(&script).unwrap();
    assert!(text.contains("move x=300 y=1000 z=0"), "{text}");
    let _ = (std::fs::remove_file(path), std::fs::remove_file(&script));
}
