"""A plain drive with numbers that a test can compute with, and outcomes of cases that nobody ran."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.drives.drive import Controller, Drive, Gear, Link, Motor, Sensor
from sysid.studies.zoo.drives.simulate import move
from sysid.studies.zoo.outcome import Outcome

RPM = 60.0 / (2.0 * math.pi)


@pytest.fixture
def motor():
    return Motor(resistance_ohm=1.0, inductance_h=5e-4, back_emf_v_s=0.5, inertia_kg_m2=3e-3, supply_v=24.0)


@pytest.fixture
def drive(motor):
    """A P loop of 1 kHz on a tachometer, no friction: the wheel follows k + kp of stiffness."""
    return Drive(
        motor=motor,
        gear=Gear(wheel_inertia_kg_m2=1e-3),
        controller=Controller("p", loop_hz=1000.0, kp=0.5, feed_forward=0.5),
        sensor=Sensor(sample_s=0.01),
        link=Link(period_s=0.1),
    )


@pytest.fixture
def last_rpm():
    """Return a function: the wheel's true mean speed in the last 0.2 s of a command held for `seconds`."""

    def run(drive, command_rpm, seconds=3.0, **options):
        commands = np.full(round(seconds / drive.link.period_s), command_rpm)
        motion = move(drive, commands, np.random.default_rng(3), **options)
        return motion.wheel_rad_s[motion.time_s > seconds - 0.2].mean() * RPM

    return run


MakeOutcome = Callable[..., Outcome]


@pytest.fixture
def outcome() -> MakeOutcome:
    """Return a function that makes an outcome: what was hidden, the kind, and what was said.

    `said` is a verdict, a set of names joined by " + ", or several of them joined by " | ". Other fields of
    the case or the outcome may be given by their names.
    """

    def make(hidden: str = "", said: str = "no_gap", kind: str = "", **given: Any) -> Outcome:
        names = tuple(hidden.split(" + ")) if hidden else ()
        of_case = {key: given.pop(key) for key in list(given) if key in Case.__dataclass_fields__}
        known = {
            "seed": 1,
            "level": "bench",
            "kind": kind or {0: "quiet", 1: "single", 2: "pair", 3: "triple"}[len(names)],
            "family": "pi",
            "plan": "steps",
            "layout": "standard",
            "hidden": tuple(Hidden(name, "fixed", {"size": 2.0}) for name in names),
            "signal": 3.0 if hidden or kind else 0.0,
        }
        case = Case(**(known | of_case))
        if said in ("no_gap", "unexplained", "error"):
            return Outcome(case, said, **given)
        sets = tuple(tuple(names.split(" + ")) for names in said.split(" | "))
        verdict = "named" if len(sets) == 1 else "ambiguous"
        return Outcome(case, verdict, sets[0], sets, **({"p_value": 1e-4} | given))

    return make
