#!/usr/bin/env python3
"""Flies `host-sim autopilot` with MAVSDK: connect, telemetry, arm, take off, Offboard setpoints, land.

Usage: px4_mavsdk.py udpin://127.0.0.1:PORT          (any MAVSDK connection URL)

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after
120 seconds.
"""

from drone import check, first, run
from mavsdk.offboard import PositionNedYaw, VelocityNedYaw
from mavsdk.telemetry import FlightMode, LandedState

TIMEOUT_S = 120


def near(sample, north, east, down, within=0.5):
    p = sample.position
    return (p.north_m - north) ** 2 + (p.east_m - east) ** 2 + (p.down_m - down) ** 2 < within**2


async def fly(drone, url):
    await drone.connect(system_address=url)
    telemetry = drone.telemetry
    check("connected", await first(drone.core.connection_state(), lambda s: s.is_connected, 20))
    health = await first(telemetry.health(), lambda h: h.is_global_position_ok and h.is_home_position_ok, 15)
    check("position and home known", health, health)
    check("armable", await first(telemetry.health(), lambda h: h.is_armable, 20))
    battery = await first(telemetry.battery(), lambda b: b.remaining_percent > 90, 20)
    check("battery", battery, f"{battery.remaining_percent:.0f} %" if battery else "")
    check("gps", await first(telemetry.gps_info(), lambda g: g.num_satellites >= 6, 20))
    version = await drone.info.get_version()
    check("version", (version.flight_sw_major, version.flight_sw_minor) == (1, 17),
          f"{version.flight_sw_major}.{version.flight_sw_minor}")
    check("float parameter", await drone.param.get_param_float("MPC_XY_VEL_MAX") > 0)
    check("integer parameter", await drone.param.get_param_int("COM_OBL_RC_ACT") == 0)

    await drone.action.set_takeoff_altitude(3.0)
    check("take-off altitude is a parameter", abs(await drone.param.get_param_float("MIS_TAKEOFF_ALT") - 3.0) < 1e-6)
    await drone.action.arm()
    check("armed", await first(telemetry.armed(), lambda armed: armed, 20))
    await drone.action.takeoff()
    check("takes off", await first(telemetry.landed_state(), lambda s: s != LandedState.ON_GROUND, 20))
    up = await first(telemetry.position(), lambda p: p.relative_altitude_m > 2.4, 15)
    check("take-off height", up, f"{up.relative_altitude_m:.2f} m" if up else "")
    check("holds after take-off", await first(telemetry.flight_mode(), lambda m: m == FlightMode.HOLD, 20))

    start = await first(telemetry.position_velocity_ned(), lambda _: True, 20)
    north, east = start.position.north_m, start.position.east_m
    await drone.offboard.set_position_ned(PositionNedYaw(north, east, -4.0, 0.0))
    await drone.offboard.start()
    check("Offboard", await first(telemetry.flight_mode(), lambda m: m == FlightMode.OFFBOARD, 20))
    await drone.offboard.set_position_ned(PositionNedYaw(north + 5.0, east + 2.0, -4.0, 90.0))
    there = await first(telemetry.position_velocity_ned(), lambda s: near(s, north + 5, east + 2, -4), 15)
    check("follows a position", there)
    turned = await first(telemetry.attitude_euler(), lambda a: abs(a.yaw_deg - 90) < 5, 20)
    check("turns to a yaw", turned, f"{turned.yaw_deg:.0f} deg" if turned else "")
    await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 1.5, 0.0, 90.0))
    moving = await first(telemetry.position_velocity_ned(), lambda s: s.velocity.east_m_s > 1.1, 20)
    check("follows a velocity", moving, f"{moving.velocity.east_m_s:.2f} m/s" if moving else "")
    await drone.offboard.stop()
    check("Offboard stops in Hold", await first(telemetry.flight_mode(), lambda m: m == FlightMode.HOLD, 20))

    await drone.action.land()
    check("landing", await first(telemetry.landed_state(), lambda s: s == LandedState.LANDING, 20))
    check("on the ground", await first(telemetry.landed_state(), lambda s: s == LandedState.ON_GROUND, 25))
    check("disarms itself", await first(telemetry.armed(), lambda armed: not armed, 20))


if __name__ == "__main__":
    run(fly, TIMEOUT_S)
