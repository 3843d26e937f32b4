"""Unrolls a motion script into commands with times, according to the language specification."""

import dataclasses
import math
import re
from fractions import Fraction

from .reader import BEATS, COMMANDS, SETTINGS, Node, Parser, Refused, Undecided
from .schedule import DRIVES, Schedule
from .values import (
    TIME_UNITS,
    SplitMix64,
    calculate,
    decimal,
    exact,
    fail_unit,
    half_away,
    of_kind,
    read_number,
    whole,
)

RESERVED = {
    *TIME_UNITS,
    *COMMANDS,
    *SETTINGS,
    *BEATS,
    "deg",
    "hz",
    "bpm",
    "if",
    "else",
    "let",
    "wait",
    "at",
    "repeat",
    "mark",
    "say",
    "use",
}


class Scope:
    def __init__(self, parent=None, is_pass=False):
        self.names, self.parent = {}, parent
        self.root = self if is_pass or parent is None else parent.root

    def find(self, name):
        scope = self
        while scope and name not in scope.names:
            scope = scope.parent
        return scope.names[name] if scope else None

    def define(self, name, value):
        if name in self.names or name in RESERVED:
            raise Refused("name")
        self.names[name] = value

    def mark(self, name, moment):
        """A mark is also visible after the blocks around it, up to the pass or the call."""
        self.define(name, ("moment", moment))
        scope = self
        while scope is not self.root:
            scope = scope.parent
            scope.names[name] = ("moment", moment)


@dataclasses.dataclass
class Place:
    """The context of statements: the visible names, and the start of their times."""

    scope: Scope
    base: Fraction
    beat: Fraction
    meter: int
    together: Fraction = None  # in a `together`, where each of its statements starts
    is_abort: bool = False


@dataclasses.dataclass
class Action:
    """A command with its values, at its time."""

    order: int
    at: Fraction
    node: Node
    verb: str
    axes: list = None  # (from or None, to)
    index: int = 0
    payload: list = None
    lasts: Fraction = None
    over: bool = False
    starts: list = None


REQUESTS = "report-start encoder-1 encoder-2 encoder-3 encoder-4 voltage pitch roll yaw report-stop".split()
LIMITED = {"servo": (1, 2, 3, 4), "rocker": "xyz", "yawhold": "xy", "wheels": (0,)}
GAINS = {"speed": 2, "position": 3, "yaw": 3}


