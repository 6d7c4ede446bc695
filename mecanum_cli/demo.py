"""The main workflow, end to end: logs -> fit -> gap found and closed -> a drive in MuJoCo -> video."""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import fill

from mecanum_env.files import asset_path
from mecanum_env.programs import Done
from mecanum_env.rendering.backend import use_backend


def demo(out: Path = Path("out")) -> Done:
    """Fit the bundled bench logs, find what changed in later ones, then drive and film the robot.

    Example: mecanum demo --out out

    Args:
        out: folder to write.
    """
    use_backend()  # before anything imports mujoco
    from mecanum_env.mjcf.__main__ import main as write_mjcf
    from mecanum_env.render import render
    from sysid.fit.__main__ import fit
    from sysid.gap.__main__ import gap

    print("1. mecanum fit @examples/logs --out", out)
    fit(asset_path("examples/logs"), out=out)
    print("\n2. mecanum gap @examples/gap_logs --model", out / "model.json", "--out", out / "gap")
    gap(asset_path("examples/gap_logs"), model=out / "model.json", out=out / "gap", jobs=2)
    model = out / "gap" / "model.json"
    print("\n3. mecanum mjcf", model, "--out", out / "mjcf")
    write_mjcf(model, out=out / "mjcf")
    print("\n4. mecanum render", model, "--commands tour --out", out / "rollout.mp4")
    render(str(model), commands="tour", out=out / "rollout.mp4", still=out / "robot.png")

    fitted = json.loads((out / "fit.json").read_text(encoding="utf-8"))
    best = fitted["methods"][fitted["method"]]
    runs = sum(best["runs"].values())
    sigma = fitted["noise"]["sigma_rpm"]["speed_rpm"]
    rms, rise, settling = best["rms_rpm"]["test"], best["rise_time_s"], best["settling_time_s"]
    study = json.loads((out / "gap" / "gap.json").read_text(encoding="utf-8"))
    print(f"""
The wheel law was identified from {runs} bench runs of a motor that no third-order law describes exactly.
Its error is {rms:.2f} rpm rms on runs that were not fitted, where repeats differ by {sigma:.2f} rpm. It rises
in {rise:.3f} s, settles in {settling:.3f} s, and is stable by construction.

Then something was changed in the drive. From logs made after that, the study concludes:
{fill(study["sentence"], 100)}
The robot in the video has these effects, too.

Look at""")
    shown = (
        (out / "report.html", "the fit of the wheel, the uncertainty of its parameters, and the residuals"),
        (out / "fit.png", "the same as one picture"),
        (out / "gap" / "report.html", "where model and later logs differ, what is missing, before and after"),
        (out / "rollout.mp4", "the robot on its rollers, driven by the wheels as they are now"),
        (model, "the model with the missing effects: all other programs read it"),
    )
    for path, what in shown:
        print(f"  {path!s:<21}  {what}")
    return Done(wrote=[path for path, _ in shown])
