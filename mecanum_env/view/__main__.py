"""`python -m mecanum_env.view MODEL`: drive the robot in a browser page, or look at a log there."""

from __future__ import annotations

import signal
import webbrowser
from contextlib import closing
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.model import paper_model, read_model
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import has_display, use_backend


def view(
    model: Annotated[str, tyro.conf.Positional] = "paper",
    /,
    log: Path | None = None,
    plant: Literal["rollers", "planar"] = "rollers",
    port: int | None = None,
    browser: bool = True,
) -> Done:
    """Show a model as a live robot in a browser page on this machine, driven by keyboard, gamepad or mouse.

    The page draws commanded against actual wheel speeds and switches effects on and off. With --log it shows
    a log beside its simulation instead, and the difference. Ctrl-C ends it.

    Example: python -m mecanum_env.view fit/model.json --log logs/drive_1.csv

    Args:
        model: path of a model.json, or "paper" for the packaged model.
        log: a log (.csv, .csv.gz, .parquet) of the robot, or of one wheel on the bench, to replay.
        plant: rollers on a floor, or the fast planar plant, whose wheels do not turn in the picture.
        port: port of the page; by default the first free one from 8350 on.
        browser: open the page in a browser, where there is a display.
    """
    # Before anything imports mujoco, which chooses its graphics library then.
    use_backend()
    from mecanum_env.view.live import Driving
    from mecanum_env.view.replay import read_log
    from mecanum_env.view.replaying import Replaying
    from mecanum_env.view.server import Server

    chosen = paper_model() if model == "paper" and not Path(model).exists() else read_model(model)
    try:
        shown = Driving(chosen, plant) if log is None else Replaying(chosen, read_log(log), plant)
        with closing(shown), closing(Server(port, shown.hello())) as server:
            print(f"{server.url}\nOpen this page on this machine; Ctrl-C ends.", flush=True)
            if browser and has_display():
                webbrowser.open(server.url)
            try:
                shown.run(server)
            finally:
                # A second Ctrl-C must not interrupt the closing.
                signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        print("stopped")
    return Done()


if __name__ == "__main__":
    raise SystemExit(run(view, prog="python -m mecanum_env.view"))
