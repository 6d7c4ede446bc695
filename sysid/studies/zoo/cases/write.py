"""The logs of a bench case as files: nominal ones for the fit, and those with something hidden."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.cases.draw import NOISE, draw_bench_case, study_commands
from sysid.studies.zoo.cases.layouts import LAYOUTS, STANDARD, Layout
from sysid.studies.zoo.cases.plans import FIT_PLANS, Commands
from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.simulate import Log, simulate

_SPLITS: Final = ("fit", "fit", "validation", "fit", "test", "fit", "validation", "test")
"""Of the groups of the nominal logs."""


def write_bench_case(seed: int, folder: Path) -> Case:
    """Write a seed's nominal logs to `folder`/nominal and its case's to `folder`/logs; return the case.

    The same seed writes the same bytes.
    """
    case, nominal, changed = draw_bench_case(seed)
    layout = next(layout for layout in LAYOUTS if layout.name == case.layout)
    fit_plan = str(np.random.default_rng((seed, NOISE)).choice(FIT_PLANS))
    commands = study_commands(seed, fit_plan, STANDARD, nominal, nominal=True)
    _write_study(folder / "nominal", nominal, commands, STANDARD, (seed, NOISE, 0), _SPLITS)
    commands = study_commands(seed, case.plan, layout, nominal, nominal=False)
    _write_study(folder / "logs", changed, commands, layout, (seed, NOISE, 1), ())
    return case


def _write_study(
    folder: Path,
    drive: Drive,
    commands: Sequence[Commands],
    layout: Layout,
    key: tuple[int, ...],
    splits: Sequence[str],
) -> None:
    """Write every run of a study and what belongs together; without `splits` the reader assigns them."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["[dataset]", f'name = "bench, free wheel, {layout.name}"']
    for group, sequence in enumerate(commands):
        for repeat in range(layout.repeats):
            name = f"run_{group:02d}_{repeat}.csv"
            log = simulate(drive, sequence, np.random.default_rng((*key, group, repeat)))
            (folder / name).write_text(_csv(log), encoding="utf-8")
            lines += ["", "[[runs]]", f'file = "{name}"', f'group = "sequence_{group:02d}"']
            if splits:
                lines.append(f'split = "{splits[group]}"')
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _csv(log: Log) -> str:
    """Return a log as text: stamps to the microsecond, a missing sample as an empty cell."""
    columns = {"time_s": "{:.6f}", "command_rpm": "{:g}", "speed_rpm": "{:.6g}", "battery_v": "{:.2f}"}
    values = {name: getattr(log, name) for name in columns if getattr(log, name) is not None}
    rows = [
        ",".join("" if np.isnan(v) else columns[name].format(v) for name, v in zip(values, row, strict=True))
        for row in zip(*values.values(), strict=True)
    ]
    return "\n".join([",".join(values), *rows]) + "\n"
