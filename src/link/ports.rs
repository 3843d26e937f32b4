//! The serial ports of this computer, and what they are, without opening one: that alone could disturb a program or a board.
//!
//! Everything is read below a root folder, so that tests use the files of other computers.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use rustix::fs::Access;

/// A serial port of this computer.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortInfo {
    /// The path of the device.
    pub path: PathBuf,
    /// Other names of it that do not change, such as `/dev/serial0` and those in `/dev/serial/by-id`, sorted.
    pub names: Vec<PathBuf>,
    /// A description for people.
    pub description: String,
    /// Whether it looks like the board.
    pub likely: BoardLikelihood,
    /// What a script writes after `board`, if the port says by itself which board it is:
    /// `maestro 12`.
    pub family: Option<String>,
    /// Why it cannot be used now, if that is known.
    pub obstacle: Option<Obstacle>,
    /// What [`permission`] says, which also counts if there is another obstacle.
    pub permission: Option<Obstacle>,
}

impl PortInfo {
    /// A port without other names and without a description.
    pub fn new(path: impl Into<PathBuf>, likely: BoardLikelihood, obstacle: Option<Obstacle>) -> Self {
        PortInfo {
            path: path.into(),
            names: Vec::new(),
            description: String::new(),
            likely,
            family: None,
            obstacle,
            permission: None,
        }
    }
}

/// Whether a port looks like the board, without opening it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BoardLikelihood {
    /// It is the serial port on the pins of a Raspberry Pi, where the board is plugged on.
    Board,
    /// It is a USB adapter.
    Maybe,
    /// Neither.
    No,
}

/// Why a port cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Obstacle {
    /// The Bluetooth chip of a Raspberry Pi is connected to it.
    Bluetooth,
    /// The messages of the kernel go there.
    Console,
    /// A login prompt is there; its program.
    Login(Owner),
    /// Another program uses it; unknown if only a lock shows that.
    InUse(Option<Owner>),
    /// This user may not open it; the group that may, if there is one.
    Forbidden(Option<String>),
}

/// A program that has a port open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner {
    /// Its name.
    pub name: String,
    /// The number of its process.
    pub process: u32,
}

/// How to free a port of the system.
const NO_LOGIN: &str =
    "on a Raspberry Pi, disable it with `sudo raspi-config` (Interface Options, Serial Port: login shell no)";

/// `python3 (process 1234)`.
impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (process {})", self.name, self.process)
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Obstacle::Bluetooth => f.write_str("connected to the Bluetooth chip, not to the pins"),
            Obstacle::Console => write!(f, "the console of the system; {NO_LOGIN}"),
            Obstacle::Login(owner) => write!(f, "a login prompt is there, {owner}; {NO_LOGIN}"),
            Obstacle::InUse(Some(owner)) => write!(f, "in use by {owner}"),
            Obstacle::InUse(None) => f.write_str("in use"),
            Obstacle::Forbidden(Some(group)) => {
                write!(f, "permission denied: run `sudo usermod -aG {group} $USER`, then log out and log in again")
            }
            Obstacle::Forbidden(None) => f.write_str("permission denied: only its owner may open it; a udev rule with GROUP=\"dialout\", MODE=\"0660\" permits it for that group"),
        }
    }
}

/// The serial ports of this computer, sorted by path.
///
/// # Errors
/// If the system does not list its terminals.
pub fn ports() -> io::Result<Vec<PortInfo>> {
    Computer::at(Path::new("/")).ports()
}

/// The serial port at a path; `None` for anything else, such as a pty.
pub fn port_at(path: &Path) -> Option<PortInfo> {
    Computer::at(Path::new("/")).port(path.canonicalize().ok()?.strip_prefix("/dev").ok()?.to_str()?)
}

/// Why a port at a path cannot be used now, if that is known.
pub fn obstacle(path: &Path) -> Option<Obstacle> {
    Computer::at(Path::new("/")).obstacle(&path.canonicalize().ok()?)
}

