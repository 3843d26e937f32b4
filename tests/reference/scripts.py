"""Writes random motion scripts."""

from .evaluator import REQUESTS, evaluate
from .reader import Refused, Undecided
from .schedule import DRIVES, EASES


class Generator:
    """Writes a random script. Most are valid; the caller drops what the evaluator refuses."""

    def __init__(self, dice):
        self.dice, self.count = dice, 0
        self.names = []  # pairs of a kind (`time`, `pulse`, `speed`, `mark`) and a name
        self.phrases = []  # pairs of a name and its parameters
        self.wild = dice.random() < 0.15  # whether values may be out of range
        self.coarse = dice.random() < 0.45  # whether times and values are few, so that many coincide

    def chance(self, share):
        return self.dice.random() < share

    def one(self, *choices):
        return self.dice.choice(choices)

    def new_name(self, prefix):
        self.count += 1
        return f"{prefix}{self.count}"

    def known(self, kind):
        return [name for of, name in self.names if of == kind]

    def time(self):
        """An argument that is a time above zero, mostly below two seconds."""
        count = self.dice.randint
        if self.coarse and self.chance(0.9):
            return self.one("100ms", "100ms", "200ms", "200ms", "300ms", "0.4s", "1 beat", "0.25 beats")
        choices = [
            f"{count(1, 30) * 20}ms",
            f"{count(1, 15) / 10}s",
            f"{count(1, 3)} beats",
            f"{count(1, 20) / 8} beats",
        ]
        choices += [
            f"{count(1000, 900000)}us",
            "1 bar",
            "1 beat",
            "1s250ms",
            f"(1 beat - {count(1, 100)}ms)",
            f"{count(21, 999)}ms",
        ]
        choices += [
            f"({count(1, 9)} * 1 beat / {count(2, 7)})",
            f"random({count(1, 50)}ms, {count(60, 900)}ms)",
            f"(0.7s % {count(2, 5)}00ms + 1ms)",
        ]
        choices += [
            f"max(1 beat, {count(1, 900)}ms)",
            f"(1s * {count(1, 99) / 100})",
            f"choose(3 % 2 == {count(0, 2)}, 1 beat, 200ms)",
        ]
        marks = self.known("mark")
        if len(marks) > 1:
            choices += [f"({marks[-1]} - {marks[0]} + 1ms)"] * 3
        return self.dice.choice(choices + self.known("time") * 4)

    def whole(self, low, high):
        """An argument in this range, as a number or as an expression."""
        if self.wild and self.chance(0.05):
            return str(self.one(low - 1, high + 1, high * 2))
        if self.coarse and self.chance(0.8):
            return str(self.one(0, 0, low // 2, high // 2, high // 4) if low < 0 else (low + high) // 2)
        number = self.dice.randint(low, high)
        form = self.dice.random()
        if form < 0.6:
            return str(number)
        other = self.dice.randint(1, 9)
        forms = [
            f"({number - other} + {other})",
            f"min({number}, {high})",
            f"{number}.4",
            f"({number * other} / {other})",
        ]
        forms += [
            f"({other} - {other - number})",
            f"round({number}.3)",
            f"pick({number}, {low}, {high})",
            f"max({number},{low})",
        ]
        forms += [
            f"random({min(low, number)}, {number})",
            f"nth({other % 3}, {number}, {low}, {high})",
            f"floor({number}.9)",
        ]
        forms += [f"({number}.5 % 1 + {low} + {(number - low) // 2})", f"(sqrt({other * other}) * {number} / {other})"]
        if low < 0:
            forms += [f"-{abs(number)}", f"-({abs(number)})", f"abs({number})", f"({number} * sin({other * 10}deg))"]
        return self.dice.choice(forms)

    def pulse(self, high=2500):
        low = 500
        if self.coarse and self.chance(0.8):
            return self.one("1000", "1500", "1505", "90deg")
        number = self.dice.randint(low, high) if self.chance(0.5) else self.dice.randint(10, 19) * 100
        if self.wild and self.chance(0.05):
            return self.one("499", "2501", "2.6ms", "181deg", "1951", "-500")
        forms = [str(number)] * 6 + [
            f"{number}us",
            f"{self.dice.randint(0, 130)}deg",
            f"{number / 1000}ms",
            f"({number}us - 0.4us)",
        ]
        forms += [
            f"({self.dice.randint(1, 12)} * 10deg)",
            self.whole(low, high),
            f"random({low}, {number})",
            f"pick({number}us, 1500us)",
        ]
        return self.dice.choice(forms + self.known("pulse") * 4)

    def broken(self):
        """A statement that must be refused almost everywhere."""
        known = self.known("time") + self.known("pulse") + self.known("speed")
        choices = [
            "servo 5 1500",
            "servo 0 1500",
            "servo 1.5 1500",
            "wait 5",
            "rocker q=1",
            "rocker x=1 x=2",
            "servo 1 1500; wait 1s",
            "servo 1",
        ]
        choices += [
            "rocker x=1 for 1s over 1s",
            "tempo 100bpm",
            "unknown()",
            "at 1s at 2s stop",
            "repeat 2.5 { stop }",
            "stop for 1s",
            "servo 1 2 3",
        ]
        choices += [
            "move x=1 for 1s",
            "buzzer off for 1s",
            "raw 256",
            "request all",
            "servo 1 1000 -> 2000",
            "servo 1 (1500 + 1s)",
            "wait (1 / 0 * 1s)",
        ]
        choices += [
            "wait -1s",
            "servo 1 unknown",
            "if 1 { stop }",
            "buzzer",
            "wheels 1 2 3",
            "let wait = 1",
            "stop;",
            "repeat -1 { stop }",
            "rocker x=26",
        ]
        choices += [
            "servo 1 1000 -> 1200 over 1s ease in-wobble",
            "servo 1 1000 -> 1200 over 0s",
            "servo 1 2ms -> 2.6ms over 1s",
            "expect voltage > 3deg",
        ]
        choices += [
            "yawhold z=1",
            "+1s +1s stop",
            "at 1s - 2s stop",
            "+-1s stop",
            "at -1s stop",
            "at bar -1 stop",
            "let back = -1s\n+back stop",
            'say "{{{unknown}}}"',
            'say "{"',
            "wait 1s; stop",
            "let x = 1s + 2",
            "servos 1500 1951",
            "limit servo 1 600..700",
        ]
        choices += [f"let {name} = 1\nlet {name} = 2" for name in known[-1:] if name.isalnum()]
        return self.dice.choice(choices).split("\n")

    def value(self, kind):
        return self.time() if kind == "time" else self.pulse(1900) if kind == "pulse" else self.whole(-9, 9)

    def speed(self, reach):
        names = self.known("speed")
        if names and self.chance(0.3):
            return self.one("", "-") + self.dice.choice(names)
        return self.whole(-reach, reach)

    def timing(self, may_hold, may_move):
        """The suffix of a command: nothing, a hold or a move; and whether its values may have arrows."""
        form = self.dice.random()
        if may_move and form < 0.35:
            ease = " ease " + self.dice.choice(EASES) if self.chance(0.6) else ""
            return f" over {self.time()}{ease}", True
        return (f" for {self.time()}", False) if may_hold and form < 0.75 else ("", False)

    def arrowed(self, is_move, value):
        return f"{value()}{self.one(' -> ', '->')}{value()}" if is_move and self.chance(0.5) else value()

    def drive(self):
        verb = self.one("rocker", "rocker", "yawhold", "wheels", "stop", "move")
        if verb == "stop":
            return "stop"
        after, is_move = self.timing(verb != "move", verb != "move")
        if verb == "wheels":
            return "wheels " + " ".join(self.arrowed(is_move, lambda: self.speed(25)) for _ in range(4)) + after
        axes = self.dice.sample(DRIVES[verb], self.dice.randint(1, len(DRIVES[verb])))
        reach = lambda axis: 65535 if verb == "move" else 150 if axis == "z" else 24
        equals = self.one("=", "=", " = ")
        return (
            " ".join(
                [verb] + [f"{axis}{equals}{self.arrowed(is_move, lambda: self.speed(reach(axis)))}" for axis in axes]
            )
            + after
        )

    def servo(self, number):
        after, is_move = self.timing(False, True)
        return f"servo {number} {self.arrowed(is_move, lambda: self.pulse(1950 if number == 2 else 2500))}{after}"

    def servos(self):
        after, is_move = self.timing(False, True)
        return f"servos {self.arrowed(is_move, self.pulse)} {self.arrowed(is_move, lambda: self.pulse(1900))}{after}"

    def buzzer(self):
        return self.one("buzzer off", "buzzer on", f"buzzer on for {self.time()}", f"buzzer on for {self.time()}")

    def other(self):
        gains = lambda count: ",".join(self.whole(0, 250) for _ in range(count))
        mode = self.one("speed", "position")
        choices = [
            f"pid {mode} speed={gains(2)} position={gains(3)} yaw={gains(3)}",
            f"request {self.dice.choice(REQUESTS)}",
            'say "now"',
        ]
        function = self.one("0x04", "4", "3", "0x03", "2", "200")
        choices += [
            f"raw {function} {self.whole(0, 255)} 0xFF",
            f'say "{{{self.names[-1][1]}}}"' if self.names else "stop",
            'say "{{}} and {{name}}"',
        ]
        choices += [self.one("expect voltage > 10V", "expect yaw in -5deg..5deg", "expect pitch < 3deg within 300ms")]
        return self.dice.choice(choices)

    def commands(self, things):
        """Commands for different resources, to be joined."""
        write = {"drive": self.drive, "buzzer": self.buzzer, "both": self.servos, "other": self.other}
        return [write[thing]() if thing in write else self.servo(thing) for thing in things]

    def things(self, count):
        """Different resources, one for each command."""
        things = ["drive", "buzzer", *(["both", 3] if self.chance(0.3) else [1, 2, 3, 4])] + (
            ["other"] if self.chance(0.4) else []
        )
        chosen = self.dice.sample(things, min(count, len(things)))
        return chosen if "drive" in chosen or self.chance(0.7) else ["drive"] + chosen[1:]

    def start(self):
        marks = self.known("mark")
        if marks and self.chance(0.3):
            return f"at {self.dice.choice(marks)} {self.one('', f'+ {self.time()} ', f'- {self.time()} ')}"
        changed = self.one("", "", f"+ {self.time()} ", f"- -{self.time()} ", f"+ -{self.time()} + {self.time()} ")
        moment = self.one(
            f"{self.dice.randint(0, 15 if self.coarse else 60) / 10}s",
            f"-{self.time()} + {self.dice.randint(1, 4)}s",
            f"bar {self.dice.randint(1, 4)}",
            f"bar 2 beat {self.dice.randint(1, 3)}",
        )
        return f"at {moment} {changed}"

    def body(self, size, depth, things=None):
        """The lines of a block; its names are unknown after it."""
        names = list(self.names)
        lines = [line for _ in range(size) for line in self.statement(depth + 1, things)]
        self.names = names
        return ["  " + line for line in lines]

    def statement(self, depth=0, things=None):
        form = self.dice.random()
        if form < 0.42 or depth > 3:
            commands = self.commands(self.dice.sample(things, 1) if things else self.things(self.one(1, 1, 2, 3)))
            prefix = self.one(*[""] * 9, f"+{self.time()} ", self.start()) if things is None else ""
            return [prefix + self.one("; ", ";", " ; ").join(commands)] + (
                [f"wait {self.time()}"] if self.chance(0.6) else []
            )
        if form < 0.55:
            return [f"wait {self.time()}"]
        if form < 0.62:
            name = self.new_name("m")
            self.names.append(("mark", name))
            return [f"mark {name}"]
        if form < 0.67:
            return self.let()
        if form < 0.76 and self.phrases:
            return [self.one("", "", "", f"+{self.time()} ") + self.call()]
        if form < 0.84:
            return self.repeat(depth, things)
        if form < 0.9 and things is None:
            return self.together(depth)
        if form < 0.93 and things is None:
            return self.touching()
        size = self.dice.randint(1, 3)
        if form < 0.96:
            tempo = ["  " + self.one("tempo 90bpm", "meter 3/4", "tempo 97bpm")] if self.chance(0.4) else []
            return ["{"] + tempo + self.body(size, depth, things) + ["}"]
        condition = self.one(
            "1 < 2", "3 == 1 or 2.5 >= 2", "not 1 == 1", "1 beat > 600ms and 1 < 2", "7 % 4 == 3", "true"
        )
        otherwise = self.one(
            ["}"],
            ["} else {"] + self.body(1, depth, things) + ["}"],
            ["}", "else if 2 > 1 {"] + self.body(1, depth, things) + ["}"],
        )
        prefix = self.one("", "", f"+{self.time()} ", self.start()) if things is None else ""
        return [f"{prefix}if {condition} {{"] + self.body(size, depth, things) + otherwise

    def let(self):
        kind, name = self.one("time", "pulse", "speed"), self.new_name("v")
        value = self.value(kind)
        self.names.append((kind, name))
        return [f"let {name} = {value}"]

    def repeat(self, depth, things):
        count, names = self.dice.randint(0, 4), list(self.names)
        every = self.one("", "", f" every {self.dice.randint(1, 20) / 4}s", f" every {self.time()}")
        counter = ""
        if self.chance(0.4):
            name = self.new_name("i")
            counter = f" as {name}"
            self.names.append(("speed", name))
            self.names.append(("pulse", f"(900 + 200 * {name})"))
            self.names.append(("time", f"({name} * 100ms + 1 beat)"))
            self.names.append(("speed", name))
        lines = self.body(self.dice.randint(1, 3), depth, things)
        self.names = names
        if len(lines) == 1 and "wait" not in lines[0] and self.chance(0.5):
            return [f"repeat {count}{every}{counter} {{ {lines[0].strip()} }}"]
        return [f"repeat {count}{every}{counter} {{"] + lines + ["}"]

    def together(self, depth):
        lines = []
        for thing in self.things(self.dice.randint(2, 4)):
            if self.chance(0.5):
                prefix = self.one("", "", f"+{self.time()} ", self.start() if self.chance(0.2) else "")
                line = "  " + prefix + self.commands([thing])[0]
                delay = self.one("", "", f"+{self.time()} ", self.start() if self.chance(0.3) else "")
                lines += [f"  {delay}if 1 < 2 {{", "  " + line, "  }"] if self.chance(0.3) else [line]
            else:
                lines += (
                    ["  {"] + ["  " + line for line in self.body(self.dice.randint(1, 3), depth + 1, [thing])] + ["  }"]
                )
        return ["together {"] + lines + ["}"]

    def touching(self):
        """Commands for one resource at times on a grid, where ends touch starts; not in order of time."""
        thing = self.one("drive", "drive", 1, 2, "both", "buzzer")
        lines = []
        for start in self.dice.sample(range(0, 9), self.dice.randint(2, 4)):
            command = self.commands([thing])[0] if self.chance(0.85) else self.one("raw 3 0", "raw 2 1")
            for word in (" for ", " over "):
                if word in command:
                    head, _, tail = command.partition(word)
                    ease = " ease" + tail.split(" ease", 1)[1] if " ease" in tail else ""
                    command = f"{head}{word}{self.one(100, 200, 300)}ms{ease}"
            lines.append(f"  at {start / 10}s {command}")
        return ["{"] + lines + ["}"]

    def phrase(self):
        name, names = self.new_name("p"), list(self.names)
        parameters = []
        for _ in range(self.dice.randint(0, 2)):
            kind, parameter = self.one("time", "pulse", "speed"), self.new_name("a")
            default = self.value(kind) if parameters and parameters[-1][2] or self.chance(0.5) else None
            parameters.append((kind, parameter, default))
            self.names.append((kind, parameter))
        lines = self.body(self.dice.randint(1, 4), 1)
        self.names = names
        self.phrases.append((name, parameters))
        heads = ", ".join(name + (f" = {default}" if default else "") for _, name, default in parameters)
        return [f"def {name}({heads}) {{"] + lines + ["}"]

    def call(self):
        name, parameters = self.dice.choice(self.phrases)
        arguments = []
        for kind, parameter, default in parameters:
            if default is None or self.chance(0.5):
                is_named = (
                    arguments
                    and "=" in arguments[-1]
                    or self.chance(0.3)
                    or len(arguments) < parameters.index((kind, parameter, default))
                )
                arguments.append(f"{parameter} = {self.value(kind)}" if is_named else self.value(kind))
        return f"{name}({', '.join(arguments)})"

    def head(self):
        count = self.dice.randint
        settings = [
            f"tempo {self.one(60, 90, 97, 113, 120, 133.3)}bpm",
            f"meter {self.one('3/4', '4/4', '7/8')}",
            f"rate {self.one(50, 25, 7, 30, 100, 200, 12.5)}hz",
        ]
        settings += [
            f"refresh {self.one('20ms', '33ms', '100ms', 'off', '1s', '10ms', '12.5ms')}",
            f"baud {self.one(9600, 57600, 115200)}",
            f"seed {count(0, 9999)}",
        ]
        settings += [
            f"limit servo 2 {self.one('900..1700', '500..2500')}",
            "limit servo 1 600..2400",
            "limit rocker x -20..20",
            "limit wheels -20..20",
        ]
        if self.chance(0.08):  # more frames than the line carries, or almost
            return [["baud 9600"], [f"rate {self.one(50, 100, 200)}hz"], [f"refresh {self.one(10, 15, 20, 50)}ms"]]
        return [[setting] for setting in settings if self.chance(0.12)]

    def chunks(self):
        """A script as a list of statements, each a list of lines."""
        chunks = self.head()
        for _ in range(self.dice.randint(0, 2)):
            chunks.append(self.let() if self.chance(0.5) else self.phrase())
        if self.chance(0.6):
            chunks.append([self.one("servos 1500 1500", "servos 1200 1300; stop", "stop")])
        if self.chance(0.3):
            chunks.append(["pid position speed=200,150 position=20,0,20 yaw=12,2,5"])
        if self.chance(0.05):
            chunks.append(["on abort { servos 1500 1500; buzzer on for 200ms }"])
        size = len(chunks) + self.dice.choice([1, 2, 3, 5, 8, 12, 20])
        while len(chunks) < size:
            chunks.append(self.phrase() if self.chance(0.05) else self.statement())
        return chunks


def joined(chunks):
    return "".join(line + "\n" for chunk in chunks for line in chunk)


def random_script(dice):
    """A script, from which most statements that the evaluator refuses have been dropped."""
    generator = Generator(dice)
    chunks = generator.chunks()
    if dice.random() < 0.05:
        chunks.insert(dice.randint(0, len(chunks)), generator.broken())
        return joined(chunks)
    while True:
        try:
            evaluate(joined(chunks))
            break
        except Undecided:
            break
        except Refused as refused:
            if dice.random() < 0.05:
                break
            last = 0
            for place, chunk in enumerate(chunks):
                last += len(chunk)
                if refused.line <= last:
                    break
            del chunks[place]
            if not chunks:
                chunks = [["servo 1 1500"]]
    return joined(chunks)
