"""Pictures of an episode: the field, the robot, the opponent with its sword, the strike, the score."""

from __future__ import annotations

import time
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np

from mecanum_env.mjcf.chassis import SWORD_M
from mecanum_env.rendering.backend import use_backend
from mecanum_env.rendering.video import lighten
from mecanum_env.rendering.view import Frame, draw_caption
from mecanum_env.simulator import RobotPlant, compile_plant
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.numbers import One
from mecanum_env.tankendo.scene import separation
from mecanum_env.units import FloatArray

_WIDEST = "dodge   robot 0 : 0 opponent   distance 0.00 m   facing +000 deg    "
Colour = tuple[float, float, float, float]
_INDIGO: Colour = (0.13, 0.17, 0.36, 1.0)
_DARK: Colour = (0.09, 0.10, 0.14, 1.0)
_ARMOUR: Colour = (0.42, 0.10, 0.12, 1.0)
METAL: Colour = (0.72, 0.74, 0.77, 1.0)
BAMBOO: Colour = (0.86, 0.72, 0.42, 1.0)
LEATHER: Colour = (0.93, 0.91, 0.85, 1.0)
STRIKING: Colour = (1.0, 0.35, 0.10, 1.0)
LANE: Colour = (1.0, 0.35, 0.10, 0.6)
HIT: Colour = (0.95, 0.10, 0.08, 0.75)
_OPEN: Colour = (0.15, 0.65, 0.30, 0.9)
_CLOSED: Colour = (0.45, 0.47, 0.52, 0.7)
_RING_DOTS = 60  # dots of the ring at maai around the opponent
_GRIP_HEIGHT_M, _GRIP_AHEAD_M = 0.46, 0.08
SHOWN_S = 0.25  # a strike is shown for this long after its end
_KINDS = {"ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "rod": mujoco.mjtGeom.mjGEOM_CAPSULE}


def _drawn_model(arena: Arena, plant: RobotPlant) -> mujoco.MjModel:
    """Compile the robot in an arena's first row, on the arena's plant, with all that is seen."""
    return compile_plant(arena.robots.model_of(0), plant)


@dataclass(frozen=True)
class Shape:
    """One shape: an ellipsoid around `start`, or a rod from `start` to `end`; points are x, y, z [m]."""

    kind: Literal["ellipsoid", "rod"]
    colour: Colour
    start: FloatArray
    size: tuple[float, float, float]
    """Half-axes of an ellipsoid along the opponent's heading, across it and up [m]; of a rod, the radius."""
    end: FloatArray | None = None
    heading_rad: float = 0.0


def opponent_shapes(arena: Arena, row: int = 0, ago_s: float = 0.0) -> list[Shape]:
    """Return the shapes of the opponent in a row, its sword, its strike, and the ring at maai around it.

    `ago_s` is the time before now [s], at most one step, for pictures between two steps.
    """
    scenes, sword, rules = arena.scenes.ago(ago_s), arena.fighter.sword, arena.setting.rules
    scene, now = scenes[:, row], float(arena.time_s()[row]) - ago_s
    tip = arena.tip(row, ago_s)
    striking = bool(not sword.is_feint[row] and sword.cut_s[row] <= now < sword.land_s[row] + SHOWN_S)
    shapes = _body(scene[6:9], tip, STRIKING if striking else BAMBOO)
    apart = separation(One(), scene[6] - scene[0], scene[7] - scene[1], scene[2])
    ring = _OPEN if rules.at_maai(*apart) else _CLOSED
    for angle in 2.0 * np.pi * np.arange(_RING_DOTS) / _RING_DOTS:
        dot = scene[6:8] + rules.maai_m * np.array([np.cos(angle), np.sin(angle)])
        shapes.append(Shape("ellipsoid", ring, np.append(dot, 0.004), (0.022, 0.022, 0.003)))
    if striking:
        start, end = (np.append(point[:, row], 0.006) for point in (sword.origin, sword.end))
        shapes.append(rod(LANE, 0.012, start, end))
    if arena.hit[row] and now >= sword.land_s[row]:
        target = np.append(scene[:2], sword.end_height_m[row])
        shapes.append(Shape("ellipsoid", HIT, target, (0.09, 0.09, 0.09)))
    return shapes


def _body(pose: FloatArray, tip: FloatArray, steel: Colour) -> list[Shape]:
    """Return the shapes of body, arms and sword, for a pose x, y [m], heading [rad]."""
    x, y, heading = (float(value) for value in pose)
    cos, sin = np.cos(heading), np.sin(heading)
    # In a long strike the upper body leans forward.
    stretch = float(np.hypot(tip[0] - x, tip[1] - y)) - GUARD_TIP_M
    lean = 0.45 * min(max(stretch, 0.0), 0.9)

    def at(ahead: float, left: float, up: float) -> FloatArray:
        """Return a point in the field's frame, shifted forward by the lean of the body at its height."""
        ahead += lean * min(max((up - 0.15) / 0.5, 0.0), 1.0)
        return np.array([x + ahead * cos - left * sin, y + ahead * sin + left * cos, up])

    grip = at(_GRIP_AHEAD_M, 0.0, _GRIP_HEIGHT_M)
    along = (tip - grip) / max(float(np.linalg.norm(tip - grip)), 1e-6)

    def blade(share: float) -> FloatArray:
        """Return the point at a share of the sword's length, from pommel to tip."""
        return np.asarray(tip - SWORD_M * (1.0 - share) * along)

    blobs = (
        (_DARK, at(0.0, 0.0, 0.07), (0.19, 0.22, 0.08)),
        (_DARK, at(0.0, 0.0, 0.20), (0.14, 0.17, 0.19)),
        (_INDIGO, at(0.0, 0.0, 0.36), (0.11, 0.15, 0.12)),
        (_INDIGO, at(0.0, 0.0, 0.49), (0.09, 0.16, 0.10)),
        (_ARMOUR, at(0.03, 0.0, 0.42), (0.10, 0.12, 0.11)),
        (_INDIGO, at(0.0, 0.0, 0.67), (0.085, 0.08, 0.095)),
        (METAL, at(0.055, 0.0, 0.665), (0.045, 0.055, 0.065)),
    )
    shapes = [
        *(Shape("ellipsoid", colour, middle, size, heading_rad=heading) for colour, middle, size in blobs),
        rod(LEATHER, 0.015, blade(0.0), blade(0.27)),
        rod(LEATHER, 0.034, blade(0.27), blade(0.29)),
        rod(steel, 0.013, blade(0.29), blade(0.92)),
        rod(LEATHER, 0.014, blade(0.92), blade(1.0)),
    ]
    for side, share in ((-1.0, 0.22), (1.0, 0.06)):
        shoulder, hand = at(0.0, 0.16 * side, 0.53), blade(share)
        elbow = 0.5 * (shoulder + hand) - (0.0, 0.0, 0.07)
        shapes += [rod(_INDIGO, 0.038, shoulder, elbow), rod(_DARK, 0.034, elbow, hand)]
    return shapes


def rod(colour: Colour, radius_m: float, start: FloatArray, end: FloatArray) -> Shape:
    """Return a rod of this `colour` and radius [m] from `start` to `end` [m]."""
    return Shape("rod", colour, start, (radius_m, 0.0, 0.0), end)


def score_lines(arena: Arena, row: int = 0) -> list[str]:
    """Return the lines of text over the picture of one episode, by its row."""
    now, sword, setting = float(arena.time_s()[row]), arena.fighter.sword, arena.setting
    distance, bearing = (float(value[row]) for value in arena.scenes.separation())
    v, theta, vc = arena.commands[row] + 0.0
    report = {name: values[row] for name, values in arena.state_info().items()}
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
    ends = (("SUCCESS", arena.succeeded[row]), ("HIT", arena.hit[row]), ("over", arena.ended[row]))
    return lines + [end for end, is_so in ends if is_so][:1]


class Painter:
    """Renders the first episode of an arena on its plant offscreen, in a width and height in pixels."""

    def __init__(self, arena: Arena, plant: RobotPlant, width: int = 640, height: int = 480) -> None:
        use_backend()
        self._arena = arena
        self._model = self._compile(plant)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        lighten(self._model)
        self._data = mujoco.MjData(self._model)
        self._renderer = mujoco.Renderer(self._model, height, width)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._camera = mujoco.MjvCamera()
        # If the program ends without close(), MuJoCo's own clean-up comes too late.
        self._free = weakref.finalize(self, self._renderer.close)

    def frame(self, ago_s: float = 0.0, qpos: FloatArray | None = None) -> Frame:
        """Return a picture, shape (height, width, 3), of `ago_s` before now [s], at most one step.

        `qpos` are the robot's generalised positions in MuJoCo then; the present ones when None.
        """
        _place(self._model, self._data, self._arena.robots.qpos(0) if qpos is None else qpos)
        _aim(self._camera, self._arena.scenes.ago(ago_s)[:, 0])
        self._renderer.update_scene(self._data, self._camera)
        _add_shapes(self._renderer.scene, self._shapes(ago_s))
        frame: Frame = self._renderer.render()
        self._caption(frame)
        return frame

    def _compile(self, plant: RobotPlant) -> mujoco.MjModel:
        """Return the model with all that is seen."""
        return _drawn_model(self._arena, plant)

    def _shapes(self, ago_s: float) -> list[Shape]:
        """Return what is drawn beside the model, as it was `ago_s` before now [s]."""
        return opponent_shapes(self._arena, ago_s=ago_s)

    def _caption(self, frame: Frame) -> None:
        """Write the score into a picture."""
        draw_caption(frame, score_lines(self._arena), _WIDEST)

    def close(self) -> None:
        """Free the graphics context."""
        self._free()


class Window:
    """Shows the first episode of an arena on its plant in a window, in real time; it needs a display."""

    def __init__(self, arena: Arena, plant: RobotPlant) -> None:
        from mujoco import viewer

        self._arena = arena
        self._model = _drawn_model(arena, plant)
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
            _add_shapes(self._viewer.user_scn, opponent_shapes(self._arena))
        self._viewer.set_texts((None, None, "\n".join(score_lines(self._arena)), None))
        self._viewer.sync()
        self._next_s = max(self._next_s + self._arena.step_s, time.monotonic())
        time.sleep(max(0.0, self._next_s - time.monotonic()))

    def close(self) -> None:
        """Close the window."""
        self._viewer.close()


def _add_shapes(scene: mujoco.MjvScene, shapes: Sequence[Shape]) -> None:
    """Append shapes to a scene that is about to be rendered; those beyond its capacity are left out."""
    for shape in shapes[: scene.maxgeom - scene.ngeom]:
        geom = scene.geoms[scene.ngeom]
        cos, sin = np.cos(shape.heading_rad), np.sin(shape.heading_rad)
        turned = np.array([cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0])
        size, colour = np.array(shape.size), np.array(shape.colour, np.float32)
        mujoco.mjv_initGeom(geom, _KINDS[shape.kind], size, shape.start, turned, colour)
        if shape.end is not None:
            mujoco.mjv_connector(geom, _KINDS[shape.kind], shape.size[0], shape.start, shape.end)
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
