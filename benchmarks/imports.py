"""How long `--help` of every program takes, relative to `import mujoco`.

Each program's help is timed in a fresh interpreter, by turns with `import mujoco`, so that all see the same
machine; the ratio of the medians counts. Target: at most 1.5.

    python benchmarks/imports.py --out out/bench/imports.json
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.errors import require_at_least
from mecanum_env.files import write_json

TARGET = 1.5
REFERENCE = {"import mujoco": ["-c", "import mujoco"]}
PARTS = {
    "python alone": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    "help of an empty command": ["-c", "def main(): pass\nimport tyro; tyro.cli(main, args=['--help'])"],
}
PROGRAMS = (
    *("mecanum_env.render", "mecanum_env.mjcf", "mecanum_env.effects"),
    *("sysid.logs", "sysid.fit", "sysid.gap", "sysid.online"),
    *("sysid.studies.reproduce", "sysid.studies.paper_gap"),
    *("sysid.studies.zoo", "sysid.studies.zoo.calibrate"),
    *("training.train", "training.certify", "training.compare", "training.record"),
)


def medians_s(commands: dict[str, list[str]], repeats: int) -> dict[str, float]:
    """Return the median wall time [s] of each command, measured by turns."""
    times: dict[str, list[float]] = {name: [] for name in commands}
    for _ in tqdm(range(repeats), desc="rounds", disable=None):
        for name, arguments in commands.items():
            start = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
            times[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in times.items()}


def main(out: Path | None = None, repeats: int = 9) -> None:
    """Measure and print the ratios; write them to a file.

    Example: python benchmarks/imports.py --out out/bench/imports.json

    Args:
        out: JSON file to write.
        repeats: rounds; the median over them counts.
    """
    require_at_least(1, repeats=repeats)
    helps = {name: ["-m", name, "--help"] for name in PROGRAMS}
    seconds = medians_s({**REFERENCE, **PARTS, **helps}, repeats)
    ratios = {name: value / seconds["import mujoco"] for name, value in seconds.items()}
    for name, ratio in ratios.items():
        late = f"  above the target of {TARGET:g}" if name in helps and ratio > TARGET else ""
        print(f"{name:<28}{seconds[name]:8.3f} s{ratio:8.2f}{late}")
    if out is not None:
        programs = {
            n: {"seconds": seconds[n], "ratio_to_import_mujoco": ratio} for n, ratio in ratios.items()
        }
        write_json(out, {"format": "mecanum-benchmark-imports/1", "target": TARGET, "programs": programs})
        print(f"written: {out}")


if __name__ == "__main__":
    sys.exit(run(main))
