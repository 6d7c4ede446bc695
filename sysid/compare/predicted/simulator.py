"""Simulation of all situations of a study; motions are shared by models that differ in their sensors only."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock
from typing import Final, TypeAlias, TypeVar

import mujoco
import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.apply import sensors_of, without_sensors
from mecanum_env.model import Model
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, FreeWheel, FreeWheels
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations
from sysid.compare.predicted.gap_start import FromGap, SeenSpeed, motions_from_gap, starts_in_gap
from sysid.compare.predicted.groups import Alike, Groups
from sysid.compare.predicted.motion import Motion, bench_motions_of
from sysid.compare.predicted.prediction import bench_run, in_run_frame, readings
from sysid.compare.predicted.robot import CompiledRobot, follows_voltage, supply_of
from sysid.compare.predicted.settings import SimulationSettings

_DRAWS: Final = 4  # sets of initial wheel angles that are simulated
_AVERAGED: Final = 2
"""Sets of initial wheel angles beside those of 0 in an average. Assumed: the rollers' chance part falls to
1 / sqrt(3), for three times the simulations."""
_MOTIONS_KEPT: Final = 8  # number of models whose motions are kept; those of one model take some megabytes
_PREDICTIONS_BYTES: Final = 1e8  # size of the predictions that are kept, about 0.1 MB for a model

Starts: TypeAlias = tuple[float, ...]
"""Place in the gap at which each situation starts, from -1 to 1; empty: all start in the middle."""
MIDDLE: Final[Starts] = ()

T = TypeVar("T")


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
        settings: SimulationSettings | None = None,
        wheel_angle_seed: int = 0,
    ) -> None:
        self.observations, self.wheel_angle_seed = observations, wheel_angle_seed
        self.settings = settings or SimulationSettings()
        self._motions: OrderedDict[Hashable, list[Motion]] = OrderedDict()
        self._predictions: OrderedDict[Hashable, list[FloatArray]] = OrderedDict()
        self._wheels: OrderedDict[Hashable, FreeWheel] = OrderedDict()
        self._gaps: OrderedDict[Hashable, FromGap | None] = OrderedDict()
        self._groups: dict[tuple[float, bool, bool], Groups] = {}
        self._lock = Lock()

    def predictions(self, model: Model, *, starts: Starts | None = None) -> list[FloatArray]:
        """Return what a model predicts for each block, each of the block's shape (m,).

        A wheel on the bench starts where in its gap each run shows it to, or at given `starts`: then
        predictions do not depend on what was measured.

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
            SimulationDivergedError: the state stopped being finite.
        """
        key = model_key(model)
        return self._remembered(
            self._predictions,
            (key, starts),
            lambda: self._predict(model, key, starts),
            self._predictions_kept,
        )

    def starts(self, model: Model) -> Starts | None:
        """Return where in a model's gap the runs on the bench show that they start; None without a gap.

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
            SimulationDivergedError: the state stopped being finite.
        """
        found = self._from_gap(model, model_key(model))
        return None if found is None else found.places if any(found.places) else MIDDLE

    def _predict(self, model: Model, key: Hashable, starts: Starts | None) -> list[FloatArray]:
        alone, sensors = without_sensors(model), sensors_of(model)
        if starts is None:
            found = self._from_gap(model, key)
            motions = None if found is None else found.motions
        else:
            motions = self._from_places(alone, starts)
        if motions is None:
            motions = self._remembered(
                self._motions,
                key if alone is model else model_key(alone),
                lambda: self._simulate(alone),
                _MOTIONS_KEPT,
            )
        # Situations with the same commands share a motion, which is seen once.
        seen = {id(motion): motion.seen_by(sensors) for motion in motions}
        return self._read([seen[id(motion)] for motion in motions])

    def predictions_of(
        self, wheels: FreeWheels, command_period_s: float
    ) -> Iterator[list[FloatArray] | None]:
        """Yield for each of several wheels on the bench what `predictions` returns, None if it has no motion.

        They start in the middle of any gap, do not depend on the voltage, and latch commands with one period.
        """
        groups = self._groups_of(command_period_s)
        for found in wheels.motions(groups.bench_runs):
            motions = [Motion(clock, {"speed_rpm": speed}) for clock, speed in found or ()]
            yield self._read(groups.of_situations(motions)) if found else None

    def _read(self, motions: Sequence[Motion]) -> list[FloatArray]:
        """Return what the motions of all situations, as sensors see them, are at each block's samples."""
        situations = self.observations.situations
        return self.observations.predicted(
            [
                readings(motion, situation.runs[0], situation.start)
                for situation, motion in zip(situations, motions, strict=True)
            ]
        )

    @cached_property
    def _voltage_logged(self) -> bool:
        """Whether any situation has a supply whose voltage was logged."""
        return any(supply_of(situation.runs[0]) is not None for situation in self.observations.situations)

    @cached_property
    def _predictions_kept(self) -> int:
        """Number of models whose predictions are remembered."""
        values = sum(block.value.size for block in self.observations.blocks)
        return max(1, int(_PREDICTIONS_BYTES / (8 * values)))

    def _remembered(
        self, kept: OrderedDict[Hashable, T], key: Hashable, work: Callable[[], T], most: int
    ) -> T:
        """Return the result of `work`, which is `kept` for the latest `most` keys."""
        with self._lock:
            if key in kept:
                kept.move_to_end(key)
                return kept[key]
        found = work()
        with self._lock:
            kept[key] = found
            while len(kept) > most:
                kept.popitem(last=False)
        return found

    def unknown_starts(self, model: Model) -> frozenset[int]:
        """Return the situations in which a model's wheel starts at a place in its gap that nobody knows.

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
        """
        if self._wheel_in_gap(model) is None:
            return frozenset()
        situations = self.observations.situations
        return frozenset(i for i, one in enumerate(situations) if one.start.initial_rpm == 0.0)

    def _wheel_in_gap(self, model: Model) -> FreeWheel | None:
        """Return a model's wheel on the bench, if it starts anywhere in a gap."""
        if self.observations.situations[0].runs[0].level != "bench":
            return None
        wheel = self._wheel(model)
        return wheel if starts_in_gap(wheel) else None

    def _wheel(self, model: Model) -> FreeWheel:
        """Return a model's wheel on the bench."""
        return self._remembered(
            self._wheels,
            model_key(model),
            lambda: FreeWheel.of(model, timestep_s=self.settings.timestep_s),
            _MOTIONS_KEPT,
        )

    def _from_gap(self, model: Model, key: Hashable) -> FromGap | None:
        """Return how a model's wheel moves if it starts anywhere in a gap; None of another."""

        def work() -> FromGap | None:
            alone = without_sensors(model)
            wheel = self._wheel_in_gap(alone)
            if wheel is None:
                return None
            return motions_from_gap(wheel, self._asked(alone, wheel), self._seen, sensors_of(model))

        return self._remembered(self._gaps, key, work, _MOTIONS_KEPT)

    def _from_places(self, model: Model, starts: Starts) -> list[Motion] | None:
        """Return the motions of a model's wheel from places in its gap; None from the middle."""
        wheel = self._wheel_in_gap(model) if any(starts) else None
        if wheel is None:
            return None
        asked = self._asked(model, wheel)
        return bench_motions_of(
            wheel,
            BenchRuns([replace(run, gap_share=place) for run, place in zip(asked, starts, strict=True)]),
        )

    def _asked(self, model: Model, wheel: FreeWheel) -> list[BenchRun]:
        """Return what a model's wheel is commanded in each situation."""
        period = model.wheel.command_period_s
        return [
            bench_run(one.runs[0], one.start, period, supply_of(one.runs[0]) if wheel.reads_voltage else None)
            for one in self.observations.situations
        ]

    @cached_property
    def _seen(self) -> list[SeenSpeed]:
        """The measured speeds of bench logs."""
        return [SeenSpeed.of(situation.runs) for situation in self.observations.situations]

    def _simulate(self, model: Model) -> list[Motion]:
        if self.observations.situations[0].runs[0].level == "bench":
            wheel = self._wheel(model)
            by_voltage = self._voltage_logged and wheel.reads_voltage
            groups = self._groups_of(model.wheel.command_period_s, by_voltage=by_voltage)
            return groups.of_situations(bench_motions_of(wheel, groups.bench_runs))
        # A direction in the world makes the motion depend on where a run starts.
        by_heading = any(CATALOGUE[name].turned is not None for name in model.effects)
        by_voltage = self._voltage_logged and follows_voltage(model)
        period = model.wheel.command_period_s
        groups = self._groups_of(period, by_voltage=by_voltage, by_heading=by_heading)
        return groups.of_situations(self._robot_motions(model, groups, by_heading))

    def _groups_of(
        self, command_period_s: float, *, by_voltage: bool = False, by_heading: bool = False
    ) -> Groups:
        """Return the situations that share a motion; see `Groups.of`."""
        key = command_period_s, by_voltage, by_heading
        if key not in self._groups:
            self._groups[key] = Groups.of(self.observations.situations, *key)
        return self._groups[key]

    def _robot_motions(self, model: Model, groups: Groups, by_heading: bool) -> list[Motion]:
        robots: dict[float, CompiledRobot] = {}
        motions = []
        for group in groups.groups:
            run, start = group.longest.runs[0], group.longest.start
            heading = start.yaw_rad if by_heading else 0.0
            if heading not in robots:
                robots[heading] = CompiledRobot(in_run_frame(model, start), self.settings)
            motions.append(robots[heading].motion(run, start, self._wheel_angles(group)))
        return motions

    def _wheel_angles(self, group: Alike) -> tuple[float, ...]:
        """Return the initial angles of the four wheels [rad] in a group; none if they are 0."""
        if not self.wheel_angle_seed:
            return ()
        rng = np.random.default_rng((self.wheel_angle_seed, group.members[0]))
        return tuple(rng.uniform(0.0, 2.0 * np.pi, 4).tolist())


