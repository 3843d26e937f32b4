"""An SO-101 arm as LeRobot drives it, with its own classes: connects, calibrates, configures, moves, reads, and lets the arm go.

LeRobot imports packages that its motors do not need. Empty ones take their place if they are missing.

    python3 lerobot.py PORT
"""
import sys

# The folder of this file has a module of the same name.
sys.path.pop(0)

import tempfile
import time
from pathlib import Path

import deepdiff  # Before the empty numpy, which it would use.

EMPTY = {
    "numpy.py": "",
    "torch.py": "class device: pass\nclass dtype: pass\nclass Tensor: pass\n",
    "accelerate.py": "class Accelerator: pass\n",
    "datasets/__init__.py": "",
    "datasets/utils/__init__.py": "",
    "datasets/utils/logging.py": "def disable_progress_bar(): pass\ndef enable_progress_bar(): pass\n",
}
folder = tempfile.TemporaryDirectory()
for name, text in EMPTY.items():
    path = Path(folder.name, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
# Last, so that installed packages are preferred.
sys.path.append(folder.name)

import scservo_sdk as sdk
from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.motors.feetech import FeetechMotorsBus

# A busy machine may take longer for an answer than the 50 ms that LeRobot waits.
now, patience = sdk.PortHandler.getCurrentTime, 20
sdk.PortHandler.getCurrentTime = lambda port: now(port) / patience

NAMES = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
# The number, the direction, the offset and the limits of each motor.
CALIBRATION = [
    (1, 0, -1470, 758, 3292),
    (2, 0, 157, 834, 3269),
    (3, 0, 1081, 870, 3104),
    (4, 0, -803, 819, 3183),
    (5, 0, 1378, 0, 4095),
    (6, 0, 1407, 1968, 3473),
]

calibration = {name: MotorCalibration(*values) for name, values in zip(NAMES, CALIBRATION)}
motors = {name: Motor(id, "sts3215", MotorNormMode.DEGREES) for id, name in enumerate(NAMES, 1)}
bus = FeetechMotorsBus(port=sys.argv[1], calibration=calibration, motors=motors)
bus.connect()
if not bus.is_calibrated:
    bus.write_calibration(calibration)
assert bus.is_calibrated, "the calibration does not read back"
with bus.torque_disabled():
    bus.configure_motors()
    for name in NAMES:
        bus.write("Operating_Mode", name, 0)
        bus.write("P_Coefficient", name, 16)
# All joints go to places within their limits, 4 degrees at a time.
bus.sync_write("Goal_Position", {name: 2048 for name in NAMES}, normalize=False)
time.sleep(1.5)
start = bus.sync_read("Present_Position", normalize=False)
assert all(abs(position - 2048) < 2 for position in start.values()), start
for step in range(1, 21):
    goal = {name: 2048 + 20 * step for name in NAMES}
    bus.sync_write("Goal_Position", goal, normalize=False)
    time.sleep(0.02)
    position = bus.sync_read("Present_Position", normalize=False)
time.sleep(0.2)
position = bus.sync_read("Present_Position", normalize=False)
assert position == goal, position
# A question to all takes the whole time, which is 0.8 s.
patience = 1
assert sorted(bus.broadcast_ping()) == [1, 2, 3, 4, 5, 6]
assert set(bus.sync_read("Present_Voltage", normalize=False).values()) == {74}
bus.disconnect()
print("done")
