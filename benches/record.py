"""Measures the precision of recordings and the cost of a tap. Needs pyserial and a release build.

    python3 benches/record.py              1 and 2
    python3 benches/record.py --soak 600   3, for this many seconds

1. A routine of ten seconds is sent to a virtual board and recorded with --exact; the script is played
   to another virtual board. The frames must be the same, in the same order; the differences of their
   times are printed.
2. A request goes to a virtual board and its report comes back, a thousand times, directly and through
   `record --port`, in turns.
3. A saturated line to `board` and `record`, both with a log: their memory over time.
"""
import json
import math
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time

import serial

PROGRAM = os.environ.get("MOTIONSEQ") or os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "target", "release", "motionseq")


def frame(function, *payload):
    body = [function, len(payload), *payload]
    return bytes([0xFF, 0xFE, *body, sum(body) & 0xFF])


def servo(index, pulse):
    return frame(2, index, pulse >> 8, pulse & 0xFF)


def rocker(x):
    return frame(3, 1, 0, abs(x), 0, 0, 0, 0, 1 | (4 if x < 0 else 0))


def start(*arguments, **more):
    child = subprocess.Popen([PROGRAM, *arguments], stderr=subprocess.PIPE, text=True, **more)
    assert "stands" in child.stderr.readline()
    return child


def end(child):
    child.send_signal(signal.SIGINT)
    return child.communicate()[0]


def routine(path):
    """Ten seconds of a typical program: a servo swings, drive frames every 10 ms, another servo jumps."""
    port = serial.Serial(path, 115200)
    began = time.monotonic()
    step = 0
    while (now := time.monotonic() - began) < 10:
        port.write(servo(1, round(1500 + 400 * math.sin(2 * math.pi * now / 4))))
        if step % 50 < 40:
            port.write(rocker(10 if step % 100 < 50 else -10))
        if step % 75 == 0:
            port.write(servo(3, 1000 + step % 7 * 100))
        step += 1
        time.sleep(0.01)
    port.write(rocker(0))
    port.close()


def board(folder, name):
    path, listing = os.path.join(folder, name), os.path.join(folder, name + ".jsonl")
    return path, listing, start("board", "--link", path, "--format", "jsonl", stdout=open(listing, "w"))


def lines(path):
    found = [json.loads(line) for line in open(path)]
    return [line["frame"] for line in found], [line["t_us"] for line in found]


def truth(folder):
    link, script, received = (os.path.join(folder, name) for name in ("near", "routine.motion", "received.jsonl"))
    child = start("record", "--link", link, "-o", script, "--exact", "--format", "jsonl", stdout=open(received, "w"))
    routine(link)
    time.sleep(0.5)
    end(child)
    path, listing, child = board(folder, "again")
    subprocess.run([PROGRAM, "play", script, "--port", path, "--progress", "none"], check=True, stderr=subprocess.DEVNULL)
    time.sleep(0.5)
    end(child)
    (frames, times), (again, later) = lines(received), lines(listing)
    if frames != again:
        sys.exit(f"the frames differ: {len(frames)} and {len(again)}")
    apart = sorted(abs((new - later[0]) - (old - times[0])) for new, old in zip(later, times))
    at = lambda part: apart[min(len(apart) - 1, int(part * len(apart)))]
    print(f"recorded and played again: {len(frames)} frames, the same in the same order")
    print(f"their times differ by {at(.5)} us (median), {at(.99)} us (p99), {apart[-1]} us (worst)")


def latency(folder):
    path, _, far = board(folder, "far")
    link = os.path.join(folder, "tap")
    taken = {"straight": [], "through the tap": []}
    request = frame(5, 5)
    for _ in range(10):
        for way, times in taken.items():
            tap = None
            if way != "straight":
                tap = start("record", "--link", link, "--port", path, "-o", os.path.join(folder, f"{time.monotonic_ns()}.motion"))
            port = serial.Serial(link if tap else path, 115200, timeout=2)
            time.sleep(0.05)
            for _ in range(100):
                began = time.perf_counter()
                port.write(request)
                assert port.read_until(b"#")
                times.append((time.perf_counter() - began) * 1e6)
            port.close()
            time.sleep(0.1)
            if tap:
                end(tap)
    end(far)
    straight, through = (statistics.median(times) for times in taken.values())
    print(f"a request and its report: {straight:.0f} us straight, {through:.0f} us through the tap (medians)")
    print(f"so the tap adds {through - straight:.0f} us to both ways together, {(through - straight) / 2:.0f} us to one")


def memory(child):
    """Resident memory in MiB."""
    status = open(f"/proc/{child.pid}/status").read()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def soak(folder, seconds):
    children, ports = {}, []
    for command in ("board", "record"):
        link, out = os.path.join(folder, command), os.path.join(folder, command + ".motion")
        more = ["-o", out] if command == "record" else []
        log = os.path.join(folder, command + ".mcap")
        children[command] = start(command, "--link", link, "--log", log, *more, stdout=subprocess.DEVNULL)
        ports.append(serial.Serial(link, 115200, timeout=0))
    frames = [servo(1 + step % 4, 500 + step * 7 % 1500) for step in range(3000)]
    began, sent, next_print = time.monotonic(), 0, 0
    while (now := time.monotonic() - began) < seconds:
        if now >= next_print:
            next_print += max(1, seconds / 10)
            print(f"{now:5.0f} s: " + ", ".join(f"{name} {memory(child):.1f} MiB" for name, child in children.items()), flush=True)
        # 11,520 bytes per second are 1,440 of these frames.
        while sent < now * 1440:
            for port in ports:
                port.write(frames[sent % len(frames)])
            sent += 1
        time.sleep(0.005)
    for name, child in children.items():
        child.send_signal(signal.SIGINT)
        print(name + ":", child.communicate()[1].strip().splitlines()[-1])
    print(f"{sent} frames were sent to each; the log of one is {os.path.getsize(log) / 2**20:.0f} MiB")


with tempfile.TemporaryDirectory() as scratch:
    if sys.argv[1:2] == ["--soak"]:
        soak(scratch, float(sys.argv[2]))
    else:
        truth(scratch)
        latency(scratch)
