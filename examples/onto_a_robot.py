"""From a policy to a robot and back: fight over a bad link, log, find the gap, compensate, fight again.

The robot is another process, known by its packets only: a policy's fights on it -> their logs -> the gap and
its effects -> the same policy with the effects compensated -> fights again.

Example: python examples/onto_a_robot.py --out out/onto_a_robot
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from close_the_loop import EXCLUDED, NOMINAL, QUICK_ONLY, ROBUST
from loop_report import GREEN, RED, difference, difference_text, gap_lines, truth_text

from mecanum_env.cli import run
from mecanum_env.rendering.backend import use_backend

if TYPE_CHECKING:
    from mecanum_env.model import Model
    from sysid.gap.result import GapReport
    from training.evaluate import Share

PAGE: Final = Path(__file__).with_name("onto_a_robot.html")


def onto_a_robot(
    out: Path = Path("out/onto_a_robot"),
    fights: int = 100,
    jobs: int = 2,
    quick: bool = False,
) -> None:
    """Run all steps from the first fights on the robot to the last; write logs, model, story.json and a page.

    Args:
        out: folder to write; it must not have logs of fights.
        fights: number of fights of each controller.
        jobs: number of parallel processes of the study, which does not change its result.
        quick: consider few effects, and fight with one compensated policy, to see that everything runs.
    """
    use_backend()  # before anything imports mujoco
    import hidden_robot

    from mecanum_env.files import write_json
    from mecanum_env.model import paper_model, read_model, write_model
    from training.certify.checks import share_text
    from training.controllers.policy import bundled
    from training.export import export_policy

    began = time.perf_counter()
    known = paper_model()
    write_model(known, out / "model.json")
    print(f"1. The policy {NOMINAL}, exported with its contract -> {out / 'export'}")
    export_policy(bundled(NOMINAL), out / "export", onnx=False)

    with hidden_robot.served() as robot:
        print(f"\n2. {NOMINAL} fights on the robot at {robot} and logs -> {out / 'before'}")
        before = fought(NOMINAL, robot, out / "model.json", out / "before", fights)

        print(f"\n3. What is different? sysid.gap on the logs of the fights -> {out / 'gap' / 'model.json'}")
        report = study(out, read_model(out / "model.json"), jobs, quick)
        print(gap_lines(report))

        print("\n4. The policies with these effects compensated, on the robot again.")
        names = (NOMINAL,) if quick else (NOMINAL, ROBUST)
        after = {}
        for name in (f"{one}+compensated" for one in names):
            folder = out / f"after_{name.removesuffix('+compensated')}"
            after[name] = fought(name, robot, out / "gap" / "model.json", folder, fights)

    print("\n5. Better?")
    first = share_of(before)
    print(f"   before: {NOMINAL:<20} {share_text(first)}")
    for name, result in after.items():
        won = share_of(result)
        print(f"   after:  {name:<20} {share_text(won)}, gained {difference_text(first, won)}")
    truth = hidden_robot.reveal()
    print(f"\nWhat had been hidden: {truth_text(truth)}; and a bad link.")
    results = {NOMINAL: before, **after}
    story = summary(report, results, truth)
    write_json(out / "story.json", story)
    written = write_story_page(out / "story.html", story, gap_lines(report))
    print(f"All results: {out / 'story.json'}, {written}. ", end="")
    print(f"It took {(time.perf_counter() - began) / 60.0:.1f} min.")


def fought(controller: str, robot: str, model: Path, out: Path, fights: int) -> dict[str, Any]:
    """Let a controller, which knows a model, fight on a robot in a process of its own; return fights.json."""
    command = [sys.executable, "-m", "training.run", controller, "--robot", robot, "--model", str(model)]
    command += ["--fights", str(fights), "--out", str(out), "--silence", "60"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr.strip() or done.returncode)
    print("\n".join(f"   {line}" for line in done.stdout.splitlines() if not line.startswith("fight ")))
    found: dict[str, Any] = json.loads((out / "fights.json").read_text(encoding="utf-8"))
    return found


def study(out: Path, model: Model, jobs: int, quick: bool) -> GapReport:
    """Study the gap between the logs in the folder `out` and a model; write the improved model."""
    from sysid.gap import analyse
    from sysid.gap.report.output import write_study
    from sysid.gap.result import GapOptions
    from sysid.logs import read_dataset
    from sysid.progress import stage_bar

    options = GapOptions(
        only=QUICK_ONLY if quick else (),
        exclude=() if quick else EXCLUDED,
        max_effects=2 if quick else 3,
        jobs=jobs,
        plant="planar",
        next_experiment=False,
    )
    with stage_bar(8) as progress:
        report = analyse(read_dataset(out / "before" / "logs"), model, options, progress)
    write_study(report, out / "gap")
    return report


def share_of(result: Mapping[str, Any]) -> Share:
    """Return the success in a fights.json."""
    from training.evaluate import share

    outcomes = [fight["outcome"] for fight in result["fights"]]
    return share(outcomes.count("won"), len(outcomes))


def summary(
    report: GapReport, results: Mapping[str, Mapping[str, Any]], truth: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Return all results of the story as a JSON object.

    Args:
        report: the study of the gap.
        results: fights.json by controller, that of the policy before first.
        truth: the hidden effects.
    """
    import mecanum_env

    shares = {name: share_of(result) for name, result in results.items()}
    before = next(iter(shares.values()))
    return {
        "version": mecanum_env.__version__,
        "gap": {
            "verdict": report.verdict,
            "effects": [asdict(found) for found in report.effects],
            "before": report.gap.before,
            "after": report.gap.after,
            "unit": report.gap.unit,
        },
        "hidden": truth,
        "fights": {
            name: {
                "success": {"value": won.value, "low": won.low, "high": won.high},
                "gained": list(difference(before, won)),
                "timing": results[name]["timing"],
                "count": len(results[name]["fights"]),
            }
            for name, won in shares.items()
        },
    }


def write_story_page(path: Path, story: Mapping[str, Any], said: str) -> Path:
    """Write the page of a story, with what the study `said`, and return its path."""
    from mecanum_env.report import figure, write_page

    fights = story["fights"]
    names, shares = list(fights), [one["success"] for one in fights.values()]
    ends = {
        "array": [one["high"] - one["value"] for one in shares],
        "arrayminus": [one["value"] - one["low"] for one in shares],
    }
    colours = [RED, *[GREEN] * (len(names) - 1)]
    bars = {
        "type": "bar",
        "x": names,
        "y": [one["value"] for one in shares],
        "error_y": {"type": "data", "symmetric": False, **ends},
        "marker": {"color": colours},
    }
    rows = [
        (
            name,
            one["count"],
            "{value:.2f} ({low:.2f} .. {high:.2f})".format(**one["success"]),
            "{:+.2f} ({:+.2f} .. {:+.2f})".format(*one["gained"]) if number else "",
            "{period_ms:.1f} ms, {jitter_ms:.1f} ms, {late_ms:.1f} ms".format(**one["timing"]),
            "{late:.0f} of {commands:.0f}".format(**one["timing"]),
        )
        for number, (name, one) in enumerate(fights.items())
    ]
    success = figure([bars], y="share of fights won, 95 % interval", layout={"yaxis": {"range": [0.0, 1.0]}})
    hidden = truth_text(story["hidden"])
    write_page(path, PAGE, {"success": success}, rows=rows, said=said, hidden=hidden)
    return path


if __name__ == "__main__":
    sys.exit(run(onto_a_robot, prog="python examples/onto_a_robot.py"))
