#!/usr/bin/env python3
"""Differential and metamorphic tests of the compiler.

An evaluator of the motion language, written from its specification and without any code of the program, computes the frames
of random scripts. They must be the frames of `motionseq render`: the same microseconds, bytes, kinds and lines. A script that one
of the two refuses must be refused by the other. Further checks need no evaluator: a script that was rewritten without a change of
meaning (a call inlined, a comment added, formatted, played at another speed, cut in two) must send what it sent before.

A script whose frames depend on the last bit of a sine or a power of two (a sample halfway between two whole numbers) is skipped.

Not covered: several robots, gates (`wait until`, `wait go`), boards other than the Raspblock, and the text of messages.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import math
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from fractions import Fraction

# ---------------------------------------------------------------------------------------------------------------- the evaluator


class Refused(Exception):
    """The script must not compile."""

    def __init__(self, reason, line=0):
        super().__init__(f"{reason} in line {line}")
        self.reason, self.line = reason, line


class Undecided(Exception):
    """The specification does not settle the result, or it is too long to compute here."""


TOKEN = re.compile(
    r"""(?P<space>(?:[ \t]|\#[^\n]*)+) | (?P<newline>\r?\n) | (?P<string>"(?:\\["\\]|[^"\\\n])*") | (?P<hex>0x[0-9A-Fa-f]+)
    | (?P<number>\d+(?:\.\d+)?(?:[A-Za-z]+(?:\d+(?:\.\d+)?[A-Za-z]+)*)?) | (?P<name>[a-z_][a-z0-9_]*)
    | (?P<sign>->|\.\.|<=|>=|==|[-+*/%(){};,=<>])""",
    re.VERBOSE,
)
COMMANDS = {"servo", "servos", "rocker", "yawhold", "wheels", "move", "stop", "buzzer", "pid", "raw"}
SETTINGS = {"language", "tempo", "meter", "rate", "refresh", "baud", "seed", "limit"}
BEATS = {"beat": "beat", "beats": "beat", "bar": "bar", "bars": "bar"}
JOINABLE = {"command", "request", "say", "expect", "call", "block", "repeat", "together"}


@dataclasses.dataclass
class Token:
    kind: str
    text: str
    line: int
    glued: bool  # no space before it


@dataclasses.dataclass
class Node:
    """A statement, or a line of statements that start together (kind `line`)."""

    kind: str
    line: int
    name: str = ""
    items: list = None  # of a line: its statements; of a block: its lines
    arguments: list = None
    named: dict = None
    time: tuple = None  # `for`, `over`, `every`, `within`, `at` or `+`, and what follows
    ease: str = "linear"
    otherwise: object = None
    settings: list = None


def tokens_of(text):
    tokens, at, line, glued = [], 0, 1, False
    while at < len(text):
        found = TOKEN.match(text, at)
        if not found:
            raise Refused("syntax", line)
        kind, at = found.lastgroup, found.end()
        if kind != "space":
            tokens.append(Token(kind, found.group(), line, glued))
        glued = kind not in ("space", "newline")
        line += kind == "newline"
    return tokens + [Token("newline", "\n", line, False), Token("end", "", line, False)]


class Parser:
    """Recursive descent: text to a list of nodes."""

    def __init__(self, text):
        self.tokens, self.at, self.depth = tokens_of(text), 0, 0

    def peek(self, ahead=0):
        return self.tokens[min(self.at + ahead, len(self.tokens) - 1)]

    def skip_newlines(self, anywhere=False):
        while (anywhere or self.depth) and self.peek().kind == "newline":
            self.at += 1

    def next(self):
        token = self.peek()
        self.at += 1
        self.skip_newlines()
        return token

    def fail(self, reason="syntax"):
        raise Refused(reason, self.peek().line)

    def has(self, *texts):
        return self.peek().text in texts and self.peek().kind in ("name", "sign")

    def take(self, *texts):
        return self.next() if self.has(*texts) else None

    def expect(self, text):
        return self.take(text) or self.fail()

    def of_kind(self, kind):
        return self.next() if self.peek().kind == kind else self.fail()

    def open(self):
        self.depth += 1
        self.expect("(")

    def close(self):
        self.depth -= 1
        self.expect(")")

    # Values. An expression is a tuple: its kind, and its parts.

    def number(self):
        token = self.next()
        unit = self.peek()
        if token.text.replace(".", "").isdigit() and unit.text in BEATS and not unit.glued:
            self.next()
            return ("beats", token.text, BEATS[unit.text])
        return ("number", token.text)

    def primary(self):
        token = self.peek()
        if token.kind in ("number", "hex"):
            return self.number()
        if self.has("("):
            self.open()
            value = self.expression()
            self.close()
            return value
        name = self.of_kind("name").text
        if self.has("(") and self.peek().glued:
            arguments, _ = self.call_arguments()
            return ("call", name, arguments)
        return ("name", name)

    def call_arguments(self):
        self.open()
        arguments, named = [], {}
        while not self.has(")"):
            if self.peek().kind == "name" and self.peek(1).text == "=":
                name = self.next().text
                self.next()
                if name in named:
                    self.fail()
                named[name] = self.expression()
            else:
                arguments.append(self.expression())
            if not self.take(","):
                break
        self.close()
        return arguments, named

    def argument(self):
        if self.take("-"):
            return ("minus", self.primary() if self.peek().glued else self.fail())
        return self.primary()

    def unary(self):
        return ("minus", self.unary()) if self.take("-") else self.primary()

    def chain(self, part, *signs):
        value = part()
        while self.has(*signs):
            value = (self.next().text, value, part())
        return value

    def comparison(self):
        sums = lambda: self.chain(lambda: self.chain(self.unary, "*", "/", "%"), "+", "-")
        value = sums()
        return (self.next().text, value, sums()) if self.has("<", "<=", ">", ">=", "==") else value

    def negation(self):
        return ("not", self.negation()) if self.take("not") else self.comparison()

    def expression(self):
        return self.chain(lambda: self.chain(self.negation, "and"), "or")

    def axis(self):
        value = self.argument()
        return (value, self.argument()) if self.take("->") else (None, value)

    def word(self):
        """A word that may contain hyphens, such as `in-out-sine`."""
        word = self.of_kind("name").text
        while self.has("-") and self.peek().glued:
            self.next()
            word += "-" + self.next().text
        return word

    # Statements.

    def lines(self, is_block):
        lines = []
        while True:
            self.skip_newlines(anywhere=True)
            if self.peek().kind == "end" or self.has("}"):
                if is_block != self.has("}"):
                    self.fail()
                return lines
            lines.append(self.line())
            if self.peek().kind != "newline" and not self.has("}"):
                self.fail()

    def line(self):
        line = Node("line", self.peek().line, items=[])
        if self.take("at"):
            line.time = ("at", *self.moment())
        elif self.take("+"):
            line.time = ("+", self.argument())
        line.items.append(self.statement())
        while self.take(";"):
            line.items.append(self.statement())
        if len(line.items) > 1 and any(item.kind not in JOINABLE for item in line.items):
            self.fail("joined")
        return line

    def moment(self):
        if self.take("bar"):
            base = ("bar", self.count(), self.count() if self.take("beat") else ("number", "1"))
        else:
            base = self.argument()
        changes = []
        while self.has("+", "-"):
            changes.append((self.next().text, self.argument()))
        return base, changes

    def count(self):
        """A number that the word `beat` may follow without being its unit."""
        return ("number", self.next().text) if self.peek().kind == "number" else self.argument()

    def block(self):
        self.expect("{")
        depth, self.depth = self.depth, 0
        lines = self.lines(is_block=True)
        self.depth = depth
        self.expect("}")
        settings = []
        while lines and lines[0].items[0].kind == "setting":
            settings.append(lines.pop(0).items[0])
        return settings, lines

    def with_block(self, node):
        node.settings, node.items = self.block()
        return node

    def statement(self):
        token = self.peek()
        line, name = token.line, token.text
        if self.has("{"):
            return self.with_block(Node("block", line))
        self.of_kind("name")
        if self.has("(") and self.peek().glued:
            arguments, named = self.call_arguments()
            return Node("call", line, name, arguments=arguments, named=named)
        if name in SETTINGS:
            return self.setting(Node("setting", line, name))
        if name in COMMANDS:
            return self.command(Node("command", line, name, arguments=[], named={}))
        read = getattr(self, "read_" + name, None)
        return read(Node(name, line)) if read else self.fail("unknown-word")

    def setting(self, node):
        node.arguments = []
        while self.peek().kind != "newline" and not self.has("}"):
            if self.take("..", "/"):
                continue
            node.arguments.append(self.argument())
        return node

    def command(self, node):
        while self.peek().kind != "newline" and not self.has("}", ";"):
            if self.has("for", "over"):
                if node.time:
                    self.fail()
                node.time = (self.next().text, self.argument())
            elif self.take("ease"):
                node.ease = self.word()
            elif self.peek().kind == "name" and self.peek(1).text == "=":
                name = self.next().text
                self.next()
                values = [self.axis()]
                while self.take(","):
                    values.append(self.axis())
                if name in node.named:
                    self.fail()
                node.named[name] = values
            else:
                node.arguments.append(self.axis())
        return node

    def read_request(self, node):
        node.name = self.word()
        return node

    def read_say(self, node):
        node.name = self.of_kind("string").text
        return node

    def read_expect(self, node):
        node.name = self.of_kind("name").text
        sign = self.next().text
        node.arguments = [self.argument()]
        if sign == "in":
            self.expect("..")
            node.arguments.append(self.argument())
        if self.take("within"):
            node.time = ("within", self.argument())
        if self.peek().kind == "string":
            self.next()
        return node

    def read_wait(self, node):
        node.time = ("wait", self.argument())
        return node

    def read_mark(self, node):
        node.name = self.of_kind("name").text
        return node

    def read_let(self, node):
        node.name = self.of_kind("name").text
        self.expect("=")
        node.arguments = [self.expression()]
        return node

    def read_repeat(self, node):
        node.arguments = [self.argument()]
        if self.take("every"):
            node.time = ("every", self.argument())
        if self.take("as"):
            node.name = self.of_kind("name").text
        return self.with_block(node)

    def read_together(self, node):
        return self.with_block(node)

    def read_if(self, node):
        node.arguments = [self.expression()]
        self.with_block(node)
        ahead = 0
        while self.peek(ahead).kind == "newline":
            ahead += 1
        if self.peek(ahead).text == "else":
            self.at += ahead + 1
            if self.has("if"):
                inner = Node("if", self.next().line)
                node.otherwise = [Node("line", inner.line, items=[self.read_if(inner)])]
            else:
                node.otherwise = self.block()[1]
        return node

    def read_def(self, node):
        node.name = self.of_kind("name").text
        self.open()
        node.arguments = []
        while not self.has(")"):
            name = self.of_kind("name").text
            node.arguments.append((name, self.expression() if self.take("=") else None))
            if not self.take(","):
                break
        self.close()
        return self.with_block(node)

    def read_use(self, node):
        node.name = self.of_kind("string").text[1:-1]
        return node

    def read_on(self, node):
        self.expect("abort")
        return self.with_block(node)


# Values are pairs of a kind and a number: a Fraction of seconds for times and moments, a bool for truths, else a float.
TIME_UNITS = {"h": 3600, "min": 60, "m": 60, "s": 1, "ms": Fraction(1, 10**3), "us": Fraction(1, 10**6)}
OTHER_UNITS = {"deg", "V", "bpm", "hz"}


def exact(seconds):
    """A time as it is kept: rounded to 10⁻¹⁵ s where the fraction (of nanoseconds) needs more than 64 bits."""
    if seconds.denominator < 1 << 31 and abs(seconds.numerator) < 1 << 31:
        return seconds
    nanos = seconds * 10**9
    if nanos.denominator < 1 << 63 and abs(nanos.numerator) < 1 << 63:
        return seconds
    return Fraction(math.floor(seconds * 10**15 + Fraction(1, 2)), 10**15)


def decimal(number):
    """A float as the decimal that it prints as."""
    return Fraction(repr(number)) if math.isfinite(number) else Fraction(0)


def half_away(number, settled=True):
    """Rounded half away from zero; undecided where a last bit of an unsettled number decides."""
    if not settled and abs(abs(number) % 1 - 0.5) < 1e-9:
        raise Undecided("a sample halfway between two whole numbers")
    whole = math.floor(abs(number))
    whole += abs(number) - whole >= 0.5
    return int(math.copysign(whole, number)) if whole else 0


def read_number(text):
    if text.startswith("0x"):
        return ("", float(int(text, 16)))
    parts = re.findall(r"(\d+(?:\.\d+)?)([A-Za-z]*)", text)
    if parts[0][1] in TIME_UNITS:
        sizes = [TIME_UNITS.get(unit, 0) for _, unit in parts]
        if 0 in sizes or any(a <= b for a, b in zip(sizes, sizes[1:])):
            raise Refused("number")
        return ("time", sum(Fraction(digits) * size for (digits, _), size in zip(parts, sizes)))
    if len(parts) > 1 or parts[0][1] and parts[0][1] not in OTHER_UNITS:
        raise Refused("unit")
    return (parts[0][1], float(parts[0][0]))


class SplitMix64:
    def __init__(self, seed):
        self.state = seed

    def next(self):
        mask = (1 << 64) - 1
        self.state = (self.state + 0x9E3779B97F4A7C15) & mask
        mixed = self.state
        mixed = (mixed ^ mixed >> 30) * 0xBF58476D1CE4E5B9 & mask
        mixed = (mixed ^ mixed >> 27) * 0x94D049BB133111EB & mask
        return mixed ^ mixed >> 31


def calculate(sign, left, right):
    """The result of a binary operator other than `and` and `or`."""
    (kind, a), (other, b) = left, right
    if sign == "*":
        if kind and other or "truth" in (kind, other):
            raise Refused("unit")
        if "time" in (kind, other):
            span, factor = (a, b) if kind == "time" else (b, a)
            return ("time", exact(span * decimal(factor)))
        return finite(kind or other, a * b)
    if sign == "/" and not other and kind not in ("truth", "moment"):
        if b == 0:
            raise Refused("arithmetic")
        return ("time", exact(a / decimal(b))) if kind == "time" else finite(kind, a / b)
    if {kind, other} == {"moment", "time"} and sign in "+-" and kind == "moment":
        return ("moment", exact(a + b if sign == "+" else a - b))
    if kind != other or kind == "truth":
        raise Refused("unit")
    if sign in ("<", "<=", ">", ">=", "=="):
        return ("truth", {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b}[sign])
    if kind == "moment":
        return ("time", exact(a - b)) if sign == "-" else fail_unit()
    if sign in "/%" and b == 0:
        raise Refused("arithmetic")
    if kind == "time":
        results = {"+": lambda: a + b, "-": lambda: a - b, "/": lambda: float(a / b), "%": lambda: a % b}
        result = results[sign]()
        return ("", result) if sign == "/" else ("time", exact(result))
    if sign == "%":
        rest = math.fmod(a, b)
        return (kind, rest + b if rest and (rest < 0) != (b < 0) else rest)
    return finite("" if sign == "/" else kind, {"+": a + b, "-": a - b, "/": a / b if b else 0}[sign])


def finite(kind, number):
    if not math.isfinite(number):
        raise Refused("arithmetic")
    return (kind, number)


def fail_unit():
    raise Refused("unit")


def of_kind(value, *kinds):
    return value[1] if value[0] in kinds else fail_unit()


def whole(value, low=0, high=10**9):
    number = of_kind(value, "")
    if number != math.floor(number):
        raise Refused("not-whole")
    if not low <= number <= high:
        raise Refused("out-of-range")
    return int(number)


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
        if name in self.names:
            raise Refused("name")
        self.names[name] = value

    def mark(self, name, moment):
        """A mark is known behind the blocks around it, up to the pass or the call."""
        self.define(name, ("moment", moment))
        scope = self
        while scope is not self.root:
            scope = scope.parent
            scope.names[name] = ("moment", moment)


@dataclasses.dataclass
class Place:
    """Where statements run: what they see, and what their times count from."""

    scope: Scope
    base: Fraction
    beat: Fraction
    meter: int
    together: bool = False
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


DRIVES = {"rocker": "xyz", "yawhold": "xy", "wheels": "abcd", "move": "xyz", "stop": "xyz"}
REQUESTS = "report-start encoder-1 encoder-2 encoder-3 encoder-4 voltage pitch roll yaw report-stop".split()
GAINS = {"speed": 2, "position": 3, "yaw": 3}


class Evaluator:
    """Unrolls a script into actions."""

    def __init__(self, files):
        self.files, self.used = files, set()
        self.actions, self.dice, self.expects, self.depth, self.steps = [], SplitMix64(0), [], 0, 0
        self.rate, self.refresh, self.baud, self.limits = Fraction(50), Fraction(1, 20), 115200, {("servo", 2): (500, 1950)}
        self.has_abort = False

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

    def duration(self, tree, place, is_move=False):
        span = of_kind(self.value(tree, place), "time")
        if span < 0 or is_move and span == 0:
            raise Refused("out-of-range")
        return span

    # Structure.

    def script(self, text):
        lines = Parser(text).lines(is_block=False)
        place = Place(Scope(), Fraction(0), Fraction(1, 2), 4)
        while lines and lines[0].items[0].kind == "setting":
            self.at_line(lines[0].line, self.setting, lines.pop(0).items[0], place)
        if not lines:
            raise Refused("empty-script")
        self.check_calls(lines)
        _, end = self.lines(lines, place, Fraction(0))
        return end

    def check_calls(self, lines):
        """Refuses calls of phrases that no file defines, also where nothing runs."""
        calls, phrases, files = [], set(), list(lines)
        for line in files:
            for node in line.items or []:
                files += (node.items or []) + (node.otherwise or [])
                if node.kind == "call":
                    calls.append(node)
                elif node.kind == "def":
                    phrases.add(node.name)
                elif node.kind == "use" and node.name in self.files:
                    files += Parser(self.files[node.name]).lines(is_block=False)
        for call in calls:
            if call.name not in phrases:
                raise Refused("unknown-word", call.line)

    def at_line(self, line, function, *arguments):
        """Calls a function; what it refuses without a line is in this one."""
        try:
            return function(*arguments)
        except Refused as refused:
            refused.line = refused.line or line
            raise

    def setting(self, node, place):
        if node.name == "limit":
            return self.limit(node, place)
        values = [] if node.arguments == [("name", "off")] else [self.value(tree, place) for tree in node.arguments]
        if node.name == "tempo":
            place.beat = exact(60 / decimal(of_kind(values[0], "bpm")))
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
        if rest[0] == ("name", "speed"):
            return
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
        start = place.base if place.together else cursor
        if line.time:
            start = self.start(line.time, place, start)
            if start < place.base:
                raise Refused("start-time")
        if line.items[0].kind == "if":
            taken = self.branch(line.items[0], place)
            inner = dataclasses.replace(place, base=start) if place.together else place
            after, ended = self.lines(taken, inner, start)
            return (cursor if place.together else after), ended
        ended = max(self.at_line(item.line, self.item, item, place, start) for item in line.items)
        return (cursor if place.together else ended), ended

    def start(self, time, place, start):
        if time[0] == "+":
            return exact(start + self.duration(time[1], place))
        _, base, changes = time
        if base[0] == "bar":
            bar, beat = (whole(self.value(tree, place), 1) for tree in base[1:])
            moment = place.base + ((bar - 1) * place.meter + beat - 1) * place.beat
        else:
            kind, moment = self.value(base, place)
            if kind not in ("time", "moment"):
                raise Refused("unit")
            moment += place.base if kind == "time" else 0
        for sign, change in changes:
            change = self.duration(change, place)
            moment += change if sign == "+" else -change
        return exact(moment)

    def branch(self, node, place):
        if of_kind(self.value(node.arguments[0], place), "truth"):
            return node.items
        return node.otherwise or []

    def block(self, node, place, start, scope=None, together=False):
        """Runs the lines of a block; returns when all have ended."""
        self.depth += 1
        if self.depth > 200:
            raise Undecided("a deep script")
        inner = dataclasses.replace(place, scope=scope or Scope(place.scope), base=start, together=together)
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
        place.scope.mark(node.name, start)
        return start

    def run_let(self, node, place, start):
        place.scope.define(node.name, self.value(node.arguments[0], place))
        return start

    def run_say(self, node, place, start):
        for name in re.findall(r"(?<!\{)\{([a-z_][a-z0-9_]*)\}", node.name):
            if place.scope.find(name) is None:
                raise Refused("unknown-name")
        return start

    def run_repeat(self, node, place, start):
        count = whole(self.value(node.arguments[0], place))
        every = self.duration(node.time[1], place) if node.time else None
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
        for tree in node.arguments:
            of_kind(self.value(tree, place), unit)
        if place.is_abort:
            raise Refused("abort")
        self.expects.append(node.line)
        return exact(start + self.duration(node.time[1], place)) if node.time else start

    def run_command(self, node, place, start):
        action = Action(len(self.actions), start, node, node.name)
        getattr(self, "read_" + node.name, self.read_drive)(action, place)
        if node.time:
            self.read_time(action, place)
        if place.is_abort and node.name in DRIVES:
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
        action.lasts = self.duration(tree, place, is_move=True)

    def axis(self, pair, place, read):
        origin, target = (None if tree is None else read(self.value(tree, place)) for tree in pair)
        return origin, target

    @staticmethod
    def pulse(value):
        kind, number = value
        if kind == "time":
            return float(number * 10**6)
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


def frame(function, payload):
    body = bytes([function, len(payload), *payload])
    return (b"\xff\xfe" + body + bytes([sum(body) & 255])).hex().upper()


def words(*numbers):
    return [byte for number in numbers for byte in divmod(abs(number), 256)]


def drive_frame(verb, values):
    negative = [value < 0 for value in values]
    if verb == "wheels":
        signs = sum(bit << place for place, bit in enumerate(negative))
        return frame(3, [2, *(abs(value) for value in values), 0, 0, signs])
    if verb == "yawhold":
        return frame(3, [3, *words(*values), 0, 0, negative[0] << 2 | negative[1] << 1])
    signs = negative[0] << 2 | negative[1] << 1 | (not negative[2])
    return frame(3, [4 if verb == "move" else 1, *words(*values), signs])


STOP, BUZZER_OFF = drive_frame("stop", [0, 0, 0]), frame(4, [0])


def bounce(part):
    for start, middle, rise in ((1, 0, 0), (2, 1.5, 0.75), (2.5, 2.25, 0.9375), (9, 2.625, 0.984375)):
        if part < start / 2.75:
            return 7.5625 * (part - middle / 2.75) ** 2 + rise
    return 1.0


def elastic(part, period):
    if part <= 0 or part >= 1:
        return part
    return -(2 ** (10 * part - 10)) * math.sin((part - 1 - period / 4) * 2 * math.pi / period)


# The curves that start slowly; a second one is what `in-out-` is made of, where that is another curve.
CURVES = {
    "sine": [lambda x: 1 - math.cos(x * math.pi / 2)],
    "quad": [lambda x: x * x],
    "cubic": [lambda x: x * x * x],
    "quart": [lambda x: x * x * x * x],
    "quint": [lambda x: x * x * x * x * x],
    "expo": [lambda x: 2 ** (10 * x - 10) if x > 0 else 0.0],
    "circ": [lambda x: 1 - math.sqrt(1 - x * x)],
    "back": [lambda x: x * x * (2.70158 * x - 1.70158), lambda x: x * x * (3.5949095 * x - 2.5949095)],
    "elastic": [lambda x: elastic(x, 0.3), lambda x: elastic(x, 0.45)],
    "bounce": [lambda x: 1 - bounce(1 - x)],
}
EASES = ["linear"] + [f"{way}-{curve}" for way in ("in", "out", "in-out") for curve in CURVES]


def eased(name, part):
    if name == "linear":
        return part
    way, _, curve = name.rpartition("-")
    if name not in EASES:
        raise Refused("arguments")
    slow = CURVES[curve][-1 if way == "in-out" else 0]
    if way == "in-out":
        return slow(2 * part) / 2 if part < 0.5 else 1 - slow(2 - 2 * part) / 2
    return slow(part) if way == "in" else 1 - slow(1 - part)


def micros(seconds):
    return math.floor(seconds * 10**6 + Fraction(1, 2))


@dataclasses.dataclass
class Sent:
    """A frame: its exact time, in which class of its microsecond it is sent, and what it says."""

    at: Fraction
    rank: int
    frame: str
    kind: str
    line: int
    holds: bool = False  # a drive command that is refreshed


class Schedule:
    """Turns actions into frames."""

    def __init__(self, script, end, speed):
        self.script, self.end, self.sent, self.drives = script, end / speed, [], []
        self.actions = script.actions
        for action in self.actions:
            action.at /= speed
            if action.lasts is not None:
                action.lasts /= speed
        self.pulses, self.drive, self.drive_frame, self.mode = {}, None, None, None
        self.raw, self.buzzer, self.now = None, None, None

    def frames(self):
        if self.end > 3_600:
            raise Undecided("a long script")
        self.check_clashes()
        starts = {(resource, action.at) for action in self.actions if not action.over for resource in self.resources(action)}
        events = []
        for action in self.actions:
            events.append((micros(action.at), action.order, 0, action.at, action))
            if action.over:
                steps = math.ceil(action.lasts * self.script.rate) - 1
                for step in range(1, steps + 2):
                    at = action.at + (step / self.script.rate if step <= steps else action.lasts)
                    events.append((micros(at), action.order, step, at, action))
            elif action.lasts is not None and (self.resources(action)[0], action.at + action.lasts) not in starts:
                at = action.at + action.lasts
                events.append((micros(at), action.order, 1, at, action))
        if len(events) > 100_000:
            raise Undecided("a long script")
        for _, _, step, self.now, action in sorted(events, key=lambda event: event[:3]):
            self.script.at_line(action.node.line, self.event, action, step)
        self.add_refreshes()
        self.add_closing()
        sent = sorted(self.sent, key=lambda sent: (micros(sent.at), sent.rank))
        self.check_line(sent)
        return [(micros(sent.at), sent.frame, sent.kind, sent.line) for sent in sent]

    @staticmethod
    def resources(action):
        if action.verb in DRIVES:
            return ["drive"]
        return {"servo": [action.index], "servos": [1, 2], "buzzer": ["buzzer"]}.get(action.verb, [])

    def check_clashes(self):
        things = {}
        for action in self.actions:
            for resource in self.resources(action):
                things.setdefault(resource, []).append(action)
        for actions in things.values():
            actions.sort(key=lambda action: action.at)
            for place, first in enumerate(actions):
                for second in actions[place + 1 :]:
                    if second.at > first.at + (first.lasts or 0):
                        break
                    if self.is_clash(first, second):
                        raise Refused("clash", max(first, second, key=lambda action: action.order).node.line)

    @staticmethod
    def is_clash(first, second):
        """Whether two actions on one thing clash; the first does not start later."""
        if first.at == second.at:
            if (first.lasts is None) == (second.lasts is None):
                return True
            instant, other = (first, second) if first.lasts is None else (second, first)
            return instant.order > other.order
        return second.at < first.at + first.lasts or second.order < first.order

    def event(self, action, step):
        if action.over:
            self.move(action, step)
        elif step:
            self.end_of_hold(action)
        elif action.verb in DRIVES:
            if action.verb == "move" and self.mode != 1:
                raise Refused("move-mode")
            self.send_drive(action, self.checked(action, [target for _, target in action.axes]), "command")
        elif action.axes:
            self.send_servos(action, self.checked(action, [target for _, target in action.axes]), "command")
        else:
            self.plain(action)

    def plain(self, action):
        function = {"buzzer": 4, "pid": 1, "request": 5}.get(action.verb, action.index)
        payload = [action.index] if action.payload is None else action.payload
        self.emit(action, frame(function, payload), "command")
        if action.verb == "raw":
            self.raw = self.raw or action
            if function == 3:
                self.drive = self.drive_frame = None
                self.drives.append(self.sent[-1])
        elif action.verb == "pid":
            self.mode = action.payload[0]
        elif action.verb == "buzzer":
            self.buzzer = action

    def end_of_hold(self, action):
        if action.verb == "buzzer":
            self.emit(action, BUZZER_OFF, "command")
            self.buzzer = None
        else:
            self.send_drive(action, [0, 0, 0], "command", verb="stop")

    def move(self, action, step):
        if step == 0:
            known = self.last_values(action)
            action.starts = [origin if origin is not None else last for (origin, _), last in zip(action.axes, known)]
            if None in action.starts:
                raise Refused("unknown-start")
            eased(action.node.ease, 0.0)
            if all(origin is None for origin, _ in action.axes):
                return
        part = step / (self.script.rate * action.lasts)
        is_target = part >= 1
        share = 1.0 if is_target else eased(action.node.ease, float(part))
        is_settled = re.search("linear|quad|cubic|quart|quint|back|bounce", action.node.ease) or step == 0 or is_target
        values = []
        for start, (_, target) in zip(action.starts, action.axes):
            values.append(target if is_target else start if step == 0 else start + (target - start) * share)
        values = self.checked(action, values, is_settled)
        if action.verb in DRIVES:
            if drive_frame(action.verb, values) != self.drive_frame:
                self.send_drive(action, values, "sample")
            else:
                self.drive = (action.verb, values)
        elif any(self.pulses.get(index) != value for index, value in zip(self.resources(action), values)):
            self.send_servos(action, values, "sample")

    def last_values(self, action):
        if action.verb not in DRIVES:
            return [self.pulses.get(index) for index in self.resources(action)]
        count = len(action.axes)
        verb, values = self.drive or ("", None)
        return [0] * count if verb == "stop" else values if verb == action.verb else [None] * count

    def checked(self, action, values, is_settled=True):
        """The whole numbers that are sent, if ranges and limits allow them."""
        values = [half_away(value, is_settled) for value in values]
        for place, value in enumerate(values):
            hard, limited = (500, 2500), None
            if action.verb == "servos" and place == 1:
                hard = (500, 1950)
            if action.verb in DRIVES:
                name = DRIVES[action.verb][place]
                reach = 65535 if action.verb == "move" else 200 if name == "z" else 25
                hard, limited = (-reach, reach), (action.verb, 0 if action.verb == "wheels" else name)
            else:
                limited = ("servo", self.resources(action)[place])
            if not hard[0] <= value <= hard[1]:
                raise Refused("out-of-range")
            low, high = self.script.limits.get(limited, hard)
            if not low <= value <= high:
                raise Refused("limit")
        return values

    def emit(self, action, data, kind, holds=False):
        self.sent.append(Sent(self.now, 1, data, kind, action.node.line, holds))

    def send_drive(self, action, values, kind, verb=None):
        verb = verb or action.verb
        data = drive_frame(verb, values)
        holds = verb == "yawhold" or verb in ("rocker", "wheels") and any(values)
        self.emit(action, data, kind, holds)
        self.drives.append(self.sent[-1])
        self.drive, self.drive_frame = (verb, values), data

    def send_servos(self, action, values, kind):
        payload = words(*values) if action.verb == "servos" else [action.index, *words(*values)]
        self.emit(action, frame(2, payload), kind)
        self.pulses.update(zip(self.resources(action), values))

    def add_refreshes(self):
        if self.script.refresh is None:
            return
        for place, drive in enumerate(self.drives):
            until = self.drives[place + 1].at if place + 1 < len(self.drives) else self.end
            at = drive.at + self.script.refresh
            while drive.holds and at < until:
                self.sent.append(Sent(at, 2, drive.frame, "refresh", drive.line))
                at += self.script.refresh

    def add_closing(self):
        is_driving = self.drives and self.drives[-1].holds
        if self.raw or is_driving:
            self.sent.append(Sent(self.end, 3, STOP, "closing", self.raw.node.line if self.raw else self.drives[-1].line))
        if self.raw or self.buzzer and self.buzzer.index:
            self.sent.append(Sent(self.end, 3, BUZZER_OFF, "closing", (self.raw or self.buzzer).node.line))
        if self.script.expects:
            self.sent.append(Sent(Fraction(0), 0, frame(5, [0]), "auto", min(self.script.expects)))
            self.sent.append(Sent(self.end, 4, frame(5, [9]), "auto", max(self.script.expects)))

    def check_line(self, sent):
        """Frames that are due together queue; one that leaves more than 50 ms late is an error."""
        baud, free = self.script.baud, 0
        for sent in sent:
            due = micros(sent.at) * baud
            if free > due + 50_000 * baud:
                raise Refused("wire-full", sent.line)
            free = max(free, due) + len(sent.frame) // 2 * 10 * 10**6


def evaluate(text, files=None, speed=1):
    """The frames of a script: microseconds, bytes, kind and line of each."""
    script = Evaluator(files or {})
    try:
        end = script.script(text)
        return Schedule(script, end, Fraction(speed)).frames()
    except (OverflowError, RecursionError, ValueError) as error:
        raise Undecided(str(error)) from error


# ---------------------------------------------------------------------------------------------------------------- random scripts


class Generator:
    """Writes a random script. Most are valid; the caller drops what the evaluator refuses."""

    def __init__(self, dice):
        self.dice, self.count = dice, 0
        self.names = []  # pairs of a kind (`time`, `pulse`, `speed`, `flag`, `mark`) and a name
        self.phrases = []  # pairs of a name and its parameters
        self.wild = dice.random() < 0.15  # whether values may be out of range

    def chance(self, share):
        return self.dice.random() < share

    def one(self, *choices):
        return self.dice.choice(choices)

    def new_name(self, prefix):
        self.count += 1
        return f"{prefix}{self.count}"

    def known(self, kind):
        return [name for of, name in self.names if of == kind]

    def time(self, long=1.0):
        """An argument that is a time above zero, mostly below two seconds."""
        count = self.dice.randint
        choices = [f"{count(1, 30) * 20}ms", f"{count(1, 15) / 10}s", f"{count(1, 3)} beats", f"{count(1, 20) / 8} beats"]
        choices += [f"{count(1000, 900000)}us", "1 bar", "1 beat", "1s250ms", f"(1 beat - {count(1, 100)}ms)", f"{count(21, 999)}ms"]
        choices += [f"({count(1, 9)} * 1 beat / {count(2, 7)})", f"random({count(1, 50)}ms, {count(60, 900)}ms)", f"(0.7s % {count(2, 5)}00ms + 1ms)"]
        choices += [f"max(1 beat, {count(1, 900)}ms)", f"(1s * {count(1, 99) / 100})", f"choose(3 % 2 == {count(0, 2)}, 1 beat, 200ms)"]
        return self.dice.choice(choices + self.known("time") * 4)

    def whole(self, low, high):
        """An argument that is a number of this range, as a number or as a calculation."""
        if self.wild and self.chance(0.05):
            return str(self.one(low - 1, high + 1, high * 2))
        number = self.dice.randint(low, high)
        form = self.dice.random()
        if form < 0.6:
            return str(number)
        other = self.dice.randint(1, 9)
        forms = [f"({number - other} + {other})", f"min({number}, {high})", f"{number}.4", f"({number * other} / {other})"]
        forms += [f"({other} - {other - number})", f"round({number}.3)", f"pick({number}, {low}, {high})", f"max({number},{low})"]
        forms += [f"random({min(low, number)}, {number})", f"nth({other % 3}, {number}, {low}, {high})", f"floor({number}.9)"]
        forms += [f"({number}.5 % 1 + {low} + {(number - low) // 2})", f"(sqrt({other * other}) * {number} / {other})"]
        if low < 0:
            forms += [f"-{abs(number)}", f"-({abs(number)})", f"abs({number})", f"({number} * sin({other * 10}deg))"]
        return self.dice.choice(forms)

    def pulse(self, high=2500):
        low = 500
        number = self.dice.randint(low, high) if self.chance(0.5) else self.dice.randint(10, 19) * 100
        if self.wild and self.chance(0.05):
            return self.one("499", "2501", "2.6ms", "181deg", "1951", "-500")
        forms = [str(number)] * 6 + [f"{number}us", f"{self.dice.randint(0, 130)}deg", f"{number / 1000}ms", f"({number}us - 0.4us)"]
        forms += [f"({self.dice.randint(1, 12)} * 10deg)", self.whole(low, high), f"random({low}, {number})", f"pick({number}us, 1500us)"]
        return self.dice.choice(forms + self.known("pulse") * 4)

    def value(self, kind):
        return self.time() if kind == "time" else self.pulse(1900) if kind == "pulse" else self.whole(-9, 9)

    def speed(self, reach):
        names = self.known("speed")
        if names and self.chance(0.3):
            return self.one("", "-") + self.dice.choice(names)
        return self.whole(-reach, reach)

    def timing(self, may_hold, may_move):
        """What follows a command: nothing, a hold or a move; and whether its values may have arrows."""
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
        return " ".join([verb] + [f"{axis}{equals}{self.arrowed(is_move, lambda: self.speed(reach(axis)))}" for axis in axes]) + after

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
        choices = [f"pid {mode} speed={gains(2)} position={gains(3)} yaw={gains(3)}", f"request {self.dice.choice(REQUESTS)}", 'say "now"']
        function = self.one("0x04", "4", "3", "0x03", "2", "200")
        choices += [f"raw {function} {self.whole(0, 255)} 0xFF", f'say "{{{self.names[-1][1]}}}"' if self.names else "stop"]
        choices += [self.one("expect voltage > 10V", "expect yaw in -5deg..5deg", "expect pitch < 3deg within 300ms")]
        return self.dice.choice(choices)

    def commands(self, things):
        """Commands of different things, to be joined."""
        write = {"drive": self.drive, "buzzer": self.buzzer, "both": self.servos, "other": self.other}
        return [write[thing]() if thing in write else self.servo(thing) for thing in things]

    def things(self, count):
        """Different things, each of which one command can use."""
        things = ["drive", "buzzer", *(["both", 3] if self.chance(0.3) else [1, 2, 3, 4])] + (["other"] if self.chance(0.4) else [])
        return self.dice.sample(things, min(count, len(things)))

    def start(self):
        marks = self.known("mark")
        if marks and self.chance(0.3):
            return f"at {self.dice.choice(marks)} {self.one('', f'+ {self.time()} ', f'- {self.time()} ')}"
        changed = self.one("", "", f"+ {self.time()} ")
        moment = self.one(f"{self.dice.randint(0, 60) / 10}s", f"bar {self.dice.randint(1, 4)}", f"bar 2 beat {self.dice.randint(1, 3)}")
        return f"at {moment} {changed}"

    def body(self, size, depth, things=None):
        """The lines of a block; its names are forgotten behind it."""
        names = list(self.names)
        lines = [line for _ in range(size) for line in self.statement(depth + 1, things)]
        self.names = names
        return ["  " + line for line in lines]

    def statement(self, depth=0, things=None):
        form = self.dice.random()
        if form < 0.42 or depth > 3:
            commands = self.commands(self.dice.sample(things, 1) if things else self.things(self.one(1, 1, 2, 3)))
            prefix = self.one(*[""] * 9, f"+{self.time()} ", self.start()) if things is None else ""
            return [prefix + self.one("; ", ";", " ; ").join(commands)] + ([f"wait {self.time()}"] if self.chance(0.6) else [])
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
        if form < 0.92 and things is None:
            return self.together(depth)
        size = self.dice.randint(1, 3)
        if form < 0.96:
            tempo = ["  " + self.one("tempo 90bpm", "meter 3/4", "tempo 97bpm")] if self.chance(0.4) else []
            return ["{"] + tempo + self.body(size, depth, things) + ["}"]
        condition = self.one("1 < 2", "3 == 1 or 2.5 >= 2", "not 1 == 1", "1 beat > 600ms and 1 < 2", "7 % 4 == 3", "true")
        otherwise = self.one(["}"], ["} else {"] + self.body(1, depth, things) + ["}"], ["}", "else if 2 > 1 {"] + self.body(1, depth, things) + ["}"])
        return [f"if {condition} {{"] + self.body(size, depth, things) + otherwise

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
                lines.append("  " + prefix + self.commands([thing])[0])
            else:
                lines += ["  {"] + ["  " + line for line in self.body(self.dice.randint(1, 3), depth + 1, [thing])] + ["  }"]
        return ["together {"] + lines + ["}"]

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
                is_named = arguments and "=" in arguments[-1] or self.chance(0.3) or len(arguments) < parameters.index((kind, parameter, default))
                arguments.append(f"{parameter} = {self.value(kind)}" if is_named else self.value(kind))
        return f"{name}({', '.join(arguments)})"

    def head(self):
        count = self.dice.randint
        settings = [f"tempo {self.one(60, 90, 97, 113, 120, 133.3)}bpm", f"meter {self.one('3/4', '4/4', '7/8')}", f"rate {self.one(50, 25, 7, 30, 100, 200, 12.5)}hz"]
        settings += [f"refresh {self.one('20ms', '33ms', '100ms', 'off', '1s', '10ms', '12.5ms')}", f"baud {self.one(9600, 57600, 115200)}", f"seed {count(0, 9999)}"]
        settings += [f"limit servo 2 {self.one('900..1700', '500..2500')}", "limit servo 1 600..2400", "limit rocker x -20..20", "limit wheels -20..20"]
        return [[setting] for setting in settings if self.chance(0.12)]

    def chunks(self):
        """A script as a list of statements, each a list of lines."""
        chunks = self.head()
        for _ in range(self.dice.randint(0, 2)):
            chunks.append(self.let() if self.chance(0.5) else self.phrase())
        if self.chance(0.6):
            chunks.append([self.one("servos 1500 1500", "servos 1200 1300; stop", "stop")])
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
    chunks = Generator(dice).chunks()
    keeps = dice.random() < 0.06
    while not keeps:
        try:
            evaluate(joined(chunks))
            break
        except Undecided:
            break
        except Refused as refused:
            last = 0
            for place, chunk in enumerate(chunks):
                last += len(chunk)
                if refused.line <= last:
                    break
            del chunks[place]
            if not chunks:
                chunks = [["servo 1 1500"]]
    return joined(chunks)


# ------------------------------------------------------------------------------------------------------------------- the checks


class Program:
    """The program under test, with a folder of its own."""

    def __init__(self, path, folder):
        self.path, self.folder = path, folder

    def run(self, *arguments, text=""):
        command = [self.path, *arguments]
        done = subprocess.run(command, input=text.encode(), capture_output=True, cwd=self.folder, timeout=120, check=False)
        if done.returncode not in (0, 1):
            raise Broken(f"exit code {done.returncode} of {' '.join(arguments)}: {done.stderr.decode()[-300:]}")
        return done.returncode == 0, done.stdout, done.stderr.decode()

    def render(self, text, *options):
        """The frames as `evaluate` returns them, or the code of the first error as a string."""
        is_fine, out, errors = self.run("render", "-q", "--format", "jsonl", *options, "-", text=text)
        if not is_fine:
            return errors.split("\n", 1)[0]
        rows = (json.loads(line) for line in out.splitlines())
        return [(row["t_us"], row["frame"], row["kind"], row["line"]) for row in rows]


class Broken(Exception):
    """The program crashed or did what no script may lead to."""


def difference(wanted, found):
    """How two results of `render` differ; None where they do not."""
    if isinstance(wanted, str) or isinstance(found, str):
        shown = [result if isinstance(result, str) else f"{len(result)} frames" for result in (wanted, found)]
        both = isinstance(wanted, str) and isinstance(found, str)
        return None if both else f"one is refused: wanted {shown[0]}, found {shown[1]}"
    for place, (first, second) in enumerate(zip(wanted, found)):
        if first != second:
            return f"frames differ: number {place + 1}, wanted {first}, found {second}"
    if len(wanted) != len(found):
        return f"frames differ: wanted {len(wanted)}, found {len(found)}; {max(wanted, found, key=len)[min(len(wanted), len(found))]}"
    return None


def without_lines(frames):
    return frames if isinstance(frames, str) else [sent[:3] for sent in frames]


def evaluated(text, speed=1):
    try:
        return evaluate(text, speed=speed)
    except Refused as refused:
        return str(refused)


def blocks_of(lines):
    """The blocks of several lines, as pairs of the numbers of their first and last line, in order of their last lines."""
    opened, blocks = [], []
    for number, line in enumerate(lines):
        if line.strip().startswith(("}", "]")) and opened:
            blocks.append((opened.pop(), number))
        if line.endswith("{"):
            opened.append(number)
    return blocks


def inside_together(lines, number):
    """Whether a line is a statement of a `together`."""
    around = [first for first, last in blocks_of(lines) if first < number < last]
    while around and re.match(r"\s*(if|else|\})", lines[around[-1]]):
        around.pop()
    around.sort()
    return any("together" in lines[first] for first in around[-1:]) or any(re.match(r"\s*(if|\})", lines[first]) for first in around)


def check_evaluator(program, text, _):
    return difference(evaluated(text), program.render(text))


def check_speed(program, text, dice):
    speed = dice.choice(["2", "0.5", "0.3", "1.25", "10", "0.1"])
    return difference(evaluated(text, Fraction(speed)), program.render(text, "--speed", speed))


def check_fmt(program, text, _):
    """Formatted twice is formatted once, and sends the same."""
    is_fine, once, errors = program.run("fmt", "-", text=text)
    if not is_fine:
        return None if isinstance(program.render(text), str) else f"not formatted: {errors[:200]}"
    once = once.decode()
    twice = program.run("fmt", "-", text=once)[1].decode()
    return "formatting twice changes more" if once != twice else difference(program.render(text), program.render(once))


def check_comment(program, text, dice):
    """Comments, empty lines, other line ends and a byte order mark change nothing but the numbers of lines."""
    lines = text.splitlines()
    place = dice.randint(0, len(lines))
    lines.insert(place, dice.choice(["", "# a comment { (", "  ", "\t# servo 1 1500"]))
    lines = [line + dice.choice(["", "", "  # a comment", "\t"]) for line in lines]
    changed = dice.choice(["", "\ufeff"]) + dice.choice(["\n", "\r\n"]).join(lines) + dice.choice(["", "\n"])
    wanted = program.render(text)
    if not isinstance(wanted, str):
        wanted = [(*sent, line + (line > place)) for *sent, line in wanted]
    return difference(wanted, program.render(changed))


def check_inline(program, text, _):
    """A call inlined as a pass of its own, with its arguments as `let`s, sends the same."""
    lines = text.splitlines()
    bodies, result = {}, []
    for first, last in blocks_of(lines):
        head = re.match(r"def (\w+)\((.*)\) \{$", lines[first])
        if head:
            bodies[head[1]] = (split(head[2]), lines[first + 1 : last])
    for line in lines:
        call = re.match(r"(\s*(?:\+.* )?)(p\d+)\((.*)\)$", line)
        if not call or call[2] not in bodies or "{" in call[1]:
            result.append(line)
            continue
        parameters, body = bodies[call[2]]
        values = dict(part.split(" = ", 1) if " = " in part else (part, None) for part in parameters)
        for place, given in enumerate(split(call[3])):
            name, value = given.split(" = ", 1) if re.match(r"\w+ = ", given) else (list(values)[place], given)
            values[name] = value
        # Arguments come before defaults, as their random numbers do.
        given = [part.split(" = ")[0] if re.match(r"\w+ = ", part) else list(values)[place] for place, part in enumerate(split(call[3]))]
        order = given + [name for name in values if name not in given]
        result += [call[1] + "repeat 1 {", *(f"let {name} = {values[name]}" for name in order), *body, "}"]
    changed = "\n".join(result) + "\n"
    return difference(without_lines(program.render(text)), without_lines(program.render(changed)))


def split(arguments):
    """Arguments at the commas outside of parentheses."""
    parts, depth = [""], 0
    for sign in arguments:
        depth += (sign == "(") - (sign == ")")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts if part.strip()]


def check_unroll(program, text, _):
    """The passes of a `repeat`, written one after the other, send the same."""
    lines = text.splitlines()
    for first, last in blocks_of(lines):
        head = re.match(r"(\s*)repeat (\d) (?:as (\w+) )?\{$", lines[first])
        if not head or inside_together(lines, first) or lines[first + 1].strip().startswith(("tempo", "meter")):
            continue
        count, name, body = int(head[2]), head[3], lines[first + 1 : last]
        passes = [["repeat 1 {"] + ([f"let {name} = {number}"] if name else []) + body + ["}"] for number in range(count)]
        changed = lines[:first] + [line for one in passes for line in one] + lines[last + 1 :]
        found = program.render("\n".join(changed) + "\n")
        return difference(without_lines(program.render(text)), without_lines(found))
    return None


def check_wrapped(program, text, dice):
    """Everything behind the settings in a block that changes nothing sends the same."""
    lines = text.splitlines()
    top = [number for number, line in enumerate(lines) if line.startswith(("def ", "on ", *SETTINGS))]
    ends = {first: last for first, last in blocks_of(lines)}
    begin = max([ends.get(number, number) + 1 for number in top], default=0)
    if any(not line.startswith(("let ", "def ", " ", "}", *SETTINGS)) for line in lines[:begin]):
        return None
    head, foot = dice.choice([("{", "}"), ("together {\n{", "}\n}"), ("repeat 1 {", "}"), ("if 1 == 1 {", "}"), ("def all() {", "}\nall()")])
    changed = "\n".join(lines[:begin] + [head] + lines[begin:] + [foot]) + "\n"
    return difference(without_lines(program.render(text)), without_lines(program.render(changed)))


def check_use(program, text, dice):
    """The `let`s and `def`s that a script begins with may be in a used file."""
    lines = text.splitlines()
    ends = {first: last for first, last in blocks_of(lines)}
    begin = next((number for number, line in enumerate(lines) if not line.startswith(tuple(SETTINGS))), 0)
    end = begin
    while end < len(lines) and lines[end].startswith(("let ", "def ")):
        end = ends.get(end, end) + 1
    name = f"used{dice.randint(0, 10**9)}.motion"
    path = os.path.join(program.folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines[begin:end]) + "\n")
    try:
        found = program.render("\n".join(lines[:begin] + [f'use "{name}"'] + lines[end:]) + "\n")
    finally:
        os.remove(path)
    return difference(without_lines(program.render(text)), without_lines(found)) if end > begin else None


def check_set(program, text, dice):
    """`--set` does what an edit of the `let` does."""
    lets = re.findall(r"^let (v\d+) = ([\w.]+)$", text, re.MULTILINE)
    if not lets:
        return None
    name, value = dice.choice(lets)
    value = f"{dice.randint(1, 3)}.5{value.lstrip('0123456789.') or ''}"
    changed = re.sub(rf"^let {name} = .*$", f"let {name} = {value}", text, flags=re.MULTILINE)
    return difference(program.render(changed), program.render(text, "--set", f"{name}={value}"))


def check_parts(program, text, dice):
    """Cut in two, a script sends the frames before the cut and those from it on, at the same distances."""
    whole = program.render(text)
    if isinstance(whole, str) or not whole:
        return None
    moments = [sent[0] for sent in whole]
    cut = max(1, dice.choice([dice.choice(moments), dice.randint(0, max(moments))]))
    before, after = program.render(text, "--to", f"{cut}us"), program.render(text, "--from", f"{cut}us")
    if isinstance(before, str) or isinstance(after, str):
        return None if "wire-full" in (before, after) else f"a part is refused: {before if isinstance(before, str) else after}"
    kept = lambda frames: [sent for sent in frames if sent[2] not in ("auto", "closing")]
    wanted = kept([sent for sent in whole if sent[0] < cut])
    found = difference(wanted, kept(before))
    if found:
        return f"--to {cut}us: {found}"
    wanted, found = kept([sent for sent in whole if sent[0] >= cut]), kept(after)
    shift = found[0][0] - wanted[0][0] if wanted and found else 0
    found = difference([(at + shift, *rest) for at, *rest in wanted], found)
    return found and f"--from {cut}us: {found}"


def check_loop(program, text, _):
    """Two passes are one and the same one again."""
    once, twice = program.render(text), program.render(text, "--loop", "2")
    if isinstance(once, str) or isinstance(twice, str) or not once:
        return None
    again = twice[len(once) :]
    shift = again[0][0] - once[0][0] if again else 0
    return difference(once + [(at + shift, *rest) for at, *rest in once], twice)


def check_parentheses(program, text, _):
    """A number in parentheses is the same number, however the line is read."""
    changed = [
        re.sub(r"(?<= )(\d{3,4})(?= |;|$)", r"(\1)", line) if line.strip().startswith("servo") else line for line in text.splitlines()
    ]
    return difference(program.render(text), program.render("\n".join(changed) + "\n"))


def check_formats(program, text, _):
    """All formats say the same, `check` agrees with `render`, and `decode` reads what was sent."""
    wanted = program.render(text)
    if program.run("check", "-q", "-", text=text)[0] == isinstance(wanted, str):
        return "check and render disagree"
    if isinstance(wanted, str):
        return None
    frames = [sent[1] for sent in wanted]
    if program.run("render", "-q", "--format", "bin", "-", text=text)[1].hex().upper() != "".join(frames):
        return "bin differs from jsonl"
    rows = [line.split("\t") for line in program.run("render", "-q", "-", text=text)[1].decode().splitlines()]
    if [(row[0], row[1].replace(" ", "")) for row in rows] != [(f"{at // 10**6}.{at % 10**6:06}", data) for at, data, *_ in wanted]:
        return "listing differs from jsonl"
    decoded = program.run("decode", "-", text="\n".join(row[1] for row in rows))[1].decode().splitlines()
    decoded = [line.split("\t")[-2:] for line in decoded if "\t" in line]
    return None if decoded == [row[1:3] for row in rows] else "decode differs from the listing"


CHECKS = {name.removeprefix("check_"): function for name, function in list(globals().items()) if name.startswith("check_")}
ALWAYS, OFTEN = ["evaluator"], 3  # checks for every script, and how many of the others


def outcome(program, check, text, seed):
    """What a check finds wrong with a script; None if nothing."""
    try:
        return CHECKS[check](program, text, random.Random(seed))
    except Undecided:
        return None
    except Broken as broken:
        return f"broken: {broken}"


def reduced(text, is_failing):
    """The script with as many lines and blocks left out as possible."""
    lines = text.splitlines()
    found = True
    while found:
        found = False
        blocks = blocks_of(lines)
        tries = [set(range(first, last + 1)) for first, last in sorted(blocks)] + [{first, last} for first, last in blocks]
        size = len(lines) // 2
        while size:
            tries += [set(range(first, first + size)) for first in range(0, len(lines), size)]
            size //= 2
        for left_out in tries:
            shorter = [line for number, line in enumerate(lines) if number not in left_out]
            if shorter and is_failing("\n".join(shorter) + "\n"):
                lines, found = shorter, True
                break
    return "\n".join(lines) + "\n"


def run_seed(path, seed):
    """All checks of one script: which passed, and what failed."""
    dice = random.Random(seed)
    text = random_script(dice)
    failures, skipped = [], False
    try:
        evaluated(text)
    except Undecided:
        skipped = True
    with tempfile.TemporaryDirectory() as folder:
        program = Program(path, folder)
        for check in ALWAYS + dice.sample(sorted(set(CHECKS) - set(ALWAYS)), OFTEN):
            found = outcome(program, check, text, seed)
            if found:
                sort = found.split(":")[0]
                is_failing = lambda shorter: (outcome(program, check, shorter, seed) or "").split(":")[0] == sort
                short = reduced(text, is_failing)
                failures.append((check, outcome(program, check, short, seed), short))
    return seed, skipped, failures


def main():
    parser = argparse.ArgumentParser(description="Compare motionseq with an independent evaluator, on random scripts.")
    parser.add_argument("--program", default="target/debug/motionseq", help="the program under test")
    parser.add_argument("--seed", type=int, default=None, help="of the first script; each further one has the next number")
    parser.add_argument("--seconds", type=float, help="start no script after this time")
    parser.add_argument("--programs", type=int, help="how many scripts")
    parser.add_argument("--keep", metavar="DIR", help="write the scripts that fail to this folder")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else int(time.time())
    count = options.programs or (10**9 if options.seconds else 1_000)
    path, begin = os.path.abspath(options.program), time.monotonic()
    if not os.access(path, os.X_OK):
        parser.error(f"there is no program {options.program}")
    print(f"seed {seed}", flush=True)
    passed = failed = skipped = 0
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        running, next_seed = set(), seed
        while True:
            in_time = options.seconds is None or time.monotonic() - begin < options.seconds
            while in_time and len(running) < 8 and next_seed < seed + count:
                running.add(pool.submit(run_seed, path, next_seed))
                next_seed += 1
            if not running:
                break
            done, running = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
            for of, was_skipped, failures in (future.result() for future in done):
                skipped += was_skipped
                passed, failed = passed + (not failures), failed + bool(failures)
                for check, found, text in failures:
                    print(f"FAILED {check}, --seed {of} --programs 1: {found}\n{text}", flush=True)
                    if options.keep:
                        os.makedirs(options.keep, exist_ok=True)
                        with open(os.path.join(options.keep, f"{of}-{check}.motion"), "w", encoding="utf-8") as file:
                            file.write(text)
    print(f"skipped by the evaluator, which cannot decide: {skipped}")
    print(f"differential: {passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
