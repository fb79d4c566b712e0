#!/usr/bin/env python3
"""Uses `host-sim autopilot` of either personality with MAVSDK: telemetry, parameters listed, set and read back, missions.

Usage: mavsdk_services.py udpin://127.0.0.1:PORT FLOAT_PARAMETER INTEGER_PARAMETER

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after
120 seconds.
"""

from drone import check, first, run
from mavsdk.mission_raw import MissionItem

TIMEOUT_S = 120
# Home, take-off, two waypoints, return: MAV_CMD, frame, latitude, longitude, height.
PLAN = [(16, 0, 0.0, 0.0, 488.0), (22, 3, 0.0, 0.0, 5.0), (16, 3, 1e-4, 0.0, 5.0), (16, 3, 1e-4, 1e-4, 6.0),
        (20, 3, 0.0, 0.0, 0.0)]
HOME = 47.397742, 8.545594


def plan(kind=0):
    items = []
    for seq, (command, frame, north, east, height) in enumerate(PLAN):
        x, y = round((HOME[0] + north) * 1e7), round((HOME[1] + east) * 1e7)
        items.append(MissionItem(seq, frame, command, int(seq == 0), 1, 0.0, 0.0, 0.0, float("nan"), x, y, height, kind))
    return items


async def use(drone, url, real, whole):
    await drone.connect(system_address=url)
    check("connected", await first(drone.core.connection_state(), lambda s: s.is_connected, 20))
    telemetry = drone.telemetry
    await telemetry.set_rate_position(5.0)
    await telemetry.set_rate_gps_info(2.0)
    await telemetry.set_rate_battery(2.0)
    await telemetry.set_rate_landed_state(5.0)
    check("rates are set", True)
    check("position", await first(telemetry.position(), lambda p: abs(p.latitude_deg - HOME[0]) < 1e-4, 20))
    battery = await first(telemetry.battery(), lambda b: b.remaining_percent > 90, 20)
    check("battery", battery, f"{battery.remaining_percent:.0f} %" if battery else "")
    check("gps", await first(telemetry.gps_info(), lambda g: g.num_satellites >= 6, 20))
    check("landed state", str(await first(telemetry.landed_state(), lambda _: True, 20)).endswith("ON_GROUND"))
    version = await drone.info.get_version()
    check("version", version.flight_sw_major > 0, f"{version.flight_sw_major}.{version.flight_sw_minor}")

    parameters = await drone.param.get_all_params()
    floats = {p.name: p.value for p in parameters.float_params}
    integers = {p.name: p.value for p in parameters.int_params}
    check("parameters are listed", real in floats and whole in integers, f"{len(floats)} floats, {len(integers)} integers")
    for value in (12.5, floats[real]):
        await drone.param.set_param_float(real, value)
        check(f"{real} read back", abs(await drone.param.get_param_float(real) - value) < 1e-5, value)
    for value in (3, integers[whole]):
        await drone.param.set_param_int(whole, value)
        check(f"{whole} read back", await drone.param.get_param_int(whole) == value, value)

    missions = drone.mission_raw
    await missions.upload_mission(plan())
    check("mission uploaded", True)
    stored = await missions.download_mission()
    seen = [(i.command, i.x, i.y, i.z) for i in stored]
    check("mission downloaded", seen == [(i.command, i.x, i.y, i.z) for i in plan()], seen)
    await missions.clear_mission()
    try:
        left = len(await missions.download_mission())
    except Exception as error:  # MAVSDK calls an empty mission an error.
        left = 0 if "NO_MISSION_AVAILABLE" in str(error) else str(error)
    # Of ArduPilot's plans MAVSDK leaves item 0, which is home there.
    check("mission cleared", left == 0 or (left == 1 and version.flight_sw_major == 4), left)


if __name__ == "__main__":
    run(use, TIMEOUT_S)
