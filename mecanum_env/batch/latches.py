"""Commands that many robots have latched, and which of them holds when: delay, jitter and loss of the link.

What `mecanum_env.wheel_drive.chain` does for drives whose clocks agree, here for robots whose episodes began
at different times. Arrays have the shape (4, n), wheels first; clocks are numpy arrays (n,).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.batch.arrays import Arrays, OnArrays
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import EPS
from mecanum_env.wheel_drive.link import SPREAD, is_lost, own_delay

Due = npt.NDArray[np.bool_] | None
"""Where an event is due, shape (n,); None: everywhere."""
LINK: Final = ("delay_s", "jitter_s", "loss", "link_seed")
"""Parameters of a link."""


class Latches(OnArrays):
    """The latched commands of n robots, latest first, each `period_s` [s] after the one before."""

    def __init__(self, n: int, period_s: float, arrays: Arrays) -> None:
        super().__init__(arrays)
        self.period_s, array = period_s, arrays.array
        self._kept = [array(np.zeros((4, n)))]
        self._arrivals = [array(np.zeros((4, n)))]
        self._sent = self._kept[0]
        self._numbers = {name: np.zeros(n) for name in LINK}
        self._delay, self._jitters = array(np.zeros(n)), array(np.zeros(n, bool))
        self.count = np.zeros(n)
        """Number of commands latched so far, shape (n,)."""
        self._is_late = self._any_jitter = self._any_loss = False

    def take(self, rows: npt.NDArray[np.intp], link: Mapping[str, FloatArray]) -> None:
        """Take over the `link` of some `rows` (m,), which has what `LINK` lists, shape (m,) each."""
        if all(np.array_equal(self._numbers[name][rows], link[name]) for name in LINK):
            return
        for name in LINK:
            self._numbers[name][rows] = link[name]
        delay, jitter = self._numbers["delay_s"], self._numbers["jitter_s"]
        self._any_jitter, self._any_loss = (
            bool(np.any(jitter > 0.0)),
            bool(np.any(self._numbers["loss"] > 0.0)),
        )
        self._is_late = self._any_jitter or bool(np.any(delay > 0.0))
        self._delay, self._jitters = self._array(delay), self._array(jitter > 0.0)
        longest = float(np.max(delay + SPREAD * jitter)) if self._is_late else 0.0
        while len(self._kept) < math.ceil(longest / self.period_s + EPS) + 2 and self._is_late:
            self._kept.append(self._kept[-1])
            self._arrivals.append(self._arrivals[-1])

    def restart(self, rows: npt.NDArray[np.intp]) -> None:
        """Forget the commands of some `rows` (m,)."""
        at = self._array(rows)
        for one in (*self._kept, *self._arrivals, self._sent):
            one[:, at] = 0.0
        self.count[rows] = 0.0

    def latch(self, due: Due, sent: Any, taken: Callable[[Any, Any], Any]) -> None:
        """Latch the commands `sent` [rpm], (4, n), where they are `due`.

        `taken` says what the robots make of commands that act at some times [s], (4, n) or (n,).
        """
        xp, at = self._xp, self.count * self.period_s
        acts_at, arrival, lost = self._array(at + self._numbers["delay_s"]), self._arrivals[0], None
        if self._any_loss:
            lost = self._array(is_lost(self._numbers["loss"], self._numbers["link_seed"], self.count))
        if self._any_jitter:
            jitters, n = self._jitters, self._numbers
            own = self._array(at + own_delay(n["delay_s"], n["jitter_s"], n["link_seed"], self.count))
            changes = sent != self._sent if lost is None else (sent != self._sent) & ~lost
            arrival = xp.where(changes, xp.maximum(arrival, own), arrival)
            acts_at = xp.where(jitters, xp.maximum(self._array(at), arrival), acts_at)
            self._sent = self._where(
                due, sent if lost is None else xp.where(lost, self._sent, sent), self._sent
            )
            self._push(self._arrivals, due, arrival)
        new = taken(sent, acts_at)
        self._push(self._kept, due, new if lost is None else xp.where(lost, self._kept[0], new))
        self.count = self.count + 1.0 if due is None else self.count + due

    def _where(self, due: Due, new: Any, old: Any) -> Any:
        return new if due is None else self._xp.where(self._array(due), new, old)

    def _push(self, ring: list[Any], due: Due, newest: Any) -> None:
        ring[:] = [self._where(due, *pair) for pair in zip([newest, *ring[:-1]], ring, strict=True)]

    def held(self, start_s: FloatArray, length_s: float) -> Iterator[tuple[Any, Any]]:
        """Yield the shares of a time for which commands hold, and those commands (4, n), in order.

        The time begins at `start_s`, shape (n,), and has this length [s]. A single command has the share 1.0.
        """
        if not self._is_late:
            yield 1.0, self._kept[0]
            return
        xp, period = self._xp, self.period_s
        t, latest = self._array(start_s), self._array(self.count - 1.0)
        oldest = float(len(self._kept) - 1)
        age = xp.clip(latest - xp.floor((t - self._delay) / period + EPS), 0.0, oldest)
        if self._any_jitter:
            age = xp.where(self._jitters, self._newest(t + EPS * period), age)
        done = 0.0 * age
        for _ in range(len(self._kept)):
            arrival = (latest - age + 1.0) * period + self._delay
            if self._any_jitter:
                arrival = xp.where(self._jitters, self._at(self._arrivals, age - 1.0), arrival)
            arrives = (age >= 1.0) & (arrival < t + length_s)
            if not bool(arrives.any()):
                break
            until = xp.where(arrives, (arrival - t) / length_s, done)
            yield until - done, self._at(self._kept, age)
            done, age = until, xp.where(arrives, age - 1.0, age)
        yield 1.0 - done, self._at(self._kept, age)

    def _newest(self, times: Any) -> Any:
        """Return the ages of the newest commands that have arrived at times (n,), or of the oldest kept."""
        age = 0.0 * self._arrivals[0] + float(len(self._arrivals) - 1)
        for i in reversed(range(len(self._arrivals) - 1)):
            age = self._xp.where(self._arrivals[i] <= times, float(i), age)
        return age

    def _at(self, ring: list[Any], age: Any) -> Any:
        """Return the entries of some ages, (n,) or (4, n)."""
        value = ring[0]
        for i, older in enumerate(ring[1:], 1):
            value = self._xp.where(age >= float(i), older, value)
        return value
