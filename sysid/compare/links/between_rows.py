"""Commands that a log shows in the first row after they were given, at any time since the row before.

A logger that writes rows at its own pace does not know when a command was given. With rows 40 ms apart a fast
wheel has moved by tens of rpm when the row appears that shows the command, and no law explains a speed that
comes before its command. Each time within the interval is as likely as another, so that the likelihood of a
common delay m, for a change between the times 0 and w, is

    (1 / w) * integral of l(m + u) du, u from 0 to w,

with l(d) that of the change acting at time d. Whether a log is of this kind is told by the likelihood of all
its changes, against that of their stamps with one delay, or with delays that spread.

Throughout, `likelihood` has the logarithm of the likelihood of each change (rows) at each delay of `GRID_S`
since the row before it, and `changes` were found with `between_rows` (`sysid.compare.links.changes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, STEP_S, Change
from sysid.compare.links.common_delay import FEWEST, CommonDelay
from sysid.logs import Run

EDGE_S: Final = 0.004
"""By how much a command that was given between rows may act earlier or later than others [s]: loops and
loggers take their time. Assumed; it keeps the edge of a row from moving a change by force."""


def blurred(likelihood: FloatArray, changes: Sequence[Change]) -> FloatArray:
    """Return the logarithm of the likelihood of each common delay, (n, p), given at any time between rows."""
    if not changes:
        return likelihood
    top = likelihood.max(axis=1, keepdims=True)
    total = np.cumsum(np.exp(likelihood - top), axis=1)
    total = np.concatenate([np.zeros((len(changes), 1)), total], axis=1)
    cells = _cells(changes)
    first = np.arange(GRID_S.size)[None, :]
    last = np.minimum(first + cells[:, None] + 1, GRID_S.size)
    mean = (np.take_along_axis(total, last, axis=1) - total[:, :-1]) / (cells[:, None] + 1)
    return np.asarray(np.log(np.maximum(mean, 1e-300)) + top)


def as_stamped(likelihood: FloatArray, changes: Sequence[Change]) -> FloatArray:
    """Return the likelihood at delays since the time at which the log says that a change was given."""
    return np.array(
        [
            np.interp(GRID_S + change.stamped_s, GRID_S, row)
            for change, row in zip(changes, likelihood, strict=True)
        ]
    ).reshape(likelihood.shape)


def weights(late_s: float, likelihood: FloatArray, changes: Sequence[Change]) -> FloatArray:
    """Return the probability of each delay of the grid (columns) for each of the changes (rows).

    By the `likelihood` of each they act `late_s` [s] after they were given, and no later than `EDGE_S` after
    that, so that what is later is left to be found.
    """
    found = np.zeros_like(likelihood)
    edge, first = round(EDGE_S / STEP_S), round(late_s / STEP_S)
    for row, cells in zip(found, _cells(changes).tolist(), strict=True):
        # The sides fall in a straight line.
        box = np.convolve(np.ones(cells + 1), np.ones(2 * edge + 1))
        here = np.arange(box.size) + first - edge
        inside = (here >= 0) & (here < row.size)
        row[here[inside]] = box[inside]
    with np.errstate(divide="ignore"):
        weight = likelihood + np.log(found)
    weight = np.exp(weight - weight.max(axis=1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def evidence(likelihood: FloatArray, changes: Sequence[Change]) -> float:
    """Return twice the log likelihood ratio of commands between rows to commands as stamped.

    The stamps may be late by delays that spread, the others by one delay: the best of each.
    """
    if len(changes) < FEWEST or not any(change.within_s >= STEP_S for change in changes):
        return 0.0
    between = float(blurred(likelihood, changes).sum(axis=0).max())
    stamped = as_stamped(likelihood, changes)
    return 2.0 * (between - CommonDelay.of(stamped).log_likelihood(stamped))


def repeated(runs: Sequence[Run], changes: Sequence[Change]) -> list[list[int]]:
    """Return which changes are the same one in repeats, whose commands come at the same times: all of them.

    In other runs of the group a change has the same number and levels, and appears between rows at the same
    times.
    """
    numbers: dict[int, int] = {}
    alike: dict[tuple[object, ...], list[int]] = {}
    for index, change in enumerate(changes):
        number = numbers[change.run] = numbers.get(change.run, 0) + 1
        key = (runs[change.run].group, number, change.before_rpm, change.after_rpm)
        alike.setdefault(key, []).append(index)
    found = []
    for rows in alike.values():
        ends = np.array([(changes[i].given_s, changes[i].given_s + changes[i].within_s) for i in rows])
        near = np.all(np.abs(ends - np.median(ends, axis=0)) < STEP_S, axis=1)
        same = [i for i, is_near in zip(rows, near, strict=True) if is_near]
        found += [same] if same else []
        found += [[i] for i, is_near in zip(rows, near, strict=True) if not is_near]
    return found


def _cells(changes: Sequence[Change]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.array([round(change.within_s / STEP_S) for change in changes], np.int64)
