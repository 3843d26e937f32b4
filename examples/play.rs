//! Plays a script on a robot, stops the robot at Ctrl-C, and has it stopped if this program is
//! killed:
//!
//! ```text
//! cargo run --example play -- scripts/hello.motion /dev/serial0
//! ```
//!
//! Without a robot, `motionseq board --link /tmp/board` provides a virtual one at `/tmp/board`.

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    match play() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            std::process::ExitCode::FAILURE
        }
    }
}

#[cfg(target_os = "linux")]
fn play() -> Result<(), Box<dyn std::error::Error>> {
    use std::path::Path;
    use std::process::Command;
    use std::sync::mpsc;
    use std::thread;

    use motionseq::link::{Link as _, Serial};
    use motionseq::playback::{Cause, Guard, GuardConfig, Notice, Player, Session, Signals, guard, now};
    use motionseq::program::Options;
    use motionseq::source::{Disk, Lines, Sources};

    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // The guard of the player is this program, started by `Guard::start` below.
    if let [word, rest @ ..] = arguments.as_slice()
        && word == "guard"
    {
        if let Some(guarded) = guard(rest)? {
            eprintln!("the player was lost at {} s; stop: {:?}", guarded.at, guarded.stop);
        }
        return Ok(());
    }
    let [script, port] = arguments.as_slice() else {
        return Err("usage: play SCRIPT PORT".into());
    };

    let sources = Sources::read(Path::new(script), Disk)?;
    let compiled = motionseq::compile(&sources, &Options::default());
    let lines = Lines::of(&sources);
    for diagnostic in &compiled.diagnostics {
        eprintln!("{}: {}; {}", lines.place(diagnostic.span), diagnostic.message, diagnostic.help);
    }
    let timeline = compiled.timeline().ok_or("the script has errors")?;

    let ward = GuardConfig::of(&timeline);
    let player = Player::new(&timeline, ward.max_late);
    let mut session = Session::new(player, Serial::open(Path::new(port), timeline.baud)?, Signals::catch()?, lines);
    let timeline = &timeline;
    let outcome = thread::scope(|scope| {
        // A terminal may block for a while: motion does not wait for it.
        let (sender, receiver) = mpsc::sync_channel::<usize>(1_024);
        scope.spawn(move || {
            for event in receiver.iter().filter_map(|event| timeline.events.get(event)) {
                println!("{:.3} s: {}", event.at, timeline.board.show(&event.command));
            }
        });
        let mut program = Command::new(std::env::current_exe()?);
        program.arg("guard");
        // Last of all: from now on the player must send heartbeats.
        session.guard = Some(Guard::start(program, session.link.descriptor(), &ward)?);
        let outcome = session.play(now(), |notice| {
            if let Notice::Sent { event, .. } = notice {
                let _ = sender.try_send(event);
            }
        });
        if let Some(guard) = session.guard.take() {
            guard.goodbye();
        }
        std::io::Result::Ok(outcome)
    })?;
    println!("{:?} at {} s; the stop of the robot: {:?}", outcome.cause, outcome.at, outcome.stop);
    if outcome.cause == Cause::Finished { Ok(()) } else { Err("the run ended early".into()) }
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("a player needs Linux");
}
