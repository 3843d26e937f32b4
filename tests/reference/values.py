"""Values of the motion language: numbers with units, exact times, and arithmetic."""

import math
import re
from fractions import Fraction

from .reader import Refused, Undecided

# Values are pairs of a kind and a number: a Fraction of seconds for times and moments, a bool for truths, else a float.
TIME_UNITS = {"h": 3600, "min": 60, "m": 60, "s": 1, "ms": Fraction(1, 10**3), "us": Fraction(1, 10**6)}
OTHER_UNITS = {"deg", "V", "bpm", "hz"}


def exact(seconds):
    """A time as it is stored: rounded to 10⁻¹⁵ s if the fraction (of nanoseconds) needs more than 64 bits."""
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
    """Rounded half away from zero; undecided if the last bit of an inexact number decides."""
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
    if kind != other or kind == "truth" and sign != "==":
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


def whole(value, low=0, high=2**31 - 1):
    number = of_kind(value, "")
    if number != math.floor(number):
        raise Refused("not-whole")
    if not low <= number <= high:
        raise Refused("out-of-range")
    return int(number)
