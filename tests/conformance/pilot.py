"""What the pymavlink scripts share: one connection that keeps setpoints going and remembers what it heard."""

import os
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "ardupilotmega"
from pymavlink import mavutil  # noqa: E402

ARMED = 128
# An answer that takes longer is none.
PATIENCE_S = 10.0


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
        self.parameters = {}
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
            if kind == "PARAM_VALUE":
                self.parameters[message.param_id] = message.param_value
            if kind == "COMMAND_ACK":
                self.acks.append((message.command, message.result))
        return done()

    def command(self, command, *params):
        """Sends a command; what it was acknowledged with, and again within the half second after the first time.

        The first may take as long as a stalled machine takes. It is not sent twice: each ack is one the command drew.
        """
        self.acks.clear()
        params = list(params) + [0.0] * (7 - len(params))
        self.link.mav.command_long_send(1, 1, command, 0, *params)
        self.spin(PATIENCE_S, lambda: any(acked == command for acked, _ in self.acks))
        self.spin(0.5)
        return [result for acked, result in self.acks if acked == command]

    def rate(self, kind, seconds, holds):
        """Messages a second of one kind, as `holds` wants them; the last of three windows if none was so.

        A stall of the machine moves messages from one window into the next.
        """
        for _ in range(3):
            self.count.clear()
            start = time.monotonic()
            self.spin(seconds)
            rate = self.count.get(kind, 0) / (time.monotonic() - start)
            if holds(rate):
                break
        return rate

    def position(self):
        p = self.last["LOCAL_POSITION_NED"]
        return p.x, p.y, p.z

    def near(self, target, within):
        return sum((a - b) ** 2 for a, b in zip(self.position(), target)) < within**2

    def armed(self):
        return bool(self.last["HEARTBEAT"].base_mode & ARMED)
