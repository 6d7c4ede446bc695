"""A toy method for GapBench: `python example_adapter.py CASES OUT`. Finds a gain or a delay; needs numpy."""

import json
import sys
from pathlib import Path

import numpy as np


def error_of(case: Path, part: str, gain: float = 1.0, delay: int = 0) -> float:
    """Return the rms error in a part of a case of its simulator with a gain and a delay [rows]."""
    squares = []
    for path in sorted((case / part).glob("*.csv")):
        measured = np.genfromtxt(path, delimiter=",", names=True)["speed_rpm"]
        said = np.genfromtxt(case / "simulator" / part / path.name, delimiter=",", names=True)["speed_rpm"]
        squares.append((measured[delay:] - gain * said[: said.size - delay]) ** 2)
    return float(np.sqrt(np.nanmean(np.concatenate(squares))))


def answer(case: Path) -> dict[str, object]:
    """Return the verdict on a case: whatever halves the error of the simulator explains it."""
    before = error_of(case, "changed")
    if before < 1.5 * error_of(case, "nominal"):
        return {"verdict": "no_gap"}
    gain = min(error_of(case, "changed", gain=g) for g in np.linspace(0.5, 1.5, 21))
    delay = min(error_of(case, "changed", delay=d) for d in range(1, 10))
    if min(gain, delay) > 0.5 * before:
        return {"verdict": "unexplained"}
    twins = ("speed_gain", "sensor_scale") if gain < delay else ("command_latency", "sensor_latency")
    return {"verdict": "ambiguous", "candidates": [[name] for name in twins]}


if __name__ == "__main__":
    cases, out = map(Path, sys.argv[1:3])
    out.mkdir(parents=True, exist_ok=True)
    found = {case.name: answer(case) for case in sorted(cases.iterdir())}
    answers = {"format": "gapbench-answers/1", "method": "a gain or a delay", "cases": found}
    (out / "answers.json").write_text(json.dumps(answers, indent=1))
