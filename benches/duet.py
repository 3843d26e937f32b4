#!/usr/bin/env python3
"""Measures how exactly several robots of one script play together, beside cyclictest.

    apt install rt-tests
    cargo build --release && cargo bench --bench lateness --no-run
    python3 benches/duet.py [--short]

Skew: the time between the first and the last of the frames that are due together, at the far ends of
ptys, for 2 and 8 robots; cyclictest runs in turns with it, and shows how late this machine wakes a
thread. A far end adds its own wake-up.
Load: 8 robots whose lines carry as much as they can, compared with single runs of one robot: frames
that came more than 5 ms late (the limit of the warning `wire-late`), of the worst robot.
"""
import glob
import os
import shutil
import statistics
import subprocess
import sys

SHORT = "--short" in sys.argv
RUNS = 3 if SHORT else 5
FRAMES = 500 if SHORT else 3000
# 60 s at full line rate.
LOAD = 5_000 if SHORT else 85_700
PROGRAM = os.path.abspath("target/release/motionseq")


def lateness(*options):
    """The numbers that the lateness program prints."""
    built = max((p for p in glob.glob("target/release/deps/lateness-*") if not p.endswith(".d")), key=os.path.getmtime)
    out = subprocess.run([built, *map(str, options), PROGRAM], stdout=subprocess.PIPE, text=True, check=True).stdout.split()
    return {name: int(value) for name, value in zip(out[::2], out[1::2])}


def cyclictest():
    """p50 and p99 of the latency of a thread without real-time priority, in microseconds."""
    command = ["cyclictest", "--policy=other", "-q", "-i", "5000", "-l", str(FRAMES), "-h", "100000"]
    out = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    rows = [line.split() for line in out.splitlines() if line and not line.startswith(("#", "/"))]
    latencies = sorted((int(row[0]), int(row[1])) for row in rows)
    count = sum(number for _, number in latencies)

    def quantile(part):
        passed = 0
        for latency, number in latencies:
            passed += number
            if passed >= part * count:
                return latency
        return latencies[-1][0]

    return quantile(0.5), quantile(0.99)


def skew(robots):
    ours, peer = [], []
    for _ in range(RUNS):
        ours.append(lateness("--robots", robots, "--frames", FRAMES, "--step-us", 5000))
        if shutil.which("cyclictest"):
            peer.append(cyclictest())
    p50 = [run["p50"] / 1000 for run in ours]
    p99 = [run["p99"] / 1000 for run in ours]
    print(f"skew of {robots} robots: p50 {statistics.median(p50):.1f} us ({min(p50):.1f} to {max(p50):.1f}), "
          f"p99 {statistics.median(p99):.1f} us ({min(p99):.1f} to {max(p99):.1f})")
    if peer:
        p50, p99 = zip(*peer)
        print(f"  cyclictest: p50 {statistics.median(p50)} us, p99 {statistics.median(p99)} us")


def load():
    passed = 0
    for _ in range(3):
        single = [lateness("--robots", 1, "--full", "--frames", LOAD)["behind"] for _ in range(3)]
        together = lateness("--robots", 8, "--full", "--frames", LOAD)["behind"]
        passed += together <= max(single)
        print(f"late frames at full line rate: one robot {single}, the worst of 8 robots {together}")
    print(f"  not more than the worst single run: {passed} of 3")


skew(2)
skew(8)
load()
