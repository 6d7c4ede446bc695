"""Programs of a custom effect: a formula or a table as a row of numbers that runs in the drive's inner loop.

A program is a list of instructions for a stack of numbers: each pushes a number or an input, or takes one or
two numbers off the stack and pushes the result. What is left at the end is the value. The plugin runs the
same numbers (mecanum_env/plugin/program.c); the tests hold both equal bit for bit. An operation without a
finite result (a division by zero, an overflow, a root of a negative number) makes the value of the whole
program 0.

`mecanum_env.wheel_drive.formula` makes programs of formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray

Program: TypeAlias = tuple[float, ...]
"""Instructions, each an operation followed by its own numbers; an empty program changes nothing."""

INPUTS: Final = ("command", "speed", "angle", "time", "voltage")
"""Inputs of a program: command [rpm], speed of the wheel [rpm], its angle [rad], time since the start [s],
and how far the supply is below its voltage at the start [V]."""
UNITS: Final[Mapping[str, str]] = dict(zip(INPUTS, ("rpm", "rpm", "rad", "s", "v"), strict=True))
PROGRAM_SIZE: Final = 48
"""Most numbers of a program, as `program.h` has it."""
STACK_SIZE: Final = 16
"""Most numbers on the stack, as `program.h` has it."""
LARGEST_TABLE: Final = 16
"""Most knots of a table."""

# The operations in the order of program.h; 0 ends a program.
_NAMES: Final = (
    *("end", "number", *INPUTS, "table"),
    *("negative", "abs", "sign", "sin", "cos", "exp"),
    *("+", "-", "*", "/", "**", "min", "max"),
)
CODES: Final[Mapping[str, float]] = {name: float(code) for code, name in enumerate(_NAMES)}
"""Operation -> its number in a program."""
ONE_NUMBER: Final = ("negative", "abs", "sign", "sin", "cos", "exp")
"""Operations on one number."""
TWO_NUMBERS: Final = ("+", "-", "*", "/", "**", "min", "max")
"""Operations on two numbers."""


def _each(function: Callable[..., float]) -> Callable[..., FloatArray]:
    """Return a function of arrays that calls the C library's for each number, as the plugin does."""

    def guarded(*numbers: float) -> float:
        try:
            return function(*numbers)
        except (ValueError, OverflowError):
            return math.nan

    def over(*arrays: FloatArray) -> FloatArray:
        # numpy's own functions may differ in the last bit, since they compute several numbers at once.
        vectorised = np.frompyfunc(guarded, len(arrays), 1)
        return np.asarray(vectorised(*arrays), float)

    return over


_ON_ARRAYS: Final[Mapping[str, Callable[..., npt.ArrayLike]]] = {
    "negative": np.negative,
    "abs": np.abs,
    "sign": lambda a: (a > 0.0).astype(float) - (a < 0.0),
    "sin": _each(math.sin),
    "cos": _each(math.cos),
    "exp": _each(math.exp),
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": _each(math.pow),
    "min": lambda a, b: np.where(a < b, a, b),
    "max": lambda a, b: np.where(a > b, a, b),
}


def table_program(name: str, knots: Sequence[float], values: Sequence[float]) -> Program:
    """Return the program of a table over the input `name`: linear between its knots, held outside.

    `knots` (in the input's unit) and `values` [rpm] are of one length.
    """
    return (CODES[name], CODES["table"], float(len(knots)), *knots, *values)


def joined(programs: Sequence[Program]) -> Program:
    """Return the program of the sum of `programs`."""
    total: Program = ()
    for program in programs:
        total = (*total, *program, CODES["+"]) if total else program
    return total


def inputs_of(program: Program) -> frozenset[str]:
    """Return the inputs that a program uses."""
    return frozenset(name for name, _ in _instructions(program) if name in INPUTS)