/// Whether this user may not open a port at a path: [`Obstacle::Forbidden`], with what to do.
pub fn permission(path: &Path) -> Option<Obstacle> {
    Computer::at(Path::new("/")).permission(&path.canonicalize().ok()?)
}

/// A computer whose files are below a folder.
struct Computer {
    root: PathBuf,
    /// Links in `/dev` to devices: each device and its other names.
    names: BTreeMap<PathBuf, Vec<PathBuf>>,
}

/// The kinds of devices that are serial ports, by their subsystem. A virtual console has no device.
const SUBSYSTEMS: [&str; 7] = ["amba", "pci", "platform", "pnp", "serial-base", "usb", "usb-serial"];
/// The USB number of Pololu, and of its servo controllers with their channels. The first of their two
/// serial ports takes commands, the other passes bytes to the pins.
const POLOLU: &str = "1ffb";
const MAESTROS: [(&str, u8); 4] = [("0089", 6), ("008a", 12), ("008b", 18), ("008c", 24)];
/// Folders with links to devices.
const LINKS: [&str; 2] = ["dev", "dev/serial/by-id"];
/// Programs that show a login prompt.
const LOGINS: [&str; 3] = ["agetty", "getty", "login"];

impl Computer {
    fn at(root: &Path) -> Self {
        let mut names: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
        for folder in LINKS {
            for entry in fs::read_dir(root.join(folder)).into_iter().flatten().flatten() {
                let name = Path::new("/").join(folder).join(entry.file_name());
                let Ok(target) = entry.path().read_link() else { continue };
                names.entry(resolved(&Path::new("/").join(folder), &target)).or_default().push(name);
            }
        }
        for names in names.values_mut() {
            names.sort();
        }
        Computer { root: root.to_owned(), names }
    }

    /// A file of this computer; its path there is absolute.
    fn file(&self, path: impl AsRef<Path>) -> PathBuf {
        let path = path.as_ref();
        self.root.join(path.strip_prefix("/").unwrap_or(path))
    }

    fn text(&self, path: impl AsRef<Path>) -> String {
        let bytes = fs::read(self.file(path)).unwrap_or_default();
        String::from_utf8_lossy(&bytes).trim_end_matches(['\0', '\n']).to_owned()
    }

    fn ports(&self) -> io::Result<Vec<PortInfo>> {
        let mut ports = Vec::new();
        for entry in fs::read_dir(self.file("sys/class/tty"))? {
            let name = entry?.file_name();
            ports.extend(name.to_str().and_then(|name| self.port(name)));
        }
        ports.sort_by(|one, other| one.path.cmp(&other.path));
        Ok(ports)
    }

    /// A terminal, if it is a serial port.
    fn port(&self, name: &str) -> Option<PortInfo> {
        let terminal = Path::new("/sys/class/tty").join(name);
        let subsystem = self.file(terminal.join("device/subsystem")).read_link().ok()?;
        let subsystem = subsystem.file_name()?.to_str()?.to_owned();
        // The driver of the ports of a PC also lists ports that do not exist: of type 0.
        if !SUBSYSTEMS.contains(&subsystem.as_str()) || self.text(terminal.join("type")) == "0" {
            return None;
        }
        let path = Path::new("/dev").join(name);
        if !self.file(&path).exists() {
            return None;
        }
        let maestro = self.maestro(&terminal);
        let family = maestro.as_ref().and_then(|(_, family)| family.clone());
        let (description, likely) = match subsystem.as_str() {
            _ if let Some((description, _)) = maestro => (description, BoardLikelihood::No),
            "usb" | "usb-serial" => (self.usb(&terminal), BoardLikelihood::Maybe),
            _ if self.is_of_bluetooth(&path) => ("serial port of the Bluetooth chip".into(), BoardLikelihood::No),
            _ => self.on_board(&path),
        };
        let names = self.names.get(&path).cloned().unwrap_or_default();
        let (obstacle, permission) = (self.obstacle(&path), self.permission(&path));
        Some(PortInfo { path, names, description, likely, family, obstacle, permission })
    }

