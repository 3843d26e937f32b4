//! The servos of a virtual bus: their registers, how they move, and what they answer on a line of one wire.

use super::{ServoFault, ServoSetup};
use crate::board::sts::{self, BROADCAST, Packet, instruction, register};
use crate::units::{Micros, Nanos, byte_time};

/// How long a servo waits before its answer, and how much longer a late one takes.
const DELAY: Micros = Micros(500);
const LATE: Micros = Micros::from_millis(40);
/// The highest speed of a servo, that of a slow one, and that of one that falls, in steps per second.
const SPEED: f64 = 3_000.0;
const SLOW: f64 = 100.0;
const FALL: f64 = 1_000.0;
/// The steps of a turn, and the center of it.
const TURN: f64 = 4_096.0;
const CENTER: f64 = 2_048.0;
/// The position that a lost servo reports.
const NOWHERE: u16 = 5_000;
/// The error bit for too much load.
const OVERLOAD: u8 = 1 << 5;

/// The number of registers.
const COUNT: usize = 87;
/// More registers, by their addresses.
const ID: u8 = 5;
const LEAST: u8 = 9;
const MOST: u8 = 11;
const OFFSET: u8 = 31;
const PRESENT_SPEED: u8 = 58;
const MOVING: u8 = 66;
/// What a new servo contains besides zeros: a model, a version, limits. The voltage is 7.4 V.
const DEFAULTS: [(u8, &[u8]); 12] = [
    (0, &[3, 7]),
    (3, &[9, 3]),
    (8, &[1]),
    (MOST, &[0xFF, 0x0F, 70, 80, 40, 0xE8, 0x03, 12, 44, 47, 32, 32]),
    (24, &[16, 0, 1, 1, 0xF4, 0x01, 1]),
    (34, &[20, 200, 80, 10, 200, 10]),
    (48, &[0xE8, 0x03]),
    (register::VOLTAGE, &[74, 30]),
    (80, &[2, 2, 50]),
    (84, &[254]),
    (85, &[254]),
    (86, &[10]),
];

/// Reads `3:silent`, a servo and what is wrong with it; a number is its position at the start.
pub fn servo_fault(text: &str) -> Option<(u8, ServoFault)> {
    let (id, fault) = text.split_once(':')?;
    let fault = match fault {
        "silent" => ServoFault::Silent,
        "twice" => ServoFault::Twice,
        "other" => ServoFault::Other,
        "sum" => ServoFault::Sum,
        "late" => ServoFault::Late,
        "wheel" => ServoFault::Wheel,
        "lost" => ServoFault::Lost,
        "error" => ServoFault::Error,
        "slow" => ServoFault::Slow,
        position => ServoFault::At(position.parse().ok().filter(|position| f64::from(*position) < TURN)?),
    };
    Some((id.parse().ok().filter(|id| *id < BROADCAST)?, fault))
}

/// The servos, and their answers on the line.
#[derive(Clone, Debug)]
pub(super) struct Servos {
    on_bus: Vec<Servo>,
    answers: Vec<LineAnswer>,
    byte_time: Nanos,
}

/// An answer, and when the line carries it.
#[derive(Clone, Debug)]
struct LineAnswer {
    begins: Micros,
    ends: Micros,
    bytes: Vec<u8>,
}

/// A servo.
#[derive(Clone, Debug)]
struct Servo {
    registers: [u8; COUNT],
    /// Where it is, in steps.
    position: f64,
    /// Whether its target was written since it has had torque. Until then, the target is where it is.
    has_goal: bool,
    falls: bool,
    /// What it writes at the next action.
    later: Option<(u8, Vec<u8>)>,
    faults: Vec<ServoFault>,
}

impl Servos {
    pub(super) fn new(setups: impl IntoIterator<Item = ServoSetup>, baud: u32) -> Self {
        let on_bus = setups.into_iter().map(Servo::new).collect();
        Servos { on_bus, answers: Vec::new(), byte_time: byte_time(baud) }
    }

    /// Gives a servo a fault, if it is on the bus.
    pub(super) fn set_fault(&mut self, id: u8, fault: ServoFault) {
        for servo in self.on_bus.iter_mut().filter(|servo| servo.id() == id) {
            match fault {
                ServoFault::Wheel => servo.set(register::MODE, &[1]),
                ServoFault::At(position) => servo.position = position.into(),
                _ => servo.faults.push(fault),
            }
        }
    }

    /// Advances the time.
    pub(super) fn pass(&mut self, seconds: f64) {
        self.on_bus.iter_mut().for_each(|servo| servo.pass(seconds));
    }

