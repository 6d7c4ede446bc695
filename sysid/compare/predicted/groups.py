"""Which situations share a motion: one simulation, of the longest of them, serves them all."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns
from sysid.compare.measured import Situation
from sysid.compare.predicted.prediction import bench_run
from sysid.compare.predicted.robot import supply_of

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Alike:
    """Situations that share a motion."""

    members: Sequence[int]
    """Their indices."""
    longest: Situation


@dataclass(frozen=True, eq=False)
class Groups:
    """All situations, in groups that share a motion."""

    groups: tuple[Alike, ...]
    command_period_s: float
    by_voltage: bool

    @classmethod
    def of(
        cls, situations: Sequence[Situation], command_period_s: float, by_voltage: bool, by_heading: bool
    ) -> Groups:
        """Return the groups for a robot that latches commands with some period.

        `by_voltage`: the motion depends on the supply's voltage as well. `by_heading`: seen from the robot,
        it depends on where it heads when it starts.
        """
        alike: dict[Hashable, list[int]] = {}
        for index, situation in enumerate(situations):
            key = _motion_key(situation, command_period_s, by_voltage, by_heading)
            alike.setdefault(key, []).append(index)
        groups = (
            Alike(members, max((situations[i] for i in members), key=_duration_s))
            for members in alike.values()
        )
        return cls(tuple(groups), command_period_s, by_voltage)

    @cached_property
    def bench_runs(self) -> BenchRuns:
        """The longest run of each group, if these are bench logs."""
        return BenchRuns([self._bench_run(group.longest) for group in self.groups])

    def _bench_run(self, situation: Situation) -> BenchRun:
        run = situation.runs[0]
        supply = supply_of(run) if self.by_voltage else None
        return bench_run(run, situation.start, self.command_period_s, supply)

    def of_situations(self, found: Sequence[T]) -> list[T]:
        """Return for each situation what was found for its group."""
        shared: dict[int, T] = {}
        for group, one in zip(self.groups, found, strict=True):
            shared |= dict.fromkeys(group.members, one)
        return [shared[index] for index in range(len(shared))]


def _duration_s(situation: Situation) -> float:
    return situation.runs[0].duration_s


def _motion_key(
    situation: Situation, command_period_s: float, by_voltage: bool, by_heading: bool
) -> Hashable:
    """Return what a motion depends on; neither the times of the samples nor the place are part of it.

    `by_voltage`: the supply's voltage is. `by_heading`: so is where the robot heads when it starts.
    """
    run, start = situation.runs[0], situation.start
    began = (start.initial_rpm, start.moving, start.wheels_rpm, start.yaw_rad if by_heading else 0.0)
    rows = run.command_rows()
    since = run.held_since(command_period_s)[rows]
    commands = [values[rows].tobytes() for values in run.command.columns().values()]
    supply = supply_of(run) if by_voltage else None
    volts = supply and (supply.time_s.tobytes(), supply.voltage_v.tobytes(), supply.full_v)
    return (np.rint(since / command_period_s * 1e6).tobytes(), *commands, began, volts)
