//! `board` as other programs see it: a port at a path.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::symlink;
use std::process::Command;

use crate::support::host::{Host, frames, has, link, request, rocker, stop};
use crate::support::{run, stderr};
use rustix::process::Signal;

#[test]
fn an_owners_program_is_shown_frame_by_frame_and_may_come_again() {
    if !has("serial") {
        return;
    }
    let mut host = Host::start("owner", &[]);
    let mut sent = Vec::new();
    for _ in 0..2 {
        let client = Command::new("python3").arg("tests/clients/owner.py").arg(&host.path).output().unwrap();
        assert!(client.status.success(), "{}", String::from_utf8_lossy(&client.stderr));
        sent.extend(String::from_utf8(client.stdout).unwrap().lines().map(str::to_owned));
        host.says("the port is closed");
    }
    let (listing, said) = host.end();
    assert_eq!(frames(&listing), sent);
    assert_eq!(listing.matches("\twheels 8 -8 8 -8\n").count(), 2_000);
    assert!(said.contains("the drive is stopped") && !said.contains("ignored"), "{said}");
}

#[test]
fn invalid_bytes_are_reported() {
    let mut host = Host::start("wrong", &[]);
    let mut port = host.open();
    let noise: &[u8] = &[0x00, 0x11, 0xFF, 0xFE, 2, 3, 1, 5, 0xDC, 0x00];
    let out_of_range: &[u8] = &[0xFF, 0xFE, 2, 3, 1, 0xFF, 0xFF, 0x04];
    let unknown: &[u8] = &[0xFF, 0xFE, 0x40, 2, 1, 2, 0x45];
    // Truncated in the middle of a frame, and the rest of it later.
    for part in [noise, out_of_range, unknown, &rocker(5)[..6], &rocker(5)[6..], &stop()[..4]] {
        port.write_all(part).unwrap();
    }
    drop(port);
    host.says("the port is closed");
    let mut port = host.open();
    port.write_all(&stop()).unwrap();
    drop(port);
    host.says("the port is closed");
    let (listing, said) = host.end();
    let lines: Vec<&str> = listing.lines().map(|line| line.split_once('\t').unwrap().1).collect();
    assert_eq!(
        lines,
        [
            "00 11\t\tskipped 2: no frame starts here",
            "FF FE 02 03 01 05 DC 00\t\tskipped 8: checksum 0x00 instead of 0xE7",
            "FF FE 02 03 01 FF FF 04\traw 0x02 0x01 0xFF 0xFF\tunknown: 65535 is out of range (500 to 2500)",
            "FF FE 40 02 01 02 45\traw 0x40 0x01 0x02\tunknown: no command has this function and length",
            "FF FE 03 08 01 00 05 00 00 00 00 01 12\trocker x=5 y=0 z=0",
            "FF FE 03 08\t\tskipped 4: checksum 0x00 instead of 0x14",
            "FF FE 03 08 01 00 00 00 00 00 00 01 0D\tstop",
        ]
    );
    assert!(said.contains("the board ignored 2 frames and 14 bytes"), "{said}");
}

#[test]
fn an_overloaded_line_and_a_running_drive_are_reported() {
    let mut host = Host::start("fast", &["--baud", "9600"]);
    let mut port = host.open();
    for _ in 0..20 {
        port.write_all(&rocker(5)).unwrap();
    }
    host.says("more than the line can carry");
    drop(port);
    host.says("has not stopped the robot; what the board does when frames stop arriving is unknown");
    let (listing, _) = host.end();
    assert_eq!(frames(&listing).len(), 20);
}

#[test]
fn a_program_that_never_reads_and_a_second_one_stop_nothing() {
    let mut host = Host::start("deaf", &["--baud", "1000000"]);
    // The second program requests exclusive access to the port.
    let mut second = fs::File::options().write(true).open(&host.path).unwrap();
    let mut first = host.open();
    let voltage = request(5);
    for _ in 0..600 {
        first.write_all(&voltage).unwrap();
        second.write_all(&stop()).unwrap();
    }
    drop((first, second));
    host.says("the port is closed");
    // Unread bytes are discarded when the next program opens the port.
    let mut port = host.open();
    port.write_all(&request(8)).unwrap();
    let mut reply = [0; 14];
    port.read_exact(&mut reply).unwrap();
    assert_eq!(&reply, b"{A0:0:0:1200}#");
    host.end();
}

/// The resident memory of a process in bytes.
fn memory(pid: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
}

#[test]
fn endless_frames_take_no_memory() {
    let mut host = Host::start("long", &["--baud", "4000000"]);
    let mut port = host.open();
    let some = rocker(5).repeat(1_000);
    let mut send = |times| (0..times).for_each(|_| port.write_all(&some).unwrap());
    // Its buffers have their final size by then.
    send(20);
    let before = memory(host.child.id());
    send(40);
    let after = memory(host.child.id());
    assert!(after < before + (1 << 20), "{before} bytes have become {after}");
    drop(port);
    host.says("the port is closed");
    assert_eq!(frames(&host.end().0).len(), 60_000);
}

