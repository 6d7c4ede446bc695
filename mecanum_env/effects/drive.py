"""Effects on the setpoint of each wheel: gains, supply, limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import Effect, Parameter, Values, usual_ceiling_rpm
from mecanum_env.effects.scale import Scale
from mecanum_env.kinematics import WHEELS
from mecanum_env.model.static_map import MAP, map_parameters, map_points
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.set_point import MAP_KNOTS, MAP_PARAMETERS

POSITIVE: Final = (1e-6, math.inf)
LIMITS_RPM: Final = (40, 60, 80, 100, 120, 150)
RATES_RPM_S: Final = (100, 200, 400, 800, 1600, 3200)
_RATES: Final = (50.0, 5000.0)
LIMIT: Final = Parameter("limit_rpm_s", "rpm/s", math.inf, _RATES, POSITIVE, scan=RATES_RPM_S)
"""Limit of a speed that grows in size."""
BRAKE: Final = Parameter("brake_rpm_s", "rpm/s", None, _RATES, multiples=(0.5, 2.0))
"""Limit of a speed that falls in size; 0: that of one that grows."""
PER_VOLT: Final = (0.0, 0.5)
"""Range of the shares that are lost with a volt [1/V]."""
_ANY: Final = (-math.inf, math.inf)
_JERKS_RPM_S2: Final = (500, 1500, 5000, 15_000, 50_000)
_WARMING: Final = Parameter(
    "time_constant_s", "s", None, (0.5, 600.0), POSITIVE, default=60.0, scan=(1, 3, 10, 30, 100, 300)
)
FADING: Final = Parameter(
    "time_constant_s", "s", None, (0.03, 1.0), POSITIVE, default=1.0, scan=(0.05, 0.15, 0.5), relative=True
)
"""Time constant of what is there at the start only: what takes longer than a run looks as if it stayed."""
_COLD_AND_WARM: Final = "the speed at one command in a cold and in a warm drive"

_CURVE: Final = MAP_PARAMETERS[MAP_KNOTS : MAP_KNOTS + 5]
"""Values that a search fits: five knots show a curve with two bends, whatever the commands."""


def _straight(scale: Scale) -> dict[str, float]:
    """Return the map that changes nothing, with knots at even distances up to the top speed, both ways."""
    knots = [scale.top_rpm * (i + 1) / len(_CURVE) for i in range(len(_CURVE))]
    return map_parameters(knots, knots)


def _static_map(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    knots, mapped = map_points(values)
    return replace(drive, knots_rpm=knots, values_rpm=mapped)


def _starts_cold(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    """Return a drive whose gain begins at 1 - share of its own, and returns to it.

    1 - share exp(-t / T) = (1 - share) (1 - s (1 - exp(-t / T))) with s = -share / (1 - share): a smaller
    gain that rises as it warms up, which the plugin has.
    """
    left = 1.0 - values["share"]
    return replace(
        drive,
        gain=drive.gain * left,
        warm_up_share=-values["share"] / left,
        warm_up_s=values["time_constant_s"],
    )


EFFECTS: Final = (
    Effect(
        name="speed_gain",
        station="set_point",
        acts_on="drive",
        exact=True,
        parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5), POSITIVE),),
        summary="Every wheel command is multiplied by this.",
        signature="A loss or surplus in proportion to speed, alike in every direction, also in wheel speeds.",
        direct_check="a wheel's true speed, with a tachometer or by counting its turns",
        realistic=lambda _: {"gain": 0.9},
        bench_twins=("sensor_scale",),
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, gain=drive.gain * values["gain"]),
    ),
    Effect(
        name="wheel_gain_mismatch",
        station="set_point",
        acts_on="drive",
        exact=True,
        parameters=tuple(Parameter(f"gain_{wheel}", "1", 1.0, (0.5, 1.5), POSITIVE) for wheel in WHEELS),
        summary="Each wheel's command is multiplied by its own factor.",
        signature="One wheel's speed is off in proportion; the robot's path bends.",
        direct_check="each wheel's true speed, with a tachometer",
        realistic=lambda _: {"gain_fl": 0.92, "gain_rr": 1.05},
        undone_by="command",
        change_drive=lambda drive, values, wheel: (
            drive if wheel is None else replace(drive, gain=drive.gain * values[f"gain_{wheel}"])
        ),
    ),
    Effect(
        name="direction_asymmetry",
        station="set_point",
        acts_on="drive",
        exact=True,
        parameters=(Parameter("reverse_ratio", "1", 1.0, (0.5, 1.5), POSITIVE),),
        summary="Negative wheel commands are multiplied by this.",
        signature="An error in proportion to speed in reverse only; turning on the spot drifts.",
        direct_check="a wheel's true speed both ways, with a tachometer",
        realistic=lambda _: {"reverse_ratio": 0.9},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, reverse_ratio=values["reverse_ratio"]),
    ),
    Effect(
        name="battery_sag",
        first_form="time",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("drop_per_s", "1/s", 0.0, (0.0, 0.08)),
            Parameter("per_volt", "1/V", 0.0, PER_VOLT, searched=False),
        ),
        summary="The drives' gain falls with time; `per_volt` is that of the form `voltage`.",
        signature="The same command gives less and less speed during a run.",
        direct_check="the battery's voltage, logged as battery_v",
        realistic=lambda _: {"drop_per_s": 0.01},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive, drop_per_s=values["drop_per_s"], gain_per_volt=values["per_volt"]
        ),
    ),
    Effect(
        name="battery_sag/voltage",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("per_volt", "1/V", 0.0, PER_VOLT),),
        summary="The drives' gain loses this share with each volt of `battery_v` below its first sample.",
        signature="The same command gives less speed where the logged voltage is lower.",
        direct_check="the speed at one command with a full and with an empty battery",
        reads=("battery_v",),
        change_drive=lambda drive, values, _: replace(drive, gain_per_volt=values["per_volt"]),
    ),
    Effect(
        name="warm_up",
        first_form="gain",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("share", "1", 0.0, (-0.8, 0.8), (-0.99, 0.99)),
            _WARMING,
        ),
        summary="As the drives warm up, their gain loses this share, most of it within the time constant; "
        "below 0 it rises.",
        signature="The same command gives less and less speed from the start of a run on, "
        "and after some time the same lower one.",
        direct_check=_COLD_AND_WARM,
        realistic=lambda _: {"share": 0.1, "time_constant_s": 30.0},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive, warm_up_share=values["share"], warm_up_s=values["time_constant_s"]
        ),
    ),
    Effect(
        name="warm_up/cold",
        station="set_point",
        acts_on="drive",
        parameters=(
            # A drive that starts with half of its gain doubles it, the most that `warm_up_share` allows.
            Parameter("share", "1", 0.0, (-0.8, 0.45), (-0.99, 0.495)),
            FADING,
        ),
        summary="A drive whose model is that of a warm one starts cold: its gain lacks this share at the "
        "start, and is the model's when it is warm; below 0 it begins above it.",
        signature="The speed at one command is off at the start of a run only, and right some time later.",
        direct_check=_COLD_AND_WARM,
        undone_by="command",
        change_drive=_starts_cold,
    ),
    Effect(
        name=MAP,
        first_form="curve",
        station="set_point",
        acts_on="drive",
        parameters=tuple(
            Parameter(name, "rpm", 0.0, (-150.0, 150.0), _ANY, searched=name in _CURVE)
            for name in MAP_PARAMETERS
        ),
        summary="Each wheel's command follows a curve through up to 6 knots, linear in between; "
        "in a file these are the lists `knots_rpm` and `values_rpm`.",
        signature="An error that depends on the command alone, but unlike a gain, a dead band or a limit.",
        direct_check="the settled speed at many commands, both ways",
        realistic=lambda model: map_parameters(
            [share * usual_ceiling_rpm(model) for share in (0.1, 0.3, 0.8)],
            [share * usual_ceiling_rpm(model) for share in (0.04, 0.25, 0.8)],
        ),
        search_from=_straight,
        undone_by="command",
        change_drive=_static_map,
    ),
    Effect(
        name="speed_saturation",
        first_form="clip",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("limit_rpm", "rpm", "wheel.saturation_rpm", (10.0, 200.0), POSITIVE, scan=LIMITS_RPM),
            Parameter("softness_rpm", "rpm", 0.0, (0.0, 100.0)),
        ),
        summary="Each wheel's command is clipped; a soft knee begins this far below the limit.",
        signature="An error at high speed only, wheel by wheel, so that the direction of motion changes.",
        direct_check="the motor's voltage at full speed",
        realistic=lambda model: {"limit_rpm": 0.8 * usual_ceiling_rpm(model), "softness_rpm": 20.0},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive, saturation_rpm=values["limit_rpm"], softness_rpm=values["softness_rpm"]
        ),
    ),
    Effect(
        name="acceleration_limit",
        first_form="set_point",
        station="set_point",
        acts_on="drive",
        parameters=(
            LIMIT,
            BRAKE,
        ),
        summary="Each wheel's command changes no faster than this, "
        "or than `brake_rpm_s` while it falls in size.",
        signature="Ramps instead of steps, longer for larger steps; the speeds reached are unchanged.",
        direct_check="the setpoint in the drive's own log",
        realistic=lambda _: {"limit_rpm_s": 600.0},
        change_drive=lambda drive, values, _: replace(
            drive, acceleration_rpm_s=values["limit_rpm_s"], brake_rpm_s=values["brake_rpm_s"]
        ),
    ),
    Effect(
        name="acceleration_limit/s_curve",
        station="set_point",
        acts_on="drive",
        parameters=(
            LIMIT,
            Parameter("jerk_rpm_s2", "rpm/s2", math.inf, (300.0, 1e5), POSITIVE, scan=_JERKS_RPM_S2),
            BRAKE,
        ),
        summary="Each wheel's command changes no faster than this, and its rate of change no faster than "
        "`jerk_rpm_s2`: an S-curve, which ends at the command without overshoot.",
        signature="Ramps with round beginnings and ends; the speeds reached are unchanged.",
        direct_check="the setpoint in the drive's own log",
        change_drive=lambda drive, values, _: replace(
            drive,
            acceleration_rpm_s=values["limit_rpm_s"],
            jerk_rpm_s2=values["jerk_rpm_s2"],
            brake_rpm_s=values["brake_rpm_s"],
        ),
    ),
)
