"""Fit recordings of real robots and print the errors of the law as a Markdown table.

Example: python benchmarks/real_logs.py --out out/real_logs.json

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro
from recordings import recordings
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.markdown import markdown_table
from sysid.fit import FitOptions, fit_dataset, fit_json
from sysid.fit.pipeline import Fit
from sysid.logs import read_dataset
from sysid.progress import seconds_of

DATASETS = ("husky/left", "husky/right", "husky/body", "micromouse/closed_loop_left",
            "micromouse/closed_loop_right", "micromouse/duty_left", "micromouse/duty_right")  # fmt: skip
HEAD = ("logs", "rms fit", "validation", "test rpm", "rise s", "order", "delay ms", "ceiling rpm", "white",
        "free of the input", "independent share", "s")  # fmt: skip


def main(
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = DATASETS,
    /,
    starts: int = 5,
    out: Path | None = None,
) -> None:
    """Fit the recordings and print the table and all notes; stop with a message if there are none.

    Example: python benchmarks/real_logs.py husky/left --starts 2

    Args:
        names: recordings, as folders below MECANUM_REAL_LOGS.
        starts: number of starting points of each fit.
        out: JSON file to write, with the results of all fits.
    """
    folder = recordings("husky", "micromouse")
    if folder is None:
        return
    rows, notes, results = [], [], {}
    for name in tqdm(names, desc="recordings", leave=False, disable=None):
        data = read_dataset(folder / name)
        fit, seconds = seconds_of(lambda data=data: fit_dataset(data, FitOptions(starts=starts)))
        rows.append((name, *row(fit), f"{seconds:.0f}"))
        notes.append(f"\n{name}\n" + "".join(f"\n- {note}" for note in fit.notes))
        results[name] = {"seconds": seconds, **fit_json(fit)}
    print(markdown_table(HEAD, rows))
    print("\n".join(notes))
    if out is not None:
        write_json(out, results)


def row(fit: Fit) -> tuple[str, ...]:
    """Return the cells of one recording between its name and its seconds."""
    metrics, found, tests = fit.methods[fit.estimate.method], fit.estimate, fit.residual_tests
    ceiling = found.saturation_rpm
    return (
        *(f"{metrics.errors[s].rms_rpm:.1f}" for s in ("fit", "validation", "test")),
        f"{metrics.metrics.rise_time_s:.3g}",
        str(1 + ("B" in found.free) + ("C" in found.free)),
        f"{found.delay_s * 1e3:.0f}",
        f"{ceiling:.0f}" if ceiling < float("inf") else "-",
        "yes" if tests.whiteness.passed else "no",
        "yes" if tests.input_correlation.passed else "no",
        f"{fit.uncertainty.effective_samples / fit.uncertainty.samples:.2f}",
    )


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/real_logs.py"))
