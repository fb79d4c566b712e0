#!/usr/bin/env python3
"""Looks on while `host-sim fly SCENARIO --qgc udp:127.0.0.1:PORT` flies the demo, and asks as QGroundControl does.

Usage: ground_station.py udpin:127.0.0.1:PORT

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after 110
seconds.
"""

import math
import os
import signal
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "ardupilotmega"
from pymavlink import mavutil  # noqa: E402

from pilot import PATIENCE_S, check  # noqa: E402

IDS = range(1, 11)
AUTOPILOT, COMPANION = 1, 191
ORIGIN = 40.3327, -3.7659
# Until the mission is prepared.
START_S = 60.0


class Station:
    """One socket, ten vehicles: what each component last said of each kind."""

    def __init__(self, url):
        self.link = mavutil.mavlink_connection(url, source_system=255, source_component=190)
        self.heard = {}
        self.bad = 0
        self.next_beat = 0.0

    def spin(self, seconds, done):
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end:
            message = self.link.recv_match(blocking=True, timeout=0.05)
            if message is None:
                continue
            if time.monotonic() >= self.next_beat:
                self.next_beat = time.monotonic() + 1.0
                self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
            if message.get_type() == "BAD_DATA":
                self.bad += 1
                continue
            self.heard[self.key(message.get_type(), message.get_srcSystem(), message.get_srcComponent())] = message
        return done()

    @staticmethod
    def key(kind, system, component=AUTOPILOT):
        return kind, system, component

    def last(self, kind, system, component=AUTOPILOT):
        return self.heard.get(self.key(kind, system, component))

    def all(self, kind, component=AUTOPILOT, holds=lambda message: True):
        return all(self.last(kind, i, component) and holds(self.last(kind, i, component)) for i in IDS)

    def who(self, kind):
        return sorted((system, component) for (of, system, component) in self.heard if of == kind)


def metres(message):
    north = (message.lat * 1e-7 - ORIGIN[0]) * 111_200
    return (message.lon * 1e-7 - ORIGIN[1]) * 111_200 * math.cos(math.radians(ORIGIN[0])), north


def main():
    signal.alarm(110)
    station = Station(sys.argv[1])
    check("ten autopilots", station.spin(START_S, lambda: station.all("HEARTBEAT")), station.who("HEARTBEAT"))
    check("and no more", {system for system, _ in station.who("HEARTBEAT")} == set(IDS), station.who("HEARTBEAT"))
    for kind in ["GLOBAL_POSITION_INT", "ATTITUDE", "SYS_STATUS", "EXTENDED_SYS_STATE", "VFR_HUD", "GPS_RAW_INT"]:
        check(f"{kind} of each", station.spin(PATIENCE_S, lambda: station.all(kind)), station.who(kind))
    places = [metres(station.last("GLOBAL_POSITION_INT", i)) for i in IDS]
    check("each in the building", all(-5 < x < 60 and -5 < y < 60 for x, y in places), places)
    apart = min(math.dist(a, b) for a in places for b in places if a is not b)
    check("each at its own place", apart > 1.0, f"{apart:.2f} m")
    check("ten companions", station.spin(PATIENCE_S, lambda: station.all("HEARTBEAT", COMPANION)))

    station.link.mav.param_request_read_send(3, AUTOPILOT, b"MPC_XY_VEL_MAX", -1)
    check("a parameter of vehicle 3", station.spin(PATIENCE_S, lambda: station.last("PARAM_VALUE", 3)))
    check("answered by no other", station.who("PARAM_VALUE") == [(3, AUTOPILOT)], station.who("PARAM_VALUE"))
    station.link.mav.command_long_send(5, AUTOPILOT, 512, 0, 148, 0, 0, 0, 0, 0, 0)
    check("AUTOPILOT_VERSION of vehicle 5", station.spin(PATIENCE_S, lambda: station.last("AUTOPILOT_VERSION", 5)))
    station.spin(PATIENCE_S, lambda: station.last("COMMAND_ACK", 5))
    check("acknowledged by it alone", station.who("COMMAND_ACK") == [(5, AUTOPILOT)], station.who("COMMAND_ACK"))

    def airborne(i):
        state = station.last("EXTENDED_SYS_STATE", i)
        return state.landed_state == 2

    check("somebody flies", station.spin(START_S, lambda: any(airborne(i) for i in IDS)))
    check("companions say what they do", station.who("STATUSTEXT") != [], station.who("STATUSTEXT"))
    flying = next(i for i in IDS if airborne(i))
    # The buttons of docs/companion.md, in flight: a start changes nothing there.
    orders = [("a pause", 193, 0), ("a start", 300, 0), ("going on", 193, 1), ("a return", 20, 0), ("landing", 21, 0)]
    for name, command, param1 in orders:
        station.heard.pop(station.key("COMMAND_ACK", flying, COMPANION), None)
        station.link.mav.command_long_send(flying, COMPANION, command, 0, param1, 0, 0, 0, 0, 0, 0)
        answered = station.spin(PATIENCE_S, lambda: station.last("COMMAND_ACK", flying, COMPANION))
        answer = station.last("COMMAND_ACK", flying, COMPANION)
        check(f"a companion obeys {name}", answered and (answer.command, answer.result) == (command, 0), answer)
    check("no frame that does not parse", station.bad == 0, f"{station.bad} bad")


if __name__ == "__main__":
    main()
