//! Robots of a script by the names that options give.

use motionseq::program::{list, suggest};
use motionseq::timeline::Timeline;

/// The names of the robots of a script.
pub(super) fn names(timelines: &[Timeline]) -> Vec<&str> {
    timelines.iter().filter_map(|timeline| timeline.robot.as_deref()).collect()
}

/// The number of the robot with a name; otherwise what is wrong.
pub(super) fn number_of(name: &str, timelines: &[Timeline]) -> Result<usize, String> {
    let is_it = |timeline: &Timeline| timeline.robot.as_deref() == Some(name);
    timelines.iter().position(is_it).ok_or_else(|| {
        let names = || names(timelines).into_iter();
        let help = match suggest(name, names()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("the robots are {}", list(names())),
        };
        format!("the script has no robot `{name}`; {help}")
    })
}

/// The robot with the name that `--robot` gives, or all.
pub(super) fn chosen<'t>(timelines: &'t [Timeline], robot: Option<&str>) -> Result<&'t [Timeline], String> {
    let Some(name) = robot else { return Ok(timelines) };
    if names(timelines).is_empty() {
        return Err("`--robot` is for scripts with several robots; this one has no line `robots`".to_owned());
    }
    let number = number_of(name, timelines)?;
    Ok(timelines.get(number..=number).unwrap_or_default())
}
