"""Six servos as the Feetech SDK for Python drives them: pings, reads, and writes of every kind.

    python3 feetech.py PORT
"""
import sys
import time

import scservo_sdk as sdk

# A busy machine may take longer for an answer than the 34 ms that the SDK waits.
now = sdk.PortHandler.getCurrentTime
sdk.PortHandler.getCurrentTime = lambda port: now(port) / 20

IDS = range(1, 7)
port, packets = sdk.PortHandler(sys.argv[1]), sdk.PacketHandler(0)
assert port.openPort() and port.setBaudRate(1_000_000)


def check(result, errors=0):
    assert (result, errors) == (sdk.COMM_SUCCESS, 0), packets.getTxRxResult(result)


def two(value):
    return [value & 255, value >> 8]


for id in IDS:
    model, *result = packets.ping(port, id)
    check(*result)
    assert model == 777
_, result, _ = packets.ping(port, 77)
assert result == sdk.COMM_RX_TIMEOUT, "a servo that is not there"
position, *result = packets.read2ByteTxRx(port, 1, 56)
check(*result)
assert position == 2048
position, *result = packets.read4ByteTxRx(port, 1, 56)
check(*result)
assert position == 2048, "with the speed in the upper half"
for id in IDS:
    check(*packets.write1ByteTxRx(port, id, 40, 1))
check(*packets.write2ByteTxRx(port, 1, 42, 2100))
check(*packets.writeTxRx(port, 2, 41, 7, [50, *two(2100), 0, 0, *two(2400)]))
check(*packets.regWriteTxRx(port, 3, 42, 2, two(2100)))
check(packets.action(port, sdk.BROADCAST_ID))
time.sleep(0.1)
positions = []
for id in IDS:
    position, *result = packets.read2ByteTxRx(port, id, 56)
    check(*result)
    positions.append(position)
assert positions == [2100, 2100, 2100, 2048, 2048, 2048], positions
goals = sdk.GroupSyncWrite(port, packets, 41, 7)
for id in IDS:
    assert goals.addParam(id, [50, *two(2000 + id), 0, 0, *two(2400)])
check(goals.txPacket())
time.sleep(0.2)
positions = sdk.GroupSyncRead(port, packets, 56, 2)
for id in IDS:
    assert positions.addParam(id)
check(positions.txRxPacket())
assert [positions.getData(id, 56, 2) for id in IDS] == [2000 + id for id in IDS]
for id in IDS:
    check(*packets.write1ByteTxRx(port, id, 40, 0))
port.closePort()
print("done")
