"""From gap to controller: a policy fails on the real robot, logs show why, and compensation repairs it.

Logs of a hidden robot -> fit -> certificate of a policy on the fit -> the same policy on the robot -> the gap
and its effects -> the predicted drop in success -> the policy with the effects compensated -> the robot
again.

Example: python examples/close_the_loop.py --out out/loop
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from loop_report import (
    FIT,
    IMPROVED,
    ITSELF,
    Row,
    difference_text,
    draw,
    fit_text,
    gap_lines,
    holds_text,
    label,
    summary,
    truth_text,
    warning_line,
    write_loop_page,
)

from mecanum_env.cli import run
from mecanum_env.rendering.backend import use_backend

if TYPE_CHECKING:
    from mecanum_env.model import Model
    from mecanum_env.simulator import RobotPlant
    from sysid.fit import Fit
    from sysid.gap.result import GapReport
    from training.certify.certificate import Certificate
    from training.evaluate import Share

EXCLUDED: Final = ("sensor_latency",)
"""Late sensors and late commands look the same in a log. Here the sensors' stamps are known to be right."""
QUICK_ONLY: Final = ("command_latency", "direction_asymmetry", "speed_gain")
"""Effects that a quick run considers; a full run considers all others than `EXCLUDED`."""
NOMINAL, ROBUST = "nominal", "robust"
"""Bundled policies: trained on the robot as it was meant to be, and on robots that differ from it."""
PLANNER: Final = "mpc"
"""Another controller that uses an improved model without training: it plans on it."""


@dataclass(frozen=True)
class Scale:
    """How much is played, and on which simulated systems."""

    episodes: int
    fights: RobotPlant
    """Simulated system of all fights, in certificates and of the robot itself."""
    logs: RobotPlant
    """Simulated system of the robot while it is logged, and of the model in the study of the logs."""
    jobs: int
    quick: bool


def close_the_loop(
    out: Path = Path("out/loop"),
    controller: str = NOMINAL,
    episodes: int = 200,
    fights: Literal["planar", "rollers"] = "planar",
    jobs: int = 2,
    quick: bool = False,
) -> None:
    """Run all steps from the logs to the repaired controller; write models, pages, pictures and loop.json.

    Args:
        out: folder to write.
        controller: as for python -m training.certify.
        episodes: number of fights of each controller on each robot.
        fights: simulated system of the fights: planar, without slip, or rollers, ten times as slow.
        jobs: number of parallel processes, which does not change the result.
        quick: record the logs without slip, too, and consider few effects, to see that everything runs.
    """
    use_backend()  # before anything imports mujoco
    import hidden_robot

    from mecanum_env.files import write_json
    from mecanum_env.model import read_model
    from training.certify.checks import share_text

    began = time.perf_counter()
    scale = Scale(episodes, fights, "planar" if quick else "rollers", jobs, quick)

    print("1. Logs. One wheel on the bench, then the robot built with it, driven by hand.")
    hidden_robot.write_bench_logs(out / "bench")
    hidden_robot.write_robot_logs(out / "robot", scale.logs)

    print(f"\n2. Fit to the bench logs -> {out / 'fit' / 'model.json'}")
    fitted = fit_bench(out)
    model = read_model(out / "fit" / "model.json")
    print(f"   {fit_text(fitted)}")

    print(f"\n3. {label(controller)}, certified on the fit -> {out / 'certificate' / 'certificate.html'}")
    first = certified(controller, model, scale, out / "certificate")
    promised = first.nominal.success
    print(f"   success {share_text(promised)}; {warning_line(first)}")

    print("\n4. The same on the robot itself, in fights that no certificate has.")
    (before,) = on_the_robot({controller: model}, scale)
    print(f"   success {share_text(before)}, changed by {difference_text(promised, before)}")

    print(f"\n5. What is different? sysid.gap on the robot's logs -> {out / 'gap' / 'model.json'}")
    report = study(out, model, scale)
    improved = read_model(out / "gap" / "model.json")
    print(gap_lines(report))

    print("\n6. Does the improved model predict the drop? The same policy, which still knows the fit only.")
    predicted = on_models(controller, improved, model, scale)
    for name, success in predicted.items():
        print(f"   {name:<28} {share_text(success)}")
    print(f"   {ITSELF:<28} {share_text(before)}")
    print(f"   by the improved model: {holds_text(predicted[IMPROVED], before)}")
    print(f"   by the fit:            {holds_text(promised, before)}")

    better = f"{controller}+compensated"
    print(f"\n7. {label(better)}: the effects compensated. Its certificate on the improved model.")
    second = certified(better, improved, scale, out / "certificate_improved")
    hoped = second.nominal.success
    print(f"   success {share_text(hoped)}; {warning_line(second)}")

    print("\n8. The robot itself again.")
    again = tuple(dict.fromkeys((better, f"{PLANNER}+compensated", ROBUST, f"{ROBUST}+compensated")))
    after = dict(zip(again, on_the_robot(dict.fromkeys(again, improved), scale), strict=True))
    print(f"   before: {label(controller):<20} {share_text(before)}")
    for name, success in after.items():
        print(
            f"   after:  {label(name):<20} {share_text(success)}, gained {difference_text(before, success)}"
        )
    print(f"   by the certificate: {holds_text(hoped, after[better])}")

    truth = hidden_robot.reveal()
    print(f"\nWhat had been hidden: {truth_text(truth)}.")
    rows = (
        Row(controller, FIT, FIT, promised),
        Row(controller, FIT, ITSELF, before),
        *(Row(controller, FIT, name, success) for name, success in predicted.items()),
        Row(better, IMPROVED, IMPROVED, hoped),
        *(Row(name, IMPROVED, ITSELF, success) for name, success in after.items()),
    )
    print(
        f"In short: {promised.value:.2f} by the first certificate, {before.value:.2f} on the robot itself, "
        f"{after[better].value:.2f} with what its logs say compensated."
    )
    draw(out, report, rows, (first, second))
    story = summary(asdict(scale), fitted, report, rows, truth)
    write_json(out / "loop.json", story)
    page = write_loop_page(out / "loop.html", story, fit_text(fitted), gap_lines(report))
    print(f"\nThe story: {page}, with pictures and the pages named above; all figures: {out / 'loop.json'}.")
    print(f"It took {(time.perf_counter() - began) / 60.0:.1f} min.")