    /// Whether an answer is on the line, so that nothing else arrives.
    pub(super) fn is_talking(&self, now: Micros) -> bool {
        self.answers.iter().any(|answer| (answer.begins..answer.ends).contains(&now))
    }

    /// When the next answer is complete.
    pub(super) fn next_due(&self) -> Option<Micros> {
        self.answers.iter().map(|answer| answer.ends).min()
    }

    /// Takes the answers that are complete.
    pub(super) fn said(&mut self, now: Micros) -> impl Iterator<Item = Vec<u8>> + use<> {
        let done: Vec<LineAnswer> = self.answers.extract_if(.., |answer| answer.ends <= now).collect();
        done.into_iter().map(|answer| answer.bytes)
    }

    /// Takes a packet; adds the numbers of servos that fall to `fell`.
    pub(super) fn take(&mut self, now: Micros, frame: &[u8], fell: &mut Vec<u8>) {
        let Some(Packet { id, instruction, parameters }) = sts::packet(frame) else { return };
        let mut begins = now + DELAY;
        match (instruction, parameters) {
            (instruction::SYNC_READ, [address, count, ids @ ..]) => {
                for id in ids {
                    let found = self.on_bus.iter().find(|servo| servo.id() == *id);
                    let said = found.map(|servo| (servo.answers(*id, &servo.read(*address, *count)), servo.delay()));
                    begins = said.map_or(begins, |(said, delay)| self.say(begins + delay, said));
                }
            }
            (instruction::SYNC_WRITE, [address, size, all @ ..]) => {
                for (id, data) in all.chunks(usize::from(*size) + 1).filter_map(<[u8]>::split_first) {
                    let found = self.on_bus.iter_mut().filter(|servo| servo.id() == *id);
                    found.for_each(|servo| servo.write(*address, data, fell));
                }
            }
            _ => {
                for at in 0..self.on_bus.len() {
                    let Some(servo) = self.on_bus.get_mut(at) else { break };
                    // A servo that gets another number answers with the old one.
                    let own = servo.id();
                    if own != id && id != BROADCAST {
                        continue;
                    }
                    let bytes = servo.obey(instruction, parameters, fell);
                    if id != BROADCAST || instruction == instruction::PING {
                        let (said, delay) = (servo.answers(own, &bytes), servo.delay());
                        begins = self.say(begins + delay, said);
                    }
                }
            }
        }
    }

    /// Puts answers on the line; returns when the last of them ends.
    fn say(&mut self, begins: Micros, said: Vec<Vec<u8>>) -> Micros {
        let mut free = begins;
        for bytes in said {
            let ends = (free.nanos() + self.byte_time * bytes.len() as u64).micros_up();
            self.answers.push(LineAnswer { begins: free, ends, bytes });
            free = ends;
        }
        free
    }
}

impl Servo {
    fn new(setup: ServoSetup) -> Self {
        let ServoSetup { id, position, mode } = setup;
        let mut servo = Servo {
            registers: [0; COUNT],
            position: position.into(),
            has_goal: false,
            falls: false,
            later: None,
            faults: Vec::new(),
        };
        for (address, bytes) in DEFAULTS {
            servo.set(address, bytes);
        }
        servo.set(ID, &[id]);
        servo.set(register::MODE, &[mode]);
        servo
    }

    fn has(&self, fault: ServoFault) -> bool {
        self.faults.contains(&fault)
    }

    fn id(&self) -> u8 {
        self.byte(ID)
    }

    fn byte(&self, address: u8) -> u8 {
        self.registers.get(usize::from(address)).copied().unwrap_or_default()
    }

    /// Two registers, whose bit `sign` is the sign.
    fn number(&self, address: u8, sign: u16) -> f64 {
        let bits = u16::from_le_bytes([self.byte(address), self.byte(address.saturating_add(1))]);
        let size = f64::from(bits & (sign - 1));
        if bits & sign == 0 { size } else { -size }
    }

    fn set(&mut self, address: u8, bytes: &[u8]) {
        self.registers.iter_mut().skip(address.into()).zip(bytes).for_each(|(register, byte)| *register = *byte);
    }

