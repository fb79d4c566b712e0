#!/usr/bin/env python3
"""Reads a plan of `host-sim cover` as ground stations do, uploads it with MAVSDK and has `host-sim autopilot` fly it.

Usage: plan_flight.py udpin://127.0.0.1:PORT udpout:127.0.0.1:PORT DIR VEHICLE (px4|ardupilot) (waypoint|distance)

DIR is what `cover` wrote. `vehicle-N.plan` is read by MAVSDK's import, `vehicle-N.waypoints` by pymavlink's loader. The
pictures that the autopilot reports, on the second link, are counted and placed beside those of `waypoints.csv`; where it
triggers by distance, along the lanes of the mission. Prints one `ok ...` line for each thing that held; the first that
does not ends it with exit code 1. Ends itself after 150 seconds.
"""

import asyncio
import csv
import json
import math
import os
import pathlib
import threading
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "ardupilotmega"
from pymavlink import mavutil, mavwp  # noqa: E402

from drone import check, first, run  # noqa: E402

TIMEOUT_S = 150
# A waypoint is passed this near, metres.
PASSED_M = 2.5
EARTH_M = 111_195.0
# How late a picture by distance may be: the period at which the autopilot looks, and a step of its simulation, seconds.
LATE_S = {"px4": 0.054, "ardupilot": 0.024}
# Beside that: two places are reported in steps of 1e-7 degrees, the distance in the plan in millimetres; some of cruise speed.
ROUNDED_M = 0.1


class Pictures(threading.Thread):
    """What the autopilot says about pictures, on a link of its own."""

    def __init__(self, url):
        super().__init__(daemon=True)
        self.link = mavutil.mavlink_connection(url, source_system=254, source_component=190)
        self.places, self.indices, self.kinds = [], [], set()

    def run(self):
        beat = 0.0
        while True:
            if time.monotonic() > beat:
                beat = time.monotonic() + 1.0
                self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
            message = self.link.recv_match(type=["CAMERA_IMAGE_CAPTURED", "CAMERA_FEEDBACK"], blocking=True, timeout=0.2)
            if message is None:
                continue
            self.kinds.add(message.get_type())
            longitude = message.lon if hasattr(message, "lon") else message.lng
            self.places.append((message.lat * 1e-7, longitude * 1e-7))
            self.indices.append(message.image_index if hasattr(message, "image_index") else message.img_idx)


def apart_m(a, b):
    north, east = (a[0] - b[0]) * EARTH_M, (a[1] - b[1]) * EARTH_M * math.cos(math.radians(a[0]))
    return math.hypot(north, east)


def same(item, other):
    """Whether an item of MAVSDK and one of pymavlink say the same."""
    if item.frame == 2:
        place = (item.x, item.y) == (round(other.x), round(other.y))
    else:
        place = abs(item.x - other.x * 1e7) < 2 and abs(item.y - other.y * 1e7) < 2
    params = zip((item.param1, item.param2, item.param3, item.param4), (other.param1, other.param2, other.param3, other.param4))
    # What `.plan` leaves out, `.waypoints` has as 0.
    alike = all(abs((0.0 if math.isnan(a) else a) - b) < 1e-3 for a, b in params)
    return item.command == other.command and item.frame == other.frame and place and abs(item.z - other.z) < 1e-2 and alike


def lanes_of(listed):
    """Both ends of each lane and the distance between its pictures: 206 after the waypoint at either end."""
    lanes = []
    for item, at in zip(listed[1:], listed):
        if item.command == 206 and item.param1 > 0:
            lanes.append([(at.x, at.y), None, item.param1])
        elif item.command == 206 and lanes and lanes[-1][1] is None:
            lanes[-1][1] = (at.x, at.y)
    return lanes


def along_m(place, start, end):
    """How far along a lane a place is, how far beside it, and the lane's length, metres."""
    wide = math.cos(math.radians(start[0]))
    north, east = (end[0] - start[0]) * EARTH_M, (end[1] - start[1]) * EARTH_M * wide
    up, right = (place[0] - start[0]) * EARTH_M, (place[1] - start[1]) * EARTH_M * wide
    length = math.hypot(north, east)
    along = (north * up + east * right) / length
    beside = (east * up - north * right) / length
    return along, math.hypot(beside, max(0.0, -along, along - length)), length


