"""Playing several controllers on the same seeds, and the results as text and Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import mujoco

import mecanum_env
from mecanum_env.errors import InputError, require_at_least
from mecanum_env.markdown import markdown_table
from mecanum_env.model import Model
from mecanum_env.parallel import Workers
from mecanum_env.tankendo import DIFFICULTIES, Opponent, opponent_for
from mecanum_env.tankendo.opponents import opponent_to_dict
from training.certify.adversary import Search, worst_opponent
from training.certify.checks import mean_text, milliseconds, share_text, warning_text
from training.certify.plants import ADVERSARY, robot_variants
from training.certify.report import columns
from training.certify.results import Timing, TrackingResult
from training.certify.run import (
    TRACK_SHARE,
    WARNING_FACTOR,
    timing_of,
    tracking_result,
    warning_curve_of,
)
from training.certify.warning import RANGE_S, WarningCurve
from training.evaluate import Job, Setup, Share, controller_factory, evaluate_controller, play_jobs
from training.evaluate.play import Progress

_ROLLERS: Final = "rollers"
"""Name of the setting with every roller on the floor, level normal."""
GROUPS: Final = ("robot-level", "latency")
"""Groups of a certificate's plants that are compared, beside the model itself."""
_WARNING, _TRACK = "warning", "track"


@dataclass(frozen=True)
class Row:
    """The results of one controller."""

    controller: str
    success: Mapping[str, Share]
    """Setting -> success: three levels on the planar plant; level normal on rollers and changed robots, and
    against the adversary."""
    warning: WarningCurve
    track: TrackingResult
    timing: Timing = field(compare=False)
    """Depends on the machine and is ignored by `==`."""
    adversary: Mapping[str, Any] | None = None
    """The opponent that was searched against this controller, as in a JSON file; None: none was."""


@dataclass(frozen=True)
class Comparison:
    """The results of several controllers on the same seeds."""

    rows: tuple[Row, ...]
    settings: Mapping[str, str]
    """Name of each setting -> description in one line."""
    provenance: Mapping[str, str | int]


