"""What a change of a model does where something else moves the robot, too.

What is uncertain about a model is found in the logs of its fit. In other logs an effect may move the robot in
another way: behind a limit it never reaches the speeds that were commanded, and an error of the gains then
matters less. So what the model may err by is simulated beside the effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray

Simulate = Callable[[Model], list[FloatArray]]


def beside(variant: Model, base: Model, at: Model) -> Model | None:
    """Return a variant of a base model with those effects in which the model `at` differs from the base.

    Returns None if the variant changes one of the same causes: which of the two values holds, is not said.
    """
    causes = {cause_of(name) for name in {*at.effects, *base.effects} if _differs(name, at, base)}
    if any(cause_of(name) in causes and _differs(name, variant, base) for name in variant.effects):
        return None
    kept = {name: values for name, values in variant.effects.items() if cause_of(name) not in causes}
    own = {name: values for name, values in at.effects.items() if cause_of(name) in causes}
    return replace(variant, effects=kept | own)


def change(simulate: Simulate, variant: Model, base: Model, at: Model) -> list[FloatArray]:
    """Return what a variant of a base model predicts beyond it, for each block, beside what `at` adds to it.

    That is without what `at` adds, if the variant changes the same cause. What cannot be simulated changes
    nothing.
    """
    together = beside(variant, base, at)
    changed, unchanged = (variant, base) if together is None else (together, at)
    before = simulate(unchanged)
    try:
        after = simulate(changed)
    except (MecanumError, ValueError):
        after = before
    return [a - b for a, b in zip(after, before, strict=True)]


def _differs(name: str, one: Model, other: Model) -> bool:
    return one.effects.get(name) != other.effects.get(name)
