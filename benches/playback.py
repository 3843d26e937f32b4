#!/usr/bin/env python3
"""Prints how exactly and how safely scripts are played, each figure beside a peer's, from one run. Needs root, for the peers.

    apt install rt-tests bsdutils && pip install pyserial
    cargo build --release && cargo bench --bench lateness --no-run
    sudo python3 benches/playback.py [--short]

Lateness: when write(2) is called, against when the frame is due, beside `cyclictest`, in turns; medians of the runs.
Drift: the last frame at the far end of a pty, beside a Python time.sleep loop over pyserial and `scriptreplay`.
Guard: from a SIGKILL, or a SIGSTOP, of the player to the stop frame at the far end.
"""
import glob
import os
import pty
import select
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import tty

SHORT = "--short" in sys.argv
PROGRAM = os.path.abspath("target/release/motionseq")
STOP = bytes.fromhex("FFFE0308010000000000 00010D".replace(" ", ""))
FOLDER = tempfile.mkdtemp(prefix="motionseq-playback-")
RUNS = 3 if SHORT else 5
FRAMES = 1000 if SHORT else 5000
STEP_US = 1000
# An ordinary user. cyclictest wants to be allowed real-time priority before it runs at all.
USER = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
MAY_RUN_BEFORE_OTHERS = USER + ["--inh-caps=+sys_nice", "--ambient-caps=+sys_nice"]


def bench():
    """A copy of the lateness program that anybody may run."""
    built = max((p for p in glob.glob("target/release/deps/lateness-*") if not p.endswith(".d")), key=os.path.getmtime)
    os.chmod(FOLDER, 0o755)
    return shutil.copy(built, os.path.join(FOLDER, "lateness"))


def lateness(program, *options, user=True):
    """p50, p99 and last, in nanoseconds."""
    command = [program, "--frames", str(FRAMES), "--step-us", str(STEP_US), *options]
    out = subprocess.run((USER if user else []) + command, stdout=subprocess.PIPE, text=True, check=True).stdout.split()
    return {name: int(value) for name, value in zip(out[::2], out[1::2])}


def cyclictest(*options, before=()):
    """p50 and p99 of cyclictest's histogram, in nanoseconds."""
    command = [*before, "cyclictest", "-q", "-N", "-h", "200000", "-i", str(STEP_US), "-l", str(FRAMES), *options]
    out = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True).stdout
    counts = [tuple(map(int, line.split())) for line in out.splitlines() if line[:1].isdigit()]
    found, seen = {}, 0
    for value, count in counts:
        seen += count
        for name, part in (("p50", 0.5), ("p99", 0.99)):
            if seen >= part * FRAMES:
                found.setdefault(name, value)
    # What is beyond the histogram is at least as late as its end.
    return {"p50": found.get("p50", 200000), "p99": found.get("p99", 200000)}


def middle(runs, name):
    return statistics.median(run[name] for run in runs) / 1000


def exactness():
    program = bench()
    kinds = {
        "ours": lambda: lateness(program),
        "ours, no guard": lambda: lateness(program, "--no-guard"),
        "cyclictest -m -p 90, same user": lambda: cyclictest("-p", "90", before=MAY_RUN_BEFORE_OTHERS),
        "cyclictest, no priority": lambda: cyclictest("--policy=other", before=MAY_RUN_BEFORE_OTHERS),
        "ours --realtime": lambda: lateness(program, "--realtime", user=False),
        "cyclictest -m -p 90, root": lambda: cyclictest("-m", "-p", "90"),
    }
    results = {name: [] for name in kinds}
    for _ in range(RUNS):
        for name, run in kinds.items():
            results[name].append(run())
    print(f"lateness at write(2), {FRAMES} frames {STEP_US} us apart, medians of {RUNS} runs in turns, us:")
    for name, runs in results.items():
        last = f"  last frame {middle(runs, 'last'):8.1f}" if "last" in runs[0] else ""
        print(f"  {name:32} p50 {middle(runs, 'p50'):8.2f}  p99 {middle(runs, 'p99'):8.1f}{last}")
    ours, peer = middle(results["ours"], "p50"), middle(results["cyclictest -m -p 90, same user"], "p50")
    print(f"  p50 / cyclictest's p50, both as an ordinary user: {ours / peer:.2f} (at most 1.25)")
    print(f"  p50 with --realtime: {middle(results['ours --realtime'], 'p50'):.2f} us (below 1)")
    print(f"  the guard adds {ours - middle(results['ours, no guard'], 'p50'):+.2f} us to p50 (at most 10)")
    print(f"  last frame, worst run: {max(run['last'] for run in results['ours']) / 1000:.1f} us (below 1000)")
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count())]
    try:
        loaded = {"ours": [], "cyclictest": []}
        for _ in range(RUNS):
            loaded["ours"].append(lateness(program, "--realtime", user=False)["p99"])
            loaded["cyclictest"].append(cyclictest("-m", "-p", "90")["p99"])
    finally:
        for process in busy:
            process.kill()
            process.wait()
    ours, peer = min(loaded["ours"]) / 1000, min(loaded["cyclictest"]) / 1000
    print(f"  a busy loop on each core, --realtime, best p99 of {RUNS}: {ours:.1f}, cyclictest {peer:.1f}: {ours / peer:.2f} (at most 1.5)")


