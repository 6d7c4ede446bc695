"""The catalogue as a table in Markdown, for the documentation."""

from __future__ import annotations

from mecanum_env.effects import CATALOGUE, PLANTS
from mecanum_env.effects.definition import Effect, Parameter, PlantKind


def markdown_table() -> str:
    """Return one row an effect, in the order of the chain."""
    head = ["effect", "acts on", "parameters (unit; neutral; range)", "what it is", "in data", *PLANTS]
    rows = [head, ["---"] * len(head), *(_row(effect) for effect in CATALOGUE.values())]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _row(effect: Effect) -> list[str]:
    parameters = "<br>".join(_parameter(parameter) for parameter in effect.parameters)
    plants = (_plant(effect, plant) for plant in PLANTS)
    return [f"`{effect.name}`", effect.acts_on, parameters, effect.summary, effect.signature, *plants]


def _parameter(parameter: Parameter) -> str:
    if isinstance(parameter.neutral, str):
        neutral = f"`{parameter.neutral}`"
    else:
        neutral = (
            f"{parameter.default:g} if left out" if parameter.neutral is None else f"{parameter.neutral:g}"
        )
    low, high = parameter.bounds
    note = "" if parameter.simulated else "; not yet"
    return f"`{parameter.name}` ({parameter.unit}; {neutral}; {low:g} .. {high:g}{note})"


def _plant(effect: Effect, plant: PlantKind) -> str:
    if effect.acts_in(plant):
        return "yes"
    if not effect.simulated:
        return "not yet"
    return "nothing to act on" if plant in effect.absent_from else "refused"
