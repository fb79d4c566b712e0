"""What the MAVSDK scripts share: checks, waiting for a value, and one connection with an end."""

import asyncio
import os
import signal
import socket
import sys

from mavsdk import System


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


def free_port():
    # None of those that the system hands out by itself: another process may be handed it before the server has it.
    port = 10_000 + os.getpid() % 10_000
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)):
                return port
        port += 1


async def connected(use, timeout_s):
    drone = System(port=free_port())
    try:
        await asyncio.wait_for(use(drone, *sys.argv[1:]), timeout_s)
        code = 0
    except Failed as failure:
        print(f"FAILED {failure}", flush=True)
        code = 1
    except asyncio.TimeoutError:
        print(f"FAILED not done within {timeout_s} s", flush=True)
        code = 1
    finally:
        drone._stop_mavsdk_server()
    # Streams that are still open would keep the interpreter from ending.
    sys.stdout.flush()
    os._exit(code)


def run(use, timeout_s):
    """Runs `use(drone, *arguments)`; the process ends with 0 if all held."""
    signal.alarm(timeout_s + 10)
    asyncio.run(connected(use, timeout_s))
