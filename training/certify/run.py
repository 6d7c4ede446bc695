"""Making a certificate: which episodes are played, and the metrics of the results."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

import mecanum_env
from mecanum_env.errors import require_at_least
from mecanum_env.model import Model, model_sha256
from mecanum_env.parallel import Workers
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import opponent_for, opponent_to_dict
from training.certify.adversary import Search, worst_opponent
from training.certify.certificate import Certificate
from training.certify.checks import checks, timing_check
from training.certify.plants import ADVERSARY, RobotVariant, knows_uncertainty, select_variants
from training.certify.results import Timing, TrackingResult, VariantResult
from training.certify.thresholds import Thresholds, require_valid
from training.certify.variations import certificate_variants
from training.certify.warning import RANGE_S, WarningCurve, warning_curve
from training.evaluate import Episode, Evaluation, Job, Mean, Setup, mean, play_jobs, success_of
from training.evaluate.play import Progress

TRACK_SHARE = 4
"""One episode of tracking is played for this many of the dodge, since it lasts five times as long."""
WARNING_FACTOR = 2
"""Episodes of varied warning, relative to those of a plant: a curve takes more of them than a point."""
BOUND_SHARE = 4
"""One episode of the oracle is played for this many of the controller, with the first seeds."""
_WARNING, _TRACK, _BOUND = "warning", "tracking", "bound of "


@dataclass(frozen=True)
class CertifyOptions:
    """How a certificate is made."""

    episodes: int = 200
    """Number of episodes per plant, with the seeds 0, 1, ..."""
    plants: tuple[str, ...] = ()
    """Names and groups of plants, to which the nominal one and those held out are added; empty: all."""
    physics: RobotPlant = "planar"
    difficulty: str = "normal"
    workers: Workers = Workers()
    """Where the episodes are played, which does not change the result."""
    thresholds: Thresholds = Thresholds()
    bound: bool = True
    """Whether the oracle plays every planar plant as well, so that results are shares of its success."""
    search: Search = Search()  # noqa: RUF009  (frozen)
    """How long the adversary is searched."""


def certify_controller(
    controller: str, model: Model, options: CertifyOptions | None = None, progress: Progress | None = None
) -> Certificate:
    """Play a controller on every plant and compare its metrics with the thresholds.

    The controller knows the model, whichever plant it is played on.

    Args:
        controller: its name or path; see `training.controllers.named.make_controller`.
        model: the identified robot.
        options: plants, episodes and thresholds; `CertifyOptions()` if None.
        progress: called with the name of what was played and the number of episodes.

    Raises:
        InputError: there is no such controller, plant or difficulty, or a number is invalid.
    """
    options = CertifyOptions() if options is None else options
    require_usable(options)
    chosen = _against(controller, model, _chosen(model, options), options, progress)
    played = play_jobs(_jobs(controller, model, chosen, options), options.workers, progress)
    nominal = played[chosen[0].name].episodes
    results = tuple(
        variant_result(
            variant,
            played[variant.name].episodes,
            None if i == 0 else nominal,
            played.get(_BOUND + variant.name),
        )
        for i, variant in enumerate(chosen)
    )
    curve, track = warning_curve_of(played[_WARNING].episodes), tracking_result(played[_TRACK].episodes)
    timing = timing_of(played[chosen[0].name])
    return Certificate(
        controller=controller,
        plants=results,
        warning=curve,
        track=track,
        thresholds=options.thresholds,
        checks=checks(results, curve, track, options.thresholds),
        notes=_notes(model, chosen, options),
        provenance=_provenance(model, options),
        timing=timing,
        timing_check=timing_check(timing, options.thresholds),
    )


def episodes_of(options: CertifyOptions, model: Model) -> int:
    """Return the number of episodes that a certificate of a model takes with these options."""
    chosen = _chosen(model, options)
    searched = options.search.total if any(one.group == ADVERSARY for one in chosen) else 0
    return searched + sum(job.episodes for job in _jobs("", model, chosen, options).values())


def _chosen(model: Model, options: CertifyOptions) -> tuple[RobotVariant, ...]:
    found = certificate_variants(model, options.physics, opponent_for(options.difficulty))
    return select_variants(found, options.plants)


def _against(
    controller: str,
    model: Model,
    chosen: Sequence[RobotVariant],
    options: CertifyOptions,
    progress: Progress | None,
) -> tuple[RobotVariant, ...]:
    """Return the chosen variants, with the adversary that was found for a controller if it is one of them."""
    base = opponent_for(options.difficulty)
    setup = Setup(model, options.physics, difficulty=options.difficulty, known=model)
    return tuple(
        replace(
            one, opponent=worst_opponent(controller, setup, base, options.search, options.workers, progress)
        )
        if one.group == ADVERSARY
        else one
        for one in chosen
    )


def require_usable(options: CertifyOptions) -> None:
    """Refuse options that cannot be played.

    Raises:
        InputError: there is no episode, workers cannot be, or there is no such difficulty or threshold.
    """
    require_at_least(1, episodes=options.episodes)
    options.workers.require_usable()
    opponent_for(options.difficulty)
    require_valid(options.thresholds)


def _jobs(
    controller: str, model: Model, chosen: Sequence[RobotVariant], options: CertifyOptions
) -> dict[str, Job]:
    nominal = Setup(model, chosen[0].physics, difficulty=options.difficulty, known=model)
    setups = {one.name: setup_on(one, nominal) for one in chosen}
    setups[_WARNING] = replace(nominal, opponent=replace(opponent_for(options.difficulty), warning_s=RANGE_S))
    setups[_TRACK] = replace(nominal, task="track")
    counts = {_WARNING: WARNING_FACTOR * options.episodes, _TRACK: max(1, options.episodes // TRACK_SHARE)}
    jobs = {
        name: Job(name, controller, setup, counts.get(name, options.episodes))
        for name, setup in setups.items()
    }
    if options.bound:
        bounds = [bound_job(_BOUND + one.name, setups[one.name], options.episodes) for one in chosen]
        jobs |= {job.name: job for job in bounds if job is not None}
    return jobs


def setup_on(variant: RobotVariant, nominal: Setup) -> Setup:
    """Return the setup of a plant, of which the controller knows what `nominal` says that it knows."""
    return replace(
        nominal,
        model=variant.model,
        physics=variant.physics,
        randomize=variant.randomize,
        opponent=variant.opponent,
        senses=variant.senses,
    )


def bound_job(name: str, setup: Setup, episodes: int) -> Job | None:
    """Return the oracle's job beside that many episodes of a controller; None on rollers.

    On rollers a rehearsal takes too long.
    """
    if setup.physics != "planar":
        return None
    return Job(name, "oracle", setup, max(1, episodes // BOUND_SHARE))


def variant_result(
    variant: RobotVariant,
    episodes: Sequence[Episode],
    nominal: Sequence[Episode] | None,
    bound: Evaluation | None = None,
) -> VariantResult:
    """Return the metrics of the dodge on one plant from its episodes, in the order of their seeds.

    `nominal` are those on the nominal plant with the same seeds; None: this is the nominal plant. `bound` is
    the oracle's evaluation of the same plant, if it was played.
    """
    change = None
    if nominal is not None:
        change = mean([float(a.success) - float(b.success) for a, b in zip(episodes, nominal, strict=True)])
    return VariantResult(
        name=variant.name,
        group=variant.group,
        summary=variant.summary,
        physics=variant.physics,
        success=success_of(episodes),
        by_technique={
            name: success_of([episode for episode in episodes if episode.technique == name])
            for name in sorted({episode.technique for episode in episodes})
        },
        failures=dict(Counter(episode.reason for episode in episodes if episode.reason).most_common()),
        change=change,
        settling_s=mean([episode.settling_s for episode in episodes]),
        overshoot=mean([episode.overshoot for episode in episodes]),
        saturated_share=_mean_of_all([episode.saturated_share for episode in episodes]),
        speed_error_m_s=_mean_of_all([episode.speed_error_m_s for episode in episodes]),
        duration_s=_mean_of_all([episode.duration_s for episode in episodes]),
        total_reward=_mean_of_all([episode.total_reward for episode in episodes]),
        bound=None if bound is None else bound.success,
        opponent=None if variant.opponent is None else _as_read(opponent_to_dict(variant.opponent)),
    )


def _as_read(value: Mapping[str, Any]) -> dict[str, Any]:
    """Return a JSON object as it is read back from a file, with lists for tuples."""
    return dict(json.loads(json.dumps(value)))


def tracking_result(episodes: Sequence[Episode]) -> TrackingResult:
    """Return the metrics of the tracking task from its episodes."""
    return TrackingResult(
        success_of(episodes),
        mean([episode.distance_error_m for episode in episodes]),
        mean([episode.bearing_error_rad for episode in episodes]),
    )


def warning_curve_of(episodes: Sequence[Episode]) -> WarningCurve:
    """Return success against warning time from episodes of the dodge with varied warning."""
    # Every episode of the dodge has a warning time.
    warnings = [episode.warning_s for episode in episodes if episode.warning_s is not None]
    return warning_curve(warnings, [episode.success for episode in episodes])


def timing_of(evaluation: Evaluation) -> Timing:
    """Return the percentiles of an evaluation's times per command."""
    times = evaluation.command_times_s
    p50, p99 = (float(value) for value in np.percentile(times, [50, 99]))
    return Timing(p50, p99, float(times.max()), int(times.size))


def _mean_of_all(values: Sequence[float]) -> Mean:
    found = mean(values)
    assert found is not None  # there is at least one episode
    return found


def _notes(model: Model, chosen: Sequence[RobotVariant], options: CertifyOptions) -> tuple[str, ...]:
    notes = []
    if not knows_uncertainty(model):
        notes.append(
            "The model holds no uncertainty, so no robots were drawn from it; python -m sysid.fit writes a "
            "model with it."
        )
    if not model.effects:
        notes.append("The model has no effects of its own; python -m sysid.gap finds them in logs.")
    rolling = ", ".join(variant.name for variant in chosen if variant.physics == "rollers")
    if rolling and options.physics == "planar":
        notes.append(f"On rollers, because the planar plant cannot simulate their effects: {rolling}.")
    return tuple(notes)


def _provenance(model: Model, options: CertifyOptions) -> dict[str, str | int]:
    return {
        "version": mecanum_env.__version__,
        "mujoco": mujoco.__version__,
        "model_sha256": model_sha256(model),
        "episodes": options.episodes,
        "first_seed": 0,
        "difficulty": options.difficulty,
        "physics": options.physics,
    }
