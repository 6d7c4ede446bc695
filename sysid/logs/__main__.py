"""Plan, check, draw and import logs: `python -m sysid.logs plan`, `... check LOGS` and so on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from mecanum_env.cli import run as run_command
from mecanum_env.errors import InputError
from sysid.logs.bags import Clock, Unit
from sysid.logs.findings import KINDS
from sysid.logs.plan.sequences import Form, Size
from sysid.logs.runs import SPLITS, UNITS, Dataset, Run


def check(logs: tyro.conf.Positional[Path], /, all_findings: bool = False) -> None:
    """Read logs, and print their runs, their splits and whatever is odd in them.

    Example: python -m sysid.logs check examples/logs

    Args:
        logs: A folder of runs, or one run.
        all_findings: Print every finding of every run instead of one per kind.
    """
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
    from mecanum_env.outputs import finish_interrupted, output_folder
    from sysid.logs.bags import import_bag
    from sysid.logs.reader import read_dataset
    from sysid.logs.settings import FILE_NAME
    from sysid.logs.writer import quoted, write_columns

    if not bags:
        raise InputError("no bag given; give .bag files or ROS 2 bag folders")
    names = [bag.stem if bag.is_file() else bag.resolve().name for bag in bags]
    finish_interrupted(out)
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
    with output_folder(out, "sysid.logs import") as staged:
        for name, part in zip(names, imported, strict=True):
            write_columns(part.columns, staged / f"{name}.csv")
        if not (out / FILE_NAME).exists():
            write_text(staged / FILE_NAME, f"[dataset]\nname = {quoted(out.resolve().name)}\n")
    for name, part in zip(names, imported, strict=True):
        topics = ", ".join(f"{role} = {topic}" for role, topic in part.choice.topics.items())
        print(f"{name}: {topics}; stamped by {part.clock}")
    if robot is None and any("command" in part.choice.topics for part in imported):
        print("commands computed with the packaged robot's dimensions; give --robot FILE if yours differ")
    print(describe(read_dataset(out)))


def plan(
    out: Path = Path("plan"),
    form: Form = "bench",
    top_speed: float = Size.top_rpm,
    period: float = Size.period_s,
    rise: float = Size.rise_s,
    noise: float | None = None,
    precision: float = 1.0,
    minutes: float | None = None,
    room: float = Size.room_m,
    robot: Path | None = None,
) -> None:
    """Plan a recording session for your robot: commands as CSV files, a dataset.toml and PROTOCOL.md.

    Example: python -m sysid.logs plan --top-speed 200 --rise 0.15 --out plan

    Args:
        out: New folder to write.
        form: bench: one wheel in the air; floor: a robot on four Mecanum wheels drives.
        top_speed: Fastest speed of a wheel [rpm].
        period: Time between two commands that the robot takes [s].
        rise: About how long a wheel takes to reach a new speed [s].
        noise: Noise of a measured speed [rpm]; default 1 % of the top speed.
        precision: Wanted error of the drive's gain, rise time, delay and friction [%].
        minutes: Time for the whole session; default: as much as the precision needs.
        room: Side of the free square on the floor [m].
        robot: JSON with the robot's dimensions, for the floor; default: the packaged robot's.
    """
    from mecanum_env.model import Robot, read_robot
    from sysid.logs.plan.layout import make_plan
    from sysid.logs.plan.protocol import PROTOCOL, recordings, write_plan

    known = Robot() if robot is None else read_robot(robot)
    size = Size(form, top_speed, period, rise, room, known)
    made = make_plan(size, precision_percent=precision, noise_rpm=noise, minutes=minutes)
    write_plan(made, out)
    worst = max(made.errors_percent.values())
    print(
        f"{len(recordings(made))} runs of {len(made.sequences)} command sequences, {made.minutes:.1f} "
        f"minutes; ",
        end="",
    )
    print(f"expected error {worst:.2g} % with a noise of {made.noise_rpm:.3g} rpm")
    print(f"wrote {out}; read {out / PROTOCOL}")


def plot(logs: tyro.conf.Positional[Path], /, out: Path = Path("logs.png")) -> None:
    """Draw commands and wheel speeds of every command sequence, repeats over each other.

    Example: python -m sysid.logs plot examples/logs --out logs.png

    Args:
        logs: A folder of runs, or one run.
        out: Picture to write: .png, .svg or .pdf.
    """
    from sysid.logs.plots import plot_logs
    from sysid.logs.reader import read_dataset

    dataset = read_dataset(logs)
    shown, groups = plot_logs(dataset, out), len(dataset.groups())
    print(f"wrote {out}" + (f" with the first {shown} of {groups} sequences" if shown < groups else ""))


def body(logs: tyro.conf.Positional[tuple[Path, ...]], /, robot: Path, out: Path | None = None) -> None:
    """Read a robot on any number of omni wheels, wheel by wheel, and say how its body moves.

    Example: python -m sysid.logs body logs --robot robot.json --out wheels

    Args:
        logs: One folder of runs with command_NAME_rpm and speed_NAME_rpm for every wheel of the robot, or one
            folder of bench logs for each wheel, in the order of robot.json.
        robot: JSON with the robot's dimensions: "wheels", or those of the four Mecanum wheels fl, fr, rl, rr.
        out: Folder for bench logs of every wheel and of the body's directions, to fit and to study each.
    """
    from mecanum_env.kinematics import mecanum_wheels
    from mecanum_env.model import read_robot
    from mecanum_env.outputs import finish_interrupted, output_folder
    from sysid.logs.bodies import (
        DIRECTIONS,
        body_runs,
        body_table,
        direction_dataset,
        read_measured,
        read_wheel_logs,
    )
    from sysid.logs.writer import write_dataset

    if not logs:
        raise InputError("no logs given; give a folder with all wheels, or one for each wheel")
    wheels = mecanum_wheels(read_robot(robot))
    if out is not None:
        finish_interrupted(out)
    if out is not None and out.exists() and any(out.iterdir()):
        raise InputError(f"{out}: is not empty; choose another --out")
    datasets = read_wheel_logs(logs, wheels)
    runs = body_runs(datasets, wheels, read_measured(logs[0]) if len(logs) == 1 else {})
    print(body_table(runs))
    if out is None:
        return
    named = {f"wheel_{wheel.name}": dataset for wheel, dataset in zip(wheels, datasets, strict=True)}
    for index, name in enumerate(DIRECTIONS):
        made = direction_dataset(runs, index, wheels, f"the body's motion: {name}")
        named |= {} if made is None else {f"body_{name}": made}
    with output_folder(out, "sysid.logs body") as staged:
        for name, dataset in named.items():
            write_dataset(dataset, staged / name)
    print(f"wrote bench logs to {out}: {', '.join(named)}; study each with python -m sysid.fit and sysid.gap")
    print("not supported: one study of all wheels and the body at once, which knows four Mecanum wheels only")


def describe(dataset: Dataset, *, all_findings: bool = False) -> str:
    """Return a table of the runs, then findings (one per kind, or `all_findings`), then the noise floor."""
    from sysid.logs.noise import noise_from_repeats

    count = {name: len(dataset.split(name)) for name in SPLITS}
    split = ", ".join(f"{number} {name}" for name, number in count.items() if number)
    runs = "1 run" if len(dataset.runs) == 1 else f"{len(dataset.runs)} runs"
    sequences = f"{len(dataset.groups())} command sequences"
    lines = [f"{dataset.name}: {dataset.level} log, {runs} ({split}), {sequences}"]
    lines += [*_channels(dataset.runs), "", *_table(dataset.runs), ""]
    lines += [*_findings(dataset, all_findings), ""]
    noise = noise_from_repeats(dataset.runs)
    if noise is None:
        lines.append("noise floor: unknown, no two runs have the same commands (record repeats to get one)")
    else:
        for name, item in noise.items():
            lines.append(
                f"noise floor of {name}: {item.std:.3g} {UNITS[name]} +- {100 * item.relative_error:.2g} % "
                f"(repeats of {item.groups} sequences)"
            )
    return "\n".join(lines)


def _channels(runs: Sequence[Run]) -> list[str]:
    """Return one line per set of measured channels."""
    sets: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        sets.setdefault(tuple(run.channels), []).append(run.file)
    if len(sets) == 1:
        return ["measured: " + ", ".join(runs[0].channels)]
    return [f"measured in {len(f)} runs ({f[0]} ...): {', '.join(names)}" for names, f in sets.items()]


def _table(runs: Sequence[Run]) -> list[str]:
    rows = [("run", "group", "split", "rows", "seconds", "Hz", "commands")]
    for run in runs:
        numbers = str(run.time_s.size), f"{run.duration_s:.2f}", f"{1.0 / run.median_interval_s:.4g}"
        rows.append((run.file, run.group, run.split, *numbers, str(len(run.command_rows()))))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    align = (str.ljust, str.ljust, str.ljust, str.rjust, str.rjust, str.rjust, str.rjust)
    return [
        "  ".join(place(cell, w) for place, cell, w in zip(align, row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _findings(dataset: Dataset, every: bool) -> list[str]:
    if not dataset.findings:
        return ["nothing odd found"]
    lines = ["noticed:"]
    for kind in KINDS:
        found = [finding for finding in dataset.findings if finding.kind == kind]
        if not found:
            continue
        files = {finding.file for finding in found if finding.file}
        where = f" [{len(files)} of {len(dataset.runs)} runs]" if files else ""
        lines.append(f"- {kind}: {KINDS[kind]}{where}")
        lines += [
            f"    {f.file + ': ' if f.file else ''}{f.message}" for f in (found if every else found[:1])
        ]
        if len(found) > 1 and not every:
            lines.append(f"    and {len(found) - 1} more (--all-findings)")
    return lines


COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {
    "plan": plan,
    "check": check,
    "plot": plot,
    "import": import_bags,
    "body": body,
}


def main(args: list[str]) -> int:
    """Run the command of `COMMANDS` that `args` names; return the exit code."""
    if args and args[0] in COMMANDS:
        return run_command(COMMANDS[args[0]], args[1:], prog=f"python -m sysid.logs {args[0]}")
    help_wanted = args[:1] in (["-h"], ["--help"])
    lines = "\n".join(f"  {name:8}{(c.__doc__ or '').splitlines()[0]}" for name, c in COMMANDS.items())
    usage = f"usage: python -m sysid.logs {{{','.join(COMMANDS)}}} ...\n\n{lines}"
    print(usage, file=sys.stdout if help_wanted else sys.stderr)
    return 0 if help_wanted else 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
