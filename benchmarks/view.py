"""How live the live view is: pictures a second, processor time, time from a command to the wheels' motion.

python benchmarks/view.py
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from websockets.sync.client import ClientConnection, connect

DRIVE = json.dumps({"type": "drive", "v": 80, "theta": 0, "vc": 0})


def processor_s(pid: int) -> float:
    """Return the processor time that a process has taken so far [s]; Linux only."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def until_moving(page: ClientConnection) -> float:
    """Drive from rest and return the time until the page is told of a wheel that turns [s]."""
    start = time.monotonic()
    while True:
        page.send(DRIVE)
        message = page.recv()
        if isinstance(message, bytes):
            page.send('{"type": "seen"}')
        elif (motion := json.loads(message))["type"] == "motion" and max(motion["wheels_rpm"][-1]) > 5.0:
            return time.monotonic() - start


def watch(page: ClientConnection, pid: int, seconds: float) -> tuple[float, float, float]:
    """Drive for some seconds; return pictures a second, share of one processor, simulated over real time."""
    pictures, simulated, spent, start = 0, [], processor_s(pid), time.monotonic()
    while time.monotonic() - start < seconds:
        page.send(DRIVE)
        message = page.recv()
        if isinstance(message, bytes):
            pictures += 1
            page.send('{"type": "seen"}')
        elif (motion := json.loads(message))["type"] == "motion":
            simulated.append((time.monotonic(), motion["time_s"][-1]))
    passed = time.monotonic() - start
    (real, model), (real_end, model_end) = simulated[0], simulated[-1]
    return pictures / passed, (processor_s(pid) - spent) / passed, (model_end - model) / (real_end - real)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    for plant in ("rollers", "planar"):
        command = [sys.executable, "-m", "mecanum_env.view", "--no-browser", "--plant", plant]
        view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        url = view.stdout.readline().strip()
        with connect(url.replace("http", "ws") + "live", origin=url.rsplit("/", 2)[0]) as page:
            late = until_moving(page)
            fps, share, pace = watch(page, view.pid, seconds)
        view.send_signal(signal.SIGINT)
        view.communicate()
        print(
            f"{plant}: {fps:.1f} pictures a second, {share:.0%} of one processor, simulated / real time "
            f"{pace:.3f}, {1000 * late:.0f} ms from the first command to 5 rpm"
        )


if __name__ == "__main__":
    main()
