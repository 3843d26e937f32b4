//! Reads the output of `socat -x`, also with `-v` and `-d`: blocks of both directions, each with a time.

use super::stamps::clock;
use crate::units::Nanos;

/// The number of nanoseconds that a fraction of a second has less than, if it is in microseconds.
const MICROS: u64 = 1_000_000;

/// What passed in one direction, with its times.
pub(super) type Direction = Vec<(Nanos, Vec<u8>)>;

/// Whether a stream that begins with this block is such an output.
pub(super) fn is_socat(block: &[u8]) -> bool {
    let first = block.split(|&byte| byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    let first = first.and_then(|line| std::str::from_utf8(line).ok()).unwrap_or_default();
    header(first).is_some() || (is_message(first) && clock(first.get(..19).unwrap_or_default()).is_some())
}

/// `> 2026/11/28 21:02:56.000932972  length=6 from=0 to=5`: the direction, the time, and its fraction.
fn header(line: &str) -> Option<(char, &str, &str)> {
    let direction = line.chars().next().filter(|sign| matches!(sign, '<' | '>'))?;
    let (time, rest) = line.get(2..)?.split_once("  length=")?;
    let (time, fraction) = time.split_once('.').unwrap_or((time, "0"));
    (rest.contains(" from=") && clock(time).is_some()).then_some((direction, time, fraction))
}

/// `2026/11/28 21:02:59 socat[4642] N PTY is /dev/pts/7`.
fn is_message(line: &str) -> bool {
    line.get(19..).is_some_and(|rest| rest.starts_with(" socat["))
}

/// The two directions, `>` first.
pub(super) fn directions(text: &str) -> [Direction; 2] {
    // Version 1.7 writes microseconds with nine digits, as if they were nanoseconds.
    let headers = || text.lines().filter_map(header);
    let is_micros =
        headers().all(|(.., fraction)| fraction.len() == 9 && fraction.parse::<u64>().is_ok_and(|n| n < MICROS));
    let time = |time: &str, fraction: &str| {
        let fraction = if is_micros { fraction.get(3..).unwrap_or_default() } else { fraction };
        clock(&format!("{time}.{fraction}")).unwrap_or_default()
    };
    let first = headers().map(|(_, at, fraction)| time(at, fraction)).min().unwrap_or_default();
    let [mut there, mut back] = [Direction::new(), Direction::new()];
    let mut current: Option<&mut Direction> = None;
    for line in text.lines() {
        if let Some((direction, at, fraction)) = header(line) {
            let of_line = if direction == '>' { &mut there } else { &mut back };
            of_line.push((time(at, fraction) - first, Vec::new()));
            current = Some(of_line);
        } else if let Some((_, bytes)) = current.as_mut().filter(|_| !is_message(line)).and_then(|all| all.last_mut()) {
            bytes.extend(hex(line));
        }
    }
    [there, back]
}

/// The bytes of a line: ` ff fe 04`, and after at least two spaces their characters, if there are any (`-v`).
fn hex(line: &str) -> Vec<u8> {
    let line = line.strip_prefix(' ').unwrap_or_default();
    let digits = line.split("  ").next().unwrap_or_default();
    // A sign, which a number may have, is no digit.
    let is_byte = |text: &str| text.len() == 2 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    digits.split(' ').map_while(|text| is_byte(text).then(|| u8::from_str_radix(text, 16).ok())?).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_is_two_hex_digits() {
        assert_eq!(hex(" ff 0f  .."), [0xFF, 0x0F]);
        for other in [" +f", " -1", " f", " fff", "ff", " \u{e9}"] {
            assert_eq!(hex(other), [0; 0], "{other}");
        }
    }
}
