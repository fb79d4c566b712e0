#!/usr/bin/env python3
"""Flies `host-sim autopilot` with pymavlink: telemetry, parameters, arming, Offboard setpoints, landing.

Usage: px4_pymavlink.py udpout:127.0.0.1:PORT        (any pymavlink connection string)

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1, and so does a
frame that does not parse. Ends itself after 90 seconds.
"""

import os
import signal
import struct
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "ardupilotmega"
from pymavlink import mavutil  # noqa: E402

OFFBOARD, LAND = 0x00060000, 0x06040000
MASK_POSITION, MASK_VELOCITY = 0xDF8, 0xDC7
ARMED = 128


def check(what, holds, seen=""):
    if not holds:
        print(f"FAILED {what}: {seen}", flush=True)
        sys.exit(1)
    print(f"ok {what} {seen}".rstrip(), flush=True)


class Pilot:
    """One connection: keeps setpoints going, counts messages, keeps the last of each type."""

    def __init__(self, url):
        self.link = mavutil.mavlink_connection(url, source_system=1, source_component=191)
        self.last = {}
        self.count = {}
        self.acks = []
        self.bad = 0
        self.setpoint = None
        self.next_setpoint = 0.0
        self.next_beat = 0.0

    def spin(self, seconds, done=lambda: False):
        """Runs until `done` or the time is over; whether it is done."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if done():
                return True
            now = time.monotonic()
            if now >= self.next_beat:
                self.next_beat = now + 1.0
                self.link.mav.heartbeat_send(18, 8, 0, 0, 4)
            if self.setpoint and now >= self.next_setpoint:
                self.next_setpoint = now + 0.05
                mask, position, velocity = self.setpoint
                self.link.mav.set_position_target_local_ned_send(
                    0, 1, 1, 1, mask, *position, *velocity, 0, 0, 0, 0, 0)
            message = self.link.recv_match(blocking=True, timeout=0.01)
            if message is None:
                continue
            kind = message.get_type()
            if kind == "BAD_DATA":
                self.bad += 1
                continue
            self.last[kind] = message
            self.count[kind] = self.count.get(kind, 0) + 1
            if kind == "COMMAND_ACK":
                self.acks.append((message.command, message.result))
        return done()

    def command(self, command, *params):
        """Sends a command; the results acknowledged within half a second."""
        self.acks.clear()
        params = list(params) + [0.0] * (7 - len(params))
        self.link.mav.command_long_send(1, 1, command, 0, *params)
        self.spin(0.5)
        return [result for acked, result in self.acks if acked == command]

    def position(self):
        p = self.last["LOCAL_POSITION_NED"]
        return p.x, p.y, p.z

    def near(self, target, within):
        return sum((a - b) ** 2 for a, b in zip(self.position(), target)) < within**2

    def armed(self):
        return bool(self.last["HEARTBEAT"].base_mode & ARMED)


def main():
    signal.alarm(90)
    pilot = Pilot(sys.argv[1])
    check("heartbeat", pilot.spin(5, lambda: "HEARTBEAT" in pilot.last))
    beat = pilot.last["HEARTBEAT"]
    check("is PX4 on a quadrotor", (beat.autopilot, beat.type) == (12, 2), f"{beat.autopilot} {beat.type}")

    pilot.count.clear()
    pilot.spin(4)
    rates = {kind: pilot.count.get(kind, 0) / 4 for kind in pilot.count}
    for kind, rate in [("ATTITUDE", 100), ("HIGHRES_IMU", 50), ("ODOMETRY", 30), ("TIMESYNC", 10), ("HEARTBEAT", 1)]:
        got = rates.get(kind, 0)
        check(f"stream {kind}", abs(got - rate) <= max(0.15 * rate, 0.3), f"{got:.1f} Hz")
    check("gps fix", pilot.last["GPS_RAW_INT"].fix_type >= 3)

    check("request AUTOPILOT_VERSION", pilot.command(512, 148) == [0] and "AUTOPILOT_VERSION" in pilot.last)
    check("request GPS_GLOBAL_ORIGIN", pilot.command(512, 49) == [0] and "GPS_GLOBAL_ORIGIN" in pilot.last)
    check("unknown command is UNSUPPORTED", pilot.command(12345) == [3], pilot.acks)
    check("interval of a bad id FAILED", pilot.command(511, 9999, 100000) == [4], pilot.acks)
    check("interval of ATTITUDE", pilot.command(511, 30, 200000) == [0], pilot.acks)
    pilot.count.clear()
    pilot.spin(2)
    check("ATTITUDE slowed to 5 Hz", 8 <= pilot.count.get("ATTITUDE", 0) <= 12, pilot.count.get("ATTITUDE"))

    pilot.link.mav.param_request_read_send(1, 1, b"COM_OBL_RC_ACT", -1)
    check("integer parameter travels bytewise", pilot.spin(2, lambda: "PARAM_VALUE" in pilot.last)
          and struct.unpack("<i", struct.pack("<f", pilot.last["PARAM_VALUE"].param_value))[0] == 0)
    pilot.count.clear()
    pilot.link.mav.param_request_list_send(1, 1)
    total = pilot.last["PARAM_VALUE"].param_count
    check("parameter list", pilot.spin(10, lambda: pilot.count.get("PARAM_VALUE", 0) >= total), f"{total} parameters")

    check("Offboard accepted while disarmed, acknowledged twice", pilot.command(176, 1, 6) == [0, 0], pilot.acks)
    check("arming without a stream refused", pilot.command(400, 1) == [1], pilot.acks)
    x, y, z = pilot.position()
    pilot.setpoint = (MASK_POSITION, (x, y, z - 4), (0, 0, 0))
    pilot.spin(1.0)
    check("arming with a stream", pilot.command(400, 1) == [0], pilot.acks)
    check("armed in HEARTBEAT", pilot.spin(2, pilot.armed))
    check("lifts off to 4 m", pilot.spin(15, lambda: pilot.near((x, y, z - 4), 0.4)), pilot.position())
    check("flies in Offboard", pilot.last["HEARTBEAT"].custom_mode == OFFBOARD)
    check("in the air", pilot.spin(1, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state == 2))
    check("disarm in the air refused", pilot.command(400, 0) == [1], pilot.acks)
    pilot.setpoint = (MASK_POSITION, (x + 6, y - 3, z - 4), (0, 0, 0))
    check("follows a position", pilot.spin(15, lambda: pilot.near((x + 6, y - 3, z - 4), 0.4)), pilot.position())
    pilot.setpoint = (MASK_VELOCITY, (0, 0, 0), (0, 2, 0))
    pilot.spin(3)
    speed = pilot.last["LOCAL_POSITION_NED"].vy
    check("follows a velocity", 1.4 < speed < 2.1, f"2 m/s asked, {speed:.2f} flown")

    check("land mode, acknowledged twice", pilot.command(176, 1, 4, 6) == [0, 0], pilot.acks)
    check("LAND in HEARTBEAT", pilot.spin(2, lambda: pilot.last["HEARTBEAT"].custom_mode == LAND))
    check("on the ground", pilot.spin(20, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state == 1))
    check("disarms itself", pilot.spin(5, lambda: not pilot.armed()))
    check("no frame that does not parse", pilot.bad == 0, f"{pilot.bad} bad")


if __name__ == "__main__":
    main()
