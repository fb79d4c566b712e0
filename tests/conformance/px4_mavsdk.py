#!/usr/bin/env python3
"""Flies `host-sim autopilot` with MAVSDK: connect, telemetry, arm, take off, Offboard setpoints, land.

Usage: px4_mavsdk.py udpin://127.0.0.1:PORT          (any MAVSDK connection URL)

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after
100 seconds.
"""

import asyncio
import os
import signal
import socket
import sys

from mavsdk import System
from mavsdk.offboard import PositionNedYaw, VelocityNedYaw
from mavsdk.telemetry import FlightMode, LandedState

TIMEOUT_S = 100


class Failed(Exception):
    """Something did not hold."""


def check(what, holds, seen=""):
    if not holds:
        raise Failed(f"{what}: {seen}")
    print(f"ok {what} {seen}".rstrip(), flush=True)


async def first(stream, holds, seconds):
    """The first value for which `holds` (True where the value itself is False), or None when the time is over."""
    last = None

    async def search():
        nonlocal last
        async for value in stream:
            last = value
            if holds(value):
                return value or True

    try:
        return await asyncio.wait_for(search(), seconds)
    except asyncio.TimeoutError:
        print(f"   last seen: {last}", flush=True)
        return None


def near(sample, north, east, down, within=0.5):
    p = sample.position
    return (p.north_m - north) ** 2 + (p.east_m - east) ** 2 + (p.down_m - down) ** 2 < within**2


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


async def fly(drone, url):
    await drone.connect(system_address=url)
    telemetry = drone.telemetry
    check("connected", await first(drone.core.connection_state(), lambda s: s.is_connected, 20))
    health = await first(telemetry.health(), lambda h: h.is_global_position_ok and h.is_home_position_ok, 15)
    check("position and home known", health, health)
    check("armable", await first(telemetry.health(), lambda h: h.is_armable, 10))
    battery = await first(telemetry.battery(), lambda b: b.remaining_percent > 90, 5)
    check("battery", battery, f"{battery.remaining_percent:.0f} %" if battery else "")
    check("gps", await first(telemetry.gps_info(), lambda g: g.num_satellites >= 6, 5))
    version = await drone.info.get_version()
    check("version", (version.flight_sw_major, version.flight_sw_minor) == (1, 17),
          f"{version.flight_sw_major}.{version.flight_sw_minor}")
    check("float parameter", await drone.param.get_param_float("MPC_XY_VEL_MAX") > 0)
    check("integer parameter", await drone.param.get_param_int("COM_OBL_RC_ACT") == 0)

    await drone.action.set_takeoff_altitude(3.0)
    check("take-off altitude is a parameter", abs(await drone.param.get_param_float("MIS_TAKEOFF_ALT") - 3.0) < 1e-6)
    await drone.action.arm()
    check("armed", await first(telemetry.armed(), lambda armed: armed, 5))
    await drone.action.takeoff()
    check("takes off", await first(telemetry.landed_state(), lambda s: s != LandedState.ON_GROUND, 10))
    up = await first(telemetry.position(), lambda p: p.relative_altitude_m > 2.4, 15)
    check("take-off height", up, f"{up.relative_altitude_m:.2f} m" if up else "")
    check("holds after take-off", await first(telemetry.flight_mode(), lambda m: m == FlightMode.HOLD, 10))

    start = await first(telemetry.position_velocity_ned(), lambda _: True, 5)
    north, east = start.position.north_m, start.position.east_m
    await drone.offboard.set_position_ned(PositionNedYaw(north, east, -4.0, 0.0))
    await drone.offboard.start()
    check("Offboard", await first(telemetry.flight_mode(), lambda m: m == FlightMode.OFFBOARD, 5))
    await drone.offboard.set_position_ned(PositionNedYaw(north + 5.0, east + 2.0, -4.0, 90.0))
    there = await first(telemetry.position_velocity_ned(), lambda s: near(s, north + 5, east + 2, -4), 15)
    check("follows a position", there)
    turned = await first(telemetry.attitude_euler(), lambda a: abs(a.yaw_deg - 90) < 5, 10)
    check("turns to a yaw", turned, f"{turned.yaw_deg:.0f} deg" if turned else "")
    await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 1.5, 0.0, 90.0))
    moving = await first(telemetry.position_velocity_ned(), lambda s: s.velocity.east_m_s > 1.1, 8)
    check("follows a velocity", moving, f"{moving.velocity.east_m_s:.2f} m/s" if moving else "")
    await drone.offboard.stop()
    check("Offboard stops in Hold", await first(telemetry.flight_mode(), lambda m: m == FlightMode.HOLD, 5))

    await drone.action.land()
    check("landing", await first(telemetry.landed_state(), lambda s: s == LandedState.LANDING, 5))
    check("on the ground", await first(telemetry.landed_state(), lambda s: s == LandedState.ON_GROUND, 25))
    check("disarms itself", await first(telemetry.armed(), lambda armed: not armed, 6))


async def main():
    drone = System(port=free_port())
    try:
        await asyncio.wait_for(fly(drone, sys.argv[1]), TIMEOUT_S)
        code = 0
    except Failed as failure:
        print(f"FAILED {failure}", flush=True)
        code = 1
    except asyncio.TimeoutError:
        print(f"FAILED not done within {TIMEOUT_S} s", flush=True)
        code = 1
    finally:
        drone._stop_mavsdk_server()
    # Streams that are still open would keep the interpreter from ending.
    sys.stdout.flush()
    os._exit(code)


if __name__ == "__main__":
    signal.alarm(TIMEOUT_S + 10)
    asyncio.run(main())
