"""A toy method for GapBench: `python example_adapter.py CASES OUT`. Names a gain or a delay; needs numpy."""

import csv
import json
import sys
from pathlib import Path

import numpy as np


def column(path: Path, name: str) -> np.ndarray:
    """Return the column of a CSV file by its name, shape (n,); a missing sample is NaN."""
    with path.open(newline="") as file:
        return np.array([float(row[name] or "nan") for row in csv.DictReader(file)])


def error_of(case: Path, part: str, gain: float, delay: int) -> float:
    """Return the rms error of a part of the case if its simulator had a gain and a delay [rows]."""
    squares = []
    for path in sorted((case / part).glob("*.csv")):
        said = gain * column(case / "simulator" / part / path.name, "speed_rpm")
        measured = column(path, "speed_rpm")
        squares.append((measured[delay:] - said[: said.size - delay]) ** 2)
    return float(np.sqrt(np.nanmean(np.concatenate(squares))))


def answer(case: Path) -> dict[str, object]:
    """Return the verdict on a case: what halves the error of the simulator is named."""
    normal = error_of(case, "nominal", 1.0, 0)
    before = error_of(case, "changed", 1.0, 0)
    if before < 1.5 * normal:
        return {"verdict": "no_gap"}
    gain = min(error_of(case, "changed", g, 0) for g in np.linspace(0.5, 1.5, 41))
    delay = min(error_of(case, "changed", 1.0, d) for d in range(1, 10))
    if min(gain, delay) > 0.5 * before:
        return {"verdict": "unexplained"}
    pair = ("speed_gain", "sensor_scale") if gain < delay else ("command_latency", "sensor_latency")
    return {"verdict": "ambiguous", "candidates": [[name] for name in pair]}


if __name__ == "__main__":
    cases, out = map(Path, sys.argv[1:3])
    answers = {case.name: answer(case) for case in sorted(cases.iterdir())}
    out.mkdir(parents=True, exist_ok=True)
    whole = {"format": "gapbench-answers/1", "method": "gain or delay", "cases": answers}
    (out / "answers.json").write_text(json.dumps(whole, indent=1))
