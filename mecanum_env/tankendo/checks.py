"""Checks of the numbers that a user may put into the task's constants."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import fields
from numbers import Real
from typing import TYPE_CHECKING, Any

from mecanum_env.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def require_number(
    where: str, value: Any, low: float = -math.inf, high: float = math.inf, *, strict: bool = False
) -> None:
    """Raise `InputError` unless `value` is a finite number from `low` (`strict`: above it) to `high`.

    Args:
        where: its name in the message.
        value: whatever was given.
        low: the least that it may be.
        high: the most that it may be.
        strict: `low` itself is refused.
    """
    sound = isinstance(value, Real) and math.isfinite(value) and low <= float(value) <= high
    if sound and not (strict and value == low):
        return
    if high < math.inf:
        what = f"a number {low:g} .. {high:g}"
    else:
        bound = "" if low == -math.inf else f" above {low:g}" if strict else f", at least {low:g}"
        what = f"a finite number{bound}"
    raise InputError(f"{where} = {value!r}, must be {what}")


def require_numbers(
    constants: DataclassInstance,
    *,
    positive: Collection[str] = (),
    signed: Collection[str] = (),
    shares: Collection[str] = (),
) -> None:
    """Raise `InputError` unless all numbers and ranges of some constants are finite and not below 0.

    Args:
        constants: fields that are neither numbers nor ranges (low, high) are left alone.
        positive: names of fields that must be above 0.
        signed: of fields that may be below 0.
        shares: of fields that may not be above 1.
    """
    for field in fields(constants):
        where, value = f"{type(constants).__name__}.{field.name}", getattr(constants, field.name)
        low = -math.inf if field.name in signed else 0.0
        high = 1.0 if field.name in shares else math.inf
        if field.type in ("float", "int"):
            require_number(where, value, low, high, strict=field.name in positive)
        if field.type == "int" and value != int(value):
            raise InputError(f"{where} = {value!r}, must be a whole number")
        if field.type == "tuple[float, float]":
            _require_range(where, value, low, high)


def _require_range(where: str, value: Any, low: float, high: float) -> None:
    try:
        first, last = value
    except (TypeError, ValueError) as error:
        raise InputError(f"{where} = {value!r}, must be two numbers: low, high") from error
    require_number(f"{where}[0]", first, low, high)
    require_number(f"{where}[1]", last, low, high)
    if first > last:
        raise InputError(f"{where} = {value!r}, must have the lower one first")
