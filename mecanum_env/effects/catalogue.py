"""The catalogue: all effects in the order of the chain, own ones included, and its table for the docs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any, Final

from mecanum_env.effects import body, command, drive, friction, load, motor, sensor
from mecanum_env.effects.definition import PLANTS, Effect, Parameter, PlantKind
from mecanum_env.errors import InputError
from mecanum_env.markdown import markdown_table
from mecanum_env.model.effect_names import EFFECT_PARAMETERS, add_to_schema, remove_from_schema

_EFFECTS: Final[dict[str, Effect]] = {}

CATALOGUE: Final[Mapping[str, Effect]] = MappingProxyType(_EFFECTS)
"""Name -> effect, in the order of the chain; a live view of what is known now."""


def register(effect: Effect, *, after: str | None = None) -> None:
    """Make an effect of one's own known to every program that runs in this process.

    Model files may hold it from then on, and simulator, gap search, certificates and `catalogue_table` know
    it. Call it where the effect is defined, at the top level of a module that worker processes import too.

    `after` names the effect behind which it acts; None puts it at the end of the chain.

    Raises:
        InputError: the name is taken, `after` is not known, or it has no parameters of different names.
    """
    names = tuple(parameter.name for parameter in effect.parameters)
    if not names or len(set(names)) < len(names):
        raise InputError(f"effect {effect.name}: needs parameters of different names, has {names}")
    add_to_schema(effect.name, names, after, effect.first_form)
    _fill({**_EFFECTS, effect.name: effect})


@contextmanager
def registered(effect: Effect, *, after: str | None = None) -> Iterator[None]:
    """Know an effect of one's own within a block only, for tests; `after` is as for `register`."""
    register(effect, after=after)
    try:
        yield
    finally:
        remove_from_schema(effect.name)
        del _EFFECTS[effect.name]


def _fill(effects: Mapping[str, Effect]) -> None:
    """Put effects into the catalogue in the order of the schema; both must name the same parameters."""
    defined = {name: tuple(p.name for p in effect.parameters) for name, effect in effects.items()}
    if defined != EFFECT_PARAMETERS:
        differing = sorted(set(defined.items()) ^ set(EFFECT_PARAMETERS.items()))
        raise ValueError(f"mecanum_env.model.effect_names and the definitions differ: {differing}")
    _EFFECTS.clear()
    _EFFECTS.update({name: effects[name] for name in EFFECT_PARAMETERS})


_FILES: Final = (command, drive, motor, load, friction, body, sensor)
_fill({effect.name: effect for file in _FILES for effect in file.EFFECTS})


def catalogue_table() -> str:
    """Return the catalogue as a table in Markdown, one row for each effect."""
    head = ["effect", "acts on", "parameters (unit; neutral; range)", "what it is", "in data", *PLANTS]
    return markdown_table(head, [_row(effect) for effect in CATALOGUE.values()])


def catalogue_json() -> dict[str, Any]:
    """Return the catalogue in JSON's types: what an effect is, by its name, with its parameters."""
    return {
        effect.name: {
            "acts_on": effect.acts_on,
            "summary": effect.summary,
            "signature": effect.signature,
            "plants": {plant: _plant(effect, plant) for plant in PLANTS},
            "parameters": {
                parameter.name: {
                    "unit": parameter.unit,
                    "neutral": parameter.neutral,
                    "default": parameter.default,
                    "bounds": list(parameter.bounds),
                }
                for parameter in effect.parameters
            },
        }
        for effect in CATALOGUE.values()
    }


def _row(effect: Effect) -> list[str]:
    parameters = "<br>".join(_parameter(parameter) for parameter in effect.parameters)
    plants = (_plant(effect, plant) for plant in PLANTS)
    return [f"`{effect.name}`", effect.acts_on, parameters, effect.summary, effect.signature, *plants]


def _parameter(parameter: Parameter) -> str:
    if isinstance(parameter.neutral, str):
        neutral = f"`{parameter.neutral}`"
    elif parameter.neutral is None:
        neutral = f"{parameter.default:g} if left out"
    else:
        neutral = f"{parameter.neutral:g}"
    low, high = parameter.bounds
    whole = "longest run" if parameter.unit == "s" else "drive"
    note = f" of the {whole}" if parameter.relative else ""
    return f"`{parameter.name}` ({parameter.unit}; {neutral}; {low:g} .. {high:g}{note})"


def _plant(effect: Effect, plant: PlantKind) -> str:
    if effect.acts_in(plant):
        return "yes"
    if not effect.simulated:
        return "not yet"
    return "nothing to act on" if plant in effect.absent_from else "refused"
