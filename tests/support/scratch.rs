//! Folders of tests, and commands that run in them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::program;

/// A folder for one test, removed with it.
pub(crate) struct Scratch(pub(crate) PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("motionseq-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        Scratch(folder)
    }

    pub(crate) fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// Runs the program in this folder.
    pub(crate) fn run(&self, args: &[&str]) -> Output {
        with_motionseq("motionseq", &self.0).args(args).output().unwrap()
    }

    pub(crate) fn file(&self, name: &str, content: &[u8]) -> String {
        fs::write(self.0.join(name), content).unwrap();
        self.path(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A command that finds the built program as `motionseq`.
pub(crate) fn with_motionseq(command: &str, folder: &Path) -> Command {
    let folder_of_program = Path::new(program()).parent().unwrap().to_str().unwrap();
    let mut command = Command::new(command);
    let path = format!("{folder_of_program}:{}", std::env::var("PATH").unwrap());
    command.env("PATH", path).env_remove("MOTIONSEQ_PORT").current_dir(folder);
    command
}

/// The exit code of a program that no signal ended.
pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().expect("it ended by itself")
}
