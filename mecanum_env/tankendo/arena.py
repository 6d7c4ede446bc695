"""The whole task for n episodes side by side: opponent, judge, sensors and physics.

The single environment is an arena with one row, so one and many run the same code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from mecanum_env.batch import PlanarBatch, PlanarRobot
from mecanum_env.errors import InputError, require_one_of
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.tankendo.actions import ActionMode, check_mode, command_numbers, command_shares
from mecanum_env.tankendo.chance import DRAWN, Chance, Start
from mecanum_env.tankendo.constants import Opponent, RewardWeights, Rules, Sensors
from mecanum_env.tankendo.fighter import Fighter
from mecanum_env.tankendo.judge import TERMS, Dodge, Duel, Judge, Track
from mecanum_env.tankendo.numbers import Number, mathematics, wrapped
from mecanum_env.tankendo.observation import EXTRA_LIMIT, LIMITS, NOISY, SIZE, Instruments
from mecanum_env.tankendo.opponents import Opponents
from mecanum_env.tankendo.plant import Compiled, RobotBatch
from mecanum_env.tankendo.scene import RowArray, Scenes
from mecanum_env.tankendo.sensing import Sensing, longest_delay_s
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.link import MOST_SEEDS

Robot = Compiled | PlanarRobot
TaskName = Literal["dodge", "track", "duel"]
_JUDGES: Final[Mapping[TaskName, type[Judge]]] = {"dodge": Dodge, "track": Track, "duel": Duel}

_REWARDS: Final = tuple(f"reward_{name}" for name in TERMS)


@dataclass(frozen=True)
class TaskSetting:
    """What is the same in every episode; the environment that was made runs with exactly these."""

    task: TaskName
    opponent: Opponent
    rules: Rules
    sensors: Sensors
    weights: RewardWeights
    action_mode: ActionMode
    opponents: Opponents | None = None
    """The distribution from which the opponent of each episode is drawn; None: always `opponent`."""
    senses: Senses | VariedSenses | None = None
    """Cameras and odometry with an estimator behind them; None: `sensors` as they are."""

    def __post_init__(self) -> None:
        require_one_of("task", self.task, _JUDGES)
        check_mode(self.action_mode)

    @property
    def observation_limits(self) -> npt.NDArray[np.float32]:
        """Largest absolute value of each number of an observation, shape (k,)."""
        extra = np.full(_JUDGES[self.task].extra_observations, EXTRA_LIMIT)
        return np.concatenate([LIMITS, extra]).astype(np.float32)


class Step(NamedTuple):
    """The result of a step; the first axis of each array is the episode.

    `Arena.step` gives arrays, `Arena.advance` numbers of one episode or of many.
    """

    observation: npt.NDArray[np.float32]
    reward: Number
    terminated: Number
    truncated: Number
    info: dict[str, Number]


class Arena:
    """n episodes side by side.

    MuJoCo steps the physics of robots that were compiled for it, by a number of `threads`; robots that are
    numbers are stepped as arrays on a `device` of torch, or by numpy.

    Raises:
        InputError: a time limit shorter than one step.
    """

    _fighter: type[Fighter] = Fighter
    _judges: Mapping[TaskName, type[Judge]] = _JUDGES

    def __init__(
        self, setting: TaskSetting, compiled: Robot, n: int, threads: int = 1, device: str | None = None
    ) -> None:
        self.setting, self.n = setting, n
        self._math = mathematics(n)
        self.step_s = compiled.model.wheel.command_period_s
        self._quantum_rpm = compiled.model.wheel.command_quantum_rpm
        self.time_limit_s: float = getattr(setting.rules, f"{setting.task}_time_s")
        self._steps = round(self.time_limit_s / self.step_s)
        if self._steps < 1:
            raise InputError(
                f"rules: {setting.task}_time_s = {self.time_limit_s:g}, must be at least one command period, "
                f"{self.step_s:g} s"
            )
        self._common = compiled
        self.robots = self._open_robots(compiled, threads, device)
        drawn_from = setting.opponent if setting.opponents is None else setting.opponents
        judge = self._judges[setting.task]
        self.chance = Chance(n, NOISY, drawn_from, setting.rules, judge.exchanges)
        oldest = max(setting.sensors.delay_s, drawn_from.sight_delay_s + self.step_s)
        if setting.senses is not None:
            oldest = max(oldest, longest_delay_s(setting.senses) + self.step_s)
        self.scenes = Scenes(n, self.step_s, oldest)
        self.fighter = self._fighter(
            n, setting.opponent, setting.rules, self.chance, self.scenes, self.step_s
        )
        self.judge = judge(n, setting.rules, setting.weights, self.fighter, self.scenes, self.chance)
        self.instruments = Instruments(n, setting.sensors, self.step_s, self.judge.extra_observations)
        age_s = setting.sensors.delay_s
        self.sensing: Sensing | None = None
        if setting.senses is not None:
            self.sensing = Sensing(setting.senses, n, self._steps, self.step_s, age_s)
        """The robots' senses; None where the sensors' picture is observed."""
        self.step_count = np.zeros(n, np.intp)
        """Steps since each episode began, shape (n,)."""
        self.commands = np.zeros((n, 3))
        """The last commands: V [rpm], theta [deg], VC [rpm]."""
        self._shares = np.zeros((3, n))
        """The same as shares of the full command."""
        self.observed = np.zeros((n, SIZE + self.judge.extra_observations), np.float32)
        """What the sensors showed last, shape (n, k)."""
        self.begun = np.zeros(n, bool)
        """Whether an episode has ever begun in each row."""
        self.all_begun = False
        self.hit, self.succeeded, self.ended = (np.zeros(n, bool) for _ in range(3))
        """Whether the last step brought a hit, a success, or the end of the episode."""

    def _open_robots(self, compiled: Robot, threads: int, device: str | None) -> RobotBatch | PlanarBatch:
        """Return the physics of all rows."""
        if isinstance(compiled, PlanarRobot):
            return PlanarBatch(compiled, self.n, device)
        return RobotBatch(compiled, self.n, threads)

    def restart(
        self,
        rows: Sequence[int],
        rngs: Sequence[np.random.Generator],
        robots: Sequence[Robot] | None = None,
        start: Start = DRAWN,
    ) -> None:
        """Begin new episodes in some rows, each with its robot of `robots`; None: with the common one.

        The generators `rngs` of their environments are the only source of randomness. The seed of a link that
        jitters or loses commands comes last, so that opponent and noise are those of a robot with a perfect
        link.
        """
        at = np.array(rows, np.intp)
        opponents = self.chance.draw(at, rngs, start)
        if self.sensing is not None:
            for row, rng in zip(rows, rngs, strict=True):
                self.sensing.restart(row, rng)
        given = [self._common] * len(rows) if robots is None else list(robots)
        for i, rng in enumerate(rngs):
            if given[i].has_random_link:
                given[i] = given[i].with_link_seed(int(rng.integers(MOST_SEEDS)))
        self._begin(at, given, opponents)

    def copies(self, row: int, n: int) -> Arena:
        """Return an arena with n copies of the episode in a row as it was at its start, for rehearsals.

        Robot, opponent and all that is random are the same; the copies have no senses, observe no noise, and
        their actions are commands.
        """
        opponent = self.fighter.opponents[row]
        setting = replace(self.setting, opponent=opponent, opponents=None, senses=None, action_mode="command")
        robot = self.robots.compiled_of(row)
        other = Arena(setting, robot, n)
        other.chance.take(self.chance, row)
        other._begin(np.arange(n), [robot] * n, [opponent] * n)
        return other

    def _begin(self, at: RowArray, given: Sequence[Robot], opponents: Sequence[Opponent]) -> None:
        """Begin the episodes that have been drawn in some rows, with a robot and an opponent each."""
        poses = self.chance.start_pose[:, at]
        # An arena is given robots of the kind that its batch holds; the type of the batch does not tell.
        self.robots.restart_rows(at, poses, given)  # type: ignore[arg-type]
        self.scenes.restart(at, self._first_scenes(at))
        self.fighter.restart(at, opponents)
        self.judge.restart(at)
        self.instruments.restart(at.tolist(), given)
        self.begun[at] = True
        self.all_begun = bool(self.begun.all())
        self.step_count[at] = 0
        self._shares[:, at], self.commands[at] = 0.0, 0.0
        self.hit[at] = self.succeeded[at] = self.ended[at] = False

    def _first_scenes(self, at: RowArray) -> FloatArray:
        """Return the scenes at the start of the episodes in some rows (m,), shape (11, m)."""
        scenes, poses = np.zeros((11, len(at))), self.chance.start_pose[:, at]
        scenes[:3], scenes[6:8], scenes[8] = poses, poses[:2], np.pi
        scenes[6] += self.chance.start_distance[at]
        return scenes

    def _opponents(self, start_s: Number, seen: list[Number]) -> Sequence[Number]:
        """Return the five numbers of the opponents one step after a time: here they follow their script.

        The robots have moved by then; the newest scene is still that of the start, as `seen` by opponents.
        """
        judge = self.judge
        return self.fighter.walk(start_s, judge.stands(), seen, judge.walk_velocity(start_s))

    def step(self, actions: npt.NDArray[np.floating]) -> Step:
        """Send one command to each robot by its action, shape (n, 3), and simulate one command period."""
        step, array = self.advance(actions), self._math.array
        ends = array(step.terminated), array(step.truncated)
        return Step(step.observation, array(step.reward), *ends, self._arrays(step.info))

    def advance(self, actions: npt.NDArray[np.floating]) -> Step:
        """Do what `step` does with `actions`; rewards, ends and info are numbers of one or many episodes."""
        math, fighter, judge = self._math, self.fighter, self.judge
        start_s = self._now_s()
        command = command_numbers(
            math, math.of(np.asarray(actions, float).T), self.setting.action_mode, self._quantum_rpm
        )
        seen = fighter.seen()
        fighter.decide(start_s, judge.may_strike(start_s), seen)
        self.commands = math.table(command).T
        self.robots.step(self.commands)
        motion = math.of(self.robots.motion())
        opponents = self._opponents(start_s, seen)
        before = self.scenes.newest()[2]
        turned = before + wrapped(motion[2] - before)
        self.scenes.push([*motion[:2], turned, *motion[3:], *opponents])
        # Not in place: adding to an array of one number takes longer than all that is done with the number.
        math.put(self.step_count, math.of(self.step_count) + 1)
        end_s = self._now_s()
        fighter.aim(end_s)
        shares = command_shares(math, command)
        (forward, left, turn), (forward_before, left_before, turn_before) = shares, math.of(self._shares)
        forward, left, turn = forward - forward_before, left - left_before, turn - turn_before
        math.put(self._shares, shares)
        verdict = judge.judge(end_s, math.sqrt(forward**2 + left**2 + turn**2))
        outcome = verdict.outcome
        truncated = math.no(outcome.terminated) & (math.of(self.step_count) >= self._steps)
        math.put(self.hit, outcome.hit)
        math.put(self.succeeded, outcome.success)
        math.put(self.ended, outcome.terminated | truncated)
        info = dict(zip(_REWARDS, verdict.terms, strict=True))
        info |= {"is_success": outcome.success, "hit": outcome.hit, **self.state()}
        self.observed = self.observe()
        return Step(self.observed, verdict.reward, outcome.terminated, truncated, info)

    def time_s(self) -> FloatArray:
        """Return the time since each episode began, shape (n,) [s]."""
        return np.asarray(self.step_count * self.step_s, float)

    def _now_s(self) -> Number:
        return self._math.of(self.step_count) * self.step_s

    def observe(self) -> npt.NDArray[np.float32]:
        """Return what the sensors show now, shape (n, k)."""
        if self.sensing is None:
            return self.observe_plainly()
        truth = self._instruments_show(np.zeros_like(self.chance.noise.at(self._math.of(self.step_count))))
        return self.sensing.observe(truth, self.scenes, self.time_s(), self.fighter.sword)

    def observe_plainly(self) -> npt.NDArray[np.float32]:
        """Return what plain sensors show now, even where senses replace them, shape (n, k)."""
        return self._instruments_show(self.chance.noise.at(self._math.of(self.step_count)))

    def _instruments_show(self, noise: FloatArray) -> npt.NDArray[np.float32]:
        shares, extra = self._math.of(self._shares), self.judge.observe()
        return self.instruments.observe(self.scenes, self._now_s(), self.fighter.sword, shares, noise, extra)

    def observe_first(self, rows: RowArray) -> None:
        """Write what the sensors show of episodes that have just begun in some rows (m,) into `observed`."""
        self.observed[rows] = self._first_seen(rows)

    def _first_seen(self, rows: RowArray) -> npt.NDArray[np.float32]:
        """Return what the sensors show of episodes that have just begun in some rows (m,), shape (m, k)."""
        if self.sensing is not None or self.instruments.acts_on(rows):
            return self.observe()[rows]
        extra = [self._math.array(number)[rows] for number in self.judge.observe()]
        return self.instruments.observe_first(self.scenes.now[:, rows], self.chance.noise.first(rows), extra)

    def first_info(self, rows: RowArray) -> dict[str, npt.NDArray[Any]]:
        """Return what `state_info` says of episodes that have just begun in some rows (m,), arrays (m,)."""
        distance, bearing = self.scenes.separation()
        m, report = len(rows), self._arrays(self.judge.report())
        return {
            **{"distance_m": distance[rows], "bearing_rad": bearing[rows]},
            **{"technique": np.full(m, -1), "warning_s": np.zeros(m)},  # the sword is on guard
            **{name: values[rows] for name, values in report.items()},
        }

    def tip(self, row: int, ago_s: float = 0.0) -> FloatArray:
        """Return the tip of the opponent's sword in a row a time before now: x, y, z [m], shape (3,)."""
        tip, _ = self.fighter.sword.tip_and_velocity(self._now_s() - ago_s, self.scenes.seen(ago_s))
        return self._math.table(tip)[:, row]

    def state(self) -> dict[str, Number]:
        """Return what `info` says of the present state by name, as numbers of one episode or of many."""
        math, sword = self._math, self.fighter.sword
        distance, bearing = self.scenes.apart()
        is_feint = math.of(sword.is_feint)
        warning_s = math.of(sword.land_s) - math.of(sword.raise_s)
        return {
            "distance_m": distance,
            "bearing_rad": bearing,
            "technique": math.where(is_feint, -1, self.fighter.current(self.chance.technique)),
            "warning_s": math.where(is_feint, 0.0, warning_s),
            **self.judge.report(),
        }

    def state_info(self) -> dict[str, npt.NDArray[Any]]:
        """Return what `state` does as arrays (n,)."""
        return self._arrays(self.state())

    def _arrays(self, numbers: Mapping[str, Number]) -> dict[str, npt.NDArray[Any]]:
        return {name: self._math.array(number) for name, number in numbers.items()}