    /// A USB adapter, by what it says of itself.
    fn usb(&self, terminal: &Path) -> String {
        let says = |file: &str| self.usb_says(terminal, "idVendor", file);
        let name = says("product").or_else(|| says("manufacturer")).unwrap_or_else(|| "serial adapter".into());
        match (says("idVendor"), says("idProduct")) {
            (Some(vendor), Some(product)) => format!("USB {vendor}:{product} {name}"),
            _ => format!("USB {name}"),
        }
    }

    /// A file of the first folder at or above the device of a terminal that contains the file `beside`.
    fn usb_says(&self, terminal: &Path, beside: &str, file: &str) -> Option<String> {
        let device = self.file(terminal.join("device")).canonicalize().ok()?;
        let above = device.ancestors().take(4).find(|folder| folder.join(beside).exists())?;
        let text = fs::read_to_string(above.join(file)).ok()?.trim().to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// A port of a Pololu Maestro: what it is and, for the port that takes commands, its family.
    fn maestro(&self, terminal: &Path) -> Option<(String, Option<String>)> {
        let says = |file: &str| self.usb_says(terminal, "idVendor", file);
        let product = says("idProduct").filter(|_| says("idVendor").as_deref() == Some(POLOLU))?;
        let (_, channels) = MAESTROS.iter().find(|(id, _)| *id == product)?;
        let interface = self.usb_says(terminal, "bInterfaceNumber", "bInterfaceNumber");
        let number = interface.and_then(|number| u8::from_str_radix(&number, 16).ok());
        let (port, is_command_port) = match number {
            None => ("", false),
            Some(0) => (", Command Port", true),
            Some(_) => (", TTL Port", false),
        };
        let family = is_command_port.then(|| format!("maestro {channels}"));
        Some((format!("Pololu Maestro {channels}{port}"), family))
    }

    /// A port of the computer itself.
    fn on_board(&self, path: &Path) -> (String, BoardLikelihood) {
        if !self.is_raspberry_pi() {
            return ("serial port".into(), BoardLikelihood::No);
        }
        // A Raspberry Pi 5 has another connector for a debugger, and that is its first port.
        if path.ends_with("ttyAMA10") {
            return ("serial port on the debug connector".into(), BoardLikelihood::No);
        }
        let is_first = self.is_named(path, "/dev/serial0") || path.ends_with("ttyAMA0");
        match (is_first, path.ends_with("ttyS0")) {
            (true, true) => ("serial port on the GPIO pins (mini UART)".into(), BoardLikelihood::Board),
            (true, false) => ("serial port on the GPIO pins".into(), BoardLikelihood::Board),
            (false, _) => ("serial port".into(), BoardLikelihood::No),
        }
    }

    fn is_raspberry_pi(&self) -> bool {
        self.text("proc/device-tree/model").starts_with("Raspberry Pi")
    }

    fn is_named(&self, path: &Path, name: &str) -> bool {
        self.names.get(path).is_some_and(|names| names.iter().any(|other| other == Path::new(name)))
    }

    /// Whether the Bluetooth chip of a Raspberry Pi is at a port. The firmware makes the port of the pins its first one, and swaps
    /// the two if there is a Bluetooth chip: then the full UART is the second one.
    fn is_of_bluetooth(&self, path: &Path) -> bool {
        if !self.is_raspberry_pi() || self.is_named(path, "/dev/serial0") {
            return false;
        }
        let second = self.text("proc/device-tree/aliases/serial1");
        let uart = self.text("proc/device-tree/aliases/uart0");
        let is_second = self.is_named(path, "/dev/serial1");
        if path.ends_with("ttyAMA0") {
            return is_second || (!second.is_empty() && second == uart);
        }
        // The mini UART, if the two were swapped back: it has a chip only if its node has one.
        let chip = self.file("proc/device-tree").join(second.trim_start_matches('/')).join("bluetooth");
        is_second
            && !second.is_empty()
            && chip.exists()
            && !fs::read(chip.join("status")).is_ok_and(|on| on.starts_with(b"disabled"))
    }

    /// Why a device cannot be used now, if that is known.
    fn obstacle(&self, path: &Path) -> Option<Obstacle> {
        if self.is_of_bluetooth(path) {
            return Some(Obstacle::Bluetooth);
        }
        let user = self.user(path);
        if matches!(user, Some(Obstacle::Login(_))) {
            return user;
        }
        if self.is_console(path) {
            return Some(Obstacle::Console);
        }
        self.permission(path).or(user)
    }

    /// Whether this user may not open a device.
    fn permission(&self, path: &Path) -> Option<Obstacle> {
        match rustix::fs::access(self.file(path), Access::READ_OK | Access::WRITE_OK) {
            Err(rustix::io::Errno::ACCESS | rustix::io::Errno::PERM) => Some(Obstacle::Forbidden(self.group(path))),
            _ => None,
        }
    }

    /// Whether the messages of the kernel go to a device.
    fn is_console(&self, path: &Path) -> bool {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return false };
        let consoles = self.text("proc/consoles");
        consoles.lines().any(|line| line.split_ascii_whitespace().next() == Some(name))
    }

