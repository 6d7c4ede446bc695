"""How far model and measurement differ before and after, on runs that no decision has seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.simulator import Plant
from mecanum_env.units import FloatArray
from sysid.gap.empirical import correction_of
from sysid.gap.records import Difference, Overlay
from sysid.gap.samples import Samples, samples_of
from sysid.logs import Dataset, Run, Split
from sysid.logs.columns import UNITS
from sysid.logs.noise import noise_from_repeats
from sysid.prediction import predict

_OVERLAYS: Final = 6
_HELD_OUT: Final[tuple[Split, ...]] = ("test", "validation", "fit")
Channels = Mapping[str, FloatArray]
"""Channel -> values at the rows of a run."""


@dataclass(frozen=True)
class Comparison:
    """Some runs, measured and simulated before and after."""

    split: Split
    """Of the runs."""
    runs: tuple[Run, ...]
    samples: tuple[Samples, ...]

    def by_channel(self) -> dict[str, list[Samples]]:
        """Return the samples of each channel, in the order of a log's columns."""
        found: dict[str, list[Samples]] = {}
        for name in UNITS:
            parts = [part for part in self.samples if part.channel == name]
            if parts:
                found[name] = parts
        return found


def held_out(dataset: Dataset) -> tuple[Split, tuple[Run, ...]]:
    """Return the test runs; where there are none, the validation runs, else the fit runs."""
    split = next(split for split in _HELD_OUT if dataset.split(split))
    return split, dataset.split(split)


def predicted(model: Model, runs: Sequence[Run], plant: Plant = "rollers") -> list[dict[str, FloatArray]]:
    """Return what a model predicts for each run: channel -> values at its rows, (n,).

    Args:
        model: wheel, robot and effects.
        runs: bench or robot logs.
        plant: of the robot.
    """
    shown = [predict(model, run, plant=plant) for run in runs]
    correction = correction_of(model)
    return (
        shown
        if correction is None
        else [correction.added_to(run, one) for run, one in zip(runs, shown, strict=True)]
    )


def compare(
    split: Split, runs: Sequence[Run], before: Sequence[Channels], after: Sequence[Channels]
) -> Comparison:
    """Return runs beside their simulations.

    Args:
        split: of the runs.
        runs: bench or robot logs.
        before: one a run, of the model as given.
        after: one a run, of the improved model.
    """
    seen: dict[str, int] = {}
    samples: list[Samples] = []
    for run, b, a in zip(runs, before, after, strict=True):
        repeat = seen.get(run.group, 0)
        seen[run.group] = repeat + 1
        samples += samples_of(run, b, a, repeat)
    return Comparison(split, tuple(runs), tuple(samples))


def differences(dataset: Dataset, comparison: Comparison) -> tuple[Difference, dict[str, Difference]]:
    """Return the gap over all channels, and that of each channel.

    With several channels the gap is in units of their noise: from repeats, else what is left after.

    Args:
        dataset: all its repeats give the noise.
        comparison: of the runs that count.
    """
    repeats = noise_from_repeats(dataset.runs) or {}
    channels = {}
    for name, parts in comparison.by_channel().items():
        before, after = (np.concatenate(errors) for errors in zip(*(p.errors() for p in parts), strict=True))
        floor = repeats[name].std if name in repeats else None
        channels[name] = Difference(UNITS[name], _rms(before), _rms(after), floor)
    if len(channels) == 1:
        return next(iter(channels.values())), channels
    known = all(channel.noise_floor is not None for channel in channels.values())
    scaled = [(c.before / s, c.after / s) for c in channels.values() if (s := c.noise_floor or c.after) > 0.0]
    if not scaled:
        return Difference("sigma", 0.0, 0.0, None), channels
    before_all, after_all = (math.sqrt(float(np.mean(np.square(x)))) for x in zip(*scaled, strict=True))
    return Difference("sigma", before_all, after_all, 1.0 if known else None), channels


def overlays(comparison: Comparison) -> tuple[Overlay, ...]:
    """Return the channels and runs that were worst before, against the spread of all of that channel."""
    scale = {name: max(_rms(np.concatenate([p.errors()[0] for p in parts])), 1e-12)
             for name, parts in comparison.by_channel().items()}  # fmt: skip
    first = [part for part in comparison.samples if part.repeat == 0]
    worst = sorted(first, key=lambda p: (-_rms(p.errors()[0]) / scale[p.channel], p.run, p.channel))
    return tuple(_overlay(comparison.split, part) for part in worst[:_OVERLAYS])


def _overlay(split: Split, part: Samples) -> Overlay:
    command = part.command.at(part.time_s)
    return Overlay(
        file=part.run,
        split=split,
        channel=part.channel,
        unit=UNITS[part.channel],
        time_s=part.time_s,
        measured=part.measured,
        before=part.before,
        after=part.after,
        command=command[:, 0] if UNITS[part.channel] == "rpm" else None,
    )


def _rms(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
