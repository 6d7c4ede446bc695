"""The same formulas for one episode and for many: floats of one, arrays (n,) of many.

numpy takes a microsecond to add two arrays of length one, Python a twentieth of that to add two floats. The
state of episodes is arrays whose last axis is the episode, however many there are. What happens in every step
is computed with numbers that are taken `of` the state, and written with the functions of `One` or `Many`.
Both round alike, so that a single episode equals a row of many bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

Number = Any
"""A float, an int or a bool of one episode, or an array (n,) of many."""
State = npt.NDArray[Any]
"""Numbers of all episodes, shape (..., n)."""


class Many:
    """The numbers of n episodes: arrays (n,), by numpy."""

    cos: ClassVar[Any] = np.cos
    sin: ClassVar[Any] = np.sin
    arctan2: ClassVar[Any] = np.arctan2
    sqrt: ClassVar[Any] = np.sqrt
    rint: ClassVar[Any] = np.rint
    minimum: ClassVar[Any] = np.minimum
    maximum: ClassVar[Any] = np.maximum
    no: ClassVar[Any] = np.logical_not
    where: ClassVar[Any] = staticmethod(np.where)

    def __init__(self, n: int) -> None:
        self._n, self._all = n, np.arange(n)

    def of(self, state: State) -> Any:
        """Return the numbers of a state."""
        return state

    def array(self, number: Number) -> State:
        """Return a number as an array, shape (n,)."""
        return np.asarray(number)

    def table(self, numbers: Sequence[Number]) -> FloatArray:
        """Return k numbers as an array, shape (k, n)."""
        rows = np.empty((len(numbers), self._n))
        self.put(rows, numbers)
        return rows

    def put(self, state: State, numbers: Number | Sequence[Number]) -> None:
        """Write a number into a state (n,), or k numbers into a state (k, n)."""
        if state.ndim == 1:
            state[:] = numbers
            return
        for row, number in zip(state, numbers, strict=True):
            row[:] = number

    def chosen(self, state: State, index: Number) -> Number:
        """Return the number of each episode at an index of its own in a state (k, n)."""
        # Flat, in the order in which draws lie in memory: two indices take three times as long.
        return state.T.reshape(-1)[self._all * len(state) + index]

    def between(self, first: State, second: State, share: Number) -> Any:
        """Return the numbers that lie a share of the way from one state (k, n) to another."""
        return first + share * (second - first)

    def any(self, where: Number) -> bool:
        """Return whether there is any episode `where` something holds."""
        return bool(np.count_nonzero(where))

    def nowhere(self) -> Number:
        """Return False."""
        return np.zeros(self._n, bool)

    def marked(self, rows: npt.NDArray[np.intp], values: npt.NDArray[np.bool_]) -> Number:
        """Return the bools `values` (m,) in some rows (m,) and False elsewhere."""
        marks = np.zeros(self._n, bool)
        marks[rows] = values
        return marks


class One:
    """The numbers of a single episode: Python's own. What is not said here is as in `Many`."""

    minimum: ClassVar[Any] = min
    maximum: ClassVar[Any] = max
    sqrt: ClassVar[Any] = math.sqrt

    # By numpy, since its functions may round otherwise than those of `math`.
    def cos(self, number: Number) -> Number:
        """Return the cosine of a number [rad]."""
        return float(np.cos(number))

    def sin(self, number: Number) -> Number:
        """Return the sine of a number [rad]."""
        return float(np.sin(number))

    def arctan2(self, y: Number, x: Number) -> Number:
        """Return the angle of the vector (x, y) [rad]."""
        return float(np.arctan2(y, x))

    def rint(self, number: Number) -> Number:
        """Return the nearest whole number, as a float."""
        return float(round(number))

    def where(self, where: Number, one: Number, other: Number) -> Number:
        """Return `one` number if the bool `where` holds, or else the other."""
        return one if where else other

    def no(self, where: Number) -> Number:
        """Return the opposite of the bool `where`."""
        return not where

    def of(self, state: State) -> Any:
        """Return the numbers of a state, nested lists of them if it has more than one axis."""
        if state.ndim == 1:
            return state.item()
        # In half of the time that an index with an ellipsis takes.
        return state[:, 0].tolist() if state.ndim == 2 else state[..., 0].tolist()

    def array(self, number: Number) -> State:
        """Return a number as an array, shape (1,)."""
        return np.array([number])

    def table(self, numbers: Sequence[Number]) -> FloatArray:
        """Return k numbers as an array, shape (k, 1)."""
        return np.array(numbers, float)[:, None]

    def put(self, state: State, numbers: Number | Sequence[Number]) -> None:
        """Write a number into a state (1,), or k numbers into a state (k, 1)."""
        # One item, since a slice takes three times as long.
        if state.ndim == 1:
            state[0] = numbers
        else:
            state[:, 0] = numbers

    def chosen(self, state: State, index: Number) -> Number:
        """Return the number at an index of a state (k, 1)."""
        return state.item(index, 0)

    def between(self, first: State, second: State, share: Number) -> Any:
        """Return the numbers that lie a share of the way from one state (k, 1) to another."""
        return self.of(first + share * (second - first))

    def any(self, where: Number) -> bool:
        """Return the bool `where` itself."""
        return bool(where)

    def nowhere(self) -> Number:
        """Return False."""
        return False

    def marked(self, rows: npt.NDArray[np.intp], values: npt.NDArray[np.bool_]) -> Number:
        """Return the bool in `values`, or False where the row is not in `rows`."""
        return bool(len(rows) and values[0])


Mathematics = One | Many


def mathematics(n: int) -> Mathematics:
    """Return how to compute with the numbers of n episodes."""
    return One() if n == 1 else Many(n)


def wrapped(angle_rad: Number) -> Number:
    """Return an angle within [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi
