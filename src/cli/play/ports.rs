//! Which port and which faults each robot of a script has.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use motionseq::faults::Faults;
use motionseq::program::suggest;
use motionseq::timeline::Timeline;

use super::super::exit::Exit;
use super::super::project::{ChosenPort, Config};
use super::super::screen::Screen;

/// Assigns the values of an option to the robots of a script: `left=VALUE` to one, `VALUE` to all where that makes sense. The robots
/// are those of `timelines`, with or without names.
struct Assignment<'a, T> {
    option: &'static str,
    separator: char,
    /// The values, each as it was written.
    values: &'a [T],
}

impl<T: AsRef<OsStr>> Assignment<'_, T> {
    /// The value for each robot; `None` without one.
    fn to(&self, timelines: &[Timeline], screen: &Screen) -> Result<Vec<Option<String>>, Exit> {
        let Assignment { option, separator, values } = *self;
        let names: Vec<&str> = timelines.iter().filter_map(|timeline| timeline.robot.as_deref()).collect();
        let mut found = vec![None; timelines.len()];
        let wrong = |message: String| {
            screen.error(&message);
            Err(Exit::Usage)
        };
        for value in values {
            let value = value.as_ref().to_string_lossy().into_owned();
            let (name, rest) = match value.split_once(separator) {
                Some((name, rest)) if !names.is_empty() => (Some(name.trim()), rest.trim().to_owned()),
                _ => (None, value.clone()),
            };
            let robot = match name {
                None if names.is_empty() => 0,
                None => {
                    let first = names.first().copied().unwrap_or("left");
                    return wrong(format!(
                        "`{option} {value}` names no robot, and the script has {}: write `{option} {first}{separator}{value}`",
                        names.join(" and ")
                    ));
                }
                Some(name) => match names.iter().position(|known| *known == name) {
                    Some(robot) => robot,
                    None => {
                        let help = match suggest(name, names.iter().copied()) {
                            Some(near) => format!("did you mean `{near}`?"),
                            None => format!("its robots are {}", names.join(", ")),
                        };
                        return wrong(format!("`{option} {value}`: the script has no robot `{name}`; {help}"));
                    }
                },
            };
            match found.get_mut(robot) {
                Some(place @ None) => *place = Some(rest),
                _ => return wrong(format!("`{option}` is given twice for one robot; keep one of the two")),
            }
        }
        Ok(found)
    }
}

/// The port of each robot: that of the command line, of the environment, or of the configuration, else a virtual board.
pub(super) fn choose(
    asked: &[PathBuf],
    timelines: &[Timeline],
    config: &Config,
    screen: &Screen,
) -> Result<Vec<ChosenPort>, Exit> {
    let is_named = timelines.first().is_some_and(|timeline| timeline.robot.is_some());
    let chosen: Vec<ChosenPort> = if is_named {
        let found = Assignment { option: "--port", separator: '=', values: asked }.to(timelines, screen)?;
        let robots = timelines.iter().zip(found);
        let port = |(timeline, path): (&Timeline, Option<String>)| {
            Config::port_of(timeline.robot.as_deref().unwrap_or_default(), path.as_deref().map(Path::new))
        };
        robots.map(port).collect()
    } else {
        if asked.len() > 1 {
            screen.error("`--port` is given more than once, and the script is for one robot; keep one of them");
            return Err(Exit::Usage);
        }
        vec![config.port(asked.first().map(PathBuf::as_path))]
    };
    let device =
        |port: &ChosenPort| fs::metadata(port.path.as_ref()?).ok().map(|file| (file.dev(), file.ino(), file.rdev()));
    for (at, port) in chosen.iter().enumerate() {
        let is_same = |other: &&ChosenPort| device(port).is_some() && device(other) == device(port);
        if let Some(other) = chosen.iter().take(at).find(is_same) {
            let path = |port: &ChosenPort| port.path.as_deref().unwrap_or(Path::new("")).display().to_string();
            screen.error(&format!(
                "{} and {} are one port, and each robot needs its own; nothing was sent",
                path(other),
                path(port)
            ));
            return Err(Exit::Usage);
        }
    }
    if is_named {
        config.warn_of_common_port(screen);
    }
    Ok(chosen)
}

/// The faults of the virtual board of each robot: `left: unplug@2s` for one, `unplug@2s` for all.
pub(super) fn faults(asked: &[String], timelines: &[Timeline], screen: &Screen) -> Result<Vec<Faults>, Exit> {
    let is_named = timelines.first().is_some_and(|timeline| timeline.robot.is_some());
    let (for_one, for_all): (Vec<&String>, Vec<&String>) =
        asked.iter().partition(|faults| is_named && faults.contains(':') && !faults.starts_with("servo="));
    let found = Assignment { option: "--fault", separator: ':', values: for_one.as_slice() }.to(timelines, screen)?;
    let read = |text: &str| {
        text.parse::<Faults>().map_err(|error| {
            screen.error(&format!("`--fault {text}`: {error}"));
            Exit::Usage
        })
    };
    let common: Vec<&str> = for_all.iter().map(|faults| faults.as_str()).collect();
    let join = |own: Option<String>| {
        let all: Vec<&str> = common.iter().copied().chain(own.as_deref()).collect();
        if all.is_empty() { Ok(Faults::default()) } else { read(&all.join(",")) }
    };
    found.into_iter().map(join).collect()
}
