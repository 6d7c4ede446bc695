"""The whole task for n episodes side by side: opponent, judge, sensors and physics.

The single environment is an arena with one row, so one and many run the same code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.law.link import MOST_SEEDS
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM, ActionMode, action_to_command, check_mode
from mecanum_env.tankendo.chance import DRAWN, Chance, Start
from mecanum_env.tankendo.constants import Opponent, RewardWeights, Rules, Sensors
from mecanum_env.tankendo.judge import TERMS, Dodge, Duel, Judge, Track
from mecanum_env.tankendo.observation import EXTRA_LIMIT, LIMITS, NOISY, Instruments
from mecanum_env.tankendo.opponent import Fighter
from mecanum_env.tankendo.opponents import Opponents
from mecanum_env.tankendo.plant import Compiled, RobotBatch
from mecanum_env.tankendo.scene import BoolArray, Scenes, wrapped
from mecanum_env.tankendo.sensing import Sensing, longest_delay_s
from mecanum_env.units import FloatArray

TaskName = Literal["dodge", "track", "duel"]
_JUDGES: Final[Mapping[TaskName, type[Judge]]] = {"dodge": Dodge, "track": Track, "duel": Duel}


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


@dataclass(frozen=True)
class Step:
    """The result of a step; the first axis of each array is the episode."""

    observation: npt.NDArray[np.float32]
    reward: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    info: dict[str, npt.NDArray[Any]]


class Arena:
    """n episodes side by side, whose physics is stepped by a number of threads.

    Raises:
        InputError: a time limit shorter than one step.
    """

    def __init__(self, setting: TaskSetting, compiled: Compiled, n: int, threads: int = 1) -> None:
        self.setting, self.n = setting, n
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
        self.robots = RobotBatch(compiled, n, threads)
        drawn_from = setting.opponent if setting.opponents is None else setting.opponents
        self.chance = Chance(n, self._steps, NOISY, drawn_from, setting.rules)
        oldest = max(setting.sensors.delay_s, drawn_from.sight_delay_s + self.step_s)
        if setting.senses is not None:
            oldest = max(oldest, longest_delay_s(setting.senses) + self.step_s)
        self.scenes = Scenes(n, self.step_s, oldest)
        self.fighter = Fighter(n, setting.opponent, setting.rules, self.chance, self.scenes, self.step_s)
        judge = _JUDGES[setting.task]
        self.judge = judge(n, setting.rules, setting.weights, self.fighter, self.scenes, self.chance)
        self.instruments = Instruments(setting.sensors, self.step_s, self.judge.extra_observations)
        age_s = setting.sensors.delay_s
        self.sensing: Sensing | None = None
        if setting.senses is not None:
            self.sensing = Sensing(setting.senses, n, self._steps, self.step_s, age_s)
        """The robots' senses; None where the sensors' picture is observed."""
        self.step_count = np.zeros(n, np.intp)
        """Steps since each episode began, shape (n,)."""
        self.commands = np.zeros((n, 3))
        """The last commands: V [rpm], theta [deg], VC [rpm]."""
        self._shares = np.zeros((3, n))  # the same as shares of the full command
        self._all = np.arange(n)
        self.begun = np.zeros(n, bool)
        """Whether an episode has ever begun in each row."""
        self.hit, self.succeeded, self.ended = (np.zeros(n, bool) for _ in range(3))
        """Whether the last step brought a hit, a success, or the end of the episode."""

    def restart(
        self, row: int, rng: np.random.Generator, compiled: Compiled | None = None, start: Start = DRAWN
    ) -> None:
        """Begin a new episode in one row, with its own robot or, if `compiled` is None, the common one.

        The environment's generator `rng` is the only source of randomness. The seed of a link that jitters or
        loses commands comes last, so that opponent and noise are those of a robot with a perfect link.
        """
        opponent = self.chance.draw(row, rng, start)
        if self.sensing is not None:
            self.sensing.restart(row, rng)
        robot = self._common if compiled is None else compiled
        if robot.has_random_link:
            robot = robot.with_link_seed(int(rng.integers(MOST_SEEDS)))
        self._begin(row, robot, opponent)

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
        for copy in range(n):
            other._begin(copy, robot, opponent)
        return other

    def _begin(self, row: int, robot: Compiled, opponent: Opponent) -> None:
        """Begin the episode that has been drawn in a row."""
        x, y, yaw = self.chance.start_pose[:, row]
        self.robots.restart(row, (x, y, yaw), robot)
        opponent_x = x + self.chance.start_distance[row]
        self.scenes.restart(row, [x, y, yaw, 0, 0, 0, opponent_x, y, np.pi, 0, 0])
        self.fighter.restart(row, opponent)
        self.judge.restart(row)
        self.instruments.restart(row, self.robots.model_of(row))
        self.begun[row] = True
        self.step_count[row] = 0
        self._shares[:, row] = self.commands[row] = 0.0
        self.hit[row] = self.succeeded[row] = self.ended[row] = False

    def step(self, actions: npt.NDArray[np.floating]) -> Step:
        """Send one command to each robot by its action, shape (n, 3), and simulate one command period."""
        start_s = self.time_s()
        fighter, judge = self.fighter, self.judge
        commands = action_to_command(actions, self.setting.action_mode, self._quantum_rpm)
        fighter.decide(start_s, judge.may_strike(start_s))
        opponent = fighter.walk(start_s, judge.stands(), judge.walk_velocity(start_s))
        self.robots.step(commands)
        motion = self.robots.motion()
        before = self.scenes.now[2].copy()
        newest = self.scenes.push()
        newest[:6], newest[6:] = motion, opponent
        newest[2] = before + wrapped(motion[2] - before)
        self.step_count += 1
        end_s = self.time_s()
        fighter.aim(end_s)
        shares = _command_shares(commands)
        change = shares - self._shares
        effort = np.sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
        self._shares, self.commands = shares, commands
        verdict = judge.judge(end_s, effort)
        outcome = verdict.outcome
        truncated = ~outcome.terminated & (self.step_count >= self._steps)
        self.hit, self.succeeded = outcome.hit.copy(), outcome.success.copy()
        self.ended = outcome.terminated | truncated
        info = {f"reward_{name}": verdict.terms[name] for name in TERMS}
        info |= {"is_success": outcome.success, "hit": outcome.hit} | self.state_info()
        return Step(self.observe(), verdict.reward, outcome.terminated, truncated, info)

    def time_s(self) -> FloatArray:
        """Return the time since each episode began, shape (n,) [s]."""
        return np.asarray(self.step_count * self.step_s, float)

    def observe(self) -> npt.NDArray[np.float32]:
        """Return what the sensors show now, shape (n, k)."""
        # A row that waits for its reset may be past its time limit.
        noise = self.chance.noise[np.minimum(self.step_count, self._steps), :, self._all].T
        sword, extra = self.fighter.sword, self.judge.observe()
        if self.sensing is None:
            return self.instruments.observe(self.scenes, self.time_s(), sword, self._shares, noise, extra)
        truth = self.instruments.observe(
            self.scenes, self.time_s(), sword, self._shares, np.zeros_like(noise), extra
        )
        return self.sensing.observe(truth, self.scenes, self.time_s(), sword)

    def state_info(self) -> dict[str, npt.NDArray[Any]]:
        """Return what `info` says of the present state: arrays (n,) by name."""
        distance, bearing = self.scenes.separation()
        sword = self.fighter.sword
        return {
            "distance_m": distance,
            "bearing_rad": bearing,
            "technique": np.where(sword.is_feint, -1, self.fighter.technique()),
            "warning_s": np.where(sword.is_feint, 0.0, sword.land_s - sword.raise_s),
            **self.judge.report(),
        }


def _command_shares(commands: FloatArray) -> FloatArray:
    """Return commands (n, 3) as shares of the full ones: forward, left, turn, shape (3, n)."""
    v, angle = commands[:, 0] / FULL_V_RPM, np.deg2rad(commands[:, 1])
    return np.array([v * np.cos(angle), v * np.sin(angle), commands[:, 2] / FULL_VC_RPM])
