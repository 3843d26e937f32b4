#!/usr/bin/env python3
"""Differential and metamorphic tests of the compiler.

An evaluator of the motion language, written from its specification without any code of the program,
computes the frames of random scripts. `motionseq render` must print the same microseconds, bytes,
kinds and lines. A script that one of them refuses must be refused by the other. More checks need no
evaluator: a script that was rewritten without a change of meaning (a call inlined, a comment added,
formatted, played at another speed, cut in two) must send the same frames.

A script is skipped if its frames depend on the last bit of a sine, a power of two or a bounce (a
sample halfway between two whole numbers).

Not covered: several robots, the places where a gate is refused, boards other than the Raspblock, and the text of messages.

If the program has a known bug, name it here and make the random scripts avoid it until it is fixed.
"""

import argparse
import concurrent.futures
import functools
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from fractions import Fraction

sys.dont_write_bytecode = True

from reference.evaluator import evaluate
from reference.reader import SETTINGS, Refused, Undecided
from reference.scripts import random_script


class Program:
    """The program under test, with its own folder."""

    def __init__(self, path, folder):
        self.path, self.folder, self.rendered = path, folder, {}

    def run(self, *arguments, text=""):
        command = [self.path, *arguments]
        done = subprocess.run(
            command, input=text.encode(), capture_output=True, cwd=self.folder, timeout=120, check=False
        )
        if done.returncode not in (0, 1):
            raise Broken(f"exit code {done.returncode} of {' '.join(arguments)}: {done.stderr.decode()[-300:]}")
        return done.returncode == 0, done.stdout, done.stderr.decode()

    def render(self, text, *options):
        """The frames as `evaluate` returns them, or the code of the first error as a string."""
        if "use " in text or (text, options) not in self.rendered:
            self.rendered[text, options] = self.read(
                *self.run("render", "-q", "--format", "jsonl", *options, "-", text=text)
            )
        return self.rendered[text, options]

    @staticmethod
    def read(is_fine, out, errors):
        if not is_fine:
            return errors.split("\n", 1)[0]
        rows = (json.loads(line) for line in out.splitlines())
        return [(row["t_us"], row["frame"], row["kind"], row["line"]) for row in rows]


class Broken(Exception):
    """The program crashed or did something that no script may cause."""


def difference(wanted, found):
    """How two results of `render` differ; None if they are equal."""
    if isinstance(wanted, str) or isinstance(found, str):
        shown = [result if isinstance(result, str) else f"{len(result)} frames" for result in (wanted, found)]
        both = isinstance(wanted, str) and isinstance(found, str)
        return None if both else f"one is refused: expected {shown[0]}, found {shown[1]}"
    for place, (first, second) in enumerate(zip(wanted, found)):
        if first != second:
            return f"frames differ: number {place + 1}, expected {first}, found {second}"
    if len(wanted) != len(found):
        return f"frames differ: expected {len(wanted)}, found {len(found)}; {max(wanted, found, key=len)[min(len(wanted), len(found))]}"
    return None


def without_lines(frames):
    return frames if isinstance(frames, str) else [sent[:3] for sent in frames]


@functools.lru_cache(maxsize=4)
def evaluated(text, speed=1):
    try:
        return evaluate(text, speed=speed)
    except Refused as refused:
        return str(refused)


def blocks_of(lines):
    """The blocks of several lines: the numbers of their first and last lines, sorted by the last."""
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
    return any("together" in lines[first] for first in around[-1:]) or any(
        re.match(r"\s*(if|\})", lines[first]) for first in around
    )


def check_evaluator(program, text, _):
    """The program sends the frames that the evaluator computes."""
    return difference(evaluated(text), program.render(text))


def check_speed(program, text, dice):
    """Also at another speed: refreshes and samples keep their real time."""
    speed = dice.choice(["2", "0.5", "0.3", "1.25", "10", "0.1"])
    return difference(evaluated(text, Fraction(speed)), program.render(text, "--speed", speed))


def check_fmt(program, text, _):
    """Formatting is idempotent and does not change the frames."""
    is_fine, once, errors = program.run("fmt", "-", text=text)
    if not is_fine:
        return None if isinstance(program.render(text), str) else f"not formatted: {errors[:200]}"
    once = once.decode()
    twice = program.run("fmt", "-", text=once)[1].decode()
    return "formatting twice changes more" if once != twice else difference(program.render(text), program.render(once))


def check_spaces(program, text, dice):
    """Other spaces change neither frames nor lines."""

    def respaced(line):
        if '"' in line:
            return line
        line = re.sub(r" *-> *", lambda _: dice.choice(["->", " -> ", " ->", "->  "]), line)
        line = re.sub(r"(?<![<>=]) *= *(?!=)", lambda _: dice.choice(["=", " = ", "= ", "\t="]), line)
        line = re.sub(r" *; *", lambda _: dice.choice([";", " ; ", "; ", "\t;  "]), line)
        line = re.sub(r" (?!beats?\b|bars?\b)", lambda _: dice.choice([" ", " ", "  ", "\t"]), line)
        return dice.choice(["", "  ", "\t"]) + line.strip() + dice.choice(["", " "])

    changed = "".join(respaced(line) + "\n" for line in text.splitlines())
    return difference(program.render(text), program.render(changed)) or check_fmt(program, changed, dice)