    fn set_number(&mut self, address: u8, value: f64) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "15 bits and a sign")]
        let size = libm::round(value.abs()).min(32_767.0) as u16;
        self.set(address, &(size | if value < 0.0 { 0x8000 } else { 0 }).to_le_bytes());
    }

    fn has_torque(&self) -> bool {
        self.byte(register::TORQUE) != 0
    }

    fn least(&self) -> f64 {
        self.number(LEAST, 1 << 15)
    }

    /// Where it is going, and how fast. Without torque it falls to its lowest position, or stays.
    fn way(&self) -> (f64, f64) {
        let speed = self.number(register::SPEED, 1 << 15);
        match self.byte(register::MODE) {
            0 if self.has_torque() => {
                let (least, most) = (self.least(), self.number(MOST, 1 << 15));
                let goal = self.number(register::GOAL, 1 << 15);
                let goal = if least < most { goal.clamp(least, most) } else { goal };
                let speed = if self.has(ServoFault::Slow) { SLOW } else { speed.abs() };
                (goal, if speed == 0.0 { SPEED } else { speed.min(SPEED) })
            }
            1 if self.has_torque() => (f64::INFINITY.copysign(speed), speed.abs().min(SPEED)),
            _ if self.falls => (self.least(), FALL),
            _ => (self.position, 0.0),
        }
    }

    fn velocity(&self) -> f64 {
        let (goal, speed) = self.way();
        if goal == self.position { 0.0 } else { speed.copysign(goal - self.position) }
    }

    fn pass(&mut self, seconds: f64) {
        let (goal, speed) = self.way();
        let way = goal - self.position;
        self.position =
            if way.abs() <= speed * seconds { goal } else { self.position + (speed * seconds).copysign(way) };
        if goal.is_infinite() {
            self.position -= TURN * libm::floor(self.position / TURN);
        }
        self.falls &= self.position > self.least();
    }

    /// Carries out an instruction; gives the registers that it asks for.
    fn obey(&mut self, instruction: u8, parameters: &[u8], fell: &mut Vec<u8>) -> Vec<u8> {
        match (instruction, parameters) {
            (instruction::READ, &[address, count]) => return self.read(address, count),
            (instruction::WRITE, [address, data @ ..]) => self.write(*address, data, fell),
            (instruction::LATER, [address, data @ ..]) => self.later = Some((*address, data.to_vec())),
            (instruction::ACTION, _) => {
                if let Some((address, data)) = self.later.take() {
                    self.write(address, &data, fell);
                }
            }
            _ => {}
        }
        Vec::new()
    }

    fn read(&self, address: u8, count: u8) -> Vec<u8> {
        let mut now = self.clone();
        let velocity = self.velocity();
        let position = if self.has(ServoFault::Lost) { NOWHERE.into() } else { self.position };
        now.set_number(register::POSITION, position);
        now.set_number(PRESENT_SPEED, velocity);
        now.set(MOVING, &[u8::from(velocity != 0.0)]);
        if !self.has_torque() && !self.has_goal {
            now.set_number(register::GOAL, self.position);
        }
        (0..count).map(|more| now.byte(address.saturating_add(more))).collect()
    }

    /// Writes registers, of which some cannot be written.
    fn write(&mut self, address: u8, data: &[u8], fell: &mut Vec<u8>) {
        let (torque, offset) = (self.byte(register::TORQUE), self.number(OFFSET, 1 << 11));
        for (address, byte) in (address..=u8::MAX).zip(data) {
            if address >= ID && !(register::POSITION..80).contains(&address) {
                self.set(address, &[*byte]);
            }
            self.has_goal |= (register::GOAL..register::GOAL + 2).contains(&address);
        }
        self.position += offset - self.number(OFFSET, 1 << 11);
        if self.byte(register::TORQUE) == 128 {
            self.position = CENTER;
            self.set(register::TORQUE, &[torque]);
        }
        match (torque != 0, self.has_torque()) {
            (false, true) => {
                self.falls = false;
                if !self.has_goal {
                    self.set_number(register::GOAL, self.position);
                }
            }
            (true, false) => {
                self.has_goal = false;
                self.falls = self.byte(register::MODE) != 1 && self.position > self.least();
                if self.falls && !fell.contains(&self.id()) {
                    fell.push(self.id());
                    fell.sort_unstable();
                }
            }
            _ => {}
        }
    }

    /// How much later than others it answers.
    fn delay(&self) -> Micros {
        if self.has(ServoFault::Late) { LATE } else { Micros::ZERO }
    }

    /// What it answers: nothing, or an answer once or twice.
    fn answers(&self, id: u8, bytes: &[u8]) -> Vec<Vec<u8>> {
        let id = if self.has(ServoFault::Other) { (id + 1) % BROADCAST } else { id };
        let errors = if self.has(ServoFault::Error) { OVERLOAD } else { 0 };
        let mut answer = Vec::new();
        sts::emit_answer(&mut answer, id, errors, bytes);
        if let Some(sum) = answer.last_mut().filter(|_| self.has(ServoFault::Sum)) {
            *sum = !*sum;
        }
        let count = if self.has(ServoFault::Silent) { 0 } else { 1 + usize::from(self.has(ServoFault::Twice)) };
        vec![answer; count]
    }
}