def evaluate(program: Program, inputs: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the value of a program [rpm], of the shape to which its inputs broadcast.

    `inputs` are numbers or arrays by name, in the units of `UNITS`; those that are absent are 0. The value is
    0 where an operation has no finite result.

    Raises:
        InputError: the program is not one that `mecanum_env.wheel_drive.formula` makes.
    """
    given = dict(zip(INPUTS, np.broadcast_arrays(*(inputs.get(name, 0.0) for name in INPUTS)), strict=True))
    stack: list[FloatArray] = []
    finite = np.ones(given["time"].shape, bool)
    with np.errstate(all="ignore"):
        for name, numbers in _instructions(program):
            if name == "number":
                result = np.full(finite.shape, numbers[0])
            elif name in INPUTS:
                result = np.asarray(given[name], float)
            elif name == "table":
                half = len(numbers) // 2
                result = _interpolated(stack.pop(), np.array(numbers[:half]), np.array(numbers[half:]))
            elif name in ONE_NUMBER:
                result = np.asarray(_ON_ARRAYS[name](stack.pop()), float)
            else:
                second, first = stack.pop(), stack.pop()
                result = np.asarray(_ON_ARRAYS[name](first, second), float)
            finite &= np.isfinite(result)
            stack.append(result)
    return np.where(finite, stack[-1], 0.0) if stack else np.zeros(finite.shape)


def evaluate_sets(programs: npt.ArrayLike, inputs: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the values [rpm] of one program for all sets, or of one for each, shape (sets, ...).

    `programs` are one or (sets, n) padded with 0; `inputs` are as for `evaluate`, with the sets first if
    there is a program for each.
    """
    rows = np.asarray(programs, float)
    if rows.ndim < 2:
        return evaluate(tuple(rows.tolist()), inputs)
    names = list(inputs)
    shaped = np.broadcast_arrays(*inputs.values(), np.zeros((len(rows), 1)))
    of_set = [dict(zip(names, arrays, strict=False)) for arrays in zip(*shaped, strict=True)]
    return np.stack([evaluate(tuple(row.tolist()), given) for row, given in zip(rows, of_set, strict=True)])


def _interpolated(x: FloatArray, knots: FloatArray, values: FloatArray) -> FloatArray:
    # Spelt out rather than np.interp, whose last bit is its own.
    i = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, knots.size - 2)
    part = (x - knots[i]) / (knots[i + 1] - knots[i])
    inside = values[i] + (values[i + 1] - values[i]) * part
    return np.where(x >= knots[-1], values[-1], np.where(x > knots[0], inside, values[0]))


def require_runs(program: Program) -> None:
    """Refuse a program that the drive cannot run.

    Raises:
        InputError: it is too long, takes too many places on the stack, or is no program at all.
    """
    if len(program) > PROGRAM_SIZE:
        raise InputError(f"too long, it takes {len(program)} instructions of at most {PROGRAM_SIZE}")
    depth = deepest = 0
    for name, _ in _instructions(program):
        depth += 1 - _taken(name)
        deepest = max(deepest, depth)
    if deepest > STACK_SIZE:
        raise InputError(
            f"too long, {deepest} of its values wait for each other, at most {STACK_SIZE} may; write its "
            "longest part first"
        )


def _instructions(program: Program) -> list[tuple[str, Program]]:
    """Return the operations of a program, each with its own numbers, down to its end."""
    found: list[tuple[str, Program]] = []
    at = depth = 0
    while at < len(program) and program[at] != CODES["end"]:
        name = _NAMES[_whole(program, at, len(_NAMES) - 1)]
        own = 1 if name == "number" else 0
        if name == "table":
            own = 1 + 2 * _whole(program, at + 1, LARGEST_TABLE)
        numbers = program[at + 1 : at + 1 + own]
        if len(numbers) < own or depth < _taken(name) or (name == "table" and own < 5):
            raise InputError(f"{list(program)} is no program: {name} cannot stand at {at}")
        depth += 1 - _taken(name)
        found.append((name, numbers[1:] if name == "table" else numbers))
        at += 1 + own
    if depth > 1:
        raise InputError(f"{list(program)} is no program: it ends with {depth} values")
    return found


def _taken(name: str) -> int:
    """Return how many numbers an operation takes off the stack."""
    return 2 if name in TWO_NUMBERS else 1 if name in (*ONE_NUMBER, "table") else 0


def _whole(program: Program, at: int, largest: int) -> int:
    number = program[at] if at < len(program) else math.nan
    if not (0.0 <= number <= largest and number == math.floor(number)):
        raise InputError(f"{list(program)} is no program: no instruction at {at}")
    return int(number)
