"""Selecting runs, or pieces of runs, where simulating all of them again and again would take too long."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from sysid.logs import Dataset, Run

PIECE_S: Final = 5.0
"""Least length of a piece of a long run [s]: the rest of one command and the response to the next."""
BEFORE_S: Final = 0.5
"""Time before a change of command at which a piece begins [s], so that the robot has settled."""
SMALL: Final = 0.5
"""Largest of the small commands, relative to the largest command."""
_ACTIVE_S: Final = {"bench": 300.0, "robot": 60.0}
"""Duration of the logs in which a model's own error is measured [s]; a robot on its rollers takes long."""
_BANDS: Final = 4  # bands of commanded speed in each direction that pieces are to cover

Bands = frozenset[tuple[int, int]]


def select_runs(runs: Sequence[Run], seconds: float, command_period_s: float) -> tuple[Run, ...]:
    """Return runs with at most so many seconds of distinct commands: all of them, or pieces of the long ones.

    If all are too long together, runs longer than two pieces are cut. Runs and pieces that add most bands of
    speed come first, those with larger changes of command first among equals. Of each group one run counts.
    The pieces keep the phase of the robot's command clock, of period `command_period_s`.
    """
    groups = {run.group: max(r.duration_s for r in runs if r.group == run.group) for run in runs}
    if sum(groups.values()) <= seconds:
        return tuple(runs)
    long = [run for run in runs if is_long(run)]
    whole = [run for run in runs if run not in long]
    return _covering([*whole, *(piece for run in long for piece in pieces(run, command_period_s))], seconds)


def is_long(run: Run) -> bool:
    """Return whether a run is cut into pieces where all runs together are too long."""
    return run.duration_s > 2.0 * PIECE_S


def pieces(run: Run, command_period_s: float) -> Iterator[Run]:
    """Yield pieces of a run, each at least `PIECE_S` long, that begin at multiples of a period [s]."""
    edges = [0.0]
    for change in run.command_changes()[0][1:]:
        edge = math.floor((change - BEFORE_S) / command_period_s + 1e-6) * command_period_s
        if edge - edges[-1] >= PIECE_S and run.duration_s - edge >= PIECE_S:
            edges.append(edge)
    ends = [*edges[1:], math.inf]
    for number, (start, end) in enumerate(zip(edges, ends, strict=True)):
        rows = (run.time_s >= start - 1e-9) & (run.time_s < end - 1e-9)
        columns = [getattr(run.command, field.name)[rows] for field in fields(run.command)]
        # The file name stays, since the findings of the data check refer to it.
        yield replace(
            run,
            group=f"{run.group}, piece {number}",
            time_s=run.time_s[rows] - run.time_s[rows][0],
            command=type(run.command)(*columns),
            channels={name: values[rows] for name, values in run.channels.items()},
            full_v=_full_voltage(run),
            weights={name: values[rows] for name, values in run.weights.items()},
            given=None if run.given is None else run.given[:, rows] - run.time_s[rows][0],
        )


def _full_voltage(run: Run) -> float | None:
    """Return the voltage that counts as full in all pieces of a run [V]; None if none was logged."""
    logged = run.channels.get("battery_v", np.zeros(0))
    finite = logged[np.isfinite(logged)]
    return run.full_v if run.full_v is not None or not finite.size else float(finite[0])


def small_command_runs(dataset: Dataset, command_period_s: float) -> Dataset:
    """Return the fit and validation runs, or pieces of the long ones, with commands below `SMALL`.

    A linear law is fitted best where no limit of speed acts. A study of the gap then finds what differs at
    larger commands. If no fit run is left, the dataset is returned unchanged.
    """
    runs = dataset.split("fit") + dataset.split("validation")
    cut = [p for r in runs for p in (pieces(r, command_period_s) if is_long(r) else (r,))]
    largest = [float(np.max(np.abs(run.command.wheels_rpm))) for run in cut]
    kept = tuple(run for run, rpm in zip(cut, largest, strict=True) if rpm <= SMALL * max(largest))
    if not any(run.split == "fit" for run in kept):
        return dataset
    return replace(dataset, runs=kept, sha256=hashlib.sha256(f"{dataset.sha256} quiet".encode()).hexdigest())


def most_active(dataset: Dataset) -> Dataset:
    """Return logs with as many of their most active runs as a model's own error is measured in."""
    return replace(dataset, runs=most_active_runs(dataset.runs, _ACTIVE_S[dataset.level]))


def most_active_runs(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return whole groups of runs with at most so many seconds of distinct commands, in their own order.

    The splits take turns, each with its group of the largest changes of command that is left. At least one
    group of each split is returned. Of each group one run counts.
    """
    lengths, activity, queues = _groups(runs)
    queues = [sorted(groups, key=lambda g: (-activity[g], g)) for groups in queues]
    return _in_turn(runs, seconds, lengths, queues)


def _covering(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return groups as `most_active_runs` does, but first those that add bands of speed."""
    lengths, activity, splits = _groups(runs)
    bands = _bands(runs)
    queues = []
    for groups in splits:
        left, queue, seen = set(groups), list[str](), set[tuple[int, int]]()
        while left:
            group = min(left, key=lambda g: (-len(bands[g] - seen), -activity[g], g))
            if not bands[group] - seen and seen:
                # All bands are covered: start again.
                seen = set()
                continue
            queue.append(group)
            left.remove(group)
            seen |= bands[group]
        queues.append(queue)
    return _in_turn(runs, seconds, lengths, queues)


def _groups(runs: Sequence[Run]) -> tuple[dict[str, float], dict[str, float], list[list[str]]]:
    """Return duration [s] and change of command [rpm/s] of each group, and the groups of each split.

    The first command counts as a change from rest, so that a run that holds one command is not without any.
    """
    lengths: dict[str, float] = {}
    activity: dict[str, float] = {}
    splits: dict[str, list[str]] = {}
    for run in runs:
        if run.group not in lengths:
            splits.setdefault(run.split, []).append(run.group)
        levels = run.command_changes()[1]
        changes = np.diff(levels, axis=0, prepend=np.zeros_like(levels[:1]))
        per_second = float(np.sqrt(np.sum(changes**2))) / max(run.duration_s, 1e-9)
        lengths[run.group] = max(lengths.get(run.group, 0.0), run.duration_s)
        activity[run.group] = max(activity.get(run.group, 0.0), per_second)
    return lengths, activity, list(splits.values())


def _bands(runs: Sequence[Run]) -> dict[str, Bands]:
    """Return the bands of speed that each group commands, as (wheel, band)."""
    top = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in runs)
    found: dict[str, Bands] = {}
    for run in runs:
        levels = run.command_changes()[1]
        band = np.rint(levels / max(top, 1e-9) * _BANDS).astype(int)
        mine = frozenset((wheel, int(b)) for row in band for wheel, b in enumerate(row))
        found[run.group] = found.get(run.group, frozenset()) | mine
    return found


def _in_turn(
    runs: Sequence[Run], seconds: float, lengths: dict[str, float], queues: Sequence[Sequence[str]]
) -> tuple[Run, ...]:
    """Return the runs of the groups that fit, one from each queue in turn."""
    chosen, spent = {queue[0] for queue in queues}, sum(lengths[queue[0]] for queue in queues)
    for rank in range(1, max(len(queue) for queue in queues)):
        for queue in queues:
            if rank < len(queue) and spent + lengths[queue[rank]] <= seconds:
                chosen.add(queue[rank])
                spent += lengths[queue[rank]]
    return tuple(run for run in runs if run.group in chosen)