def model_key(model: Model) -> Hashable:
    """Return a key of what a model's motion depends on, its sensors included."""
    effects = tuple((name, tuple(sorted(model.effects[name].items()))) for name in sorted(model.effects))
    return model.wheel, model.robot, effects, tuple(sorted(model.wheels.items())), model.custom


@dataclass(frozen=True, eq=False)
class Averaged:
    """The mean of what several simulators predict, in which what rollers do by chance is smaller."""

    simulators: tuple[Simulator, ...]

    def predictions(self, model: Model) -> list[FloatArray]:
        """Return what a model predicts for each block, each of the block's shape (m,).

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
            SimulationDivergedError: the state stopped being finite.
        """
        found = [one.predictions(model) for one in self.simulators]
        return [np.mean(parts, axis=0) for parts in zip(*found, strict=True)]


@dataclass(frozen=True, eq=False)
class Simulators:
    """What simulates the observations of a problem."""

    full: Simulator
    planar: Simulator | None
    """A surrogate on the planar plant, where the robot is on rollers."""
    turned: tuple[Simulator, ...]
    """The rollers again, with other initial wheel angles."""

    @classmethod
    def of(cls, observations: Observations, settings: SimulationSettings) -> Simulators:
        """Return the simulators of some observations."""
        full = Simulator(observations, settings)
        if observations.situations[0].runs[0].level == "bench" or settings.plant != "rollers":
            return cls(full, None, ())
        turned = (Simulator(observations, settings, wheel_angle_seed=1 + draw) for draw in range(_DRAWS))
        return cls(full, Simulator(observations, replace(settings, plant="planar")), tuple(turned))

    @property
    def averaged(self) -> Averaged:
        """The full simulation, on rollers averaged over initial wheel angles."""
        return Averaged((self.full, *self.turned[:_AVERAGED]))

    def smooth(self, model: Model) -> list[FloatArray]:
        """Return the predictions of a model by the fastest simulation, which is smooth in its parameters.

        Raises:
            InputError: an effect that cannot be simulated, or a value out of range.
            SimulationDivergedError: the state stopped being finite.
        """
        return (
            self.full.predictions(model)
            if self.planar is None
            else self.planar.predictions(planar_part(model))
        )


def planar_part(model: Model) -> Model:
    """Return a model without the effects that the planar plant refuses."""
    simulated = {name: v for name, v in model.effects.items() if "planar" not in CATALOGUE[name].refused_by}
    return replace(model, effects=simulated)