def check_comment(program, text, dice):
    """Comments, empty lines, other line ends and a byte order mark change only line numbers."""
    lines = text.splitlines()
    place = dice.randint(0, len(lines))
    lines.insert(place, dice.choice(["", "# a comment { (", "  ", "\t# servo 1 1500"]))
    lines = [line + dice.choice(["", "", "  # a comment", "\t"]) for line in lines]
    changed = dice.choice(["", "\ufeff"]) + dice.choice(["\n", "\r\n"]).join(lines) + dice.choice(["", "\n"])
    wanted = program.render(text)
    if not isinstance(wanted, str):
        wanted = [(*sent, line + (line > place)) for *sent, line in wanted]
    return difference(wanted, program.render(changed))


# What may be wrong with a gate at a place where a script has none.
AT_GATES = ["gate-overlap", "gate-time", "gate-refresh", "setting-place"]


def check_gate(program, text, dice):
    """A gate between two lines changes no frame at any other time."""
    lines = text.splitlines()
    inside = {number for first, last in blocks_of(lines) for number in range(first, last)}
    places = [number + 1 for number in range(len(lines)) if number not in inside]
    places = [place for place in places if not (lines[place:] and lines[place].startswith("else"))]
    if not places:
        return None
    place = dice.choice(places)
    gate = dice.choice(["wait go within 5s", "wait go within 60s or continue", "wait until yaw > 3deg within 5s"])
    changed = program.render("\n".join(lines[:place] + [gate] + lines[place:]) + "\n")
    wanted = program.render(text)
    if changed in AT_GATES or isinstance(wanted, str):
        return None
    if isinstance(changed, str):
        return f"refused: {changed}"
    moment = next(at for at, _, kind, _ in changed if kind == "gate")
    found = [sent for sent in changed if sent[0] != moment and sent[2] != "auto"]
    wanted = [(*sent, line + (line > place)) for *sent, line in wanted if sent[0] != moment and sent[2] != "auto"]
    return difference(wanted, found)


def check_inline(program, text, _):
    """A call that is inlined as a separate pass, with its arguments as `let`s, sends the same."""
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
        # Arguments come before defaults, and so do their random numbers.
        given = [
            part.split(" = ")[0] if re.match(r"\w+ = ", part) else list(values)[place]
            for place, part in enumerate(split(call[3]))
        ]
        order = given + [name for name in values if name not in given]
        result += [call[1] + "repeat 1 {", *(f"let {name} = {values[name]}" for name in order), *body, "}"]
    changed = "\n".join(result) + "\n"
    return difference(without_lines(program.render(text)), without_lines(program.render(changed)))


def split(arguments):
    """Splits arguments at the commas outside of parentheses."""
    parts, depth = [""], 0
    for sign in arguments:
        depth += (sign == "(") - (sign == ")")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts if part.strip()]


def check_unroll(program, text, _):
    """The passes of a `repeat`, written out, send the same."""
    lines = text.splitlines()
    for first, last in blocks_of(lines):
        head = re.match(r"(\s*)repeat ([1-9]) (?:as (\w+) )?\{$", lines[first])
        if not head or inside_together(lines, first) or lines[first + 1].strip().startswith(("tempo", "meter")):
            continue
        count, name, body = int(head[2]), head[3], lines[first + 1 : last]
        passes = [
            ["repeat 1 {"] + ([f"let {name} = {number}"] if name else []) + body + ["}"] for number in range(count)
        ]
        changed = lines[:first] + [line for one in passes for line in one] + lines[last + 1 :]
        found = program.render("\n".join(changed) + "\n")
        return difference(without_lines(program.render(text)), without_lines(found))
    return None


def wrapped(text, head, foot):
    """The script with everything after its settings and phrases between two lines; None if impossible."""
    lines = text.splitlines()
    top = [number for number, line in enumerate(lines) if line.startswith(("def ", "on ", *SETTINGS))]
    ends = {first: last for first, last in blocks_of(lines)}
    begin = max([ends.get(number, number) + 1 for number in top], default=0)
    if begin == len(lines) or any(not line.startswith(("let ", "def ", " ", "}", *SETTINGS)) for line in lines[:begin]):
        return None
    return "\n".join(lines[:begin] + [head] + lines[begin:] + [foot]) + "\n"


def check_wrapped(program, text, dice):
    """Putting everything after the settings in a block that changes nothing sends the same."""
    changed = wrapped(
        text,
        *dice.choice(
            [
                ("{", "}"),
                ("together {\n{", "}\n}"),
                ("together {\nif 1 == 1 {\n{", "}\n}\n}"),
                ("repeat 1 {", "}"),
                ("if 1 == 1 {", "}"),
                ("def all() {", "}\nall()"),
            ]
        ),
    )
    return changed and difference(without_lines(program.render(text)), without_lines(program.render(changed)))