class Port:
    """A pty whose far end notes when bytes come."""

    def __init__(self):
        self.far, self.near = pty.openpty()
        tty.setraw(self.near)
        self.path = os.ttyname(self.near)

    def read(self, timeout=5):
        """What came and when; nothing at a hang-up or after so many seconds."""
        if not select.select([self.far], [], [], timeout)[0]:
            return b"", 0
        now = time.monotonic()
        try:
            return os.read(self.far, 4096), now
        except OSError:
            return b"", now

    def close(self, near_only=False):
        """The near end is held until the program has the port: a pty that nobody holds is one that has hung up."""
        if self.near is not None:
            os.close(self.near)
            self.near = None
        if not near_only:
            os.close(self.far)


def last_frame(start, frames, step_us):
    """How late the last frame comes at the far end, against the first, in milliseconds."""
    port = Port()
    child = start(port)
    first = last = None
    pending = frames * 8
    try:
        while pending > 0:
            data, now = port.read()
            if not data:
                break
            first = first or now
            last = now
            pending -= len(data)
    finally:
        child.kill()
        child.wait()
        port.close()
    return (last - first) * 1e3 - (frames - 1) * step_us / 1e3


SLEEPER = """
import serial, sys, time
port = serial.Serial(sys.argv[1], 115200)
for n in range({frames}):
    pulse = 1000 + n % 2
    body = [2, 3, 1, pulse >> 8, pulse & 255]
    port.write(bytes([255, 254, *body, sum(body) & 255]))
    time.sleep({step})
"""


def drift(frames, step_us=5000):
    script, timing, typescript = (os.path.join(FOLDER, name) for name in ("drift.motion", "timing", "typescript"))
    with open(script, "w") as out:
        out.writelines(f"at {n * step_us}us servo 1 {1000 + n % 2}\n" for n in range(frames))
    with open(timing, "w") as out:
        out.writelines(f"{step_us / 1e6:.6f} 8\n" for n in range(frames))
    with open(typescript, "wb") as out:
        out.write(b"Script started\n")
        out.write(subprocess.run([PROGRAM, "render", script, "--format", "bin"], stdout=subprocess.PIPE, check=True).stdout)
    sleeper = SLEEPER.format(frames=frames, step=step_us / 1e6)
    quiet = {"stdin": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    peers = {
        "motionseq play": lambda port: subprocess.Popen([PROGRAM, "play", "-q", script, "--port", port.path], **quiet),
        "Python time.sleep, pyserial": lambda port: subprocess.Popen([sys.executable, "-c", sleeper, port.path], **quiet),
        "scriptreplay": lambda port: subprocess.Popen(["scriptreplay", "-t", timing, typescript], stdout=port.near, **quiet),
    }
    late = {name: last_frame(start, frames, step_us) for name, start in peers.items()}
    print(f"drift of the last of {frames} frames {step_us} us apart, at the far end, ms:")
    for name, value in late.items():
        print(f"  {name:32} {value:+10.3f}")


def until_stop(send, options=()):
    """Milliseconds from a signal to the stop frame at the far end; None where none came."""
    script = os.path.join(FOLDER, "long.motion")
    with open(script, "w") as out:
        out.write("rocker x=10; buzzer on\nwait 1h\nstop; buzzer off\n")
    port = Port()
    command = [PROGRAM, "play", script, "--port", port.path, *options]
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port.read()
        port.close(near_only=True)
        # A random phase between two refreshes.
        time.sleep(0.02 + 0.05 * (os.urandom(1)[0] / 255))
        while select.select([port.far], [], [], 0)[0]:
            port.read()
        begin = time.monotonic()
        os.kill(child.pid, send)
        received = b""
        while True:
            data, now = port.read()
            if not data:
                return None
            received += data
            if STOP in received:
                return (now - begin) * 1e3
    finally:
        child.kill()
        child.wait()
        # The guard ends when it has stopped the robot, and with it the port.
        while port.read(2)[0]:
            pass
        port.close()


def guard():
    kills = [until_stop(signal.SIGKILL) for _ in range(50 if SHORT else 200)]
    seen = sorted(value for value in kills if value is not None)
    print(f"SIGKILL to the stop at the far end: {len(seen)} of {len(kills)} stopped, p50 {statistics.median(seen):.2f} ms (at most 1), p99 {seen[(len(seen) - 1) * 99 // 100]:.2f} ms (at most 10), max {seen[-1]:.2f}")
    hangs = [until_stop(signal.SIGSTOP, ("--max-late", "50ms")) for _ in range(10 if SHORT else 30)]
    seen = [value for value in hangs if value is not None]
    print(f"SIGSTOP to the stop, --max-late 50ms: {len(seen)} of {len(hangs)} stopped, median {statistics.median(seen):.0f} ms (at most 150), max {max(seen):.0f}")


if __name__ == "__main__":
    try:
        guard()
        exactness()
        drift(1000 if SHORT else 5000)
    finally:
        shutil.rmtree(FOLDER)
