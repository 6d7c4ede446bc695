"""A simulated robot in a process of its own: `python -m training.run.simulated_robot --model HIDDEN.json`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal, NoReturn

from mecanum_env.cli import run


def simulated_robot(
    model: Path | None = None,
    port: int = 9750,
    line: Literal["udp", "serial"] = "udp",
    latency: float = 0.01,
    jitter: float = 0.002,
    loss: float = 0.02,
    plant: Literal["planar", "rollers"] = "planar",
    difficulty: str = "normal",
    first_seed: int = 20_000,
    seed: int = 0,
    in_step: bool = False,
    journal: Path | None = None,
) -> NoReturn:
    """Simulate a robot that only its packets show, until it is killed.

    It prints one line with the name that python -m training.run --robot takes.

    Example: python -m training.run.simulated_robot --model hidden.json --port 9750

    Args:
        model: Model of the robot, with the effects that nobody outside knows; by default the packaged one.
        port: UDP port on this machine; 0 for a free one.
        line: udp, or serial for a pseudo-terminal.
        latency: Time that every packet takes, each way [s].
        jitter: Mean of the time on top of that [s].
        loss: Share of packets that never arrive, each way.
        plant: Planar, without slip, or rollers on a floor, ten times as slow.
        difficulty: Difficulty of the opponent: easy, normal or hard.
        first_seed: Seed of fight number 0.
        seed: Seed of the sensors' noise and of the link.
        in_step: Let time pass only while the controller is not computing, and as fast as possible: what comes
            late is the link's doing alone, however busy this machine is. For results; the watchdogs need real
            time.
        journal: File that gets a line for every change of the motors' command.
    """
    import numpy as np

    from mecanum_env.model import paper_model, read_model
    from training.drivers.interface import DriveCommand
    from training.drivers.named import BAUD
    from training.drivers.transport import Serial, Transport, Udp
    from training.run.link import LinkQuality
    from training.run.robot_side import RobotSide, serve, serve_in_step
    from training.run.world import World

    quality = LinkQuality(latency, jitter, loss)
    hidden = paper_model() if model is None else read_model(model)
    transport: Transport
    if line == "udp":
        transport = Udp("127.0.0.1", port, serves=True)
        name = f"udp:127.0.0.1:{transport.port}"
    else:
        own, other = os.openpty()  # the other end stays open, so that controllers may come and go
        transport = Serial(own, BAUD)
        name = f"serial:{os.ttyname(other)}"
    written = None if journal is None else journal.open("w", encoding="utf-8")

    def note(time_s: float, command: DriveCommand, why: str) -> None:
        if written is not None:
            print(f"{time_s:.6f}", *command, why, file=written, flush=True)

    world = World(hidden, plant, "dodge", difficulty, seed)
    robot = RobotSide(world, first_seed, note)
    print(name, flush=True)
    (serve_in_step if in_step else serve)(robot, transport, quality, np.random.default_rng([seed, 1]))


if __name__ == "__main__":
    sys.exit(run(simulated_robot, prog="python -m training.run.simulated_robot"))
