"""Simulation of all situations of a study; motions are shared by models that differ in their sensors only."""

from __future__ import annotations

import json
from collections import OrderedDict
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import without_sensors
from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from mecanum_env.units import FloatArray
from sysid.compare.correction import correction_of
from sysid.compare.observations import Observations, Situation
from sysid.compare.prediction import (
    Motion,
    Study,
    bench_motions_of,
    bench_run,
    compile_robot,
    in_run_frame,
    robot_motion,
    sensor_readings,
)

_REMEMBERED: Final = 8  # number of models whose motions are kept; those of one model take some megabytes


@contextmanager
def without_engine_warnings() -> Iterator[None]:
    """Silence MuJoCo's warnings of diverging states: a search tries such models and drops them."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


class Simulator:
    """Predicts the blocks of observations; initial wheel angles are drawn if `wheel_angle_seed` is not 0."""

    def __init__(
        self,
        observations: Observations,
        study: Study | None = None,
        wheel_angle_seed: int = 0,
    ) -> None:
        self.observations, self.wheel_angle_seed = observations, wheel_angle_seed
        self.study = study or Study()
        self._motions: OrderedDict[str, list[Motion]] = OrderedDict()
        self._lock = Lock()

    def predictions(self, model: Model) -> list[FloatArray]:
        """Return what a model predicts for each block, each of the block's shape (m,).

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
            SimulationDivergedError: the state stopped being finite.
        """
        situations = self.observations.situations
        correction = correction_of(model)
        channels = []
        for situation, motion in zip(situations, self._motion(without_sensors(model)), strict=True):
            read = sensor_readings(model, situation.runs[0], situation.start, motion)
            channels.append(correction.added_to(situation.runs[0], read) if correction else read)
        return [
            block.of(situations[block.situation].runs[0], channels[block.situation])
            for block in self.observations.blocks
        ]

    def _motion(self, model: Model) -> Sequence[Motion]:
        key = model_key(model)
        with self._lock:
            if key in self._motions:
                self._motions.move_to_end(key)
                return self._motions[key]
        found = self._simulate(model)
        with self._lock:
            self._motions[key] = found
            while len(self._motions) > _REMEMBERED:
                self._motions.popitem(last=False)
        return found

    def _simulate(self, model: Model) -> list[Motion]:
        situations = self.observations.situations
        alike: dict[Hashable, list[int]] = {}
        for index, situation in enumerate(situations):
            alike.setdefault(_motion_key(situation, model.wheel.command_period_s), []).append(index)
        longest = [
            max((situations[i] for i in members), key=lambda s: s.runs[0].duration_s)
            for members in alike.values()
        ]
        if situations[0].runs[0].level == "bench":
            runs = [bench_run(model, situation.runs[0], situation.start) for situation in longest]
            found = bench_motions_of(model, runs, self.study)
        else:
            found = self._robot_motions(model, longest, [members[0] for members in alike.values()])
        motions: dict[int, Motion] = {}
        for members, motion in zip(alike.values(), found, strict=True):
            motions |= dict.fromkeys(members, motion)
        return [motions[index] for index in range(len(situations))]

    def _robot_motions(
        self, model: Model, situations: Sequence[Situation], seeds: Sequence[int]
    ) -> list[Motion]:
        # A direction in the world makes the compiled model depend on where a run starts.
        by_heading = any(CATALOGUE[name].turned is not None for name in model.effects)
        common = None if by_heading else compile_robot(model, self.study)
        motions = []
        for situation, seed in zip(situations, seeds, strict=True):
            rng = np.random.default_rng((self.wheel_angle_seed, seed))
            angles = rng.uniform(0.0, 2.0 * np.pi, 4).tolist() if self.wheel_angle_seed else []
            local = in_run_frame(model, situation.start)
            compiled = common or compile_robot(local, self.study)
            motions.append(robot_motion(local, situation.runs[0], situation.start, compiled, angles))
        return motions


def _motion_key(situation: Situation, command_period_s: float) -> Hashable:
    """Return what a motion depends on; the times of the samples are not part of it."""
    run = situation.runs[0]
    rows = run.command_rows()
    since = run.held_since(command_period_s)[rows]
    commands = [values[rows].tobytes() for values in run.command.columns().values()]
    return (np.rint(since / command_period_s * 1e6).tobytes(), *commands, situation.start)


def model_key(model: Model) -> str:
    """Return a key of what a model's motion depends on."""
    physics = replace(model, uncertainty={}, provenance={}, extra={})
    return json.dumps(model_to_dict(physics), sort_keys=True)
