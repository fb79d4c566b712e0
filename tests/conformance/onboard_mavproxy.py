#!/usr/bin/env python3
"""Uses a companion's files and parameters through the routing of its autopilot, by the commands a person gives MAVProxy.

Usage: onboard_mavproxy.py udpout:127.0.0.1:PORT ROADMAP MISSION COUNT

COUNT is how many parameters a companion has.

Prints one `ok ...` line for each thing that held; the first that does not ends it with exit code 1. Ends itself after 150
seconds.
"""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time

from pilot import check

SYSTEM, COMPANION = 1, 191
PATIENCE_S = 60.0


class MavProxy:
    """MAVProxy with its parameter and FTP modules alone, and what it prints."""

    def __init__(self, url, directory):
        program = os.path.join(os.path.dirname(sys.executable), "mavproxy.py")
        self.process = subprocess.Popen(
            [sys.executable, program, f"--master={url}", f"--target-system={SYSTEM}", f"--target-component={COMPANION}",
             "--source-system=255", "--no-state", "--default-modules=param,ftp", "--logfile=log.tlog"],
            cwd=directory, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1)
        self.said = ""
        self.news = threading.Condition()
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while character := self.process.stdout.read(1):
            with self.news:
                self.said += character
                self.news.notify_all()

    def until(self, *texts, seconds=PATIENCE_S):
        """Whether it has printed all of these since the last command."""
        end = time.monotonic() + seconds
        with self.news:
            while not all(text in self.said for text in texts):
                if not self.news.wait(max(end - time.monotonic(), 0)):
                    return False
        return True

    def does(self, command, *texts):
        """Gives a command; whether all of these are printed then."""
        with self.news:
            self.said = ""
        self.process.stdin.write(command + "\n")
        return self.until(*texts)


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


def main():
    signal.signal(signal.SIGALRM, lambda *_: sys.exit("too late"))
    signal.alarm(150)
    url, roadmap, mission, count = sys.argv[1:]
    with tempfile.TemporaryDirectory() as directory:
        proxy = MavProxy(url, directory)
        try:
            use(proxy, roadmap, mission, os.path.join(directory, "back.bin"), int(count))
        finally:
            proxy.process.kill()


def use(proxy, roadmap, mission, back, count):
    fetched = f"Received {count} parameters"
    holds = lambda name, answer: check(name, answer, proxy.said)  # noqa: E731
    holds("the companion is found", proxy.until(f"Detected vehicle {SYSTEM}:{COMPANION}"))
    holds("parameters are fetched", proxy.until(fetched))
    holds("and listed", proxy.does("param show FLK*", "FLK_ACCEL        1.5", "FLK_SPEED_MAX    20.0", "FLK_SYS_ID       0.0"))
    proxy.does("param set FLK_ACCEL 2.25")
    holds("one is set", proxy.does("param fetch", fetched))
    holds("and read back", proxy.does("param show FLK_ACCEL", "2.25"))
    holds("nothing there yet", proxy.does("ftp list /", "Total size 0.00"))
    for path in (roadmap, mission):
        name, size = os.path.basename(path), os.path.getsize(path)
        holds(f"{name} goes up", proxy.does(f"ftp put {path} {name}", f"Sent file of length {size}"))
        holds("it is listed", proxy.does("ftp list /", f"{name}\t{size}", "Total size"))
        holds("its CRC is answered", proxy.does(f"ftp crc {name}", f"crc: {name} 0x"))
        holds("it comes back", proxy.does(f"ftp get {name} {back}", f"Wrote {size} bytes"))
        # It closes the file after it says so.
        end = time.monotonic() + PATIENCE_S
        while bytes_of(back) != bytes_of(path) and time.monotonic() < end:
            time.sleep(0.1)
        holds("the same", bytes_of(back) == bytes_of(path))
    proxy.does("ftp rm mission.bin")
    end = time.monotonic() + PATIENCE_S
    while proxy.does("ftp list /", "Total size") and "mission.bin" in proxy.said and time.monotonic() < end:
        time.sleep(0.5)
    holds("a file is removed", "Total size" in proxy.said and "mission.bin" not in proxy.said)
    holds("the other one is not", "roadmap.bin" in proxy.said)


if __name__ == "__main__":
    main()
