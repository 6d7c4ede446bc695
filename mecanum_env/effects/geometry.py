"""Effects of geometry: dimensions that differ from the model's, and the frame in which motion is measured."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Channels, Effect, Parameter, Values
from mecanum_env.units import FloatArray

if TYPE_CHECKING:
    from mecanum_env.model import Model


def _radius(model: Model, values: Values) -> Model:
    robot = model.robot
    return replace(model, robot=replace(robot, wheel_radius_m=robot.wheel_radius_m * values["scale"]))


def _track(model: Model, values: Values) -> Model:
    """Only the sum of the two counts for the motion, so both grow alike."""
    robot, scale = model.robot, values["scale"]
    return replace(
        model,
        robot=replace(
            robot, half_wheelbase_m=robot.half_wheelbase_m * scale, half_track_m=robot.half_track_m * scale
        ),
    )


def _mount_yaw(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Turn velocity and path, which keeps the measured pose the integral of the measured velocity."""
    angle = math.radians(values["angle_deg"])
    cos, sin = math.cos(angle), math.sin(angle)
    measured = dict(channels)
    for x, y in (("vx_m_s", "vy_m_s"), ("x_m", "y_m")):
        if x in channels:
            measured[x] = cos * channels[x] + sin * channels[y]
            measured[y] = cos * channels[y] - sin * channels[x]
    return measured


_FACTOR: Final = (0.1, 10.0)

WHEEL_RADIUS: Final = Effect(
    name="wheel_radius",
    acts_on="geometry",
    parameters=(Parameter("scale", "1", 1.0, (0.8, 1.2), _FACTOR),),
    summary="The wheels are this many times as large as the model says.",
    signature="Body velocity is off in proportion in every direction and in rotation; wheel speeds are not.",
    absent_from=("bench",),
    change_model=_radius,
)

TRACK_WIDTH: Final = Effect(
    name="track_width",
    acts_on="geometry",
    parameters=(Parameter("scale", "1", 1.0, (0.7, 1.4), _FACTOR),),
    summary="half_wheelbase + half_track is this many times what the model says.",
    signature="Only rotation is off, by 1 / scale.",
    absent_from=("bench",),
    change_model=_track,
)

MOUNT_YAW: Final = Effect(
    name="mount_yaw",
    acts_on="geometry",
    parameters=(Parameter("angle_deg", "deg", 0.0, (-30.0, 30.0), (-360.0, 360.0)),),
    summary="The frame that is measured is turned on the body by this angle, counter-clockwise positive.",
    signature="Straight commands give a sideways part in proportion to speed; rotation is not changed.",
    absent_from=("bench",),
    change_channels=_mount_yaw,
)
