//! `motionseq joints`: writes the calibration of an arm as `joint` lines of a script.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use motionseq::program::name_from;
use serde_json::{Map, Value};

use super::exit::Exit;
use super::output;
use super::read;
use super::screen::Screen;

/// Print the `joint` lines for the calibration file of a robot arm
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq joints my_arm.json\n  (echo board sts; motionseq joints my_arm.json) > arm.motion   # the start of a script\n\nA calibration file, as LeRobot writes it, is a JSON object with one entry for each motor: its name, and \"id\",\n\"drive_mode\", \"homing_offset\", \"range_min\" and \"range_max\". The zero of a joint is the middle of its range, as for the\ndegrees of LeRobot. A drive mode of 1 reverses the joint. The servo itself adds the homing offset, so the lines do not\ncontain it."
)]
pub(super) struct Joints {
    /// Calibration file to read, or `-` for standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// The numbers that a servo can have, and its positions.
const IDS: (i64, i64) = (0, 253);
const POSITIONS: (i64, i64) = (0, 4_095);

/// One entry of the file.
struct Joint {
    /// Its name in the file, and in a script.
    name: String,
    word: String,
    id: i64,
    is_reversed: bool,
    range: (i64, i64),
}

impl Joints {
    /// Prints the lines.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let source = match read(&self.file, screen) {
            Ok(source) => source,
            Err(exit) => return exit,
        };
        match lines(source.text()) {
            Ok(lines) => output::exit(io::stdout().lock().write_all(lines.as_bytes()), None, screen),
            Err(error) => {
                screen.error(&format!("{}: {error}", self.file.display()));
                Exit::Script
            }
        }
    }
}

/// The lines of a calibration file, in the order of the numbers of the servos.
fn lines(text: &str) -> Result<String, String> {
    let entries: Map<String, Value> = serde_json::from_str(text).map_err(|error| match error.classify() {
        serde_json::error::Category::Data => {
            "a calibration file is a JSON object with one entry for each motor".to_owned()
        }
        _ => format!("this is not JSON: {error}"),
    })?;
    if entries.is_empty() {
        return Err("the file contains no motor".to_owned());
    }
    let mut joints = entries.iter().map(|(name, entry)| joint(name, entry)).collect::<Result<Vec<_>, _>>()?;
    joints.sort_by_key(|joint| joint.id);
    for (at, joint) in joints.iter().enumerate() {
        for other in joints.iter().take(at) {
            let (first, second) = (&other.name, &joint.name);
            if other.id == joint.id {
                return Err(format!("`{first}` and `{second}` have the same `id`, {}", joint.id));
            }
            if other.word == joint.word {
                return Err(format!("`{first}` and `{second}` would have the same name in a script, `{}`", joint.word));
            }
        }
    }
    Ok(joints.iter().map(Joint::line).collect())
}

fn joint(name: &str, entry: &Value) -> Result<Joint, String> {
    let word = name_from(name).ok_or_else(|| format!("the name `{name}` has no letter or digit"))?;
    let Value::Object(entry) = entry else {
        return Err(format!(
            "`{name}` is not an object with `id`, `drive_mode`, `homing_offset`, `range_min` and `range_max`"
        ));
    };
    let number = |key: &str, range: (i64, i64)| number(entry, (name, key), range);
    let id = number("id", IDS)?;
    let is_reversed = number("drive_mode", (0, 1))? == 1;
    // The servo adds it to its positions.
    number("homing_offset", (-POSITIONS.1, POSITIONS.1))?;
    let range = (number("range_min", POSITIONS)?, number("range_max", POSITIONS)?);
    if range.0 >= range.1 {
        return Err(format!("`range_min` of `{name}` is {}, and must be less than `range_max`, {}", range.0, range.1));
    }
    Ok(Joint { name: name.to_owned(), word, id, is_reversed, range })
}

/// A whole number of an entry.
fn number(entry: &Map<String, Value>, (name, key): (&str, &str), (least, most): (i64, i64)) -> Result<i64, String> {
    let value = entry.get(key).ok_or_else(|| format!("`{name}` has no `{key}`"))?;
    let number = value.as_i64().ok_or_else(|| format!("`{key}` of `{name}` is not a whole number"))?;
    if (least..=most).contains(&number) {
        return Ok(number);
    }
    Err(format!("`{key}` of `{name}` is {number}, and must be from {least} to {most}"))
}

impl Joint {
    fn line(&self) -> String {
        let (least, most) = self.range;
        let sum = least + most;
        let half = if sum % 2 == 1 { ".5" } else { "" };
        let reversed = if self.is_reversed { " reversed" } else { "" };
        format!("joint {} servo {} zero {}{half}{reversed} {least}..{most}\n", self.word, self.id, sum / 2)
    }
}
