"""Pictures of a bout: both robots, their swords, strikes and the score."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from mecanum_env.mjcf.chassis import SWORD_M
from mecanum_env.rendering.view import Frame, draw_caption
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import drawing
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.bout import DuelArena
from mecanum_env.tankendo.drawing import Colour, Painter, Shape
from mecanum_env.tankendo.pair import SECOND, compile_pair
from mecanum_env.units import FloatArray

_COLOURS: Final[tuple[Colour, Colour]] = ((0.80, 0.16, 0.13, 1.0), (0.13, 0.30, 0.70, 1.0))
"""Red for the first player, blue for the second."""
_GRIP_AHEAD_M, _GRIP_HEIGHT_M = 0.22, 0.46
_HELD: Final = ("bamboo", "leather")
"""Materials of the sword that a robot holds when it does not fight; the one that moves is drawn instead."""


def duel_model(arena: DuelArena, plant: RobotPlant) -> mujoco.MjModel:
    """Compile both robots of an arena on its plant, with all that is seen; the second one is blue."""
    model = compile_pair(arena.robots.model_of(0), plant, visuals=True).mj_model
    # One light follows the first robot; with a second one the mat would be too bright.
    for light in range(model.nlight):
        follows = model.body(int(model.light_bodyid[light])).name.startswith(SECOND)
        model.light_active[light] = not follows
    for geom in range(model.ngeom):
        material = int(model.geom_matid[geom])
        name = model.material(material).name if material >= 0 else ""
        is_rod = model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_ELLIPSOID
        if name.removeprefix(SECOND) in _HELD and is_rod:
            model.geom_matid[geom], model.geom_rgba[geom] = -1, 0.0
        elif name.removeprefix(SECOND) == "accent":
            body = model.body(int(model.geom_bodyid[geom])).name
            model.geom_matid[geom], model.geom_rgba[geom] = -1, _COLOURS[body.startswith(SECOND)]
    return model


def sword_shapes(arena: DuelArena, player: int, ago_s: float = 0.0) -> list[Shape]:
    """Return the shapes of the sword and the strike of a `player`, 0 or 1, `ago_s` before now [s]."""
    # The sword of a player is that of the opponent in the other's row, in the other's frame.
    row, scenes, sword = 1 - player, arena.scenes.ago(ago_s), arena.fighter.sword
    scene, now = scenes[:, row], float(arena.time_s()[row]) - ago_s
    tip = arena.tip(row, ago_s)
    striking = bool(not sword.is_feint[row] and sword.cut_s[row] <= now < sword.land_s[row] + drawing.SHOWN_S)
    heading = np.array([np.cos(scene[8]), np.sin(scene[8])])
    grip = np.append(scene[6:8] + _GRIP_AHEAD_M * heading, _GRIP_HEIGHT_M)
    along = (tip - grip) / max(float(np.linalg.norm(tip - grip)), 1e-6)
    steel = drawing.STRIKING if striking else drawing.BAMBOO
    pommel = tip - SWORD_M * along
    points = [(drawing.LEATHER, 0.015, pommel, pommel + 0.14 * along)]
    points += [(_COLOURS[player], 0.034, pommel + 0.14 * along, pommel + 0.155 * along)]
    points += [(steel, 0.013, pommel + 0.155 * along, tip)]
    # An arm from the body to where the sword is held.
    points += [(drawing.METAL, 0.02, grip - np.append(0.18 * heading, -0.04), pommel + 0.06 * along)]
    if striking:
        start, end = (np.append(point[:, row], 0.006) for point in (sword.origin, sword.end))
        points.append((drawing.LANE, 0.012, start, end))
    shapes = [
        drawing.rod(colour, size, _in_field(a, row), _in_field(b, row)) for colour, size, a, b in points
    ]
    if arena.hit[row] and now >= sword.land_s[row]:
        target = _in_field(np.append(scene[:2], sword.end_height_m[row]), row)
        shapes.append(Shape("ellipsoid", drawing.HIT, target, (0.09, 0.09, 0.09)))
    return shapes


def score_lines(arena: DuelArena, names: tuple[str, str]) -> list[str]:
    """Return the lines of text over the picture of a bout; the players are called `names`."""
    now, report = float(arena.time_s()[0]), arena.judge.report()
    points = report["points"]
    lines = [f"{now:.1f} s   {names[0]} {points[0]} : {points[1]} {names[1]}"]
    lines.append(f"distance {float(arena.scenes.separation()[0][0]):.2f} m")
    for player, (colour, name) in enumerate(zip(("red", "blue"), names, strict=True)):
        lines.append(f"{colour} {name}: {_action(arena, 1 - player, now)}")
    if arena.ended[0]:
        winner = arena.results()[0]
        lines.append("draw" if winner == "draw" else f"{names[winner == 'second']} wins")
    elif arena.hit.any():
        lines.append("HIT")
    return lines


def _action(arena: Arena, row: int, now: float) -> str:
    """Return what the sword against the player of a row does at a time [s]."""
    sword = arena.fighter.sword
    if not sword.raise_s[row] <= now < sword.free_s[row]:
        return "on guard"
    if sword.is_feint[row]:
        return "feint"
    technique = arena.setting.opponent.techniques[int(arena.fighter.technique()[row])].name
    if now < sword.cut_s[row]:
        return "raises the sword"
    return f"strikes: {technique}" if now < sword.land_s[row] else "has struck"


def _in_field(point: FloatArray, row: int) -> FloatArray:
    """Return a point x, y, z [m] of the frame of a row's player in that of the field."""
    return point * (-1.0, -1.0, 1.0) if row else point


class DuelPainter(Painter):
    """Renders the first bout of an arena on its plant offscreen, `width` by `height` pixels.

    The players are called `names` in the pictures.
    """

    _arena: DuelArena

    def __init__(
        self,
        arena: DuelArena,
        plant: RobotPlant,
        width: int = 640,
        height: int = 480,
        names: tuple[str, str] = ("first", "second"),
    ) -> None:
        self._names = names
        super().__init__(arena, plant, width, height)

    def _compile(self, plant: RobotPlant) -> mujoco.MjModel:
        return duel_model(self._arena, plant)

    def _shapes(self, ago_s: float) -> list[Shape]:
        return [shape for player in (0, 1) for shape in sword_shapes(self._arena, player, ago_s)]

    def _caption(self, frame: Frame) -> None:
        widest = f"00.0 s   {self._names[0]} 0 : 0 {self._names[1]}   raises the sword   "
        draw_caption(frame, score_lines(self._arena, self._names), widest)
