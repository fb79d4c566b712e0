#!/usr/bin/env python3
"""Flies `host-sim autopilot` with pymavlink: telemetry, parameters, arming, Offboard setpoints, landing.

Usage: px4_pymavlink.py udpout:127.0.0.1:PORT        (any pymavlink connection string)

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1, and so does a
frame that does not parse. Ends itself after 150 seconds.
"""

import signal
import struct
import sys

from pilot import Pilot, check

OFFBOARD, LAND = 0x00060000, 0x06040000
MASK_POSITION, MASK_VELOCITY = 0xDF8, 0xDC7


def main():
    signal.alarm(150)
    pilot = Pilot(sys.argv[1])
    check("heartbeat", pilot.spin(10, lambda: "HEARTBEAT" in pilot.last))
    beat = pilot.last["HEARTBEAT"]
    check("is PX4 on a quadrotor", (beat.autopilot, beat.type) == (12, 2), f"{beat.autopilot} {beat.type}")

    for kind, rate in [("ATTITUDE", 100), ("HIGHRES_IMU", 50), ("ODOMETRY", 30), ("TIMESYNC", 10), ("HEARTBEAT", 1)]:
        within = max(0.15 * rate, 0.3)
        got = pilot.rate(kind, 4 if rate <= 1 else 1, lambda seen: abs(seen - rate) <= within)
        check(f"stream {kind}", abs(got - rate) <= within, f"{got:.1f} Hz")
    check("gps fix", pilot.last["GPS_RAW_INT"].fix_type >= 3)

    check("request AUTOPILOT_VERSION", pilot.command(512, 148) == [0] and "AUTOPILOT_VERSION" in pilot.last)
    check("request GPS_GLOBAL_ORIGIN", pilot.command(512, 49) == [0] and "GPS_GLOBAL_ORIGIN" in pilot.last)
    check("unknown command is UNSUPPORTED", pilot.command(12345) == [3], pilot.acks)
    check("interval of a bad id FAILED", pilot.command(511, 9999, 100000) == [4], pilot.acks)
    check("interval of ATTITUDE", pilot.command(511, 30, 200000) == [0], pilot.acks)
    got = pilot.rate("ATTITUDE", 2, lambda seen: 4 <= seen <= 6)
    check("ATTITUDE slowed to 5 Hz", 4 <= got <= 6, f"{got:.1f} Hz")

    pilot.link.mav.param_request_read_send(1, 1, b"COM_OBL_RC_ACT", -1)
    check("integer parameter travels bytewise", pilot.spin(10, lambda: "PARAM_VALUE" in pilot.last)
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
    check("armed in HEARTBEAT", pilot.spin(10, pilot.armed))
    check("lifts off to 4 m", pilot.spin(30, lambda: pilot.near((x, y, z - 4), 0.4)), pilot.position())
    check("flies in Offboard", pilot.last["HEARTBEAT"].custom_mode == OFFBOARD)
    check("in the air", pilot.spin(10, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state == 2))
    check("disarm in the air refused", pilot.command(400, 0) == [1], pilot.acks)
    pilot.setpoint = (MASK_POSITION, (x + 6, y - 3, z - 4), (0, 0, 0))
    check("follows a position", pilot.spin(30, lambda: pilot.near((x + 6, y - 3, z - 4), 0.4)), pilot.position())
    pilot.setpoint = (MASK_VELOCITY, (0, 0, 0), (0, 2, 0))
    follows = pilot.spin(10, lambda: 1.4 < pilot.last["LOCAL_POSITION_NED"].vy < 2.1)
    check("follows a velocity", follows, f"2 m/s asked, {pilot.last['LOCAL_POSITION_NED'].vy:.2f} flown")

    check("land mode, acknowledged twice", pilot.command(176, 1, 4, 6) == [0, 0], pilot.acks)
    check("LAND in HEARTBEAT", pilot.spin(10, lambda: pilot.last["HEARTBEAT"].custom_mode == LAND))
    check("on the ground", pilot.spin(40, lambda: pilot.last["EXTENDED_SYS_STATE"].landed_state == 1))
    check("disarms itself", pilot.spin(10, lambda: not pilot.armed()))
    check("no frame that does not parse", pilot.bad == 0, f"{pilot.bad} bad")


if __name__ == "__main__":
    main()
