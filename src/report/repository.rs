//! Paths as a repository names them.

use std::path::{Component, Path, PathBuf};

use crate::verify::Case;

/// Where paths of annotations count from.
#[derive(Clone, Debug)]
pub struct Repository {
    roots: Vec<PathBuf>,
    here: PathBuf,
}

impl Repository {
    /// The same cases, with paths that count from here.
    pub fn cases(&self, cases: &[Case]) -> Vec<Case> {
        let mut cases = cases.to_vec();
        for case in &mut cases {
            case.name = self.path(&case.name);
            for problem in &mut case.problems {
                problem.file = self.path(&problem.file);
            }
        }
        cases
    }

    /// `here` is the folder that names of files count from; a file belongs to the first root that it is in. All of them are
    /// absolute, without links.
    pub fn new(roots: Vec<PathBuf>, here: PathBuf) -> Self {
        Repository { roots, here }
    }

    /// The path of a file from the root on, with `/` between its parts. What is in no root keeps its name.
    pub fn path(&self, name: &str) -> String {
        // `<stdin>` is no path.
        if name.starts_with('<') {
            return name.to_owned();
        }
        let path = normalised(&self.here.join(name));
        let Some(inside) = self.roots.iter().find_map(|root| path.strip_prefix(root).ok()) else {
            return name.to_owned();
        };
        inside.components().map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    }
}

/// A path without `.` and `..`.
fn normalised(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_count_from_the_root() {
        let repository = Repository::new(vec!["/repo".into()], "/repo/robots/left".into());
        for (name, path) in [
            ("dance.motion", "robots/left/dance.motion"),
            ("./lib/../dance.motion", "robots/left/dance.motion"),
            ("../../top.motion", "top.motion"),
            ("/repo/a b.motion", "a b.motion"),
            ("/elsewhere/x.motion", "/elsewhere/x.motion"),
            ("../../../out.motion", "../../../out.motion"),
            ("<stdin>", "<stdin>"),
        ] {
            assert_eq!(repository.path(name), path);
        }
    }
}
