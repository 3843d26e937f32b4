use super::super::ports::help;
use super::*;
use motionseq::board::raspblock;

fn port(path: &str, likely: BoardLikelihood, obstacle: Option<Obstacle>) -> PortInfo {
    PortInfo::new(path, likely, obstacle)
}

fn chosen(ports: &[PortInfo]) -> Result<PathBuf, String> {
    choose(ports.to_vec(), &raspblock::board()).map_err(|refused| refused.to_string())
}

#[test]
fn auto_takes_the_one_port_that_looks_like_the_board() {
    use BoardLikelihood::{Board, Maybe, No};
    let pins = port("/dev/ttyS0", Board, None);
    let usb = port("/dev/ttyUSB0", Maybe, None);
    let other = port("/dev/ttyS1", No, None);
    assert_eq!(chosen(&[other.clone(), pins.clone(), usb.clone()]), Ok(PathBuf::from("/dev/ttyS0")));
    assert_eq!(chosen(&[other.clone(), usb.clone()]), Ok(PathBuf::from("/dev/ttyUSB0")));
    // One that another program uses is still the board, and is refused when it is opened.
    let used = port("/dev/ttyUSB0", Maybe, Some(Obstacle::InUse(None)));
    assert_eq!(chosen(&[used]), Ok(PathBuf::from("/dev/ttyUSB0")));
    let none = Err("`--port auto`: no port looks like the board".to_owned());
    let console = port("/dev/ttyUSB0", Maybe, Some(Obstacle::Console));
    assert_eq!((chosen(&[]), chosen(&[other, console])), (none.clone(), none));
    let second = port("/dev/ttyUSB1", Maybe, None);
    assert_eq!(chosen(&[usb, second]), Err("`--port auto`: several ports look like the board".to_owned()));
}

#[test]
fn auto_takes_a_maestro_for_a_script_for_one_and_for_no_other() {
    use BoardLikelihood::{Maybe, No};
    let maestro = |path: &str, family: &str| {
        let mut port = port(path, No, None);
        port.family = Some(family.to_owned());
        port
    };
    let on = |line: &'static str, ports: &[PortInfo]| {
        let board = Board { line: line.into(), ..Board::clone(&raspblock::board()) };
        choose(ports.to_vec(), &board).map_err(|refused| refused.to_string())
    };
    let small = maestro("/dev/ttyACM0", "maestro 6");
    let large = maestro("/dev/ttyACM2", "maestro 24");
    let (ttl, usb) = (port("/dev/ttyACM1", No, None), port("/dev/ttyUSB0", Maybe, None));
    let all = [small.clone(), ttl.clone(), large.clone(), usb.clone()];
    let taken = |path: &str| Ok(PathBuf::from(path));
    assert_eq!(on("maestro 24 device 7 crc on", &all), taken("/dev/ttyACM2"));
    assert_eq!(on("maestro 6", &all), taken("/dev/ttyACM0"));
    assert_eq!(on("maestro 12", &[small.clone(), ttl.clone(), usb]), taken("/dev/ttyACM0"));
    let several = Err("`--port auto`: several ports look like the board".to_owned());
    assert_eq!((on("maestro 12", &all), on("raspblock", &all)), (several, taken("/dev/ttyUSB0")));
    assert_eq!(on("\"robot.toml\"", &all), taken("/dev/ttyUSB0"));
    let none = Err("`--port auto`: no port looks like the board".to_owned());
    assert_eq!((on("raspblock", &[small, ttl.clone()]), on("maestro 6", &[ttl])), (none.clone(), none));
    assert_eq!(help(&[large]), None);
}

#[test]
fn help_is_shown_only_if_no_port_looks_like_the_board() {
    assert!(help(&[]).unwrap().starts_with("no serial ports; "));
    let other = port("/dev/ttyS0", BoardLikelihood::No, None);
    assert!(help(std::slice::from_ref(&other)).unwrap().starts_with("none of these ports looks like the board; "));
    for likely in [BoardLikelihood::Board, BoardLikelihood::Maybe] {
        assert_eq!(help(&[other.clone(), port("/dev/tty1", likely, None)]), None);
    }
}

#[test]
fn auto_takes_no_adapter_if_the_system_uses_the_pins() {
    use BoardLikelihood::{Board, Maybe};
    let usb = port("/dev/ttyUSB0", Maybe, None);
    let login = Obstacle::Login(motionseq::link::Owner { name: "agetty".to_owned(), process: 80 });
    for (obstacle, why) in [
        (Obstacle::Console, "the console of the system; on a Raspberry Pi, disable it"),
        (login, "a login prompt is there, agetty (process 80)"),
        (Obstacle::Bluetooth, "connected to the Bluetooth chip"),
    ] {
        let pins = port("/dev/ttyS0", Board, Some(obstacle));
        for ports in [vec![pins.clone(), usb.clone()], vec![pins.clone()]] {
            let refused = choose(ports, &raspblock::board()).unwrap_err();
            let text = refused.to_string();
            assert!(
                text.starts_with("`--port auto`: /dev/ttyS0, the port on the pins: ") && text.contains(why),
                "{text}"
            );
            assert!(!refused.may_pass(), "`--wait` does not wait for it");
        }
        // Another port on pins is free.
        assert_eq!(chosen(&[pins, usb.clone(), port("/dev/ttyAMA0", Board, None)]), Ok(PathBuf::from("/dev/ttyAMA0")));
    }
}

#[test]
fn help_for_a_forbidden_port_says_what_else_is_in_the_way() {
    let group = Obstacle::Forbidden(Some("dialout".to_owned()));
    let help = forbidden(Some(&group), Some(&group));
    assert_eq!(help, "run `sudo usermod -aG dialout $USER`, then log out and log in again");
    let both = forbidden(Some(&group), Some(&Obstacle::Console));
    assert!(both.starts_with(&help) && both.contains("the console of the system"), "{both}");
    let both = forbidden(Some(&Obstacle::Forbidden(None)), Some(&Obstacle::Console));
    assert!(both.starts_with("only its owner may open it; a udev rule") && both.contains("the console"), "{both}");
    assert_eq!(forbidden(None, None), "you may not read the folder of the port");
}
