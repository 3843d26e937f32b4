#!/usr/bin/env python3
"""Measures start-up and hostile input, and compares them with peers. Build first: cargo build --release.

    pip install pyserial
    python3 benches/figures.py [PROGRAM]

Start-up: wall time of `check` on a ten-line script compared with /bin/true and
`python3 -c "import serial"`, in turns.
Hostile input: wall time and peak memory of files that must be refused quickly.
"""
import os
import statistics
import subprocess
import sys
import tempfile
import time

PROGRAM = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "target/release/motionseq")
FOLDER = tempfile.mkdtemp(prefix="motionseq-figures-")
NOWHERE = os.open(os.devnull, os.O_RDWR)
QUIET = [(os.POSIX_SPAWN_DUP2, NOWHERE, 0), (os.POSIX_SPAWN_DUP2, NOWHERE, 1), (os.POSIX_SPAWN_DUP2, NOWHERE, 2)]


def file(name, content):
    path = os.path.join(FOLDER, name)
    with open(path, "wb") as out:
        out.write(content)
    return path


def once(arguments):
    """Wall time in milliseconds, peak memory in MB and exit code of one run."""
    begin = time.perf_counter()
    child = os.posix_spawnp(arguments[0], arguments, os.environ, file_actions=QUIET)
    _, status, usage = os.wait4(child, 0)
    return (time.perf_counter() - begin) * 1e3, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)


def start_up():
    lines = b"servos 1500 1500\nwait 0.5s\nrocker y=10 for 1s\nbuzzer on for 100ms\nwait 1s\nservo 1 900\nwait 1s\nwheels 8 -8 8 -8 for 800ms\nservo 1 90deg\nstop\n"
    script = file("ten.motion", lines)
    runs = {"check": [PROGRAM, "check", script], "/bin/true": ["/bin/true"], "python": [sys.executable, "-c", "import serial"]}
    times = {name: [] for name in runs}
    for turn in range(220):
        for name, arguments in runs.items():
            if name != "python" or turn % 10 == 0:
                times[name].append(once(arguments)[0])
    medians = {name: statistics.median(values[2:]) for name, values in times.items()}
    spread = statistics.quantiles(times["check"], n=10)
    print(f"start-up, median ms: check {medians['check']:.2f} (p10 {spread[0]:.2f}, p90 {spread[8]:.2f}), /bin/true {medians['/bin/true']:.2f}, python import serial {medians['python']:.1f}")
    print(f"  check / true = {medians['check'] / medians['/bin/true']:.2f} (at most 2); python / check = {medians['python'] / medians['check']:.0f} (at least 10)")
    print(f"  size of the program: {os.path.getsize(PROGRAM) / 2**20:.2f} MiB")


def hostile():
    cases = {
        "empty file": b"",
        "3,000,000 open brackets": b"(" * 3_000_000,
        "3,000,000 open braces": b"{" * 3_000_000,
        "3,000,000 NUL bytes": bytes(3_000_000),
        "a time of 10^30 s": b"at 1000000000000000000000000000000s stop\n",
        "invalid UTF-8": b"servo 1 1500\n\xff\xfe\n",
        "100,000 unknown words": b"servoo\n" * 100_000,
        "a line of 1 MB": b"servo 1 1500 " * 80_000,
    }
    paths = {name: file("hostile.%d" % at, content) for at, (name, content) in enumerate(cases.items())}
    huge = os.path.join(FOLDER, "huge")
    with open(huge, "wb") as out:
        out.write(b"a" * 1_000_000)
        out.truncate(1 << 30)
    paths["a line of 1 GB"] = huge
    paths["a folder"] = FOLDER
    fifo = os.path.join(FOLDER, "fifo")
    os.mkfifo(fifo)
    paths["a FIFO"] = fifo
    for name, path in paths.items():
        wall, memory, code = once([PROGRAM, "check", path])
        print(f"  {name}: {wall:.0f} ms, {memory:.0f} MB, exit {code}")


if __name__ == "__main__":
    print("hostile input (each below 1000 ms and 128 MB, exit 1):")
    hostile()
    start_up()
    subprocess.run(["rm", "-r", FOLDER], check=True)
