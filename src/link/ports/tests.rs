//! Ports of computers that are folders of files.

use std::os::unix::fs::symlink;

use super::*;

/// A computer in a temporary folder, removed at the end.
struct Files(PathBuf);

impl Files {
    fn new(name: &str) -> Self {
        let root = std::env::temp_dir().join(format!("motionseq-ports-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(root.join("sys/class/tty")).unwrap();
        fs::create_dir_all(root.join("proc")).unwrap();
        Files(root)
    }

    fn file(self, path: &str, text: &str) -> Self {
        let path = self.0.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
        self
    }

    fn link(self, path: &str, target: &str) -> Self {
        let path = self.0.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        symlink(target, path).unwrap();
        self
    }

    /// A terminal whose device is of a subsystem; the folders of its device may come before its name.
    fn port(self, device: &str, subsystem: &str) -> Self {
        let name = device.rsplit('/').next().unwrap();
        let device = format!("sys/devices/{device}");
        fs::create_dir_all(self.0.join(&device)).unwrap();
        self.link(&format!("{device}/subsystem"), &format!("../../bus/{subsystem}"))
            .link(&format!("sys/class/tty/{name}/device"), &format!("../../../{}", device.trim_start_matches("sys/")))
            .file(&format!("dev/{name}"), "")
    }

    /// A Raspberry Pi with its first and second port.
    fn raspberry_pi(name: &str, model: &str, ports: [&str; 2]) -> Self {
        let [first, second] = ports;
        Files::new(name)
            .file("proc/device-tree/model", &format!("Raspberry Pi {model}\0"))
            .link("dev/serial0", first)
            .link("dev/serial1", second)
    }

    fn ports(&self) -> Vec<PortInfo> {
        Computer::at(&self.0).ports().unwrap()
    }

    fn one(&self, path: &str) -> PortInfo {
        self.ports().into_iter().find(|port| port.path == Path::new(path)).unwrap()
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn the_full_uart_of_a_stock_raspberry_pi_is_bluetooth_and_its_first_port_is_on_the_pins() {
    let pi = Files::raspberry_pi("pi4", "4 Model B Rev 1.4", ["ttyS0", "ttyAMA0"]);
    let pi = pi.port("ttyAMA0", "amba").port("ttyS0", "platform");
    let bluetooth = pi.one("/dev/ttyAMA0");
    assert_eq!((bluetooth.likely, bluetooth.obstacle), (BoardLikelihood::No, Some(Obstacle::Bluetooth)));
    assert_eq!(bluetooth.names, [PathBuf::from("/dev/serial1")]);
    let pins = pi.one("/dev/ttyS0");
    assert_eq!((pins.likely, pins.obstacle), (BoardLikelihood::Board, None));
    assert_eq!(pins.description, "serial port on the GPIO pins (mini UART)");
    assert_eq!(pins.names, [PathBuf::from("/dev/serial0")]);
}

#[test]
fn without_the_links_of_raspberry_pi_os_the_device_tree_says_where_bluetooth_is() {
    let uart = "/soc/serial@7e201000\0";
    let pi = Files::new("no-links").file("proc/device-tree/model", "Raspberry Pi Zero 2 W Rev 1.0\0");
    let pi = pi.file("proc/device-tree/aliases/uart0", uart).file("proc/device-tree/aliases/serial1", uart);
    assert_eq!(pi.port("ttyAMA0", "amba").one("/dev/ttyAMA0").obstacle, Some(Obstacle::Bluetooth));
}

#[test]
fn with_bluetooth_disabled_or_moved_the_full_uart_is_on_the_pins() {
    let pi = Files::raspberry_pi("disabled", "3 Model B Plus Rev 1.3", ["ttyAMA0", "ttyS0"]);
    let pi = pi.port("ttyAMA0", "serial-base").port("ttyS0", "platform");
    let pins = pi.one("/dev/ttyAMA0");
    assert_eq!((pins.likely, pins.obstacle), (BoardLikelihood::Board, None));
    assert_eq!(pi.one("/dev/ttyS0").likely, BoardLikelihood::No);
    let second = "/soc/serial@7e215040";
    let pi = pi.file("proc/device-tree/aliases/serial1", &format!("{second}\0"));
    let pi = pi.file(&format!("proc/device-tree{second}/bluetooth/compatible"), "brcm,bcm43438-bt\0");
    assert_eq!(pi.one("/dev/ttyS0").obstacle, Some(Obstacle::Bluetooth));
    let pi = pi.file(&format!("proc/device-tree{second}/bluetooth/status"), "disabled\0");
    assert_eq!(pi.one("/dev/ttyS0").obstacle, None);
}

#[test]
fn the_first_port_of_a_raspberry_pi_5_is_its_debug_connector() {
    let pi = Files::raspberry_pi("pi5", "5 Model B Rev 1.0", ["ttyAMA10", "ttyAMA1"]);
    let pi = pi.port("ttyAMA0", "amba").port("ttyAMA10", "amba");
    assert_eq!(pi.one("/dev/ttyAMA10").likely, BoardLikelihood::No);
    assert_eq!(pi.one("/dev/ttyAMA0").likely, BoardLikelihood::Board);
}

#[test]
fn an_adapter_says_what_it_is_and_has_a_name_that_stays() {
    let name = "usb-1a86_USB_Serial-if00-port0";
    let pc = Files::new("usb")
        .port("ttyUSB0", "usb-serial")
        .file("sys/devices/idVendor", "1a86\n")
        .file("sys/devices/idProduct", "7523\n")
        .file("sys/devices/product", "USB Serial\n")
        .link(&format!("dev/serial/by-id/{name}"), "../../ttyUSB0")
        .link("dev/robot", "ttyUSB0")
        // The other ports of the driver of a PC do not exist; a virtual console has no device.
        .port("ttyS3", "serial-base")
        .file("sys/class/tty/ttyS3/type", "0\n")
        .file("sys/class/tty/tty1/dev", "4:1\n");
    let [adapter] = &pc.ports()[..] else { panic!("{:?}", pc.ports()) };
    assert_eq!(adapter.description, "USB 1a86:7523 USB Serial");
    assert_eq!(adapter.likely, BoardLikelihood::Maybe);
    assert_eq!(adapter.names, [PathBuf::from("/dev/robot"), PathBuf::from(format!("/dev/serial/by-id/{name}"))]);
}

#[test]
fn a_maestro_has_a_port_for_commands_and_one_for_its_pins() {
    let maestro = |product: &str| {
        Files::new(&format!("maestro-{product}"))
            .port("1-1/ttyACM0", "usb")
            .port("1-1/ttyACM1", "usb")
            .file("sys/devices/1-1/idVendor", "1ffb\n")
            .file("sys/devices/1-1/idProduct", &format!("{product}\n"))
            .file("sys/devices/1-1/ttyACM0/bInterfaceNumber", "02\n")
            .file("sys/devices/1-1/ttyACM1/bInterfaceNumber", "00\n")
    };
    for (product, channels) in [("0089", 6), ("008a", 12), ("008b", 18), ("008c", 24)] {
        let pc = maestro(product);
        let [ttl, commands] = &pc.ports()[..] else { panic!("{:?}", pc.ports()) };
        assert_eq!(commands.description, format!("Pololu Maestro {channels}, Command Port"));
        assert_eq!(
            (commands.family.clone(), commands.likely),
            (Some(format!("maestro {channels}")), BoardLikelihood::No)
        );
        assert_eq!(ttl.description, format!("Pololu Maestro {channels}, TTL Port"));
        assert_eq!((&ttl.family, ttl.likely), (&None, BoardLikelihood::No));
    }
    let pc = maestro("0088");
    let other = pc.one("/dev/ttyACM1");
    assert_eq!((other.family, other.likely), (None, BoardLikelihood::Maybe));
    assert_eq!(other.description, "USB 1ffb:0088 serial adapter");
}

#[test]
fn a_port_says_which_program_uses_it() {
    let pc = Files::new("owners").port("ttyUSB0", "usb-serial").port("ttyUSB1", "usb-serial").port("ttyUSB2", "usb");
    let of_file = fs::metadata(pc.0.join("dev/ttyUSB1")).unwrap();
    let (major, minor) = (rustix::fs::major(of_file.dev()), rustix::fs::minor(of_file.dev()));
    let lock = format!("1: FLOCK  ADVISORY  WRITE 71 {major:02x}:{minor:02x}:{} 0 EOF\n", of_file.ino());
    let pc = pc
        .file("proc/70/comm", "python3\n")
        .link("proc/70/fd/3", "/dev/ttyUSB0")
        .file("proc/71/comm", "minicom\n")
        .file("proc/locks", &lock)
        .file("proc/72/comm", "kermit\n")
        .file("run/lock/LCK..ttyUSB2", "        72\n");
    let uses = |name: &str, process| Some(Obstacle::InUse(Some(Owner { name: name.into(), process })));
    assert_eq!(pc.one("/dev/ttyUSB0").obstacle, uses("python3", 70));
    assert_eq!(pc.one("/dev/ttyUSB1").obstacle, uses("minicom", 71));
    assert_eq!(pc.one("/dev/ttyUSB2").obstacle, uses("kermit", 72));
    // It was killed, and left its lock file.
    fs::remove_dir_all(pc.0.join("proc/72")).unwrap();
    assert_eq!(pc.one("/dev/ttyUSB2").obstacle, None);
}

#[test]
fn a_console_and_a_login_prompt_are_obstacles() {
    let pi = Files::raspberry_pi("console", "4 Model B Rev 1.4", ["ttyS0", "ttyAMA0"]).port("ttyS0", "platform");
    let pi = pi
        .file("proc/consoles", "ttyS0                -W- (EC p a)    4:64\ntty0                 -WU (E  p  )    4:1\n");
    assert_eq!(pi.one("/dev/ttyS0").obstacle, Some(Obstacle::Console));
    let pi = pi.file("proc/80/comm", "agetty\n").link("proc/80/fd/0", "/dev/ttyS0");
    let login = Owner { name: "agetty".into(), process: 80 };
    assert_eq!(pi.one("/dev/ttyS0").obstacle, Some(Obstacle::Login(login)));
}