def check_use(program, text, dice):
    """The `let`s and `def`s at the start of a script may be in a used file."""
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
    """`--set` is equivalent to an edit of the `let`."""
    lets = re.findall(r"^let (v\d+) = ([\w.]+)$", text, re.MULTILINE)
    if not lets:
        return None
    name, value = dice.choice(lets)
    value = f"{dice.randint(1, 3)}.5{value.lstrip('0123456789.') or ''}"
    changed = re.sub(rf"^let {name} = .*$", f"let {name} = {value}", text, flags=re.MULTILINE)
    return difference(program.render(changed), program.render(text, "--set", f"{name}={value}"))


def check_parts(program, text, dice):
    """The two parts of a script send the frames before and after the cut, at the same distances."""
    whole = program.render(text)
    moments = [] if isinstance(whole, str) else [sent[0] for sent in whole]
    if not any(moments):
        return None
    cut = max(1, dice.choice([dice.choice(moments), dice.randint(0, max(moments))]))
    before, after = program.render(text, "--to", f"{cut}us"), program.render(text, "--from", f"{cut}us")
    if isinstance(before, str) or isinstance(after, str):
        return (
            None
            if "wire-full" in (before, after)
            else f"a part is refused: {before if isinstance(before, str) else after}"
        )
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
    """Two passes are one pass repeated; they are refused only if two passes of a `repeat` are."""
    once, twice = program.render(text), program.render(text, "--loop", "2")
    if isinstance(once, str) or not once:
        return None
    if twice == "wire-full":
        return None  # every pass sends its last frames, some of which a `repeat` leaves out
    if isinstance(twice, str):
        repeated = wrapped(text, "repeat 2 {", "}")
        is_fine = repeated and not isinstance(program.render(repeated), str)
        return f"refused, and the same `repeat` is not: {twice}" if is_fine else None
    again = twice[len(once) :]
    shift = again[0][0] - once[0][0] if again else 0
    return difference(once + [(at + shift, *rest) for at, *rest in once], twice)


def check_parentheses(program, text, _):
    """A number in parentheses is the same number."""
    changed = [
        re.sub(r"(?<= )(\d{3,4})(?= |;|$)", r"(\1)", line) if line.strip().startswith("servo") else line
        for line in text.splitlines()
    ]
    return difference(program.render(text), program.render("\n".join(changed) + "\n"))


def check_breaks(program, text, _):
    """A line may break inside parentheses."""
    changed = re.sub(r"\(([^()\"\n]*) ([-+*/%]) ", r"(\1\n  \2\n ", text)
    return difference(without_lines(program.render(text)), without_lines(program.render(changed)))


def check_formats(program, text, _):
    """All formats agree, `check` agrees with `render`, and `decode` reads what was sent."""
    wanted = program.render(text)
    if program.run("check", "-q", "-", text=text)[0] == isinstance(wanted, str):
        return "check and render disagree"
    if isinstance(wanted, str):
        return None
    frames = [sent[1] for sent in wanted]
    if program.run("render", "-q", "--format", "bin", "-", text=text)[1].hex().upper() != "".join(frames):
        return "bin differs from jsonl"
    rows = [line.split("\t") for line in program.run("render", "-q", "-", text=text)[1].decode().splitlines()]
    if [(row[0], row[1].replace(" ", "")) for row in rows] != [
        (f"{at // 10**6}.{at % 10**6:06}", data) for at, data, *_ in wanted
    ]:
        return "listing differs from jsonl"
    if any(row[2].startswith("raw") for row in rows):
        return None
    decoded = program.run("decode", "-", text="\n".join(row[1] for row in rows))[1].decode().splitlines()
    decoded = [line.split("\t")[-2:] for line in decoded if "\t" in line]
    return None if decoded == [row[1:3] for row in rows] else "decode differs from the listing"


CHECKS = {
    name.removeprefix("check_"): function for name, function in list(globals().items()) if name.startswith("check_")
}
ALWAYS, OFTEN = ["evaluator"], 3  # checks for every script, and how many of the others


def outcome(program, check, text, seed):
    """The fault that a check finds in a script; None if there is none."""
    try:
        return CHECKS[check](program, text, random.Random(seed))
    except Undecided:
        return None
    except Broken as broken:
        return f"broken: {broken}"


def reduced(text, is_failing):
    """The script with as many lines and blocks removed as possible."""
    lines = text.splitlines()
    found = True
    while found:
        found = False
        blocks = blocks_of(lines)
        tries = [set(range(first, last + 1)) for first, last in sorted(blocks)] + [
            {first, last} for first, last in blocks
        ]
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
    """Runs all checks on one script: which passed, and what failed."""
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
    parser.add_argument(
        "--seed", type=int, default=None, help="the seed of the first script; each later one has the next number"
    )
    parser.add_argument("--seconds", type=float, help="start no script after this time")
    parser.add_argument("--programs", type=int, help="the number of scripts")
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
    print(f"skipped because the evaluator cannot decide: {skipped}")
    print(f"differential: {passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
