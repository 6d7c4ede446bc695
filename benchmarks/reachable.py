"""How much of a certificate's bound can be reached without knowing the future, and why fights are lost.

Example: python benchmarks/reachable.py --controllers told varied mpc --episodes 200

`told` is the planner `mpc` that is told the true robot, the true opponent and the range of its warnings, but
like any controller sees the strike only through the sensors: what a policy may hope for. The oracle, whose
success is the bound, knows the strike before it comes. The episodes of a row are those of a certificate.

A hit is put down to the first of these that holds: `late`, the robot changed its velocity by 0.3 m/s less
than 0.2 s before the hit; `led`, it moved so early that the opponent, which aims ahead, saw it; `edge`, it
was at the edge of the field; `returning`, it was on its way back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.model import paper_model
from mecanum_env.statistics import wilson_interval
from mecanum_env.tankendo import opponent_for
from mecanum_env.tankendo.actions import command_to_action
from mecanum_env.tankendo.arena import Arena
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.certify.plants import HELD_OUT, RobotVariant
from training.certify.variations import certificate_variants
from training.controllers.features import stack_features
from training.controllers.interface import Controller
from training.controllers.mpc import Mpc, Planning
from training.controllers.named import make_controller
from training.controllers.oracle import Oracle
from training.controllers.policy import Network, load_policy, policy_path

ALSO: Final = ("nominal", "robot-level", "latency+0.1s")
"""Rows that are played beside those that are held out."""
_STARTED_M_S: Final = 0.3
_LATE_S: Final = 0.2
_EDGE_M: Final = 0.3
_RETURNING_M_S: Final = -0.2


class Side(Protocol):
    """Who commands all robots of an arena."""

    def act(self, observation: npt.NDArray[np.floating]) -> FloatArray:
        """Return the actions for observations, shape (n, k)."""


class NetworkSide:
    """A policy's network for all robots at once."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._memory: FloatArray | None = None

    def act(self, observation: npt.NDArray[np.floating]) -> FloatArray:
        """Return the actions for observations, shape (n, k)."""
        self._memory = stack_features(self._memory, self._network.features(observation), self._network.stack)
        return self._network.actions(self._memory)


class EachSide:
    """A controller for each robot."""

    def __init__(self, arena: Arena, make: Callable[[Arena, int], Controller]) -> None:
        self._controllers = [make(arena, row) for row in range(arena.n)]
        for one in self._controllers:
            one.reset()

    def act(self, observation: npt.NDArray[np.floating]) -> FloatArray:
        """Return the actions for observations, shape (n, k)."""
        pairs = zip(self._controllers, observation, strict=True)
        return np.array([command_to_action(np.array(one.act(seen))) for one, seen in pairs])


def told(arena: Arena, row: int) -> Mpc:
    """Return the planner that is told all but the future of the episode in an arena's row."""
    opponent = arena.fighter.opponents[row]
    planning = Planning(warning_s=opponent.warning_s)
    return Mpc(arena.robots.model_of(row), planning, opponent, is_exact=True)


def _network_of(name: str) -> Network | None:
    """Return the network of a policy, by its name or path; None for other controllers."""
    path = policy_path(name)
    return None if path is None else load_policy(path).network


def _maker(name: str) -> Callable[[Arena, int], Controller]:
    """Return what makes the controller `name` of an arena's row."""
    if name == "told":
        return told
    if name == "oracle":
        return Oracle
    return lambda *_: make_controller(name, paper_model())


def play(name: str, row: RobotVariant, episodes: int) -> Counter[str]:
    """Return how the episodes of a certificate's row end."""
    network = _network_of(name)
    env = TankendoVectorEnv(
        episodes,
        autoreset_mode="Disabled",
        action_mode="command" if network is None else network.action_mode,
        model=row.model,
        opponent=row.opponent,
        senses=row.senses,
        engine="arrays",
    )
    observation, _ = env.reset(seed=list(range(episodes)))
    arena = env.arena
    # The oracle looks at the episode that has begun.
    side: Side = EachSide(arena, _maker(name)) if network is None else NetworkSide(network)
    over, ends = np.zeros(episodes, bool), Counter[str]()
    past = [arena.scenes.now.copy()]
    while not over.all():
        step = arena.step(side.act(observation))
        observation = step.observation
        past.append(arena.scenes.now.copy())
        ended = (step.terminated | step.truncated) & ~over
        for one in np.flatnonzero(ended).tolist():
            ends[_end_of(arena, one, np.array([scene[:, one] for scene in past]))] += 1
        over |= ended
    return ends


def _end_of(arena: Arena, row: int, past: FloatArray) -> str:
    """Return how the episode in a row ended, whose scenes were `past`, shape (steps + 1, 11)."""
    if arena.succeeded[row]:
        return "won"
    if not arena.hit[row]:
        return "not hit"
    sword, rules, clock = arena.fighter.sword, arena.setting.rules, arena.step_s * np.arange(len(past))

    def at(seconds: float) -> FloatArray:
        return np.array([np.interp(seconds, clock, numbers) for numbers in past.T])

    rise, land = float(sword.raise_s[row]), float(sword.land_s[row])
    seen = at(float(sword.cut_s[row] - arena.fighter.sight_delay_s[row]))
    first, last = at(rise), at(land)
    change = [np.hypot(*(at(time)[3:5] - first[3:5])) for time in np.arange(rise, land - _LATE_S, 0.02)]
    if not change or max(change) < _STARTED_M_S:
        return "late"
    if np.hypot(*(seen[3:5] - first[3:5])) > _STARTED_M_S:
        return "led"
    if np.abs(last[:2]).max() > rules.field_m / 2 - _EDGE_M:
        return "edge"
    away = first[:2] - sword.origin[:, row]
    return "returning" if last[3:5] @ away / np.hypot(*away) < _RETURNING_M_S else "otherwise"


def main(
    controllers: tuple[str, ...] = ("told", "mpc", "creep", "varied"),
    episodes: int = 100,
    rows: tuple[str, ...] = (),
    warnings: tuple[float, ...] = (),
    out: Path = Path("out/bench/reachable.json"),
) -> None:
    """Play controllers on the held-out rows of a certificate, and divide their failures.

    Args:
        controllers: told, oracle, names of controllers or bundled policies, or files of policies.
        episodes: Number of episodes of each row, with the seeds 0, 1, ...
        rows: Rows to play; by default those held out, the nominal one, and the slow and the late robot.
        warnings: Warning times [s] with each of which the nominal row is played, too.
        out: JSON file to write.
    """
    usual = opponent_for("normal")
    known = certificate_variants(paper_model(), "planar", usual)
    chosen = [
        one for one in known if (one.name in rows if rows else one.group == HELD_OUT or one.name in ALSO)
    ]
    nominal = next(one for one in known if one.name == "nominal")
    chosen += [
        replace(nominal, name=f"warning {one:.2f} s", opponent=replace(usual, warning_s=(one, one)))
        for one in warnings
    ]
    found: dict[str, dict[str, dict[str, int]]] = {}
    for name in controllers:
        for row in chosen:
            ends = play(name, row, episodes)
            found.setdefault(name, {})[row.name] = dict(ends)
            low, high = wilson_interval(ends["won"], episodes)
            why = ", ".join(f"{end} {count}" for end, count in ends.most_common() if end != "won")
            print(f"{name:12} {row.name:14} {ends['won'] / episodes:.2f} ({low:.2f} .. {high:.2f})  {why}")
            write_json(out, found)
    print(f"wrote {out}")


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/reachable.py"))
