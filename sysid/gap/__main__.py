"""Find what a model, or a linear law, lacks: `python -m sysid.gap LOGS --model MODEL`, or without it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.programs import Done


def gap(
    logs: tyro.conf.Positional[Path],
    /,
    model: Path | None = None,
    out: Path = Path("gap"),
    fitted_on: Path | None = None,
    seed: int = 0,
    level: Literal["auto", "bench", "robot"] = "auto",
    only: tuple[str, ...] = (),
    exclude: tuple[str, ...] = (),
    max_effects: int = 3,
    jobs: int = 1,
    plant: Literal["rollers", "planar"] = "rollers",
    seconds: float | None = None,
    adopt: bool = False,
) -> Done:
    """Compare a model with logs, name the effects that it lacks, add them, and show the gap before and after.

    Writes gap.json, model.json with the effects added, report.html and, where it helps, next_experiment.csv.

    Example: python -m sysid.gap logs --model fit/model.json --out gap

    Args:
        logs: Folder of bench or robot logs, or one file.
        model: Model to compare with them, from python -m sysid.fit; without one, a law and effects are fitted
            to these logs (of a wheel on the bench), and what is beyond the law is reported.
        out: Folder to write.
        fitted_on: The logs that the model was fitted to; default: where model.json says.
        seed: Seed of the simulated thresholds, the bootstrap and the design of experiments.
        level: Level that the logs must have; auto accepts both.
        only: Effects to look for; default: all that act on such logs (python -m mecanum_env.effects).
        exclude: Effects not to look for.
        max_effects: Size of the largest set of effects that is tried.
        jobs: Simulations at a time; results do not depend on it.
        plant: How a robot is simulated; planar does not slip and is much faster.
        seconds: Duration of the runs that decide, repeats not counted [s]; default 240 (bench), 60 (robot).
        adopt: If no named effect explains the gap, add the proposed custom effect to the model.
    """
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.model import read_model
    from mecanum_env.outputs import output_folder
    from sysid.gap.alone import law_of, require_fittable
    from sysid.gap.report.output import FILES, gap_table, write_study
    from sysid.gap.result import GapOptions
    from sysid.gap.search.checks import require_valid
    from sysid.gap.spending import studies_near
    from sysid.gap.workflow import analyse
    from sysid.logs import read_dataset
    from sysid.logs.of_fit import logs_of_fit, seen_from
    from sysid.logs.quantities import require_our_units
    from sysid.progress import stage_bar

    options = GapOptions(
        seed=seed,
        level=level,
        only=only,
        exclude=exclude,
        max_effects=max_effects,
        jobs=jobs,
        plant=plant,
        seconds=seconds,
        adopt=adopt,
        earlier=studies_near(out),
    )
    if model is not None and (out / "model.json").resolve() == model.resolve():
        raise InputError(
            f"--out {out}: the study would replace {model}, its own input; choose another folder"
        )
    dataset = read_dataset(logs)
    require_our_units(dataset)
    require_valid(options, dataset.level)
    base = None
    if model is None:
        require_fittable(dataset, logs, fitted_on)
    else:
        base = read_model(model)
        if fitted_on is None:
            known, why = logs_of_fit(base, model.parent, dataset.level)
        else:
            known, why = read_dataset(fitted_on), ""
        options = replace(options, fitted_on=known, notes=(why,) if why else ())
    files = output_folder(out, "sysid.gap", FILES, seed=seed)
    with files as staged, stage_bar(7 if base else 14) as progress:
        if base is None:
            base, options = law_of(dataset, options, progress)
        report = analyse(dataset, base, options, progress)
        if model is not None:
            report = replace(report, model=seen_from(report.model, model.parent, out))
        progress("report")
        written = [out / path.name for path in write_study(report, staged)]
    print(gap_table(report))
    print(f"\nwrote {', '.join(map(str, written))}")
    return Done(wrote=written)


if __name__ == "__main__":
    sys.exit(run(gap, prog="python -m sysid.gap"))
