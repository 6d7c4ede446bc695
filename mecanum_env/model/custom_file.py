"""The "custom" section of a model file: custom effects to JSON and back."""

from __future__ import annotations

from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model.custom import CustomEffect, CustomTable
from mecanum_env.model.json_checks import mapping, number

_FIELDS: Final = ("station", "formula", "table", "unit", "source", "range")
_TABLE_FIELDS: Final = ("input", "knots", "values")


def custom_to_json(effects: tuple[CustomEffect, ...]) -> list[dict[str, Any]]:
    """Return the list of custom effects as a model file has it."""
    return [_to_json(effect) for effect in effects]


def custom_from_json(value: Any) -> tuple[CustomEffect, ...]:
    """Return the custom effects in the "custom" section of a model file, a list of objects.

    Raises:
        InputError: it is something else, or an effect that cannot be simulated; the message says which.
    """
    if not isinstance(value, list):
        raise InputError(
            f"custom must be a list of objects with station and formula, not {type(value).__name__}"
        )
    effects = []
    for index, section in enumerate(value):
        where = f"custom[{index}]"
        try:
            effects.append(_from_json(where, section))
        except InputError as error:
            text = str(error)
            raise InputError(text if text.startswith(where) else f"{where}: {text}") from error
    return tuple(effects)


def _to_json(effect: CustomEffect) -> dict[str, Any]:
    value: dict[str, Any] = {"station": effect.station}
    if effect.table is None:
        value["formula"] = effect.formula
    else:
        table = effect.table
        value["table"] = {"input": table.input, "knots": list(table.knots), "values": list(table.values)}
    value["unit"] = effect.unit
    if effect.source:
        value["source"] = effect.source
    if effect.range:
        value["range"] = {name: list(ends) for name, ends in effect.range.items()}
    return value


def _from_json(where: str, value: Any) -> CustomEffect:
    section = mapping(where, value)
    _require_known(where, section, _FIELDS)
    texts = {name: section[name] for name in ("station", "formula", "unit", "source") if name in section}
    for name, text in texts.items():
        if not isinstance(text, str):
            raise InputError(f"{where}.{name} must be text, not {type(text).__name__}")
    if "station" not in texts:
        raise InputError(f"{where}.station is missing")
    table, ends = None, {}
    if "table" in section:
        table = _table(f"{where}.table", section["table"])
    for name, pair in mapping(f"{where}.range", section.get("range", {})).items():
        low_high = _numbers(f"{where}.range.{name}", pair)
        if len(low_high) != 2:
            raise InputError(f"{where}.range.{name} must be two numbers, the lower first")
        ends[name] = (low_high[0], low_high[1])
    return CustomEffect(table=table, range=ends, **texts)


def _table(where: str, value: Any) -> CustomTable:
    section = mapping(where, value)
    _require_known(where, section, _TABLE_FIELDS)
    for name in _TABLE_FIELDS:
        if name not in section:
            raise InputError(f"{where}.{name} is missing")
    return CustomTable(
        section["input"],
        _numbers(f"{where}.knots", section["knots"]),
        _numbers(f"{where}.values", section["values"]),
    )


def _numbers(where: str, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list):
        raise InputError(f"{where} must be a list of numbers, not {type(value).__name__}")
    return tuple(number(f"{where}[{index}]", item) for index, item in enumerate(value))


def _require_known(where: str, section: Any, known: tuple[str, ...]) -> None:
    for name in section:
        if name not in known:
            raise InputError(
                f"{where}.{name}: unknown name{did_you_mean(name, known)}; known: {', '.join(known)}"
            )