def check_lanes(places, lanes, lane_m, spacing_m, late_m):
    """Each lane has a picture at both ends and no gap above its distance, and no picture is elsewhere.

    A vehicle that turns into a lane at speed swings out of it: pictures may be a quarter of the lane spacing beside. With the
    side overlap that a scenario has by default, 0.6, nothing is left out up to three quarters.
    """
    check("lanes are planned", lanes and all(lane[1] for lane in lanes), len(lanes))
    check("no distance above the spacing", all(step <= spacing_m for _, _, step in lanes), [lane[2] for lane in lanes])
    shown = [[] for _ in lanes]
    for place in places:
        found = [along_m(place, start, end) for start, end, _ in lanes]
        nearest = min(range(len(lanes)), key=lambda k: found[k][1])
        check("a picture on a lane", found[nearest][1] < lane_m / 4, f"{found[nearest][1]:.2f} m beside")
        shown[nearest].append(found[nearest][0])
    for (start, end, step), own in zip(lanes, shown):
        length = along_m(end, start, end)[0]
        own.sort()
        check("pictures at both ends", own and own[0] < PASSED_M and own[-1] > length - PASSED_M, f"{own} of {length:.1f} m")
        gap = max((b - a for a, b in zip(own, own[1:])), default=0.0)
        check("no wider gap", gap < step + late_m, f"{gap:.2f} m for {step:.2f} m")


async def use(drone, url, pictures_url, folder, vehicle, autopilot, trigger):
    ardupilot = autopilot == "ardupilot"
    folder = pathlib.Path(folder)
    plan, waypoints = (str(folder / f"vehicle-{vehicle}.{kind}") for kind in ("plan", "waypoints"))
    loader = mavwp.MAVWPLoader()
    check("pymavlink reads .waypoints", loader.load(waypoints) > 5, loader.count())
    listed = [loader.wp(k) for k in range(loader.count())]
    check("the first is home", (listed[0].command, listed[0].frame) == (16, 0))
    check("they are numbered", [item.seq for item in listed] == list(range(len(listed))))
    with open(folder / "waypoints.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["act"] == "photo" and row["vehicle"] == vehicle]
    photos = [(float(row["lat_deg"]), float(row["lon_deg"])) for row in rows]
    check("pictures are planned", len(photos) > 3, len(photos))

    await drone.connect(system_address=url)
    check("connected", await first(drone.core.connection_state(), lambda s: s.is_connected, 20))
    pictures = Pictures(pictures_url)
    pictures.start()
    await drone.telemetry.set_rate_position(5.0)
    await drone.telemetry.set_rate_in_air(5.0)
    check("position", await first(drone.telemetry.position(), lambda p: abs(p.latitude_deg - photos[0][0]) < 0.1, 40))
    missions = drone.mission_raw
    data = await missions.import_qgroundcontrol_mission(plan)
    items = data.mission_items
    check("MAVSDK imports .plan", len(items) == len(listed) - (not ardupilot), len(items))
    check("neither fence nor rally points", not data.geofence_items and not data.rally_items)
    # For ArduPilot MAVSDK puts home before the items.
    own = items[1:] if ardupilot else items
    unlike = [k for k, (item, other) in enumerate(zip(own, listed[1:])) if not same(item, other)]
    check("both files say the same", not unlike, unlike[:5])
    flown = [item.command for item in own if item.command != 93]
    check("it takes off first and returns last", (flown[0], flown[-1]) == (22, 20))
    await missions.upload_mission(items)
    check("uploaded", True)
    stored = await missions.download_mission()
    seen = [(i.seq, i.command, i.frame, i.x, i.y, i.z) for i in stored]
    check("downloaded as it was", seen == [(i.seq, i.command, i.frame, i.x, i.y, i.z) for i in items])

    for _ in range(20):
        # ArduCopter refuses until its estimator is ready.
        try:
            await drone.action.arm()
            break
        except Exception as error:
            print(f"   not yet: {error}", flush=True)
            await asyncio.sleep(1.0)
    check("armed", await first(drone.telemetry.armed(), lambda armed: armed, 10))
    if ardupilot:
        # On the ground ArduCopter waits in AUTO for a throttle that nobody raises.
        await drone.action.takeoff()
        check("in the air", await first(drone.telemetry.in_air(), lambda in_air: in_air, 20))
    await missions.start_mission()
    check("started", True)
    progress = await first(missions.mission_progress(), lambda p: p.current >= len(items) - 1, 130)
    check("flown to its return", progress, progress)
    check("landed and disarmed", await first(drone.telemetry.armed(), lambda armed: not armed, 40) is not None)

    check("told as this autopilot tells", pictures.kinds == {"CAMERA_FEEDBACK" if ardupilot else "CAMERA_IMAGE_CAPTURED"})
    begin = 1 if ardupilot else 0
    check("numbered", pictures.indices == list(range(begin, begin + len(pictures.indices))), pictures.indices[:3])
    if trigger == "distance":
        planned = json.loads((folder / "result.json").read_text())["coverage"]
        cruise_mps = next(item.param2 for item in listed if item.command == 178)
        late_m = cruise_mps * LATE_S[autopilot] + ROUNDED_M
        check_lanes(pictures.places, lanes_of(listed), planned["lane_m"], planned["waypoint_m"], late_m)
        return
    check("as many as planned", len(pictures.places) == len(photos), f"{len(pictures.places)} of {len(photos)}")
    worst = max(apart_m(a, b) for a, b in zip(pictures.places, photos))
    check("each where it was planned", worst < PASSED_M, f"{worst:.2f} m")


if __name__ == "__main__":
    run(use, TIMEOUT_S)
