#!/usr/bin/env python3
"""Measures how precisely and how safely scripts are played, and compares that with peers. The peers
need root.

    apt install rt-tests bsdutils && pip install pyserial
    cargo build --release && cargo bench --bench lateness --no-run
    sudo python3 benches/playback.py [--short]

Lateness: the time of write(2) relative to the due time of the frame, compared with `cyclictest`, in
turns; medians of the runs. Ours polls the clock before a deadline, cyclictest only sleeps: the ratio
compares what users get, not how fast a thread wakes.
Drift: the last frame at the far end of a pty, compared with a Python time.sleep loop over pyserial
and with `scriptreplay`.
Gates: from the last byte of a report that opens a gate to the next frame at the far end, compared
with a Python loop over pyserial that waits for the same report.
Guard: from a SIGKILL or SIGSTOP of the player to the stop frame at the far end.
"""
import ctypes
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
STOP = bytes.fromhex("FFFE030801000000000000010D")
FOLDER = tempfile.mkdtemp(prefix="motionseq-playback-")
RUNS = 3 if SHORT else 5
FRAMES = 1000 if SHORT else 5000
BUSY_FRAMES = 1000 if SHORT else 2000
# Longer than 2 ms, so that the player has time to poll the port and to send heartbeats to the guard.
STEP_US = 2500
# The precision of times at the far end, in milliseconds. Smaller values count as this much in a ratio.
FAR_END = 0.1
# An ordinary user. cyclictest needs the permission for real-time priority, even if it does not use it.
USER = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
MAY_RUN_BEFORE_OTHERS = USER + ["--inh-caps=+sys_nice", "--ambient-caps=+sys_nice"]


def bench():
    """A copy of the lateness program that every user may run."""
    built = max((p for p in glob.glob("target/release/deps/lateness-*") if not p.endswith(".d")), key=os.path.getmtime)
    os.chmod(FOLDER, 0o755)
    return shutil.copy(built, os.path.join(FOLDER, "lateness"))


def lateness(program, *options, user=True, frames=FRAMES):
    """p50, p99 and last, in nanoseconds."""
    command = [program, "--frames", str(frames), "--step-us", str(STEP_US), *options]
    out = subprocess.run((USER if user else []) + command, stdout=subprocess.PIPE, text=True, check=True).stdout.split()
    return {name: int(value) for name, value in zip(out[::2], out[1::2])}


def cyclictest(*options, before=(), frames=FRAMES, exact=False):
    """p50 and p99 of cyclictest's histogram, in nanoseconds. `exact` sets the timer slack of the player.

    It tries real-time priority, and giving that back restores the slack of its parent; so a shell in between has it.
    """
    command = [*before, "cyclictest", "-q", "-N", "-h", "1000000", "-i", str(STEP_US), "-l", str(frames), *options]
    slack = None
    if exact:
        command = ["sh", "-c", '"$@"; exit $?', "sh", *command]
        slack = lambda: ctypes.CDLL(None).prctl(29, 1)  # PR_SET_TIMERSLACK
    out = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True, preexec_fn=slack).stdout
    # Values beyond the histogram are at least as late as its end.
    found, seen = {"p50": 1000000, "p99": 1000000}, 0
    for value, count in (map(int, line.split()) for line in out.splitlines() if line[:1].isdigit()):
        for name, part in (("p50", 0.5), ("p99", 0.99)):
            if seen < part * frames <= seen + count:
                found[name] = value
        seen += count
    return found


def middle(runs, name):
    return statistics.median(run[name] for run in runs) / 1000


def figure(text, value, unit, bound, least=False):
    kept = value >= bound if least else value <= bound
    shown = value if isinstance(value, int) else f"{value:.3f}"
    print(f"  {text:58} {shown:>9} {unit:3} ({'at least' if least else 'at most'} {bound}{'' if kept else ': NOT KEPT'})")


