"""Effects on the command, between the robot's latch and the drives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from mecanum_env.effects.definition import PLANTS, BodyCommand, Effect, Parameter, Values, usual_ceiling_rpm
from mecanum_env.law.arrays import namespace
from mecanum_env.model import Model
from mecanum_env.wheel_drive.drive import longest_delay_s

TIME_STAMPS: Final = (
    "when a command is sent, when the drive acts and when a sensor reads, by time stamps of one clock"
)
"""Direct check of any delay."""
_CONTROLLER_LOG: Final = "the command that reaches the drives, in the controller's own log"
_RANDOM: Final = PLANTS
"""Where chance decides when a command acts, no search looks: a simulation draws other times than those of a
log, and what is left in the mean over repeats is a fixed delay and a lag."""
_LIMIT: Final = (1e-6, math.inf)


def _longest_delay(model: Model) -> float:
    # A physics step is no longer than a tick of the law.
    return longest_delay_s(model.wheel.command_period_s, model.wheel.law.sample_period_s)


def _limit_speed(
    body: BodyCommand, previous: BodyCommand, values: Values, seconds: float
) -> tuple[BodyCommand, BodyCommand]:
    forward, left, turn = body
    speed, most = math.hypot(forward, left), values["vc_rpm"]
    share = values["v_rpm"] / speed if speed > values["v_rpm"] else 1.0
    limited = share * forward, share * left, min(max(turn, -most), most)
    return limited, limited


def _limit_acceleration(
    body: BodyCommand, previous: BodyCommand, values: Values, seconds: float
) -> tuple[BodyCommand, BodyCommand]:
    changes = body[0] - previous[0], body[1] - previous[1], body[2] - previous[2]
    linear = _shares(math.hypot(changes[0], changes[1]), values["v_rpm_s"] * seconds)
    turning = _shares(abs(changes[2]), values["vc_rpm_s"] * seconds)
    forward, mean_forward = _ramp(body[0], previous[0], changes[0], linear)
    left, mean_left = _ramp(body[1], previous[1], changes[1], linear)
    turn, mean_turn = _ramp(body[2], previous[2], changes[2], turning)
    return (forward, left, turn), (mean_forward, mean_left, mean_turn)


def _shares(length: float, most: float) -> tuple[float, float]:
    """Return what share of a change of some `length` is made if `most` of it can be, and lost in the mean."""
    if length == 0.0:
        return 1.0, 0.0
    share = min(1.0, most / length)
    return share, 0.5 * share * min(1.0, length / most)


def _ramp(asked: float, previous: float, change: float, shares: tuple[float, float]) -> tuple[float, float]:
    """Return the end and the mean of a straight ramp to what is asked, or as far as the `shares` allow."""
    made, lost = shares
    end = previous + made * change if made < 1.0 else asked
    return end, end - lost * change


def _limit_speeds(bodies: Any, previous: Any, values: Mapping[str, Any], seconds: float) -> tuple[Any, Any]:
    xp, (forward, left, turn) = namespace(bodies), bodies
    speed, most = xp.sqrt(forward * forward + left * left), values["vc_rpm"]
    share = xp.where(speed > values["v_rpm"], values["v_rpm"] / xp.where(speed > 0.0, speed, 1.0), 1.0)
    limited = xp.stack([share * forward, share * left, xp.minimum(xp.maximum(turn, -most), most)])
    return limited, limited


def _limit_accelerations(
    bodies: Any, previous: Any, values: Mapping[str, Any], seconds: float
) -> tuple[Any, Any]:
    xp, change = namespace(bodies), bodies - previous
    length = xp.sqrt(change[0] * change[0] + change[1] * change[1])
    lengths = xp.stack([length, length, xp.abs(change[2])])
    most = seconds * xp.stack([values["v_rpm_s"], values["v_rpm_s"], values["vc_rpm_s"]])
    moves = lengths > 0.0
    share = xp.where(moves, xp.clip(most / xp.where(moves, lengths, 1.0), None, 1.0), 1.0)
    lost = xp.where(moves, 0.5 * share * xp.clip(lengths / most, None, 1.0), 0.0)
    end = xp.where(share < 1.0, previous + share * change, bodies)
    return end, end - lost * change


EFFECTS: Final = (
    Effect(
        name="command_latency",
        first_form="fixed",
        station="command",
        acts_on="command",
        exact=True,
        parameters=(
            Parameter(
                "delay_s",
                "s",
                0.0,
                (0.0, 0.5),
                scan=(0.005, 0.02, 0.05, 0.1, 0.2, 0.4),
                largest=_longest_delay,
            ),
        ),
        summary="A latched command takes effect later.",
        signature="Every rise and fall comes later by the same time; the speeds reached are unchanged. "
        "On a bench log the same as sensor_latency.",
        direct_check=TIME_STAMPS,
        realistic=lambda _: {"delay_s": 0.05},
        shifts_time=True,
        undone_by="prediction",
        change_drive=lambda drive, values, _: replace(drive, delay_s=values["delay_s"]),
    ),
    Effect(
        name="command_latency/jitter",
        station="command",
        acts_on="command",
        parameters=(
            Parameter("delay_s", "s", 0.0, (0.0, 0.5), largest=_longest_delay),
            Parameter("jitter_s", "s", 0.0, (0.0, 0.2)),
        ),
        summary="Each change of a latched command takes effect later by a time of its own, with this mean "
        "and this standard deviation.",
        signature="Rises and falls come later, each by another time; the speeds reached are unchanged.",
        direct_check=TIME_STAMPS,
        unsearched_on=_RANDOM,
        shifts_time=True,
        undone_by="prediction",
        change_drive=lambda drive, values, _: replace(
            drive, delay_s=values["delay_s"], jitter_s=values["jitter_s"]
        ),
    ),
    Effect(
        name="command_loss",
        first_form="drop",
        station="command",
        acts_on="command",
        parameters=(Parameter("share", "1", 0.0, (0.0, 0.8), (0.0, 1.0)),),
        summary="This share of the latched commands never arrives, and the one before goes on.",
        signature="Now and then a change of the command comes one command period late, or more.",
        direct_check=_CONTROLLER_LOG,
        realistic=lambda _: {"share": 0.05},
        unsearched_on=_RANDOM,
        change_drive=lambda drive, values, _: replace(drive, loss=values["share"]),
    ),
    Effect(
        name="body_speed_limit",
        station="body_command",
        acts_on="command, on V and VC",
        parameters=(
            Parameter("v_rpm", "rpm", math.inf, (5.0, 200.0), _LIMIT, scan=(20, 40, 60, 80, 100, 120, 150)),
            Parameter("vc_rpm", "rpm", math.inf, (5.0, 200.0), _LIMIT, scan=(20, 40, 60, 80, 100, 120, 150)),
        ),
        summary="V and VC are each limited, before the kinematics.",
        signature="All wheels stop rising together, in the ratio of the command; the direction is kept.",
        direct_check=_CONTROLLER_LOG,
        realistic=lambda model: {
            "v_rpm": 0.8 * usual_ceiling_rpm(model),
            "vc_rpm": 0.6 * usual_ceiling_rpm(model),
        },
        absent_from=("bench",),
        undone_by="command",
        limit_body=_limit_speed,
        limit_bodies=_limit_speeds,
    ),
    Effect(
        name="body_acceleration_limit",
        station="body_command",
        acts_on="command, on V and VC",
        parameters=tuple(
            Parameter(
                name,
                "rpm/s",
                math.inf,
                (20.0, 12000.0),
                _LIMIT,
                scan=(50, 100, 200, 400, 800, 1600, 3200, 6400),
                follows_rise=False,
            )
            for name in ("v_rpm_s", "vc_rpm_s")
        ),
        summary="V (as a vector) and VC change no faster than this, before the kinematics.",
        signature="Ramps instead of steps, on all wheels together; the speeds reached are unchanged.",
        direct_check=_CONTROLLER_LOG,
        realistic=lambda _: {"v_rpm_s": 500.0, "vc_rpm_s": 500.0},
        absent_from=("bench",),
        limit_body=_limit_acceleration,
        limit_bodies=_limit_accelerations,
    ),
    Effect(
        name="command_deadband",
        first_form="drop",
        station="set_point",
        acts_on="command",
        parameters=(
            Parameter(
                "threshold_rpm", "rpm", 0.0, (0.0, 90.0), scan=(2, 4, 7, 11, 16, 24, 40, 80), stepwise=True
            ),
        ),
        summary="Wheel commands below a threshold do nothing; larger ones are unchanged.",
        signature="No motion for small commands, no error for large ones; diagonals lose their slow wheels.",
        direct_check="the smallest command that makes the motor draw current",
        realistic=lambda _: {"threshold_rpm": 6.0},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, deadband_rpm=values["threshold_rpm"]),
    ),
    Effect(
        name="command_deadband/subtract",
        station="set_point",
        acts_on="command",
        parameters=(Parameter("threshold_rpm", "rpm", 0.0, (0.0, 60.0)),),
        summary="A threshold is taken off every wheel command; smaller ones do nothing.",
        signature="No motion for small commands, and the same loss in rpm for all larger ones, "
        "with integral action in the drive as well.",
        direct_check="the smallest command that makes the motor draw current, and the setpoint beyond it",
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, subtracted_rpm=values["threshold_rpm"]),
    ),
)
