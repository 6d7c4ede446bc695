"""Pictures of an episode: the field, the robot, the opponent with its sword, the strike, the score."""

from __future__ import annotations

import time
import weakref
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.rendering.backend import use_backend
from mecanum_env.rendering.video import lighten
from mecanum_env.rendering.view import Frame, draw_caption
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.body_limits import limits_body, wheel_side
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.figure import Picture, Shape, opponent_shapes
from mecanum_env.tankendo.scene import separation
from mecanum_env.units import FloatArray

_WIDEST = "dodge   robot 0 : 0 opponent   distance 0.00 m   facing +000 deg    "
_KINDS = {"ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "rod": mujoco.mjtGeom.mjGEOM_CAPSULE}


def drawn_model(arena: Arena, plant: RobotPlant) -> mujoco.MjModel:
    """Compile the robot of an arena with all that is seen; its positions are those of the arena's.

    Args:
        arena: the first row's robot.
        plant: that the arena simulates.
    """
    model = arena.robots.model_of(0)
    spec = robot_spec if plant == "rollers" else planar_spec
    return spec(wheel_side(model) if limits_body(model) else model, wheel_quantum=False).compile()


def picture_of(arena: Arena, row: int = 0, ago_s: float = 0.0) -> Picture:
    """Return what is drawn of one episode beside the robot.

    Args:
        arena: the arena.
        row: which episode of it.
        ago_s: time before now, at most one step, for pictures between two steps [s].
    """
    scenes, sword = arena.scenes.ago(ago_s), arena.fighter.sword
    scene, now = scenes[:, row], float(arena.time_s()[row]) - ago_s
    tip, _ = sword.tip_and_velocity(arena.time_s() - ago_s, scenes)
    striking = not sword.is_feint[row] and sword.cut_s[row] <= now < sword.land_s[row] + 0.25
    hit = bool(arena.hit[row]) and now >= sword.land_s[row]
    lane = (sword.origin[:, row].copy(), sword.end[:, row].copy()) if striking else None
    target = np.array([scene[0], scene[1], sword.end_height_m[row]]) if hit else None
    rules = arena.setting.rules
    at_maai = rules.at_maai(*separation(scene))
    return Picture(
        scene[6:8].copy(), float(scene[8]), tip[:, row], bool(striking), lane, target, bool(at_maai), rules
    )


def score_lines(arena: Arena, row: int = 0) -> list[str]:
    """Return the lines of text over the picture of one episode, by its row."""
    now, sword, setting = float(arena.time_s()[row]), arena.fighter.sword, arena.setting
    distance, bearing = (float(value[row]) for value in arena.scenes.separation())
    v, theta, vc = arena.commands[row] + 0.0
    report = {name: values[row] for name, values in arena.judge.report().items()}
    score = ""
    if "points" in report:
        score = f"   robot {report['points']} : {report['points_against']} opponent"
    elif "kept_share" in report:
        score = f"   kept {report['kept_share']:.0%}"
    technique = setting.opponent.techniques[int(arena.fighter.technique()[row])].name
    action = "on guard"
    if now < sword.free_s[row] and now >= sword.raise_s[row]:
        if sword.is_feint[row]:
            action = "feint"
        elif now < sword.cut_s[row]:
            action = "raises its sword"
        elif now < sword.land_s[row]:
            action = f"strikes: {technique}"
        else:
            action = f"has struck: {technique}"
    lines = [
        f"{now:.1f} s   {setting.task}{score}",
        f"distance {distance:.2f} m   facing {np.rad2deg(bearing) + 0.0:+.0f} deg",
        f"opponent {action}",
        f"command  V {v:.0f} rpm   theta {theta:.0f} deg   VC {vc:.0f} rpm",
    ]
    if arena.succeeded[row]:
        lines.append("SUCCESS")
    elif arena.hit[row]:
        lines.append("HIT")
    elif arena.ended[row]:
        lines.append("over")
    return lines


class Painter:
    """Renders the first episode of an arena offscreen.

    Args:
        arena: the arena.
        plant: the plant that it simulates.
        width: width of the picture [px].
        height: height of the picture [px].
    """

    def __init__(self, arena: Arena, plant: RobotPlant, width: int = 640, height: int = 480) -> None:
        use_backend()
        self._arena = arena
        self._model = drawn_model(arena, plant)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        lighten(self._model)
        self._data = mujoco.MjData(self._model)
        self._renderer = mujoco.Renderer(self._model, height, width)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._camera = mujoco.MjvCamera()
        # If the program ends without close(), MuJoCo's own clean-up comes too late.
        self._free = weakref.finalize(self, self._renderer.close)

    def frame(self, ago_s: float = 0.0, qpos: FloatArray | None = None) -> Frame:
        """Return a picture of now, or of a moment between the last two steps, shape (height, width, 3).

        Args:
            ago_s: time before now, at most one step [s].
            qpos: MuJoCo's generalised positions of the robot at that moment; the present ones when None.
        """
        _place(self._model, self._data, self._arena.robots.qpos(0) if qpos is None else qpos)
        _aim(self._camera, self._arena.scenes.ago(ago_s)[:, 0])
        self._renderer.update_scene(self._data, self._camera)
        add_shapes(self._renderer.scene, opponent_shapes(picture_of(self._arena, ago_s=ago_s)))
        frame: Frame = self._renderer.render()
        draw_caption(frame, score_lines(self._arena), _WIDEST)
        return frame

    def close(self) -> None:
        """Free the graphics context."""
        self._free()


class Window:
    """Shows the first episode of an arena in a window, in real time; it needs a display.

    Args:
        arena: the arena.
        plant: the plant that it simulates.
    """

    def __init__(self, arena: Arena, plant: RobotPlant) -> None:
        from mujoco import viewer

        self._arena = arena
        self._model = drawn_model(arena, plant)
        self._data = mujoco.MjData(self._model)
        self._viewer: Any = viewer.launch_passive(
            self._model, self._data, show_left_ui=False, show_right_ui=False
        )
        _aim(self._viewer.cam, arena.scenes.now[:, 0])
        self._next_s = time.monotonic()

    def show(self) -> None:
        """Draw the present state, then wait until one step's time has passed since the last call."""
        with self._viewer.lock():
            _place(self._model, self._data, self._arena.robots.qpos(0))
            self._viewer.user_scn.ngeom = 0
            add_shapes(self._viewer.user_scn, opponent_shapes(picture_of(self._arena)))
        self._viewer.set_texts((None, None, "\n".join(score_lines(self._arena)), None))
        self._viewer.sync()
        self._next_s = max(self._next_s + self._arena.step_s, time.monotonic())
        time.sleep(max(0.0, self._next_s - time.monotonic()))

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()


def add_shapes(scene: mujoco.MjvScene, shapes: Sequence[Shape]) -> None:
    """Append shapes to a scene that is about to be rendered; those beyond its capacity are left out."""
    for shape in shapes[: scene.maxgeom - scene.ngeom]:
        geom = scene.geoms[scene.ngeom]
        cos, sin = np.cos(shape.heading_rad), np.sin(shape.heading_rad)
        turned = np.array([cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0])
        colour = np.array(shape.colour, np.float32)
        mujoco.mjv_initGeom(
            geom, _KINDS[shape.kind], np.array(shape.size), np.array(shape.start), turned, colour
        )
        if shape.kind == "rod":
            start, end = np.array(shape.start), np.array(shape.end)
            mujoco.mjv_connector(geom, _KINDS["rod"], shape.size[0], start, end)
        scene.ngeom += 1


def _place(model: mujoco.MjModel, data: mujoco.MjData, qpos: FloatArray) -> None:
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)


def _aim(camera: mujoco.MjvCamera, scene: FloatArray) -> None:
    """Look at both players from the side, from the farther the greater their distance."""
    middle = 0.5 * (scene[:2] + scene[6:8])
    distance = float(np.hypot(*(scene[6:8] - scene[:2])))
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = middle[0], middle[1], 0.30
    camera.distance = max(2.6, 1.1 + 0.95 * distance)
    camera.azimuth, camera.elevation = 118.0, -20.0
