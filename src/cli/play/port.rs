//! The port that a run is played on: a real one, or that of the built-in virtual board.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver};

use motionseq::board::{ServoSet, Simulation};
use motionseq::faults::{Faults, Faulty};
use motionseq::link::{Pty, Serial};
use motionseq::serve::BoardThread;
use motionseq::sim::{Device, Pose, ServoSetup, Settings};
use motionseq::timeline::Timeline;
use motionseq::units::Micros;

use super::super::exit::Exit;
use super::super::port_opening::doubt;
use super::super::project::{ChosenPort, ValueSource};
use super::super::screen::Screen;

/// An open port, and the virtual board at its other end if there is one.
pub(super) struct Port {
    pub(super) link: Serial,
    /// The path of a real port.
    pub(super) path: Option<PathBuf>,
    pub(super) board: Option<BoardThread>,
    /// Where the robot of the virtual board is, ten times a second, since the start of the run.
    pub(super) poses: Option<Receiver<(Micros, Pose)>>,
}

/// How often the pose of the robot is noted, and how many poses fit in the queue.
const POSE_EVERY: Micros = Micros::from_millis(100);
const POSES: usize = 1_024;

impl Port {
    /// The port of a new virtual board.
    pub(super) fn of_board(
        chosen: &ChosenPort,
        timeline: &Timeline,
        faults: Faults,
        screen: &Screen,
    ) -> Result<Self, Exit> {
        let Timeline { robot, board, baud, .. } = timeline;
        if !faults.servos.is_empty() && board.simulation != Simulation::Servos {
            screen.error(&format!(
                "the servos of the board `{}` do not answer, so `--fault servo=` has no effect",
                board.line
            ));
            return Err(Exit::Usage);
        }
        let pty = Pty::open().map_err(|error| system(screen, &error))?;
        // Opened by its path, like a real port.
        let link = Serial::open(pty.path(), *baud).map_err(|error| system(screen, &io::Error::other(error)))?;
        screen.note(&match (&chosen.source, robot) {
            (ValueSource::Default, None) => "no --port: playing on the built-in virtual board".to_owned(),
            (ValueSource::Default, Some(robot)) => {
                format!("{}no --port {robot}=PATH: playing on a built-in virtual board", timeline.prefix())
            }
            (_, None) => format!("playing on the built-in virtual board{}", chosen.origin()),
            (_, Some(_)) => format!("{}playing on a built-in virtual board{}", timeline.prefix(), chosen.origin()),
        });
        let mut settings = Settings::default();
        settings.servos = Some(servos(timeline));
        settings.baud = Some(*baud);
        let board = Faulty::new(Device::new(Arc::clone(board), settings), faults);
        let (tell, poses) = mpsc::sync_channel(POSES);
        let mut due = Micros(1);
        let watch = move |time: Micros, board: &Device| {
            // Before the script begins, the time is 0.
            if time >= due && board.family().simulation == Simulation::Mecanum {
                due = time + POSE_EVERY;
                // Without a log, nothing takes them.
                let _ = tell.try_send((time, board.received().pose));
            }
        };
        let board = BoardThread::start(board, pty, *baud, watch).map_err(|error| system(screen, &error))?;
        Ok(Port { link, path: None, board: Some(board), poses: Some(poses) })
    }

    /// A real port.
    pub(super) fn real(
        (link, path): (Serial, PathBuf),
        timeline: &Timeline,
        chosen: &ChosenPort,
        screen: &Screen,
    ) -> Self {
        let name = timeline.prefix();
        screen.note(&format!("{name}playing on {}{}", path.display(), chosen.origin()));
        doubt(&path, screen);
        Port { link, path: Some(path), board: None, poses: None }
    }
}

/// The servos that a script uses: those that it commands, and those that it reads.
fn servos(timeline: &Timeline) -> Vec<ServoSetup> {
    let requests = timeline.asked().into_iter().filter_map(|row| timeline.board.quantities.get(row)?.request.as_ref());
    let asked = requests.filter_map(|request| request.value(0));
    let all: ServoSet = timeline.servos().iter().chain(asked).collect();
    all.iter().filter_map(|id| u8::try_from(id).ok()).map(ServoSetup::new).collect()
}

/// Reports that the system refused something that a run needs.
pub(super) fn system(screen: &Screen, error: &io::Error) -> Exit {
    screen.error(&format!("cannot play: {error}; nothing was sent"));
    Exit::Port
}
