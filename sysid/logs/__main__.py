"""Plan, check, draw, import and export logs: `python -m sysid.logs plan`, `... check LOGS` and so on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.programs import Done, run_one_of
from sysid.logs.formats.bags import Clock, Unit
from sysid.logs.plan.sequences import Form, Size


def check(logs: tyro.conf.Positional[Path], /, all_findings: bool = False) -> Done:
    """Read logs, and print their runs, their splits and whatever is odd in them.

    Example: python -m sysid.logs check @examples/logs

    Args:
        logs: A folder of runs, or one run.
        all_findings: Print every finding of every run instead of one per kind.
    """
    from sysid.logs.describe import dataset_json, describe
    from sysid.logs.reader import read_dataset

    dataset = read_dataset(logs)
    print(describe(dataset, all_findings=all_findings))
    return Done(found=dataset_json(dataset))


def import_logs(
    sources: tyro.conf.Positional[tuple[Path, ...]],
    /,
    out: Path,
    map: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = (),
    robot: Path | None = None,
    unit: Unit | None = None,
    clock: Clock = "auto",
) -> Done:
    """Import bags, MCAP files, LeRobot datasets, or tables with other columns as runs into a new folder.

    Example: python -m sysid.logs import a.csv --out logs --map time_s=stamp:ns --map speed_rpm=omega:rad_s

    Args:
        sources: ROS 1 .bag files, ROS 2 bag folders, .mcap files, LeRobot datasets (v3), tables (.csv,
            .parquet) or folders of tables.
        out: Folder to write; it must not contain runs of these names yet.
        map: For bags ROLE=TOPIC where message types do not decide (command, wheel_commands, wheel_speeds,
            odometry, imu, battery; command_rpm and speed_rpm for the bench), ROLE=none, or WHEEL=JOINT (fl,
            fr, rl, rr; joint for the bench). For all others OURS=THEIRS, OURS=THEIRS:UNIT (rad_s, deg_s, ns
            ...) or OURS=none. May be given several times.
        robot: JSON with the robot's dimensions, which a Twist command needs.
        unit: Unit of std_msgs numbers.
        clock: Stamp samples of a bag by message header or by time of receipt.
    """
    from mecanum_env.files import write_text
    from mecanum_env.outputs import finish_interrupted, output_folder
    from sysid.logs.describe import dataset_json, describe
    from sysid.logs.formats.sources import import_source, read_dimensions
    from sysid.logs.reader import read_dataset
    from sysid.logs.settings import FILE_NAME
    from sysid.logs.writer import quoted, write_columns

    if not sources:
        raise InputError("no source given; give bags, .mcap files, LeRobot datasets or tables")
    geometry, interactive = None if robot is None else read_dimensions(robot), sys.stderr.isatty()
    runs = [
        run
        for source in sources
        for run in import_source(source, geometry, map, unit=unit, clock=clock, progress=interactive)
    ]
    names = [run.name for run in runs]
    finish_interrupted(out)
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"two runs have the name {name}; rename one, or import them into two folders")
        if (out / f"{name}.csv").exists():
            raise InputError(f"{out / f'{name}.csv'}: exists already; choose another --out")
    with output_folder(out, "sysid.logs import") as staged:
        for run in runs:
            write_columns(run.columns, staged / f"{run.name}.csv")
        if not (out / FILE_NAME).exists():
            write_text(staged / FILE_NAME, f"[dataset]\nname = {quoted(out.resolve().name)}\n")
    for run in runs:
        print(f"{run.name}: {run.said}")
    dataset = read_dataset(out)
    print(describe(dataset))
    return Done(wrote=[out / f"{name}.csv" for name in names], found=dataset_json(dataset))


def export(
    logs: tyro.conf.Positional[Path],
    /,
    out: Path,
    to: Literal["mcap", "parquet", "lerobot"] = "mcap",
    fps: int = 30,
) -> Done:
    """Write logs for other programs: MCAP for Foxglove and PlotJuggler, Parquet, or a LeRobot dataset.

    Example: python -m sysid.logs export @examples/logs --to mcap --out out/mcap

    Args:
        logs: A folder of runs, or one run. Simulated ones come from python -m sysid.simulate.
        out: Folder to write.
        to: mcap: one file per run, with JSON messages and their schemas; parquet: one file per run, with all
            digits; lerobot: one dataset (v3), resampled.
        fps: Frames per second of a LeRobot dataset.
    """
    from mecanum_env.outputs import output_folder, require_empty
    from mecanum_env.tables import table_stem
    from sysid.logs.formats.json_mcap import write_mcap
    from sysid.logs.formats.lerobot import INFO, write_lerobot
    from sysid.logs.reader import read_dataset
    from sysid.logs.writer import write_dataset

    require_at_least(1, fps=fps)
    if to == "lerobot":
        require_empty(out)
    dataset = read_dataset(logs)
    names = [f"{table_stem(Path(run.file))}.{to}" for run in dataset.runs]
    with output_folder(out, "sysid.logs export") as staged:
        if to == "lerobot":
            write_lerobot(dataset, staged, fps)
        elif to == "parquet":
            runs = tuple(replace(run, file=name) for run, name in zip(dataset.runs, names, strict=True))
            write_dataset(replace(dataset, runs=runs), staged)
        else:
            for run, name in zip(dataset.runs, names, strict=True):
                write_mcap(run, staged / name)
    print(f"wrote {len(names)} runs to {out}")
    return Done(wrote=[out / INFO] if to == "lerobot" else [out / name for name in names])


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
) -> Done:
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
    found = {
        "runs": [name for name, _ in recordings(made)],
        "minutes": made.minutes,
        "noise_rpm": made.noise_rpm,
        "errors_percent": made.errors_percent,
    }
    return Done(wrote=[out / PROTOCOL], found=found)


def plot(logs: tyro.conf.Positional[Path], /, out: Path = Path("logs.png")) -> Done:
    """Draw commands and wheel speeds of every command sequence, repeats over each other.

    Example: python -m sysid.logs plot @examples/logs --out logs.png

    Args:
        logs: A folder of runs, or one run.
        out: Picture to write: .png, .svg or .pdf.
    """
    from sysid.logs.plots import plot_logs
    from sysid.logs.reader import read_dataset

    dataset = read_dataset(logs)
    shown, groups = plot_logs(dataset, out), len(dataset.groups())
    print(f"wrote {out}" + (f" with the first {shown} of {groups} sequences" if shown < groups else ""))
    return Done(wrote=[out])


def body(logs: tyro.conf.Positional[tuple[Path, ...]], /, robot: Path, out: Path | None = None) -> Done:
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
    from mecanum_env.outputs import output_folder, require_empty
    from sysid.logs.bodies import (
        DIRECTIONS,
        body_runs,
        body_table,
        direction_dataset,
        read_measured,
        read_wheel_logs,
    )
    from sysid.logs.settings import FILE_NAME
    from sysid.logs.writer import write_dataset

    if not logs:
        raise InputError("no logs given; give a folder with all wheels, or one for each wheel")
    wheels = mecanum_wheels(read_robot(robot))
    if out is not None:
        require_empty(out)
    datasets = read_wheel_logs(logs, wheels)
    runs = body_runs(datasets, wheels, read_measured(logs[0]) if len(logs) == 1 else {})
    print(body_table(runs))
    found = {"runs": [run.wheels[0].file for run in runs]}
    if out is None:
        return Done(found=found)
    named = {f"wheel_{wheel.name}": dataset for wheel, dataset in zip(wheels, datasets, strict=True)}
    for index, name in enumerate(DIRECTIONS):
        made = direction_dataset(runs, index, wheels, f"the body's motion: {name}")
        named |= {} if made is None else {f"body_{name}": made}
    with output_folder(out, "sysid.logs body") as staged:
        for name, dataset in named.items():
            write_dataset(dataset, staged / name)
    print(f"wrote bench logs to {out}: {', '.join(named)}; study each with python -m sysid.fit and sysid.gap")
    print("not supported: one study of all wheels and the body at once, which knows four Mecanum wheels only")
    return Done(wrote=[out / name / FILE_NAME for name in named], found=found)


COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {
    "plan": plan,
    "check": check,
    "plot": plot,
    "import": import_logs,
    "export": export,
    "body": body,
}


def main(args: list[str]) -> int:
    """Run the command of `COMMANDS` that `args` names; return the exit code."""
    return run_one_of(COMMANDS, args, "python -m sysid.logs")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