#[test]
fn json_lines_say_the_same() {
    let mut host = Host::start("json", &["--format", "jsonl"]);
    let mut port = host.open();
    port.write_all(&[&[7], stop().as_slice()].concat()).unwrap();
    drop(port);
    host.says("the port is closed");
    let (text, _) = host.end();
    let objects: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(objects[0]["skipped"], "07");
    assert_eq!(objects[0]["wrong"], "no frame starts here");
    assert_eq!(objects[1]["command"], "stop");
    assert_eq!(objects[1]["frame"], "FFFE030801000000000000010D");
    assert!(objects[1]["t_us"].is_u64() && objects[1]["wrong"].is_null());
}

#[test]
fn a_link_replaces_only_links_of_motionseq() {
    let path = link("file");
    fs::write(&path, "mine").unwrap();
    let output = run(&["board", "--link", path.to_str().unwrap()]);
    assert_eq!((output.status.code(), fs::read_to_string(&path).unwrap().as_str()), (Some(2), "mine"));
    assert!(stderr(&output).contains("is not a link to a board"), "{}", stderr(&output));
    fs::remove_file(&path).unwrap();
    symlink("/etc/hostname", &path).unwrap();
    assert_eq!(run(&["board", "--link", path.to_str().unwrap()]).status.code(), Some(2));
    fs::remove_file(&path).unwrap();
}

#[test]
fn the_link_of_one_that_was_killed_is_replaced_and_that_of_a_living_one_is_not() {
    let mut first = Host::start("killed", &[]);
    let output = run(&["board", "--link", first.path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    first.signal(Signal::KILL);
    first.child.wait().unwrap();
    let left = fs::read_link(&first.path).unwrap();
    let path = first.path.clone();
    let second = Host::start_at("board", path, &[]);
    assert!(fs::read_link(&second.path).is_ok(), "{left:?}");
    let (_, said) = second.end();
    assert!(said.contains("received 0 frames"), "{said}");
}

#[test]
fn wrong_line_settings_are_reported_once() {
    let mut host = Host::start("settings", &[]);
    if !has("serial") {
        return;
    }
    for (baud, stops, words) in [
        ("9600", "1", Some("9600 baud, 1 stop bit;")),
        ("115200", "2", Some("115200 baud, 2 stop bits;")),
        ("115200", "1", None),
    ] {
        let code = "import serial,sys\np=serial.Serial(sys.argv[1],int(sys.argv[2]),stopbits=int(sys.argv[3]))\n\
                    for _ in range(3): p.write(bytes([255,254,3,8,1,0,0,0,0,0,0,1,13])); p.flush()";
        let client = Command::new("python3").args(["-c", code]).arg(&host.path).args([baud, stops]).output().unwrap();
        assert!(client.status.success(), "{}", stderr(&client));
        let mut said = Vec::new();
        while !said.last().is_some_and(|line: &String| line.contains("the port is closed")) {
            said.push(host.line());
        }
        let warned: Vec<&String> = said.iter().filter(|line| line.contains("would get garbage")).collect();
        assert_eq!(warned.len(), usize::from(words.is_some()), "{said:?}");
        assert!(words.is_none_or(|words| warned[0].contains(words)), "{said:?}");
    }
    host.end();
}

#[test]
fn the_count_of_faults_equals_the_listed_ones() {
    // Three faults, the last of which comes in many pieces.
    let host = Host::start("counted", &["--baud", "1000000"]);
    let mut port = host.open();
    port.write_all(&[&[1, 2, 3], stop().as_slice(), &[0xFF, 0xFE, 9, 0, 9], stop().as_slice(), &[7; 200]].concat())
        .unwrap();
    drop(port);
    let (listing, said) = host.end();
    let wrong = listing.lines().filter(|line| line.contains("skipped") || line.contains("unknown")).count();
    assert_eq!(wrong, 3, "{listing}");
    assert!(said.contains("the board ignored 1 frame and 203 bytes"), "{said}");
}

#[test]
fn reports_come_at_the_requested_interval() {
    let host = Host::start("often", &["--report-every", "20ms"]);
    let mut port = host.open();
    port.write_all(&request(0)).unwrap();
    let begun = std::time::Instant::now();
    port.read_exact(&mut [0; 14 * 25]).unwrap();
    // 25 reports in half a second instead of two and a half.
    let took = begun.elapsed();
    assert!(took.as_millis() < 2_000 && took.as_millis() > 400, "{took:?}");
    drop(port);
    host.end();
    let output = run(&["board", "--link", "/tmp/never", "--report-every", "1ms"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn a_board_reads_a_move_in_the_requested_version() {
    for (more, way) in [(&[][..], "3.0 cm to the left"), (&["--older-move"], "3.0 cm to the right")] {
        let mut host = Host::start("older", more);
        let mut port = host.open();
        port.write_all(&[0xFF, 0xFE, 1, 9, 1, 200, 150, 20, 0, 20, 12, 2, 5, 0xA4]).unwrap();
        // 3 to the right and 4 forward, with the direction bits of older driver versions.
        port.write_all(&[0xFF, 0xFE, 3, 8, 4, 0, 3, 0, 4, 0, 0, 7, 0x1D]).unwrap();
        host.says("cannot always be distinguished");
        // A nominal move takes twelve report intervals.
        port.write_all(&request(0)).unwrap();
        port.read_exact(&mut [0; 14 * 12]).unwrap();
        drop(port);
        host.says("the port is closed");
        let (_, said) = host.end();
        assert!(said.contains(way), "{said}");
    }
}
