"""Fewer runs where all would take too long to simulate again and again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid.logs import Run


def liveliest(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return whole groups of runs up to so many seconds of distinct commands, in their own order.

    Of each split the groups with the largest changes of command come first, in turn; one group of each split
    is always there.

    Args:
        runs: of a dataset.
        seconds: how long one run of each group may take altogether [s].
    """
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
    queues = [sorted(groups, key=lambda g: (-activity[g], g)) for groups in splits.values()]
    chosen, spent = {queue[0] for queue in queues}, sum(lengths[queue[0]] for queue in queues)
    for rank in range(1, max(len(queue) for queue in queues)):
        for queue in queues:
            if rank < len(queue) and spent + lengths[queue[rank]] <= seconds:
                chosen.add(queue[rank])
                spent += lengths[queue[rank]]
    return tuple(run for run in runs if run.group in chosen)
