#!/usr/bin/env python3
"""Uses a companion's files and parameters through the routing of its autopilot, with pymavlink and its FTP client.

Usage: onboard_pymavlink.py udpout:127.0.0.1:PORT ROADMAP MISSION

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after 150
seconds.
"""

import os
import signal
import sys
import tempfile
import time

from pilot import PATIENCE_S, check, mavutil
from pymavlink import mavftp

SYSTEM, COMPANION = 1, 191
REBOOT, REQUEST_MESSAGE, ACCEL = 246, 512, b"FLK_ACCEL"


class Ground:
    """A ground station that listens to the companion, not to the autopilot that passes its messages on."""

    def __init__(self, url):
        self.link = mavutil.mavlink_connection(url, source_system=255, source_component=190)
        self.heard = []
        self.next_beat = 0.0

    def spin(self, seconds, done):
        """Listens until `done` or the time is over; what `done` gave last."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if time.monotonic() >= self.next_beat:
                self.next_beat = time.monotonic() + 1.0
                self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
            message = self.link.recv_match(blocking=True, timeout=0.05)
            if message is not None and message.get_srcComponent() == COMPANION:
                self.heard.append(message)
            result = done()
            if result:
                return result
        return done()

    def until(self, kind, holds=lambda m: True, seconds=PATIENCE_S):
        """The first message of a kind heard for which `holds`."""
        return self.spin(seconds, lambda: next((m for m in self.heard if m.get_type() == kind and holds(m)), None))

    def ask(self, kind, send, holds=lambda m: True):
        """Asks again until it is answered: UDP may lose."""
        for _ in range(5):
            self.heard.clear()
            send()
            answer = self.until(kind, holds, PATIENCE_S / 2)
            if answer:
                return answer
        return None

    def command(self, command, *params):
        params = list(params) + [0.0] * (7 - len(params))
        send = lambda: self.link.mav.command_long_send(SYSTEM, COMPANION, command, 0, *params)  # noqa: E731
        ack = self.ask("COMMAND_ACK", send, lambda m: m.command == command)
        return ack.result if ack else None

    def read(self, name=b"", index=-1):
        send = lambda: self.link.mav.param_request_read_send(SYSTEM, COMPANION, name, index)  # noqa: E731
        return self.ask("PARAM_VALUE", send)

    def set(self, name, value):
        send = lambda: self.link.mav.param_set_send(SYSTEM, COMPANION, name, value, 9)  # noqa: E731
        return self.ask("PARAM_VALUE", send)


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


def parameters(ground):
    ground.link.mav.param_request_list_send(SYSTEM, COMPANION)
    listed = {}

    def all_listed():
        for m in ground.heard:
            if m.get_type() == "PARAM_VALUE":
                listed[m.param_index] = m
        return bool(listed) and len(listed) == next(iter(listed.values())).param_count

    check("parameters are listed", ground.spin(PATIENCE_S, all_listed), sorted(m.param_id for m in listed.values()))
    check("as REAL32", all(m.param_type == 9 for m in listed.values()))
    index = next(i for i, m in listed.items() if m.param_id == ACCEL.decode())
    check("one by its index", ground.read(index=index).param_id == ACCEL.decode())
    check("and by its name", abs(ground.read(ACCEL).param_value - listed[index].param_value) < 1e-6)
    check("one is set", abs(ground.set(ACCEL, 2.25).param_value - 2.25) < 1e-6)
    check("and read back", abs(ground.read(ACCEL).param_value - 2.25) < 1e-6)
    check("out of range the old one stands", abs(ground.set(ACCEL, 1e9).param_value - 2.25) < 1e-6)


def main():
    signal.alarm(150)
    url, roadmap, mission = sys.argv[1:]
    ground = Ground(url)
    check("the companion is heard", ground.until("HEARTBEAT", seconds=60))
    parameters(ground)
    version = ground.ask("AUTOPILOT_VERSION", lambda: ground.link.mav.command_long_send(
        SYSTEM, COMPANION, REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0))
    check("it can FTP", version and version.capabilities & 32, version and version.capabilities)
    answer = ground.ask("TIMESYNC", lambda: ground.link.mav.timesync_send(0, 1234567), lambda m: m.ts1 == 1234567)
    check("TIMESYNC is answered", answer and answer.tc1 > 0, answer)

    ftp = mavftp.MAVFTP(ground.link, SYSTEM, COMPANION)
    done = lambda result: result.error_code == 0  # noqa: E731

    def put(path, name):
        ftp.cmd_put([path, name])
        return ftp.process_ftp_reply("put", timeout=60)

    def get(name):
        with tempfile.TemporaryDirectory() as directory:
            target = os.path.join(directory, "file")
            ftp.cmd_get([name, target])
            result = ftp.process_ftp_reply("OpenFileRO", timeout=60)
            return bytes_of(target) if done(result) and os.path.exists(target) else result.error_code

    def names():
        return {entry.name: entry.size_b for entry in ftp.cmd_list(["/"]).directory_listing or []}

    check("nothing there yet", names() == {}, names())
    check("a roadmap goes up", done(put(roadmap, "/roadmap.bin")))
    check("it is listed", names() == {"roadmap.bin": os.path.getsize(roadmap)}, names())
    check("it comes back the same", get("roadmap.bin") == bytes_of(roadmap))
    check("its CRC is answered", done(ftp.cmd_crc(["roadmap.bin"])))
    check("a mission goes up", done(put(mission, "mission.bin")))
    check("and comes back the same", get("/mission.bin") == bytes_of(mission))
    with tempfile.NamedTemporaryFile() as damaged:
        damaged.write(bytes_of(mission)[:-1] + b"X")
        damaged.flush()
        put(damaged.name, "mission.bin")
    check("a damaged one is not kept", get("mission.bin") == bytes_of(mission))
    check("what is not there is not found", get("nothing.bin") == mavftp.FtpError.FileNotFound)
    check("it restarts on command", ground.command(REBOOT, 1) == 0)
    check("and is back", ground.until("STATUSTEXT", lambda m: m.text.startswith("Autopilot found")), ground.heard)
    check("with the parameter kept", abs(ground.read(ACCEL).param_value - 2.25) < 1e-6)
    check("and the files", names() == {"roadmap.bin": os.path.getsize(roadmap), "mission.bin": os.path.getsize(mission)})
    check("a file is removed", done(ftp.cmd_rm(["mission.bin"])))
    check("and is gone", "mission.bin" not in names(), names())


if __name__ == "__main__":
    main()
