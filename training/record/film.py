"""A film of one episode of a controller, and one of its frames as a picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from tqdm import tqdm

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import Model
from mecanum_env.registration import ENVIRONMENTS
from mecanum_env.rendering import video
from mecanum_env.rendering.view import Frame
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.env import TankendoEnv
from training.certify.plants import RobotVariant, robot_variants, select_variants
from training.controllers.named import make_controller
from training.record.rollout import AFTER_S, outcome, rollout_frames

STILL_S: Final = 1.0
"""Time of a still after the start [s], unless another is asked for."""


@dataclass(frozen=True)
class Film:
    """An episode that is to be filmed: the one that the same seed has in a certificate."""

    controller: str
    """Name of a controller or path of a trained policy."""
    known: Model
    """The robot as the controller knows it."""
    env: str = "MecanumTankendo-v0"
    seed: int = 0
    on: str = "nominal"
    """Plant of a certificate."""
    physics: RobotPlant = "rollers"
    difficulty: str = "normal"
    width: int = 640
    """Of the frames, plots included [pixels]."""
    height: int = 480
    fps: float = 30.0

    def __post_init__(self) -> None:
        if self.env not in ENVIRONMENTS:
            raise InputError(
                f"env = {self.env!r}{did_you_mean(self.env, ENVIRONMENTS)}, must be {', '.join(ENVIRONMENTS)}"
            )

    @cached_property
    def variant(self) -> RobotVariant:
        """The simulated robot."""
        found = select_variants(robot_variants(self.known, self.physics), [self.on])
        return next(one for one in found if self.on in (one.name, one.group))

    @cached_property
    def world(self) -> TankendoEnv:
        """The environment of the episode."""
        return TankendoEnv(
            task=ENVIRONMENTS[self.env],  # type: ignore[arg-type]
            model=self.variant.model,
            plant=self.variant.physics,
            difficulty=self.difficulty,
            action_mode="command",
            randomize=self.variant.randomize,
        )

    def require_within(self, still_s: float) -> None:
        """Raise `InputError` if a time [s] may lie outside of the film."""
        longest_s = self.world.arena.time_limit_s + AFTER_S
        if not 0.0 <= still_s <= longest_s:
            raise InputError(f"still_time = {still_s:g}, must be within the film, 0 to {longest_s:g} s")

    def frames(self) -> Iterator[Frame]:
        """Play the episode and return its frames, each (height, width, 3).

        Raises:
            InputError: a controller, plant, seed, size or frame rate that cannot be.
        """
        arena = self.world.arena
        return rollout_frames(
            self.world,
            make_controller(self.controller, self.known, arena=arena, seed=self.seed),
            self.known,
            self.variant.physics,
            seed=self.seed,
            width=self.width,
            height=self.height,
            fps=self.fps,
            title=f"{self.controller}, {self.variant.name}, seed {self.seed}",
        )

    def write(
        self, frames: Iterator[Frame], target: Path, still: Path | None = None, still_s: float = STILL_S
    ) -> int:
        """Write the `frames` of this film to a `target`, and the `still` at a time [s]; return their number.

        If the episode is over by then, the still is the last frame.
        """
        kept: list[Frame] = []

        def passed() -> Iterator[Frame]:
            for i, frame in enumerate(tqdm(frames, desc="drawing", unit="frame", disable=None)):
                if i <= still_s * self.fps:
                    kept[:] = [frame]
                yield frame

        count = video.write_video(target, passed(), self.fps)
        if still is not None:
            video.write_still(still, kept[0])
        return count

    def outcome(self) -> str:
        """Return in a few words how the episode that was played ended."""
        return outcome(self.world.arena)
