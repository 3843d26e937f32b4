#!/usr/bin/env python3
"""Measures how fast long scripts are parsed, checked, rendered and decoded, compared with serde_json
reading the same events.

    cargo build --release && cargo bench --bench speed --no-run
    python3 benches/speed.py            # a few minutes

Every figure is a median of runs that take turns, printed with the spread of a whole process.
`events/s` of `render` and `decode` are those of whole processes, including compilation.
"""
import glob
import os
import shutil
import statistics
import subprocess
import tempfile
import time

PROGRAM = os.path.abspath("target/release/motionseq")
BENCH = max((path for path in glob.glob("target/release/deps/speed-*") if not path.endswith(".d")), key=os.path.getmtime)
FOLDER = tempfile.mkdtemp(prefix="motionseq-speed-")
NOWHERE = os.open(os.devnull, os.O_RDWR)
QUIET = [(os.POSIX_SPAWN_DUP2, NOWHERE, number) for number in (0, 1, 2)]
MILLION = 1_000_000


def path(name):
    return os.path.join(FOLDER, name)


def once(*arguments):
    """Wall time in seconds and peak memory in bytes of one run."""
    begin = time.perf_counter()
    child = os.posix_spawn(arguments[0], arguments, os.environ, file_actions=QUIET)
    _, status, usage = os.wait4(child, 0)
    took = time.perf_counter() - begin
    assert os.waitstatus_to_exitcode(status) == 0, arguments
    return took, usage.ru_maxrss * 1024


def in_turns(runs, turns):
    """Median wall time, lowest and highest, and peak memory, of each run."""
    found = {name: [] for name in runs}
    for _ in range(turns):
        for name, arguments in runs.items():
            found[name].append(once(*arguments))
    return {
        name: (statistics.median(took for took, _ in all), min(all)[0], max(all)[0], max(memory for _, memory in all))
        for name, all in found.items()
    }


def row(what, figure, bound):
    print(f"| {what} | {figure} | {bound} |")


def million():
    script, json, unrolled = path("flat-1000000.motion"), path("flat-1000000.json"), path("nested-1000000.motion")
    print("| a million lines or events | measured | at most or at least |")
    print("|---|---|---|")
    ours, theirs = map(float, subprocess.run([BENCH, "parse", FOLDER], capture_output=True, check=True, text=True).stdout.split())
    row("parse alone, one core, compared with serde_json", f"{ours / theirs:.2f}x ({ours * 1e3:.0f} and {theirs * 1e3:.0f} ms)", "2x")
    runs = {
        "check": [PROGRAM, "check", script],
        "peer": [BENCH, "peer", json],
        "nested": [PROGRAM, "check", unrolled],
        "bin": [PROGRAM, "render", script, "--format", "bin", "-o", path("out.bin")],
        "listing": [PROGRAM, "render", script, "-o", path("out.listing")],
        "decode": [PROGRAM, "decode", path("out.bin"), "-o", path("out.decoded")],
    }
    times = in_turns(runs, 15)
    check, low, high, memory = times["check"]
    peer = times["peer"][0]
    row("`check`, whole process, compared with the peer", f"{check / peer:.2f}x ({check * 1e3:.0f} ms, {low * 1e3:.0f} to {high * 1e3:.0f}; peer {peer * 1e3:.0f})", "3x")
    row("`check`, peak memory above the script", f"{(memory - os.path.getsize(script)) / MILLION:.0f} bytes an event", "160")
    row("`check` of 20 lines that unroll to the same number, compared with the flat one", f"{times['nested'][0] / check:.2f}x ({times['nested'][0] * 1e3:.0f} ms)", "0.3x")
    for name, what, bound in [
        ("bin", "`render --format bin`", 2),
        ("listing", "`render`, a listing", 1),
        ("decode", "`decode`", 2),
    ]:
        row(what, f"{MILLION / times[name][0] / 1e6:.1f} million frames/s", f"{bound} million")


def growth():
    print("\n| events | `check`, flat | ns an event | `check`, unrolled | ns an event |")
    print("|---|---|---|---|---|")
    for count in [10_000, 100_000, 1_000_000, 2_000_000, 10_000_000]:
        cells = []
        for kind in ["flat", "nested"]:
            script = path(f"{kind}-{count}.motion")
            if not os.path.exists(script):
                cells += ["more than 64 MiB" if kind == "flat" else "", ""]
                continue
            times = in_turns({"check": [PROGRAM, "check", script, "--max-events", "20000000"]}, 7)
            took = times["check"][0]
            cells += [f"{took * 1e3:.1f} ms", f"{took * 1e9 / count:.0f}"]
        print(f"| {count:,} | {' | '.join(cells)} |")


def scaling():
    folder = path("tests")
    os.mkdir(folder)
    with open(path("flat-10000.motion")) as lines:
        text = "".join(lines.readlines()[:1_000])
    for number in range(1_000):
        with open(os.path.join(folder, f"{number}.motion"), "w") as out:
            out.write(text)
    subprocess.run([PROGRAM, "test", folder, "--bless"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    cores = os.cpu_count()
    runs = {"one": ["/usr/bin/taskset", "-c", "0", PROGRAM, "test", folder], "all": [PROGRAM, "test", folder]}
    times = in_turns(runs, 7)
    one, all = times["one"][0], times["all"][0]
    print(f"\n`test` of 1,000 scripts of 1,000 lines: {one * 1e3:.0f} ms on one core, {all * 1e3:.0f} ms on {cores}: {one / all:.2f}x as fast")


if __name__ == "__main__":
    try:
        subprocess.run([BENCH, "scripts", FOLDER], check=True)
        million()
        growth()
        scaling()
    finally:
        shutil.rmtree(FOLDER)
