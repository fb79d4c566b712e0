#!/usr/bin/env python3
"""Reads a plan of `host-sim cover` as ground stations do, uploads it with MAVSDK and has `host-sim autopilot` fly it.

Usage: plan_flight.py udpin://127.0.0.1:PORT udpout:127.0.0.1:PORT PLAN WAYPOINTS CSV (px4|ardupilot)

`.plan` is read by MAVSDK's import, `.waypoints` by pymavlink's loader; the pictures that the autopilot reports, on the
second link, are counted and placed beside those of `waypoints.csv`. Prints one `ok ...` line for each thing that held;
the first that does not ends it with exit code 1. Ends itself after 150 seconds.
"""

import asyncio
import csv
import math
import os
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


async def use(drone, url, pictures_url, plan, waypoints, table, autopilot):
    ardupilot = autopilot == "ardupilot"
    loader = mavwp.MAVWPLoader()
    check("pymavlink reads .waypoints", loader.load(waypoints) > 5, loader.count())
    listed = [loader.wp(k) for k in range(loader.count())]
    check("the first is home", (listed[0].command, listed[0].frame) == (16, 0))
    check("they are numbered", [item.seq for item in listed] == list(range(len(listed))))
    with open(table, newline="") as file:
        photos = [(float(row["lat_deg"]), float(row["lon_deg"])) for row in csv.DictReader(file) if row["act"] == "photo"]
    check("pictures are planned", len(photos) > 4, len(photos))

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
    check("it takes off first and returns last", (own[0].command, own[-1].command) == (22, 20))
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
    check("as many as planned", len(pictures.places) == len(photos), f"{len(pictures.places)} of {len(photos)}")
    worst = max(apart_m(a, b) for a, b in zip(pictures.places, photos))
    check("each where it was planned", worst < PASSED_M, f"{worst:.2f} m")


if __name__ == "__main__":
    run(use, TIMEOUT_S)
