"""Pictures of the robot as JPEG, drawn without a window, with a second robot as a shadow of the first.

Call `mecanum_env.rendering.backend.use_backend` before importing this module.
"""

from __future__ import annotations

import copy
import io
import math
import weakref
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from PIL import Image

from mecanum_env.rendering.video import lighten
from mecanum_env.units import FloatArray

WIDTH_PX: Final = 640
HEIGHT_PX: Final = 400
_JPEG_QUALITY: Final = 80
AROUND: Final = "around"
"""The camera that the page turns around the robot; the others are the model's."""
GHOST_RGBA: Final = (1.0, 0.62, 0.11, 0.35)
"""Colour of the second robot, that of commanded and logged values in the plots."""


@dataclass(frozen=True)
class Camera:
    """Where the robot is seen from."""

    name: str = AROUND
    azimuth_deg: float = 35.0
    """Direction in which the camera looks; 0: along the world's x, in which a robot heads at the start."""
    elevation_deg: float = -22.0
    distance_m: float = 2.2


class Picture:
    """Draws one compiled model; it belongs to the thread that made it."""

    def __init__(self, mj_model: mujoco.MjModel) -> None:
        self._model = copy.copy(mj_model)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = WIDTH_PX, HEIGHT_PX
        lighten(self._model)
        self._robot, self._ghost = mujoco.MjData(self._model), mujoco.MjData(self._model)
        self._renderer = mujoco.Renderer(self._model, HEIGHT_PX, WIDTH_PX)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        # If the program ends without close(), MuJoCo's own clean-up comes too late.
        self._free = weakref.finalize(self, self._renderer.close)

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return AROUND, *(self._model.camera(i).name for i in range(self._model.ncam))

    def fits(self, qpos: FloatArray) -> bool:
        """Return whether positions `qpos`, shape (nq,), are of this model."""
        return bool(qpos.size == self._model.nq)

    def jpeg(self, qpos: FloatArray, camera: Camera, ghost: FloatArray | None = None) -> bytes:
        """Return a JPEG file of the robot at positions `qpos` (nq,), and of a `ghost` at others."""
        _place(self._model, self._robot, qpos)
        self._renderer.update_scene(self._robot, self._seen_from(camera))
        if ghost is not None:
            _place(self._model, self._ghost, ghost)
            self._add_ghost()
        file = io.BytesIO()
        Image.fromarray(self._renderer.render()).save(file, "jpeg", quality=_JPEG_QUALITY)
        return file.getvalue()

    def close(self) -> None:
        """Free the graphics context."""
        self._free()

    def _seen_from(self, camera: Camera) -> str | mujoco.MjvCamera:
        if camera.name != AROUND:
            return camera.name
        around = mujoco.MjvCamera()
        around.type = mujoco.mjtCamera.mjCAMERA_FREE
        around.lookat[:] = *self._robot.body("base").xpos[:2], 0.15
        around.azimuth, around.elevation = camera.azimuth_deg, camera.elevation_deg
        around.distance = camera.distance_m
        return around

    def _add_ghost(self) -> None:
        scene = self._renderer.scene
        first = scene.ngeom
        moving = mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_addGeoms(self._model, self._ghost, mujoco.MjvOption(), mujoco.MjvPerturb(), moving, scene)
        for geom in scene.geoms[first : scene.ngeom]:
            geom.rgba[:], geom.matid, geom.transparent = GHOST_RGBA, -1, 1


def placed(mj_model: mujoco.MjModel, qpos: FloatArray, pose: FloatArray) -> FloatArray:
    """Return positions `qpos` (nq,) with the base moved to a pose x, y [m], yaw [rad], shape (3,)."""
    moved, (x, y, yaw) = qpos.copy(), pose
    if mj_model.joint(0).type[0] == mujoco.mjtJoint.mjJNT_FREE:
        moved[:2] = x, y
        moved[3:7] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
    else:
        for name, value in zip(("base_x", "base_y", "base_yaw"), (x, y, yaw), strict=True):
            moved[mj_model.joint(name).qposadr] = value
    return moved


def _place(model: mujoco.MjModel, data: mujoco.MjData, qpos: FloatArray) -> None:
    """Compute the part of `mj_forward` that drawing needs."""
    data.qpos[:] = np.asarray(qpos)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
