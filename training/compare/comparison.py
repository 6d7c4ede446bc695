"""Playing several controllers on the same seeds.

A comparison as text and as Markdown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import mujoco

import mecanum_env
from mecanum_env.errors import InputError, require_at_least
from mecanum_env.model import Model
from mecanum_env.tankendo import DIFFICULTIES, opponent_for
from training.certify.certificate import Timing, TrackFigures
from training.certify.judge import milliseconds, share_text
from training.certify.plants import plants
from training.certify.report import columns
from training.certify.run import TRACK_SHARE, WARNING_FACTOR, success_of, timing_of, track_figures
from training.certify.warning import RANGE_S, WarningCurve, warning_curve
from training.evaluate import Evaluation, Job, Mean, Setup, Share, evaluate, named_maker, play_jobs
from training.evaluate.jobs import Progress, require_jobs

ROLLERS: Final = "rollers"
"""Name of the setting in which every roller is on the floor, level normal."""
GROUPS: Final = ("robot-level", "latency")
"""Plants of a certificate that are compared too, beside the model itself."""
_WARNING, _TRACK = "warning", "track"


@dataclass(frozen=True)
class Row:
    """The figures of one controller."""

    controller: str
    success: Mapping[str, Share]
    """Setting -> success: the three levels on the planar plant; normal on rollers and on changed plants."""
    warning: WarningCurve
    track: TrackFigures
    timing: Timing = field(compare=False)
    """Of the machine, so it does not count in `==`."""


@dataclass(frozen=True)
class Comparison:
    """Several controllers on the same seeds."""

    rows: tuple[Row, ...]
    settings: Mapping[str, str]
    """Name of each setting -> what it is, one line."""
    provenance: Mapping[str, str | int]


def compare(
    controllers: Sequence[str],
    model: Model,
    *,
    episodes: int = 200,
    rollers: bool = True,
    jobs: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Play every controller in every setting, seeds 0, 1, ...

    Args:
        controllers: names or paths, as for `training.controllers.named.make_controller`.
        model: the robot, which all of them know.
        episodes: of each controller in each setting.
        rollers: whether the rollers are played too; they take most of the time.
        jobs: at a time; 0: as many as there are processors. The result is the same with any number.
        progress: called after each job, with its name and number of episodes.

    Raises:
        InputError: no such controller, none at all, one twice, no episode, or a negative number of jobs.
    """
    if not controllers or len(set(controllers)) != len(controllers):
        raise InputError(f"controllers = {', '.join(controllers) or 'none'}: must be some, each once")
    require_at_least(1, episodes=episodes)
    require_jobs(jobs)
    for name in controllers:
        # A misspelt last name would else be found out after an hour.
        evaluate(named_maker(name, model), Setup(model), [0])
    setups, settings = _settings(model, rollers)
    counts = {_WARNING: WARNING_FACTOR * episodes, _TRACK: max(1, episodes // TRACK_SHARE)}
    planned = {
        f"{name}|{setting}": Job(f"{name}, {setting}", name, setup, counts.get(setting, episodes))
        for name in controllers
        for setting, setup in setups.items()
    }
    played = play_jobs(planned, jobs, progress)
    return Comparison(
        rows=tuple(
            _row(name, {setting: played[f"{name}|{setting}"] for setting in setups}, list(settings))
            for name in controllers
        ),
        settings=settings,
        provenance={
            "version": mecanum_env.__version__,
            "mujoco": mujoco.__version__,
            "episodes": episodes,
            "first_seed": 0,
        },
    )


def _settings(model: Model, rollers: bool) -> tuple[dict[str, Setup], dict[str, str]]:
    """Return what to play by name, and what of that the success counts in."""
    setups: dict[str, Setup] = {level: Setup(model, difficulty=level) for level in DIFFICULTIES}
    about: dict[str, str] = {level: f"planar plant, level {level}" for level in DIFFICULTIES}
    normal = setups["normal"]
    if rollers:
        setups[ROLLERS] = replace(normal, physics="rollers")
        about[ROLLERS] = "every roller on the floor, level normal"
    for plant in plants(model):
        if plant.group in GROUPS:
            setups[plant.name] = replace(normal, model=plant.model, physics=plant.physics, known=model)
            about[plant.name] = f"planar plant, level normal; {plant.summary}"
    opponent = opponent_for("normal")
    setups[_WARNING] = replace(normal, opponent=replace(opponent, warning_s=RANGE_S))
    setups[_TRACK] = replace(normal, task="track")
    return setups, about


def _row(name: str, played: Mapping[str, Evaluation], settings: Sequence[str]) -> Row:
    varied = played[_WARNING].episodes
    warnings = [one.warning_s for one in varied if one.warning_s is not None]
    return Row(
        controller=name,
        success={setting: success_of(played[setting].episodes) for setting in settings},
        warning=warning_curve(warnings, [one.success for one in varied]),
        track=track_figures(played[_TRACK].episodes),
        timing=timing_of(played["normal"]),
    )


def comparison_table(found: Comparison) -> str:
    """Return what was found as text: one row a controller."""
    return "\n".join(columns(cells(found)))


def comparison_markdown(found: Comparison, command: str) -> str:
    """Return what was found as a page in Markdown.

    Args:
        found: the comparison.
        command: that writes it.
    """
    head, *rows = cells(found)
    made = found.provenance
    lines = [
        "# Results of `python -m training.compare`",
        "",
        f"Written by `{command}`; do not edit. mecanum-tankendo {made['version']}, MuJoCo {made['mujoco']}, "
        f"{made['episodes']} episodes a figure with seeds from {made['first_seed']}.",
        "",
        "## Success",
        "",
        "With Wilson's 95 % interval. Every controller plays the same episodes and knows the model, not the "
        "plant that it is on.",
        "",
        *(f"- {name}: {text}." for name, text in found.settings.items()),
        "",
        *_markdown([head[: 1 + len(found.settings)], *(row[: 1 + len(found.settings)] for row in rows)]),
        "",
        "## Warning, tracking, time",
        "",
        "Warning: the shortest at which the success reaches 90 %, planar plant, level normal but for the "
        "warning; see [certificates](../certify.md). Tracking error: root mean square of distance - maai "
        "behind an opponent that walks about, mean over episodes. Time: of the processor, for one command, "
        "on the machine that wrote this; the robot takes one every 100 ms.",
        "",
        *_markdown([(head[0], *head[1 + len(found.settings) :])]
                   + [(row[0], *row[1 + len(found.settings) :]) for row in rows]),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def cells(found: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of what was found, the head first."""
    head = (
        *("controller", *found.settings),
        *("warning for 90 %", "tracking error, m", "tracking success", "time p50", "time p99"),
    )
    return [head, *(_text_row(row, list(found.settings)) for row in found.rows)]


def label(controller: str) -> str:
    """Return the name of a controller, or of the file or folder of a policy, as tables show it."""
    return Path(controller).stem if "/" in controller or controller.endswith(".npz") else controller


def _text_row(row: Row, settings: list[str]) -> tuple[str, ...]:
    return (
        label(row.controller),
        *(share_text(row.success[setting]) for setting in settings),
        _warning(row),
        _mean(row.track.distance_error_m),
        share_text(row.track.success),
        milliseconds(row.timing.p50_s),
        milliseconds(row.timing.p99_s),
    )


def _warning(row: Row) -> str:
    curve = row.warning
    if curve.needed_s is None:
        return f"not reached, at best {max(curve.success):.2f}"
    high = f"more than {curve.range_s[1]:g}" if curve.high_s is None else f"{curve.high_s:.2f}"
    text = f"{curve.needed_s:.2f} s ({curve.low_s:.2f} .. {high})"
    return text if curve.holds_to_s is None else f"{text}, up to {curve.holds_to_s:.2f}"


def _mean(found: Mean | None) -> str:
    return "-" if found is None else f"{found.value:.2f} ({found.low:.2f} .. {found.high:.2f})"


def _markdown(rows: list[tuple[str, ...]]) -> list[str]:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return [lines[0], f"|{'---|' * len(rows[0])}", *lines[1:]]
