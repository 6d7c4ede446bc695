"""Check logs or import ROS bags: `python -m sysid.logs check LOGS`, `... import BAG --out DIR`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from mecanum_env.cli import run as run_command
from mecanum_env.errors import InputError
from sysid.logs.bags import Clock, Unit


def check(logs: tyro.conf.Positional[Path], /, all_findings: bool = False) -> None:
    """Read logs, and print their runs, their splits and whatever is odd in them.

    Example: python -m sysid.logs check examples/logs

    Args:
        logs: A folder of runs, or one run.
        all_findings: Print every finding of every run instead of one per kind.
    """
    from sysid.logs.describe import describe
    from sysid.logs.reader import read_dataset

    print(describe(read_dataset(logs), all_findings=all_findings))


def import_bags(
    bags: tyro.conf.Positional[tuple[Path, ...]],
    /,
    out: Path,
    map: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = (),
    robot: Path | None = None,
    unit: Unit | None = None,
    clock: Clock = "auto",
) -> None:
    """Import ROS 1 or ROS 2 bags as runs into a new folder of logs.

    Example: python -m sysid.logs import drive_1 drive_2 --out logs --map imu=none --robot robot.json

    Args:
        bags: .bag files or ROS 2 bag folders.
        out: Folder to write; it must not contain runs of these names yet.
        map: ROLE=TOPIC where message types do not decide (command, wheel_commands, wheel_speeds, odometry,
            imu, battery; command_rpm and speed_rpm for the bench), ROLE=none, or WHEEL=JOINT (fl, fr, rl,
            rr; joint for the bench). May be given several times.
        robot: JSON with the robot's dimensions, for Twist commands; default: the packaged robot's.
        unit: Unit of std_msgs numbers.
        clock: Stamp samples by message header or by time of receipt.
    """
    from mecanum_env.files import write_text
    from mecanum_env.model import Robot, read_robot
    from sysid.logs.bags import import_bag
    from sysid.logs.describe import describe
    from sysid.logs.reader import read_dataset
    from sysid.logs.settings import FILE_NAME
    from sysid.logs.writer import quoted, write_columns

    if not bags:
        raise InputError("no bag given; give .bag files or ROS 2 bag folders")
    names = [bag.stem if bag.is_file() else bag.resolve().name for bag in bags]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"two bags have the name {name}; rename one")
        if (out / f"{name}.csv").exists():
            raise InputError(f"{out / f'{name}.csv'}: exists already; choose another --out")
    geometry = Robot() if robot is None else read_robot(robot)
    imported = [
        import_bag(bag, geometry, topic_map=map, unit=unit, clock=clock, progress=sys.stderr.isatty())
        for bag in bags
    ]
    for name, part in zip(names, imported, strict=True):
        write_columns(part.columns, out / f"{name}.csv")
        topics = ", ".join(f"{role} = {topic}" for role, topic in part.choice.topics.items())
        print(f"{name}: {topics}; stamped by {part.clock}")
    if robot is None and any("command" in part.choice.topics for part in imported):
        print("commands computed with the packaged robot's dimensions; give --robot FILE if yours differ")
    if not (out / FILE_NAME).exists():
        write_text(out / FILE_NAME, f"[dataset]\nname = {quoted(out.resolve().name)}\n")
    print(describe(read_dataset(out)))


COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {"check": check, "import": import_bags}


def main(args: list[str]) -> int:
    """Run the command of `COMMANDS` that `args` names; return the exit code."""
    if args and args[0] in COMMANDS:
        return run_command(COMMANDS[args[0]], args[1:], prog=f"python -m sysid.logs {args[0]}")
    help_wanted = args[:1] in (["-h"], ["--help"])
    lines = "\n".join(f"  {name:8}{(c.__doc__ or '').splitlines()[0]}" for name, c in COMMANDS.items())
    usage = f"usage: python -m sysid.logs {{check,import}} ...\n\n{lines}"
    print(usage, file=sys.stdout if help_wanted else sys.stderr)
    return 0 if help_wanted else 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