    /// The program that uses a device, if there is one.
    fn user(&self, path: &Path) -> Option<Obstacle> {
        let own = std::process::id();
        let process = self.opener(path, own).or_else(|| self.locker(path, own));
        let by_lock_file = || {
            // Of an older program, with the number of its process. A killed one may have left it.
            let name = path.file_name()?.to_str()?;
            let process = self.text(format!("run/lock/LCK..{name}")).trim().parse().ok()?;
            self.program(process).is_some().then_some(process)
        };
        match self.program(process.or_else(by_lock_file)?) {
            Some(owner) if LOGINS.contains(&owner.name.as_str()) => Some(Obstacle::Login(owner)),
            owner => Some(Obstacle::InUse(owner)),
        }
    }

    /// The process that has a device open. Those of other users are not seen, unless this is root.
    fn opener(&self, path: &Path, own: u32) -> Option<u32> {
        let processes = fs::read_dir(self.file("proc")).into_iter().flatten().flatten();
        let mut processes = processes.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        processes.find(|process| {
            let open = fs::read_dir(self.file(format!("proc/{process}/fd"))).into_iter().flatten().flatten();
            *process != own && open.filter_map(|entry| entry.path().read_link().ok()).any(|target| target == path)
        })
    }

    /// The process of any user that has locked a device.
    fn locker(&self, path: &Path, own: u32) -> Option<u32> {
        let of_file = fs::metadata(self.file(path)).ok()?;
        let (major, minor) = (rustix::fs::major(of_file.dev()), rustix::fs::minor(of_file.dev()));
        let file = format!("{major:02x}:{minor:02x}:{}", of_file.ino());
        // `1: FLOCK ADVISORY WRITE 1234 00:05:987 0 EOF`.
        let locks = self.text("proc/locks");
        let locks = locks.lines().map(|line| line.split_ascii_whitespace().collect::<Vec<_>>());
        let mut locks = locks.filter(|words| words.get(5) == Some(&file.as_str()));
        locks.find_map(|words| words.get(4)?.parse().ok()).filter(|process| *process != own)
    }

    fn program(&self, process: u32) -> Option<Owner> {
        let name = self.text(format!("proc/{process}/comm"));
        (!name.is_empty()).then_some(Owner { name, process })
    }

    /// The group that may open a device, unless it is that of root.
    fn group(&self, path: &Path) -> Option<String> {
        let of_file = fs::metadata(self.file(path)).ok()?;
        if of_file.mode() & 0o060 != 0o060 || of_file.gid() == 0 {
            return None;
        }
        self.text("etc/group").lines().find_map(|line| {
            let mut fields = line.split(':');
            let name = fields.next()?;
            (fields.nth(1)?.parse() == Ok(of_file.gid())).then(|| name.to_owned())
        })
    }
}

/// A link target, seen from the folder of the link, without the parts `..`.
fn resolved(folder: &Path, target: &Path) -> PathBuf {
    let mut path = PathBuf::new();
    for part in folder.join(target).components() {
        match part {
            std::path::Component::ParentDir => {
                path.pop();
            }
            part => path.push(part),
        }
    }
    path
}

#[cfg(test)]
mod tests;
