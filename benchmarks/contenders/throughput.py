"""Environment steps a second: our batches against Gymnasium's vector environments and a stock task."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from tqdm import tqdm

from contenders.table import Table, number, over, spread
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.vector import TankendoVectorEnv

STOCK: Final = "HalfCheetah-v5"
"""Task of Gymnasium for scale: nine degrees of freedom with contacts, five physics steps a control step."""
OURS: Final = "ours: arrays"
BATCH: Final = "ours: MuJoCo batch"
TITLE: Final = "Throughput: environment steps a second"
HEAD: Final = ("environment", "robots", "steps/s", "our arrays over it", "simulated s per s")

VectorEnv = gymnasium.vector.VectorEnv[Any, Any, Any]


@dataclass(frozen=True)
class Row:
    """One vector environment."""

    name: str
    robots: int
    make: Callable[[], VectorEnv]
    steps: int
    """Steps of each robot in a round."""
    period_s: float
    """Simulated time of one step [s]."""


def rows(many: int, few: int, steps: int, workers: int) -> list[Row]:
    """Return the environments: ours with `many` robots as arrays, the others with `few` each."""

    def planar() -> gymnasium.Env[Any, Any]:
        return TankendoEnv(plant="planar")

    def stock() -> gymnasium.Env[Any, Any]:
        return gymnasium.make(STOCK)

    # A stock task's period, read off it.
    with ExitStack() as stack:
        task = stock()
        stack.callback(task.close)
        assert isinstance(task.unwrapped, MujocoEnv)
        period_s = float(task.unwrapped.dt)
    return [
        Row(OURS, many, lambda: TankendoVectorEnv(many, engine="arrays"), steps, 0.1),
        Row("ours: arrays, few robots", few, lambda: TankendoVectorEnv(few, engine="arrays"), steps, 0.1),
        Row(BATCH, few, lambda: TankendoVectorEnv(few), steps, 0.1),
        Row("Gymnasium Sync over ours", few, lambda: SyncVectorEnv([planar] * few), steps, 0.1),
        Row(
            "Gymnasium Async over ours",
            workers,
            lambda: AsyncVectorEnv([planar] * workers),
            steps,
            0.1,
        ),
        Row(f"Gymnasium Sync, {STOCK}", few, lambda: SyncVectorEnv([stock] * few), steps, period_s),
    ]


def player(env: VectorEnv, robots: int, steps: int) -> Callable[[], float]:
    """Return what plays a round of random actions and returns environment steps a second, by the clock.

    Resets are within, as Gymnasium does them by itself.
    """
    env.reset(seed=0)
    space = env.single_action_space
    assert isinstance(space, gymnasium.spaces.Box)
    low, high = np.maximum(space.low, -0.3), np.minimum(space.high, 0.3)
    drawn = np.random.default_rng(0).uniform(low, high, (steps, robots, *space.shape))
    actions = drawn.astype(np.float32)

    def play() -> float:
        begin = time.perf_counter()
        for action in actions:
            env.step(action)
        return steps * robots / (time.perf_counter() - begin)

    return play


def measure(repeats: int, many: int, few: int, steps: int, workers: int) -> Table:
    """Measure all environments, by turns.

    Args:
        repeats: rounds; one more before them is not counted.
        many: robots of the arrays.
        few: robots of the other environments.
        steps: steps of each robot in a round.
        workers: processes of the asynchronous environment, one robot each.
    """
    measured = rows(many, few, steps, workers)
    with ExitStack() as stack:
        plays = {}
        for row in measured:
            env = row.make()
            stack.callback(env.close)
            plays[row.name] = player(env, row.robots, row.steps)
        rates: dict[str, list[float]] = {row.name: [] for row in measured}
        for turn in tqdm(range(repeats + 1), desc="throughput", unit="round", disable=None):
            for name, play in plays.items():
                rate = play()
                if turn:
                    rates[name].append(rate)
    return table(measured, rates)


def table(measured: list[Row], rates: dict[str, list[float]]) -> Table:
    """Return the table of measured rates."""
    cells = [
        (
            row.name,
            number(row.robots),
            str(spread(rates[row.name])),
            str(over(rates[OURS], rates[row.name])),
            number(spread(rates[row.name]).median * row.period_s),
        )
        for row in measured
    ]
    slower = [
        f"{row.name} makes more steps a second than our arrays."
        for row in measured
        if over(rates[row.name], rates[OURS]).median > 1.0
    ]
    ratio = over(rates[f"Gymnasium Sync, {STOCK}"], rates[BATCH])
    slower.append(
        f"Per step the stock task is {ratio} times as fast as our MuJoCo batch; a step of it simulates "
        f"{measured[-1].period_s:g} s, and one of ours 0.1 s with an opponent and its rules."
    )
    about = (
        "Random actions, resets included, rounds by turns, by the clock. *Ours* is the Tankendo task on\n"
        'the planar robot: as arrays (`engine="arrays"`), as one batch of MuJoCo on one thread (the\n'
        "default), and as single environments inside Gymnasium's own vector environments, of which Async\n"
        "has one process a robot. Ratios are within a round: median (least .. largest)."
    )
    return Table(TITLE, about, HEAD, tuple(cells), rates, tuple(slower))
