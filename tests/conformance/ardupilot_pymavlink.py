#!/usr/bin/env python3
"""Flies `host-sim autopilot --personality ardupilot` with pymavlink: streams, parameters, Guided setpoints, landing.

Usage: ardupilot_pymavlink.py udpout:127.0.0.1:PORT        (any pymavlink connection string)

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1, and so does a
frame that does not parse. Ends itself after 150 seconds.
"""

import signal
import sys

from pilot import Pilot, check

GUIDED, LAND = 4, 9
POSITION, VELOCITY, BOTH = 0xDF8, 0xDC7, 0xDC0


def main():
    signal.alarm(150)
    pilot = Pilot(sys.argv[1])
    check("heartbeat", pilot.spin(10, lambda: "HEARTBEAT" in pilot.last))
    beat = pilot.last["HEARTBEAT"]
    check("is ArduPilot on a quadrotor", (beat.autopilot, beat.type) == (3, 2), f"{beat.autopilot} {beat.type}")
    pilot.count.clear()
    pilot.spin(2)
    unasked = set(pilot.count) - {"HEARTBEAT", "STATUSTEXT", "TIMESYNC", "GPS_GLOBAL_ORIGIN", "HOME_POSITION"}
    check("says nothing unasked", not unasked, unasked)

    for message, us in [(32, 50000), (245, 100000), (193, 200000), (33, 200000), (1, 500000), (24, 200000)]:
        check(f"interval of {message}", pilot.command(511, message, us) == [0], pilot.acks)
    check("bad message id DENIED", pilot.command(511, 9999, 100000) == [2], pilot.acks)
    check("unknown command UNSUPPORTED", pilot.command(12345) == [3], pilot.acks)
    check("AUTOPILOT_VERSION", pilot.command(512, 148) == [0] and "AUTOPILOT_VERSION" in pilot.last)
    version = pilot.last["AUTOPILOT_VERSION"].flight_sw_version
    check("version 4.6", (version >> 24, version >> 16 & 0xFF) == (4, 6), hex(version))

    pilot.link.mav.param_set_send(1, 1, b"FS_GCS_TIMEOUT", 7.0, 9)
    check("float parameter set", pilot.spin(10, lambda: pilot.parameters.get("FS_GCS_TIMEOUT") == 7.0))
    pilot.link.mav.param_set_send(1, 1, b"FS_GCS_ENABLE", 0.0, 2)
    check("integer parameter cast", pilot.spin(10, lambda: pilot.parameters.get("FS_GCS_ENABLE") == 0.0))
    pilot.parameters.clear()
    pilot.link.mav.param_request_list_send(1, 1)
    check("parameter list", pilot.spin(10, lambda: len(pilot.parameters) >= pilot.last["PARAM_VALUE"].param_count > 1),
          f"{len(pilot.parameters)} parameters")

    check("Guided accepted early", pilot.command(176, 1, GUIDED) == [0], pilot.acks)
    ready = pilot.spin(30, lambda: pilot.last["EKF_STATUS_REPORT"].flags & 0x418 == 0x18)
    check("estimator ready", ready, hex(pilot.last["EKF_STATUS_REPORT"].flags))
    check("position", pilot.spin(10, lambda: "LOCAL_POSITION_NED" in pilot.last))
    check("take-off while disarmed FAILED", pilot.command(22, 0, 0, 0, 0, 0, 0, 4) == [4], pilot.acks)
    check("arms", pilot.command(400, 1) == [0], pilot.acks)
    check("armed in HEARTBEAT", pilot.spin(10, pilot.armed))
    x, y, z = pilot.position()
    check("take-off", pilot.command(22, 0, 0, 0, 0, 0, 0, 4) == [0], pilot.acks)
    check("in the air", pilot.spin(10, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state != 1))
    check("at 4 m", pilot.spin(30, lambda: pilot.near((x, y, z - 4), 0.3)), pilot.position())
    check("disarm in the air FAILED", pilot.command(400, 0) == [4], pilot.acks)
    pilot.setpoint = (POSITION, (x + 5, y - 3, z - 4), (0, 0, 0))
    check("follows a position", pilot.spin(30, lambda: pilot.near((x + 5, y - 3, z - 4), 0.3)), pilot.position())
    pilot.setpoint = (VELOCITY, (0, 0, 0), (0, 2, 0))
    follows = pilot.spin(10, lambda: 1.8 < pilot.last["LOCAL_POSITION_NED"].vy < 2.2)
    check("follows a velocity", follows, f"2 m/s asked, {pilot.last['LOCAL_POSITION_NED'].vy:.2f} flown")
    pilot.setpoint = (BOTH, (x + 5, y, z - 3), (0, 0, 0))
    check("follows both", pilot.spin(30, lambda: pilot.near((x + 5, y, z - 3), 0.3)), pilot.position())
    pilot.setpoint = None
    check("LAND", pilot.command(176, 1, LAND) == [0], pilot.acks)
    check("on the ground", pilot.spin(40, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state == 1))
    check("disarms itself", pilot.spin(10, lambda: not pilot.armed()))
    check("no frame that does not parse", pilot.bad == 0, f"{pilot.bad} bad")


if __name__ == "__main__":
    main()
