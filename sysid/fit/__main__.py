"""Fit the wheel law to logs: `python -m sysid.fit LOGS`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final, Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.programs import Done

_STAGES: Final = 7
_FILES: Final = ("model.json", "fit.json", "fit.png", "report.html")


def fit(
    logs: tyro.conf.Positional[Path],
    /,
    robot: Path | None = None,
    out: Path = Path("fit"),
    method: tuple[str, ...] = ("output-error",),
    starts: int = 10,
    seed: int = 0,
    free_gain: bool = False,
    per_wheel: bool = False,
    delay: Literal["auto", "none"] | float = "auto",
    sample_period: float | None = None,
    command_period: float | None = None,
    quantum: float | None = None,
    saturation: float | None = None,
    effects: Literal["auto", "off"] = "auto",
) -> Done:
    """Fit the wheel law A-F to a folder of logs and write model.json, fit.json, report.html and plots.

    Example: python -m sysid.fit @examples/logs --out fit

    Args:
        logs: Folder of bench or robot logs, or one file; @examples/logs is in the package.
        robot: JSON file of measured robot parameters (wheel_radius_m, mass_kg ...), which are not fitted.
        out: Folder to write.
        method: Methods to run, or "all"; the model is from the first.
        starts: Number of starting points of each method.
        seed: Seed of the random starting points.
        free_gain: Estimate the DC gain instead of holding it at exactly 1.
        per_wheel: On robot logs, fit each wheel, too.
        delay: Transport delay of the command [s]; auto: estimated, and adopted on evidence.
        sample_period: Period of the law [s]; default near 1/120 s.
        command_period: Shortest time between commands [s]; default 0.1.
        quantum: Rounding of commands [rpm]; default 1.
        saturation: Ceiling of the wheel speed [rpm]; default 135, or estimated if commands exceed it.
        effects: Whether bench logs may show friction or limits beside the law; off: the law alone.
    """
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.files import write_json
    from mecanum_env.model import Robot, read_robot, write_model
    from mecanum_env.outputs import output_folder
    from mecanum_env.reading import read_json
    from sysid.fit.estimators import METHODS
    from sysid.fit.options import FitOptions
    from sysid.fit.pipeline import fit_dataset
    from sysid.fit.report import fit_json, fit_table, fitted_model, write_fit_plots, write_fit_report
    from sysid.logs import read_dataset
    from sysid.logs.of_fit import with_logs
    from sysid.logs.quantities import require_our_units
    from sysid.progress import stage_bar

    options = FitOptions(
        methods=tuple(METHODS) if method == ("all",) else method,
        starts=starts,
        seed=seed,
        unit_gain=not free_gain,
        delay_s={"auto": None, "none": 0.0}[delay] if isinstance(delay, str) else delay,
        per_wheel=per_wheel,
        sample_period_s=sample_period,
        command_period_s=command_period,
        quantum_rpm=quantum,
        saturation_rpm=saturation,
        effects=effects,
        robot=read_robot(robot) if robot else Robot(),
        robot_given=tuple(read_json(robot)) if robot else (),
    )
    dataset = read_dataset(logs)
    require_our_units(dataset)
    stages = _STAGES + len(options.methods) - 1 + 4 * per_wheel
    with output_folder(out, "sysid.fit", _FILES, seed=seed) as staged, stage_bar(stages) as progress:
        found = fit_dataset(dataset, options, progress)
        progress("report")
        model = with_logs(fitted_model(found), logs, out)
        write_model(model, staged / "model.json")
        write_json(staged / "fit.json", fit_json(found, model))
        write_fit_plots(found, staged, model)
        write_fit_report(found, model, staged / "report.html")
    print(fit_table(found, model))
    print(f"\nwrote {out / 'model.json'}, {out / 'fit.json'}, {out / 'fit.png'}", end="")
    print(f" and {out / 'report.html'}")
    return Done(wrote=[out / name for name in _FILES])


if __name__ == "__main__":
    sys.exit(run(fit, prog="python -m sysid.fit"))
