"""Let a controller drive a robot: `python -m training.run POLICY --robot udp:HOST`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done
from training.drivers.interface import SILENCE_S

SILENT: Final = 3
"""Exit code when the robot cannot be heard any more."""


def drive(
    controller: tyro.conf.Positional[str],
    /,
    robot: str,
    model: Path | None = None,
    fights: int = 1,
    out: Path = Path("out/run"),
    silence: float = SILENCE_S,
) -> Done:
    """Fight on a robot, ten commands a second, and log every fight in our own format for python -m sysid.gap.

    A policy that was not trained for the model is refused. When nothing is heard of the robot for 0.3 s, it
    is told to stop, and the program ends with exit code 3.

    Example: python -m training.run robust --robot udp:127.0.0.1:9750 --fights 20 --out out/run

    Args:
        controller: Name of a controller as for python -m training.certify, a policy's file or folder among
            them; each may be followed by +compensated.
        robot: udp:HOST[:PORT], serial:DEVICE[:BAUD], or MODULE:CLASS of a driver of your own.
        model: Model file of the robot, as far as it is known; by default the packaged one.
        fights: Number of fights.
        out: Folder to write: logs/fight_0000.csv and so on, and fights.json.
        silence: How long the robot may be silent [s]; more for a simulated robot on a busy machine.
    """
    from mecanum_env.errors import InputError, require_at_least
    from mecanum_env.files import require_writable
    from mecanum_env.model import paper_model, read_model
    from training.certify.checks import share_text
    from training.drivers import RobotSilentError, open_driver
    from training.run.loop import Fight, play_series
    from training.run.summary import FILE_NAME, success_of, timing_text, write_summary
    from training.run.with_contract import controller_for

    require_at_least(1, fights=fights)
    if not silence > 0.0:
        raise InputError(f"silence = {silence:g}, must be above 0")
    if list((out / "logs").glob("fight_*")):
        raise InputError(f"{out / 'logs'}: has logs of fights already; choose another folder")
    require_writable(out / FILE_NAME)
    known = paper_model() if model is None else read_model(model)
    player = controller_for(controller, known, "the packaged model" if model is None else str(model))
    driver = open_driver(robot)
    done: list[Fight] = []

    def note(fight: Fight) -> None:
        done.append(fight)
        print(f"fight {fight.number}: {fight.outcome} after {fight.commands} commands", flush=True)

    try:
        play_series(driver, player, fights, out / "logs", note, silence)
    except RobotSilentError as error:
        print(f"error: {error}", file=sys.stderr)
        return Done(SILENT, wrote=[out / FILE_NAME], error=str(error))
    finally:
        driver.close()
        write_summary(out / FILE_NAME, controller, robot, done)
    print(f"success {share_text(success_of(done))}; {timing_text(done)}")
    print(f"wrote {out / FILE_NAME} and {out / 'logs'}")
    return Done(wrote=[out / FILE_NAME])


if __name__ == "__main__":
    sys.exit(run(drive, prog="python -m training.run"))
