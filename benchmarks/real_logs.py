"""Fit recordings of real robots and print what the law reaches on them, as a Markdown table.

Example: python benchmarks/real_logs.py > table.md

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder.
"""

import os
import sys
from pathlib import Path

import numpy as np

from sysid.fit import FitOptions, fit_dataset
from sysid.fit.pipeline import Fit
from sysid.logs import read_dataset
from sysid.measure import seconds_of

DATASETS = ("husky/left", "husky/right", "husky/body", "micromouse/closed_loop_left",
            "micromouse/closed_loop_right", "micromouse/duty_left", "micromouse/duty_right")  # fmt: skip
HEAD = ("logs", "rms fit", "validation", "test rpm", "rise s", "order", "delay ms", "ceiling rpm", "white",
        "free of the input", "independent share", "s")  # fmt: skip


def main(names: list[str]) -> None:
    default = Path(__file__).parents[1].parent / "shared" / "data"
    folder = Path(os.environ.get("MECANUM_REAL_LOGS", default))
    if not (folder / "husky").is_dir():
        print("no real logs here; set MECANUM_REAL_LOGS to the folder that holds husky/ and micromouse/")
        return
    rows, notes = [HEAD, tuple("---" for _ in HEAD)], []
    for name in names or DATASETS:
        data = read_dataset(folder / name)
        fit, seconds = seconds_of(lambda data=data: fit_dataset(data, FitOptions(starts=5)))
        rows.append((name, *row(fit), f"{seconds:.0f}"))
        notes.append(f"\n{name}\n" + "".join(f"\n- {note}" for note in fit.notes))
    print("\n".join("| " + " | ".join(cells) + " |" for cells in rows))
    print("\n".join(notes))


def row(fit: Fit) -> tuple[str, ...]:
    figures, found, tests = fit.methods[fit.estimate.method], fit.estimate, fit.residual_tests
    return (
        *(f"{figures.errors[s].rms_rpm:.1f}" for s in ("fit", "validation", "test")),
        f"{figures.metrics.rise_time_s:.3g}",
        str(1 + ("B" in found.free) + ("C" in found.free)),
        f"{found.delay_s * 1e3:.0f}",
        f"{found.saturation_rpm:.0f}" if np.isfinite(found.saturation_rpm) else "-",
        "yes" if tests.whiteness.passed else "no",
        "yes" if tests.input_correlation.passed else "no",
        f"{fit.uncertainty.effective_samples / fit.uncertainty.samples:.2f}",
    )


if __name__ == "__main__":
    main(sys.argv[1:])
