"""Draw learning curves: `python -m training.train.curve FOLDER ... --out curve.png`."""

from __future__ import annotations

import sys
from collections.abc import Collection
from pathlib import Path

import matplotlib
import tyro
from matplotlib.figure import Figure

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import atomic_path
from mecanum_env.reading import read_json
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


def draw(curves: dict[str, list[Point]], retreat: float, on_levels: Collection[str]) -> Figure:
    """Return a figure of success against steps, of learning curves by the names of the runs.

    `retreat` is the success of the scripted retreat on the same episodes; for the runs named in `on_levels`
    the success on the worst robot is drawn, too.
    """
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.axhline(retreat, color="0.5", linestyle="--", linewidth=1.0, label="scripted retreat")
    for name, points in curves.items():
        millions = [point.steps / 1e6 for point in points]
        (line,) = axes.plot(millions, [point.success for point in points], marker=".", label=name)
        if name in on_levels:
            worst = [point.worst for point in points]
            axes.plot(millions, worst, color=line.get_color(), linestyle=":", label=f"{name}, worst robot")
    axes.set(xlabel="steps, millions", ylabel="success, deterministic policy", ylim=(0.0, 1.0))
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
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
    on_levels = [name for name, settings in runs.items() if settings.randomize == "levels"]
    figure = draw(curves, _retreat_success(next(iter(runs.values()))), on_levels)
    with atomic_path(out) as path:
        figure.savefig(path, dpi=120)
    print(f"wrote {out}")


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m training.train.curve"))
