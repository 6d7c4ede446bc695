"""From episodes to a certificate's figures.

Making a certificate: which episodes are played where, and what comes of them.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

import mecanum_env
from mecanum_env.errors import require_at_least
from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import opponent_for
from training.certify.certificate import Certificate, PlantFigures, Thresholds, Timing, TrackFigures
from training.certify.judge import checks, require_valid, timing_check
from training.certify.plants import NamedPlant, knows_uncertainty, plants, select
from training.certify.warning import RANGE_S, warning_curve
from training.evaluate import Episode, Evaluation, Job, Mean, Setup, Share, mean, play_jobs, share
from training.evaluate.jobs import require_jobs


def plant_figures(
    plant: NamedPlant, episodes: Sequence[Episode], nominal: Sequence[Episode] | None
) -> PlantFigures:
    """Return the figures of the dodge on one plant.

    Args:
        plant: what was played on.
        episodes: in the order of their seeds.
        nominal: those of the nominal plant with the same seeds; None: this is it.
    """
    techniques = sorted({episode.technique for episode in episodes})
    change = None
    if nominal is not None:
        change = mean([float(a.success) - float(b.success) for a, b in zip(episodes, nominal, strict=True)])
    return PlantFigures(
        name=plant.name,
        group=plant.group,
        summary=plant.summary,
        physics=plant.physics,
        success=success_of(episodes),
        by_technique={
            name: success_of([episode for episode in episodes if episode.technique == name])
            for name in techniques
        },
        failures=dict(Counter(episode.reason for episode in episodes if episode.reason).most_common()),
        change=change,
        settling_s=_known([episode.settling_s for episode in episodes]),
        overshoot=_known([episode.overshoot for episode in episodes]),
        saturated_share=_all([episode.saturated_share for episode in episodes]),
        speed_error_m_s=_all([episode.speed_error_m_s for episode in episodes]),
        duration_s=_all([episode.duration_s for episode in episodes]),
        total_reward=_all([episode.total_reward for episode in episodes]),
    )


def track_figures(episodes: Sequence[Episode]) -> TrackFigures:
    """Return the figures of the tracking task from its episodes."""
    return TrackFigures(
        success_of(episodes),
        _known([episode.distance_error_m for episode in episodes]),
        _known([episode.bearing_error_rad for episode in episodes]),
    )


def timing_of(evaluation: Evaluation) -> Timing:
    """Return how long the commands of an evaluation took."""
    times = evaluation.command_times_s
    p50, p99 = (float(value) for value in np.percentile(times, [50, 99]))
    return Timing(p50, p99, float(times.max()), int(times.size))


def success_of(episodes: Sequence[Episode]) -> Share:
    """Return the share of episodes that are a success."""
    return share(sum(episode.success for episode in episodes), len(episodes))


def _known(values: Sequence[float | None]) -> Mean | None:
    return mean([value for value in values if value is not None])


def _all(values: Sequence[float]) -> Mean:
    found = mean(values)
    assert found is not None  # there is at least one episode
    return found


TRACK_SHARE = 4
"""One episode in this many of the dodge is played of tracking, which lasts five times as long."""
WARNING_FACTOR = 2
"""Episodes of varied warning, over those of a plant: a curve takes more than a point."""


@dataclass(frozen=True)
class Options:
    """How a certificate is made."""

    episodes: int = 200
    """A plant; their seeds are 0, 1, ..."""
    plants: tuple[str, ...] = ()
    """Names and groups of plants; none: all. The nominal one is always among them."""
    physics: RobotPlant = "planar"
    difficulty: str = "normal"
    jobs: int = 0
    """Plants at a time; 0: as many as there are processors. The result is the same with any number."""
    thresholds: Thresholds = Thresholds()  # noqa: RUF009  (frozen)


def certify(
    controller: str,
    model: Model,
    options: Options | None = None,
    progress: Callable[[str, int], Any] | None = None,
) -> Certificate:
    """Play a controller on every plant and hold its figures against the thresholds.

    The controller knows the model, whichever plant it is played on.

    Args:
        controller: its name or path, as for `training.controllers.named.make_controller`.
        model: the identified robot.
        options: which plants and how many episodes; `Options()` when None.
        progress: called with the name of what was played and the number of episodes.

    Raises:
        InputError: no such controller, plant or difficulty, or a number that is none.
    """
    options = Options() if options is None else options
    require_usable(options)
    chosen = select(plants(model, options.physics), options.plants)
    played = play_jobs(_jobs(controller, model, chosen, options), options.jobs, progress)
    nominal = played[chosen[0].name].episodes
    figures = tuple(
        plant_figures(plant, played[plant.name].episodes, None if i == 0 else nominal)
        for i, plant in enumerate(chosen)
    )
    varied = played[_WARNING].episodes
    warnings = [e.warning_s for e in varied if e.warning_s is not None]  # every episode of the dodge has one
    curve = warning_curve(warnings, [e.success for e in varied])
    track, timing = track_figures(played[_TRACK].episodes), timing_of(played[chosen[0].name])
    worst = min(figures, key=lambda one: one.success.value)
    return Certificate(
        controller=controller,
        plants=figures,
        warning=curve,
        track=track,
        thresholds=options.thresholds,
        checks=checks(figures[0], worst, curve, track, options.thresholds),
        notes=_notes(model, chosen, options),
        provenance=_provenance(model, options),
        timing=timing,
        timing_check=timing_check(timing, options.thresholds),
    )


def episodes_of(options: Options, model: Model) -> int:
    """Return how many episodes a certificate with these options takes for a model, for a progress bar."""
    count = len(select(plants(model, options.physics), options.plants))
    return (count + WARNING_FACTOR) * options.episodes + _track_episodes(options)


def require_usable(options: Options) -> None:
    """Refuse options that cannot be played.

    Raises:
        InputError: fewer than one episode, a negative number of jobs, no such difficulty or threshold.
    """
    require_at_least(1, episodes=options.episodes)
    require_jobs(options.jobs)
    opponent_for(options.difficulty)
    require_valid(options.thresholds)


_WARNING, _TRACK = "warning", "tracking"


def _jobs(controller: str, model: Model, chosen: Sequence[NamedPlant], options: Options) -> dict[str, Job]:
    def job(name: str, episodes: int, setup: Setup) -> Job:
        return Job(name, controller, replace(setup, known=model), episodes)

    opponent = opponent_for(options.difficulty)
    nominal = Setup(model, chosen[0].physics, difficulty=options.difficulty)
    varied = replace(nominal, opponent=replace(opponent, warning_s=RANGE_S))
    found = {
        plant.name: job(
            plant.name,
            options.episodes,
            Setup(plant.model, plant.physics, difficulty=options.difficulty, randomize=plant.randomize),
        )
        for plant in chosen
    }
    found[_WARNING] = job(_WARNING, WARNING_FACTOR * options.episodes, varied)
    found[_TRACK] = job(_TRACK, _track_episodes(options), replace(nominal, task="track"))
    return found


def _track_episodes(options: Options) -> int:
    return max(1, options.episodes // TRACK_SHARE)


def _notes(model: Model, chosen: Sequence[NamedPlant], options: Options) -> tuple[str, ...]:
    notes = []
    if not knows_uncertainty(model):
        notes.append(
            "The model holds no uncertainty, so no robots were drawn from it; python -m sysid.fit makes one "
            "that does."
        )
    if not model.effects:
        notes.append("The model has no effects of its own; python -m sysid.gap finds them in logs.")
    rolling = [plant.name for plant in chosen if plant.physics == "rollers"]
    if rolling and options.physics == "planar":
        notes.append(f"On rollers, since the planar plant cannot simulate them: {', '.join(rolling)}.")
    return tuple(notes)


def _provenance(model: Model, options: Options) -> dict[str, str | int]:
    written = json.dumps(model_to_dict(model), sort_keys=True).encode()
    return {
        "version": mecanum_env.__version__,
        "mujoco": mujoco.__version__,
        "model_sha256": hashlib.sha256(written).hexdigest(),
        "episodes": options.episodes,
        "first_seed": 0,
        "difficulty": options.difficulty,
        "physics": options.physics,
    }
