"""A typical program of a Raspblock owner: writes frames with pyserial, some with pauses and some back to
back, reads the reports of the board, and closes the port without a stop. Prints each written frame in
hex.

    python3 owner.py PORT
"""
import sys
import time

import serial


def frame(function, *payload):
    body = [function, len(payload), *payload]
    return bytes([0xFF, 0xFE, *body, sum(body) & 0xFF])


def servo(index, pulse):
    return frame(2, index, pulse >> 8, pulse & 0xFF)


def wheels(a, b, c, d):
    signs = sum(bit for value, bit in zip((a, b, c, d), (1, 2, 4, 8)) if value < 0)
    return frame(3, 2, abs(a), abs(b), abs(c), abs(d), 0, 0, signs)


STOP = frame(3, 1, 0, 0, 0, 0, 0, 0, 1)

port = serial.Serial(sys.argv[1], 115200, timeout=2)


def send(data):
    port.write(data)
    print(data.hex(" ").upper())


send(frame(5, 0))
for pulse in range(1000, 2000, 100):
    send(servo(1, pulse))
    time.sleep(0.01)
for pulse in range(2000, 1000, -50):
    send(servo(3, pulse))
for _ in range(1000):
    send(wheels(8, -8, 8, -8))
send(STOP)
send(frame(4, 1))
time.sleep(0.1)
send(frame(4, 0))
report = port.read_until(b"#")
assert report.startswith(b"{A0:0:"), report
send(frame(5, 9))
port.close()
