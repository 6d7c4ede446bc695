"""What a certificate varies besides the robot: opponents and senses, and what no training has seen.

| group | rows |
|---|---|
| `opponents` | opponents drawn from the ranges of people, and each other form of the lead |
| `senses` | usual senses, and worse ones drawn for each episode, with an estimator behind both |
| `adversary` | an opponent searched against the controller (`adversary`) |
| `held-out` | robots and opponents outside what `training.train` trains on |

The distribution of `senses` is that of `training.train --senses varied`, and `--opponents varied` trains on
the ranges of `opponents`, with warnings from 0.3 to 1 s. Every held-out opponent has a number outside these
ranges, and the held-out robots have effects that no robot of `--randomize levels` or `varied` has.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from mecanum_env.effects.apply import delayed
from mecanum_env.model import Model
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import Opponent, Opponents
from mecanum_env.tankendo.constants import LEAD_FORMS
from training.certify.plants import ADVERSARY, HELD_OUT, RobotVariant, robot_variants

_QUICK_WARNING_S: Final = (0.34, 0.40)
_SLOW_WARNING_S: Final = (0.75, 0.90)
_LONG_REACH_M: Final = 0.12
_FAST_SWING: Final = 0.8
"""Time of a swing relative to the usual one's."""


def certificate_variants(
    model: Model, physics: RobotPlant = "planar", opponent: Opponent | None = None
) -> tuple[RobotVariant, ...]:
    """Return all that a certificate plays: robots, opponents around `opponent`, senses, and what is held out.

    Variants run on the given physics, except on rollers if the planar plant refuses one of their effects.
    """
    base = Opponent() if opponent is None else opponent
    return (
        *robot_variants(model, physics),
        *opponent_variants(model, physics, base),
        *sense_variants(model, physics),
        RobotVariant(ADVERSARY, ADVERSARY, "an opponent searched against the controller", model, physics),
        *held_out_variants(model, physics, base),
    )


def opponent_variants(model: Model, physics: RobotPlant, base: Opponent) -> list[RobotVariant]:
    """Return the variants of the opponent `base`, against a model's robot on the given physics."""
    about = "opponents drawn for each episode from the ranges of people"
    found = [RobotVariant("opponents-varied", "opponents", about, model, physics, opponent=Opponents(base))]
    for form in LEAD_FORMS:
        if form != base.lead_form:
            name, about = f"lead-{form.replace('_', '-')}", f"an opponent whose lead has the form {form}"
            opponent = replace(base, lead_form=form)
            found.append(RobotVariant(name, "opponents", about, model, physics, opponent=opponent))
    return found


def sense_variants(model: Model, physics: RobotPlant) -> list[RobotVariant]:
    """Return the variants of the senses, of a model's robot on the given physics."""
    usual = "frames of a camera, some of them lost, and an estimator"
    worse = "worse senses, drawn for each episode"
    return [
        RobotVariant("senses-usual", "senses", usual, model, physics, senses=Senses()),
        RobotVariant("senses-varied", "senses", worse, model, physics, senses=VariedSenses()),
    ]


def held_out_variants(model: Model, physics: RobotPlant, base: Opponent) -> list[RobotVariant]:
    """Return what no training saw around a model and the opponent `base`, on the given physics."""
    tired = delayed(model, 0.07).with_effect("speed_gain", gain=0.9)
    heavy = model.with_effect("acceleration_limit", limit_rpm_s=500.0).with_effect(
        "direction_asymmetry", reverse_ratio=0.92
    )
    quick = replace(base, warning_s=_QUICK_WARNING_S, sight_delay_s=0.16, patience_s=(0.1, 0.4))
    slow = replace(base, warning_s=_SLOW_WARNING_S, sight_delay_s=0.28, feint_probability=0.6)
    long = replace(
        base,
        extra_reach_m=_LONG_REACH_M,
        sight_delay_s=0.13,
        techniques=tuple(replace(one, swing_s=_FAST_SWING * one.swing_s) for one in base.techniques),
    )
    robots = {
        "late-and-slow": ("commands act 0.07 s later, speeds are 0.9", tired),
        "sluggish": ("accelerations up to 500 rpm/s, reverse 0.92", heavy),
    }
    opponents = {
        "quick": ("0.34 to 0.40 s of warning, little patience", quick),
        "deliberate": ("0.75 to 0.90 s of warning, many feints", slow),
        "long-armed": ("reaches 0.12 m farther, sees and swings faster than people do", long),
    }
    return [
        *(RobotVariant(name, HELD_OUT, about, robot, physics) for name, (about, robot) in robots.items()),
        *(
            RobotVariant(name, HELD_OUT, about, model, physics, opponent=opponent)
            for name, (about, opponent) in opponents.items()
        ),
    ]
