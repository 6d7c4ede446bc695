"""Draw learning curves: `python -m training.train.curve FOLDER ... --out curve.png`."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import tyro
from matplotlib.figure import Figure

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import atomic_path
from mecanum_env.reading import read_json
from mecanum_env.statistics import wilson_interval
from training.evaluate import Setup, controller_factory, evaluate_controller
from training.train.checkpoint import Point, read_run
from training.train.environments import model_of
from training.train.run import DEVELOPMENT_SEEDS
from training.train.settings import TrainingSettings


def read_curve(folder: Path) -> list[Point]:
    """Return the learning curve in a training folder.

    Raises:
        InputError: the folder holds none.
    """
    path = folder / "curve.json"
    stored = read_json(path, "give folders of training runs")
    try:
        return [Point(**point) for point in stored]
    except TypeError as error:
        raise InputError(f"{path}: no learning curve; give folders of training runs") from error


def by_seed(runs: Mapping[str, TrainingSettings]) -> dict[str, list[str]]:
    """Return the names of runs that differ by their seed alone, under the name of the first of them."""
    groups: list[list[str]] = []
    for name, settings in runs.items():
        same = (group for group in groups if replace(runs[group[0]], seed=settings.seed) == settings)
        group = next(same, None)
        if group is None:
            groups.append([name])
        else:
            group.append(name)
    return {group[0]: group for group in groups}


def draw(
    curves: Mapping[str, list[Point]],
    groups: Mapping[str, Sequence[str]],
    retreat: float,
    on_several: Collection[str],
) -> Figure:
    """Return a figure of success against steps, of learning curves by the names of the runs.

    The `groups` are those of `by_seed`: of several seeds the mean is drawn, in a band from the lowest to the
    highest; of a single run its Wilson interval. `retreat` is the success of the scripted retreat on the
    model; for the runs named in `on_several` the success on the worst robot is drawn, too.
    """
    figure = Figure(figsize=(7.0, 5.2), layout="constrained")
    axes = figure.subplots()
    axes.axhline(retreat, color="0.5", linestyle="--", linewidth=1.0, label="scripted retreat, on the model")
    episodes = len(DEVELOPMENT_SEEDS)
    for name, group in groups.items():
        length = min(len(curves[one]) for one in group)
        millions = [point.steps / 1e6 for point in curves[name][:length]]
        found = np.array([[point.success for point in curves[one][:length]] for one in group])
        label = name if len(group) == 1 else f"{name}, {len(group)} seeds"
        (line,) = axes.plot(millions, found.mean(axis=0), marker=".", label=label)
        low, high = found.min(axis=0), found.max(axis=0)
        if len(group) == 1:
            ends = [wilson_interval(round(episodes * share), episodes) for share in found[0]]
            low, high = np.array(ends).T
        axes.fill_between(millions, low, high, color=line.get_color(), alpha=0.2, linewidth=0.0)
        if name in on_several:
            worst = np.mean([[point.worst for point in curves[one][:length]] for one in group], axis=0)
            axes.plot(millions, worst, color=line.get_color(), linestyle=":", label=f"{name}, worst robot")
    axes.set(xlabel="steps, millions", ylabel="success, deterministic policy", ylim=(0.0, 1.0))
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.3)
    # Beneath the axes, where it hides no curve.
    figure.legend(loc="outside lower center", ncols=2, fontsize="small")
    return figure


def _retreat_success(settings: TrainingSettings) -> float:
    """Return the success of the scripted retreat on the development seeds, with the settings of a run."""
    model = model_of(settings)
    setup = Setup(model, settings.plant, settings.task, settings.difficulty)
    return evaluate_controller(controller_factory("retreat", model), setup, DEVELOPMENT_SEEDS).success.value


def main(folders: tyro.conf.Positional[tuple[Path, ...]], /, out: Path = Path("curve.png")) -> None:
    """Draw the learning curves of training runs, with the scripted retreat on the same episodes.

    Example: python -m training.train.curve out/ppo out/ppo-1 --out out/curve.png

    Args:
        folders: Folders of training runs.
        out: Picture to write; its suffix selects the format.
    """
    if not folders:
        raise InputError("no folder given; name at least one training run")
    matplotlib.use("Agg")
    runs = {folder.name: read_run(folder)[0] for folder in folders}
    curves = {folder.name: read_curve(folder) for folder in folders}
    on_several = [name for name, settings in runs.items() if settings.randomize in ("levels", "varied")]
    figure = draw(curves, by_seed(runs), _retreat_success(next(iter(runs.values()))), on_several)
    with atomic_path(out) as path:
        figure.savefig(path, dpi=120)
    print(f"wrote {out}")


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.curve"))
