"""Writing a plan: commands as CSV files, a dataset.toml for the logs to come, and PROTOCOL.md."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from mecanum_env.files import write_text
from mecanum_env.kinematics import WHEEL_SPEEDS
from mecanum_env.markdown import markdown_table
from mecanum_env.outputs import output_folder, require_empty
from mecanum_env.units import FloatArray
from sysid.logs.plan.layout import SAMPLE_S, Plan
from sysid.logs.plan.sequences import Sequence, Size
from sysid.logs.runs import TIME
from sysid.logs.settings import FILE_NAME
from sysid.logs.writer import quoted, write_columns

COMMANDS: Final = "commands"
"""Folder of the commands to play."""
LOGS: Final = "logs"
"""Folder for what is recorded."""
PROTOCOL: Final = "PROTOCOL.md"


def write_plan(plan: Plan, folder: Path) -> None:
    """Write a plan into a folder: commands/NAME.csv, logs/dataset.toml and PROTOCOL.md.

    Raises:
        InputError: the folder is not empty, or cannot be written.
    """
    require_empty(folder)
    with output_folder(folder, "sysid.logs plan", (PROTOCOL,)) as staged:
        for sequence in plan.sequences:
            write_columns(command_columns(sequence, plan.size), staged / COMMANDS / f"{sequence.name}.csv")
        write_text(staged / LOGS / FILE_NAME, _settings(plan))
        write_text(staged / PROTOCOL, protocol(plan))


def command_columns(sequence: Sequence, size: Size) -> dict[str, FloatArray]:
    """Return the columns of a sequence's file: a row where the command changes, and one at the end."""
    commands = sequence.commands
    changed = np.flatnonzero(np.any(commands[1:] != commands[:-1], axis=1)) + 1
    rows = np.concatenate([[0], changed, [len(commands)]])
    time = np.round(rows * size.period_s, 9)
    values = commands[np.minimum(rows, len(commands) - 1)]
    return {TIME: time, **dict(zip(size.columns, values.T, strict=True))}


def recordings(plan: Plan) -> list[tuple[str, Sequence]]:
    """Return the file names of a plan's runs as recorded: all sequences once, then the repeats."""
    passes = max(one.repeats for one in plan.sequences)
    return [
        (f"{one.name}_r{number}.csv", one)
        for number in range(1, passes + 1)
        for one in plan.sequences
        if one.repeats >= number
    ]


def _settings(plan: Plan) -> str:
    lines = [
        "# What the runs are. Remove the entry of a run that was not recorded.",
        "[dataset]",
        f"name = {quoted(f'first session, {plan.size.form}')}",
        "",
        "# Where your columns have other names or units, say so here, for example:",
        "# [columns]",
        '# speed_rpm = { from = "omega_rad_s", scale = 9.549296585513721 }',
    ]
    for file, sequence in sorted(recordings(plan), key=lambda item: item[0]):
        lines += ["", "[[runs]]", f"file = {quoted(file)}"]
        lines += [f"group = {quoted(sequence.name)}", f"split = {quoted(sequence.split)}"]
    return "\n".join(lines) + "\n"


