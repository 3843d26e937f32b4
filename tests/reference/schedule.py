"""Converts commands with times to frames: moves, holds, refreshes, clashes, and the load of the line."""

import dataclasses
import math
import re
from fractions import Fraction

from .reader import Refused, Undecided
from .values import half_away

DRIVES = {"rocker": "xyz", "yawhold": "xy", "wheels": "abcd", "move": "xyz", "stop": "xyz"}


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


# The `in-` curves; a second one is used for `in-out-` if that is made of another curve.
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
    """A frame: its exact time, its rank within the microsecond, and its content."""

    at: Fraction
    rank: int
    frame: str
    kind: str
    line: int
    holds: bool = False  # a drive command that is refreshed


class Schedule:
    """Converts actions to frames."""

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
        starts = {
            (resource, micros(action.at))
            for action in self.actions
            if not action.over
            for resource in self.resources(action)
        }
        events = []
        for action in self.actions:
            events.append((micros(action.at), action.order, 0, action.at, action))
            if action.over:
                steps = math.ceil(action.lasts * self.script.rate) - 1
                for step in range(1, steps + 2):
                    at = action.at + (step / self.script.rate if step <= steps else action.lasts)
                    events.append((micros(at), action.order, step, at, action))
            elif action.lasts is not None:
                at = action.at + action.lasts
                if (self.resources(action)[0], micros(at)) not in starts:
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
        """Refuses overlaps. Times are equal if they are in the same microsecond."""
        things = {}
        for action in self.actions:
            for resource in self.resources(action):
                until = micros(action.at + (action.lasts or 0))
                things.setdefault(resource, []).append(
                    (micros(action.at), until, action.lasts is None, action.order, action)
                )
        for spans in things.values():
            spans.sort(key=lambda span: span[:4])
            for place, first in enumerate(spans):
                for second in spans[place + 1 :]:
                    if second[0] > first[1]:
                        break
                    if self.is_clash(*first[:4], *second[:4]):
                        raise Refused("clash", max(first, second, key=lambda span: span[3])[4].node.line)

    @staticmethod
    def is_clash(start, until, is_instant, order, second_start, _, is_second_instant, second_order):
        """Whether two actions on one resource clash; the first does not start later."""
        if start == second_start:
            return is_instant == is_second_instant or (order > second_order) == is_instant
        return second_start < until or second_order < order

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
            eased(action.node.ease or "linear", 0.0)
            if all(origin is None for origin, _ in action.axes):
                return
        part = step / (self.script.rate * action.lasts)
        is_target = part >= 1
        share = 1.0 if is_target else eased(action.node.ease or "linear", float(part))
        is_settled = bool(re.search("linear|quad|cubic|quart|quint|back", action.node.ease or "linear"))
        values = []
        for start, (_, target) in zip(action.starts, action.axes):
            values.append(target if is_target else start if step == 0 else start + (target - start) * share)
        # The result also depends on how a value with a long fraction was computed.
        is_settled &= all(value % 0.125 == 0 for value in [*action.starts, *(target for _, target in action.axes)])
        values = self.checked(action, values, is_settled or step == 0 or is_target)
        if action.verb in DRIVES:
            if drive_frame(action.verb, values) != self.drive_frame:
                self.send_drive(action, values, "sample")
            else:
                self.drive = ("stop" if self.drive_frame == STOP else action.verb, values)
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
        # A rocker at zero is a stop.
        self.drive, self.drive_frame = ("stop" if data == STOP else verb, values), data

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
            self.sent.append(
                Sent(self.end, 3, STOP, "closing", self.raw.node.line if self.raw else self.drives[-1].line)
            )
        if self.raw or self.buzzer and self.buzzer.index:
            self.sent.append(Sent(self.end, 3, BUZZER_OFF, "closing", (self.raw or self.buzzer).node.line))
        expects = sorted(self.script.expects, key=lambda expect: expect[0])
        if expects:
            self.sent.append(Sent(Fraction(0), 0, frame(5, [0]), "auto", expects[0][1]))
            self.sent.append(Sent(self.end, 4, frame(5, [9]), "auto", expects[-1][1]))

    def check_line(self, sent):
        """Frames that are due together wait in a queue; more than 50 ms of lateness is an error."""
        baud, free = self.script.baud, 0
        for one in sent:
            due = micros(one.at) * baud
            if free > due + 50_000 * baud:
                raise Refused("wire-full", one.line)
            free = max(free, due) + len(one.frame) // 2 * 10 * 10**6
