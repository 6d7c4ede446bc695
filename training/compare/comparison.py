"""Playing several controllers on the same seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import mujoco

import mecanum_env
from mecanum_env.errors import InputError, require_at_least
from mecanum_env.model import Model
from mecanum_env.parallel import Workers
from mecanum_env.tankendo import DIFFICULTIES, Opponent, opponent_for
from mecanum_env.tankendo.opponents import opponent_to_dict
from training.certify.adversary import Search, worst_opponent
from training.certify.plants import ADVERSARY, HELD_OUT, RobotVariant
from training.certify.results import Timing, TrackingResult
from training.certify.run import (
    TRACK_SHARE,
    WARNING_FACTOR,
    bound_job,
    setup_on,
    timing_of,
    tracking_result,
    warning_curve_of,
)
from training.certify.variations import certificate_variants
from training.certify.warning import RANGE_S, WarningCurve
from training.evaluate import Job, Setup, Share, controller_factory, evaluate_controller, play_jobs
from training.evaluate.play import Progress

_ROLLERS: Final = "rollers"
"""Name of the setting with every roller on the floor, level normal."""
GROUPS: Final = ("robot-level", "latency", HELD_OUT)
"""Groups of a certificate's plants that are compared, beside the model itself."""
_WARNING, _TRACK = "warning", "track"
_BOUND: Final = ""
"""Stands for the oracle as the bound where others have a controller's name, of which none is empty."""


@dataclass(frozen=True)
class Row:
    """The results of one controller."""

    controller: str
    success: Mapping[str, Share]
    """Setting -> success: three levels on the planar plant; level normal on rollers and changed robots,
    against the adversary, and on what is held out."""
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
    held_out: tuple[str, ...] = ()
    """Which settings a certificate holds out: robots and opponents that no training saw."""
    bound: Mapping[str, Share] = field(default_factory=dict)
    """Setting -> success of the oracle on the first quarter of the episodes, as in a certificate; missing are
    rollers, and the adversary, which is another opponent for each controller."""


def compare_controllers(
    controllers: Sequence[str],
    model: Model,
    *,
    episodes: int = 200,
    rollers: bool = True,
    search: Search | None = None,
    bound: bool = True,
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
        bound: whether the oracle plays as well, for what could be won at best.
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
    if bound:
        bounds = {one: bound_job(f"bound, {one}", setups[one], episodes) for one in settings}
        planned |= {f"{_BOUND}|{one}": job for one, job in bounds.items() if job is not None}
    adversaries: dict[str, Opponent] = {}
    if search is not None:
        base, normal = opponent_for("normal"), setups["normal"]
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
    return Comparison(
        rows=rows,
        settings=settings,
        provenance={**versions, "episodes": episodes, "first_seed": 0},
        held_out=tuple(one.name for one in _compared(model) if one.group == HELD_OUT),
        bound={one: played[f"{_BOUND}|{one}"].success for one in settings if f"{_BOUND}|{one}" in played},
    )


def _compared(model: Model) -> tuple[RobotVariant, ...]:
    """Return the plants of a certificate that are compared."""
    found = certificate_variants(model, "planar", opponent_for("normal"))
    return tuple(one for one in found if one.group in GROUPS)


def _settings(model: Model, rollers: bool) -> tuple[dict[str, Setup], dict[str, str]]:
    """Return all setups by name, and the descriptions of those in which success is reported."""
    setups: dict[str, Setup] = {}
    about: dict[str, str] = {}
    for level in DIFFICULTIES:
        setups[level] = Setup(model, difficulty=level, known=model)
        about[level] = f"planar plant, level {level}"
    normal = setups["normal"]
    if rollers:
        setups[_ROLLERS] = replace(normal, physics="rollers")
        about[_ROLLERS] = "every roller on the floor, level normal"
    for variant in _compared(model):
        setups[variant.name] = setup_on(variant, normal)
        about[variant.name] = f"planar plant, level normal; {variant.summary}"
    setups[_WARNING] = replace(normal, opponent=replace(opponent_for("normal"), warning_s=RANGE_S))
    setups[_TRACK] = replace(normal, task="track")
    return setups, about
