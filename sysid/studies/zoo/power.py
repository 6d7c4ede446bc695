"""Power curves: the share of cases that are found over the size of the change, as table and picture."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mecanum_env.files import atomic_path
from sysid.studies.score import SIZES, size_of
from sysid.studies.zoo.outcome import Outcome
from sysid.studies.zoo.tables import Share, Table, is_found, of_kind, share, signal_of

EDGES: Final = (0.0, 0.1, 0.3, 0.6, 1.0, 2.0, 5.0, 10.0, 20.0, math.inf)
"""Signals between which the cases of an overall curve are pooled."""
_NAME_EDGES: Final = (*(low for low, _ in SIZES.values()), math.inf)
"""The same of a single name, of which there are fewer cases: those of the sizes."""
_LEAST_SIGNAL: Final = 0.03
"""Where changes below the axis are drawn."""
_COLUMNS: Final = 6
_COLOURS: Final = ("#c8102e", "#1f4e79", "#2e8b57")


@dataclass(frozen=True)
class Point:
    """The cases of a curve whose signals are between two edges."""

    signal: float
    """Their geometric mean."""
    found: Share


@dataclass(frozen=True)
class Curve:
    """One power curve; bins without a case are left out."""

    label: str
    points: tuple[Point, ...]


def curve(label: str, outcomes: Iterable[Outcome], edges: Sequence[float] = EDGES) -> Curve:
    """Return the power curve of outcomes, which are pooled between `edges`, by its `label`."""
    cases = list(outcomes)
    points = []
    for low, high in itertools.pairwise(edges):
        inside = [o for o in cases if low <= signal_of(o) < high]
        if inside:
            logs = [math.log(max(signal_of(o), _LEAST_SIGNAL)) for o in inside]
            points.append(Point(math.exp(sum(logs) / len(logs)), share(map(is_found, inside))))
    return Curve(label, tuple(points))


def overall_groups(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Return the outcomes with singles on the bench and on robots, and with pairs and triples, by a label."""
    groups = {
        "bench, one effect": of_kind(outcomes, "single", "twin", level="bench"),
        "robot, one effect": of_kind(outcomes, "single", "twin", level="robot"),
        "two or three effects": of_kind(outcomes, "pair", "triple"),
    }
    return {label: group for label, group in groups.items() if group}


def name_groups(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Return, by name, the outcomes in which it is the only hidden effect."""
    singles = of_kind(outcomes, "single", "twin")
    names = sorted({name for outcome in singles for name in outcome.hidden})
    return {name: [o for o in singles if name in o.hidden] for name in names}


def power_table(outcomes: Sequence[Outcome]) -> Table:
    """Return the share of cases that are found by name and size."""
    groups = {**overall_groups(outcomes), **name_groups(outcomes)}
    rows = tuple(
        (
            label,
            *(share(is_found(o) for o in group if size_of(signal_of(o)) == size).text() for size in SIZES),
        )
        for label, group in groups.items()
    )
    note = "Right or rightly ambiguous, with 95 % Wilson intervals."
    return Table("Found, by name and size", note, ("", *SIZES), rows)


def write_power_plot(outcomes: Sequence[Outcome], path: Path) -> None:
    """Write the power curves as PNG to `path`: over all names above, by name below."""
    names = name_groups(outcomes)
    rows = math.ceil(len(names) / _COLUMNS)
    heights = [3.6, 1.9 * rows] if rows else [3.6]
    figure = Figure(figsize=(13.5, sum(heights)), layout="constrained")
    parts = list(figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False).flat)
    above = parts[0].subplots()
    for (label, group), colour in zip(overall_groups(outcomes).items(), _COLOURS, strict=False):
        _draw(above, curve(label, group), colour)
    above.set(title="share of cases that are right or rightly ambiguous", ylabel="share")
    above.set_xlabel("size of the change: rms of what it does to the logs, over the noise")
    if names:
        above.legend(fontsize=9, loc="upper left")
        axes = list(parts[1].subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False).flat)
        for ax, (name, group) in zip(axes, names.items(), strict=False):
            _draw(ax, curve(name, group, _NAME_EDGES), _COLOURS[0])
            ax.set_title(f"{name} ({len(group)})", fontsize=8)
        for ax in axes[len(names) :]:
            ax.set_axis_off()
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=80)


def _draw(ax: Axes, one: Curve, colour: str) -> None:
    x = [point.signal for point in one.points]
    y = [point.found.value for point in one.points]
    below = [point.found.value - point.found.low for point in one.points]
    above = [point.found.high - point.found.value for point in one.points]
    ax.errorbar(x, y, yerr=(below, above), fmt="o-", ms=3, lw=1.3, capsize=2, color=colour, label=one.label)
    for low, _ in list(SIZES.values())[1:]:
        ax.axvline(low, color="0.85", lw=0.8, zorder=0)
    ax.set_xscale("log")
    ax.set(xlim=(0.8 * _LEAST_SIGNAL, 200.0), ylim=(-0.03, 1.03))
