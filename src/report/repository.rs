//! Paths relative to a repository.

use std::path::{Component, Path, PathBuf};

use crate::verify::Case;

/// What paths in annotations are relative to.
#[derive(Clone, Debug)]
pub struct Repository {
    roots: Vec<PathBuf>,
    here: PathBuf,
}

impl Repository {
    /// The same cases with paths relative to the repository.
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

    /// Paths are read relative to `here` and written relative to the first root that contains them. All folders must be absolute
    /// and without links.
    pub fn new(roots: Vec<PathBuf>, here: PathBuf) -> Self {
        Repository { roots, here }
    }

    /// The path relative to its root, with `/` as separator. A file outside of every root keeps its name.
    pub fn path(&self, name: &str) -> String {
        // `<stdin>` is not a path.
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
    fn paths_are_relative_to_the_root() {
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
