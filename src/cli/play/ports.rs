//! Which port and which faults each robot of a script has.

use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

use motionseq::board::Simulation;
use motionseq::faults::Faults;
use motionseq::timeline::Timeline;

use super::super::exit::Exit;
use super::super::project::{ChosenPort, Config, VIRTUAL, ValueSource};
use super::super::robot_names::{names, number_of};
use super::super::screen::Screen;

/// The value of `--port` for each robot: `left=PATH`. One that is `virtual` without a name is for all.
fn assigned(asked: &[PathBuf], timelines: &[Timeline]) -> Result<Vec<Option<PathBuf>>, String> {
    let names = names(timelines);
    let first = names.first().copied().unwrap_or("left");
    let mut found = vec![None; timelines.len()];
    for value in asked {
        let value = value.to_string_lossy();
        if value == VIRTUAL && asked.len() == 1 {
            return Ok(vec![Some(PathBuf::from(VIRTUAL)); timelines.len()]);
        }
        let Some((name, path)) = value.split_once('=') else {
            let written = value.split_once(':').filter(|(name, _)| names.contains(&name.trim()));
            let (name, path) = written.map_or((first, &*value), |(name, path)| (name.trim(), path.trim()));
            return Err(format!(
                "`--port {value}` names no robot, and the script has {}: write `--port {name}={path}`",
                names.join(" and ")
            ));
        };
        let robot = number_of(name.trim(), timelines).map_err(|why| format!("`--port {value}`: {why}"))?;
        if path.is_empty() {
            return Err(format!("`--port {value}` has no port; for a virtual board, write `--port {name}={VIRTUAL}`"));
        }
        match found.get_mut(robot) {
            Some(place @ None) => *place = Some(PathBuf::from(path)),
            _ => return Err(format!("`--port` is given twice for {name}; keep one of the two")),
        }
    }
    Ok(found)
}

/// The port of each robot: that of the command line, of the environment, or of the configuration, else a virtual board.
pub(super) fn choose(
    asked: &[PathBuf],
    timelines: &[Timeline],
    config: &Config,
    screen: &Screen,
) -> Result<Vec<ChosenPort>, Exit> {
    let is_named = timelines.first().is_some_and(|timeline| timeline.robot.is_some());
    let wrong = |message: &str| {
        screen.error(message);
        Exit::Usage
    };
    let chosen: Vec<ChosenPort> = if is_named {
        let found = assigned(asked, timelines).map_err(|why| wrong(&why))?;
        let robots = timelines.iter().zip(found);
        let port = |(timeline, path): (&Timeline, Option<PathBuf>)| {
            Config::port_of(timeline.robot.as_deref().unwrap_or_default(), path.as_deref())
        };
        robots.map(port).collect()
    } else if asked.len() > 1 {
        return Err(wrong("`--port` is given more than once, and the script is for one robot; keep one of them"));
    } else {
        vec![config.port(asked.first().map(PathBuf::as_path))]
    };
    let is_unset = |chosen: &ChosenPort| matches!(chosen.source, ValueSource::Default);
    if is_named
        && chosen.iter().all(is_unset)
        && let Some(set) = config.common_port()
    {
        return Err(wrong(&set));
    }
    for (at, port) in chosen.iter().enumerate() {
        let is_same = |other: &&ChosenPort| device(port).is_some() && device(other) == device(port);
        if let Some(other) = chosen.iter().take(at).find(is_same) {
            let path = |port: &ChosenPort| port.path.as_deref().unwrap_or(Path::new("")).display().to_string();
            return Err(wrong(&format!(
                "{} and {} are one port, and each robot needs its own; nothing was sent",
                path(other),
                path(port)
            )));
        }
    }
    Ok(chosen)
}

/// What a path leads to: the number of a device, or else a file.
fn device(port: &ChosenPort) -> Option<(u64, u64)> {
    let file = fs::metadata(port.path.as_ref()?).ok()?;
    Some(if file.file_type().is_char_device() { (0, file.rdev()) } else { (file.dev(), file.ino()) })
}

/// The faults of the virtual board of each robot: `left: unplug@2s` or `left, right: unplug@2s` for some, `unplug@2s` for all.
/// What is for all and about servos is for the boards that have servos.
pub(super) fn faults(asked: &[String], timelines: &[Timeline], screen: &Screen) -> Result<Vec<Faults>, Exit> {
    let wrong = |message: &str| {
        screen.error(message);
        Exit::Usage
    };
    let has_servos = |timeline: &Timeline| timeline.board.simulation == Simulation::Servos;
    let mut found: Vec<Vec<&str>> = vec![Vec::new(); timelines.len()];
    for words in asked {
        if let Some((robots, faults)) = of_robots(words).filter(|_| !names(timelines).is_empty()) {
            for name in robots.split(',') {
                let robot = number_of(name.trim(), timelines);
                let robot = robot.map_err(|why| wrong(&format!("`--fault {words}`: {why}")))?;
                found.get_mut(robot).into_iter().for_each(|own| own.push(faults));
            }
            continue;
        }
        for (timeline, own) in timelines.iter().zip(&mut found) {
            let is_meant = |fault: &&str| {
                has_servos(timeline) || !fault.starts_with("servo=") || !timelines.iter().any(has_servos)
            };
            own.extend(words.split(',').map(str::trim).filter(is_meant));
        }
    }
    let read = |faults: Vec<&str>| {
        if faults.is_empty() {
            return Ok(Faults::default());
        }
        let text = faults.join(",");
        text.parse().map_err(|error| wrong(&format!("`--fault {text}`: {error}")))
    };
    found.into_iter().map(read).collect()
}

/// The robots that a list of faults begins with, and the rest: `left: unplug@2s`. The faults themselves may have a `:`, too.
pub(super) fn of_robots(words: &str) -> Option<(&str, &str)> {
    let (robots, faults) = words.split_once(':')?;
    let is_name = |name: &str| {
        !name.trim().is_empty() && name.trim().bytes().all(|byte| byte == b'_' || byte.is_ascii_alphanumeric())
    };
    robots.split(',').all(is_name).then(|| (robots, faults.trim()))
}
