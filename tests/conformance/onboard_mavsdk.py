#!/usr/bin/env python3
"""Uses a companion's files and parameters through the routing of its autopilot, with MAVSDK.

Usage: onboard_mavsdk.py udpin://127.0.0.1:PORT ROADMAP MISSION

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after 120
seconds.
"""

import asyncio
import os
import tempfile

from drone import check, first, run
from mavsdk.param import ProtocolVersion

TIMEOUT_S = 120
COMPANION = 191


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


async def refused(action):
    """The name of the error an action ends with."""
    try:
        await action
    except Exception as error:
        return str(error)
    return ""


async def listed(ftp):
    """What the companion lists; none at all is an error to some versions."""
    entries = await ftp.list_directory("/")
    return getattr(entries, "files", entries)


async def use(drone, address, roadmap, mission):
    await drone.connect(system_address=address)
    check("connected", await first(drone.core.connection_state(), lambda s: s.is_connected, 20))
    ftp, param = drone.ftp, drone.param
    await ftp.set_target_compid(COMPANION)

    # Its companion may still be preparing its mission.
    for _ in range(60):
        answer = await refused(ftp.list_directory("/"))
        if "TIMEOUT" not in answer.upper():
            break
        await asyncio.sleep(1)
    check("the companion answers", "TIMEOUT" not in answer.upper(), answer)

    for path in (roadmap, mission):
        name = os.path.basename(path)
        last = None
        async for progress in ftp.upload(path, "/"):
            last = progress
        check(f"{name} goes up", last and last.bytes_transferred == last.total_bytes == os.path.getsize(path), last)
        check(f"{name} is the same there", await ftp.are_files_identical(path, f"/{name}"))
        check(f"{name} is listed", any(name in entry for entry in await listed(ftp)), await listed(ftp))
        # Read by read a roadmap takes half a minute.
        for burst in (True,) if path == roadmap else (False, True):
            with tempfile.TemporaryDirectory() as directory:
                async for progress in ftp.download(f"/{name}", directory, burst):
                    last = progress
                same = bytes_of(os.path.join(directory, name)) == bytes_of(path)
                check(f"{name} comes back, {'in bursts' if burst else 'read by read'}", same, last)
    why = await refused(ftp.remove_file("/nothing.bin"))
    check("what is not there cannot be removed", "NOT_EXIST" in why or "NOT_FOUND" in why, why)
    check("no directories", await refused(ftp.create_directory("/fs")))
    await ftp.remove_file("/mission.bin")
    check("a file is removed", not any("mission" in entry for entry in await listed(ftp)))

    # It does what it is asked and says UNKNOWN all the same: that the parameters below are the companion's shows it.
    await refused(param.select_component(COMPANION, ProtocolVersion.V1))
    parameters = await param.get_all_params()
    floats = {p.name: p.value for p in parameters.float_params}
    check("parameters are listed", "FLK_ACCEL" in floats, sorted(floats))
    check("all as floats", not parameters.int_params)
    for value in (2.5, floats["FLK_ACCEL"]):
        await param.set_param_float("FLK_ACCEL", value)
        check("one is read back", abs(await param.get_param_float("FLK_ACCEL") - value) < 1e-6, value)
    check("none that is not there", await refused(param.get_param_float("FLK_NONE")))


if __name__ == "__main__":
    run(use, TIMEOUT_S)
