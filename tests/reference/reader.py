"""Parses a motion script: tokens, and statements as a tree."""

import dataclasses
import re


class Refused(Exception):
    """The script must not compile."""

    def __init__(self, reason, line=0):
        super().__init__(f"{reason} in line {line}")
        self.reason, self.line = reason, line


class Undecided(Exception):
    """The specification does not define the result, or it would take too long to compute."""


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
    time: tuple = None  # `for`, `over`, `every`, `within`, `at` or `+`, and its value
    ease: str = None
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
            if not self.take(",") and not self.has(")") or self.has(")") and self.tokens[self.at - 1].text == ",":
                self.fail()
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
        """A number that the word `beat` may follow without being its unit, as in `bar 1 beat 2`."""
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
        sign = (self.take("<", "<=", ">", ">=", "==", "in") or self.fail("arguments")).text
        node.arguments = [self.argument()]
        if sign == "in":
            self.expect("..")
            node.arguments.append(self.argument())
        while self.has("within") or self.peek().kind == "string":
            if self.next().text == "within":
                node.time = ("within", self.argument())
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
            if not self.take(",") and not self.has(")") or self.has(")") and self.tokens[self.at - 1].text == ",":
                self.fail()
        self.close()
        return self.with_block(node)

    def read_use(self, node):
        node.name = self.of_kind("string").text[1:-1]
        return node

    def read_on(self, node):
        self.expect("abort")
        return self.with_block(node)
