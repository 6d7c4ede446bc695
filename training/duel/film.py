"""Pictures of one bout."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.rendering.view import Frame
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.bout import duel_arena
from mecanum_env.tankendo.duel_drawing import DuelPainter
from training.duel.match import PlayerFactory, play_bouts

FPS: Final = 30.0
"""Frames per second."""
_STEPS: Final = 3
"""Frames a step of 0.1 s."""
_WIDTH_PX, _HEIGHT_PX = 640, 480
"""Size of the frames."""
_AFTER_S: Final = 1.0
"""The last picture is shown for this long [s]."""


def bout_frames(
    players: tuple[PlayerFactory, PlayerFactory],
    names: tuple[str, str],
    seed: int,
    *,
    model: Model | None = None,
    plant: RobotPlant = "planar",
    **task: Any,
) -> Iterator[Frame]:
    """Play a bout and yield its frames, each (480, 640, 3).

    Args:
        players: make the two players.
        names: what they are called in the pictures.
        seed: of the bout.
        model: of both robots; None: the packaged one.
        plant: "planar" or "rollers".
        task: further arguments of `duel_arena`.
    """
    arena = duel_arena(1, model=model, plant=plant, action_mode="command", **task)
    arena.begin([0], [np.random.default_rng(seed)])
    painter = DuelPainter(arena, plant, _WIDTH_PX, _HEIGHT_PX, names)
    try:
        yield (frame := painter.frame())
        before = arena.robots.qpos(0)
        for _ in play_bouts(arena, [make(side) for side, make in enumerate(players)]):
            after = arena.robots.qpos(0)
            for share in (i / _STEPS for i in range(1, _STEPS + 1)):
                yield (
                    frame := painter.frame((1.0 - share) * arena.step_s, before + share * (after - before))
                )
            before = after
        for _ in range(round(_AFTER_S * FPS)):
            yield frame
    finally:
        painter.close()
