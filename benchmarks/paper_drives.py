"""The paper's robot drives: straight at 10, 40, 80 and 130 rpm, and turning in place at 1.484 rad/s.

Each drive starts from rest, holds its command for three seconds and stops (`sysid.studies.reproduce.robot`).
The paper (section 4.5) prints how much slower its robot was than its model. The simulated robot loses only
what rollers and grip lose; the remaining loss of the paper's robot is due to effects that a free wheel's law
does not have: friction, load, battery, sensors.

Example: python benchmarks/paper_drives.py --out out/paper_drives.json
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.model import paper_model, read_model
from mecanum_env.simulator import RobotPlant
from sysid.studies.reproduce.published import MODEL_RISE_S, ROBOT_RISE_S
from sysid.studies.reproduce.robot import RobotDrive, robot_drives

METRICS = tuple(f.name for f in fields(RobotDrive) if f.name not in ("time_s", "body", "law"))


def main(model: Path | None = None, plant: RobotPlant = "rollers", out: Path | None = None) -> None:
    """Run the paper's drives and print the results beside those in its text.

    Args:
        model: model file; by default the packaged one.
        plant: "rollers" or "planar".
        out: JSON file to write.
    """
    results = robot_drives(paper_model() if model is None else read_model(model), plant)
    print(
        f"{'drive':18} {'commanded':>14} {'steady':>8} {'loss':>8} {'paper: loss':>11} "
        f"{'rise s':>7} {'wheel s':>7} {'fall s':>7}"
    )
    for r in results:
        print(
            f"{r.name:18} {r.commanded:8.4g} {r.unit:>5} {r.steady:8.4g} {r.loss:8.4f} {r.paper_loss:11.4f} "
            f"{r.rise_s:7.3f} {r.wheel_rise_s:7.3f} {r.fall_s:7.3f}"
        )
    print(f"paper: rise {MODEL_RISE_S} s of its model without load, {ROBOT_RISE_S} s of its robot")
    if out is not None:
        drives = [{name: getattr(r, name) for name in METRICS} for r in results]
        rise = {"model": MODEL_RISE_S, "robot": ROBOT_RISE_S}
        write_json(out, {"plant": plant, "drives": drives, "paper_rise_s": rise})


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/paper_drives.py"))
