"""From episodes to a certificate's figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from training.certify.plants import NamedPlant
from training.certify.records import PlantFigures, Timing, TrackFigures
from training.evaluate import Episode, Evaluation, Mean, Share, mean, share


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
