use super::*;

fn port(path: &str, likely: BoardLikelihood, obstacle: Option<Obstacle>) -> PortInfo {
    PortInfo::new(path, likely, obstacle)
}

fn chosen(ports: &[PortInfo]) -> Result<PathBuf, String> {
    choose(ports.to_vec()).map_err(|refused| refused.to_string())
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
    // A console is not.
    let console = port("/dev/ttyS0", Board, Some(Obstacle::Console));
    assert_eq!(chosen(&[console.clone(), usb.clone()]), Ok(PathBuf::from("/dev/ttyUSB0")));
    let none = Err("`--port auto`: no port looks like the board".to_owned());
    assert_eq!((chosen(&[]), chosen(&[other, console])), (none.clone(), none));
    let second = port("/dev/ttyUSB1", Maybe, None);
    assert_eq!(chosen(&[usb, second]), Err("`--port auto`: several ports look like the board".to_owned()));
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
