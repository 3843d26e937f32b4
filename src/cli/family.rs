//! The board that `--family` or a snapshot names.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use motionseq::board::{Board, FAMILIES, Family, raspblock};
use motionseq::diagnostic::Diagnostics;
use motionseq::program::text_board;
use motionseq::source::{Disk, Files as _, Sources};
use motionseq::timeline::{NamedBoard, Snapshot};

use super::exit::Exit;
use super::screen::{Screen, Warnings};

/// How the bytes of another program are decoded.
#[derive(Clone, Debug, Args)]
pub(super) struct Reading {
    /// Choose the board: as a script writes it after `board`, or by the file that describes it [default: raspblock]
    #[arg(long, value_name = "NAME|FILE.toml", value_parser = wanted)]
    family: Option<Wanted>,
    /// Decode the direction of `move` as older versions of the vendor's driver encode it (Raspblock only)
    #[arg(long)]
    older_move: bool,
}

/// What `--family` names.
#[derive(Clone, Debug)]
enum Wanted {
    Board(Arc<Board>),
    File(String),
}

/// A board, and the file that describes it if it is a text board.
#[derive(Clone, Debug)]
pub(super) struct Chosen {
    pub(super) board: Arc<Board>,
    pub(super) file: Option<PathBuf>,
}

/// Reads the value of `--family`.
fn wanted(text: &str) -> Result<Wanted, String> {
    if Path::new(text).extension().is_some_and(|end| end == "toml") {
        let is_writable = !text.contains(|letter: char| letter == '"' || letter.is_control());
        return if is_writable {
            Ok(Wanted::File(text.to_owned()))
        } else {
            Err("a script cannot name this file; rename it without quotation marks and control characters".to_owned())
        };
    }
    let line = |text: &'static str| text.strip_prefix("board ").unwrap_or(text);
    Family::board(text).map(Wanted::Board).ok_or_else(|| {
        match text.split_ascii_whitespace().next().and_then(Family::named) {
            Some(family) if family.usage == family.example => format!("write `{}`", line(family.usage)),
            Some(family) => format!("write `{}`, for example `{}`", line(family.usage), line(family.example)),
            None => {
                let known: Vec<String> = FAMILIES.iter().map(|family| format!("`{}`", line(family.usage))).collect();
                format!("write one of {}, or the name of a .toml file that describes a board", known.join(", "))
            }
        }
    })
}

impl Reading {
    /// Whether the board was named.
    pub(super) fn is_given(&self) -> bool {
        self.family.is_some()
    }

    /// The board that the frames are for.
    pub(super) fn chosen(&self, screen: &Screen) -> Result<Chosen, Exit> {
        let chosen = match &self.family {
            None => Chosen::of(raspblock::board()),
            Some(Wanted::Board(board)) => Chosen::of(Arc::clone(board)),
            Some(Wanted::File(name)) => read(Path::new(name), name, screen)?,
        };
        self.with_older_move(chosen, screen)
    }

    /// The board of a snapshot, unless another one was named.
    pub(super) fn chosen_for(&self, snapshot: &Path, head: &[u8], screen: &Screen) -> Result<Chosen, Exit> {
        if self.is_given() {
            return self.chosen(screen);
        }
        self.with_older_move(of_snapshot(&snapshot.display().to_string(), snapshot, head, screen)?, screen)
    }

    /// Applies `--older-move`.
    fn with_older_move(&self, chosen: Chosen, screen: &Screen) -> Result<Chosen, Exit> {
        if !self.older_move {
            return Ok(chosen);
        }
        let older = raspblock::with_older_move();
        if chosen.board.line != older.line {
            let (only, line) = (&older.line, &chosen.board.line);
            screen.error(&format!("`--older-move` is only for the board `{only}`, not for `{line}`; remove it"));
            return Err(Exit::Usage);
        }
        Ok(Chosen::of(older))
    }
}

impl Chosen {
    fn of(board: Arc<Board>) -> Self {
        Chosen { board, file: None }
    }

    /// The same for a script at a path, or on standard output in this folder: its `board` line names the file of a text board as
    /// seen from the folder of the script.
    pub(super) fn for_script(self, script: Option<&Path>, screen: &Screen) -> Self {
        let Some(file) = &self.file else { return self };
        let name = inside(file, script).unwrap_or_else(|| {
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            screen.note(&format!("the script names its board `{name}`: copy {} next to the script", file.display()));
            name
        });
        let board = Board { line: format!("\"{name}\"").into(), ..Board::clone(&self.board) };
        Chosen { board: Arc::new(board), ..self }
    }
}

/// The path of a file as a script names it; `None` if the file is not in the folder of the script or below.
fn inside(file: &Path, script: Option<&Path>) -> Option<String> {
    let folder = Path::new(".").join(script.and_then(Path::parent).unwrap_or(Path::new("")));
    let file = file.canonicalize().ok()?;
    let parts = file.strip_prefix(folder.canonicalize().ok()?).ok()?.iter();
    let parts: Option<Vec<&str>> = parts.map(|part| part.to_str().filter(|part| !part.contains(['"', '\\']))).collect();
    Some(parts?.join("/"))
}

/// The board of a snapshot with this name in messages, or that of its first robot. A file that it names is in the folder of `from` or
/// below.
fn of_snapshot(name: &str, from: &Path, text: &[u8], screen: &Screen) -> Result<Chosen, Exit> {
    let board = Snapshot::robots(text).into_iter().next().and_then(|(_, board)| board);
    of_line((name, from), board, screen)
}

/// The robots of a snapshot with their boards.
pub(super) fn robots_of_snapshot(
    name: &str,
    from: &Path,
    text: &[u8],
    screen: &Screen,
) -> Result<Vec<NamedBoard>, Exit> {
    let robots = Snapshot::robots(text).into_iter();
    let board = |line| of_line((name, from), line, screen).map(|chosen| chosen.board);
    robots.map(|(robot, line)| Ok((robot.map(Arc::from), board(line)?))).collect()
}

/// The board that a snapshot names like a script after `board`, or the default one.
fn of_line((name, from): (&str, &Path), line: Option<&str>, screen: &Screen) -> Result<Chosen, Exit> {
    let Some(line) = line else { return Ok(Chosen::of(raspblock::board())) };
    let refused = |why: &str| {
        screen.error(&format!("{name} is for the board `{line}`: {why}"));
        Exit::Script
    };
    let Some(file) = line.strip_prefix('"').and_then(|line| line.strip_suffix('"')) else {
        let board = Family::board(line).ok_or_else(|| refused("this motionseq does not know it, so update motionseq"));
        return board.map(Chosen::of);
    };
    let path = Disk.resolve(from, from, file).map_err(|error| refused(&error.to_string()))?;
    read(&path, file, screen)
}

/// Reads the file of a text board, and shows what is wrong with it. `name` is its path as a script writes it.
fn read(file: &Path, name: &str, screen: &Screen) -> Result<Chosen, Exit> {
    let sources = Sources::read(file, Disk).map_err(|error| {
        screen.unreadable(error);
        Exit::Script
    })?;
    let mut diagnostics = Diagnostics::default();
    let board = text_board(sources.main(), name, &mut diagnostics);
    screen.diagnostics(&sources, &diagnostics, Warnings::First, false);
    Ok(Chosen { board: board.ok_or(Exit::Script)?, file: Some(file.to_owned()) })
}