def compare_controllers(
    controllers: Sequence[str],
    model: Model,
    *,
    episodes: int = 200,
    rollers: bool = True,
    search: Search | None = None,
    workers: Workers = Workers(),
    progress: Progress | None = None,
) -> Comparison:
    """Play every controller in every setting, with the seeds 0, 1, ...

    Args:
        controllers: names or paths; see `training.controllers.named.make_controller`.
        model: the robot, which all controllers know.
        episodes: number of episodes per controller and setting.
        rollers: whether to play on rollers too, which takes most of the time.
        search: how long an adversary is searched against each controller; None: none is.
        workers: where the episodes are played; by default on all processors of this machine.
        progress: called after each job with its name and number of episodes.

    Raises:
        InputError: there is no such controller, none at all or one twice, or no episode.
    """
    if not controllers or len(set(controllers)) != len(controllers):
        raise InputError(
            f"controllers = {', '.join(controllers) or 'none'}: must be at least one, each named once"
        )
    require_at_least(1, episodes=episodes)
    workers.require_usable()
    for name in controllers:
        # Otherwise a misspelt last name would be found out after an hour.
        evaluate_controller(controller_factory(name, model), Setup(model), [0])
    setups, settings = _settings(model, rollers)
    counts = {_WARNING: WARNING_FACTOR * episodes, _TRACK: max(1, episodes // TRACK_SHARE)}
    planned = {
        f"{name}|{setting}": Job(f"{name}, {setting}", name, setup, counts.get(setting, episodes))
        for name in controllers
        for setting, setup in setups.items()
    }
    adversaries: dict[str, Opponent] = {}
    if search is not None:
        base, normal = opponent_for("normal"), Setup(model)
        settings[ADVERSARY] = "planar plant, an opponent that is searched against each controller"
        for name in controllers:
            found = adversaries[name] = worst_opponent(name, normal, base, search, workers, progress)
            setup = replace(normal, opponent=found)
            planned[f"{name}|{ADVERSARY}"] = Job(f"{name}, {ADVERSARY}", name, setup, episodes)
    played = play_jobs(planned, workers, progress)
    rows = tuple(
        Row(
            controller=name,
            success={setting: played[f"{name}|{setting}"].success for setting in settings},
            warning=warning_curve_of(played[f"{name}|{_WARNING}"].episodes),
            track=tracking_result(played[f"{name}|{_TRACK}"].episodes),
            timing=timing_of(played[f"{name}|normal"]),
            adversary=opponent_to_dict(adversaries[name]) if name in adversaries else None,
        )
        for name in controllers
    )
    versions = {"version": mecanum_env.__version__, "mujoco": mujoco.__version__}
    return Comparison(rows, settings, {**versions, "episodes": episodes, "first_seed": 0})


def _settings(model: Model, rollers: bool) -> tuple[dict[str, Setup], dict[str, str]]:
    """Return all setups by name, and the descriptions of those in which success is reported."""
    setups: dict[str, Setup] = {level: Setup(model, difficulty=level) for level in DIFFICULTIES}
    about: dict[str, str] = {level: f"planar plant, level {level}" for level in DIFFICULTIES}
    normal = setups["normal"]
    if rollers:
        setups[_ROLLERS] = replace(normal, physics="rollers")
        about[_ROLLERS] = "every roller on the floor, level normal"
    for variant in robot_variants(model):
        if variant.group in GROUPS:
            setups[variant.name] = replace(normal, model=variant.model, physics=variant.physics, known=model)
            about[variant.name] = f"planar plant, level normal; {variant.summary}"
    setups[_WARNING] = replace(normal, opponent=replace(opponent_for("normal"), warning_s=RANGE_S))
    setups[_TRACK] = replace(normal, task="track")
    return setups, about


def comparison_table(found: Comparison) -> str:
    """Return a comparison as text, one row per controller."""
    return "\n".join(columns(cells(found)))


def comparison_markdown(found: Comparison, command: str) -> str:
    """Return a comparison as a Markdown page that names the command it is written by."""
    head, *rows = cells(found)
    made, split = found.provenance, 1 + len(found.settings)
    settings = "\n".join(f"- {name}: {text}." for name, text in found.settings.items())
    others = markdown_table((head[0], *head[split:]), [(row[0], *row[split:]) for row in rows])
    return f"""# Results of `python -m training.compare`

Written by `{command}`; do not edit. mecanum-tankendo {made["version"]}, MuJoCo {made["mujoco"]}, \
{made["episodes"]} episodes per number with seeds from {made["first_seed"]}.

## Success

With Wilson's 95 % interval. Every controller plays the same episodes and knows the model, not the robot \
that it is on or the opponent that it meets.

{settings}

{markdown_table(head[:split], [row[:split] for row in rows])}

## Warning, tracking, time

Warning: the shortest at which the success reaches 90 %, planar plant, level normal but for the warning; see \
[certificates](../certify.md). Tracking error: root mean square of distance - maai behind an opponent that \
walks about, mean over episodes. Time: processor time per command on the machine that wrote this; the robot \
takes a command every 100 ms.

{others}
"""


def cells(found: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of a comparison's table, the head first."""
    metrics = ("warning for 90 %", "tracking error, m", "tracking success", "time p50", "time p99")
    rows = [
        (
            label(row.controller),
            *(share_text(row.success[setting]) for setting in found.settings),
            warning_text(row.warning),
            mean_text(row.track.distance_error_m),
            share_text(row.track.success),
            milliseconds(row.timing.p50_s),
            milliseconds(row.timing.p99_s),
        )
        for row in found.rows
    ]
    return [("controller", *found.settings, *metrics), *rows]


def label(controller: str) -> str:
    """Return how tables show a controller: its name, or that of its policy's file or folder."""
    return Path(controller).stem if "/" in controller or controller.endswith(".npz") else controller