def fit_bench(out: Path) -> Fit:
    """Fit the bench logs in the folder `out`; write the model and the page of the fit."""
    from mecanum_env.files import write_json
    from mecanum_env.model import write_model
    from sysid.fit import fit_dataset, fit_json, fitted_model
    from sysid.fit.report import write_fit_report
    from sysid.logs import read_dataset
    from sysid.progress import stage_bar

    with stage_bar(6) as progress:
        fitted = fit_dataset(read_dataset(out / "bench"), progress=progress)
    model = fitted_model(fitted)
    write_model(model, out / "fit" / "model.json")
    write_json(out / "fit" / "fit.json", fit_json(fitted, model))
    write_fit_report(fitted, model, out / "fit" / "report.html")
    return fitted


def study(out: Path, model: Model, scale: Scale) -> GapReport:
    """Study the gap between the robot's logs in the folder `out` and a model; write the improved model."""
    from sysid.gap import analyse
    from sysid.gap.report.output import write_study
    from sysid.gap.result import GapOptions
    from sysid.logs import read_dataset
    from sysid.progress import stage_bar

    options = GapOptions(
        only=QUICK_ONLY if scale.quick else (),
        exclude=() if scale.quick else EXCLUDED,
        max_effects=2 if scale.quick else 3,
        jobs=scale.jobs,
        plant=scale.logs,
        seconds=9.0 if scale.quick else None,
        next_experiment=False,
    )
    with stage_bar(8) as progress:
        report = analyse(read_dataset(out / "robot"), model, options, progress)
    write_study(report, out / "gap")
    return report


def certified(controller: str, model: Model, scale: Scale, folder: Path) -> Certificate:
    """Certify a controller on the model that it knows; write the certificate and its page to a folder."""
    from mecanum_env.parallel import Workers
    from training.certify.certificate import write_certificate
    from training.certify.report import write_certificate_page
    from training.certify.run import CertifyOptions, certify_controller, episodes_of

    options = CertifyOptions(
        episodes=scale.episodes,
        plants=("nominal",),
        physics=scale.fights,
        workers=Workers(jobs=scale.jobs),
        bound=False,
    )
    with bar(episodes_of(options, model)) as progress:
        certificate = certify_controller(controller, model, options, progress)
    write_certificate(certificate, folder / "certificate.json")
    write_certificate_page(certificate, folder / "certificate.html")
    return certificate


def on_models(controller: str, improved: Model, known: Model, scale: Scale) -> dict[str, Share]:
    """Return a controller's success on the improved model, and on the fit with each of its effects alone.

    The controller was made for the `known` model; the fights are those of the certificate.
    """
    from training.certify.plants import robot_variants, select_variants
    from training.evaluate import Job, Setup

    jobs = {}
    for plant in select_variants(robot_variants(improved, scale.fights), ("nominal", "effects")):
        name = IMPROVED if plant.name == "nominal" else plant.name
        if name != "bare":  # That is the fit, on which it has been certified.
            jobs[name] = Job(name, controller, Setup(plant.model, plant.physics, known=known), scale.episodes)
    return played(jobs, scale)


def on_the_robot(controllers: Mapping[str, Model], scale: Scale) -> tuple[Share, ...]:
    """Return the success of controllers, each with the model that it was made for, on the hidden robot."""
    from hidden_robot import fights

    jobs = {n: fights(n, known, scale.episodes, scale.fights) for n, known in controllers.items()}
    return tuple(played(jobs, scale).values())


def played(jobs: Mapping[str, Any], scale: Scale) -> dict[str, Share]:
    """Return the success in each of the jobs, which are `training.evaluate.Job`, under its name."""
    from mecanum_env.parallel import Workers
    from training.evaluate import play_jobs

    with bar(sum(job.episodes for job in jobs.values())) as progress:
        found = play_jobs(jobs, Workers(jobs=scale.jobs), progress)
    return {name: found[name].success for name in jobs}


@contextmanager
def bar(episodes: int) -> Iterator[Callable[[str, int], None]]:
    """Show a progress bar over a number of episodes; yield the function that advances it."""
    from tqdm import tqdm

    with tqdm(total=episodes, unit="episode", disable=None, leave=False) as shown:

        def advance(name: str, count: int) -> None:
            shown.set_description(name)
            shown.update(count)

        yield advance


if __name__ == "__main__":
    sys.exit(run(close_the_loop, prog="python examples/close_the_loop.py"))