def protocol(plan: Plan) -> str:
    """Return the page for whoever records the plan."""
    size = plan.size
    where = "one wheel on the bench" if size.form == "bench" else "the robot on its floor"
    columns = ", ".join(f"`{name}`" for name in size.columns)
    return f"""# Recording session: {where}

{len(recordings(plan))} runs, {plan.minutes:.0f} minutes. Planned for wheels of at most {size.top_rpm:g} rpm,
a command every {size.period_s:g} s, and speeds that settle in about {size.hold_s:g} s.

## Before you start

{_preparation(size)}

## What to do

1. Play `{COMMANDS}/NAME.csv`. A row says from when (`time_s`) to send which command{_units(size)}; send
   it until the next row. The last row is the end. Send commands at multiples of {size.period_s:g} s.
2. Meanwhile log a row every {1000 * SAMPLE_S:g} ms (20 ms still do): `time_s`, the command as sent
   ({columns}),
   and what was measured: {_measured(size)}.
   Leave a cell empty where a sample is missing. Do not filter or resample.
3. Store it as `{LOGS}/NAME_rK.csv`: K is 1 for the first time, 2 for the repeat, and so on. Record all
   sequences once, then the repeats: so a robot that warms up or a battery that falls shows.
4. After the first run, `python -m sysid.logs check {LOGS}/NAME_r1.csv` says whether units, stamps and
   sensors look right. Better now than after all runs.

A run that went wrong (an obstacle, a lost link) is recorded again; one that is left out loses its entry in
`{LOGS}/{FILE_NAME}`.

## The runs

{_runs(plan)}

The model is fitted to `fit` runs; `validation` runs choose between explanations; `test` runs are for the
figures at the end. Repeats of the same commands tell noise from error: please repeat them as listed.

## Afterwards

    python -m sysid.logs check {LOGS}
    python -m sysid.logs plot {LOGS} --out logs.png
    python -m sysid.fit {LOGS}{"" if size.form == "bench" else " --robot robot.json"} --out fit

{_after(size)}

## How precise that will be

With a noise of {plan.noise_rpm:.3g} rpm on a measured speed, the runs of the fit give {_errors(plan)}
(two standard errors of a drive of first order that rises in {size.rise_s:g} s).
Wanted: {plan.precision_percent:g} %. `fit/fit.json` states the errors of what you recorded.
"""


def _preparation(size: Size) -> str:
    if size.form == "bench":
        return f"""- Lift the wheel off the floor, so that it turns freely, and fix the robot.
- Charge the battery, and note its voltage; log it as `battery_v` if you can.
- The fastest command is {1.1 * size.top_rpm:.0f} rpm, above the top speed on purpose: it shows the ceiling.
  Have a stop at hand.
- Wheel speeds are rpm of the wheel, after the gearbox."""
    return f"""- Clear a square of {size.room_m:g} m on its floor, with the robot in the middle.
  Every sequence returns about to where it began; put the robot back into the middle before each run.
- Measure wheel radius, wheelbase and track with a ruler and weigh the robot; write them into `robot.json`
  (`wheel_radius_m`, `half_wheelbase_m`, `half_track_m`, `mass_kg`).
- Charge the battery, and note its voltage; log it as `battery_v` if you can. Have a stop at hand.
- V and VC are rpm of the wheel; theta is the direction of motion, counter-clockwise from forward."""


def _units(size: Size) -> str:
    return " [rpm of the wheel]" if size.form == "bench" else " (V [rpm], theta [deg], VC [rpm])"


def _measured(size: Size) -> str:
    if size.form == "bench":
        return "`speed_rpm`"
    speeds = ", ".join(f"`{name}`" for name in WHEEL_SPEEDS)
    return f"{speeds}\n   and, where a sensor gives them, `yaw_rate_rad_s`, `vx_m_s`, `vy_m_s`"


def _after(size: Size) -> str:
    ask = "    python -m sysid.gap changed --model fit/model.json"
    if size.form == "bench":
        return f"""When something about the drive changes (load, firmware ...), play the same commands again
into a new folder and ask what changed:

{ask}

The robot on its floor is a session of its own: `python -m sysid.logs plan --form floor`."""
    return f"""To learn what a model of the bench lacks here, or what changed since, ask:

{ask}"""


def _errors(plan: Plan) -> str:
    return ", ".join(f"{name} {error:.2g} %" for name, error in plan.errors_percent.items())


def _runs(plan: Plan) -> str:
    rows = [
        [f"`{one.name}`", f"{one.duration_s(plan.size):.0f}", str(one.repeats), one.split, one.shows]
        for one in plan.sequences
    ]
    return markdown_table(["commands", "seconds", "times", "split", "shows"], rows)
