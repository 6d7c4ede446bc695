"""Fewer runs where all would take too long to simulate again and again."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Final

import numpy as np

from sysid.logs import Dataset, Run

PIECE_S: Final = 5.0
"""Of a long run, at least: the rest of one command and what follows the next."""
BEFORE_S: Final = 0.5
"""A piece begins so long before a change of command, when the robot has settled."""
QUIET: Final = 0.5
"""Of the fastest command: the largest of small_command_runs ones."""
_BANDS: Final = 4
"""Of commanded speed in each direction, up to the fastest, that pieces are to cover."""

Bands = frozenset[tuple[int, int]]


def select_runs(runs: Sequence[Run], seconds: float, command_period_s: float) -> tuple[Run, ...]:
    """Return runs up to so many seconds of distinct commands: all, or pieces of the long ones.

    Where all would be too much, runs longer than two pieces are cut, and the pieces that bring the most
    speeds that none before had come first, the livelier ones first among equals. Where no run is so long,
    whole groups are chosen: see `most_active_runs`.

    Args:
        runs: of a dataset.
        seconds: how long one run of each group may take altogether [s].
        command_period_s: of the robot's clock [s], which goes on in a piece as it did in the run.
    """
    groups = {run.group: max(r.duration_s for r in runs if r.group == run.group) for run in runs}
    long = [run for run in runs if run.duration_s > 2.0 * PIECE_S]
    if sum(groups.values()) <= seconds or not long:
        return most_active_runs(runs, seconds)
    whole = [run for run in runs if run not in long]
    return _covering([*whole, *(piece for run in long for piece in pieces(run, command_period_s))], seconds)


def pieces(run: Run, command_period_s: float) -> Iterator[Run]:
    """Yield pieces of a run, each at least `PIECE_S` long, the last with what is left.

    Args:
        run: at least `PIECE_S` long.
        command_period_s: pieces begin at a whole number of these.
    """
    edges = [0.0]
    for change in run.command_changes()[0][1:]:
        edge = math.floor((change - BEFORE_S) / command_period_s + 1e-6) * command_period_s
        if edge - edges[-1] >= PIECE_S and run.duration_s - edge >= PIECE_S:
            edges.append(edge)
    ends = [*edges[1:], math.inf]
    for number, (start, end) in enumerate(zip(edges, ends, strict=True)):
        rows = (run.time_s >= start - 1e-9) & (run.time_s < end - 1e-9)
        columns = [getattr(run.command, field.name)[rows] for field in fields(run.command)]
        # The file keeps its name: by it the findings of the data check are known.
        yield replace(
            run,
            group=f"{run.group}, piece {number}",
            time_s=run.time_s[rows] - run.time_s[rows][0],
            command=type(run.command)(*columns),
            channels={name: values[rows] for name, values in run.channels.items()},
        )


def small_command_runs(dataset: Dataset, command_period_s: float) -> Dataset:
    """Return the fit and validation runs, or pieces of the long ones, whose commands stay small.

    A linear law is fitted best where no limit of speed acts: below half of the fastest command. What departs
    from it at larger ones is then seen by a study of the gap. Where no fit run is left, all are returned.

    Args:
        dataset: bench or robot logs.
        command_period_s: as for `pieces`.
    """
    runs = dataset.split("fit") + dataset.split("validation")
    cut = [p for r in runs for p in (pieces(r, command_period_s) if r.duration_s > 2.0 * PIECE_S else (r,))]
    largest = [float(np.max(np.abs(run.command.wheels_rpm))) for run in cut]
    kept = tuple(run for run, rpm in zip(cut, largest, strict=True) if rpm <= QUIET * max(largest))
    if not any(run.split == "fit" for run in kept):
        return dataset
    return replace(dataset, runs=kept, sha256=hashlib.sha256(f"{dataset.sha256} quiet".encode()).hexdigest())


def most_active_runs(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return whole groups of runs up to so many seconds of distinct commands, in their own order.

    Of each split the groups with the largest changes of command come first, in turn; one group of each split
    is always there.

    Args:
        runs: of a dataset.
        seconds: how long one run of each group may take altogether [s].
    """
    lengths, activity, queues = _groups(runs)
    queues = [sorted(groups, key=lambda g: (-activity[g], g)) for groups in queues]
    return _in_turn(runs, seconds, lengths, queues)


def _covering(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return groups as `most_active_runs`, those first that bring speeds that none before had."""
    lengths, activity, splits = _groups(runs)
    bands = _bands(runs)
    queues = []
    for groups in splits:
        left, queue, seen = set(groups), list[str](), set[tuple[int, int]]()
        while left:
            best = min(left, key=lambda g: (-len(bands[g] - seen), -activity[g], g))
            if not bands[best] - seen and seen:
                # All speeds are there: they are covered anew.
                seen = set()
                continue
            queue.append(best)
            left.remove(best)
            seen |= bands[best]
        queues.append(queue)
    return _in_turn(runs, seconds, lengths, queues)


def _groups(runs: Sequence[Run]) -> tuple[dict[str, float], dict[str, float], list[list[str]]]:
    """Return the length and the change of command per second of each group, and the groups of each split."""
    lengths: dict[str, float] = {}
    activity: dict[str, float] = {}
    splits: dict[str, list[str]] = {}
    for run in runs:
        if run.group not in lengths:
            splits.setdefault(run.split, []).append(run.group)
        changes = np.diff(run.command_changes()[1], axis=0)
        per_second = float(np.sqrt(np.sum(changes**2))) / max(run.duration_s, 1e-9)
        lengths[run.group] = max(lengths.get(run.group, 0.0), run.duration_s)
        activity[run.group] = max(activity.get(run.group, 0.0), per_second)
    return lengths, activity, list(splits.values())


def _bands(runs: Sequence[Run]) -> dict[str, Bands]:
    """Return which bands of speed each group commands, as (wheel, band)."""
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
    chosen, spent = {queue[0] for queue in queues}, sum(lengths[queue[0]] for queue in queues)
    for rank in range(1, max(len(queue) for queue in queues)):
        for queue in queues:
            if rank < len(queue) and spent + lengths[queue[rank]] <= seconds:
                chosen.add(queue[rank])
                spent += lengths[queue[rank]]
    return tuple(run for run in runs if run.group in chosen)