def exactness():
    program = bench()
    peer, peer_root = "cyclictest --policy=other, slack 1 ns", "cyclictest -m -p 90, root"
    kinds = {
        "ours": lambda: lateness(program),
        "ours, no guard": lambda: lateness(program, "--no-guard"),
        peer: lambda: cyclictest("--policy=other", before=MAY_RUN_BEFORE_OTHERS, exact=True),
        "ours --realtime, root": lambda: lateness(program, "--realtime", user=False),
        peer_root: lambda: cyclictest("-m", "-p", "90"),
    }
    results = {name: [] for name in kinds}
    for _ in range(RUNS):
        for name, run in kinds.items():
            results[name].append(run())
    print(f"lateness at write(2), {FRAMES} frames {STEP_US} us apart, medians of {RUNS} runs in turns, us (lowest and highest p50):")
    for name, runs in results.items():
        low, high = min(run["p50"] for run in runs) / 1000, max(run["p50"] for run in runs) / 1000
        print(f"  {name:38} p50 {middle(runs, 'p50'):8.2f} ({low:.2f} to {high:.2f})  p99 {middle(runs, 'p99'):8.1f}")
    ours = middle(results["ours"], "p50")
    figure("p50 / cyclictest's, an ordinary user", ours / middle(results[peer], "p50"), "", 1.25)
    figure("p50 / that of cyclictest -m -p 90 as root", ours / middle(results[peer_root], "p50"), "", 1.25)
    figure("p50 with --realtime", middle(results["ours --realtime, root"], "p50"), "us", 1)
    figure("what the guard adds to p50", ours - middle(results["ours, no guard"], "p50"), "us", 10)
    figure("last frame, worst run", max(run["last"] for run in results["ours"]) / 1000, "us", 1000)
    busy, loaded = [], {"ours": [], "cyclictest": []}
    try:
        for _ in range(os.cpu_count()):
            busy.append(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
        for _ in range(RUNS):
            loaded["ours"].append(lateness(program, "--realtime", user=False, frames=BUSY_FRAMES)["p99"] / 1000)
            loaded["cyclictest"].append(cyclictest("-m", "-p", "90", frames=BUSY_FRAMES)["p99"] / 1000)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    print(f"a busy loop on each core, --realtime, {BUSY_FRAMES} frames, p99 of each of {RUNS} runs, us:")
    for name, runs in loaded.items():
        print(f"  {name:38} {'  '.join(f'{run:.1f}' for run in runs)}")
    figure("best p99 / cyclictest's best", min(loaded["ours"]) / min(loaded["cyclictest"]), "", 1.5)


def arm():
    program = bench()
    kinds = ("--raspblock", "--arm")
    results = {kind: [] for kind in kinds}
    for _ in range(RUNS):
        for kind in kinds:
            results[kind].append(lateness(program, kind, frames=1200 if SHORT else 6000))
    print(f"servos at 50 Hz with reports, as the player notes it, medians of {RUNS} runs in turns, us:")
    for kind, runs in results.items():
        print(f"  {kind[2:]:38} p50 {middle(runs, 'p50'):8.2f}  p99 {middle(runs, 'p99'):8.1f}")
    figure("p50 of six bus servos / that of a Raspblock", middle(results["--arm"], "p50") / middle(results["--raspblock"], "p50"), "", 1.25)


class Port:
    """A pty whose far end records when bytes arrive."""

    def __init__(self):
        self.far, self.near = pty.openpty()
        tty.setraw(self.near)
        self.path = os.ttyname(self.near)

    def read(self, timeout=5):
        """The next bytes and their time; nothing after a hang-up or a timeout in seconds."""
        if not select.select([self.far], [], [], timeout)[0]:
            return b"", 0
        now = time.monotonic()
        try:
            return os.read(self.far, 4096), now
        except OSError:
            return b"", now

    def close(self, near_only=False):
        """Keeps the near end open until the program has the port: a pty that no process has open is hung up."""
        if self.near is not None:
            os.close(self.near)
            self.near = None
        if not near_only:
            os.close(self.far)


def last_frame(start, frames, step_us, expected):
    """The lateness of the last frame at the far end, relative to the most punctual one, in milliseconds.

    Against the first, a reader that was late for that one would hide as much of what comes after.
    """
    port = Port()
    child = start(port)
    received, origin, last = b"", float("inf"), 0
    try:
        while len(received) < len(expected):
            data, now = port.read()
            if not data:
                break
            received += data
            last = now - (min(len(received) // 8, frames) - 1) * step_us / 1e6
            origin = min(origin, last)
    finally:
        child.kill()
        child.wait()
        port.close()
    # A run that lost frames would seem punctual. scriptreplay adds a line end.
    if not received.startswith(expected):
        sys.exit(f"the far end got {len(received)} bytes of {len(expected)}, or wrong ones")
    return (last - origin) * 1e3


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
    expected = subprocess.run([PROGRAM, "render", script, "--format", "bin"], stdout=subprocess.PIPE, check=True).stdout
    with open(typescript, "wb") as out:
        out.write(b"Script started\n" + expected)
    sleeper = SLEEPER.format(frames=frames, step=step_us / 1e6)
    quiet = {"stdin": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    peers = {
        "motionseq play": lambda port: subprocess.Popen([PROGRAM, "play", "-q", script, "--port", port.path], **quiet),
        "Python time.sleep, pyserial": lambda port: subprocess.Popen([sys.executable, "-c", sleeper, port.path], **quiet),
        "scriptreplay": lambda port: subprocess.Popen(["scriptreplay", "-t", timing, typescript], stdout=port.near, **quiet),
    }
    late = {name: last_frame(start, frames, step_us, expected) for name, start in peers.items()}
    ours = late["motionseq play"]
    print(f"last of {frames} frames {step_us} us apart, at the far end, against the one most in time; one run each:")
    figure("motionseq play", ours, "ms", 1)
    for name, value in list(late.items())[1:]:
        print(f"  {name:58} {value:9.3f} ms  ({value / max(abs(ours), FAR_END):.0f} times ours)")


# Waits for a yaw above 0, 1, 2 ... degrees, and sends a servo frame after each.
PEER = """
import serial, sys
port = serial.Serial(sys.argv[1], 115200, timeout=10)
frame = bytes.fromhex(sys.argv[3])
for number in range(int(sys.argv[2])):
    while int(port.read_until(b"#").split(b":")[2]) <= number * 100:
        pass
    port.write(frame)
"""


def openings(start, frame, count):
    """Milliseconds from the last byte of each report to the frame that follows, at the far end."""
    port, times = Port(), []
    child = start(port.path)
    try:
        for number in range(count):
            # At a random phase, and some time after the last frame.
            until = time.monotonic() + (0.8 if number == 0 else 0.02 + 0.08 * (os.urandom(1)[0] / 255))
            while (left := until - time.monotonic()) > 0:
                port.read(left)
            port.close(near_only=True)
            os.write(port.far, b"{A0:0:%d:1200}#" % (number * 100 + 50))
            begin, received = time.monotonic(), b""
            while frame not in received:
                data, now = port.read()
                if not data:
                    sys.exit("a gate did not open")
                received += data
            times.append((now - begin) * 1e3)
    finally:
        child.kill()
        child.wait()
        port.close()
    return times


def gates():
    count, frame = (50, 200)[not SHORT], bytes.fromhex("FFFE02030105DCE7")
    script, peer = os.path.join(FOLDER, "gates.motion"), os.path.join(FOLDER, "gates.py")
    with open(script, "w") as out:
        out.write("repeat %d as i {\n  wait until yaw > (i * 1deg) within 10s\n  servo 1 1500\n}\nwait 1s\n" % count)
    with open(peer, "w") as out:
        out.write(PEER)
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    kinds = {
        "motionseq play": lambda path: subprocess.Popen([PROGRAM, "play", script, "--port", path], **quiet),
        "a Python loop over pyserial": lambda path: subprocess.Popen([sys.executable, peer, path, str(count), frame.hex()], **quiet),
    }
    results = {name: [] for name in kinds}
    for _ in range(RUNS):
        for name, start in kinds.items():
            results[name].extend(openings(start, frame, count))
    print(f"from the last byte of a report to the frame after the gate, {RUNS} x {count} gates, at the far end:")
    middles = {name: statistics.median(times) for name, times in results.items()}
    ours, peers = middles.values()
    figure("motionseq play, p50", ours, "ms", 1)
    print(f"  {'p99':58} {sorted(results['motionseq play'])[len(results['motionseq play']) * 99 // 100]:9.3f} ms")
    print(f"  {'a Python loop over pyserial, p50':58} {peers:9.3f} ms  ({peers / ours:.1f} times ours)")


def until_stop(send, options=()):
    """Milliseconds from a signal to the stop frame at the far end; None if it did not arrive."""
    script = os.path.join(FOLDER, "long.motion")
    with open(script, "w") as out:
        out.write("rocker x=10; buzzer on\nwait 1h\nstop; buzzer off\n")
    port = Port()
    command = [PROGRAM, "play", script, "--port", port.path, *options]
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        if not port.read()[0]:
            sys.exit("the player sends nothing")
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
        # The guard ends after it has stopped the robot, which closes the port.
        while port.read(2)[0]:
            pass
        port.close()


def guard():
    for name, send, options, count, bounds in (
        ("SIGKILL", signal.SIGKILL, (), 50 if SHORT else 200, {"p50": 1, "p99": 10}),
        ("SIGSTOP, --max-late 50ms", signal.SIGSTOP, ("--max-late", "50ms"), 10 if SHORT else 30, {"p50": 150}),
    ):
        times = [until_stop(send, options) for _ in range(count)]
        seen = sorted(value for value in times if value is not None)
        print(f"{name} to the stop at the far end, {count} times:")
        figure("stops seen", len(seen), "", count, least=True)
        if seen:
            for part, bound in bounds.items():
                figure(part, seen[(len(seen) - 1) * int(part[1:]) // 100], "ms", bound)
            print(f"  {'max':58} {seen[-1]:9.3f} ms")


if __name__ == "__main__":
    # End the child processes however this one ends: busy loops would run forever.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        guard()
        gates()
        exactness()
        arm()
        drift(1000 if SHORT else 5000)
    finally:
        shutil.rmtree(FOLDER)
