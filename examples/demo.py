"""The main job, end to end: logs -> fit -> model -> the robot drives in MuJoCo -> picture and video.

Example: python examples/demo.py --out out
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mecanum_env.cli import run
from mecanum_env.rendering.backend import use_backend

LOGS = Path(__file__).parent / "logs"


def demo(out: Path = Path("out")) -> None:
    """Fit the bundled bench logs, then drive and film the robot with the identified wheels.

    Args:
        out: folder to write.
    """
    use_backend()  # before anything imports mujoco
    from mecanum_env.mjcf.__main__ import main as write_mjcf
    from mecanum_env.render import render
    from sysid.fit.__main__ import fit

    print("1. python -m sysid.fit examples/logs --out", out)
    fit(LOGS, out=out)
    model = out / "model.json"
    print("\n2. python -m mecanum_env.mjcf", model, "--out", out / "mjcf")
    write_mjcf(model, out=out / "mjcf")
    print("\n3. python -m mecanum_env.render", model, "--commands tour --out", out / "rollout.mp4")
    render(str(model), commands="tour", out=out / "rollout.mp4", still=out / "robot.png")

    figures = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    best = figures["methods"][figures["method"]]
    runs = sum(best["runs"].values())
    sigma = figures["noise"]["sigma_rpm"]["speed_rpm"]
    rms, rise, settling = best["rms_rpm"]["test"], best["rise_time_s"], best["settling_time_s"]
    print(f"""
The wheel was identified from {runs} bench runs of a motor that no third-order law describes exactly:
{rms:.2f} rpm rms on runs it never saw, where repeats differ by {sigma:.2f} rpm; it rises in {rise:.3f} s
and settles in {settling:.3f} s, and is stable by construction.

Look at   {out / "report.html"}    how well, how sure, and what is left over
          {out / "fit.png"}        the same as one picture
          {out / "rollout.mp4"}    the robot on its rollers, driven by the identified wheels
          {out / "model.json"}     the model: everything else reads it""")


if __name__ == "__main__":
    sys.exit(run(demo, prog="python examples/demo.py"))