class Evaluator:
    """Unrolls a script into actions."""

    def __init__(self, files):
        self.files, self.used = files, set()
        self.actions, self.dice, self.expects, self.depth, self.steps = [], SplitMix64(0), [], 0, 0
        self.rate, self.refresh, self.baud, self.limits = (
            Fraction(50),
            Fraction(1, 20),
            115200,
            {("servo", 2): (500, 1950)},
        )
        self.has_abort, self.given = False, set()

    # Values.

    def value(self, tree, place):
        kind = tree[0]
        if kind == "number":
            return read_number(tree[1])
        if kind == "beats":
            return ("time", exact(Fraction(tree[1]) * place.beat * (place.meter if tree[2] == "bar" else 1)))
        if kind == "name":
            value = ("truth", tree[1] == "true") if tree[1] in ("true", "false") else place.scope.find(tree[1])
            return value if value and value[0] != "def" else self.unknown()
        if kind == "minus":
            of, number = self.value(tree[1], place)
            return (of, -number) if of not in ("truth", "moment") else fail_unit()
        if kind == "not":
            return ("truth", not of_kind(self.value(tree[1], place), "truth"))
        if kind in ("and", "or"):
            left = of_kind(self.value(tree[1], place), "truth")
            if left == (kind == "or"):
                return ("truth", left)
            return ("truth", of_kind(self.value(tree[2], place), "truth"))
        if kind == "call":
            return self.function(tree[1], [self.value(argument, place) for argument in tree[2]])
        return calculate(kind, self.value(tree[1], place), self.value(tree[2], place))

    def unknown(self):
        raise Refused("unknown-name")

    def function(self, name, values):
        counts = {"min": (1, 99), "max": (1, 99), "choose": (3, 3), "nth": (2, 99), "random": (2, 2), "pick": (1, 99)}
        singles = {"abs": abs, "round": half_away, "floor": math.floor, "ceil": math.ceil}
        fewest, most = counts.get(name, (1, 1))
        if not fewest <= len(values) <= most:
            raise Refused("arguments")
        kind, number = values[0]
        if name in ("min", "max", "random", "pick") and any(other != kind for other, _ in values):
            raise Refused("unit")
        if name in ("min", "max"):
            return (min if name == "min" else max)(values, key=lambda value: value[1])
        if name == "choose":
            return values[1 if of_kind(values[0], "truth") else 2]
        if name == "nth":
            return values[1 + whole(values[0], 0, len(values) - 2)]
        if name == "pick":
            return values[self.dice.next() % len(values)]
        if name == "random":
            part = Fraction(self.dice.next() >> 11, 1 << 53)
            a, b = number, values[1][1]
            return (kind, exact(a + (b - a) * part)) if kind == "time" else (kind, a + (b - a) * float(part))
        if name in singles:
            if kind == "time" and name != "abs":
                raise Undecided("a rounded time")
            return (kind, number if name == "abs" and number >= 0 else type(number)(singles[name](number)))
        if name == "sqrt":
            return ("", math.sqrt(of_kind(values[0], "")) if number >= 0 else self.unknown())
        if name in ("sin", "cos"):
            return ("", getattr(math, name)(math.radians(number) if kind == "deg" else of_kind(values[0], "")))
        raise Refused("unknown-name")

    def duration(self, tree, place, is_above_zero=False):
        span = of_kind(self.value(tree, place), "time")
        if span < 0 or is_above_zero and span == 0:
            raise Refused("out-of-range")
        return span

    # Structure.

    def script(self, text):
        lines = Parser(text).lines(is_block=False)
        place = Place(Scope(), Fraction(0), Fraction(1, 2), 4)
        while lines and lines[0].items[0].kind == "setting":
            self.at_line(lines[0].line, self.setting, lines.pop(0).items[0], place)
        self.check_calls(lines)
        _, end = self.lines(lines, place, Fraction(0))
        return end

    def check_calls(self, lines):
        """Refuses calls of unknown phrases and recursion, even in code that never runs."""
        calls, bodies, files = [], {None: set()}, [(line, None) for line in lines]
        for line, phrase in files:
            for node in line.items or []:
                if node.kind == "call":
                    calls.append(node)
                    bodies[phrase].add(node.name)
                elif node.kind == "def":
                    bodies[node.name] = set()
                elif node.kind == "use" and node.name in self.files:
                    files += [(line, None) for line in Parser(self.files[node.name]).lines(is_block=False)]
                inner = node.name if node.kind == "def" else phrase
                files += [(line, inner) for line in (node.items or []) + (node.otherwise or [])]
        for call in calls:
            if call.name not in bodies:
                raise Refused("unknown-word", call.line)
        for phrase, reached in bodies.items():
            for _ in bodies:
                reached = reached.union(*(bodies[name] for name in reached))
            if phrase in reached:
                raise Refused("recursion")

    def at_line(self, line, function, *arguments):
        """Calls a function; errors without a line are in this one."""
        try:
            return function(*arguments)
        except Refused as refused:
            refused.line = refused.line or line
            raise

    def setting(self, node, place):
        if node.name == "limit":
            return self.limit(node, place)
        if place.scope.parent is None and node.name in self.given:
            raise Refused("setting-place")
        self.given.add(node.name)
        values = [] if node.arguments == [("name", "off")] else [self.value(tree, place) for tree in node.arguments]
        if values and values[0][1] == 0 and node.name in ("tempo", "meter"):
            raise Refused("out-of-range")
        if node.name == "tempo":
            place.beat = exact(60 / decimal(of_kind(values[0], "bpm")))
        elif node.name == "meter" and len(values) != 2:
            raise Refused("arguments")
        elif node.name == "meter":
            place.meter = whole(values[0], 1)
        elif node.name == "rate":
            self.rate = decimal(of_kind(values[0], "hz"))
            if not 1 <= self.rate <= 200:
                raise Refused("out-of-range")
        elif node.name == "refresh":
            self.refresh = of_kind(values[0], "time") if values else None
            if values and not Fraction(1, 100) <= self.refresh <= 1:
                raise Refused("out-of-range")
        elif node.name == "baud":
            self.baud = whole(values[0], 1)
        elif node.name == "seed":
            self.dice = SplitMix64(whole(values[0]))
        elif whole(values[0]) != 1:
            raise Refused("language-version")

    def limit(self, node, place):
        verb, *rest = node.arguments
        verb, of = verb[1], 0
        if verb != "wheels":
            of = rest.pop(0)
            of = whole(self.value(of, place), 1, 4) if verb == "servo" else of[1]
        if rest[:1] == [("name", "speed")]:
            return
        if verb not in LIMITED or of not in LIMITED[verb] or len(rest) != 2:
            raise Refused("arguments")
        if (verb, of) in self.given:
            raise Refused("setting-place")
        self.given.add((verb, of))
        low, high = (of_kind(self.value(tree, place), "") for tree in rest)
        hardest = (500, 2500) if verb == "servo" else (-200, 200) if of == "z" else (-25, 25)
        if not hardest[0] <= low <= high <= hardest[1]:
            raise Refused("out-of-range")
        self.limits[verb, of] = (low, high)

    def lines(self, lines, place, cursor):
        """Runs statements in turn; returns where the next one starts, and when all have ended."""
        finish = cursor
        for line in lines:
            self.steps += 1
            if self.steps > 20_000 or cursor > 3_600:
                raise Undecided("a long script")
            cursor, ended = self.at_line(line.line, self.line, line, place, cursor)
            finish = max(finish, ended)
        return cursor, finish

    def line(self, line, place, cursor):
        start = cursor if place.together is None else place.together
        if line.time:
            start = self.start(line.time, place, start)
            if start < place.base:
                raise Refused("start-time")
        if line.items[0].kind == "if":
            taken = self.branch(line.items[0], place)
            inner = place if place.together is None else dataclasses.replace(place, together=start)
            after, ended = self.lines(taken, inner, start)
            return (after if place.together is None else cursor), ended
        ended = max(self.at_line(item.line, self.item, item, place, start) for item in line.items)
        return (ended if place.together is None else cursor), ended

    def start(self, time, place, start):
        if time[0] == "+":
            return exact(start + self.duration(time[1], place))
        _, base, changes = time
        if base[0] == "bar":
            bar, beat = (whole(self.value(tree, place), 1) for tree in base[1:])
            if beat > place.meter:
                raise Refused("out-of-range")
            moment = place.base + ((bar - 1) * place.meter + beat - 1) * place.beat
        else:
            kind, moment = self.value(base, place)
            if kind not in ("time", "moment"):
                raise Refused("unit")
            moment += place.base if kind == "time" else 0
        for sign, change in changes:
            change = of_kind(self.value(change, place), "time")
            moment += change if sign == "+" else -change
        return exact(moment)

    def branch(self, node, place):
        if of_kind(self.value(node.arguments[0], place), "truth"):
            if node.settings:
                raise Refused("setting-place")
            return node.items
        return node.otherwise or []

    def block(self, node, place, start, scope=None, together=False):
        """Runs the lines of a block; returns when all have ended."""
        self.depth += 1
        if self.depth > 200:
            raise Undecided("a deep script")
        inner = dataclasses.replace(
            place, scope=scope or Scope(place.scope), base=start, together=start if together else None
        )
        if len({setting.name for setting in node.settings}) < len(node.settings):
            raise Refused("setting-place")
        for setting in node.settings:
            if setting.name not in ("tempo", "meter"):
                raise Refused("setting-place", setting.line)
            self.setting(setting, inner)
        _, end = self.lines(node.items, inner, start)
        self.depth -= 1
        return end

    def item(self, node, place, start):
        if node.kind in ("setting", "if"):
            raise Refused("setting-place")
        return getattr(self, "run_" + node.kind)(node, place, start)

    def run_block(self, node, place, start):
        return self.block(node, place, start)

    def run_together(self, node, place, start):
        return self.block(node, place, start, together=True)

    def run_wait(self, node, place, start):
        return exact(start + self.duration(node.time[1], place))

    def run_mark(self, node, place, start):
        if place.is_abort:
            raise Refused("abort")
        place.scope.mark(node.name, start)
        return start

    def run_let(self, node, place, start):
        place.scope.define(node.name, self.value(node.arguments[0], place))
        return start

    def run_say(self, node, place, start):
        for found in re.finditer(r"\{\{|\{([^}]*)(\}?)", node.name[1:-1]):
            name, close = found.groups()
            if name is not None and (not close or place.scope.find(name.strip()) is None):
                raise Refused("unknown-name")
        return start

    def run_repeat(self, node, place, start):
        count = whole(self.value(node.arguments[0], place))
        every = self.duration(node.time[1], place, is_above_zero=True) if node.time else None
        if count > 20_000:
            raise Undecided("a long script")
        for number in range(count):
            scope = Scope(place.scope, is_pass=True)
            if node.name:
                scope.define(node.name, ("", float(number)))
            end = self.block(node, place, start, scope)
            if every is not None:
                if end > start + every:
                    raise Refused("start-time")
                end = exact(start + every)
            start = end
        return start

    def run_def(self, node, place, start):
        if place.scope.parent:
            raise Refused("top-level")
        seen = Scope()
        seen.names.update(place.scope.names)
        place.scope.define(node.name, ("def", (node, seen)))
        return start

    def run_call(self, node, place, start):
        kind, found = place.scope.find(node.name) or ("", None)
        if kind != "def":
            raise Refused("unknown-name")
        phrase, seen = found
        scope = Scope(seen, is_pass=True)
        given = {name: self.value(tree, place) for (name, _), tree in zip(phrase.arguments, node.arguments)}
        if len(node.arguments) > len(phrase.arguments) or set(given) & set(node.named):
            raise Refused("arguments")
        given.update((name, self.value(tree, place)) for name, tree in node.named.items())
        for name, default in phrase.arguments:
            if name in given:
                scope.define(name, given.pop(name))
            elif default is None:
                raise Refused("arguments")
            else:
                scope.define(name, self.value(default, dataclasses.replace(place, scope=scope)))
        if given:
            raise Refused("arguments")
        return self.block(phrase, place, start, scope)

    def run_use(self, node, place, start):
        if place.scope.parent:
            raise Refused("top-level")
        text = self.files.get(node.name)
        if text is None:
            raise Refused("use")
        if node.name not in self.used:
            self.used.add(node.name)
            for line in Parser(text).lines(is_block=False):
                if line.items[0].kind not in ("use", "let", "def"):
                    raise Refused("use")
                self.item(line.items[0], place, start)
        return start

    def run_on(self, node, place, start):
        if place.scope.parent or self.has_abort:
            raise Refused("abort")
        self.has_abort = True
        actions, self.actions = self.actions, []
        inner = dataclasses.replace(place, is_abort=True)
        lasts = self.block(node, inner, Fraction(0))
        Schedule(self, lasts, Fraction(1)).frames()
        self.actions = actions
        if lasts > 2:
            raise Refused("abort")
        return start

    # Commands.

    def run_request(self, node, place, start):
        if node.name not in REQUESTS:
            raise Refused("arguments")
        self.actions.append(Action(len(self.actions), start, node, "request", index=REQUESTS.index(node.name)))
        return start

    def run_expect(self, node, place, start):
        unit = {"voltage": "V", "pitch": "deg", "roll": "deg", "yaw": "deg"}.get(node.name)
        values = [of_kind(self.value(tree, place), unit) for tree in node.arguments]
        if values != sorted(values):
            raise Refused("out-of-range")
        if place.is_abort:
            raise Refused("abort")
        self.expects.append((start, node.line))
        return exact(start + self.duration(node.time[1], place, is_above_zero=True)) if node.time else start

    def run_command(self, node, place, start):
        action = Action(len(self.actions), start, node, node.name)
        getattr(self, "read_" + node.name, self.read_drive)(action, place)
        if node.time:
            self.read_time(action, place)
        if (
            node.ease
            and not action.over
            or node.name != "pid"
            and any(len(values) > 1 for values in node.named.values())
        ):
            raise Refused("arguments")
        if place.is_abort and (node.name in DRIVES or node.name == "raw" and action.index == 3):
            raise Refused("abort")
        if not action.over and any(origin is not None for origin, _ in action.axes or []):
            raise Refused("arguments")
        self.actions.append(action)
        return exact(start + (action.lasts or 0))

    def read_time(self, action, place):
        kind, tree = action.node.time
        action.over = kind == "over"
        allowed = "servo servos rocker yawhold wheels" if action.over else "rocker yawhold wheels buzzer"
        if action.verb not in allowed.split() or action.verb == "buzzer" and action.index == 0:
            raise Refused("arguments")
        action.lasts = self.duration(tree, place, is_above_zero=True)

    def axis(self, pair, place, read):
        origin, target = (None if tree is None else read(self.value(tree, place)) for tree in pair)
        return origin, target

    @staticmethod
    def pulse(value):
        kind, number = value
        if kind == "time":
            return float(number * 10**6)
        if kind == "deg" and not 0 <= number <= 180:
            raise Refused("out-of-range")
        return 500 + number * 2000 / 180 if kind == "deg" else of_kind(value, "")

    @staticmethod
    def bare(value):
        return of_kind(value, "")

    def read_servo(self, action, place):
        if len(action.node.arguments) != 2 or action.node.named:
            raise Refused("arguments")
        action.index = whole(self.value(action.node.arguments[0][1], place), 1, 4)
        action.axes = [self.axis(action.node.arguments[1], place, self.pulse)]

    def read_servos(self, action, place):
        if len(action.node.arguments) != 2 or action.node.named:
            raise Refused("arguments")
        action.axes = [self.axis(pair, place, self.pulse) for pair in action.node.arguments]

    def read_drive(self, action, place):
        names, node = DRIVES[action.verb], action.node
        pairs = [values[0] for values in node.named.values()]
        if action.verb == "wheels":
            if len(node.arguments) != 4 or node.named:
                raise Refused("arguments")
            action.axes = [self.axis(pair, place, self.bare) for pair in node.arguments]
            return
        if node.arguments or any(name not in names for name in node.named) or (not pairs) != (action.verb == "stop"):
            raise Refused("arguments")
        zero = (None, ("number", "0"))
        action.axes = [self.axis(node.named.get(name, [zero])[0], place, self.bare) for name in names]

    def read_buzzer(self, action, place):
        if [pair for pair in action.node.arguments] not in ([(None, ("name", "on"))], [(None, ("name", "off"))]):
            raise Refused("arguments")
        action.index = int(action.node.arguments[0][1][1] == "on")

    def read_pid(self, action, place):
        node = action.node
        mode = [tree[1] for _, tree in node.arguments]
        if mode not in (["speed"], ["position"]) or {name: len(gains) for name, gains in node.named.items()} != GAINS:
            raise Refused("arguments")
        gains = [self.value(tree, place) for name in GAINS for _, tree in node.named[name]]
        action.payload = [int(mode == ["position"])] + [whole(gain, 0, 255) for gain in gains]

    def read_raw(self, action, place):
        payload = [whole(self.value(tree, place), 0, 255) for _, tree in action.node.arguments]
        if not payload:
            raise Refused("arguments")
        action.index, action.payload = payload[0], payload[1:]


def evaluate(text, files=None, speed=1):
    """The frames of a script: the microseconds, bytes, kind and line of each."""
    script = Evaluator(files or {})
    try:
        end = script.script(text)
        return Schedule(script, end, Fraction(speed)).frames()
    except (OverflowError, RecursionError, ValueError) as error:
        raise Undecided(str(error)) from error
