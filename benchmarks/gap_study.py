"""One study of the gap by one version of the library, for `benchmarks/gap.py`: its cost and its result.

    python -S benchmarks/gap_study.py REQUEST.json

The request names the folder of the version (`checkout`), the folders of installed packages (`packages`), the
logs, the model and the study's options; the answer goes to stdout as JSON. Without site (-S) no editable
installation puts other files in the place of the checkout's. This file knows only what all versions have.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any


def study(request: dict[str, Any]) -> dict[str, Any]:
    """Return seconds, processor seconds and result of the study that is asked for."""
    from mecanum_env.files import write_json
    from mecanum_env.model import read_model
    from sysid.gap.report.output import gap_json
    from sysid.gap.result import GapOptions
    from sysid.gap.wording import verdict_sentence
    from sysid.gap.workflow import analyse
    from sysid.logs import read_dataset

    data, model = read_dataset(request["logs"]), read_model(request["model"])
    began, computing = time.perf_counter(), time.process_time()
    report = analyse(data, model, GapOptions(seed=request["seed"], jobs=request["jobs"]))
    seconds, cpu_s = time.perf_counter() - began, time.process_time() - computing
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gap.json"
        write_json(path, gap_json(report))
        written = path.read_text()
    return {
        "runs": len(data.runs),
        "log_s": sum(run.duration_s for run in data.runs),
        "seconds": seconds,
        "cpu_s": cpu_s,
        "sets": len(report.evidence),
        "sentence": verdict_sentence(report),
        "gap_json": written,
    }


if __name__ == "__main__":
    asked = json.loads(Path(sys.argv[1]).read_text())
    sys.path[0] = asked["checkout"]
    sys.path += asked["packages"]
    json.dump(study(asked), sys.stdout)
